"""From ROS messages to the columns of our streams: one small function per message type, all in `MESSAGES`.

Each gets a block of messages as columns by dotted field name and returns the parts of streams it makes of them.
ROS covariances of rotations are about the fixed axes of the frame in the header; ours are about the body axes:
P_body = R' P R. A covariance of zeros means "unknown" in ROS and becomes NaN; so does one that starts with -1.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from outrider.core.angles import wrap_all
from outrider.core.attitudes import quats_to_matrices
from outrider.data import Altitude, Fix, Kind
from outrider.typing import Bools, Floats

# Standard atmosphere (ISO 2533), troposphere: h = T0/L (1 - (p/p0)^n), n = R L / g0
ISA_P0 = 101325.0  # Pa
ISA_T0_OVER_L = 288.15 / 0.0065  # m
ISA_N = 287.05287 * 0.0065 / 9.80665
HECTOPASCALS = 2000.0  # Pa: the air at 27 km; less than this is a sensor that reports hPa
PERCENT_95 = 1.96  # GPSFix states errors at 95 %
NOT_MEASURED = -1.0  # as a variance: this device does not measure that
RIM = "rim_"  # names of joints whose velocity is that of a wheel's rim, in m/s

_GNSS_TOPIC = re.compile(r"gnss|gps|navsat|nmea|ublox|(^|[_/])fix|(^|/)vel$", re.IGNORECASE)
_GNSS_FRAME = re.compile(r"gnss|gps|navsat", re.IGNORECASE)
_COMMAND_TOPIC = re.compile(r"cmd|command|setpoint|reference", re.IGNORECASE)
_STEERING_TOPIC = re.compile(r"steering|measured|state|feedback|odom", re.IGNORECASE)
_ESTIMATE_TOPIC = re.compile(r"filtered|estimat|ekf|ukf|fused|odometry/(global|local)$|^/outrider/", re.IGNORECASE)


class Block(NamedTuple):
    """Messages of one topic with the same frame names, as columns by dotted field name."""

    columns: Mapping[str, NDArray[Any]]
    topic: str
    frame: str
    child: str = ""

    def number(self, name: str) -> Floats:
        """(n,) one field."""
        return np.asarray(self.columns[name], np.float64)

    def vector(self, name: str, axes: Sequence[str] = "xyz") -> Floats:
        """(n, len(axes)) the fields name.x, name.y ..."""
        return np.stack([self.number(f"{name}.{axis}") for axis in axes], axis=-1)

    def square(self, name: str) -> Floats:
        """(n, k, k) a row-major covariance, NaN where it says that it is unknown."""
        flat = np.array(self.columns[name], np.float64)
        flat[(flat[:, 0] == NOT_MEASURED) | ~flat.any(axis=1)] = np.nan
        side = {9: 3, 36: 6}[flat.shape[1]]
        return flat.reshape(-1, side, side)

    def absent(self, covariance: str, row: int = 0) -> Bools:
        """(n,) whether a variance, the first by default, is -1: "this device does not measure that"."""
        square = self.columns[covariance]
        return np.asarray(square[:, row * (round(square.shape[1] ** 0.5) + 1)] == NOT_MEASURED)


class Part(NamedTuple):
    """What a block adds to one stream: `keep` drops rows (None keeps all)."""

    kind: Kind
    z: Floats
    var: Floats
    frame: str
    suffix: str = ""
    extra: Mapping[str, Floats] = {}
    altitude: Altitude = Altitude.UNKNOWN
    keep: Bools | None = None


def _variances(square: Floats) -> Floats:
    return np.diagonal(square, axis1=-2, axis2=-1)


def _unstated(like: Floats) -> Floats:
    return np.full(like.shape, np.nan)


def _about_body_axes(square: Floats, q: Floats) -> Floats:
    """(n, 3) variances R' P R of a rotation covariance P (n, 3, 3) about fixed axes; q (n, 4) is R."""
    R = quats_to_matrices(q)
    return _variances(np.swapaxes(R, -1, -2) @ square @ R)


def imu(b: Block) -> tuple[Part, ...]:
    """Rates and specific force; and the attitude, if the device claims one."""
    w, f = b.vector("angular_velocity"), b.vector("linear_acceleration")
    no_w, no_f = b.absent("angular_velocity_covariance"), b.absent("linear_acceleration_covariance")
    w[no_w], f[no_f] = np.nan, np.nan
    spread = [_variances(b.square(f"{name}_covariance")) for name in ("angular_velocity", "linear_acceleration")]
    q = b.vector("orientation", "xyzw")
    claimed = ~b.absent("orientation_covariance") & q.any(axis=1)
    var_q = _about_body_axes(b.square("orientation_covariance"), q)
    return (
        Part(Kind.IMU, np.hstack((w, f)), np.hstack(spread), b.frame, keep=~(no_w & no_f)),
        Part(Kind.ATTITUDE, q, var_q, b.frame, "#attitude", keep=claimed),
    )


_FIXES = {-1: Fix.NONE, 0: Fix.SINGLE, 1: Fix.SBAS, 2: Fix.DGNSS}
_GPSFIXES = {**_FIXES, 18: Fix.DGNSS, 19: Fix.FIXED, 20: Fix.FLOAT, 33: Fix.SBAS}


def _fix_codes(status: Floats, known: Mapping[int, Fix]) -> Floats:
    out = np.full(status.shape, float(Fix.UNKNOWN.value))
    for code, fix in known.items():
        out[status == code] = fix.value
    return out


def _fix(b: Block, status: Mapping[int, Fix], extra: Mapping[str, Floats]) -> Part:
    """A position; var is (east, north, up) in m^2, as the message has it, although the columns are lat, lon, alt."""
    z = np.stack((np.radians(b.number("latitude")), np.radians(b.number("longitude")), b.number("altitude")), axis=-1)
    kind = b.number("position_covariance_type")
    var = _variances(b.square("position_covariance")).copy()
    var[kind == 0] = np.nan
    codes = _fix_codes(b.number("status.status"), status)
    return Part(
        Kind.GNSS, z, var, b.frame, extra={"fix": codes, "cov_type": kind, **extra}, altitude=Altitude.ELLIPSOID
    )


def nav_sat_fix(b: Block) -> tuple[Part, ...]:
    """A position with its fix status."""
    return (_fix(b, _FIXES, {}),)


def gps_fix(b: Block) -> tuple[Part, ...]:
    """Position with satellites and dilution of precision, and speed over ground with climb."""
    stated = {"hacc": b.number("err_horz"), "vacc": b.number("err_vert"), "sacc": b.number("err_speed")}
    extra = {name: np.where(e > 0, e / PERCENT_95, np.nan) for name, e in stated.items()}
    extra |= {"satellites": b.number("status.satellites_used"), "hdop": b.number("hdop"), "vdop": b.number("vdop")}
    position = _fix(b, _GPSFIXES, extra)
    speed, track = b.number("speed"), np.radians(b.number("track"))  # clockwise from north
    v = np.stack((speed * np.sin(track), speed * np.cos(track), b.number("climb")), axis=-1)
    if not np.isfinite(speed).any():  # the receiver does not tell
        return (position,)
    return position, Part(Kind.GNSS_VELOCITY, v, _unstated(v), b.frame, "#velocity", {"fix": position.extra["fix"]})


def _geo_point(prefix: str) -> Callable[[Block], tuple[Part, ...]]:
    def geo(b: Block) -> tuple[Part, ...]:
        z = b.vector(prefix, ("latitude", "longitude", "altitude"))
        z[:, :2] = np.radians(z[:, :2])
        return (Part(Kind.GNSS, z, _unstated(z), b.frame, altitude=Altitude.ELLIPSOID),)

    return geo


def _pose(b: Block, name: str, covariance: str = "") -> tuple[Floats, Floats]:
    """z (n, 7) and var (n, 6): position in the header's frame, rotation about the body axes."""
    p, q = b.vector(f"{name}.position"), b.vector(f"{name}.orientation", "xyzw")
    if not covariance:
        return np.hstack((p, q)), np.full((len(p), 6), np.nan)
    P = b.square(covariance)
    return np.hstack((p, q)), np.hstack((_variances(P)[:, :3], _about_body_axes(P[:, 3:, 3:], q)))


def odometry(b: Block) -> tuple[Part, ...]:
    """Body twist and integrated pose of a base; or, by the topic's name, what another estimator made of it all."""
    z, var = _pose(b, "pose.pose", "pose.covariance")
    v, w = b.vector("twist.twist.linear"), b.vector("twist.twist.angular")
    if _ESTIMATE_TOPIC.search(b.topic):
        v_world = np.einsum("nij,nj->ni", quats_to_matrices(z[:, 3:]), v)
        answer = np.hstack((z, v_world))
        return (Part(Kind.ESTIMATE, answer, _unstated(answer), b.frame),)
    spread = _variances(b.square("twist.covariance"))
    return (
        Part(Kind.TWIST, np.hstack((v, w)), spread, b.child),
        Part(Kind.ODOMETRY_POSE, z, var, b.frame, "#pose"),
    )


def _twist(b: Block, name: str, covariance: str = "") -> tuple[Part, ...]:
    v, w = b.vector(f"{name}.linear"), b.vector(f"{name}.angular")
    var = _variances(b.square(covariance)) if covariance else np.full((len(v), 6), np.nan)
    if is_gnss(b.topic, b.frame):
        return (Part(Kind.GNSS_VELOCITY, v, var[:, :3], b.frame),)
    whole = Part(Kind.TWIST, np.hstack((v, w)), var, b.frame)
    if not covariance or not (bare := b.absent(covariance, row=3)).any():
        return (whole,)
    return whole._replace(keep=~bare), Part(Kind.BODY_VELOCITY, v, var[:, :3], b.frame, "#velocity", keep=bare)


def twist_stamped(b: Block) -> tuple[Part, ...]:
    """Body twist, or the velocity of a GNSS receiver (by topic or frame); a commanded twist is not a measurement."""
    return () if _COMMAND_TOPIC.search(b.topic) else _twist(b, "twist")


def twist_with_covariance_stamped(b: Block) -> tuple[Part, ...]:
    """Body twist, or the velocity of a GNSS receiver (by topic or frame); a variance of -1 about x: no rates."""
    return () if _COMMAND_TOPIC.search(b.topic) else _twist(b, "twist.twist", "twist.covariance")


def vector3_stamped(b: Block) -> tuple[Part, ...]:
    """The velocity of a GNSS receiver; on other topics a vector means nothing to us."""
    v = b.vector("vector")
    wanted = is_gnss(b.topic, b.frame) and "vel" in b.topic.lower()
    return (Part(Kind.GNSS_VELOCITY, v, _unstated(v), b.frame),) if wanted else ()


def is_gnss(topic: str, frame: str) -> bool:
    """Whether a velocity comes from a GNSS receiver: `fix_velocity`, `/vel`, `/gps/...`, or a frame named so."""
    return bool(_GNSS_TOPIC.search(topic) or _GNSS_FRAME.search(frame))


def pose_stamped(b: Block) -> tuple[Part, ...]:
    """A pose against a map; a goal is not a measurement."""
    if _COMMAND_TOPIC.search(b.topic) or "goal" in b.topic.lower():
        return ()
    return (Part(Kind.POSE, *_pose(b, "pose"), b.frame),)


def pose_with_covariance_stamped(b: Block) -> tuple[Part, ...]:
    """A pose against a map, with its covariance; RViz's initial guess is not a measurement."""
    if "initialpose" in b.topic.lower():
        return ()
    return (Part(Kind.POSE, *_pose(b, "pose.pose", "pose.covariance"), b.frame),)


def magnetic_field(b: Block) -> tuple[Part, ...]:
    """The field in the sensor's frame."""
    return (Part(Kind.MAG, b.vector("magnetic_field"), _variances(b.square("magnetic_field_covariance")), b.frame),)


def fluid_pressure(b: Block) -> tuple[Part, ...]:
    """Pressure altitude in the standard atmosphere; `extra["pressure"]` is what the message said."""
    stated, stated_var = b.number("fluid_pressure"), b.number("variance")
    scale = np.where(stated < HECTOPASCALS, 100.0, 1.0)
    p = np.where(stated > 0, stated * scale, np.nan)
    h_D_p = ISA_T0_OVER_L * ISA_N / ISA_P0 * (p / ISA_P0) ** (ISA_N - 1)
    var = np.where(stated_var > 0, stated_var * (scale * h_D_p) ** 2, np.nan)
    z = ISA_T0_OVER_L * (1 - (p / ISA_P0) ** ISA_N)
    extra = {"pressure": stated}
    return (Part(Kind.BARO, z[:, None], var[:, None], b.frame, "", extra, Altitude.PRESSURE),)


def range_finder(b: Block) -> tuple[Part, ...]:
    """A distance; outside what the sensor can measure (REP-117: infinities) it is NaN."""
    d, low, high = b.number("range"), b.number("min_range"), b.number("max_range")
    seen = np.isfinite(d) & (d >= low) & ((d <= high) | (high <= 0))
    var = b.number("variance") if "variance" in b.columns else np.zeros(d.shape)
    z = np.where(seen, d, np.nan)
    return (Part(Kind.RANGE_FINDER, z[:, None], np.where(var > 0, var, np.nan)[:, None], b.frame),)


def azimuth(b: Block) -> tuple[Part, ...]:
    """A heading from true north; a magnetic one needs the declination, one from grid north its convergence."""
    degrees, clockwise = b.number("unit") == 1, b.number("orientation") == 1
    scale = np.where(degrees, np.pi / 180.0, 1.0)
    angle, var = b.number("azimuth") * scale, b.number("variance") * scale**2
    z = wrap_all(np.where(clockwise, 0.5 * np.pi - angle, angle))
    var = np.where(var > 0.0, var, np.nan)
    return (Part(Kind.HEADING, z[:, None], var[:, None], b.frame, keep=b.number("reference") == 1),)


def beacon_range(b: Block) -> tuple[Part, ...]:
    """Our own message: the distance to a numbered beacon or robot."""
    var = b.number("variance")
    stated = np.where(var > 0.0, var, np.nan)
    z = np.stack((b.number("beacon"), b.number("range")), axis=-1)
    return (Part(Kind.RANGE, z, np.stack((_unstated(stated), stated), axis=-1), b.frame),)


def relative_pose(b: Block) -> tuple[Part, ...]:
    """Our own message: another robot, by its number, in the frame of the sensor that sees it."""
    z, var = _pose(b, "pose.pose", "pose.covariance")
    return (Part(Kind.RELATIVE_POSE, np.column_stack((b.number("robot"), z)), var, b.frame),)


def ackermann_drive(b: Block) -> tuple[Part, ...]:
    """Speed and steering angle as measured; most messages of this type are commands, so the topic must say so."""
    z = np.stack((b.number("drive.speed"), b.number("drive.steering_angle")), axis=-1)
    measured = _STEERING_TOPIC.search(b.topic) and not _COMMAND_TOPIC.search(b.topic)
    return (Part(Kind.ACKERMANN, z, _unstated(z), b.frame),) if measured else ()


def joint_state(b: Block) -> tuple[Part, ...]:
    """Rim speeds, if that is what the joints are called; other joints do not tell the radius of their wheels."""
    names, v = b.columns["name"], b.columns["velocity"]
    if names.ndim != 2 or not np.char.startswith(names.astype(str), RIM).all() or v.shape != names.shape:
        return ()
    return (Part(Kind.WHEELS, np.asarray(v, np.float64), _unstated(v), b.frame),)


def laser_scan(b: Block) -> tuple[Part, ...]:
    """Ranges of one lidar; beyond what it can measure they are infinite."""
    z = np.asarray(b.columns["ranges"], np.float64)
    if z.ndim != 2:
        return ()
    reach = b.number("range_max")
    extra = {"angle_min": b.number("angle_min"), "angle_step": b.number("angle_increment"), "range_max": reach}
    return (Part(Kind.SCAN, np.where(z > reach[:, None], np.inf, z), _unstated(z), b.frame, extra=extra),)


Reader = Callable[[Block], tuple[Part, ...]]

MESSAGES: Mapping[str, Reader] = {
    "sensor_msgs/msg/Imu": imu,
    "sensor_msgs/msg/NavSatFix": nav_sat_fix,
    "sensor_msgs/msg/MagneticField": magnetic_field,
    "sensor_msgs/msg/FluidPressure": fluid_pressure,
    "sensor_msgs/msg/Range": range_finder,
    "nav_msgs/msg/Odometry": odometry,
    "geometry_msgs/msg/TwistStamped": twist_stamped,
    "geometry_msgs/msg/TwistWithCovarianceStamped": twist_with_covariance_stamped,
    "geometry_msgs/msg/Vector3Stamped": vector3_stamped,
    "geometry_msgs/msg/PoseStamped": pose_stamped,
    "geometry_msgs/msg/PoseWithCovarianceStamped": pose_with_covariance_stamped,
    "geographic_msgs/msg/GeoPointStamped": _geo_point("position"),
    "geographic_msgs/msg/GeoPoseStamped": _geo_point("pose.position"),
    "gps_msgs/msg/GPSFix": gps_fix,
    "gps_common/msg/GPSFix": gps_fix,
    "compass_msgs/msg/Azimuth": azimuth,
    "ackermann_msgs/msg/AckermannDriveStamped": ackermann_drive,
    "sensor_msgs/msg/JointState": joint_state,
    "sensor_msgs/msg/LaserScan": laser_scan,
    "outrider_msgs/msg/BeaconRange": beacon_range,
    "outrider_msgs/msg/RelativePose": relative_pose,
}
"""Message type (as rosbags spells it) to the function that reads it."""

_STAMP = ("header.stamp.sec", "header.stamp.nanosec")
_GPSFIX = (
    *_STAMP, "status.satellites_used", "status.status", "latitude", "longitude", "altitude", "track", "speed", "climb",
    "hdop", "vdop", "err_horz", "err_vert", "err_speed", "position_covariance", "position_covariance_type",
)  # fmt: skip

VARIABLE: Mapping[str, tuple[str, ...]] = {
    "gps_msgs/msg/GPSFix": _GPSFIX,
    "gps_common/msg/GPSFix": _GPSFIX,
    "sensor_msgs/msg/JointState": (*_STAMP, "name", "velocity"),
    "sensor_msgs/msg/LaserScan": (*_STAMP, "angle_min", "angle_increment", "range_max", "ranges"),
}
"""The fields that are read of types with sequences in them, whose layout changes from message to message."""

ON_REQUEST = frozenset({"sensor_msgs/msg/LaserScan"})
"""Types of which much is recorded and nothing is fused: read only when their topic is asked for."""
