"""ArduPilot on-board logs (.BIN, DataFlash), by the format table of `pymavlink`.

A record is A3 95, a type, and fields as an earlier FMT record declared them. `pymavlink`'s reader makes one object per
record; here the offsets of one type are gathered and its fields decoded as columns. Stamps (TimeUS) are microseconds
since boot; body vectors are forward-right-down, world vectors north-east-down, angles degrees.
"""

import mmap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast, final

import numpy as np

from outrider.core.attitudes import rpy_to_quats
from outrider.core.frames import frd_to_flu, ned_to_enu, quat_ned_frd_to_enu_flu
from outrider.data import Altitude, EventLog, Kind, Stream, stream
from outrider.io._shared import (
    FIX_OF_CODE,
    as_floats,
    fix_codes,
    last_before,
    nearest,
    pressure_altitude,
    site_positions,
)
from outrider.io.files import Progress, assemble, ensure_readable
from outrider.typing import Bools, Floats, Ints

FORMAT = 0x80  # the type of the FMT record, and its length
FORMAT_LENGTH = 89
REPORT_EVERY = 1 << 20
PAIRING = 200_000  # us: a record of another type further away in time is not paired
DEGREE = np.pi / 180
GPS_EPOCH = 315_964_800  # s, 1980-01-06 since 1970
LEAP = 18  # s, GPS ahead of UTC since 2017
POS_HORIZ_ABS, CONST_POS_MODE = 16, 128  # XKF4.SS
DOWNWARD = 25  # RFND.Orient: pitched down by 90 degrees
IN_RANGE = 4  # RFND.Stat
PADDING = 528  # bytes of filling that a block-based logger leaves at the end of a log

WANTED = (
    "IMU", "IMU2", "IMU3", "GPS", "GPS2", "GPA", "GPA2", "BARO", "BAR2", "MAG", "MAG2", "MAG3", "POS", "ATT", "XKF1",
    "NKF1", "XKF4", "NKF4", "RFND", "OF",
)  # fmt: skip


@final
@dataclass(frozen=True, slots=True)
class Layout:
    """One record type as its FMT declares it."""

    name: str
    length: int
    dtype: np.dtype[Any]
    scale: Mapping[str, float]


@final
@dataclass(frozen=True, slots=True)
class Table:
    """All records of one type and one sensor instance; columns by name, scaled as the format says."""

    name: str
    cells: np.ndarray
    scale: Mapping[str, float]

    def __len__(self) -> int:
        return int(self.cells.size)

    @property
    def stamp(self) -> Ints:
        """(n,) us since boot."""
        return self.cells["TimeUS"].astype(np.int64)

    def has(self, *names: str) -> bool:
        """Whether all these fields are there."""
        return all(n in (self.cells.dtype.names or ()) for n in names)

    def column(self, name: str, scale: float = 1.0) -> Floats:
        """(n,) a field, NaN where there is no such field."""
        if not self.has(name):
            return np.full(len(self), np.nan)
        return as_floats(self.cells[name]) * (self.scale.get(name, 1.0) * scale)

    def vector(self, *names: str, scale: float = 1.0) -> Floats:
        """(n, len(names)) fields side by side."""
        return np.column_stack([self.column(n, scale) for n in names])

    def stream(self, kind: Kind, z: Floats, *, suffix: str = "", var: Floats | None = None, **rest: object) -> Stream:
        """A stream under the record's name, stamped with it."""
        t = self.stamp * 1000
        return stream(self.name + suffix, kind, t, z, var=var, t_arrival=t, **rest)


def read_dataflash(
    path: Path,
    *,
    robot: str = "robot",
    topics: Sequence[str] | None = None,
    start_s: float | None = None,
    end_s: float | None = None,
    progress: Progress | None = None,
) -> EventLog:
    """Read an ArduPilot on-board log.

    Streams carry the record's name and, from the second sensor on, its number (`IMU`, `IMU_1`); GNSS velocity is
    `GPS#velocity`, the autopilot's own answer the ESTIMATE `autopilot` (extra: lat, lon [rad], alt [m], valid).
    Simulator records (SIM, SIM2) are truth and never read.
    """
    with ensure_readable(path).open("rb") as f, mmap.mmap(f.fileno(), 0, access=mmap.ACCESS_READ) as data:
        tables, notes = _gather(cast(bytes, data), progress)
    streams = [replace(s, robot=robot) for s in _streams(tables)]
    return assemble(path, streams, notes=notes, topics=topics, start_s=start_s, end_s=end_s)


def _layout(record: bytes, letters: Mapping[str, tuple[str, float | None, type]]) -> tuple[int, Layout] | None:
    """The type and layout that an FMT record declares; None if it cannot be one."""
    kind, length = record[3], record[4]
    name, form, names = (record[a:b].split(b"\0")[0].decode("ascii", "replace") for a, b in ((5, 9), (9, 25), (25, 89)))
    columns = names.split(",") if names else []
    unknown = [c for c in form if c not in letters]
    if unknown or len(columns) != len(form) or len(set(columns)) != len(columns):
        return None
    codes = [letters[c][0] for c in form]
    fields = [(n, f"S{c[:-1]}" if c.endswith("s") else f"<{c}") for n, c in zip(columns, codes, strict=True)]
    dtype = np.dtype([("header", "S3"), *fields])
    scale = {n: factor for n, c in zip(columns, form, strict=True) if (factor := letters[c][1]) is not None}
    return (kind, Layout(name, length, dtype, scale)) if dtype.itemsize == length else None


def _gather(data: bytes, progress: Progress | None) -> tuple[dict[str, Table], list[str]]:
    """Tables by name and instance, and what was wrong with the file."""
    from pymavlink.DFReader import FORMAT_TO_STRUCT

    letters = cast("Mapping[str, tuple[str, float | None, type]]", FORMAT_TO_STRUCT)
    layouts: dict[int, Layout] = {}
    length = [0] * 256  # 0: not declared
    length[FORMAT] = FORMAT_LENGTH
    rows: dict[int, bytearray] = {}
    size, i, skipped, report = len(data), 0, 0, 0
    while i + 3 <= size:
        if progress is not None and i >= report:
            progress(i, size)
            report = i + REPORT_EVERY
        kind = data[i + 2]
        step = length[kind] if data[i] == 0xA3 and data[i + 1] == 0x95 else 0
        if not step:
            at = data.find(b"\xa3\x95", i + 1)
            skipped, i = skipped + ((at if at >= 0 else size) - i), at if at >= 0 else size
            continue
        if i + step > size:
            break
        if kind == FORMAT and (declared := _layout(data[i : i + step], letters)) is not None:
            layouts[declared[0]] = declared[1]
            length[declared[0]] = declared[1].length
            if declared[1].name in WANTED:
                rows.setdefault(declared[0], bytearray())
        elif kind in rows:
            rows[kind] += data[i : i + step]
        i += step
    notes = [f"{skipped} bytes belong to no record and were skipped"] if skipped > PADDING else []
    if i < size:
        notes.append("the file is truncated: what had been written was read")
    return _by_instance(rows, layouts), notes


def _by_instance(rows: Mapping[int, bytearray], layouts: Mapping[int, Layout]) -> dict[str, Table]:
    """One table per record type and sensor: `IMU` holds the first, `IMU_1` the second."""
    tables: dict[str, Table] = {}
    for kind, raw in rows.items():
        layout = layouts[kind]
        if not raw or len(raw) % layout.length or "TimeUS" not in (layout.dtype.names or ()):
            continue
        cells = np.frombuffer(bytes(raw), layout.dtype)
        column = next((n for n in ("I", "Instance", "C") if n in (layout.dtype.names or ())), None)
        for k in np.unique(cells[column]) if column is not None else [0]:
            name = layout.name if k == 0 else f"{layout.name}_{k}"
            own = cells if column is None else cells[cells[column] == k]
            tables[name] = Table(name, own, layout.scale)
    return tables


def _streams(tables: Mapping[str, Table]) -> list[Stream]:
    out: list[Stream] = []
    for name, t in tables.items():
        base = name.split("_")[0].rstrip("23")
        if base == "IMU" and t.has("GyrX", "AccX"):
            w, f = t.vector("GyrX", "GyrY", "GyrZ"), t.vector("AccX", "AccY", "AccZ")
            out.append(t.stream(Kind.IMU, np.hstack([frd_to_flu(w), frd_to_flu(f)])))
        elif base == "GPS" and t.has("Lat", "Lng"):
            out += _gnss(t, tables.get(name.replace("GPS", "GPA")))
        elif base in ("BARO", "BAR") and t.has("Press"):
            out.append(t.stream(Kind.BARO, pressure_altitude(t.column("Press"))[:, None], altitude=Altitude.PRESSURE))
        elif base == "MAG" and t.has("MagX"):
            out.append(t.stream(Kind.MAG, frd_to_flu(t.vector("MagX", "MagY", "MagZ"))))
        elif base == "RFND" and t.has("Dist"):
            extra = {"valid": (t.column("Stat") == IN_RANGE).astype(float)}
            s = t.stream(Kind.RANGE_FINDER, t.vector("Dist"), extra=extra)
            out.append(s.select(t.column("Orient") == DOWNWARD))
        elif base == "OF" and t.has("flowX", "flowY"):
            flow = t.vector("flowX", "flowY") * [1.0, -1.0]
            out.append(t.stream(Kind.FLOW, flow, extra={"quality": t.column("Qual")}))
    return out + _estimate(tables)


def _gnss(t: Table, accuracy: Table | None) -> list[Stream]:
    """Position and velocity; accuracies and the time of the measurement come from the GPA record beside it."""
    sigma = np.full((len(t), 3), np.nan)  # horizontal, vertical, speed
    taken = t.stamp
    if accuracy is not None:
        index, near = nearest(accuracy.stamp, t.stamp, PAIRING)
        sigma[near] = accuracy.vector("HAcc", "VAcc", "SAcc")[index[near]]
        sampled = accuracy.column("SMS")[index] * 1e3
        sane = near & (sampled > 0) & (sampled <= t.stamp) & (sampled > t.stamp - 1e6)
        taken = np.where(sane, sampled, t.stamp).astype(np.int64)
    sigma[sigma <= 0] = np.nan
    fix, satellites = fix_codes(t.column("Status"), FIX_OF_CODE), t.column("NSats")
    utc = GPS_EPOCH - LEAP + t.column("GWk") * 604_800 + t.column("GMS") * 1e-3
    extra = {"fix": fix, "satellites": satellites, "hdop": t.column("HDop"), "hacc": sigma[:, 0], "vacc": sigma[:, 1]}
    extra["utc"] = np.where(t.column("GWk") > 0, utc, np.nan)
    z = np.column_stack([t.vector("Lat", "Lng", scale=DEGREE), t.column("Alt")])
    position = t.stream(Kind.GNSS, z, var=sigma[:, [0, 0, 1]] ** 2, altitude=Altitude.MSL, extra=extra)
    speed, course = t.column("Spd"), t.column("GCrs", DEGREE)  # clockwise from north
    v = np.column_stack([speed * np.sin(course), speed * np.cos(course), -t.column("VZ")])
    rest = {"fix": fix, "satellites": satellites}
    velocity = t.stream(Kind.GNSS_VELOCITY, v, suffix="#velocity", var=sigma[:, [2, 2, 2]] ** 2, extra=rest)
    return [replace(s, t=taken * 1000) for s in (position, velocity)]


def _estimate(tables: Mapping[str, Table]) -> list[Stream]:
    """The answer of the first estimator core: position from POS, attitude and velocity from XKF1 beside it."""
    core = tables.get("XKF1", tables.get("NKF1"))
    if core is None:
        return []
    t = tables.get("POS", core)
    index, near = nearest(core.stamp, t.stamp, PAIRING)
    q, v = np.full((len(t), 4), np.nan), np.full((len(t), 3), np.nan)
    attitude = quat_ned_frd_to_enu_flu(rpy_to_quats(core.vector("Roll", "Pitch", "Yaw", scale=DEGREE)))
    q[near], v[near] = attitude[index[near]], ned_to_enu(core.vector("VN", "VE", "VD"))[index[near]]
    extra: dict[str, Floats] = {}
    if t is core:
        p = ned_to_enu(core.vector("PN", "PE", "PD"))
    else:
        lat, lon, alt = t.column("Lat", DEGREE), t.column("Lng", DEGREE), t.column("Alt")
        lat[(lat == 0) & (lon == 0)] = np.nan  # no position yet
        p, extra = site_positions(lat, lon, alt), {"lat": lat, "lon": lon, "alt": alt}
    extra["valid"] = (np.isfinite(p[:, 0]) & _stands_by_position(t, tables)).astype(float)
    s = t.stream(Kind.ESTIMATE, np.hstack([p, q, v]), altitude=Altitude.MSL, extra=extra)
    return [replace(s, name="autopilot")]


def _stands_by_position(t: Table, tables: Mapping[str, Table]) -> Bools:
    """(n,) whether the last solution status before each record claims an absolute horizontal position."""
    status = tables.get("XKF4", tables.get("NKF4"))
    if status is None or not status.has("SS"):
        return np.ones(len(t), np.bool_)
    flags = status.column("SS").astype(np.int64)
    good = ((flags & POS_HORIZ_ABS) > 0) & ((flags & CONST_POS_MODE) == 0)
    index, known = last_before(status.stamp, t.stamp)
    return good[index] & known
