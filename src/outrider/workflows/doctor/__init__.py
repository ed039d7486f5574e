"""What a log needs to be fused well: units, mounts, senses of rotation and clocks, found from the log itself."""

from outrider.workflows.doctor.examine import Examination, examine
from outrider.workflows.doctor.prescribe import prescribed, starter

__all__ = ["Examination", "examine", "prescribed", "starter"]
