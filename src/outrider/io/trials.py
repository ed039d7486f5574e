"""The folder of a campaign: one line per trial, written as the trial ends, so that nothing done is lost.

campaign.json    the configuration, schema `outrider.trials/1`: rows of another configuration never mix with these
rows.jsonl       one JSON object per line in the order in which trials ended, with how long each took; append only
trials.parquet   the same as a table in the order of the trials, made when all have ended: same trials, same bytes
"""

import json
import os
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO, cast, final

from outrider.errors import ConfigError, DataError, OutputExistsError, UsageError
from outrider.io.files import replacing
from outrider.io.folders import as_json, plain, read_marker

SCHEMA = "outrider.trials/1"
MARKER, ROWS, TABLE = "campaign.json", "rows.jsonl", "trials.parquet"
SHOWN = 3  # differences named before "and more"

Record = dict[str, Any]
"""A row: case [index], seed, values {name: number or list}, error (empty if none), wall_s."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Stored:
    """What a folder holds. rows : in the order in which they ended;  damaged : lines, from 1, that are no row"""

    configuration: Record
    rows: Sequence[Record]
    damaged: tuple[int, ...]


@final
class TrialStore:
    """Rows of one campaign in a folder; a context that holds the folder against a second writer."""

    def __init__(self, folder: Path, configuration: Mapping[str, object], *, resume: bool = False) -> None:
        """Begin a folder, or with `resume` go on with one whose configuration is the same.

        Raises `OutputExistsError` for a folder in use, `ConfigError` for another configuration, naming the difference.
        """
        self.folder = folder
        self.rows: list[Record] = []
        self._file: TextIO | None = None
        _prepare(folder, plain(configuration), resume=resume)

    def __enter__(self) -> "TrialStore":
        try:
            self._file = (self.folder / ROWS).open("a+", encoding="utf-8")
            self._hold()
            self._read()
        except OSError as e:
            self.__exit__()
            raise _unwritable(e, self.folder) from None
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        if self._file is not None:
            with suppress(OSError):  # of a full disk: it tries again to write what `append` could not
                self._file.close()
            self._file = None

    def append(self, row: Record) -> None:
        """Store a row so that it outlives this process, however that ends."""
        assert self._file is not None
        try:
            self._file.write(json.dumps(row, ensure_ascii=False) + "\n")
            self._file.flush()
        except OSError as e:  # a full disk, most likely: what is complete stays, the torn line is cut on resuming
            raise _unwritable(e, self.folder) from None
        self.rows.append(row)

    def write_table(self, rows: Sequence[Record], cases: Sequence[Mapping[str, object]]) -> None:
        """Write rows, in the order given, to the Parquet table."""
        import pyarrow as pa
        from pyarrow import parquet

        columns = {
            "trial.case": pa.array([r["case"] for r in rows], pa.int64()),
            "trial.seed": pa.array([r["seed"] for r in rows], pa.int64()),
            "trial.error": pa.array([r["error"] for r in rows], pa.string()),
        }
        for name in _names(cases):
            columns[f"param.{name}"] = _column([cases[r["case"]].get(name) for r in rows])
        for name in _names([r["values"] for r in rows]):
            columns[name] = _column([r["values"].get(name) for r in rows])
        with replacing(self.folder / TABLE, force=True) as part:
            parquet.write_table(pa.table(columns), part)

    def _hold(self) -> None:
        """Nobody else may write here until the file is closed, even by the end of this process."""
        assert self._file is not None
        try:
            import fcntl
        except ImportError:  # no such locks on Windows
            return
        try:
            fcntl.flock(self._file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise UsageError("another process is running this campaign", where=str(self.folder)) from None

    def _read(self) -> None:
        """Take in what is stored; cut a last line that was never finished, blank those that hold no row.

        The trials of both count as not done.
        """
        assert self._file is not None
        self._file.seek(0)
        raw = self._file.buffer.read()  # type: ignore[attr-defined]
        whole = raw[: raw.rfind(b"\n") + 1]
        os.truncate(self.folder / ROWS, len(whole))
        at = 0
        for line in whole.split(b"\n")[:-1]:
            row = _parsed(line)
            if row is not None:
                self.rows.append(row)
            elif line.strip():
                with (self.folder / ROWS).open("r+b") as file:  # `a+` writes at the end only
                    file.seek(at)
                    file.write(b" " * len(line))
            at += len(line) + 1
        self._file.seek(0, os.SEEK_END)


def read_trials(folder: Path) -> Stored:
    """Configuration and rows of a folder, whether or not all trials have ended; a line being written is not yet one."""
    configuration: Any = read_marker(folder, MARKER, SCHEMA).get("configuration")
    if not _is_campaign(configuration):
        raise DataError("is damaged: it says no cases", where=str(folder / MARKER), fix="make it again")
    try:
        lines = (folder / ROWS).read_bytes().split(b"\n")[:-1] if (folder / ROWS).exists() else []
    except OSError as e:
        raise DataError(f"cannot be read: {(e.strerror or str(e)).lower()}", where=str(folder / ROWS)) from None
    parsed = [_parsed(line, len(configuration["cases"])) for line in lines]
    return Stored(
        configuration=configuration,
        rows=[row for row in parsed if row is not None],
        damaged=tuple(
            n for n, (line, row) in enumerate(zip(lines, parsed, strict=True), 1) if line.strip() and row is None
        ),
    )


def _is_campaign(configuration: Any) -> bool:
    """Whether it names a trial, and its cases with their numbers of samples."""
    if not isinstance(configuration, dict):
        return False
    said = cast("Record", configuration)
    cases = cast("list[Any]", said.get("cases")) if isinstance(said.get("cases"), list) else []
    whole = all(isinstance(c, dict) and isinstance(cast("Record", c).get("sample", 0), int) for c in cases)
    return whole and bool(cases) and isinstance(said.get("trial"), str)


def _prepare(folder: Path, configuration: Record, *, resume: bool) -> None:
    """Check the folder's marker, or write it into an empty or new folder."""
    if folder.exists() and not folder.is_dir():
        raise OutputExistsError("exists and is not a directory", where=str(folder), fix="name another folder")
    if (folder / MARKER).exists():
        if not resume:
            raise OutputExistsError("holds an earlier campaign", where=str(folder), fix="resume it or name another")
        different = _differences(read_marker(folder, MARKER, SCHEMA).get("configuration"), configuration)
        if different:
            more = f" and {len(different) - SHOWN} more" if len(different) > SHOWN else ""
            what = "holds trials of another configuration: " + "; ".join(different[:SHOWN]) + more
            raise ConfigError(what, where=str(folder), fix="name another folder to begin afresh")
        return
    if folder.is_dir() and any(folder.iterdir()):
        raise OutputExistsError("is not empty and holds no campaign", where=str(folder), fix="name another folder")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with replacing(folder / MARKER) as part:
            part.write_text(as_json({"schema": SCHEMA, "configuration": configuration}) + "\n", encoding="utf-8")
    except OSError as e:
        raise _unwritable(e, folder) from None


def _differences(stored: object, now: object, where: str = "") -> list[str]:
    """Every place in which two configurations differ, as `grid[2].tau: 0.5 in the folder, 1.0 now`."""
    if isinstance(stored, dict) and isinstance(now, dict):
        a, b = cast("Record", stored), cast("Record", now)
        keys = [*a, *(k for k in b if k not in a)]
        return [d for k in keys for d in _differences(a.get(k), b.get(k), f"{where}.{k}" if where else k)]
    if isinstance(stored, list) and isinstance(now, list):
        a, b = cast("list[object]", stored), cast("list[object]", now)
        length = [] if len(a) == len(b) else [f"{where}: {len(a)} in the folder, {len(b)} now"]
        both = zip(a, b, strict=False)
        return [*length, *(d for i, (x, y) in enumerate(both) for d in _differences(x, y, f"{where}[{i}]"))]
    return [] if stored == now else [f"{where}: {json.dumps(stored)} in the folder, {json.dumps(now)} now"]


def _parsed(line: bytes, cases: int = sys.maxsize) -> Record | None:
    try:
        row = json.loads(line, parse_int=_small)
        whole = isinstance(row["case"], int) and isinstance(row["seed"], int) and isinstance(row["error"], str)
        whole = whole and 0 <= row["case"] < cases
        return cast("Record", row) if whole and all(map(_is_value, row["values"].values())) else None
    except (ValueError, KeyError, TypeError, AttributeError):
        return None


def _is_value(x: object) -> bool:
    """A number or a row of numbers."""
    return all(isinstance(n, int | float) for n in (cast("list[object]", x) if isinstance(x, list) else [x]))


def _small(text: str) -> int:
    """A whole number of 64 bits; others are no count, seed or case."""
    if abs(number := int(text)) >= 2**63:
        raise ValueError(text)
    return number


def _names(mappings: Sequence[Mapping[str, object]]) -> list[str]:
    """All keys, in the order in which they are met."""
    return list(dict.fromkeys(name for m in mappings for name in m))


def _column(values: list[Any]) -> Any:
    """An Arrow column: numbers, lists of numbers, or text; what is mixed becomes JSON text."""
    import pyarrow as pa

    known = [v for v in values if v is not None]
    if all(isinstance(v, bool) for v in known) and known:
        return pa.array(values, pa.bool_())
    if all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in known):
        return pa.array([None if v is None else float(v) for v in values], pa.float64())
    if all(isinstance(v, list) and all(isinstance(x, (int, float)) for x in cast("list[object]", v)) for v in known):
        return pa.array(values, pa.list_(pa.float64()))
    return pa.array([v if v is None or isinstance(v, str) else json.dumps(v) for v in values], pa.string())


def _unwritable(e: OSError, folder: Path) -> UsageError:
    return UsageError(f"cannot be written: {(e.strerror or str(e)).lower()}", where=str(folder), fix="rows so far stay")
