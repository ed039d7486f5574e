"""ROS messages of constant layout as columns: numpy reads thousands of serialized messages at once, and writes them.

A message type that consists of numbers, arrays of fixed length and one run of strings (frame names) has the same layout
in every message as long as those strings stay the same. The layout follows from the type's own definition, as
`rosbags` parsed it, so a type that gained a field in a later ROS release needs nothing here.
"""

import struct
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, final

import numpy as np
from numpy.typing import NDArray

FieldDefs = Mapping[str, Any]  # rosbags' Typesdict: type name -> (constants, [(field name, description)])

_CODES = {
    "bool": "u1", "byte": "u1", "char": "u1", "uint8": "u1", "int8": "i1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8",
}  # fmt: skip
_CDR_PADDING = 3  # writers may fill a message up to the next multiple of four bytes


class Leaf(NamedTuple):
    """One number, fixed array or string of a message: dotted name, numpy code ("" for a string), how many."""

    name: str
    code: str
    length: int = 1


def leaves(defs: FieldDefs, msgtype: str, prefix: str = "") -> list[Leaf] | None:
    """The message flattened, in wire order; None for a type with sequences or arrays of messages."""
    from rosbags.interfaces import Nodetype

    out: list[Leaf] = []
    for name, (node, what) in defs[msgtype][1]:
        path = prefix + name
        if node == Nodetype.NAME:
            inner = leaves(defs, what, f"{path}.")
            if inner is None:
                return None
            out += inner
        elif node == Nodetype.BASE and what[0] == "string":
            out.append(Leaf(path, ""))
        elif node == Nodetype.BASE and what[0] in _CODES:
            out.append(Leaf(path, _CODES[what[0]]))
        elif node == Nodetype.ARRAY and what[0][0] == Nodetype.BASE and what[0][1][0] in _CODES:
            out.append(Leaf(path, _CODES[what[0][1][0]], what[1]))
        else:
            return None
    return out if _one_run_of_strings(out) else None


def _one_run_of_strings(fields: Sequence[Leaf]) -> bool:
    kinds = "".join("n" if leaf.code else "s" for leaf in fields)
    return "s" not in kinds.strip("n").strip("s") and "n" not in kinds.strip("n")


@final
class Layout(NamedTuple):
    """Where everything stands in a message. `raw[first:last] == text` and equal length tell another one of its kind."""

    dtype: np.dtype[Any]
    strings: dict[str, str]
    first: int
    last: int
    text: bytes
    head: bytes  # encapsulation of a ROS 2 message; empty in ROS 1

    def fits(self, raw: bytes) -> bool:
        """Whether a message has this layout and these strings."""
        return (
            len(raw) == self.dtype.itemsize and raw[self.first : self.last] == self.text and raw.startswith(self.head)
        )


def layout(fields: Sequence[Leaf], raw: bytes, ros2: bool) -> Layout:
    """The layout of one serialized message; ValueError if it is not a message of this type."""
    start = 4 if ros2 else 0
    if ros2 and raw[:2] not in (b"\x00\x00", b"\x00\x01"):
        raise ValueError("not plain CDR")
    order = ">" if ros2 and raw[1] == 0 else "<"
    pos, first, last = start, len(raw), 0
    strings: dict[str, str] = {}
    columns: list[tuple[str, Any, int]] = []
    for leaf in fields:
        size = int(leaf.code[1]) if leaf.code else 4
        if ros2:
            pos += -(pos - start) % size
        if leaf.code:
            kind = order + leaf.code
            columns.append((leaf.name, kind if leaf.length == 1 else (kind, (leaf.length,)), pos))
            pos += size * leaf.length
            continue
        length = _length(raw, pos, order)
        value = raw[pos + 4 : pos + 4 + length]
        strings[leaf.name] = (value[:-1] if ros2 else value).decode(errors="replace")
        first, pos = min(first, pos), pos + 4 + length
        last = pos
    if not pos <= len(raw) <= pos + (_CDR_PADDING if ros2 else 0):
        raise ValueError(f"{len(raw)} bytes where {pos} were expected")
    names, formats, offsets = (list(c) for c in zip(*columns, strict=True)) if columns else ([], [], [])
    dtype = np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": len(raw)})
    return Layout(dtype, strings, first, last, raw[first:last], raw[:start])


def _length(raw: bytes, pos: int, order: str) -> int:
    if pos + 4 > len(raw):
        raise ValueError("cut short")
    length: int = struct.unpack_from(f"{order}I", raw, pos)[0]
    if pos + 4 + length > len(raw):
        raise ValueError("a string longer than its message")
    return length


def decode(shape: Layout, raw: bytes | bytearray) -> dict[str, NDArray[Any]]:
    """Messages of one layout, end to end, as columns by dotted name: (n,) or (n, count)."""
    table = np.frombuffer(raw, shape.dtype)
    return {name: table[name] for name in shape.dtype.names or ()}


def nothing(fields: Sequence[Leaf]) -> dict[str, NDArray[Any]]:
    """The columns of no message at all."""
    return {f.name: np.zeros((0,) if f.length == 1 else (0, f.length)) for f in fields if f.code}


def encode(shape: Layout, template: bytes, columns: Mapping[str, Any], n: int) -> list[bytes]:
    """n copies of a serialized message with the named columns replaced."""
    buffer, size = bytearray(template * n), len(template)
    table = np.frombuffer(buffer, shape.dtype)  # a view: a copy would not carry what lies between the fields
    for name, values in columns.items():
        table[name] = values
    return [bytes(buffer[i : i + size]) for i in range(0, n * size, size)]
