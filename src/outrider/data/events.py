"""Sensor records as columns: one `Stream` per source, all streams of a log in one `EventLog`, on one clock."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Final, final

import numpy as np

from outrider.errors import DataError
from outrider.typing import Bools, Floats, Ints


class Kind(Enum):
    """What one record holds; `columns` names the columns of `Stream.z`. SI units, radians, quaternions x y z w.

    `body` is forward-left-up, `world` is east-north-up, `sensor` is the sensor's own frame (forward-left-up if mounted
    straight), fixed to the body by the mount that the configuration gives.
    """

    IMU = "imu"  # sensor: rad/s, specific force m/s^2
    ATTITUDE = "attitude"  # R_world_sensor as the sensor claims it
    GNSS = "gnss"  # rad, rad, m (which altitude: Stream.altitude)
    GNSS_VELOCITY = "gnss_velocity"  # world, m/s
    POSITION = "position"  # site frame (ENU), m
    POSE = "pose"  # of the body in the site frame: lidar or camera against a map
    ODOMETRY_POSE = "odometry_pose"  # integrated by the base itself, in its own odom frame
    TWIST = "twist"  # body: m/s, rad/s (wheel or visual odometry)
    WHEELS = "wheels"  # rim speed of each wheel, m/s; as many columns as wheels (drive in the configuration)
    ACKERMANN = "ackermann"  # rear-axle speed m/s, front-wheel angle rad (left positive)
    BODY_VELOCITY = "body_velocity"  # sensor, m/s (stereo, Doppler log)
    FLOW = "flow"  # angular flow about the sensor's x and y axes, rad/s
    RANGE_FINDER = "range_finder"  # distance along the sensor's -z axis to the ground, m
    BARO = "baro"  # pressure altitude, m
    MAG = "mag"  # sensor, any unit: only the direction is used
    HEADING = "heading"  # rad, counter-clockwise from east, true
    RANGE = "range"  # beacon id, m
    RANGE_BEARING = "range_bearing"  # bearing rad, body, left positive
    RELATIVE_POSE = "relative_pose"  # of the other robot in the sensor's frame, in this body's if it has none
    SCAN = "scan"  # ranges [m] of a 2-D lidar, inf where nothing returned; extra: angle_min, angle_step, range_max
    COMMAND = "command"  # commanded velocity, world, m/s
    ESTIMATE = "estimate"  # another estimator's answer
    STATUS = "status"  # an autopilot's own estimator flags, for the report and for comparison

    __hash__ = object.__hash__  # there is one of each: that of Enum is a call of Python, and every stream asks for it

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns of `Stream.z` (WHEELS has one per wheel instead, SCAN one per beam)."""
        return _COLUMNS[self]


_ANY_WIDTH = {Kind.WHEELS, Kind.SCAN}
_POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")
_COLUMNS: Mapping[Kind, tuple[str, ...]] = {
    Kind.IMU: ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"),
    Kind.ATTITUDE: ("qx", "qy", "qz", "qw"),
    Kind.GNSS: ("lat", "lon", "alt"),
    Kind.GNSS_VELOCITY: ("v_east", "v_north", "v_up"),
    Kind.POSITION: ("x", "y", "z"),
    Kind.POSE: _POSE,
    Kind.ODOMETRY_POSE: _POSE,
    Kind.TWIST: ("v_x", "v_y", "v_z", "w_x", "w_y", "w_z"),
    Kind.WHEELS: ("wheels",),
    Kind.ACKERMANN: ("speed", "steering"),
    Kind.BODY_VELOCITY: ("v_x", "v_y", "v_z"),
    Kind.FLOW: ("flow_x", "flow_y"),
    Kind.RANGE_FINDER: ("height",),
    Kind.BARO: ("alt",),
    Kind.MAG: ("m_x", "m_y", "m_z"),
    Kind.HEADING: ("heading",),
    Kind.RANGE: ("beacon", "range"),
    Kind.RANGE_BEARING: ("beacon", "range", "bearing"),
    Kind.RELATIVE_POSE: ("robot", *_POSE),
    Kind.SCAN: ("ranges",),
    Kind.COMMAND: ("v_x", "v_y", "v_z"),
    Kind.ESTIMATE: (*_POSE, "v_east", "v_north", "v_up"),
    Kind.STATUS: ("flags",),
}


class Altitude(Enum):
    """What an altitude is measured from. Two different references are never mixed silently."""

    ELLIPSOID = "height above the WGS84 ellipsoid"
    MSL = "height above mean sea level (geoid)"
    HOME = "height above the take-off point"
    PRESSURE = "pressure altitude in the standard atmosphere"
    UNKNOWN = "not stated by the log"


class Fix(Enum):
    """GNSS solution type, worst to best; the value is the code stored in `Stream.extra["fix"]`."""

    UNKNOWN = -1
    NONE = 0
    SINGLE = 1
    SBAS = 2
    DGNSS = 3
    FLOAT = 4
    FIXED = 5


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Stream:
    """All records of one source, in the order in which they arrived.

    z : (n, m) float64, columns as `kind` says;  var : (n, m) variances as the sensor states them, NaN where it states
    none (a POSE or ATTITUDE states them per rotation axis: m is then 6 or 3);  t : (n,) int64 ns, the sensor's stamp;
    t_arrival : (n,) int64 ns, when the recorder got it (equal to t where unknown).
    extra : further columns by name, e.g. fix (`Fix` codes), satellites, hdop, hacc [m], vacc [m].
    """

    name: str
    kind: Kind
    t: Ints
    z: Floats
    var: Floats
    t_arrival: Ints
    robot: str = "robot"
    frame: str = ""
    altitude: Altitude = Altitude.UNKNOWN
    extra: Mapping[str, Floats] = field(default_factory=dict[str, Floats])
    malformed: int = 0  # records that could not be decoded at all

    def __post_init__(self) -> None:
        n = self.t.shape[0]
        if self.z.ndim != 2 or self.z.shape[0] != n or self.var.shape[0] != n or self.t_arrival.shape[0] != n:
            raise DataError(
                f"columns of unequal length: t {n}, z {self.z.shape}, var {self.var.shape}", where=self.name
            )
        if self.kind not in _ANY_WIDTH and self.z.shape[1] != len(self.kind.columns):
            raise DataError(
                f"{self.kind.name} needs columns {self.kind.columns}, got {self.z.shape[1]}", where=self.name
            )

    def __len__(self) -> int:
        return self.t.shape[0]

    def select(self, keep: Bools | Ints | slice) -> "Stream":
        """The same stream with only the given rows."""
        extra = {name: column[keep] for name, column in self.extra.items()}
        return Stream(
            name=self.name, kind=self.kind, t=self.t[keep], z=self.z[keep], var=self.var[keep],
            t_arrival=self.t_arrival[keep], robot=self.robot, frame=self.frame, altitude=self.altitude, extra=extra,
            malformed=self.malformed,
        )  # fmt: skip

    def named(self, name: str) -> "Stream":
        """The same records under another name."""
        return replace(self, name=name)

    @property
    def rate(self) -> float:
        """Median rate [Hz], in whatever order the records came; NaN for fewer than two distinct stamps."""
        gaps = np.diff(np.sort(self.t, kind="stable"))
        gaps = gaps[gaps > 0]
        return float(1e9 / np.median(gaps)) if gaps.size else float("nan")


_ROTATIONS: Final = {Kind.ATTITUDE: 3, Kind.POSE: 6, Kind.ODOMETRY_POSE: 6, Kind.RELATIVE_POSE: 6}
"""Variances of kinds that state them per rotation axis."""


def stream(
    name: str,
    kind: Kind,
    t: Ints,
    z: Floats,
    *,
    var: Floats | None = None,
    t_arrival: Ints | None = None,
    **rest: object,
) -> Stream:
    """A `Stream` from any array-likes: contiguous, right types, unstated variances as NaN."""
    t = np.ascontiguousarray(t, np.int64)
    z = np.ascontiguousarray(z, np.float64)
    z = z if z.ndim >= 2 else np.atleast_2d(z)
    if var is None:
        width: int = _ROTATIONS[kind] if kind in _ROTATIONS else z.shape[1]
        var = np.full((t.size, width), np.nan)
    else:
        var = np.ascontiguousarray(var, np.float64)
    arrival = t if t_arrival is None else np.ascontiguousarray(t_arrival, np.int64)
    return Stream(name=name, kind=kind, t=t, z=z, var=var, t_arrival=arrival, **rest)  # type: ignore[arg-type]


def joined(parts: Sequence[Stream]) -> Stream:
    """The records of several pieces of one source as one stream, in the order of the pieces."""
    if len(parts) == 1:
        return parts[0]
    arrays = {n: np.concatenate([getattr(s, n) for s in parts]) for n in ("t", "z", "var", "t_arrival")}
    extra = {name: np.concatenate([s.extra[name] for s in parts]) for name in parts[0].extra}
    return replace(parts[0], **arrays, extra=extra, malformed=sum(s.malformed for s in parts))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class EventLog:
    """Every stream of a recording by name, with where it came from and what the reader had to say about it."""

    streams: Mapping[str, Stream]
    path: str = ""
    sha256: str = ""
    notes: tuple[str, ...] = ()
    mounts: Mapping[str, Floats] = field(default_factory=dict[str, Floats])
    """(4, 4) body-from-sensor transforms by frame name, as far as the log itself holds them (static /tf)."""
    beacons: Mapping[float, tuple[float, float, float]] = field(default_factory=dict[float, tuple[float, float, float]])
    """Places [m] of beacons and landmarks by number, as far as the log itself tells them."""
    ids: Mapping[str, int] = field(default_factory=dict[str, int])
    """The number by which others see each robot."""

    def __len__(self) -> int:
        return sum(len(s) for s in self.streams.values())

    def __iter__(self) -> Iterator[Stream]:
        return iter(self.streams.values())

    def of(self, *kinds: Kind) -> tuple[Stream, ...]:
        """Streams of the given kinds, in name order."""
        return tuple(self.streams[n] for n in sorted(self.streams) if self.streams[n].kind in kinds)

    @property
    def span(self) -> tuple[int, int]:
        """First and last stamp [ns] over all streams; (0, 0) for an empty log."""
        filled = [s for s in self if len(s)]
        if not filled:
            return 0, 0
        return min(int(s.t.min()) for s in filled), max(int(s.t.max()) for s in filled)

    @property
    def duration(self) -> float:
        """Seconds from the first stamp to the last."""
        first, last = self.span
        return (last - first) * 1e-9

    def with_streams(self, *streams: Stream) -> "EventLog":
        """The same log with streams added or replaced by name."""
        return replace(self, streams={**self.streams, **{s.name: s for s in streams}})
