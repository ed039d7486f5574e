"""Regulated pure pursuit: a circle to a point ahead on the path, slower in bends, near things and near the goal.

The plain alternative behind the same interface: it follows the path and waits before what is in the way. Source:
Coulter 1992; Macenski et al. 2023 for the regulation.
"""

from dataclasses import dataclass, field
from math import atan2, cos, hypot, sin
from typing import final

import numpy as np

from outrider.core.angles import wrap
from outrider.data.driving import Conflict, DriveLimits, LocalOutcome, LocalPlan, Situation, Steering
from outrider.data.footprint import Footprint
from outrider.errors import ConfigError
from outrider.planning.local.fallback import Blocked, answer
from outrider.planning.local.guide import cut, near
from outrider.safety.clearance import Body, around, body_of, clash
from outrider.safety.stopping import moved, saturated, smoothed
from outrider.typing import Floats

FACING: float = 0.8  # rad, further off than that a base turns on the spot first


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PursuitSettings:
    """period : s between answers;  ahead : s of way to the point pursued, within nearest and furthest [m];  bend : m
    of radius below which it is slower;  gap : m of room below which it is slower;  foresee : s of the circle that are
    checked;  horizon : s for which others are believed to keep their velocity;  xy, yaw : m, rad of the goal.
    """

    period: float = 0.1
    ahead: float = 1.5
    nearest: float = 0.3
    furthest: float = 1.5
    bend: float = 0.9
    gap: float = 0.4
    foresee: float = 1.5
    horizon: float = 2.0
    xy: float = 0.05
    yaw: float = 0.05

    def __post_init__(self) -> None:
        if not (0.0 < self.nearest <= self.furthest < np.inf and self.period > 0.0 and self.gap > 0.0):
            raise ConfigError("impossible distances or period", where="pursuit", fix="0 < nearest <= furthest")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Pursuit:
    """A `LocalPlanner` that follows its path and goes around nothing."""

    limits: DriveLimits
    footprint: Footprint
    settings: PursuitSettings = field(default_factory=PursuitSettings)
    _body: Body = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_body", body_of(self.footprint))

    def plan(self, now: Situation, last: LocalPlan | None = None) -> LocalPlan:
        """See `LocalPlanner`."""
        s = self.settings
        off, turned = hypot(*(now.goal[:2] - now.pose[:2])), wrap(float(now.goal[2] - now.pose[2]))
        if off < s.xy and not now.through:
            if abs(turned) < s.yaw or not now.faces:
                return LocalPlan(outcome=LocalOutcome.ARRIVED, time=now.time, twist=np.zeros(3))
            want = np.array([0.0, 0.0, self._turn(turned)])
        else:
            want = self._towards(now, off)
        world = around(now.surroundings, s.horizon)
        here = clash(np.array([[*now.pose, 0.0]]), self._body, world)
        want = want * min(1.0, max(here.room, 0.0) / s.gap + 0.3)
        want = saturated(want, self.limits)
        twist = saturated(smoothed(want, now.twist, self.limits, s.period), self.limits)
        t = np.linspace(0.0, s.foresee, 16)
        band = np.column_stack([moved(now.pose, want, t), t])
        hit = clash(band, self._body, world)
        at = np.array([hit.x, hit.y])
        plan = LocalPlan(
            outcome=LocalOutcome.DRIVE,
            time=now.time,
            twist=twist,
            band=band,
            clearance=hit.room,
            conflict=None if hit.free else Conflict(hit.knot, band[hit.knot, :3], hit.time, hit.obstacle, at),
        )
        return answer(Blocked(self.limits, s.period, self._body, world), now, plan, last)

    def _turn(self, angle: float) -> float:
        """As fast as it may and can still stop turning in time."""
        most = min(self.limits.turn, np.sqrt(2.0 * 0.8 * self.limits.turn_acceleration * abs(angle)))
        return float(np.copysign(most, angle))

    def _towards(self, now: Situation, off: float) -> Floats:
        """The wanted twist to the point ahead on the path."""
        s, limits = self.settings, self.limits
        speed = float(np.hypot(now.twist[0], now.twist[1]))
        reach = min(max(s.ahead * speed, s.nearest), s.furthest)
        path = near(now, 1e9).path
        carrot = cut(path, reach)[0][-1]
        dx, dy = carrot - now.pose[:2]
        c, h = cos(now.pose[2]), sin(now.pose[2])
        x, y = c * dx + h * dy, c * dy - h * dx
        left = float(np.hypot(*np.diff(path, axis=0).T).sum())
        v = limits.forward if now.through else min(limits.forward, np.sqrt(2.0 * 0.8 * limits.deceleration * left))
        if limits.steering is Steering.HOLONOMIC:
            far = max(hypot(x, y), 1e-9)
            turned = wrap(float(now.goal[2] - now.pose[2]))
            w = turned * v / max(left, v * s.period)
            return np.array([v * x / far, v * y / far, w])
        bearing = atan2(y, x)
        if limits.steering is Steering.DIFFERENTIAL and abs(bearing) > FACING and off > s.xy:
            return np.array([0.0, 0.0, self._turn(bearing)])
        bend = 2.0 * y / max(x * x + y * y, 1e-9)
        v *= min(1.0, 1.0 / max(abs(bend) * s.bend, 1e-9))
        return np.array([v, 0.0, v * bend])
