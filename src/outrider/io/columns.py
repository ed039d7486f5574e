"""Columns of one length as a Parquet table."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from outrider.io.files import replacing


def write_columns(columns: Mapping[str, Any], path: Path) -> None:
    """A file that appears when it is complete."""
    import pyarrow as pa
    from pyarrow import parquet

    with replacing(path) as part, part.open("wb") as f:
        parquet.write_table(pa.table(dict(columns)), f, compression="zstd")
