"""Readers and writers, one file per format; every third-party log library behind one typed adapter.

`read_log` reads any supported log; `read_trajectory` any trajectory. Readers are imported when they are needed.
"""

from outrider.io.registry import SUPPORTED, detect, read_log

__all__ = ["SUPPORTED", "detect", "read_log"]
