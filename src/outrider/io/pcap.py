"""Packets of a capture (pcap, pcapng), for readers of what is in them.

Libraries for this parse whole protocols; here a packet is a stamp, a link type and bytes.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, final

PCAP: Final = {  # first four bytes -> byte order, ns per fraction of a second
    b"\xd4\xc3\xb2\xa1": ("<", 1000), b"\xa1\xb2\xc3\xd4": (">", 1000),
    b"\x4d\x3c\xb2\xa1": ("<", 1), b"\xa1\xb2\x3c\x4d": (">", 1),
}  # fmt: skip
PCAPNG: Final = b"\x0a\x0d\x0d\x0a"
SECTION, INTERFACE, OLD_PACKET, SIMPLE, PACKET = 0x0A0D0D0A, 1, 2, 3, 6
LITTLE: Final = b"\x4d\x3c\x2b\x1a"
RESOLUTION, OFFSET = 9, 14  # options of an interface
LARGEST: Final = 1 << 26  # bytes of a packet or block; more is damage


@final
@dataclass(frozen=True, slots=True)
class Packet:
    """t : Unix ns, 0 if not told;  link : LINKTYPE of the tcpdump list;  end : where it ends in the file."""

    t: int
    link: int
    data: bytes
    end: int


@final
@dataclass(frozen=True, slots=True)
class Interface:
    """link type;  ticks : per second;  offset : s added to its stamps."""

    link: int
    ticks: int = 1_000_000
    offset: int = 0

    def unix(self, high: int, low: int) -> int:
        """Unix ns of the two halves of a stamp."""
        return (high << 32 | low) * 10**9 // self.ticks + self.offset * 10**9


def packets(data: bytes) -> Iterator[Packet]:
    """The packets of a capture in order, up to where it was cut or damaged."""
    return _pcap(data) if data[:4] in PCAP else _pcapng(data)


def _pcap(data: bytes) -> Iterator[Packet]:
    order, unit = PCAP[data[:4]]
    if len(data) < 24:
        return
    link, i = struct.unpack_from(f"{order}I", data, 20)[0] & 0xFFFF, 24
    while i + 16 <= len(data):
        seconds, fraction, kept, _ = struct.unpack_from(f"{order}IIII", data, i)
        i += 16 + kept
        if kept > LARGEST or i > len(data):
            return
        yield Packet(seconds * 10**9 + fraction * unit, link, data[i - kept : i], i)


def _pcapng(data: bytes) -> Iterator[Packet]:
    order, i = "<", 0
    interfaces: list[Interface] = []
    while i + 12 <= len(data):
        if data[i : i + 4] == PCAPNG:
            order = "<" if data[i + 8 : i + 12] == LITTLE else ">"
            interfaces = []
        kind, size = struct.unpack_from(f"{order}II", data, i)
        if size < 12 or size % 4 or size > LARGEST or i + size > len(data):
            return
        body = data[i + 8 : i + size - 4]
        i += size
        if kind == INTERFACE and len(body) >= 8:
            interfaces.append(_interface(body, order))
        elif (packet := _packet(kind, body, order, interfaces, i)) is not None and packet.t < 2**62:
            yield packet


def _packet(kind: int, body: bytes, order: str, interfaces: list[Interface], end: int) -> Packet | None:
    if kind == SIMPLE and interfaces and len(body) >= 4:
        size = struct.unpack_from(f"{order}I", body)[0]
        return Packet(0, interfaces[0].link, body[4 : 4 + size], end)
    if kind not in (PACKET, OLD_PACKET) or len(body) < 20:
        return None
    which, high, low, kept, _ = struct.unpack_from(f"{order}IIIII", body)
    if kind == OLD_PACKET:  # a number of two bytes, then two bytes of dropped packets
        which = struct.unpack_from(f"{order}H", body)[0]
    if which >= len(interfaces) or 20 + kept > len(body):
        return None
    one = interfaces[which]
    return Packet(one.unix(high, low), one.link, body[20 : 20 + kept], end)


def _interface(body: bytes, order: str) -> Interface:
    link, ticks, offset, i = struct.unpack_from(f"{order}H", body)[0], 1_000_000, 0, 8
    while i + 4 <= len(body):
        code, size = struct.unpack_from(f"{order}HH", body, i)
        value = body[i + 4 : i + 4 + size]
        if code == RESOLUTION and len(value) == 1:
            ticks = 2 ** (value[0] & 0x3F) if value[0] & 0x80 else 10 ** min(value[0], 18)
        if code == OFFSET and len(value) == 8:
            offset = struct.unpack(f"{order}q", value)[0]
        i += 4 + size + (-size % 4)
        if code == 0:
            break
    return Interface(link, ticks, offset if abs(offset) < 2**33 else 0)
