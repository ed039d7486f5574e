"""Writes an `EventLog` as a ROS 2 recording (one MCAP file), as the robot itself would have recorded it.

A stream becomes a topic of its name: IMU sensor_msgs/Imu (with the attitude that the same frame claims), GNSS
gps_msgs/GPSFix, TWIST geometry_msgs/TwistWithCovarianceStamped. Mounts become /tf_static. The time of recording is the
time of arrival. Other kinds have no message here and are refused.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from outrider.core.attitudes import matrices_to_quats, quats_to_matrices
from outrider.data import EventLog, Fix, Kind, Stream
from outrider.errors import DataError
from outrider.io._ros_bag import Source, write_bag
from outrider.io._ros_encode import Messages, vector
from outrider.typing import Floats

GPSFIX = """
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
STATUS = {Fix.NONE: -1, Fix.SINGLE: 0, Fix.UNKNOWN: 0, Fix.SBAS: 33, Fix.DGNSS: 18, Fix.FIXED: 19, Fix.FLOAT: 20}
_EXTRA = {"hdop": ("hdop", 1.0), "vdop": ("vdop", 1.0), "err_horz": ("hacc", 1.96), "err_vert": ("vacc", 1.96)}
DIAGONAL = 2  # position_covariance_type: only the diagonal is known
UNKNOWN = -1.0  # first element of a covariance of what a device does not measure
BODY = "base_link"
_TWIST = "geometry_msgs/msg/TwistWithCovarianceStamped"


def write_recording(log: EventLog, path: Path, *, force: bool = False) -> None:
    """One MCAP file at `path`; it appears when it is complete, or not at all."""
    from rosbags.typesys import get_types_from_msg

    messages = Messages()
    messages.store.register(
        {
            n: f
            for n, f in get_types_from_msg(GPSFIX, "gps_msgs/msg/GPSFix").items()
            if n not in messages.store.fielddefs
        }
    )
    write_bag(path, messages, list(_sources(log, messages)), {"log": log.path}, force=force)


def _sources(log: EventLog, messages: Messages) -> Iterator[Source]:
    start = int(min((s.t_arrival.min() for s in log if len(s)), default=0))
    for frame, T in log.mounts.items():
        q = np.asarray(matrices_to_quats(T[:3, :3]))
        yield (
            "/tf_static",
            "tf2_msgs/msg/TFMessage",
            messages.links(BODY, frame, np.array([start]), T[None, :3, 3], q[None]),
        )
    for s in log:
        topic = f"/{s.name.strip('/')}"
        if s.kind is Kind.IMU:
            yield topic, "sensor_msgs/msg/Imu", _imu(messages, s, _attitude(log, s))
        elif s.kind is Kind.TWIST:
            yield topic, _TWIST, _twist(messages, s)
        elif s.kind is Kind.GNSS:
            yield topic, "gps_msgs/msg/GPSFix", _fixes(messages, s)
        elif s.kind is not Kind.ATTITUDE or not any(_attitude(log, i) is s for i in log.of(Kind.IMU)):
            raise DataError(f"{s.kind.value} has no message to be recorded in", where=s.name)


def _attitude(log: EventLog, imu: Stream) -> Stream | None:
    """The attitude that comes in the messages of an IMU: of the same frame, at some of its stamps."""
    found = [s for s in log.of(Kind.ATTITUDE) if s.frame == imu.frame and np.isin(s.t, imu.t).all()]
    return found[0] if found else None


def _arrived(s: Stream, packed: Iterator[tuple[int, bytes]]) -> Iterator[tuple[int, bytes]]:
    """Messages at their time of arrival."""
    return ((int(t), raw) for t, (_, raw) in zip(s.t_arrival, packed, strict=True))


def _imu(messages: Messages, s: Stream, attitude: Stream | None) -> Iterator[tuple[int, bytes]]:
    q, P_q = np.tile([0.0, 0.0, 0.0, 1.0], (len(s), 1)), np.zeros((len(s), 9))
    P_q[:, 0] = UNKNOWN
    if attitude is not None:
        rows = np.searchsorted(s.t, attitude.t)
        R = quats_to_matrices(attitude.z)
        P = R @ _flat(attitude.var).reshape(-1, 3, 3) @ np.swapaxes(R, 1, 2)  # ROS: about fixed axes, not the body's
        q[rows], P_q[rows] = attitude.z, P.reshape(-1, 9)
    columns = {
        **vector("orientation", q),
        **vector("angular_velocity", s.z[:, :3]),
        **vector("linear_acceleration", s.z[:, 3:]),
        "orientation_covariance": P_q,
        "angular_velocity_covariance": _flat(s.var[:, :3]),
        "linear_acceleration_covariance": _flat(s.var[:, 3:]),
    }
    return _arrived(s, messages.stream("sensor_msgs/msg/Imu", {"header.frame_id": s.frame}, s.t, columns))


def _twist(messages: Messages, s: Stream) -> Iterator[tuple[int, bytes]]:
    columns = {
        **vector("twist.twist.linear", s.z[:, :3]),
        **vector("twist.twist.angular", s.z[:, 3:]),
        "twist.covariance": _flat(s.var),
    }
    return _arrived(s, messages.stream(_TWIST, {"header.frame_id": s.frame or BODY}, s.t, columns))


def _fixes(messages: Messages, s: Stream) -> Iterator[tuple[int, bytes]]:
    """One by one: the type holds sequences."""
    extra = {theirs: s.extra[ours] * scale for theirs, (ours, scale) in _EXTRA.items() if ours in s.extra}
    fix = s.extra.get("fix", np.full(len(s), float(Fix.UNKNOWN.value)))
    satellites = s.extra.get("satellites", np.zeros(len(s)))
    P = _flat(s.var)

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
        yield int(s.t_arrival[i]), messages.pack(messages.make("gps_msgs/msg/GPSFix", given(i)))


def _flat(var: Floats) -> Floats:
    """(n, k*k) row-major covariances with a variance of zero, ROS's word for unknown, where none is stated."""
    n, k = var.shape
    P = np.zeros((n, k, k))
    P[:, range(k), range(k)] = np.nan_to_num(var)
    return P.reshape(n, k * k)
