"""Records of a ROS 1 bag or MCAP file whose index is missing or damaged: read from the front, as far as they go.

A recorder that lost power leaves such files. `rosbags` needs the index; this needs only the records themselves, and
borrows the decompressors and the parser of definitions from there.
"""

import struct
from collections.abc import Collection, Iterator
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, TypeAlias, final

from rosbags.interfaces import Connection, MessageDefinition, MessageDefinitionFormat
from rosbags.rosbag1.reader import decompressors
from rosbags.rosbag2.storage_mcap import decompress
from rosbags.typesys.msg import normalize_msgtype

Message: TypeAlias = tuple[int, int, bytes]  # connection, time of arrival [ns], serialized message

ROSBAG1_MAGIC = b"#ROSBAG V2.0\n"
MCAP_MAGIC = b"\x89MCAP0\r\n"
_FORMATS = {"ros2msg": MessageDefinitionFormat.MSG, "ros2idl": MessageDefinitionFormat.IDL}


@final
class Salvage:
    """The readable front of a damaged file, with the interface of a rosbags storage reader.

    `lost` counts records and chunks that could not be unpacked. The file is read twice: once for the connections,
    once for the messages.
    """

    def __init__(self, path: Path, *, ros2: bool) -> None:
        self._path, self._ros2, self.lost = path, ros2, 0
        self._found: dict[int, Connection] = {}
        self._schemas: dict[int, tuple[str, MessageDefinition]] = {}
        counts: dict[int, int] = {}
        self.start_time = 2**63 - 1
        for key, time, _ in self._scan():
            counts[key] = counts.get(key, 0) + 1
            self.start_time = min(self.start_time, time)
        self.connections = [c._replace(msgcount=counts.get(key, 0)) for key, c in self._found.items()]

    def messages(
        self, connections: Collection[Connection], start: int | None = None, stop: int | None = None
    ) -> Iterator[tuple[Connection, int, bytes]]:
        """Messages in file order; start <= time < stop."""
        wanted = {c.id: c for c in connections}
        for key, time, raw in self._scan():
            if key in wanted and (start is None or time >= start) and (stop is None or time < stop):
                yield wanted[key], time, raw

    def _scan(self) -> Iterator[Message]:
        self.lost = 0
        magic = MCAP_MAGIC if self._ros2 else ROSBAG1_MAGIC
        with self._path.open("rb") as file:
            if file.read(len(magic)) == magic:
                yield from self._mcap(file) if self._ros2 else self._rosbag1(file)

    def _rosbag1(self, source: BinaryIO) -> Iterator[Message]:
        end = _end(source)
        while (header := _sized(source, end, "<I")) is not None:
            fields = _fields(header)
            op = fields.get(b"op", b"")
            data = _sized(source, end, "<I", partial=op == b"\x05")
            if data is None:
                return
            try:
                if op == b"\x02":
                    sec, nsec, key = struct.unpack("<III", fields[b"time"] + fields[b"conn"])
                    if key in self._found:
                        yield key, sec * 10**9 + nsec, data
                elif op == b"\x05":
                    yield from self._rosbag1(BytesIO(decompressors[fields[b"compression"].decode()](data)))
                elif op == b"\x07":
                    inner = _fields(data)
                    text = inner[b"message_definition"].decode(errors="replace")
                    definition = MessageDefinition(MessageDefinitionFormat.MSG, text)
                    (key,) = struct.unpack("<I", fields[b"conn"])
                    self._add(key, fields[b"topic"].decode(), normalize_msgtype(inner[b"type"].decode()), definition)
            except Exception:  # whatever a decompressor raises for a damaged chunk; the lengths around it still hold
                self.lost += 1

    def _mcap(self, source: BinaryIO) -> Iterator[Message]:
        end = _end(source)
        while op := source.read(1):
            data = _sized(source, end, "<Q", partial=op == b"\x06")
            if data is None:
                return
            try:
                if op == b"\x05":
                    key, _, time, _ = struct.unpack_from("<HIQQ", data)
                    if key in self._found:
                        yield key, time, data[22:]
                elif op == b"\x06":
                    yield from self._mcap(BytesIO(_mcap_chunk(data)))
                elif op == b"\x03":
                    name, encoding, text = _strings(data, 2, 3)
                    form = _FORMATS.get(encoding, MessageDefinitionFormat.NONE)
                    self._schemas[struct.unpack_from("<H", data)[0]] = name, MessageDefinition(form, text)
                elif op == b"\x04":
                    key, schema = struct.unpack_from("<HH", data)
                    topic, encoding = _strings(data, 4, 2)
                    if encoding == "cdr":
                        self._add(key, topic, *self._schemas[schema])
            except Exception:  # as above
                self.lost += 1

    def _add(self, key: int, topic: str, msgtype: str, definition: MessageDefinition) -> None:
        connection = Connection(key, topic, msgtype, definition, "", 0, None, self)  # type: ignore[arg-type]
        self._found.setdefault(key, connection)


def _end(source: BinaryIO) -> int:
    here = source.tell()
    end = source.seek(0, 2)
    source.seek(here)
    return end


def _sized(source: BinaryIO, end: int, code: str, *, partial: bool = False) -> bytes | None:
    """A length and that many bytes; None if the file ends before, unless a `partial` answer will do."""
    head = source.read(struct.calcsize(code))
    if len(head) < struct.calcsize(code):
        return None
    size, left = struct.unpack(code, head)[0], end - source.tell()
    return source.read(min(size, left)) if size <= left or partial else None


def _fields(header: bytes) -> dict[bytes, bytes]:
    """name=value pairs of a ROS 1 record header, as far as they make sense."""
    out: dict[bytes, bytes] = {}
    pos = 0
    while pos + 4 <= len(header):
        size = struct.unpack_from("<I", header, pos)[0]
        name, _, value = header[pos + 4 : pos + 4 + size].partition(b"=")
        out[name] = value
        pos += 4 + size
    return out


def _strings(data: bytes, pos: int, count: int) -> list[str]:
    out: list[str] = []
    for _ in range(count):
        size = struct.unpack_from("<I", data, pos)[0]
        if pos + 4 + size > len(data):
            raise ValueError("a string longer than its record")
        out.append(data[pos + 4 : pos + 4 + size].decode())
        pos += 4 + size
    return out


def _mcap_chunk(data: bytes) -> bytes:
    """The records inside a chunk; of an uncompressed chunk that is cut off, those that are there."""
    _, _, size, crc = struct.unpack_from("<QQQI", data)
    (compression,) = _strings(data, 28, 1)
    packed = data[28 + 4 + len(compression) + 8 :]
    return packed if compression == "" else decompress(packed, compression, size, crc)
