"""One follower or target online: commands and fixes in any order, each where it belongs in time.

A fix of a receiver is old when it arrives. It is applied at the moment it was taken, and everything that was known
since is replayed on top, so that a late fix gives the very numbers that it would have given in time.
"""

from bisect import bisect_right
from dataclasses import dataclass
from enum import Enum
from math import hypot, inf, isfinite, sqrt
from typing import Final, NamedTuple, final

import numpy as np

from outrider.errors import ConfigError, UsageError
from outrider.filters.following.steps import predict, update, update_course
from outrider.models.motion.following import GAIN, STEP, FollowerModel, lag_step
from outrider.typing import Floats

CHI2_3: Final = 16.266  # 99.9 % of a chi-square of three degrees of freedom
CHI2_1: Final = 10.828
SHORT: Final = 0.1  # s, of a step in which the vehicle's limits act
TINY: Final = 1e-9


class Outcome(Enum):
    """What became of a record; each is a sentence that says what to look at."""

    USED = "used"
    STARTED = "the first fix: the filter starts there"
    GATED = "does not fit the prediction: ignored; if several in a row agree with one another, the filter goes there"
    TOO_FAR = (
        "agrees with those before, and lies farther away than can have been flown since the last one that was believed"
    )
    REACQUIRED = "fixes in a row agreed with one another and not with the prediction: the filter started anew there"
    WAITING = "there has been no fix yet: kept for later"
    SLOW = "too slow for a direction of flight to say anything"
    NOT_FINITE = "not a number, or a variance that is not positive: look at the receiver's driver"
    FUTURE = "stamped later than now: the clocks differ, set both aircraft by one source"
    TOO_OLD = "older than the history: shorten the link's delay, look for a clock that is late, or raise history_s"
    REPEATED = "the same stamp as before: the receiver repeats its last fix, as many do without signal"

    @property
    def good(self) -> bool:
        """Whether the record, or what it stands for, is in the estimate."""
        return self in (Outcome.USED, Outcome.STARTED, Outcome.REACQUIRED)


class Fused(NamedTuple):
    """What became of a record, and its NIS (NaN if it was not compared with a prediction)."""

    outcome: Outcome
    nis: float


@final
@dataclass(frozen=True, slots=True)
class Belief:
    """At t [s]: position p (3,), velocity over ground v (3,), wind w (3,), zero without a state for it; covariance P
    (n, n) in that order, n = 6 or 9. World ENU, metres. `fix_t` is when the last fix that counts was taken."""

    t: float
    p: Floats
    v: Floats
    w: Floats
    P: Floats
    fix_t: float

    @property
    def x(self) -> Floats:
        """(n,) the whole state."""
        return np.concatenate([self.p, self.v, self.w])[: self.P.shape[0]]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Following:
    """How to estimate. Raises ConfigError for impossible numbers.

    velocity, wind : standard deviations at the start [m/s]; wind 0 leaves that state out (6 states instead of 9)
    gate : of three components [NIS], scaled for one;  reacquire : how many fixes in a row may not fit, if they agree
    history_s : how old a record may be;  ahead_s : how far a stamp may lie in the future
    command_delay_s : from `add_command` to its effect
    fastest : m/s, over ground: no fix is believed, however many agree, where nobody flies since the last one that was
    hardest, hardest_up : m/s^2, to which the vehicle limits its answer, in the plane and upwards
    """

    velocity: float = 2.0
    wind: float = 0.0
    gate: float = CHI2_3
    reacquire: int = 3
    history_s: float = 5.0
    ahead_s: float = 0.05
    command_delay_s: float = 0.0
    slowest: float = 0.5  # m/s, below which there is no direction of flight
    fastest: float = inf
    hardest: float = inf
    hardest_up: float = inf

    def __post_init__(self) -> None:
        for name in ("velocity", "gate", "history_s"):
            if not 0.0 < getattr(self, name) < inf:
                raise ConfigError(f"{name} = {getattr(self, name)} of a follower's filter", fix="give it above zero")
        for name in ("wind", "ahead_s", "command_delay_s", "slowest"):
            if not 0.0 <= getattr(self, name) < inf:
                raise ConfigError(f"{name} = {getattr(self, name)} of a follower's filter", fix="zero or more")
        for name in ("fastest", "hardest", "hardest_up"):
            if not getattr(self, name) > 0.0:
                raise ConfigError(f"{name} = {getattr(self, name)} of a follower's filter", fix="give it above zero")
        if self.reacquire < 2:
            raise ConfigError(f"reacquire = {self.reacquire} would follow any jump", fix="2 or more")


class _Event(NamedTuple):
    """A position (at 0), a velocity (3), a heading (7), a course (8) or a command (9, z the velocity).

    Of one moment they act in this order, whichever came first."""

    t: float
    at: int
    z: Floats
    r: Floats


class _State(NamedTuple):
    """All that the filter knows after an event; `missed` fixes in a row were off by about `offset`; the last one that
    counts was taken at fix_t, when it was at fix_p."""

    t: float
    x: Floats
    P: Floats
    u: Floats
    missed: int
    offset: Floats
    fix_t: float
    fix_p: Floats


_POSITION, _VELOCITY, _HEADING, _COURSE, _COMMAND = 0, 3, 7, 8, 9


@final
class FollowerFilter:
    """Estimates one aircraft; times in seconds of one clock, positions (3,) in the world ENU.

        f = FollowerFilter(FollowerModel(lag=0.5), Following(wind=0.5))
        f.add_command(t, u)                  # velocity (3,) commanded from t on
        f.add_fix(t_taken, z, r, now=t)      # variances r (3,), inf for what was not measured
        b = f.belief(t)                      # b.p, b.v, b.w, b.P

    Without commands (a target, `FollowerModel.target()`) leave `add_command` out. Every `add_` says what became of the
    record; none raises for bad data. A record may be up to `history_s` old.
    """

    def __init__(self, model: FollowerModel, settings: Following | None = None) -> None:
        self.model, self.settings = model, settings or Following()
        self._theta, self._step, self._dt = model.theta(), np.zeros((3, STEP)), -1.0
        self._scratch = np.zeros(9)
        self._events: list[_Event] = []
        self._states: list[_State] = []  # after each event; one more in front, from which the history starts
        self._early: list[_Event] = []  # commands before the first fix

    @property
    def started(self) -> bool:
        """Whether there has been a fix."""
        return bool(self._states)

    def add_command(self, t: float, u: Floats) -> Fused:
        """The velocity (3,) commanded from t on."""
        event = _Event(t + self.settings.command_delay_s, _COMMAND, np.array(u, float), np.zeros(3))
        if not (isfinite(t) and np.isfinite(event.z).all()):
            return Fused(Outcome.NOT_FINITE, np.nan)
        if self.started:
            return self._insert(event)
        self._early = [e for e in self._early if e.t > t - self.settings.history_s] + [event]
        return Fused(Outcome.WAITING, np.nan)

    def add_fix(self, t: float, z: Floats, r: Floats, *, now: float | None = None) -> Fused:
        """A position z (3,), variances r (3,), taken at t; a height alone has r = (inf, inf, s^2).

        now : by the same clock, to notice stamps from the future.
        """
        bad = self._refused(t, z, r, now)
        if bad is not None:
            return Fused(bad, np.nan)
        event = _Event(t, _POSITION, np.where(np.isfinite(r), z, 0.0), np.array(r, float))
        if self.started:
            return self._insert(event)
        if not np.isfinite(event.r).all():
            return Fused(Outcome.WAITING, np.nan)
        self._states = [self._first(event, np.zeros(3))]
        for command in sorted(self._early, key=lambda e: e.t):
            self._insert(command._replace(t=max(command.t, t)))
        self._early = []
        return Fused(Outcome.STARTED, np.nan)

    def add_velocity(self, t: float, z: Floats, r: Floats, *, now: float | None = None) -> Fused:
        """A velocity over ground z (3,) [m/s], variances r (3,), taken at t."""
        bad = self._refused(t, z, r, now)
        if bad is None and not self.started:
            bad = Outcome.WAITING
        if bad is not None:
            return Fused(bad, np.nan)
        return self._insert(_Event(t, _VELOCITY, np.where(np.isfinite(r), z, 0.0), np.array(r, float)))

    def add_course(self, t: float, angle: float, r: float, *, heading: bool = False, now: float | None = None) -> Fused:
        """A direction of flight [rad, from east to north] of variance r [rad^2] over ground, as a receiver tells it.

        heading : it is where the nose points (a magnetometer, declination taken off) of a craft that points where it
        flies through the air. Of a craft that turns its nose at will, do not pass it at all.
        """
        z, variance = np.full(3, angle, float), np.full(3, r, float)
        bad = self._refused(t, z, variance, now)
        if bad is None and not self.started:
            bad = Outcome.WAITING
        if bad is not None:
            return Fused(bad, np.nan)
        return self._insert(_Event(t, _HEADING if heading else _COURSE, z, variance))

    def belief(self, t: float) -> Belief:
        """The estimate at t, now or in the history or predicted; raises UsageError before it."""
        if not self.started:
            raise UsageError("there is no estimate before the first fix", fix="ask `started` first")
        if not isfinite(t) or t < self._states[0].t:
            raise UsageError(f"no estimate of {t} s, before the history", fix="raise history_s, or ask for later")
        k = bisect_right(self._states, t, key=lambda s: s.t) - 1
        s = self._moved(self._states[k], t)
        w = s.x[6:9].copy() if s.x.size == 9 else np.zeros(3)
        return Belief(t, s.x[:3].copy(), s.x[3:6].copy(), w, s.P, s.fix_t)

    def reachable(self, t: float, z: Floats, r: Floats) -> bool:
        """Whether anybody can have flown to a fix z (3,), variances r (3,), taken at t, since the last one before it
        that was believed; before the first fix: anywhere."""
        k = bisect_right(self._states, t, key=lambda s: s.t) - 1
        return k < 0 or not self._beyond(self._states[k], _Event(t, _POSITION, z, r))

    def _refused(self, t: float, z: Floats, r: Floats, now: float | None) -> Outcome | None:
        r = np.asarray(r, float)
        seen = np.isfinite(r)
        if np.shape(z) != (3,) or r.shape != (3,):
            raise UsageError(f"a record of shapes {np.shape(z)} and {r.shape}", fix="z (3,) and variances r (3,)")
        if not (isfinite(t) and seen.any() and np.isfinite(np.asarray(z)[seen]).all() and (r > 0.0).all()):
            return Outcome.NOT_FINITE
        if now is not None and t > now + self.settings.ahead_s:
            return Outcome.FUTURE
        return None

    def _first(self, fix: _Event, u: Floats) -> _State:
        s = self.settings
        n = 9 if s.wind > 0.0 else 6
        x, P = np.zeros(n), np.zeros((n, n))
        x[:3] = fix.z
        P[np.diag_indices(n)] = np.concatenate([fix.r, np.full(3, s.velocity**2), np.full(3, s.wind**2)])[:n]
        if n == 9:
            P[8, 8] = s.wind**2 if self.model.wind_z > 0.0 else 0.0
        return _State(fix.t, x, P, u, 0, np.zeros(3), fix.t, fix.z)

    def _insert(self, event: _Event) -> Fused:
        """Put an event where it belongs and redo what follows it."""
        if event.t < self._states[0].t:
            return Fused(Outcome.TOO_OLD, np.nan)
        k = bisect_right(self._events, (event.t, event.at), key=lambda e: (e.t, e.at))
        same = (e for e in reversed(self._events[:k]) if e.t == event.t and e.at == event.at)
        level = bool(np.isfinite(event.r[0]))
        first = level and event.t == self._states[0].fix_t
        if event.at == _POSITION and (first or any(np.isfinite(e.r[0]) == level for e in same)):
            return Fused(Outcome.REPEATED, np.nan)
        self._events.insert(k, event)
        del self._states[k + 1 :]
        after, fused = self._apply(self._states[-1], event)
        self._states.append(after)
        for later in self._events[k + 1 :]:
            self._states.append(self._apply(self._states[-1], later)[0])
        oldest = self._events[-1].t - self.settings.history_s
        drop = bisect_right(self._events, oldest, key=lambda e: e.t)
        del self._events[:drop], self._states[:drop]
        return fused

    def _moved(self, s: _State, t: float) -> _State:
        """The state at t, under the command in force; in short steps while the vehicle cannot answer it as asked."""
        x, P, now = s.x.copy(), s.P.copy(), s.t
        while t > now:
            dt = t - now
            if dt > SHORT and not self._answers(x, s.u):
                dt = SHORT
            self._stepped(x, P, s.u, dt)
            now = t if dt == t - now else now + dt
        return s._replace(t=max(t, s.t), x=x, P=P)

    def _answers(self, x: Floats, u: Floats) -> bool:
        """Whether a command asks for no more acceleration than the vehicle has."""
        s, m = self.settings, self.model
        flat = hypot(u[0] - x[3], u[1] - x[4]) <= s.hardest * m.lag
        return flat and abs(u[2] - x[5]) <= s.hardest_up * m.lag_z

    def _stepped(self, x: Floats, P: Floats, u: Floats, dt: float) -> None:
        """One step. A command that asks for too much is the one by which the velocity changes as fast as it can."""
        if dt != self._dt:
            self._dt = dt
            lag_step(dt, self._theta, self._step)
        if not self._answers(x, u):
            s, c = self.settings, self._step
            gap = u - x[3:6]
            level = gap * np.array([c[0, GAIN], c[1, GAIN], c[2, GAIN]]) / dt  # m/s^2, in the mean over the step
            gap[:2] *= min(1.0, s.hardest / max(hypot(level[0], level[1]), TINY))
            gap[2] *= min(1.0, s.hardest_up / max(abs(level[2]), TINY))
            u = x[3:6] + gap
        predict(x, P, u, self._step)

    def _apply(self, s: _State, event: _Event) -> tuple[_State, Fused]:
        """The state after an event."""
        s = self._moved(s, event.t)
        if event.at == _COMMAND:
            return s._replace(u=event.z), Fused(Outcome.USED, np.nan)
        gate = self.settings.gate
        if event.at in (_HEADING, _COURSE):
            heading, slowest = event.at == _HEADING, self.settings.slowest
            gate *= CHI2_1 / CHI2_3
            nis, _ = update_course(s.x, s.P, event.z[0], event.r[0], heading, slowest, gate, self._scratch)
            outcome = Outcome.SLOW if np.isnan(nis) else Outcome.USED if nis <= gate else Outcome.GATED
            return s, Fused(outcome, nis)
        offset = event.z - s.x[event.at : event.at + 3]
        whole = event.at == _POSITION and bool(np.isfinite(event.r).all())
        if whole and self._beyond(s, event):
            gate = -1.0
        nis, _ = update(s.x, s.P, event.at, event.z, event.r, gate)
        if nis <= gate:
            kept = s._replace(missed=0, fix_t=event.t, fix_p=s.x[:3].copy()) if whole else s
            return kept, Fused(Outcome.USED, nis)
        if not whole:
            return s, Fused(Outcome.GATED, nis)
        return self._missed(s, event, offset, nis)

    def _missed(self, s: _State, fix: _Event, offset: Floats, nis: float) -> tuple[_State, Fused]:
        """A fix that does not fit: one more of a row that agree, the first of another row, or enough of them."""
        spread = 2.0 * fix.r + np.diag(s.P)[:3]
        agrees = s.missed > 0 and float(((offset - s.offset) ** 2 / spread).sum()) <= self.settings.gate
        missed = s.missed + 1 if agrees else 1
        if missed < self.settings.reacquire:
            return s._replace(missed=missed, offset=offset), Fused(Outcome.GATED, nis)
        if self._beyond(s, fix):
            return s._replace(missed=missed, offset=offset), Fused(Outcome.TOO_FAR, nis)
        return self._first(fix, s.u), Fused(Outcome.REACQUIRED, nis)

    def _beyond(self, s: _State, fix: _Event) -> bool:
        """Whether a fix lies where nobody can have flown since the last one that was believed."""
        reach = self.settings.fastest * (fix.t - s.fix_t) + sqrt(2.0 * self.settings.gate * float(fix.r.max()))
        return float(np.linalg.norm(fix.z - s.fix_p)) > reach
