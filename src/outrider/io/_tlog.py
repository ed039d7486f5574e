"""Frames, columns and clocks of a MAVLink telemetry log (.tlog), by the message definitions of `pymavlink`.

A record is the arrival time (uint64, big-endian, microseconds of the ground station's clock) and one MAVLink 1 or 2
frame. `pymavlink` decodes one message object at a time; here the payloads of one type are gathered and decoded as
columns, which is an order of magnitude faster. The dialect is imported by name, so no environment variable matters.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, cast, final

import numpy as np

from outrider.io._shared import as_floats
from outrider.io.files import Progress
from outrider.typing import Floats, Ints

AUTOPILOT = 1  # component id of an autopilot; cameras and gimbals of the same system have others
UNIX = 10**15  # us: a larger stamp counts from 1970, a smaller one from boot
REBOOT = 5_000_000  # us: the boot clock going back by more than this is a restart, not late packets
DAY = 86_400_000_000  # us
MAGIC = (0xFD, 0xFE)  # MAVLink 2, MAVLink 1
FRAME_START = re.compile(rb"[\xfd\xfe]")
LATEST = 2**52  # us, the year 2112
REPORT_EVERY = 1 << 20


class Definition(Protocol):
    """What `pymavlink` generates per message."""

    id: int
    msgname: str
    crc_extra: int
    native_format: bytearray
    ordered_fieldnames: list[str]
    array_lengths: list[int]


@final
@dataclass(slots=True)
class Table:
    """All messages of one type from one component. arrival : us; cells : columns by field name."""

    name: str
    arrival: Ints
    cells: np.ndarray

    def __len__(self) -> int:
        return int(self.arrival.size)

    def column(self, name: str, *, scale: float = 1.0, unknown: float | None = None) -> Floats:
        """(n,) a field in our unit; NaN where it holds the value that means unknown, or is missing."""
        if name not in (self.cells.dtype.names or ()):
            return np.full(len(self), np.nan)
        raw = as_floats(self.cells[name])
        return np.where(raw == unknown, np.nan, raw * scale) if unknown is not None else raw * scale

    def vector(self, *names: str, scale: float = 1.0) -> Floats:
        """(n, len(names)) fields side by side."""
        return np.column_stack([self.column(n, scale=scale) for n in names])

    @property
    def stamp(self) -> Ints:
        """(n,) us on the sender's boot or Unix clock; 0 where the message has none."""
        names = self.cells.dtype.names or ()
        if "time_boot_ms" in names:
            return self.cells["time_boot_ms"].astype(np.int64) * 1000
        return self.cells["time_usec"].astype(np.int64) if "time_usec" in names else np.zeros(len(self), np.int64)


@final
class _Gathered:
    """Payloads and arrivals by (system, component, message id)."""

    def __init__(self, first_arrival: int) -> None:
        self.payloads: dict[tuple[int, int, int], bytearray] = {}
        self.arrivals: dict[tuple[int, int, int], list[int]] = {}
        self._last = self._doubted = first_arrival

    def add(self, key: tuple[int, int, int], payload: bytes, width: int, arrival: int) -> None:
        """MAVLink 2 cuts trailing zeros off a payload, and a newer dialect may have appended fields: width is ours."""
        if abs(arrival - self._last) > DAY and abs(arrival - self._doubted) > DAY:
            self._doubted, arrival = arrival, self._last  # no checksum covers it: the next message must confirm a jump
        else:
            self._last = arrival
        self.payloads.setdefault(key, bytearray()).extend(payload[:width].ljust(width, b"\0"))
        self.arrivals.setdefault(key, []).append(min(arrival, LATEST))


@final
@dataclass(slots=True)
class Scan:
    """One pass over a file. vehicles : tables by message name, by system id."""

    vehicles: Mapping[int, Mapping[str, Table]]
    malformed: Mapping[str, int]  # frames of a wanted type with a wrong checksum
    skipped: int  # bytes that belong to no frame
    cut: bool  # the last frame is incomplete


def definitions(names: tuple[str, ...]) -> dict[int, Definition]:
    """The wanted messages of the ArduPilot dialect (which contains the common ones) by id."""
    from pymavlink.dialects.v20 import ardupilotmega

    known = cast("dict[int, Definition]", ardupilotmega.mavlink_map)
    return {i: d for i, d in known.items() if d.msgname in names}


def row_type(d: Definition) -> np.dtype[Any]:
    """The wire layout of a message; fields are in wire order, little-endian."""
    letters = bytes(d.native_format).decode().lstrip("<")
    codes = {"c": "S1", "b": "i1", "B": "u1", "h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4", "q": "<i8", "Q": "<u8"}
    codes |= {"f": "<f4", "d": "<f8"}
    columns: list[tuple[str, str, tuple[int, ...]]] = []
    for name, letter, n in zip(d.ordered_fieldnames, letters, d.array_lengths, strict=True):
        columns.append((name, codes[letter], (n,) if n else ()))
    return np.dtype(cast(Any, columns))


def scan(data: bytes, names: tuple[str, ...], progress: Progress | None = None) -> Scan:
    """Gather every frame of the wanted messages; a damaged stretch is skipped up to the next frame that fits."""
    from fastcrc import crc16  # what pymavlink itself computes checksums with

    checksum = cast("Callable[[bytes, int], int]", crc16.mcrf4xx)
    wanted = definitions(names)
    rows = {i: row_type(d) for i, d in wanted.items()}
    found, malformed = _Gathered(int.from_bytes(data[:8], "big")), dict[str, int]()
    size, i, skipped, report, cut = len(data), 0, 0, 0, False
    while i + 16 <= size:
        if progress is not None and i >= report:
            progress(i, size)
            report = i + REPORT_EVERY
        if data[i + 8] == 0xFD:
            head, tail = 18, 15 if data[i + 10] & 1 else 2  # a signature follows the checksum
            system, component, kind = data[i + 13], data[i + 14], int.from_bytes(data[i + 15 : i + 18], "little")
        else:
            head, tail = 14, 2
            system, component, kind = data[i + 11], data[i + 12], data[i + 13]
        stop = i + head + data[i + 9]
        end = stop + tail
        whole = data[i + 8] in MAGIC and end <= size
        cut |= data[i + 8] in MAGIC and end > size
        fits = whole and (end + 9 > size or data[end + 8] in MAGIC)
        if whole and kind in wanted:
            sent = int.from_bytes(data[stop : stop + 2], "little")
            if checksum(data[i + 9 : stop] + bytes((wanted[kind].crc_extra,)), 0xFFFF) == sent:
                arrival = int.from_bytes(data[i : i + 8], "big")
                found.add((system, component, kind), data[i + head : stop], rows[kind].itemsize, arrival)
                fits, cut = True, False
            elif fits:
                name = wanted[kind].msgname
                malformed[name] = malformed.get(name, 0) + 1
        if not fits:  # go on at the next place where a frame could start
            start = FRAME_START.search(data, i + 9)
            end = start.start() - 8 if start else size
            skipped += end - i
        i = end
    return Scan(_by_vehicle(found, wanted, rows), malformed, skipped, cut or i < size)


def _by_vehicle(
    found: _Gathered, wanted: dict[int, Definition], rows: dict[int, np.dtype[Any]]
) -> dict[int, dict[str, Table]]:
    """Tables of the autopilot component of each system; of the lowest component if none calls itself autopilot."""
    vehicles: dict[int, dict[str, Table]] = {}
    for system in sorted({s for s, _, _ in found.payloads}):
        components = {c for s, c, _ in found.payloads if s == system}
        chosen = AUTOPILOT if AUTOPILOT in components else min(components)
        vehicles[system] = {}
        for key, raw in found.payloads.items():
            if key[:2] == (system, chosen):
                name, arrival = wanted[key[2]].msgname, np.array(found.arrivals[key], np.int64)
                vehicles[system][name] = Table(name, arrival, np.frombuffer(bytes(raw), rows[key[2]]))
    return vehicles


@final
class Clock:
    """Puts the stamps and arrivals of one vehicle on one clock: time since the boot that the log begins with [us].

    Sensor stamps count from boot (or from 1970), arrivals on the ground station's clock. The two differ by a constant
    plus the link's latency, so the constant is the low end (1 %) of arrival - stamp; a message without a stamp, or with
    the stamp 0 that means "none yet", gets its arrival less that constant. A reboot begins a new constant, and the
    log's clock runs on across it. Without any boot stamp the log's clock is the arrival clock.
    """

    def __init__(self, tables: Mapping[str, Table]) -> None:
        steady = [t for t in tables.values() if not t.name.startswith("GPS")]  # which repeat a stamp without a fix
        arrival, stamp = self._all(steady)
        boot = (stamp > 0) & (stamp < UNIX)
        restart = np.flatnonzero(np.diff(stamp[boot]) < -REBOOT) + 1
        self.lives = np.concatenate([[np.iinfo(np.int64).min], arrival[boot][restart]]).astype(np.int64)
        self.offsets = self._offsets(arrival[boot], stamp[boot])
        arrival, stamp = self._all(list(tables.values()))
        self.unix_offsets = self._offsets(arrival[stamp >= UNIX], stamp[stamp >= UNIX])
        self.zero = int(self.offsets[0])

    @staticmethod
    def _all(tables: Sequence[Table]) -> tuple[Ints, Ints]:
        """(arrival, stamp) of all messages in the order of arrival."""
        arrival = np.concatenate([t.arrival for t in tables] or [np.zeros(0, np.int64)])
        stamp = np.concatenate([t.stamp for t in tables] or [np.zeros(0, np.int64)])
        order = np.argsort(arrival, kind="stable")
        return arrival[order], stamp[order]

    def _life(self, arrival: Ints) -> Ints:
        return np.searchsorted(self.lives, arrival, side="right") - 1

    def _offsets(self, arrival: Ints, stamp: Ints) -> Ints:
        life, out = self._life(arrival), np.zeros(self.lives.size, np.int64)
        for k in range(self.lives.size):
            gaps = (arrival - stamp)[life == k]
            out[k] = np.percentile(gaps, 1, method="lower") if gaps.size else 0
        return out

    def stamps(self, table: Table) -> tuple[Ints, Ints]:
        """(t, t_arrival) in ns on the log's clock."""
        life, stamp = self._life(table.arrival), table.stamp
        arrival = table.arrival - self.zero
        t = np.where(stamp >= UNIX, stamp + self.unix_offsets[life], stamp + self.offsets[life]) - self.zero
        t = np.where(stamp > 0, t, arrival)
        return t * 1000, np.maximum(arrival, t) * 1000
