"""The last stage before the motors: watchdog, collision monitor, limits, in this order, whichever planner drives."""

from dataclasses import dataclass, replace
from enum import Enum
from typing import final

import numpy as np

from outrider.data.driving import DriveLimits
from outrider.errors import ConfigError
from outrider.safety.monitor import Action, Monitor, Ruling, Watch, returns
from outrider.safety.stopping import saturated, smoothed, stop
from outrider.typing import Floats


class Reason(Enum):
    """Why a robot is not driven as its planner says."""

    NONE = "driven as commanded"
    LIMITED = "the command is beyond what the base may do: scaled down"
    SLOWED = Action.SLOW.value
    APPROACHING = Action.APPROACH.value
    ZONE = Action.STOP.value
    BLIND = Action.BLIND.value
    NO_LOCALISATION = "the position is not known any more: check the estimator and its sensors"
    NO_SCAN = "no scan any more: check the lidar and its link"
    NO_COMMAND = "no command any more: check the planner"
    BAD_COMMAND = "the command is not finite: check the planner"
    BAD_POSE = "the position is not finite: check the estimator"
    CLOCK = "time went backward: check the clock"


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

    def fault(self, x: Inputs) -> Reason | None:
        """What is missing, too old, from the future or not finite; None if all is well."""
        if x.pose is None or not 0.0 <= x.time - x.pose_time <= self.localisation:
            return Reason.NO_LOCALISATION
        if not np.isfinite(x.pose).all():
            return Reason.BAD_POSE
        if x.scan is None or not 0.0 <= x.time - x.scan.time <= self.scan:
            return Reason.NO_SCAN
        if x.command is None or not 0.0 <= x.time - x.command_time <= self.command:
            return Reason.NO_COMMAND
        if x.command.shape != (3,) or not np.isfinite(x.command).all():
            return Reason.BAD_COMMAND
        return None


@final
@dataclass(frozen=True, slots=True)
class Held:
    """State of the stage: when it last spoke, the twist (3,) it gave, the monitor's memory, how often each reason."""

    time: float
    twist: Floats
    watch: Watch
    counts: tuple[int, ...] = (0,) * len(Reason)

    def count(self, reason: Reason) -> int:
        """How often this was the reason."""
        return self.counts[list(Reason).index(reason)]


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

    In doubt the answer is a controlled stop, never the last velocity.  period : s, the longest step that a twist is
    let change for.
    """

    limits: DriveLimits
    monitor: Monitor
    watchdog: Watchdog = Watchdog()
    period: float = 0.1

    def start(self, time: float) -> Held:
        """At rest."""
        return Held(time, np.zeros(3), self.monitor.start())

    def step(self, state: Held, x: Inputs) -> tuple[Held, Given]:
        """One cycle."""
        dt = min(max(x.time - state.time, 0.0), self.period) if np.isfinite(x.time) else self.period
        backward = not x.time >= state.time
        fault = Reason.CLOCK if backward else self.watchdog.fault(x)
        if fault is not None or x.command is None or x.scan is None:
            given = Given(stop(state.twist, self.limits, dt or self.period), fault or Reason.NO_COMMAND)
            return self._after(state, state.time if backward else x.time, state.watch, given)
        # limits first: the monitor follows what will really be driven
        want = saturated(x.command, self.limits)
        scan, mount = x.scan, np.array(x.scan.mount)
        points = returns(scan.ranges, scan.angle_min, scan.angle_step, scan.reach, mount)
        watch, ruling = self.monitor.rule(state.watch, scan.ranges, points, want)
        if ruling.action in (Action.STOP, Action.BLIND):
            reason = Reason.BLIND if ruling.action is Action.BLIND else Reason.ZONE
            given = Given(stop(state.twist, self.limits, dt), reason, ruling)
            return self._after(state, x.time, watch, given)
        twist = smoothed(ruling.twist, state.twist, self.limits, dt)
        usual = Reason.NONE if np.array_equal(twist, x.command) else Reason.LIMITED
        reason = {Action.SLOW: Reason.SLOWED, Action.APPROACH: Reason.APPROACHING}.get(ruling.action, usual)
        return self._after(state, x.time, watch, Given(twist, reason, ruling))

    def _after(self, state: Held, time: float, watch: Watch, given: Given) -> tuple[Held, Given]:
        counts = tuple(n + (r is given.reason) for n, r in zip(state.counts, Reason, strict=True))
        return replace(state, time=time, twist=given.twist, watch=watch, counts=counts), given
