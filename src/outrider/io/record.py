"""Writes an `EventLog` as a ROS 2 recording (one MCAP file), as the robot itself would have recorded it.

A stream becomes a topic of its name, the attitude that an IMU claims goes into the IMU's messages. Mounts become
/tf_static, each robot's about its own base_link. The time of recording is the time of arrival. The message of each kind
is in docs/how-to-simulate.md; FLOW, STATUS, POSITION, ODOMETRY_POSE and RANGE_BEARING have none and are refused.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from outrider.core.attitudes import matrices_to_quats
from outrider.data import EventLog, Kind, Stream
from outrider.errors import DataError
from outrider.io._ros_bag import Source, write_bag
from outrider.io._ros_encode import Messages
from outrider.io._ros_record import BODY, WRITERS, Topic, register


def write_recording(log: EventLog, path: Path, *, force: bool = False) -> None:
    """One MCAP file at `path`; it appears when it is complete, or not at all."""
    messages = Messages()
    register(messages)
    write_bag(path, messages, list(_sources(log, messages)), {"log": log.path}, force=force)


def _sources(log: EventLog, messages: Messages) -> Iterator[Source]:
    start = int(min((s.t_arrival.min() for s in log if len(s)), default=0))
    for frame, T in log.mounts.items():
        q = np.asarray(matrices_to_quats(T[:3, :3]))
        links = messages.links(_beside(frame), frame, np.array([start]), T[None, :3, 3], q[None])
        yield "/tf_static", "tf2_msgs/msg/TFMessage", links
    for s in log:
        if s.kind not in WRITERS:
            raise DataError(f"{s.kind.value} has no message to be recorded in", where=s.name)
        if s.kind is Kind.ATTITUDE and any(_attitude(log, i) is s for i in log.of(Kind.IMU)):
            continue  # it is in the IMU's messages
        kind, write = WRITERS[s.kind]
        attitude = _attitude(log, s) if s.kind is Kind.IMU else None
        yield f"/{s.name.strip('/')}", kind, write(Topic(messages, _beside(s.name.strip("/")), attitude), s)


def _beside(name: str) -> str:
    """The body frame of the robot that a frame or a stream belongs to: `ugv/base_link` for `ugv/gnss`."""
    robot, slash, _ = name.rpartition("/")
    return f"{robot}{slash}{BODY}"


def _attitude(log: EventLog, imu: Stream) -> Stream | None:
    """The attitude that comes in the messages of an IMU: of the same robot and frame, at some of its stamps."""
    found = [
        s for s in log.of(Kind.ATTITUDE) if (s.robot, s.frame) == (imu.robot, imu.frame) and np.isin(s.t, imu.t).all()
    ]
    return found[0] if found else None
