"""Opening what ROS records into: a ROS 1 bag, a ROS 2 directory or one of its data files, whole or damaged."""

import os
import re
import struct
from collections.abc import Collection, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, final

from outrider.errors import DataError
from outrider.io.files import ensure_readable

if TYPE_CHECKING:
    from rosbags.interfaces import Connection

DATA_SUFFIXES = (".bag", ".mcap", ".db3")
_SIGNS = {b"#ROSBAG V": "rosbag1", b"\x89MCAP0\r\n": "mcap", b"SQLite format 3\0": "sqlite3"}
_INT64 = 2**63
_NUMBER = re.compile(r"_\d+$")
_COMPRESSED = re.compile(r"compression_mode:\s*['\"]?(file|message)\b", re.IGNORECASE)


class _Source(Protocol):
    """A rosbags reader, or a salvage."""

    connections: list["Connection"]

    def messages(
        self, connections: Collection["Connection"], start: int | None = None, stop: int | None = None
    ) -> Iterator[tuple["Connection", int, bytes]]: ...


@final
@dataclass(slots=True)
class Bag:
    """One opened data file. start : arrival of its first record [ns]; size : bytes."""

    path: Path
    ros2: bool
    source: _Source
    start: int
    size: int

    @property
    def connections(self) -> list["Connection"]:
        """Those that make sense: a damaged table of topics may hold anything."""
        kinds = (str, str, int)
        return [c for c in self.source.connections if tuple(map(type, (c.topic, c.msgtype, c.msgcount))) == kinds]

    def messages(
        self, connections: Collection["Connection"], start: int | None, stop: int | None, notes: list[str]
    ) -> Iterator[tuple["Connection", int, bytes]]:
        """Records of the given connections; a damaged place ends them with a note, not with an error."""
        if not connections:
            return
        count = lost = 0
        try:
            for connection, time, raw in self.source.messages(connections, start, stop):
                # sqlite keeps what it is given, and a damaged page gives anything
                if type(raw) is bytes and type(time) is int and 0 <= time < _INT64:
                    count += 1
                    yield connection, time, raw
                else:
                    lost += 1
        except Exception as e:  # a damaged file may raise anything inside the container's reader
            notes.append(f"{self.path.name}: damaged after {count} records, the rest was not read ({_one_line(e)})")
        if lost := lost + getattr(self.source, "lost", 0):
            notes.append(f"{self.path.name}: {lost} damaged records or chunks were left out")


def open_bags(path: Path, stack: ExitStack, notes: list[str]) -> list[Bag]:
    """Every data file of a recording, in order; DataError if it is none or nothing in it can be read."""
    if not path.exists():
        raise DataError("no such file or directory", where=str(path), fix="check the path")
    if not path.is_dir():
        return [_open_file(path, stack, notes)]
    if not os.access(path, os.R_OK | os.X_OK):
        raise DataError("cannot be read: permission denied", where=str(path))
    files = sorted((p for p in path.iterdir() if p.suffix in DATA_SUFFIXES and p.is_file()), key=_natural)
    if packed := _compressed_directory(path, stack):
        return [packed]
    if not files:
        kinds = " ".join(DATA_SUFFIXES)
        raise DataError("no recording in this directory", where=str(path), fix=f"it should hold files named *{kinds}")
    parts = {_NUMBER.sub("", p.stem) for p in files}  # a split recording numbers its files
    if len(parts) > 1 and not (path / "metadata.yaml").is_file():
        raise DataError(f"holds {len(parts)} different recordings", where=str(path), fix="name one of them")
    bags: list[Bag] = []
    faults: list[DataError] = []
    for file in files:
        try:
            bags.append(_open_file(file, stack, notes))
        except DataError as e:
            faults.append(e)
    if not bags:
        raise faults[0]
    notes += [f"{Path(e.where).name}: {e.what}, left out" for e in faults]
    return bags


def _compressed_directory(path: Path, stack: ExitStack) -> Bag | None:
    """A ROS 2 directory that only its metadata make readable: messages or files compressed by the recorder."""
    metadata = path / "metadata.yaml"
    if not metadata.is_file():
        if any(path.glob("*.zstd")):
            raise DataError("compressed files without metadata.yaml", where=str(path), fix="try `ros2 bag reindex`")
        return None
    if not _COMPRESSED.search(metadata.read_text(errors="replace")):
        return None
    from rosbags.rosbag2 import Reader

    try:
        reader = stack.enter_context(Reader(path))
    except Exception as e:  # see _open_file
        raise DataError(f"the recording cannot be read: {_one_line(e)}", where=str(path)) from None
    size = sum(p.stat().st_size for p in path.iterdir() if p.is_file())
    return Bag(path, True, reader, reader.start_time, size)  # type: ignore[arg-type]


def _open_file(path: Path, stack: ExitStack, notes: list[str]) -> Bag:
    with ensure_readable(path).open("rb") as f:
        head = f.read(16)
    kind = next((kind for sign, kind in _SIGNS.items() if head.startswith(sign)), "")
    if not kind:
        raise DataError(
            "not a ROS recording", where=str(path), fix="known are ROS 1 bags (V2.0), MCAP and ROS 2 sqlite3 files"
        )
    if kind == "sqlite3" and (wal := path.with_name(path.name + "-wal")).exists() and wal.stat().st_size:
        notes.append(f"{path.name}: records that never left {wal.name} are not read (open it once with sqlite3)")
    size = path.stat().st_size
    try:
        reader: Any = _reader(kind, path)
        reader.open()
        stack.callback(reader.close)
        start = reader.start_time if kind == "rosbag1" else reader.metadata.start_time
        return Bag(path, kind != "rosbag1", reader, int(start), size)
    except Exception as e:  # asserts, struct and decompression errors included: the index of a damaged file
        return _salvaged(kind, path, size, _one_line(e), notes)


def _reader(kind: str, path: Path) -> object:
    from rosbags.rosbag1 import Reader
    from rosbags.rosbag2.storage_mcap import McapReader
    from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

    return {"rosbag1": Reader, "mcap": McapReader, "sqlite3": Sqlite3Reader}[kind](path)


def _salvaged(kind: str, path: Path, size: int, why: str, notes: list[str]) -> Bag:
    from outrider.io._ros_salvage import Salvage

    remedy = {"rosbag1": "rosbag reindex", "mcap": "mcap recover", "sqlite3": "sqlite3 .recover"}[kind]
    rescued = None if kind == "sqlite3" else Salvage(path, ros2=kind == "mcap")
    if rescued is None or not any(c.msgcount for c in rescued.connections):
        raise DataError(f"the recording cannot be read: {why}", where=str(path), fix=f"try `{remedy}`")
    count = sum(c.msgcount for c in rescued.connections)
    notes.append(f"{path.name}: no usable index ({why}); {count} records found by a scan (`{remedy}` mends the file)")
    return Bag(path, kind != "rosbag1", rescued, rescued.start_time, size)  # type: ignore[arg-type]


def _natural(path: Path) -> list[tuple[int, str]]:
    """Sort key with numbers by value: part_2 before part_10."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", path.name)]


def _one_line(error: Exception) -> str:
    text = " ".join(str(error).split())
    if isinstance(error, (AssertionError, struct.error, KeyError, IndexError)) or not text:
        return "a damaged record"
    return text.rstrip(".")[:160]
