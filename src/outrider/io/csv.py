"""Any CSV through a small mapping file: which column is the time, and which columns make which stream.

```yaml
time: {column: stamp, unit: us}            # s ms us ns, or iso for 2024-05-01T12:00:00.5Z
streams:
  imu:
    kind: IMU
    frame: frd                             # flu (default) or frd; for world vectors and attitudes enu or ned
    columns: {gyro_x: wx, gyro_y: wy, gyro_z: wz, accel_x: ax, accel_y: ay, accel_z: az}
    units: {gyro_x: deg/s, gyro_y: deg/s, gyro_z: deg/s, accel_x: g, accel_y: g, accel_z: g}
    sigma: 0.05                            # one number, or one per column: standard deviations in our units
    where: {sensor: imu}                   # only rows in which another column equals this
  fix:
    kind: GNSS
    columns: {lat: latitude, lon: longitude, alt: height}
    units: {lat: deg, lon: deg}
    altitude: ELLIPSOID
    extra: {fix: quality, satellites: ns}
    values: {fix: {1: 5, 2: 4, 5: 1}}      # the file's codes -> `Fix` codes (here those of RTKLIB)
```
A row takes part in every stream whose columns it fills; blank means absent. Cells that are not numbers are counted as
malformed, never fatal; a column that is not there is. Columns of a kind that are not mapped are NaN (not measured).
Where a kind has a quaternion, `yaw` (and `roll`, `pitch`) may stand instead. A stream may have a `time` of its own, and
`increments: true` where its columns are sums since the row before. Arrays are read likewise: `outrider.io.arrays`.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Literal, cast, final

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from outrider.core.attitudes import rpy_to_quats
from outrider.core.frames import heading_from_azimuth, ned_to_enu, quat_ned_frd_to_enu_flu
from outrider.data import Altitude, EventLog, Kind, Stream, stream
from outrider.errors import ConfigError
from outrider.io._table import Header, Rows, header_of, read_rows
from outrider.io.checked import Number, validated
from outrider.io.config import read_yaml
from outrider.io.files import Progress, assemble, closest, ensure_readable
from outrider.io.stamps import gps_to_unix
from outrider.typing import Bools, Floats, Ints

DEGREE = np.pi / 180
UNITS = {
    "rad": 1.0, "deg": DEGREE, "1e-7 deg": 1e-7 * DEGREE, "m": 1.0, "cm": 1e-2, "mm": 1e-3, "km": 1e3, "ft": 0.3048,
    "m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "km/h": 1 / 3.6, "mph": 0.44704, "kn": 1852 / 3600, "rad/s": 1.0,
    "deg/s": DEGREE, "mrad/s": 1e-3, "m/s2": 1.0, "g": 9.80665, "mg": 9.80665e-3, "1": 1.0,
}  # fmt: skip
QUATERNION, ANGLES = ("qx", "qy", "qz", "qw"), ("roll", "pitch", "yaw")
BODY = {Kind.IMU, Kind.MAG, Kind.BODY_VELOCITY, Kind.TWIST, Kind.FLOW, Kind.RANGE_BEARING, Kind.ACKERMANN}
TURNED = ("_y", "_z", "bearing", "steering")  # endings of what changes sign from forward-right-down to forward-left-up
AXES = {Kind.POSITION, Kind.POSE, Kind.ODOMETRY_POSE, Kind.ESTIMATE, Kind.COMMAND}  # x y z: north-east-down swaps them


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


@final
class TimeColumn(_Strict):
    """Where the stamps are and what they count."""

    column: str
    unit: Literal["s", "ms", "us", "ns", "iso"] = "s"
    epoch: Literal["any", "gps"] = Field("any", description="gps: GPS time since 1980, moved to Unix time")
    offset_s: Number = Field(0.0, description="added to every stamp, s")
    arrival: str | None = Field(None, description="column of the time of reception, in the same unit")


@final
class StreamColumns(_Strict):
    """One stream: its kind, and where its numbers are."""

    kind: str
    columns: dict[str, str] = Field(description="our column -> the file's column", min_length=1)
    units: dict[str, str] = Field(default_factory=dict, description=f"our column -> one of {', '.join(UNITS)}")
    frame: Literal["flu", "frd", "enu", "ned"] | None = None
    frame_id: str = Field("", description="name of the sensor's frame, for its mount")
    sigma: Number | list[Number] | list[str] | None = Field(None, description="number(s), or the file's columns")
    where: dict[str, str | Number] = Field(default_factory=dict, description="only rows with these values")
    altitude: Literal["ELLIPSOID", "MSL", "HOME", "PRESSURE", "UNKNOWN"] = "UNKNOWN"
    extra: dict[str, str] = Field(default_factory=dict, description="further columns, e.g. fix, satellites, hdop")
    values: dict[str, dict[Number, Number]] = Field(default_factory=dict, description="codes of the file -> ours")
    robot: str | None = None
    time: TimeColumn | None = Field(None, description="stamps of this stream, where they are not those of the file")
    increments: bool = Field(False, description="the columns hold what was added since the row before: made rates")

    @field_validator("kind")
    @classmethod
    def _known_kind(cls, name: str) -> str:
        if name.upper() not in Kind.__members__:
            raise ValueError(f"no kind '{name}' ({closest(name.upper(), Kind.__members__)})")
        return name.upper()

    @field_validator("units")
    @classmethod
    def _known_units(cls, units: dict[str, str]) -> dict[str, str]:
        for unit in units.values():
            if unit not in UNITS:
                raise ValueError(f"no unit '{unit}' ({closest(unit, UNITS)})")
        return units

    @property
    def names(self) -> tuple[str, ...]:
        """Columns of `Stream.z`."""
        return tuple(self.columns) if self.kind == "WHEELS" else Kind[self.kind].columns


@final
class CsvMapping(_Strict):
    """How to read one kind of CSV file."""

    delimiter: str = Field(",", min_length=1, max_length=1)
    names: list[str] | None = Field(None, description="column names of a file without a header line")
    time: TimeColumn | None = None
    streams: dict[str, StreamColumns] = Field(min_length=1)

    @model_validator(mode="after")
    def _every_stream_has_stamps(self) -> "CsvMapping":
        untimed = [name for name, s in self.streams.items() if s.time is None]
        if self.time is None and untimed:
            raise ValueError(f"no stamps for stream {untimed[0]} (write `time: {{column: NAME}}` here or there)")
        return self

    def stamps(self, s: StreamColumns) -> TimeColumn:
        """Where the stamps of a stream are."""
        return cast("TimeColumn", s.time or self.time)


def load_mapping(path: Path) -> CsvMapping:
    """Read and check a mapping file; the first fault is named by its line and key."""
    return validated(CsvMapping, read_yaml(path), str(path))


def read_csv(
    path: Path,
    mapping: Path | CsvMapping,
    *,
    robot: str = "robot",
    topics: Sequence[str] | None = None,
    start_s: float | None = None,
    end_s: float | None = None,
    progress: Progress | None = None,
) -> EventLog:
    """Read a CSV by a mapping file. Streams carry the names the mapping gives them."""
    how = mapping if isinstance(mapping, CsvMapping) else load_mapping(mapping)
    header = header_of(ensure_readable(path), how.delimiter, how.names)
    for key, column in wanted(how).items():
        if column not in header.names:
            fix = _other_delimiter(header) or closest(column, header.names)
            raise ConfigError(f"no column '{column}' for {key}", where=str(path), fix=fix)
    tests = {c for s in how.streams.values() for c in s.where}
    times = [how.stamps(s) for s in how.streams.values()]
    stamps = {c: t.unit for t in times for c in (t.column, t.arrival) if c is not None}
    numbers = {c for key, c in wanted(how).items() if key.startswith("streams.") and ".where." not in key}
    rows = read_rows(path, header, numbers=sorted(numbers), texts=sorted(tests), stamps=stamps, progress=progress)
    streams = [stream_of(name, s, rows, how.stamps(s), robot) for name, s in how.streams.items()]
    unstamped = max(int((~rows.stamps[t.column][1]).sum()) for t in times)
    notes = [f"{rows.ragged} rows have too many or too few cells and were left out"] if rows.ragged else []
    notes += [f"{unstamped} rows have no readable stamp and were left out"] if unstamped else []
    return assemble(path, streams, notes=notes, topics=topics, start_s=start_s, end_s=end_s)


def _other_delimiter(header: Header) -> str:
    """A remedy for a header of one name that holds what looks like a delimiter."""
    found = [d for d in (";", "\t", "|", ",") if len(header.names) == 1 and d in header.names[0]]
    return f"its columns seem to be apart by {found[0]!r}: write `delimiter: {json.dumps(found[0])}`" if found else ""


def wanted(how: CsvMapping) -> dict[str, str]:
    """Key in the mapping -> column of the file, for every column that is asked for."""
    out: dict[str, str] = {}
    for key, time in (("time", how.time), *((f"stamps of {n}", s.time) for n, s in how.streams.items())):
        if time is not None:
            out |= {key: time.column} | ({f"{key}.arrival": time.arrival} if time.arrival is not None else {})
    for name, s in how.streams.items():
        pairs = [*s.columns.items(), *s.extra.items(), *((f"where.{c}", c) for c in s.where)]
        pairs += [(f"sigma.{c}", c) for c in s.sigma if isinstance(c, str)] if isinstance(s.sigma, list) else []
        out |= {f"streams.{name}.{ours}": theirs for ours, theirs in pairs}
        allowed = {*s.names, *(ANGLES if "qw" in s.names else ())}
        for ours in s.columns:
            if ours not in allowed:
                raise ConfigError(
                    f"{s.kind} has no column '{ours}'", where=f"streams.{name}", fix=closest(ours, allowed)
                )
    return out


def stream_of(name: str, s: StreamColumns, rows: Rows, time: TimeColumn, robot: str) -> Stream:
    """The rows that belong to one stream, in our units and frames."""
    kind, theirs = Kind[s.kind], list(s.columns.values())
    t, mine = rows.stamps[time.column]
    broken = np.any([rows.broken[c] for c in theirs], axis=0)
    filled = np.any([np.isfinite(rows.numbers[c]) for c in theirs], axis=0)
    for column, value in s.where.items():
        mine = mine & _equal(rows.texts[column], value)
    keep = np.flatnonzero(mine & filled & ~broken)
    t, keep, dt = _intervals(t, keep) if s.increments else (t, keep, np.ones(keep.size))
    given = {ours: rows.numbers[c][keep] * UNITS[s.units.get(ours, "1")] / dt for ours, c in s.columns.items()}
    z = _ours(kind, s, given, keep.size)
    received = t if time.arrival is None else np.where(rows.stamps[time.arrival][1], rows.stamps[time.arrival][0], t)
    extra = {ours: _translated(rows.numbers[c][keep], s.values.get(ours, {})) for ours, c in s.extra.items()}
    return stream(
        name,
        kind,
        _moved(t[keep], time),
        z,
        var=_variances(s, rows, keep, kind, z.shape[1]),
        t_arrival=_moved(received[keep], time),
        extra=extra,
        malformed=int((mine & broken).sum()),
        robot=s.robot or robot,
        frame=s.frame_id,
        altitude=Altitude[s.altitude],
    )


def _intervals(t: Ints, keep: Ints) -> tuple[Ints, Ints, Floats]:
    """Stamps in the middle between rows that are kept, the rows that have one before them, and the time between [s]."""
    step = np.diff(t[keep])
    later = step > 0
    middle = t.copy()
    middle[keep[1:]] -= step // 2
    return middle, keep[1:][later], step[later] * 1e-9


def _moved(t: Ints, time: TimeColumn) -> Ints:
    """Stamps as the mapping wants them: shifted, and in Unix time."""
    shifted = t + round(time.offset_s * 1e9)
    return gps_to_unix(shifted) if time.epoch == "gps" else shifted


def _equal(texts: list[str], value: str | float) -> Bools:
    if isinstance(value, str):
        return np.array([c == value for c in texts], np.bool_)
    return np.array([_number(c) == value for c in texts], np.bool_)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return float("nan")


def _translated(codes: Floats, table: dict[float, float]) -> Floats:
    """Codes of the file as ours; NaN for a code that the table does not list."""
    if not table:
        return codes
    out = np.full(codes.shape, np.nan)
    for theirs, ours in table.items():
        out[codes == theirs] = ours
    return out


def _ours(kind: Kind, s: StreamColumns, given: dict[str, Floats], n: int) -> Floats:
    """(n, m) columns as `kind` lists them, east-north-up and forward-left-up."""
    turned = s.frame in ("frd", "ned")
    if "qw" in s.names and any(a in given for a in ANGLES):
        q = rpy_to_quats(np.column_stack([given.get(a, np.zeros(n)) for a in ANGLES]))
        given = given | dict(zip(QUATERNION, q.T, strict=True))
    none = np.full(n, np.nan)
    z = np.column_stack([given.get(c, none) for c in s.names]).reshape(n, len(s.names))
    at = {c: i for i, c in enumerate(s.names)}
    if s.frame == "ned" and "qw" in at:
        q = [at[c] for c in QUATERNION]
        z[:, q] = quat_ned_frd_to_enu_flu(z[:, q])
    if turned and kind in BODY:
        z[:, [i for c, i in at.items() if c.endswith(TURNED)]] *= -1.0
    if s.frame == "ned" and kind in AXES:
        z[:, :3] = ned_to_enu(z[:, :3])
    if s.frame == "ned" and "v_up" in at:
        z[:, at["v_up"]] *= -1.0  # the column holds the velocity down; v_east and v_north name their axes themselves
    if s.frame == "ned" and kind is Kind.HEADING:
        z = heading_from_azimuth(z)
    return z


def _variances(s: StreamColumns, rows: Rows, keep: Ints, kind: Kind, width: int) -> Floats | None:
    """(n, m) from the standard deviations that the mapping gives, in the order of our columns; rotations are 3 axes."""
    if s.sigma is None:
        return None
    width = {Kind.ATTITUDE: 3, Kind.POSE: 6, Kind.ODOMETRY_POSE: 6, Kind.RELATIVE_POSE: 6}.get(kind, width)
    wanted = s.sigma if isinstance(s.sigma, list) else [s.sigma] * width
    if len(wanted) != width:
        needed = f"1 or {width} standard deviations" if width > 1 else "1 standard deviation"
        raise ConfigError(f"sigma: {s.kind} needs {needed}, got {len(wanted)}")
    columns = [rows.numbers[c][keep] if isinstance(c, str) else np.full(keep.size, float(c)) for c in wanted]
    return np.column_stack(columns) ** 2
