"""The last stage before the motors: watchdog, collision monitor, limits, in this order, whichever planner drives."""

from dataclasses import dataclass, replace
from enum import Enum
from typing import Final, Self, final

import numpy as np

from outrider.data.driving import DriveLimits
from outrider.errors import ConfigError
from outrider.safety.monitor import HERE, Action, Monitor, Ruling, Watch, returns
from outrider.safety.stopping import REST, moved, saturated, smoothed, stop, stopping_time
from outrider.typing import Floats


class Reason(Enum):
    """Why a robot is not driven as its planner says."""

    NONE = "driven as commanded"
    LIMITED = "the command is beyond what the base may do: scaled down"
    SLOWED = Action.SLOW.value
    APPROACHING = Action.APPROACH.value
    LEAVING = Action.LEAVE.value
    ZONE = Action.STOP.value
    BLIND = Action.BLIND.value
    NO_LOCALISATION = "the position is not known any more: check the estimator and its sensors"
    NO_SCAN = "no scan any more: check the lidar and its link"
    NO_COMMAND = "no command any more: check the planner"
    BAD_COMMAND = "the command is not finite: check the planner"
    BAD_POSE = "the position is not finite: check the estimator"
    CLOCK = "time went backward: check the clock"

    @property
    def stops(self) -> bool:
        """Whether the robot is brought to rest."""
        return self not in (Reason.NONE, Reason.LIMITED, Reason.SLOWED, Reason.APPROACHING, Reason.LEAVING)


MISSED: Final = 2.5  # scans
LATE: Final = 0.25  # s from a scan until a cycle has it, at most
RULED: Final = {
    Action.SLOW: Reason.SLOWED,
    Action.APPROACH: Reason.APPROACHING,
    Action.LEAVE: Reason.LEAVING,
    Action.STOP: Reason.ZONE,
    Action.BLIND: Reason.BLIND,
}


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Scan:
    """A raw scan: ranges (n,) m, NaN invalid, inf empty; angles in the frame of the lidar, its pose on the body."""

    time: float
    ranges: Floats
    angle_min: float
    angle_step: float
    reach: float
    mount: tuple[float, float, float] = (0.0, 0.0, 0.0)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Inputs:
    """What has reached the stage by `time` [s]; None for what never came."""

    time: float
    command: Floats | None = None  # (3,)
    command_time: float = -np.inf
    pose: Floats | None = None  # (3,)
    pose_time: float = -np.inf
    scan: Scan | None = None


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Watchdog:
    """How old [s] the last localisation, scan and command may be."""

    localisation: float = 0.5
    scan: float = 0.5
    command: float = 0.3

    def __post_init__(self) -> None:
        if not all(0.0 < x < np.inf for x in (self.localisation, self.scan, self.command)):
            raise ConfigError("ages must be positive and finite", where="watchdog")

    @classmethod
    def at(cls, scan_s: float) -> Self:
        """For a lidar that scans every `scan_s` seconds: two scans in a row may be lost, and the third be late."""
        return cls(scan=LATE + MISSED * scan_s)

    def fault(self, x: Inputs, *, sees: bool = True) -> Reason | None:
        """What is missing, too old, from the future or not finite; None if all is well. `sees`: scans are due."""
        if x.pose is None or not 0.0 <= x.time - x.pose_time <= self.localisation:
            return Reason.NO_LOCALISATION
        if not np.isfinite(x.pose).all():
            return Reason.BAD_POSE
        if sees and (x.scan is None or not 0.0 <= x.time - x.scan.time <= self.scan):
            return Reason.NO_SCAN
        if x.command is None or not 0.0 <= x.time - x.command_time <= self.command:
            return Reason.NO_COMMAND
        if x.command.shape != (3,) or not np.isfinite(x.command).all():
            return Reason.BAD_COMMAND
        return None


@final
@dataclass(frozen=True, slots=True)
class Held:
    """State of the stage: when it last spoke, the twist (3,) it gave and why, the monitor's memory; per reason, in how
    many cycles a motion was changed for it, and how many times in a row of cycles that began."""

    time: float
    twist: Floats
    watch: Watch
    reason: Reason = Reason.NONE
    counts: tuple[int, ...] = (0,) * len(Reason)
    began: tuple[int, ...] = (0,) * len(Reason)

    def count(self, reason: Reason) -> int:
        """In how many cycles this was the reason."""
        return self.counts[list(Reason).index(reason)]

    def times(self, reason: Reason) -> int:
        """How many times this became the reason."""
        return self.began[list(Reason).index(reason)]


@final
@dataclass(frozen=True, slots=True)
class Given:
    """What the motors are told, and why."""

    twist: Floats
    reason: Reason
    ruling: Ruling | None = None


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class SafetyStage:
    """A pure step from state and inputs to a twist that is within the limits and changes no faster than they say.

    In doubt the answer is a controlled stop, never the last velocity.  monitor : None for a base without a lidar, of
    which no scan is asked;  period : s, the longest step that a twist is let change for.
    """

    limits: DriveLimits
    monitor: Monitor | None
    watchdog: Watchdog = Watchdog()
    period: float = 0.1

    def start(self, time: float) -> Held:
        """At rest."""
        return Held(time, np.zeros(3), Watch((), ()) if self.monitor is None else self.monitor.start())

    def step(self, state: Held, x: Inputs) -> tuple[Held, Given]:
        """One cycle."""
        dt = min(max(x.time - state.time, 0.0), self.period) if np.isfinite(x.time) else self.period
        backward = not x.time >= state.time
        fault = Reason.CLOCK if backward else self.watchdog.fault(x, sees=self.monitor is not None)
        if fault is not None or x.command is None:
            given = Given(stop(state.twist, self.limits, dt or self.period), fault or Reason.NO_COMMAND)
            return self._after(state, replace(x, time=state.time) if backward else x, state.watch, given)
        # limits first: the monitor follows what will really be driven
        want = saturated(x.command, self.limits)
        watch, ruling = self._ruled(state, x, want)
        if ruling.action in (Action.STOP, Action.BLIND):
            given = Given(stop(state.twist, self.limits, dt), RULED[ruling.action], ruling)
            return self._after(state, x, watch, given)
        twist = smoothed(ruling.twist, state.twist, self.limits, dt)
        usual = Reason.NONE if np.allclose(twist, x.command, rtol=0.0, atol=1e-6) else Reason.LIMITED
        return self._after(state, x, watch, Given(twist, RULED.get(ruling.action, usual), ruling))

    def _ruled(self, state: Held, x: Inputs, want: Floats) -> tuple[Watch, Ruling]:
        """The monitor's word on a command, with the scan where it is seen from now."""
        if self.monitor is None or x.scan is None:
            return state.watch, Ruling(Action.NONE, want)
        scan = x.scan
        points = returns(scan.ranges, scan.angle_min, scan.angle_step, scan.reach, np.array(scan.mount))
        px, py, turned = moved(HERE, state.twist, np.array([x.time - scan.time]))[0]
        c, s = np.cos(turned), np.sin(turned)
        points = (points - [px, py]) @ np.array([[c, -s], [s, c]])
        return self.monitor.rule(state.watch, scan.ranges, points, want, stopping_time(want, self.limits))

    def _after(self, state: Held, x: Inputs, watch: Watch, given: Given) -> tuple[Held, Given]:
        """Remember, and count: a reason not to move counts only where something moves or wants to."""
        still = x.command is not None and x.command.shape == (3,) and bool((np.abs(x.command) <= REST).all())
        reason = Reason.NONE if still and np.abs(state.twist).max() <= REST else given.reason
        hit = tuple(r is reason for r in Reason)
        counts = tuple(n + h for n, h in zip(state.counts, hit, strict=True))
        new = reason is not state.reason
        began = tuple(n + (h and new) for n, h in zip(state.began, hit, strict=True))
        return Held(x.time, given.twist, watch, reason, counts, began), given
