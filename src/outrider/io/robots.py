"""Recordings of several robots: the reader tells them apart, or each speaks under its own name.

In ROS a name stands before topics (`/ugv/imu`) and frames (`ugv/imu`).
"""

from dataclasses import replace

from outrider.data import EventLog
from outrider.errors import UsageError


def robots_of(log: EventLog) -> tuple[str, ...]:
    """Names that the reader gave, else those under which both topics and frames stand; empty where there are none."""
    if len(told := {s.robot for s in log}) > 1:
        return tuple(sorted(told))
    spaces = {s.name.strip("/").split("/")[0] for s in log if "/" in s.name.strip("/")}
    frames = {f.split("/")[0] for f in (*log.mounts, *(s.frame for s in log)) if "/" in f}
    return tuple(sorted(spaces & frames))


def of_robot(log: EventLog, name: str | None) -> EventLog:
    """What one robot of a recording sent. Without a name the log must be of one robot.

    Raises UsageError for a robot that is not there, and for several robots without a name.
    """
    known = robots_of(log)
    if name is None:
        if len(known) > 1:
            raise UsageError(f"holds {len(known)} robots", where=log.path, fix=f"--robot {' or '.join(known)}")
        return log
    if name not in known:
        there = f"it has {', '.join(known)}" if known else "its topics and frames carry no robot's name"
        raise UsageError(f"no robot '{name}'", where=log.path, fix=there)
    prefix = f"{name}/"
    if name in {s.robot for s in log}:
        own = {key: s for key, s in log.streams.items() if s.robot == name}
    else:
        own = {key: replace(s, robot=name) for key, s in log.streams.items() if key.strip("/").startswith(prefix)}
    return replace(log, streams=own, mounts={f: T for f, T in log.mounts.items() if f.startswith(prefix)})
