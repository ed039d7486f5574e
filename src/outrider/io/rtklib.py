"""RTKLIB solutions (.pos): positions by latitude, Earth-centred or from a base, with fix type and covariance.

The comment above the rows says in which time and which coordinates they are. Standard deviations stand as north, east,
up; heights are ellipsoidal unless the header says geodetic. GPS time becomes Unix time.
"""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import final

import numpy as np

from outrider.core.geodesy import ecef_to_geodetic
from outrider.data import Altitude, EventLog, Fix, Kind, Stream, stream
from outrider.errors import DataError
from outrider.io._shared import fix_codes
from outrider.io.files import Progress, assemble, ensure_readable
from outrider.io.stamps import DAY, GPS_EPOCH, gps_to_unix, to_nanoseconds
from outrider.typing import Bools, Floats, Ints

COLUMNS = re.compile(r"%.*(latitude\((?:deg|d'\")\)|x-ecef\(m\)|e-baseline\(m\))")
FIX_OF_Q = {1: Fix.FIXED, 2: Fix.FLOAT, 3: Fix.SBAS, 4: Fix.DGNSS, 5: Fix.SINGLE, 6: Fix.FLOAT}  # 6: PPP, not resolved
NUMBERS = 12  # after the position: Q ns, three deviations, three covariances, age, ratio; then velocities if any
JST = 9 * 3600 * 10**9  # ns, Japan ahead of UTC
REPORT_EVERY = 1 << 12  # lines


@final
@dataclass(slots=True)
class Header:
    """What the comments say."""

    time: str = "GPST"
    position: str = ""  # latitude(deg), latitude(d'"), x-ecef(m) or e-baseline(m)
    altitude: Altitude = Altitude.ELLIPSOID

    def read(self, line: str) -> None:
        """Take what a comment says, if anything."""
        if "lat/lon/height" in line and "geodetic" in line:
            self.altitude = Altitude.MSL
        found = COLUMNS.match(line)
        if found:
            self.position = found[1]
            self.time = next((t for t in ("GPST", "UTC", "JST") if t in line), "GPST")


@final
@dataclass(slots=True)
class Rows:
    """Stamps as text and numbers of every line that could be read."""

    dates: list[str] = field(default_factory=list[str])
    times: list[str] = field(default_factory=list[str])
    numbers: list[list[float]] = field(default_factory=list[list[float]])
    broken: int = 0


def read_pos(
    path: Path,
    *,
    robot: str = "robot",
    topics: Sequence[str] | None = None,
    start_s: float | None = None,
    end_s: float | None = None,
    progress: Progress | None = None,
) -> EventLog:
    """Read an RTKLIB solution. Streams: `solution` (GNSS, or POSITION for a baseline) and `solution#velocity`.

    extra : fix, satellites, age [s] of the corrections, ratio of the ambiguity test
    """
    header, rows = _lines(ensure_readable(path), progress)
    if not header.position:
        raise DataError("no line says what its columns are", where=str(path), fix="let RTKLIB write the header")
    t, stamped = _stamps(header, rows)
    numbers = np.array(rows.numbers or np.zeros((0, 5)), np.float64)[stamped]
    broken = rows.broken + int((~stamped).sum())
    streams = _streams(header, t[stamped], numbers, broken, robot)
    notes = [f"{broken} lines could not be read and were left out"] if broken else []
    return assemble(path, streams, notes=notes, topics=topics, start_s=start_s, end_s=end_s)


def _lines(path: Path, progress: Progress | None) -> tuple[Header, Rows]:
    header, rows, done, size = Header(), Rows(), 0, path.stat().st_size
    with path.open("rb") as f:
        for number, raw in enumerate(f):
            done += len(raw)
            if progress is not None and number % REPORT_EVERY == 0:
                progress(done, size)
            line = raw.decode("utf-8-sig" if number == 0 else "ascii", "replace").strip()
            if line.startswith("%"):
                header.read(line)
            elif line and not line.startswith("#"):
                _row(line, header, rows)
    width = Counter(map(len, rows.numbers)).most_common(1)[0][0] if rows.numbers else 0
    whole = [i for i, r in enumerate(rows.numbers) if len(r) == width]  # the last line may have been cut
    rows.broken += len(rows.numbers) - len(whole)
    rows.dates, rows.times, rows.numbers = (
        [rows.dates[i] for i in whole], [rows.times[i] for i in whole], [rows.numbers[i] for i in whole]
    )  # fmt: skip
    return header, rows


def _row(line: str, header: Header, rows: Rows) -> None:
    cells = re.split(r"[\s,;]+", line)
    try:
        values = [float(c) for c in cells[2:]]
    except ValueError:
        values = []
    if header.position.startswith("latitude(d'"):
        values = _degrees(values)
    if len(values) < 5 or not np.isfinite(values[:5]).all():
        rows.broken += 1
        return
    rows.dates.append(cells[0])
    rows.times.append(cells[1])
    rows.numbers.append(values)


def _degrees(values: list[float]) -> list[float]:
    """Degrees, minutes, seconds of latitude and longitude as degrees."""
    if len(values) < 6:
        return []
    out = [np.copysign(abs(d) + m / 60 + s / 3600, d) for d, m, s in (values[:3], values[3:6])]
    return [*out, *values[6:]]


def _stamps(header: Header, rows: Rows) -> tuple[Ints, Bools]:
    """(n,) Unix ns, and which could be read: week and seconds of week, or a date and a time of day."""
    seconds, good = to_nanoseconds([_of_day(c) for c in rows.times], "s")
    days = np.array([_day(d) for d in rows.dates], np.float64).reshape(-1)
    good &= np.isfinite(days)
    dated = np.array(["/" in d or "-" in d for d in rows.dates], np.bool_).reshape(-1)
    whole = np.where(good, days, 0).astype(np.int64) * DAY + seconds
    if header.time == "GPST":
        return gps_to_unix(np.where(dated, whole - GPS_EPOCH, whole)), good
    return whole - (JST if header.time == "JST" else 0) + np.where(dated, 0, GPS_EPOCH), good


def _day(text: str) -> float:
    """Days since 1970 of a date, or since 1980-01-06 of a GPS week; NaN for neither."""
    try:
        if text.isdecimal() and len(text) <= 4:
            return 7.0 * int(text)
        day = datetime.strptime(text.replace("-", "/"), "%Y/%m/%d").replace(tzinfo=UTC)
        return float((day - datetime(1970, 1, 1, tzinfo=UTC)).days)
    except ValueError:
        return np.nan


def _of_day(text: str) -> str:
    """A time of day as seconds; seconds stay what they are, and nonsense stays unreadable."""
    parts = text.split(":")
    if len(parts) != 3 or not (parts[0].isdecimal() and parts[1].isdecimal()):
        return text
    whole, _, fraction = parts[2].partition(".")
    if not whole.isdecimal():
        return ""
    return f"{int(parts[0]) * 3600 + int(parts[1]) * 60 + int(whole)}.{fraction or 0}"


def _streams(header: Header, t: Ints, numbers: Floats, broken: int, robot: str) -> list[Stream]:
    if not t.size:
        return []
    padded = np.full((t.size, 3 + NUMBERS + 6), np.nan)
    width = min(numbers.shape[1], padded.shape[1])
    padded[:, :width] = numbers[:, :width]
    p, q, satellites, s = padded[:, :3], padded[:, 3], padded[:, 4], padded[:, 5:8]
    extra = {"fix": fix_codes(q, FIX_OF_Q), "satellites": satellites, "age": padded[:, 11], "ratio": padded[:, 12]}
    return [
        _positions(header, t, p, s, extra, broken, robot),
        *_velocities(header, t, padded[:, 13:], extra, robot),
    ]


def _positions(
    header: Header, t: Ints, p: Floats, s: Floats, extra: Mapping[str, Floats], broken: int, robot: str
) -> Stream:
    kind, altitude, var = Kind.GNSS, Altitude.ELLIPSOID, _squares(s)
    if header.position.startswith("e-base"):
        kind, altitude = Kind.POSITION, Altitude.UNKNOWN
    elif header.position.startswith("x-ecef"):  # its deviations are along the Earth's axes: the mean of all three
        p = np.column_stack(ecef_to_geodetic(p))
        var = np.repeat(var.mean(axis=1, keepdims=True), 3, axis=1)
    else:
        p = np.column_stack([np.radians(p[:, :2]), p[:, 2]])
        altitude, var = header.altitude, var[:, [1, 0, 2]]
    return stream("solution", kind, t, p, var=var, altitude=altitude, extra=extra, malformed=broken, robot=robot)


def _squares(s: Floats) -> Floats:
    """Variances of deviations, however absurd."""
    return np.minimum(np.abs(s), 1e100) ** 2


def _velocities(header: Header, t: Ints, v: Floats, extra: Mapping[str, Floats], robot: str) -> list[Stream]:
    """North, east, up and their deviations, where the solution has them."""
    known = np.flatnonzero(np.isfinite(v[:, :3]).all(axis=1))
    if not header.position.startswith("lat") or not known.size:
        return []
    z, var = v[:, [1, 0, 2]], _squares(v[:, [4, 3, 5]])
    rest = {"fix": extra["fix"], "satellites": extra["satellites"]}
    s = stream("solution#velocity", Kind.GNSS_VELOCITY, t, z, var=var, extra=rest, robot=robot)
    return [s.select(known)]
