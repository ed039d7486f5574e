"""Timed elastic band: poses and times, optimised together, in several ways around things.

Source: amr2025 (19)-(22); Roesmann et al. 2012 and 2017 for terms and classes. What differs from the usual form: see
`terms`, and `docs/how-to-drive.md`.
"""

from dataclasses import dataclass, field, replace
from math import cos, sin
from typing import Final, final

import numpy as np

from outrider.core.angles import wrap
from outrider.data.driving import Conflict, DriveLimits, LocalOutcome, LocalPlan, Situation, Steering
from outrider.data.footprint import Footprint
from outrider.errors import ConfigError
from outrider.planning.local.bands import along, resumed
from outrider.planning.local.cover import cover
from outrider.planning.local.fallback import Blocked, answer
from outrider.planning.local.guide import near
from outrider.planning.local.optimise import optimise
from outrider.planning.local.problem import Problem, Weights, Work, workspace
from outrider.planning.local.ways import obstacles_near, same, signature, ways
from outrider.safety.clearance import Around, Body, Clash, around, body_of, clash, clash_ahead
from outrider.safety.stopping import braking, saturated, smoothed, stop, stopping_distance
from outrider.typing import Floats

SLOW: Final = 0.1  # of the limits

LAST = 1.5  # m before a goal: it may stand closer to something than the gap


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class TebSettings:
    """What physics does not say.

    step : m between knots at full speed, and dt : s at the most;  period : s between answers;  reach : m of path that
    is looked at;  gap : m wanted to obstacles;  spare : m below which a trajectory counts as blocked;  horizon : s for
    which others are believed to keep their velocity;  notice : s from when somebody sets off until the robot brakes;
    slowest : m/s with which it passes whoever might;  capacity : knots;  ways : at most so many are compared;
    explore : s between looking for other ways;  keep : s and share of the time by which another way must be better;
    dear : s that passing something without a gap costs in the comparison;
    xy, yaw : m and rad within which a goal is reached;
    share : of the limits that is planned with.
    """

    step: float = 0.16
    dt: float = 0.3
    period: float = 0.1
    reach: float = 8.0
    gap: float = 0.3
    spare: float = 0.02
    horizon: float = 4.0
    notice: float = 0.6
    slowest: float = 0.15
    capacity: int = 240
    ways: int = 4
    explore: float = 0.5
    keep: tuple[float, float] = (0.5, 0.1)
    dear: float = 4.0
    xy: float = 0.03
    yaw: float = 0.05
    share: float = 0.98
    weights: Weights = field(default_factory=Weights)

    def __post_init__(self) -> None:
        positive = ("step", "dt", "period", "reach", "gap", "horizon", "notice", "slowest", "explore", "xy", "yaw")
        for name in (*positive, "share"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise ConfigError(f"{name} of {getattr(self, name)}", where="teb", fix="a positive number")
        if self.capacity < 20 or self.ways < 1:
            fix = "at least 20 knots and one way"
            raise ConfigError(f"capacity {self.capacity}, ways {self.ways}", where="teb", fix=fix)


@final
@dataclass(frozen=True, slots=True)
class Band:
    """An optimised band, what its check says, and what it is worth [s]."""

    z: Floats
    clash: Clash
    value: float
    iterations: int
    other: bool = False  # of another class than the one from before


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Teb:
    """A `LocalPlanner`: the band from before and new ways around things, optimised; the best that is free is driven.

    Answers depend on the arguments only. One instance serves one thread: its scratch is reused.
    """

    limits: DriveLimits
    footprint: Footprint
    settings: TebSettings = field(default_factory=TebSettings)
    _work: Work = field(init=False, repr=False, compare=False)
    _discs: Floats = field(init=False, repr=False, compare=False)
    _body: Body = field(init=False, repr=False, compare=False)
    _rows: Floats = field(init=False, repr=False, compare=False)
    _dt: float = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_work", workspace(self.settings.capacity))
        object.__setattr__(self, "_discs", cover(self.footprint))
        object.__setattr__(self, "_body", body_of(self.footprint))
        object.__setattr__(self, "_rows", self.limits.rows)
        object.__setattr__(self, "_dt", min(self.settings.dt, self.settings.step / self.limits.forward))

    def plan(self, now: Situation, last: LocalPlan | None = None) -> LocalPlan:
        """See `LocalPlanner`."""
        around_ = around(now.surroundings, self.settings.horizon)
        blocked = Blocked(self.limits, self.settings.period, self._body, around_)
        # a robot that stands at its goal stays, one that would come to stand there brakes
        outcome = self._at_goal(now, last)
        if outcome is not None:
            twist = stop(now.twist, self.limits, self.settings.period)
            band = braking(now.pose, now.twist, self.limits, 0.0)
            return answer(blocked, now, LocalPlan(outcome=outcome, time=now.time, twist=twist, band=band), last)
        # the next metres of the path
        here = near(now, self.settings.reach)
        problem = self._problem(here, around_)
        # the band from before, from here on
        kept = None if last is None else resumed(last.band, now.time - last.time, here)
        current = None if kept is None else self._optimised(kept, problem, around_, passes=2, iterations=12)
        # other ways, now and then, and whenever this one is blocked
        explored = last.explored if last is not None else -np.inf
        bands = [] if current is None else [current]
        stalled = current is not None and last is not None and self._stalled(current, now, last)
        due = now.time - explored >= self.settings.explore
        if current is None or not current.clash.free or due or stalled:
            bands += self._others(here, problem, around_, current, again=stalled)
            explored = now.time
        # the best of them, in doubt the one from before
        best = self._chosen(bands, current)
        plan = LocalPlan(
            outcome=LocalOutcome.DRIVE,
            time=now.time,
            twist=self._command(best.z, here),
            band=best.z,
            clearance=best.clash.room,
            classes=len(bands),
            switched=best.other,
            iterations=sum(b.iterations for b in bands),
            explored=explored,
            conflict=None if best.clash.free else _conflict(best),
        )
        # what the robot can still do if the way is blocked
        return answer(blocked, here, plan, last)

    def _at_goal(self, now: Situation, last: LocalPlan | None) -> LocalOutcome | None:
        """Whether the place where the robot would stand is as good as the goal, and one period later not better."""
        s, reach = self.settings, float(np.hypot(*(now.goal[:2] - now.pose[:2])))
        speed, turn = float(np.hypot(now.twist[0], now.twist[1])), abs(float(now.twist[2]))
        if now.through or reach > 2.0 * s.xy + stopping_distance(speed, self.limits.deceleration):
            return None
        was = last is not None and last.outcome is LocalOutcome.ARRIVED
        wide = 2.0 if was else 1.0  # a robot that has arrived does not twitch
        rest, late = (self._off(braking(now.pose, now.twist, self.limits, t)[-1], now.goal) for t in (0.0, s.period))
        if max(rest) >= wide:
            return None
        if speed < 0.1 and turn < 0.2:
            return LocalOutcome.ARRIVED
        return LocalOutcome.DRIVE if sum(rest) <= sum(late) else None

    def _off(self, pose: Floats, goal: Floats) -> tuple[float, float]:
        """Distance and angle to the goal, in shares of what is allowed."""
        s = self.settings
        return float(np.hypot(*(goal[:2] - pose[:2]))) / s.xy, abs(wrap(float(goal[2] - pose[2]))) / s.yaw

    def _problem(self, now: Situation, a: Around) -> Problem:
        s, limits = self.settings, self.limits
        gap = s.gap
        if not now.through and np.hypot(*(now.goal[:2] - now.pose[:2])) < LAST:
            gap = min(gap, max(clash(np.array([[*now.goal, 0.0]]), self._body, a).room, s.spare))
        return Problem(
            weights=s.weights, dt=self._dt, share=s.share, top=limits.forward,
            holonomic=limits.steering is Steering.HOLONOMIC, radius=1.1 * limits.min_radius, through=now.through,
            gap=gap, horizon=s.horizon, reaction=s.notice + 0.5 * limits.forward / limits.deceleration,
            slowest=s.slowest, west=a.west, south=a.south, resolution=a.resolution, rows=self._rows,
            rates=np.vstack([limits.axes, now.twist]), discs=self._discs, obstacles=a.discs,
            wary=now.surroundings.wary, field=a.field,
        )  # fmt: skip

    def _optimised(self, z: Floats, p: Problem, a: Around, *, passes: int, iterations: int) -> Band:
        w, s = self._work, self.settings
        n = min(len(z), s.capacity)
        w.z[0, :n] = z[:n]
        w.z[0, n - 1] = z[-1]
        n, _, used = optimise(n, p, w, passes, iterations, 2e-4)
        out = w.z[0, :n].copy()
        hit = clash_ahead(out, self._body, a, s.spare)
        tight = max(1.0 - max(hit.room, 0.0) / s.gap, 0.0)
        return Band(out, hit, float(out[-1, 3]) + s.dear * tight + (1e3 if not hit.free else 0.0), used)

    def _others(self, now: Situation, p: Problem, a: Around, current: Band | None, *, again: bool) -> list[Band]:
        """Bands of other classes than the current one, each from the polyline that shows the way; `again`: its, too."""
        s = self.settings
        marks = obstacles_near(now.path, a.discs, now.surroundings.field, self.limits.forward)
        seen = [] if current is None else [signature(current.z, marks)]
        lines = ways(now.path, marks, self.footprint.inscribed + s.spare, 0.5 * s.gap, s.ways) or [now.path]
        out = list[Band]()
        for line in lines:
            mark = signature(line, marks)
            if any(same(mark, other) for other in seen):
                continue
            start = along(line, now, self.limits, self._dt, s.capacity)
            fresh = self._optimised(start, p, a, passes=3, iterations=25)
            out.append(replace(fresh, other=current is not None))
            seen.append(mark)
        if current is not None and (again or not (out or current.clash.free)):  # the same way, from scratch
            line = next((x for x in lines if same(signature(x, marks), seen[0])), lines[0])
            start = along(line, now, self.limits, self._dt, s.capacity)
            out.append(self._optimised(start, p, a, passes=3, iterations=25))
        return out

    def _stalled(self, current: Band, now: Situation, last: LocalPlan) -> bool:
        """Whether a robot that hardly moves puts its start off: less than half of the time that passed was gained."""
        moves = (
            np.hypot(now.twist[0], now.twist[1]) > SLOW * self.limits.forward
            or abs(now.twist[2]) > SLOW * self.limits.turn
        )
        return not moves and float(current.z[-1, 3]) > last.duration - 0.5 * (now.time - last.time)

    def _chosen(self, bands: list[Band], current: Band | None) -> Band:
        """The least value; another class than the current one only if it is clearly better."""
        seconds, share = self.settings.keep
        stay = current is not None and current.clash.free
        return min(bands, key=lambda b: (b.value + seconds) / (1.0 - share) if b.other and stay else b.value)

    def _command(self, z: Floats, now: Situation) -> Floats:
        """The twist one period ahead, between the twist now and those in the middle of the steps; within limits."""
        (t0, a), (t1, b) = _mean_twist(z[0], z[1]), _mean_twist(z[1], z[2])
        period = self.settings.period
        if period <= t0:
            want = now.twist + (a - now.twist) * (period / t0)
        else:
            want = a + (b - a) * min((period - t0) / (t0 + t1), 1.0)
        want = saturated(want, self.limits)
        return saturated(smoothed(want, now.twist, self.limits, self.settings.period), self.limits)


def _mean_twist(a: Floats, b: Floats) -> tuple[float, Floats]:
    """Half the time between two knots, and the constant twist (3,) that leads from one to the other."""
    (x0, y0, h0, t0), (x1, y1, h1, t1) = a.tolist(), b.tolist()
    turned = wrap(h1 - h0)
    c, s = cos(h0 + 0.5 * turned), sin(h0 + 0.5 * turned)
    longer = 0.5 * turned / sin(0.5 * turned) if abs(turned) > 1e-6 else 1.0  # arc to chord
    dx, dy, f = x1 - x0, y1 - y0, 1.0 / (t1 - t0)
    twist = np.array([(c * dx + s * dy) * longer * f, (c * dy - s * dx) * longer * f, turned * f])
    return 0.5 * (t1 - t0), twist


def _conflict(b: Band) -> Conflict:
    hit = b.clash
    knot = min(hit.knot + 1, len(b.z) - 1)
    share = (hit.time - b.z[hit.knot, 3]) / max(b.z[knot, 3] - b.z[hit.knot, 3], 1e-9)
    pose = b.z[hit.knot, :3] + min(share, 1.0) * (b.z[knot, :3] - b.z[hit.knot, :3])
    pose[2] = b.z[hit.knot, 2]
    return Conflict(hit.knot, pose, hit.time, hit.obstacle, np.array([hit.x, hit.y]))
