"""u-blox messages as streams, by the payload tables of `pyubx2`: the only file that knows it.

`pyubx2`'s parser makes one object per message; here the payloads of one type are gathered and decoded as columns. Most
messages carry the time of the GPS week (iTOW) only: the week comes from NAV-PVT or NAV-TIMEGPS.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any, Final, cast, final

import numpy as np

from outrider.core.frames import heading_from_azimuth, ned_to_enu
from outrider.data import Altitude, Fix, Kind, Stream, stream
from outrider.io._shared import as_floats
from outrider.io.stamps import DAY, gps_to_unix
from outrider.typing import Bools, Floats, Ints

WEEK: Final = 7 * DAY
TYPES: Final = {  # class and number on the wire
    b"\x01\x07": "NAV-PVT", b"\x01\x14": "NAV-HPPOSLLH", b"\x01\x02": "NAV-POSLLH", b"\x01\x12": "NAV-VELNED",
    b"\x01\x03": "NAV-STATUS", b"\x01\x20": "NAV-TIMEGPS", b"\x01\x3c": "NAV-RELPOSNED",
}  # fmt: skip
SHORTEST: Final = {"NAV-PVT": 84}  # older receivers send fewer fields; otherwise the length is that of the table
DATE_AND_TIME: Final = 3  # NAV-PVT valid: both known
TOW_AND_WEEK: Final = 3  # NAV-TIMEGPS valid: both known
MOVING_BASELINE: Final = 0b1_0010_0101  # NAV-RELPOSNED flags: fix, relative position, moving base, heading valid


@final
@dataclass(slots=True)
class Messages:
    """Payloads by type, and where each stood in the file."""

    payloads: dict[str, bytearray] = field(default_factory=dict[str, bytearray])
    places: dict[str, list[int]] = field(default_factory=dict[str, list[int]])
    malformed: dict[str, int] = field(default_factory=dict[str, int])

    def take(self, kind: bytes, payload: bytes, place: int) -> None:
        """Add a message whose checksum was right; types that hold nothing for us are passed over."""
        name = TYPES.get(kind)
        if name is None or not payload:  # an empty one is the question for such a message
            return
        width = layouts()[name].itemsize
        if not SHORTEST.get(name, width) <= len(payload) <= width:
            self.malformed[name] = self.malformed.get(name, 0) + 1
            return
        self.payloads.setdefault(name, bytearray()).extend(payload.ljust(width, b"\0"))
        self.places.setdefault(name, []).append(place)

    def streams(self, notes: list[str]) -> list[Stream]:
        """Positions, velocities and headings, best first, with what is odd about them."""
        tables = {n: np.frombuffer(bytes(p), layouts()[n]) for n, p in self.payloads.items()}
        places = {n: np.array(p, np.int64) for n, p in self.places.items()}
        clock = Clock.of(tables, places)
        out: list[Stream] = []
        for name, build in BUILDERS.items():
            if name not in tables:
                continue
            t, known = clock.stamps(tables[name], places[name])
            if not known.all():
                notes.append(f"{int((~known).sum())} {name} came without a date and were left out")
            bad = self.malformed.get(name, 0)
            built = build(name, tables[name][known], t[known], Fixes.of(tables))
            out += [replace(built[0], malformed=bad), *built[1:]]
        return out


@cache
def layouts() -> Mapping[str, np.dtype[Any]]:
    """Payload of each type of message as pyubx2 lists it."""
    from pyubx2.ubxtypes_get import UBX_PAYLOADS_GET

    return {name: _layout(cast("Mapping[str, Any]", UBX_PAYLOADS_GET[name])) for name in TYPES.values()}


def _layout(fields: Mapping[str, Any]) -> np.dtype[Any]:
    """U004 is an unsigned number of four bytes, I signed, X a set of bits; a scale may stand beside it."""
    letters = {"U": "u", "I": "i", "X": "u"}
    out: list[tuple[str, str]] = []
    for name, what in fields.items():
        code = cast("str", what[0] if isinstance(what, tuple) else what)
        out.append((name, f"<{letters[code[0]]}{int(code[1:])}"))
    return np.dtype(out)


@final
@dataclass(frozen=True, slots=True)
class Clock:
    """Where in the file the week was told. place : in the file;  tow : ns of the week then;  start : Unix ns of it."""

    place: Ints
    tow: Ints
    start: Ints

    @classmethod
    def of(cls, tables: Mapping[str, Any], places: Mapping[str, Ints]) -> "Clock":
        """Of the messages that tell it."""
        parts: list[tuple[Ints, Ints, Ints]] = []
        if "NAV-PVT" in tables:
            table = tables["NAV-PVT"]
            t, known = utc(table)
            tow = table["iTOW"].astype(np.int64) * 10**6
            start = np.round((t - tow) / 1e6).astype(np.int64) * 10**6  # the solution is not on the millisecond
            parts.append((places["NAV-PVT"][known], tow[known], start[known]))
        if "NAV-TIMEGPS" in tables:
            table = tables["NAV-TIMEGPS"]
            known = (table["valid_bit"] & TOW_AND_WEEK) == TOW_AND_WEEK
            tow = table["iTOW"].astype(np.int64) * 10**6
            start = gps_to_unix(table["week"].astype(np.int64) * WEEK + tow) - tow
            parts.append((places["NAV-TIMEGPS"][known], tow[known], start[known]))
        none = np.zeros(0, np.int64)
        joined = [np.concatenate([none, *column]) for column in zip(*parts, strict=True)] if parts else [none] * 3
        order = np.argsort(joined[0], kind="stable")
        return cls(*(column[order] for column in joined))

    def stamps(self, table: Any, places: Ints) -> tuple[Ints, Bools]:
        """(n,) Unix ns of messages, and which have any."""
        if "year" in (table.dtype.names or ()):
            return utc(table)
        if not self.place.size:
            return np.zeros(places.size, np.int64), np.zeros(places.size, np.bool_)
        at = np.maximum(np.searchsorted(self.place, places, side="right") - 1, 0)
        tow = table["iTOW"].astype(np.int64) * 10**6
        turns = np.round((self.tow[at] - tow) / WEEK).astype(np.int64)  # the week may have ended meanwhile
        return self.start[at] + tow + turns * WEEK, np.ones(places.size, np.bool_)


def utc(table: Any) -> tuple[Ints, Bools]:
    """(n,) Unix ns by the calendar of NAV-PVT, and where the receiver knows it."""
    known = ((table["valid_bit"] & DATE_AND_TIME) == DATE_AND_TIME) & (table["month"] >= 1) & (table["month"] <= 12)
    months = np.where(known, (table["year"].astype(np.int64) - 1970) * 12 + table["month"] - 1, 0)
    days = months.astype("datetime64[M]").astype("datetime64[D]").astype(np.int64) + table["day"].astype(np.int64) - 1
    seconds = table["hour"].astype(np.int64) * 3600 + table["min"].astype(np.int64) * 60 + table["second"]
    return days * DAY + seconds * 10**9 + table["nano"].astype(np.int64), known


@final
@dataclass(frozen=True, slots=True)
class Fixes:
    """Fix type and satellites by the time of the week [ms], for messages that say neither."""

    tow: Ints
    fix: Floats
    satellites: Floats

    @classmethod
    def of(cls, tables: Mapping[str, Any]) -> "Fixes":
        """Of NAV-PVT, else of NAV-STATUS."""
        table = tables.get("NAV-PVT", tables.get("NAV-STATUS"))
        if table is None:
            none = np.zeros(0)
            return cls(np.zeros(0, np.int64), none, none)
        tow, first = np.unique(table["iTOW"].astype(np.int64), return_index=True)
        rows = table[first]
        seen = as_floats(rows["numSV"]) if "numSV" in rows.dtype.names else np.full(tow.size, np.nan)
        return cls(tow, fix_types(rows), seen)

    def at(self, table: Any) -> dict[str, Floats]:
        """For the messages of a table; unknown where no other message is of that time."""
        tow = table["iTOW"].astype(np.int64)
        fix, seen = np.full(tow.size, float(Fix.UNKNOWN.value)), np.full(tow.size, np.nan)
        if self.tow.size:
            index = np.minimum(np.searchsorted(self.tow, tow), self.tow.size - 1)
            same = self.tow[index] == tow
            fix[same], seen[same] = self.fix[index[same]], self.satellites[index[same]]
        return {"fix": fix, "satellites": seen}


def fix_types(table: Any) -> Floats:
    """(n,) `Fix` codes of NAV-PVT or NAV-STATUS; two dimensions and pure dead reckoning are no fix."""
    pvt = "fixType" in table.dtype.names
    kind, flags = table["fixType" if pvt else "gpsFix"], table["flags_bit"]
    carrier = (flags if pvt else table["flags2_bit"]) >> 6
    fix = np.where(flags & 2, Fix.DGNSS.value, Fix.SINGLE.value)
    fix = np.where(carrier == 1, Fix.FLOAT.value, np.where(carrier == 2, Fix.FIXED.value, fix))
    return np.where(np.isin(kind, (3, 4)) & (flags & 1 > 0), fix, Fix.NONE.value).astype(np.float64)


def _pvt(name: str, table: Any, t: Ints, _: Fixes) -> list[Stream]:
    extra = {"fix": fix_types(table), "satellites": as_floats(table["numSV"])}
    extra["pdop"] = as_floats(table["pDOP"]) * 0.01
    at = _position(name, table, t, extra)
    v = ned_to_enu(np.column_stack([as_floats(table[n]) for n in ("velN", "velE", "velD")]) * 1e-3)
    return [at, _velocity(f"{name}#velocity", table, t, v, extra)]


def _llh(name: str, table: Any, t: Ints, fixes: Fixes) -> list[Stream]:
    return [_position(name, table, t, fixes.at(table))]


def _ned(name: str, table: Any, t: Ints, fixes: Fixes) -> list[Stream]:
    v = ned_to_enu(np.column_stack([as_floats(table[n]) for n in ("velN", "velE", "velD")]) * 1e-2)
    return [_velocity(f"{name}#velocity", table, t, v, fixes.at(table), scale=1e-2)]


def _position(name: str, table: Any, t: Ints, extra: Mapping[str, Floats]) -> Stream:
    """lon, lat in 1e-7 deg (finer digits of 1e-9 deg), heights and accuracies in mm (of 0.1 mm there)."""
    fine = "_HPlat" in table.dtype.names

    def column(own: str, digits: str, scale: float, finer: float) -> Floats:
        return as_floats(table[own]) * scale + (as_floats(table[digits]) * finer if fine else 0.0)

    lat, lon = column("lat", "_HPlat", 1e-7, 1e-9), column("lon", "_HPlon", 1e-7, 1e-9)
    msl, height = column("hMSL", "_HPhMSL", 1e-3, 1e-4), column("height", "_HPheight", 1e-3, 1e-4)
    h, v = (as_floats(table[n]) * (1e-4 if fine else 1e-3) for n in ("hAcc", "vAcc"))
    bits = "flags_bit" if fine else "flags3_bit"
    invalid = (table[bits] & 1) > 0 if bits in table.dtype.names else np.zeros(t.size, np.bool_)
    z = np.column_stack([np.radians(lat), np.radians(lon), msl])
    fix = np.where(invalid, Fix.NONE.value, extra["fix"])
    more = {**extra, "fix": fix, "hacc": h, "vacc": v, "alt_ellipsoid": height}
    return stream(name, Kind.GNSS, t, z, var=np.column_stack([h, h, v]) ** 2, altitude=Altitude.MSL, extra=more)


def _velocity(name: str, table: Any, t: Ints, v: Floats, extra: Mapping[str, Floats], scale: float = 1e-3) -> Stream:
    sigma = np.repeat(as_floats(table["sAcc"])[:, None] * scale, 3, axis=1)
    told = {n: extra[n] for n in ("fix", "satellites")}
    return stream(name, Kind.GNSS_VELOCITY, t, v, var=sigma**2, extra=told)


def _heading(name: str, table: Any, t: Ints, _: Fixes) -> list[Stream]:
    """Of the baseline between two antennas on one vehicle; from a fixed base it is no heading."""
    azimuth, sigma = (np.radians(as_floats(table[n]) * 1e-5)[:, None] for n in ("relPosHeading", "accHeading"))
    s = stream(name, Kind.HEADING, t, heading_from_azimuth(azimuth), var=sigma**2)
    return [s.select((table["flags_bit"] & MOVING_BASELINE) == MOVING_BASELINE)]


BUILDERS: Final = {
    "NAV-HPPOSLLH": _llh, "NAV-PVT": _pvt, "NAV-POSLLH": _llh, "NAV-VELNED": _ned, "NAV-RELPOSNED": _heading,
}  # fmt: skip
