"""Giving way: a planner's command is driven only while it stays clear of whoever moves; else the mildest that does.

Who moves is believed to keep his velocity, and looks at nothing: it is the robot that yields. Short motions (speed up
or slow down to a twist, hold it, brake to rest) are followed through the predicted discs, as in the dynamic window
approach (Fox, Burgard, Thrun 1997) but with the others' motion, as in velocity obstacles (Fiorini, Shiller 1998).
"""

from dataclasses import dataclass, field, replace
from itertools import product
from typing import Final, final

import numpy as np

from outrider.data.driving import Conflict, DriveLimits, LocalOutcome, LocalPlan, LocalPlanner, Situation, Steering
from outrider.data.footprint import Footprint
from outrider.data.surroundings import DistanceField
from outrider.planning.local.evasions import motions, nearest, ramp, shortages
from outrider.safety.stopping import saturated
from outrider.typing import Floats, Ints

STANDS: Final = 0.1  # m/s, slower than anybody walks
SHARES: Final = (1.0, 0.75, 0.5, 0.25)  # of the planner's command
NEAR: Final = 8.0  # m, who is further away does not matter yet


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class YieldSettings:
    """room, growth : m of room wanted to who moves, and how much more of it per second ahead;  back : m more before the
    planner's command is driven again;  horizon, step : s that are looked ahead, and between looks;  further : s that
    are looked ahead by a robot that is about to stand;  holds : s that a motion may be held;  period : s between
    answers."""

    room: float = 0.15
    growth: float = 0.1
    back: float = 0.05
    horizon: float = 3.0
    further: float = 5.0
    holds: tuple[float, ...] = (0.8, 2.5)
    step: float = 0.15
    period: float = 0.1


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Yielding:
    """A `LocalPlanner` around another one."""

    planner: LocalPlanner
    footprint: Footprint
    settings: YieldSettings = field(default_factory=YieldSettings)
    _twists: Floats = field(init=False, repr=False, compare=False)
    _rates: Floats = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_twists", _choices(self.limits))
        u = self.limits
        rates = [[u.acceleration] * 2 + [u.turn_acceleration], [u.deceleration] * 2 + [u.turn_acceleration]]
        object.__setattr__(self, "_rates", np.array(rates))

    @property
    def limits(self) -> DriveLimits:
        """Of the planner's base."""
        return self.planner.limits

    def plan(self, now: Situation, last: LocalPlan | None = None) -> LocalPlan:
        """See `LocalPlanner`."""
        plan = self.planner.plan(now, last)
        discs = now.surroundings.discs
        moving = discs[np.hypot(discs[:, 3], discs[:, 4]) >= STANDS]
        moving = moving[np.hypot(*(moving[:, :2] - now.pose[:2]).T) < NEAR]
        if not len(moving):
            return plan
        s = self.settings
        n = round(s.horizon / s.step)
        # as planned
        spare = s.back if last is not None and last.outcome is LocalOutcome.GIVE_WAY else 0.0
        on = plan.outcome is LocalOutcome.DRIVE
        planned = (
            _along(plan.band, s.step * np.arange(1.0, n + 1.0)) if on else self._motions(now, plan.twist[None], n, 0.0)
        )
        short, _ = self._shortage(planned, moving)
        if short[0] <= -spare:
            return plan
        # the mildest motion that keeps clear, or the one that comes least near
        wanted = np.vstack([self._twists, np.array(SHARES)[:, None] * plan.twist])
        stays = self._stays(plan, now)
        seen = round(s.further / s.step) if stays else n
        poses = np.concatenate([self._motions(now, wanted, seen, hold) for hold in s.holds])
        wanted = np.tile(wanted, (len(s.holds), 1))
        short, who = self._shortage(poses, moving)
        taken = _touches(now.surroundings.field, poses, now.pose, self.footprint.inscribed)
        if stays:  # it has to come back
            change = np.hypot(*(poses[:, -1, :2] - now.goal[:2]).T)
        else:
            change = np.hypot(*(wanted[:, :2] - plan.twist[:2]).T) + 0.3 * np.abs(wanted[:, 2] - plan.twist[2])
        best = int(np.argmin(100.0 * taken + 20.0 * np.maximum(short, 0.0) + change))
        speeds = zip(now.twist.tolist(), wanted[best].tolist(), *self._rates.tolist(), strict=True)
        twist = np.array([ramp(v, want, up, down, s.period) for v, want, up, down in speeds])
        disc = moving[who[0]]
        conflict = Conflict(0, now.pose, 0.0, int(np.flatnonzero((discs == disc).all(axis=1))[0]), disc[:2])
        return replace(plan, outcome=LocalOutcome.GIVE_WAY, twist=saturated(twist, self.limits), conflict=conflict)

    def _stays(self, plan: LocalPlan, now: Situation) -> bool:
        """Whether the robot will stand at its goal while it looks: then who is faster catches up with it."""
        s = self.settings
        if now.through or not len(plan.band) or plan.duration >= s.horizon:
            return False
        return float(np.hypot(*(plan.band[-1, :2] - now.goal[:2]))) < s.room

    def _motions(self, now: Situation, wanted: Floats, n: int, hold: float) -> Floats:
        """(k, n, 3) poses: to each of the twists (k, 3), held until `hold` [s], then to rest."""
        out = np.empty((len(wanted), n, 3))
        motions(now.pose, now.twist, wanted, self._rates, hold, self.settings.step, out)
        return out

    def _shortage(self, poses: Floats, moving: Floats) -> tuple[Floats, Ints]:
        """(k,) m of room that is missing at worst, less the later; negative for what is to spare; (k,) whom to."""
        s, short, who = self.settings, np.empty(len(poses)), np.empty(len(poses), np.int64)
        shortages(poses, moving, s.step, self.footprint.circumscribed + s.room, s.growth, s.horizon, short, who)
        return short, who


def _along(band: Floats, t: Floats) -> Floats:
    """(1, n, 3) poses of a band at times t; it ends where it ends."""
    return np.stack([np.interp(t, band[:, 3], band[:, k]) for k in range(3)], axis=-1)[None]


def _choices(limits: DriveLimits) -> Floats:
    """(k, 3) twists that the base can drive, all over its limits."""
    ahead = [limits.forward * x for x in (1.0, 0.7, 0.4, 0.2, 0.0)] + [-limits.backward * x for x in (0.5, 1.0)]
    if limits.steering is Steering.HOLONOMIC:
        rest = [(limits.sideways * y, 0.0) for y in (-1.0, -0.5, 0.0, 0.5, 1.0)]
    else:
        rest = [(0.0, limits.turn * w) for w in (-1.0, -0.5, 0.0, 0.5, 1.0)]
    grid = [np.array([x, *r]) for x, r in product(ahead, rest)]
    return np.array([saturated(u, limits) for u in grid])


def _touches(field_: DistanceField | None, poses: Floats, pose: Floats, radius: float) -> Floats:
    """(k,) m by which motions come too near to what is mapped, at worst; what is as near as now does not count."""
    out, here = np.zeros(len(poses)), np.empty(1)
    if field_ is None:
        return out
    (west, south), resolution = field_.origin.tolist(), field_.resolution
    nearest(field_.distances, west, south, resolution, pose[None, None], here)
    nearest(field_.distances, west, south, resolution, poses, out)
    return np.maximum(min(float(here[0]), radius + resolution) - out - 1e-6, 0.0)
