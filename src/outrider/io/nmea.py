"""NMEA 0183 sentences as streams, by `pynmea2`: the only file that knows it.

A sentence says the time of day at best; the date comes from RMC and ZDA and is carried over midnight. Speeds are knots,
courses clockwise from true north, heights above mean sea level.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import date, time
from typing import Any, Final, final

import numpy as np

from outrider.core.frames import heading_from_azimuth
from outrider.data import Altitude, Fix, Kind, Stream, stream
from outrider.io._shared import nearest
from outrider.io.stamps import DAY
from outrider.typing import Floats, Ints

Row = tuple[float, ...]
KNOT: Final = 1852 / 3600  # m/s
PAIRING: Final = 1_000_000  # ns: GST and GGA of one epoch carry the same time
EPOCH: Final = date(1970, 1, 1).toordinal()
FIX_OF_QUALITY: Final = {1: Fix.SINGLE, 2: Fix.DGNSS, 3: Fix.SINGLE, 4: Fix.FIXED, 5: Fix.FLOAT, 9: Fix.SBAS}
FIX_OF_MODE: Final = {"A": Fix.SINGLE, "P": Fix.SINGLE, "D": Fix.DGNSS, "F": Fix.FLOAT, "R": Fix.FIXED}
SIMULATED: Final = 8  # GGA quality of a simulator: a position like any other, of unknown quality


@final
@dataclass(slots=True)
class Sentences:
    """What was said, in order: rows by type, each with the index of its time in `times` and `days`."""

    rows: dict[str, list[Row]] = field(default_factory=dict[str, list[Row]])
    times: list[int] = field(default_factory=list[int])  # ns since midnight
    days: list[int] = field(default_factory=list[int])  # since 1970, -1 where the sentence gives none
    malformed: dict[str, int] = field(default_factory=dict[str, int])
    untimed: int = 0  # sentences without a time before the first one that has it

    def take(self, text: str) -> None:
        """Add a sentence whose checksum was right; types that hold nothing for us are passed over."""
        from pynmea2 import NMEASentence

        name = text[3:6]
        if name not in READERS or text[5] == ",":
            return
        try:
            said: Any = NMEASentence.parse(text)
            at = self._when(said)
            row = READERS[name](said)
        except (ValueError, AttributeError, TypeError, ArithmeticError, IndexError):
            self.malformed[name] = self.malformed.get(name, 0) + 1
            return
        if at < 0:
            self.untimed += 1
        elif row:
            self.rows.setdefault(name, []).append((float(at), *row))

    def _when(self, said: Any) -> int:
        """Index of the sentence's time; of the last one told if it has none itself."""
        told = getattr(said, "timestamp", None)
        if isinstance(told, time):
            ns = (told.hour * 3600 + told.minute * 60 + told.second) * 10**9 + told.microsecond * 1000
            self.times.append(ns)
            self.days.append(_day(said))
        return len(self.times) - 1

    def streams(self, notes: list[str]) -> list[Stream]:
        """Positions, velocities and headings, best first, with what is odd about them."""
        t, dated = dates(np.array(self.times, np.int64), np.array(self.days, np.int64))
        if not dated and self.rows:
            notes.append("no sentence gives the date: stamps count from the midnight before the log, a day late")
        if self.untimed:
            notes.append(f"{self.untimed} sentences before the first time of day were left out")
        return [*self._positions(t), *self._velocities(t), *self._headings(t)]

    def _table(self, name: str, t: Ints) -> tuple[Ints, Floats]:
        """Stamps and values of one type."""
        rows = np.array(self.rows[name], np.float64)
        return t[rows[:, 0].astype(np.int64)], rows[:, 1:]

    def _positions(self, t: Ints) -> list[Stream]:
        out: list[Stream] = []
        for name in ("GGA", "GNS", "RMC"):
            if name not in self.rows:
                continue
            at, v = self._table(name, t)
            if name == "RMC":  # no height
                v = np.column_stack([v[:, :2], np.full(len(v), np.nan), v[:, 4]])
            extra: dict[str, Floats] = dict(zip(("fix", "satellites", "hdop", "sep"), v[:, 3:].T, strict=False))
            if (separation := extra.pop("sep", None)) is not None:
                extra["alt_ellipsoid"] = v[:, 2] + separation
            z = np.column_stack([np.radians(v[:, :2]), v[:, 2]])
            var = self._variances(at, t)
            bad = self.malformed.get(name, 0)
            out.append(stream(name, Kind.GNSS, at, z, var=var, altitude=Altitude.MSL, extra=extra, malformed=bad))
        return out

    def _variances(self, at: Ints, t: Ints) -> Floats | None:
        """(n, 3) east, north, up of the GST sentence of the same epoch."""
        if "GST" not in self.rows:
            return None
        told, sigma = self._table("GST", t)
        index, near = nearest(told, at, PAIRING)
        return np.where(near[:, None], sigma[index] ** 2, np.nan)

    def _velocities(self, t: Ints) -> list[Stream]:
        out: list[Stream] = []
        for name, columns in (("RMC", (2, 3, 4)), ("VTG", (0, 1, 2))):
            if name in self.rows:
                at, v = self._table(name, t)
                speed, course, fix = v[:, columns].T
                course = np.where((speed == 0) & np.isnan(course), 0.0, course)  # at rest there is none
                z = np.column_stack([speed * np.sin(course), speed * np.cos(course), np.full(len(v), np.nan)])
                s = stream(f"{name}#velocity", Kind.GNSS_VELOCITY, at, z, extra={"fix": fix})
                out.append(s.select(np.isfinite(z[:, 0]) | (fix == Fix.NONE.value)))
        return out

    def _headings(self, t: Ints) -> list[Stream]:
        """Of two antennas, or of a gyrocompass: true, clockwise from north."""
        present = [n for n in ("THS", "HDT") if n in self.rows]
        tables = [self._table(n, t) for n in present]
        return [
            stream(n, Kind.HEADING, at, heading_from_azimuth(np.radians(v)))
            for n, (at, v) in zip(present, tables, strict=True)
        ]


def dates(times: Ints, days: Ints) -> tuple[Ints, bool]:
    """(n,) Unix ns of times of day in the order in which they came, and whether any of them had a date.

    days : since 1970, -1 where not told. A sentence without date takes that of its neighbour with the same time, else
    of the one before; a time that falls by half a day is past midnight.
    """
    step = np.diff(times, prepend=times[:1])
    nights = np.cumsum((step < -DAY // 2).astype(np.int64) - (step > DAY // 2))
    known = np.flatnonzero(days >= 0)
    if not known.size:
        return times + (nights + 1) * DAY, False  # a day more, because a stamp of zero is none
    order = np.arange(times.size)
    after = known[np.minimum(np.searchsorted(known, order), known.size - 1)]
    before = known[np.maximum(np.searchsorted(known, order, side="right") - 1, 0)]
    anchor = np.where((times[after] == times) | (before > order), after, before)
    return (days[anchor] + nights - nights[anchor]) * DAY + times, True


def _day(said: Any) -> int:
    """Days since 1970 that a sentence tells, else -1."""
    told = getattr(said, "datestamp", None)
    if isinstance(told, date):
        return told.toordinal() - EPOCH
    if said.sentence_type == "ZDA" and said.year:
        return date(int(said.year), int(said.month), int(said.day)).toordinal() - EPOCH
    return -1


def _number(value: Any) -> float:
    return float("nan") if value is None or value == "" else float(value)


def _place(said: Any) -> Row:
    """Latitude and longitude [deg], NaN where they are blank."""
    if not said.lat or not said.lon:
        return float("nan"), float("nan")
    if said.lat_dir not in ("N", "S") or said.lon_dir not in ("E", "W"):
        raise ValueError("no hemisphere")
    return float(said.latitude), float(said.longitude)


def _gga(said: Any) -> Row:
    quality = int(_number(said.gps_qual or 0))
    fix = Fix.UNKNOWN if quality == SIMULATED else FIX_OF_QUALITY.get(quality, Fix.NONE)
    rest = (_number(v) for v in (said.altitude, fix.value, said.num_sats, said.horizontal_dil, said.geo_sep))
    return *_place(said), *rest


def _gns(said: Any) -> Row:
    """One letter per constellation: the best of them is the solution's."""
    fix = max((FIX_OF_MODE.get(c, Fix.NONE).value for c in said.mode_indicator or ""), default=Fix.NONE.value)
    rest = (_number(v) for v in (said.altitude, fix, said.num_sats, said.hdop, said.geo_sep))
    return *_place(said), *rest


def _rmc(said: Any) -> Row:
    mode = said.mode_indicator if len(said.data) > 11 else "A"
    fix = FIX_OF_MODE.get(mode or "A", Fix.NONE) if said.status == "A" else Fix.NONE
    return *_place(said), _number(said.spd_over_grnd) * KNOT, np.radians(_number(said.true_course)), fix.value


def _vtg(said: Any) -> Row:
    mode = said.data[8] if len(said.data) > 8 else "A"
    fix = FIX_OF_MODE.get(mode or "A", Fix.NONE)
    return _number(said.spd_over_grnd_kts) * KNOT, np.radians(_number(said.true_track)), fix.value


def _gst(said: Any) -> Row:
    return tuple(_number(v) for v in (said.std_dev_longitude, said.std_dev_latitude, said.std_dev_altitude))


def _hdt(said: Any) -> Row:
    heading = _number(said.data[0])
    return (heading,) if np.isfinite(heading) else ()


def _ths(said: Any) -> Row:
    return _hdt(said) if said.data[1:2] == ["A"] else ()


READERS: Final[Mapping[str, Callable[[Any], Row]]] = {
    "GGA": _gga, "GNS": _gns, "RMC": _rmc, "VTG": _vtg, "GST": _gst, "HDT": _hdt, "THS": _ths, "ZDA": lambda _: (),
}  # fmt: skip
