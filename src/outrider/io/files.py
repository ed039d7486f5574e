"""What every reader and writer shares: digests, outputs that are never half written, and the assembly of a log."""

import os
import stat
import tempfile
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from fnmatch import fnmatchcase
from hashlib import sha256 as new_sha256
from pathlib import Path
from typing import TypeAlias

import numpy as np

from outrider.data import EventLog, Stream
from outrider.errors import DataError, OutputExistsError, UsageError

Progress: TypeAlias = Callable[[int, int], None]
"""Called with (bytes done, bytes in all)."""

HASH_WHOLE = 1 << 30  # a longer file is hashed by its head, tail and size: 10 GB must not cost a minute
_CHUNK = 1 << 20


def sha256(path: Path) -> str:
    """SHA-256 of a file or of all files of a directory, as hex.

    A file above 1 GiB is represented by its size, first and last 64 MiB, and the digest is prefixed `head-tail-size:`.
    """
    digest, prefix = new_sha256(), ""
    for file in sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]:
        with file.open("rb") as f:
            size = file.stat().st_size
            if size > HASH_WHOLE:
                prefix = "head-tail-size:"
                digest.update(str(size).encode())
                for start in (0, size - 64 * _CHUNK):
                    f.seek(start)
                    for _ in range(64):
                        digest.update(f.read(_CHUNK))
            else:
                while chunk := f.read(_CHUNK):
                    digest.update(chunk)
    return prefix + digest.hexdigest()


def is_directory(path: Path) -> bool:
    """Whether a path is a directory; unlike `Path.is_dir`, also where one may not look, or the name is too long."""
    try:
        return stat.S_ISDIR(path.stat().st_mode)
    except OSError:
        return False


def ensure_readable(path: Path) -> Path:
    """The path of a file that is there, not empty and may be opened; otherwise a `DataError` that says which."""
    if is_directory(path):
        raise DataError("is a directory, not a log file", where=str(path), fix="name the file inside it")
    try:
        if not stat.S_ISREG(path.stat().st_mode):  # to open a pipe would wait for its other end
            raise DataError("is a pipe or a device, no file", where=str(path), fix="save what it gives as a file")
        with path.open("rb") as f:
            empty = not f.read(1)
    except OSError as e:
        raise DataError(
            f"cannot be read: {(e.strerror or str(e)).lower()}", where=str(path), fix=_neighbour(path)
        ) from None
    if empty:
        raise DataError("the file is empty", where=str(path), fix="was the recording stopped before it was written?")
    return path


@contextmanager
def replacing(path: Path, *, force: bool = False, source: Path | None = None) -> Generator[Path, None, None]:
    """Yield a temporary path beside `path` that takes its place if the block succeeds, and vanishes if it does not.

    It is never `source`, the recording that is read, whatever `force` says.
    """
    if source is not None and source.exists() and path.exists() and path.samefile(source):
        raise OutputExistsError("is the recording itself", where=str(path), fix="give another name")
    if os.path.lexists(path) and not force:
        raise OutputExistsError("exists already", where=str(path), fix="--force overwrites it")
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
        os.close(handle)
    except OSError as e:
        raise UsageError(f"cannot be written: {(e.strerror or str(e)).lower()}", where=str(path)) from None
    part = Path(name)
    try:
        yield part
        part.chmod(0o666 & ~_umask())  # mkstemp makes it private
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def as_text(name: Path | str) -> str:
    """A file name as text that can be written anywhere: bytes that are no UTF-8 are shown as \\xNN."""
    return os.fsencode(name).decode("utf-8", "backslashreplace")


def _neighbour(path: Path) -> str:
    """A remedy for a file that is not there: one of nearly the same name."""
    try:
        names = [] if path.exists() else [p.name for p in path.parent.iterdir()]
    except OSError:
        return ""
    near = get_close_matches(path.name, names, n=1, cutoff=0.8)
    return f"did you mean '{path.with_name(near[0])}'?" if near else ""


def closest(name: str, names: Iterable[str]) -> str:
    """A remedy for a name that is not there: the nearest one, or all of them."""
    names = sorted(names)
    near = get_close_matches(name, names, n=1)
    return f"did you mean '{near[0]}'?" if near else f"there are: {', '.join(names) or 'none'}"


def assemble(
    path: Path,
    streams: Iterable[Stream],
    *,
    notes: Sequence[str] = (),
    topics: Sequence[str] | None = None,
    start_s: float | None = None,
    end_s: float | None = None,
) -> EventLog:
    """One `EventLog` of the streams that were asked for.

    topics : stream names, topics (the part before "#") or patterns with * and ?
    start_s, end_s : seconds since the log's first event; records outside are left out.
    """
    named: dict[str, Stream] = {s.name: s for s in streams if len(s) or s.malformed}
    if not any(len(s) for s in named.values()):
        why = f"; {notes[0]}" if notes else ""
        raise DataError(f"holds no sensor record that can be used{why}", where=str(path))
    first = min(int(s.t[s.t > 0].min(initial=np.iinfo(np.int64).max)) for s in named.values())
    if topics is not None:
        named = {s.name: s for wanted in topics for s in _matching(wanted, named, path)}
    if start_s is not None or end_s is not None:
        begin = -np.inf if start_s is None else start_s
        end = np.inf if end_s is None else end_s
        since = {name: (s.t - first) * 1e-9 for name, s in named.items()}
        named = {name: s.select((since[name] >= begin) & (since[name] <= end)) for name, s in named.items()}
        if not any(len(s) for s in named.values()):
            last = max(float(t.max(initial=0.0)) for t in since.values())
            window = f"after {begin:g} s" if end_s is None else f"between {max(begin, 0.0):g} and {end:g} s"
            raise DataError(
                f"no record {window}", where=str(path), fix=f"the log lasts {last:.3g} s; widen the time span"
            )
    return EventLog(streams=named, path=as_text(path), sha256=sha256(path), notes=tuple(notes))


def _matching(wanted: str, named: dict[str, Stream], path: Path) -> list[Stream]:
    found = [s for s in named.values() if fnmatchcase(s.name, wanted) or fnmatchcase(s.name.split("#")[0], wanted)]
    if not found:
        raise DataError(f"no topic '{wanted}'", where=str(path), fix=closest(wanted, named))
    return found
