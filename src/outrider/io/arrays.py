"""NumPy and MATLAB arrays (.npy, .npz, .mat, folders of .npy) through the mapping file of `outrider.io.csv`.

A column is `NAME[k]`, the k-th column of an array (from 0), or `NAME` where the array is one column; NAME is the
variable (`GPS.lat` inside a structure), in a folder the path of the file, and nothing in a single .npy:

```yaml
streams:
  gyro:
    kind: IMU
    time: {column: "IMU/gyro/t"}
    columns: {gyro_x: "IMU/gyro/value[0]", gyro_y: "IMU/gyro/value[1]", gyro_z: "IMU/gyro/value[2]"}
```
"""

import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, cast, final

import numpy as np

from outrider.data import EventLog, Stream
from outrider.errors import ConfigError, DataError
from outrider.io._matlab import read_matlab
from outrider.io._table import Rows
from outrider.io.csv import CsvMapping, StreamColumns, load_mapping, stream_of, wanted
from outrider.io.files import Progress, assemble, closest, ensure_readable, is_directory
from outrider.io.stamps import UNITS_NS
from outrider.typing import Bools, Floats, Ints

NUMPY: Final = b"\x93NUMPY"
COLUMN: Final = re.compile(r"(?P<name>.*?)(\[(?P<index>\d+)\])?")
LIMIT: Final = 2.0**62  # ns


@final
@dataclass(slots=True)
class Arrays:
    """Arrays of a file by name; those of a folder are read when asked for."""

    path: Path
    known: dict[str, Any] = field(default_factory=dict[str, Any])

    @classmethod
    def of(cls, path: Path) -> "Arrays":
        """Open a file or folder. Raises `DataError` if it cannot be read."""
        if is_directory(path):
            return cls(path)
        head = ensure_readable(path).open("rb")
        with head as f:
            begin = f.read(20)
        if begin.startswith(NUMPY):
            return cls(path, _fields("", _loaded(path, _numpy)))
        loader = _npz if begin.startswith(b"PK") else _matlab
        if b"MATLAB 7.3" in begin or begin.startswith(b"\x89HDF"):
            raise DataError("is a MATLAB 7.3 file, which is HDF5", where=str(path), fix="save it with `-v7`")
        found = cast("Mapping[str, Any]", _loaded(path, loader))
        return cls(path, {k: v for n, a in found.items() for k, v in _fields(n, a).items()})

    def names(self) -> list[str]:
        """What there is, with shapes as far as they are known."""
        if not is_directory(self.path):
            return [f"{n or 'the array'} {'x'.join(map(str, a.shape))}" for n, a in self.known.items()]
        files = [p for p in sorted(self.path.rglob("*")) if p.is_file() and _is_numpy(p)]
        return [str(p.relative_to(self.path)) for p in files]

    def column(self, reference: str) -> Floats:
        """(n,) one column. Raises `ConfigError` for a name, an index or numbers that are not there."""
        m = cast("re.Match[str]", COLUMN.fullmatch(reference))
        a, k = self._array(m["name"]), int(m["index"] or 0)
        flat = a.reshape(-1, 1) if a.ndim == 1 or (a.ndim == 2 and 1 in a.shape) else a
        if flat.ndim != 2 or k >= flat.shape[1] or (m["index"] is None and flat.shape[1] > 1):
            shape = "x".join(map(str, a.shape))
            raise ConfigError(f"'{reference}' is no column of an array of {shape}", where=str(self.path),
                              fix=f"write {m['name']}[0] to {m['name']}[{max(flat.shape[-1] - 1, 0)}]")  # fmt: skip
        if flat.dtype.kind not in "biuf":
            raise ConfigError(f"'{reference}' holds no numbers", where=str(self.path), fix="name another array")
        return flat[:, k]

    def _array(self, name: str) -> Any:
        if name in self.known:
            return self.known[name]
        if not is_directory(self.path):
            raise ConfigError(f"no array '{name}'", where=str(self.path), fix=closest(name, self.known))
        path = next((p for p in (self.path / name, self.path / f"{name}.npy") if p.is_file()), None)
        if path is None or not _is_numpy(path):
            raise ConfigError(f"no array '{name}'", where=str(self.path), fix=closest(name, self.names()))
        self.known[name] = _loaded(path, _numpy)
        return self.known[name]


def read_arrays(
    path: Path,
    mapping: Path | CsvMapping,
    *,
    robot: str = "robot",
    topics: Sequence[str] | None = None,
    start_s: float | None = None,
    end_s: float | None = None,
    progress: Progress | None = None,
) -> EventLog:
    """Read arrays by a mapping file. Streams carry the names the mapping gives them."""
    how = mapping if isinstance(mapping, CsvMapping) else load_mapping(mapping)
    arrays, streams, notes = Arrays.of(path), list[Stream](), list[str]()
    for done, (name, s) in enumerate(how.streams.items()):
        if progress is not None:
            progress(done, len(how.streams))
        rows = _rows(arrays, how.model_copy(update={"streams": {name: s}}), s)
        unstamped = int((~rows.stamps[how.stamps(s).column][1]).sum())
        if unstamped:
            notes.append(f"{unstamped} rows of {name} have no readable stamp and were left out")
        streams.append(stream_of(name, s, rows, how.stamps(s), robot))
    return assemble(path, streams, notes=notes, topics=topics, start_s=start_s, end_s=end_s)


def _rows(arrays: Arrays, how: CsvMapping, s: StreamColumns) -> Rows:
    """The columns of one stream, all of one length."""
    time, out = how.stamps(s), Rows()
    asked = {c for key, c in wanted(how).items() if key.startswith("streams.")}
    columns = {c: arrays.column(c) for c in {*asked, time.column, *([time.arrival] if time.arrival else [])}}
    lengths = {c: v.size for c, v in columns.items()}
    if len(set(lengths.values())) > 1:
        told = ", ".join(f"{c} {n}" for c, n in sorted(lengths.items()))
        raise ConfigError(f"columns of unequal length: {told}", where=str(arrays.path), fix="map them as two streams")
    for c in asked:
        values = columns[c].astype(np.float64)
        out.numbers[c], out.broken[c] = values, np.zeros(values.size, np.bool_)
    out.texts = {c: [repr(float(v)) for v in columns[c]] for c in s.where}
    for c in (time.column, *([time.arrival] if time.arrival else [])):
        out.stamps[c] = _nanoseconds(columns[c], time.unit, c)
    return out


def _nanoseconds(values: Any, unit: str, name: str) -> tuple[Ints, Bools]:
    """(n,) ns, and which are stamps; whole numbers stay exact."""
    if unit == "iso":
        raise ConfigError(f"the stamps {name} are numbers, not texts", fix="write unit: s, ms, us or ns")
    scale = UNITS_NS[unit]
    floats = values.astype(np.float64)
    good = np.isfinite(floats) & (np.abs(floats) < LIMIT / scale)
    if values.dtype.kind in "iu":
        return np.where(good, values.astype(np.int64), 0) * scale, good
    return np.round(np.where(good, floats, 0.0) * scale).astype(np.int64), good


def _is_numpy(path: Path) -> bool:
    try:
        with path.open("rb") as f:
            return f.read(len(NUMPY)) == NUMPY
    except OSError:
        return False


def _loaded(path: Path, loader: Callable[[Path], Any]) -> Any:
    """What a library makes of a file; whatever it stumbles over becomes one line."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return loader(path)
    except Exception as e:  # of damaged files numpy raises nearly everything there is
        what = " ".join(str(e).split())[:120] or type(e).__name__
        raise DataError(f"is damaged: {what}", where=str(path), fix="save it again") from None


def _numpy(path: Path) -> Any:
    with path.open("rb") as f:
        return np.load(f, allow_pickle=False)


def _npz(path: Path) -> dict[str, Any]:
    with path.open("rb") as f, np.load(f, allow_pickle=False) as found:
        return {name: found[name] for name in found.files}


def _matlab(path: Path) -> dict[str, Any]:
    return read_matlab(path.read_bytes())


def _fields(name: str, array: Any) -> dict[str, Any]:
    """An array under its name, the fields of a record under NAME.FIELD."""
    if not isinstance(array, np.ndarray):
        return {}
    if array.dtype.names is None:
        return {name: array}
    out: dict[str, Any] = {}
    for f in array.dtype.names:
        out |= _fields(f"{name}.{f}" if name else f, array[f])
    return out


__all__ = ["read_arrays"]
