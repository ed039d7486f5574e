"""What every record said against what the estimate expected, as one Parquet file for plots of one's own."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np

from outrider.data import Innovations, Run, Verdict
from outrider.io.files import replacing
from outrider.typing import Floats, Ints

CHUNK: Final = 1 << 17  # records written at a time: memory stays constant however long the log is


def write_innovations(run: Run, path: Path, *, force: bool = False) -> None:
    """Write one row per record and component.

    source, component, unit, verdict : text;  t_ns : int64;  z : the measurement in the site frame;  innovation, sigma :
    measured minus expected and its expected deviation, SI;  nis, dof : of the whole record, the same in all its rows.
    """
    import pyarrow as pa
    from pyarrow import parquet

    text = pa.dictionary(pa.int32(), pa.string())
    fields = [("source", text), ("component", text), ("unit", text), ("t_ns", pa.int64()), ("z", pa.float64())]
    fields += [(name, pa.float32()) for name in ("innovation", "sigma", "nis")]
    schema = pa.schema([*fields, ("dof", pa.int8()), ("verdict", text)])
    packing: dict[str, Any] = {"compression": "zstd", "use_dictionary": [f.name for f in schema if f.type == text]}
    packing["use_byte_stream_split"] = ["z", "innovation", "sigma", "nis"]  # a third smaller
    packing["column_encoding"] = {"t_ns": "DELTA_BINARY_PACKED"}
    with (
        replacing(path, force=force) as part,
        part.open("wb") as f,  # not by name, which for pyarrow must be UTF-8
        parquet.ParquetWriter(f, schema, **packing) as out,
    ):
        for source, i in run.innovations.items():
            for columns in _columns(source, i):
                out.write_table(pa.table(columns, schema=schema))


def _columns(source: str, i: Innovations) -> Iterator[dict[str, Any]]:
    """Chunks of one source, by column; components that a source never measured are left out."""
    from pyarrow import DictionaryArray

    verdicts = [v.name.lower() for v in sorted(Verdict)]
    for k, (component, unit) in enumerate(zip(i.columns, i.units, strict=True)):
        if not np.isfinite(i.y[:, k]).any():
            continue
        for begin in range(0, i.t.size, CHUNK):
            rows = slice(begin, begin + CHUNK)
            same = np.zeros(i.t[rows].size, np.int32)
            names = {"source": source, "component": component, "unit": unit}
            yield {
                **{name: DictionaryArray.from_arrays(same, [value]) for name, value in names.items()},
                "t_ns": i.t[rows],
                "z": i.z[rows, k],
                "innovation": i.y[rows, k].astype(np.float32),
                "sigma": i.s[rows, k].astype(np.float32),
                "nis": i.nis[rows].astype(np.float32),
                "dof": i.dof[rows].astype(np.int8),
                "verdict": DictionaryArray.from_arrays(i.verdict[rows].astype(np.int32), verdicts),
            }


def read_nis(path: Path) -> dict[str, tuple[Floats, Ints]]:
    """By source: NIS (n,) and degrees of freedom (n,) of the records that were used, or compared only.

    Empty for a file that is not there: an older run.
    """
    if not path.is_file():
        return {}
    from pyarrow import parquet

    with path.open("rb") as f:
        table = parquet.read_table(f, columns=["source", "component", "nis", "dof", "verdict"])
    source, component, verdict = (
        np.asarray(table[name].cast("string").to_pylist(), object) for name in ("source", "component", "verdict")
    )
    judged = (verdict == "used") | (verdict == "withheld")
    nis, dof = table["nis"].to_numpy().astype(np.float64), table["dof"].to_numpy().astype(np.int64)
    out: dict[str, tuple[Floats, Ints]] = {}
    for name in dict.fromkeys(source.tolist()):
        rows = judged & (source == name)
        if not rows.any():
            continue
        rows &= component == component[rows][0]  # each record once
        out[str(name)] = nis[rows], dof[rows]
    return out
