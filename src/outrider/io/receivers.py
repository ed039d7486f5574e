"""Logs of GNSS receivers: NMEA sentences, u-blox messages, or both mixed, with anything else between them.

A receiver that sends its solution in several messages sends one solution: of one epoch the best message is kept
(NAV-HPPOSLLH, NAV-PVT, NAV-POSLLH, GGA, GNS, RMC), the others are counted in a note.
"""

import mmap
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from operator import xor
from pathlib import Path
from typing import Final, cast, final

import numpy as np

from outrider.data import EventLog, Kind, Stream
from outrider.io._shared import nearest
from outrider.io.files import Progress, assemble, ensure_readable
from outrider.io.nmea import Sentences
from outrider.io.ubx import Messages

START: Final = re.compile(rb"\xb5\x62|\$(?=[A-Z]{2})")
SENTENCE: Final = re.compile(rb"\$([A-Z][A-Z0-9]{3,7},[\x20-\x23\x25-\x29\x2b-\x7e]{0,240})\*([0-9A-Fa-f]{2})")
LONGEST: Final = 8192  # bytes of a payload; more is no message
SAME_EPOCH: Final = 15_000_000  # ns: receivers give 25 solutions a second at most; NMEA rounds to hundredths
REPORT_EVERY: Final = 1 << 20


@final
@dataclass(slots=True)
class Scan:
    """What a log is made of."""

    nmea: Sentences = field(default_factory=Sentences)
    ubx: Messages = field(default_factory=Messages)
    broken: int = 0  # sentences and messages whose checksum is wrong, or that end too early
    skipped: int = 0  # bytes that belong to none


def is_receiver_log(head: bytes) -> bool:
    """Whether the beginning of a file holds a sentence or a message whose checksum is right."""
    return any(_frame(head, m.start()) is not None for m in START.finditer(head))


def read_receiver(
    path: Path,
    *,
    robot: str = "robot",
    topics: Sequence[str] | None = None,
    start_s: float | None = None,
    end_s: float | None = None,
    progress: Progress | None = None,
) -> EventLog:
    """Read a log of NMEA (GGA GNS RMC VTG GST ZDA HDT THS) and UBX (NAV-PVT HPPOSLLH POSLLH VELNED RELPOSNED).

    Streams carry the message's name; velocity is `<message>#velocity`. What a message does not say (deviations in GGA,
    fix type in NAV-POSLLH) is taken from GST, NAV-PVT or NAV-STATUS of the same epoch.
    """
    with ensure_readable(path).open("rb") as f, mmap.mmap(f.fileno(), 0, access=mmap.ACCESS_READ) as data:
        seen = scan(cast(bytes, data), progress)
    notes: list[str] = []
    found = [replace(s, robot=robot) for s in (*seen.ubx.streams(notes), *seen.nmea.streams(notes))]
    streams = [*_once(found, Kind.GNSS, notes), *_once(found, Kind.GNSS_VELOCITY, notes)]
    streams += [s for s in found if s.kind is Kind.HEADING]
    if seen.broken:
        notes.append(f"{seen.broken} sentences or messages are damaged and were left out")
    if seen.skipped:
        notes.append(f"{seen.skipped} bytes are neither NMEA nor UBX and were skipped")
    return assemble(path, streams, notes=notes, topics=topics, start_s=start_s, end_s=end_s)


def scan(data: bytes, progress: Progress | None = None) -> Scan:
    """Sentences and messages whose checksums are right, in order."""
    out, size, i, report = Scan(), len(data), 0, 0
    while (m := START.search(data, i)) is not None:
        if progress is not None and m.start() >= report:
            progress(m.start(), size)
            report = m.start() + REPORT_EVERY
        at = m.start()
        out.skipped += len(data[i:at].strip(b"\r\n"))
        end = _frame(data, at)
        if end is None:
            out.broken += 1
            i = at + 2
            continue
        if data[at] == 0x24:
            out.nmea.take(data[at:end].decode("ascii"))
        else:
            out.ubx.take(data[at + 2 : at + 4], data[at + 6 : end - 2], at)
        i = end
    out.skipped += len(data[i:].strip(b"\r\n\0"))
    return out


def _frame(data: bytes, at: int) -> int | None:
    """Where the sentence or message that begins here ends; None if it is damaged or cut."""
    if data[at] == 0x24:
        m = SENTENCE.match(data, at)
        return m.end() if m is not None and reduce(xor, m[1]) == int(m[2], 16) else None
    size = int.from_bytes(data[at + 4 : at + 6], "little")
    end = at + 8 + size
    if size > LONGEST or end > len(data):
        return None
    return end if _fletcher(data[at + 2 : end - 2]) == data[end - 2 : end] else None


def _fletcher(body: bytes) -> bytes:
    """The two bytes that close a u-blox message: sum, and sum of sums, modulo 256."""
    values = np.frombuffer(body, np.uint8).astype(np.int64)
    return bytes([int(values.sum()) & 0xFF, int(values @ np.arange(values.size, 0, -1)) & 0xFF])


def _once(found: Sequence[Stream], kind: Kind, notes: list[str]) -> list[Stream]:
    """Streams of a kind without records of epochs that a better one has; `found` has the best first."""
    out: list[Stream] = []
    for s in (s for s in found if s.kind is kind):
        told = np.concatenate([np.zeros(0, np.int64), *(b.t for b in out)])
        repeated = nearest(told, s.t, SAME_EPOCH)[1]
        if repeated.any():
            better = ", ".join(b.name for b in out)
            notes.append(f"{int(repeated.sum())} of {len(s)} {s.name} repeat {better} and were left out")
        out.append(s.select(~repeated))
    return [s for s in out if len(s) or s.malformed]
