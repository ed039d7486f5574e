"""Numeric arrays of MATLAB files (level 5, what `save -v6` and `-v7` write).

scipy's reader crashes the process on some damaged files, so the few elements that matter are read here.
Source: MathWorks, MAT-File Format, R2020a, chapter 1.
"""

import struct
import zlib
from collections.abc import Iterator
from typing import Any, Final

import numpy as np

NUMBERS: Final = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
NAME, MATRIX, COMPRESSED = 1, 14, 15
STRUCTURE: Final = 2  # classes of arrays; 6 to 15 are numbers
NUMERIC: Final = range(6, 16)
HEADER: Final = 128
DEEPEST: Final = 4  # structures within structures
LARGEST: Final = 1 << 31  # bytes that a packed element may unpack to


def read_matlab(data: bytes) -> dict[str, Any]:
    """Arrays by name, `STRUCTURE.FIELD` inside structures; texts, cells and sparse arrays are passed over.

    Raises ValueError for anything that the format does not allow.
    """
    order = {b"IM": "<", b"MI": ">"}.get(data[126:128])
    if order is None:
        raise ValueError("no MATLAB level 5 header")
    out: dict[str, Any] = {}
    for kind, body in _elements(data[HEADER:], order):
        if kind == COMPRESSED:
            for inner, unpacked in _elements(_unpacked(body), order):
                out |= _matrix(unpacked, order) if inner == MATRIX else {}
        elif kind == MATRIX:
            out |= _matrix(body, order)
    return out


def _unpacked(body: bytes) -> bytes:
    try:
        return zlib.decompressobj().decompress(body, LARGEST)
    except zlib.error as e:
        raise ValueError(str(e)) from None


def _elements(data: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    """Type and content of the elements that stand one after another; padded to eight bytes unless packed."""
    i = 0
    while i + 8 <= len(data):
        kind, size = struct.unpack_from(f"{order}II", data, i)
        if kind >> 16:  # up to four bytes beside the tag
            kind, size, at, step = kind & 0xFFFF, kind >> 16, i + 4, 8
        else:
            at, step = i + 8, 8 + size + (0 if kind == COMPRESSED else -size % 8)
        if at + size > len(data) or (step == 8 and size > 4):
            raise ValueError("an element ends after the file")
        yield kind, data[at : at + size]
        i += step


def _matrix(body: bytes, order: str, prefix: str = "", depth: int = 0) -> dict[str, Any]:
    """One variable; its parts are flags, dimensions, name, and then what its class asks for."""
    parts = list(_elements(body, order))
    if len(parts) < 4 or len(parts[0][1]) < 4:
        return {}
    flags = struct.unpack_from(f"{order}I", parts[0][1])[0]
    shape = _numbers(parts[1], order).astype(np.int64)
    name = prefix or parts[2][1].decode("ascii", "replace")
    if (shape < 0).any() or shape.size < 2:
        raise ValueError("no dimensions")
    if flags & 0xFF == STRUCTURE:
        return _structure(parts, order, name, depth) if shape.prod() == 1 and depth < DEEPEST else {}
    if flags & 0xFF not in NUMERIC:
        return {}
    values = _numbers(parts[3], order)
    if values.size != float(np.prod(shape.astype(np.float64))):
        raise ValueError(f"{name} has {values.size} numbers for {'x'.join(map(str, shape))}")
    return {name: values.reshape(tuple(shape), order="F")}


def _structure(parts: list[tuple[int, bytes]], order: str, name: str, depth: int) -> dict[str, Any]:
    """Fields of a single structure."""
    width = int(_numbers(parts[3], order)[0])
    if len(parts) < 5 or width < 1:
        return {}
    names = [parts[4][1][k : k + width].split(b"\0")[0] for k in range(0, len(parts[4][1]), width)]
    out: dict[str, Any] = {}
    for field, (kind, body) in zip(names, parts[5:], strict=False):
        if kind == MATRIX:
            out |= _matrix(body, order, f"{name}.{field.decode('ascii', 'replace')}", depth + 1)
    return out


def _numbers(part: tuple[int, bytes], order: str) -> Any:
    kind, body = part
    if kind not in NUMBERS:
        raise ValueError(f"numbers of type {kind}")
    dtype = np.dtype(f"{order}{NUMBERS[kind]}")
    if not body or len(body) % dtype.itemsize:
        raise ValueError("a number was cut")
    return np.frombuffer(body, dtype).astype(dtype.newbyteorder("="))
