"""Writes a `Run` as one MCAP file with ROS 2 messages, for Foxglove, Rerun, PlotJuggler, RViz and evo.

/outrider/odometry/global  nav_msgs/Odometry, map -> base_link      /outrider/odometry/local  odom -> base_link
/tf, /tf_static            map -> odom -> base_link (REP-105)       /outrider/path            nav_msgs/Path, once
/outrider/fix              sensor_msgs/NavSatFix of the estimate    /outrider/tracks/...      of what each source says
/diagnostics               accounts, findings, health, resets

ROS states the covariance of a rotation about the fixed axes of the header's frame, we about the body's: P_ros = R P R'.
A covariance of zeros says "unknown". Where the heading is unknown the orientation is the identity with a variance of
pi^2, and there is no transform. Time of recording = stamp, and never decreases in the file.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from outrider.core.attitudes import quats_conjugate, quats_multiply, quats_to_matrices, slerp
from outrider.core.geodesy import enu_to_geodetic
from outrider.data import Datum, Estimates, Run, Trajectory
from outrider.io._ros_bag import Source, write_bag
from outrider.io._ros_diagnostics import diagnostics
from outrider.io._ros_encode import Messages, vector
from outrider.typing import Bools, Floats, Ints

PATH_POSES = 2000  # a path for the eye: at most so many
UNKNOWN_ROTATION = np.pi**2  # rad^2, variance of a rotation of which nothing is known
_NO_TURN = np.array([0.0, 0.0, 0.0, 1.0])
_TF = "tf2_msgs/msg/TFMessage"


def write_mcap(run: Run, path: Path, *, robot_frame: str = "base_link", force: bool = False) -> None:
    """One MCAP file at `path`; it appears when it is complete, or not at all.

    Raises OutputExistsError if it is there already (unless `force`), UsageError if it cannot be written.
    """
    messages = Messages()
    write_bag(Path(path), messages, list(_sources(run, messages, robot_frame)), _about(run), force=force)


def _about(run: Run) -> dict[str, str]:
    """Where the estimate comes from, for the file's metadata."""
    versions = {f"version_{name}": version for name, version in run.versions.items()}
    return {"log": run.log_path, "log_sha256": run.log_sha256, "outcome": run.outcome.value, **versions}


def _sources(run: Run, messages: Messages, robot_frame: str) -> Iterator[Source]:
    kind = "nav_msgs/msg/Odometry"
    yield "/outrider/odometry/global", kind, _odometry(messages, run.fused, "map", robot_frame)
    if run.local is not None:
        yield "/outrider/odometry/local", kind, _odometry(messages, run.local, "odom", robot_frame)
    yield from _transforms(messages, run, robot_frame)
    if len(run.fused.pose):
        yield "/outrider/path", "nav_msgs/msg/Path", _path(messages, run.fused.pose)
    if run.datum is not None:
        yield "/outrider/fix", "sensor_msgs/msg/NavSatFix", _fixes(messages, run.fused.pose, run.datum, robot_frame)
        for name, track in run.tracks.items():
            topic = f"/outrider/tracks/{_legal(name)}"
            yield topic, "sensor_msgs/msg/NavSatFix", _fixes(messages, track, run.datum, robot_frame)
    yield "/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", diagnostics(run, messages)


def _legal(name: str) -> str:
    """A ROS topic made of a stream's name: letters, digits, _ and / only."""
    return "".join(c if c.isalnum() or c in "_/" else "_" for c in name.strip("/")) or "unnamed"


def _known(pose: Trajectory) -> tuple[Floats, Bools]:
    """Attitudes with the identity where unknown, and where they are known."""
    known: Bools = np.isfinite(pose.q).all(axis=1) & np.any(pose.q != 0.0, axis=1)
    return np.where(known[:, None], pose.q, _NO_TURN), known


def ros_covariance(pose: Trajectory) -> Floats:
    """(n, 6, 6) covariance of (x y z, rotation about the fixed axes of the header's frame), zeros where unknown."""
    n = len(pose)
    q, known = _known(pose)
    J = np.zeros((n, 6, 6))  # (dx, dtheta fixed) = J (dx, dtheta body)
    J[:, range(3), range(3)] = 1.0
    J[:, 3:, 3:] = quats_to_matrices(q)
    P = J @ pose.P @ np.swapaxes(J, 1, 2) if len(pose.P) else np.zeros((n, 6, 6))
    P[~np.isfinite(P).all(axis=(1, 2))] = 0.0
    lost = np.flatnonzero(~known)
    P[lost, 3:, :] = P[lost, :, 3:] = 0.0
    P[lost[:, None], range(3, 6), range(3, 6)] = UNKNOWN_ROTATION
    return P


def _odometry(messages: Messages, of: Estimates, frame: str, child: str) -> Iterator[tuple[int, bytes]]:
    """Pose with covariance; velocity and, if the filter has one as a state, the turning rate in the body frame."""
    pose = of.pose
    q, known = _known(pose)
    v = np.zeros((len(pose), 3))
    if len(pose.v):
        v[known] = np.einsum("nji,nj->ni", quats_to_matrices(q), pose.v)[known]  # R' v
    w = np.zeros((len(pose), 3))
    for name, column in (("rate", slice(0, 3)), ("yaw_rate", slice(2, 3))):
        if name in of.layout and len(of.x) == len(pose):
            w[:, column] = of.x[:, of.layout.state(name)]
    columns = {
        **vector("pose.pose.position", pose.p),
        **vector("pose.pose.orientation", q),
        **vector("twist.twist.linear", v),
        **vector("twist.twist.angular", w),
        "pose.covariance": ros_covariance(pose).reshape(-1, 36),
    }
    keep = np.isfinite(pose.p).all(axis=1)
    columns = {name: np.nan_to_num(column[keep], posinf=0.0, neginf=0.0) for name, column in columns.items()}
    strings = {"header.frame_id": frame, "child_frame_id": child}
    return messages.stream("nav_msgs/msg/Odometry", strings, pose.t[keep], columns)


def _usable(pose: Trajectory) -> tuple[Ints, Floats, Floats]:
    """t, p, q of the rows with a position and an attitude."""
    q, keep = _known(pose)
    keep &= np.isfinite(pose.p).all(axis=1)
    return pose.t[keep], pose.p[keep], q[keep]


def _transforms(messages: Messages, run: Run, body: str) -> Iterator[Source]:
    """odom -> body from the local estimate and map -> odom as what is left to the global one; or map = odom."""
    t, p, q = _usable(run.fused.pose)
    if not t.size:
        return
    if run.local is None or not (usable := _usable(run.local.pose))[0].size:
        yield "/tf_static", _TF, messages.links("map", "odom", t[:1], np.zeros((1, 3)), _NO_TURN[None])
        yield "/tf", _TF, messages.links("odom", body, t, p, q)
        return
    tl, pl, ql = usable
    p_ob = np.stack([np.interp(t - tl[0], tl - tl[0], column) for column in pl.T], axis=1)
    q_mo = quats_multiply(q, quats_conjugate(slerp(t, tl, ql)))  # R_mo = R_mb R_bo
    p_mo = p - np.einsum("nij,nj->ni", quats_to_matrices(q_mo), p_ob)
    yield "/tf", _TF, messages.links("map", "odom", t, p_mo, q_mo)
    yield "/tf", _TF, messages.links("odom", body, tl, pl, ql)


def _path(messages: Messages, pose: Trajectory) -> Iterator[tuple[int, bytes]]:
    """The whole way in one message, thinned, at the last stamp."""
    end = int(pose.t[-1])
    t, p, q = _usable(pose)
    rows = np.unique(np.linspace(0, t.size - 1, min(PATH_POSES, t.size)).astype(np.int64))
    poses = [
        messages.make(
            "geometry_msgs/msg/PoseStamped", {"header.frame_id": "map", **_stamp(int(t[i])), **_at(p[i], q[i])}
        )
        for i in rows
    ]
    given = {"header.frame_id": "map", **_stamp(end), "poses": poses}
    yield end, messages.pack(messages.make("nav_msgs/msg/Path", given))


def _stamp(t: int) -> dict[str, int]:
    return {"header.stamp.sec": t // 10**9, "header.stamp.nanosec": t % 10**9}


def _at(p: Floats, q: Floats) -> dict[str, float]:
    place = {f"pose.position.{axis}": float(v) for axis, v in zip("xyz", p, strict=True)}
    return place | {f"pose.orientation.{axis}": float(v) for axis, v in zip("xyzw", q, strict=True)}


def _fixes(messages: Messages, pose: Trajectory, datum: Datum, frame: str) -> Iterator[tuple[int, bytes]]:
    """Positions in degrees with their covariance; status "no fix" where the position is not stood by."""
    keep = np.asarray(np.isfinite(pose.p).all(axis=1))
    lat, lon, alt = enu_to_geodetic(pose.p[keep], datum.lat, datum.lon, datum.alt)
    P = pose.P[keep][:, :3, :3].reshape(-1, 9) if len(pose.P) else np.zeros((int(keep.sum()), 9))
    sound = np.isfinite(P).all(axis=1) & np.any(P != 0.0, axis=1)
    valid = pose.valid[keep] if len(pose.valid) else np.ones(int(keep.sum()), np.bool_)
    columns = {
        "status.status": np.where(valid, 0, -1),
        "status.service": np.ones(lat.size),
        "latitude": np.degrees(lat),
        "longitude": np.degrees(lon),
        "altitude": alt,
        "position_covariance": np.where(sound[:, None], P, 0.0),
        "position_covariance_type": np.where(sound, 3, 0),
    }
    return messages.stream("sensor_msgs/msg/NavSatFix", {"header.frame_id": frame}, pose.t[keep], columns)
