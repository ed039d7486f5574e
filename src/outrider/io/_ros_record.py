"""Streams as messages: one small function per kind, all in `WRITERS`. The reverse of `outrider.io._ros_messages`.

Where ROS has no message for what we record, ours are defined in `DEFINITIONS` and travel with the recording.
"""

from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np

from outrider.core.attitudes import quats_to_matrices
from outrider.data import Fix, Kind, Stream
from outrider.errors import DataError
from outrider.io._ros_encode import Messages, fill, vector
from outrider.io._ros_messages import ISA_N, ISA_P0, ISA_T0_OVER_L, NOT_MEASURED, RIM, is_gnss
from outrider.io._ros_wire import Leaf, leaves
from outrider.typing import Floats

Rows: TypeAlias = Iterator[tuple[int, bytes]]

GPSFIX: Final = """
std_msgs/Header header
GPSStatus status
float64 latitude
float64 longitude
float64 altitude
float64 track
float64 speed
float64 climb
float64 hdop
float64 vdop
float64 err_horz
float64 err_vert
float64 err_speed
float64[9] position_covariance
uint8 position_covariance_type
================================================================================
MSG: gps_msgs/GPSStatus
std_msgs/Header header
uint16 satellites_used
int32[] satellite_used_prn
int16 status
"""
ACKERMANN: Final = """
std_msgs/Header header
AckermannDrive drive
================================================================================
MSG: ackermann_msgs/AckermannDrive
float32 steering_angle
float32 steering_angle_velocity
float32 speed
float32 acceleration
float32 jerk
"""
AZIMUTH: Final = """
std_msgs/Header header
float64 azimuth
float64 variance
uint8 unit
uint8 orientation
uint8 reference
"""
BEACON_RANGE: Final = """
std_msgs/Header header
float64 beacon
float64 range
float64 variance
"""
RELATIVE_POSE: Final = """
std_msgs/Header header
float64 robot
geometry_msgs/PoseWithCovariance pose
"""
DEFINITIONS: Final[Mapping[str, str]] = {
    "gps_msgs/msg/GPSFix": GPSFIX,
    "ackermann_msgs/msg/AckermannDriveStamped": ACKERMANN,
    "compass_msgs/msg/Azimuth": AZIMUTH,
    "outrider_msgs/msg/BeaconRange": BEACON_RANGE,
    "outrider_msgs/msg/RelativePose": RELATIVE_POSE,
}
STATUS: Final = {Fix.NONE: -1, Fix.SINGLE: 0, Fix.UNKNOWN: 0, Fix.SBAS: 33, Fix.DGNSS: 18, Fix.FIXED: 19, Fix.FLOAT: 20}
_EXTRA = {"hdop": ("hdop", 1.0), "vdop": ("vdop", 1.0), "err_horz": ("hacc", 1.96), "err_vert": ("vacc", 1.96)}
DIAGONAL = 2  # position_covariance_type: only the diagonal is known
TRUE_NORTH = 1  # reference of an azimuth; unit and orientation are 0: radians, from east
WORLD, BODY = "map", "base_link"


class Topic(NamedTuple):
    """What a writer has to know beside the stream. body : frame of the robot;  attitude : what the IMU claims."""

    messages: Messages
    body: str
    attitude: Stream | None = None

    def stream(self, msgtype: str, s: Stream, frame: str, columns: Mapping[str, Any], child: str = "") -> Rows:
        """Messages of constant layout, at their time of arrival."""
        strings = {"header.frame_id": frame, **({"child_frame_id": child} if child else {})}
        return arrived(s, self.messages.stream(msgtype, strings, s.t, columns))


def arrived(s: Stream, packed: Rows) -> Rows:
    """Messages at their time of arrival."""
    return ((int(t), raw) for t, (_, raw) in zip(s.t_arrival, packed, strict=True))


def register(messages: Messages) -> None:
    """Teach a type store the messages that it lacks."""
    from rosbags.typesys import get_types_from_msg

    for name, text in DEFINITIONS.items():
        found = get_types_from_msg(text, name).items()
        messages.store.register({n: f for n, f in found if n not in messages.store.fielddefs})


def _imu(to: Topic, s: Stream) -> Rows:
    q, P_q = np.tile([0.0, 0.0, 0.0, 1.0], (len(s), 1)), np.zeros((len(s), 9))
    P_q[:, 0] = NOT_MEASURED
    if to.attitude is not None:
        rows = np.searchsorted(s.t, to.attitude.t)
        q[rows], P_q[rows] = to.attitude.z, about_fixed_axes(to.attitude.var, to.attitude.z)
    columns = {
        **vector("orientation", q),
        **vector("angular_velocity", s.z[:, :3]),
        **vector("linear_acceleration", s.z[:, 3:]),
        "orientation_covariance": P_q,
        "angular_velocity_covariance": flat(s.var[:, :3]),
        "linear_acceleration_covariance": flat(s.var[:, 3:]),
    }
    return to.stream("sensor_msgs/msg/Imu", s, s.frame, columns)


def _attitude(to: Topic, s: Stream) -> Rows:
    """An IMU that measures nothing else."""
    absent = np.zeros((len(s), 9))
    absent[:, 0] = NOT_MEASURED
    columns = {
        **vector("orientation", s.z),
        "orientation_covariance": about_fixed_axes(s.var, s.z),
        "angular_velocity_covariance": absent,
        "linear_acceleration_covariance": absent,
    }
    return to.stream("sensor_msgs/msg/Imu", s, s.frame, columns)


def _twist(to: Topic, s: Stream) -> Rows:
    columns = {
        **vector("twist.twist.linear", s.z[:, :3]),
        **vector("twist.twist.angular", s.z[:, 3:]),
        "twist.covariance": flat(s.var),
    }
    return to.stream(WITH_COVARIANCE, s, s.frame or to.body, columns)


def _velocity(to: Topic, s: Stream) -> Rows:
    """A velocity without a turning rate, which a variance of -1 says."""
    var = np.column_stack([s.var, np.full((len(s), 3), NOT_MEASURED)])
    columns = {**vector("twist.twist.linear", s.z), "twist.covariance": flat(var)}
    frame = s.frame or to.body if s.kind is Kind.BODY_VELOCITY else s.frame or "gnss"
    if s.kind is Kind.GNSS_VELOCITY and not is_gnss(s.name, frame):
        raise DataError("is not known as a GNSS receiver's by its name", where=s.name, fix="name it gnss_velocity")
    return to.stream(WITH_COVARIANCE, s, frame, columns)


def _command(to: Topic, s: Stream) -> Rows:
    return to.stream("geometry_msgs/msg/TwistStamped", s, WORLD, vector("twist.linear", s.z))


def _pose(to: Topic, s: Stream) -> Rows:
    return to.stream("geometry_msgs/msg/PoseWithCovarianceStamped", s, s.frame or WORLD, _pose_columns(s, s.z))


def _relative_pose(to: Topic, s: Stream) -> Rows:
    columns = {"robot": s.z[:, 0], **_pose_columns(s, s.z[:, 1:])}
    return to.stream("outrider_msgs/msg/RelativePose", s, s.frame or to.body, columns)


def _pose_columns(s: Stream, z: Floats) -> dict[str, Any]:
    P = np.zeros((len(s), 6, 6))
    P[:, :3, :3] = flat(s.var[:, :3]).reshape(-1, 3, 3)
    P[:, 3:, 3:] = about_fixed_axes(s.var[:, 3:], z[:, 3:]).reshape(-1, 3, 3)
    return {
        **vector("pose.pose.position", z[:, :3]),
        **vector("pose.pose.orientation", z[:, 3:]),
        "pose.covariance": P.reshape(-1, 36),
    }


def _estimate(to: Topic, s: Stream) -> Rows:
    """Velocity turned from the site frame to the body, as nav_msgs wants it."""
    v = np.einsum("nji,nj->ni", quats_to_matrices(s.z[:, 3:7]), s.z[:, 7:])
    columns = {
        **vector("pose.pose.position", s.z[:, :3]),
        **vector("pose.pose.orientation", s.z[:, 3:7]),
        **vector("twist.twist.linear", v),
    }
    return to.stream("nav_msgs/msg/Odometry", s, WORLD, columns, child=to.body)


def _mag(to: Topic, s: Stream) -> Rows:
    columns = {**vector("magnetic_field", s.z), "magnetic_field_covariance": flat(s.var)}
    return to.stream("sensor_msgs/msg/MagneticField", s, s.frame, columns)


def _baro(to: Topic, s: Stream) -> Rows:
    """The pressure at that altitude in the standard atmosphere."""
    p = ISA_P0 * (1.0 - s.z[:, 0] / ISA_T0_OVER_L) ** (1.0 / ISA_N)
    h_D_p = ISA_T0_OVER_L * ISA_N / ISA_P0 * (p / ISA_P0) ** (ISA_N - 1)
    columns = {"fluid_pressure": p, "variance": np.nan_to_num(s.var[:, 0]) / h_D_p**2}
    return to.stream("sensor_msgs/msg/FluidPressure", s, s.frame or to.body, columns)


def _range_finder(to: Topic, s: Stream) -> Rows:
    columns = {"range": s.z[:, 0], "max_range": np.full(len(s), np.inf), "variance": np.nan_to_num(s.var[:, 0])}
    return to.stream("sensor_msgs/msg/Range", s, s.frame or to.body, columns)


def _heading(to: Topic, s: Stream) -> Rows:
    reference = np.full(len(s), TRUE_NORTH)
    columns = {"azimuth": s.z[:, 0], "variance": np.nan_to_num(s.var[:, 0]), "reference": reference}
    return to.stream("compass_msgs/msg/Azimuth", s, s.frame or to.body, columns)


def _range(to: Topic, s: Stream) -> Rows:
    columns = {"beacon": s.z[:, 0], "range": s.z[:, 1], "variance": np.nan_to_num(s.var[:, 1])}
    return to.stream("outrider_msgs/msg/BeaconRange", s, s.frame or to.body, columns)


def _ackermann(to: Topic, s: Stream) -> Rows:
    columns = {"drive.speed": s.z[:, 0], "drive.steering_angle": s.z[:, 1]}
    return to.stream("ackermann_msgs/msg/AckermannDriveStamped", s, s.frame or to.body, columns)


def _wheels(to: Topic, s: Stream) -> Rows:
    """Joint velocities in m/s: the joint is the rim, which moves along the ground."""
    k = s.z.shape[1]
    names = [f"{RIM}{i}" for i in range(k)]
    given = {"header.frame_id": s.frame or to.body, "name": names, "velocity": np.zeros(k)}
    template = to.messages.pack(to.messages.make("sensor_msgs/msg/JointState", given))
    strings = [Leaf("header.frame_id", ""), Leaf("names", "u4"), *(Leaf(n, "") for n in names)]
    numbers = [Leaf("positions", "u4"), Leaf("velocities", "u4"), Leaf("velocity", "f8", k), Leaf("efforts", "u4")]
    fields = [Leaf("header.stamp.sec", "i4"), Leaf("header.stamp.nanosec", "u4"), *strings, *numbers]
    return arrived(s, fill(template, fields, s.t, {"velocity": s.z if k > 1 else s.z[:, 0]}))


def _scan(to: Topic, s: Stream) -> Rows:
    n, k = s.z.shape
    ours = {"angle_min": "angle_min", "angle_increment": "angle_step", "range_max": "range_max"}
    columns: dict[str, Any] = {theirs: s.extra[name] for theirs, name in ours.items()}
    columns["angle_max"] = columns["angle_min"] + columns["angle_increment"] * (k - 1)
    columns["scan_time"] = np.full(n, 1.0 / s.rate if s.rate > 0 else 0.0)
    blank = {"ranges": np.zeros(k, np.float32), "intensities": np.zeros(0, np.float32)}
    given = {"header.frame_id": s.frame or to.body, **blank}
    template = to.messages.pack(to.messages.make("sensor_msgs/msg/LaserScan", given))
    head = leaves(to.messages.store.fielddefs, "std_msgs/msg/Header", "header.") or []
    names = ("angle_min", "angle_max", "angle_increment", "time_increment", "scan_time", "range_min", "range_max")
    fields = [*head, *(Leaf(f, "f4") for f in names), Leaf("many", "u4"), Leaf("ranges", "f4", k), Leaf("none", "u4")]
    return arrived(s, fill(template, fields, s.t, {**columns, "ranges": s.z}))


def _fixes(to: Topic, s: Stream) -> Rows:
    """One by one: the type holds sequences."""
    extra = {theirs: s.extra[ours] * scale for theirs, (ours, scale) in _EXTRA.items() if ours in s.extra}
    fix = s.extra.get("fix", np.full(len(s), float(Fix.UNKNOWN.value)))
    satellites = s.extra.get("satellites", np.zeros(len(s)))
    P = flat(s.var)

    def given(i: int) -> dict[str, Any]:
        t, (lat, lon, alt) = int(s.t[i]), s.z[i].tolist()
        return {
            "header.stamp.sec": t // 10**9, "header.stamp.nanosec": t % 10**9, "header.frame_id": s.frame,
            "status.status": STATUS[Fix(int(fix[i]))], "status.satellites_used": int(satellites[i]),
            "latitude": float(np.degrees(lat)), "longitude": float(np.degrees(lon)), "altitude": alt,
            "position_covariance": P[i], "position_covariance_type": DIAGONAL, "speed": np.nan,
            **{name: float(column[i]) for name, column in extra.items()},
        }  # fmt: skip

    for i in range(len(s)):
        yield int(s.t_arrival[i]), to.messages.pack(to.messages.make("gps_msgs/msg/GPSFix", given(i)))


def flat(var: Floats) -> Floats:
    """(n, k*k) row-major covariances with a variance of zero, ROS's word for unknown, where none is stated."""
    n, k = var.shape
    P = np.zeros((n, k, k))
    P[:, range(k), range(k)] = np.nan_to_num(var)
    return P.reshape(n, k * k)


def about_fixed_axes(var: Floats, q: Floats) -> Floats:
    """(n, 9) R P R': ROS states a rotation about the fixed axes of the frame in the header, we about the body's."""
    R = quats_to_matrices(q)
    return (R @ flat(var).reshape(-1, 3, 3) @ np.swapaxes(R, 1, 2)).reshape(-1, 9)


WITH_COVARIANCE: Final = "geometry_msgs/msg/TwistWithCovarianceStamped"

WRITERS: Final[Mapping[Kind, tuple[str, Callable[[Topic, Stream], Rows]]]] = {
    Kind.IMU: ("sensor_msgs/msg/Imu", _imu),
    Kind.ATTITUDE: ("sensor_msgs/msg/Imu", _attitude),
    Kind.GNSS: ("gps_msgs/msg/GPSFix", _fixes),
    Kind.GNSS_VELOCITY: (WITH_COVARIANCE, _velocity),
    Kind.BODY_VELOCITY: (WITH_COVARIANCE, _velocity),
    Kind.TWIST: (WITH_COVARIANCE, _twist),
    Kind.COMMAND: ("geometry_msgs/msg/TwistStamped", _command),
    Kind.POSE: ("geometry_msgs/msg/PoseWithCovarianceStamped", _pose),
    Kind.RELATIVE_POSE: ("outrider_msgs/msg/RelativePose", _relative_pose),
    Kind.ESTIMATE: ("nav_msgs/msg/Odometry", _estimate),
    Kind.MAG: ("sensor_msgs/msg/MagneticField", _mag),
    Kind.BARO: ("sensor_msgs/msg/FluidPressure", _baro),
    Kind.RANGE_FINDER: ("sensor_msgs/msg/Range", _range_finder),
    Kind.HEADING: ("compass_msgs/msg/Azimuth", _heading),
    Kind.RANGE: ("outrider_msgs/msg/BeaconRange", _range),
    Kind.ACKERMANN: ("ackermann_msgs/msg/AckermannDriveStamped", _ackermann),
    Kind.WHEELS: ("sensor_msgs/msg/JointState", _wheels),
    Kind.SCAN: ("sensor_msgs/msg/LaserScan", _scan),
}
"""Message type (as rosbags spells it) and function of every kind that can be recorded."""
