"""Giving way: a planner's command is driven only while it stays clear of whoever moves; else the mildest that does.

Who moves is believed to keep his velocity, and looks at nothing: it is the robot that yields. Short motions (speed up
or slow down to a twist, hold it, brake to rest) are followed through the predicted discs, as in the dynamic window
approach (Fox, Burgard, Thrun 1997) but with the others' motion, as in velocity obstacles (Fiorini, Shiller 1998).
"""

from dataclasses import dataclass, field, replace
from itertools import product
from math import inf
from typing import Final, final

import numpy as np

from outrider.data.driving import Conflict, DriveLimits, LocalOutcome, LocalPlan, LocalPlanner, Situation, Steering
from outrider.data.footprint import Footprint
from outrider.data.surroundings import DistanceField
from outrider.safety.stopping import saturated
from outrider.typing import Floats

STANDS: Final = 0.1  # m/s, slower than anybody walks
SHARES: Final = (1.0, 0.75, 0.5, 0.25)  # of the planner's command
NEAR: Final = 8.0  # m, who is further away does not matter yet


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class YieldSettings:
    """room, growth : m of room wanted to who moves, and how much more of it per second ahead;  back : m more before the
    planner's command is driven again;  horizon, step : s that are looked ahead, and between looks;  holds : s that a
    motion may be held;  period : s between answers."""

    room: float = 0.15
    growth: float = 0.1
    back: float = 0.05
    horizon: float = 3.0
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

    def __post_init__(self) -> None:
        object.__setattr__(self, "_twists", _choices(self.limits))

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
        t = s.step * np.arange(1.0, round(s.horizon / s.step) + 1.0, dtype=np.float64)
        # as planned
        spare = s.back if last is not None and last.outcome is LocalOutcome.GIVE_WAY else 0.0
        on = plan.outcome is LocalOutcome.DRIVE
        planned = _along(plan.band, t) if on else self._motions(now, plan.twist[None], t, 0.0)
        short, _ = self._shortage(planned, moving, t)
        if short[0] <= -spare:
            return plan
        # the mildest motion that keeps clear, or the one that comes least near
        wanted = np.vstack([self._twists, np.array(SHARES)[:, None] * plan.twist])
        motions = np.concatenate([self._motions(now, wanted, t, hold) for hold in s.holds])
        wanted = np.tile(wanted, (len(s.holds), 1))
        short, who = self._shortage(motions, moving, t)
        taken = _touches(now.surroundings.field, motions, now.pose, self.footprint.inscribed)
        change = np.hypot(*(wanted[:, :2] - plan.twist[:2]).T) + 0.3 * np.abs(wanted[:, 2] - plan.twist[2])
        best = int(np.argmin(100.0 * taken + 20.0 * np.maximum(short, 0.0) + change))
        twist = saturated(_ramps(now.twist, wanted[best, None], self.limits, np.array([s.period]))[0, 0], self.limits)
        disc = moving[who[0]]
        conflict = Conflict(0, now.pose, 0.0, int(np.flatnonzero((discs == disc).all(axis=1))[0]), disc[:2])
        return replace(plan, outcome=LocalOutcome.GIVE_WAY, twist=twist, conflict=conflict)

    def _motions(self, now: Situation, wanted: Floats, t: Floats, hold: float) -> Floats:
        """(k, n, 3) poses at times t (n,): to each of the twists (k, 3), held until `hold` [s], then to rest."""
        s, limits = self.settings, self.limits
        down = _seconds(wanted, limits, limits.deceleration)
        fine = np.arange(0.0, s.horizon, 0.5 * s.step) + 0.25 * s.step
        fall = np.clip(1.0 - (fine - hold) / np.maximum(down, 1e-9)[:, None], 0.0, 1.0)
        u = _ramps(now.twist, wanted, limits, fine) * fall[..., None]
        heading = now.pose[2] + np.cumsum(u[..., 2], axis=1) * 0.5 * s.step
        c, k = np.cos(heading), np.sin(heading)
        x = now.pose[0] + np.cumsum(c * u[..., 0] - k * u[..., 1], axis=1) * 0.5 * s.step
        y = now.pose[1] + np.cumsum(k * u[..., 0] + c * u[..., 1], axis=1) * 0.5 * s.step
        return np.stack([x, y, heading], axis=-1)[:, 1::2][:, : len(t)]

    def _shortage(self, motions: Floats, moving: Floats, t: Floats) -> tuple[Floats, Floats]:
        """(k,) m of room that is missing at worst, less the later; negative for what is to spare; (k,) whom to."""
        s = self.settings
        there = moving[None, :, :2] + t[:, None, None] * moving[None, :, 3:]  # (n, m, 2)
        gap = np.linalg.norm(motions[:, :, None, :2] - there[None], axis=-1) - moving[:, 2]
        missing = (self.footprint.circumscribed + s.room + s.growth * t)[None, :, None] - gap
        missing = np.where(missing > 0.0, missing * (1.0 - 0.5 * t / s.horizon)[None, :, None], missing)
        worst = missing.max(axis=1)
        return worst.max(axis=1), worst.argmax(axis=1)


def _ramps(twist: Floats, wanted: Floats, limits: DriveLimits, t: Floats) -> Floats:
    """(k, n, 3) twists at times t (n,) on the way to `wanted` (k, 3), each axis as fast as it may by itself."""
    speed_up = np.array([limits.acceleration, limits.acceleration, limits.turn_acceleration])
    slow_down = np.array([limits.deceleration, limits.deceleration, limits.turn_acceleration])
    change = wanted - twist
    slower = np.where(twist * change < 0.0, np.minimum(np.abs(change), np.abs(twist)), 0.0)  # this part of it
    first = t[:, None] * slow_down
    late = np.maximum(t[:, None] - (slower / slow_down)[:, None], 0.0) * speed_up
    gone = np.minimum(first, slower[:, None]) + np.minimum(late, (np.abs(change) - slower)[:, None])
    return twist + np.sign(change)[:, None] * gone


def _seconds(change: Floats, limits: DriveLimits, rate: float) -> Floats:
    """(k,) s that changes of twist (k, 3) take."""
    return np.maximum(np.abs(change[:, :2]).max(axis=1) / rate, np.abs(change[:, 2]) / limits.turn_acceleration)


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


def _touches(field_: DistanceField | None, motions: Floats, pose: Floats, radius: float) -> Floats:
    """(k,) m by which motions come too near to what is mapped, at worst; what is as near as now does not count."""
    if field_ is None:
        return np.zeros(len(motions))
    here = min(float(_distances(field_, pose[None, None])[0, 0]), radius + field_.resolution)
    return np.maximum(here - _distances(field_, motions).min(axis=1) - 1e-6, 0.0)


def _distances(field_: DistanceField, poses: Floats) -> Floats:
    """(k, n) m from places to the nearest taken cell, inf beyond the map."""
    cells = np.floor((poses[..., :2] - field_.origin) / field_.resolution).astype(np.int64)
    rows, cols = field_.distances.shape
    inside = (cells >= 0).all(axis=-1) & (cells[..., 0] < cols) & (cells[..., 1] < rows)
    at = np.where(inside[..., None], cells, 0)
    return np.where(inside, field_.distances[at[..., 1], at[..., 0]], inf)
