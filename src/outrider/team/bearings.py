"""What a follower knows: where it is, where its target is, how late the target's fixes come, what its clock says."""

from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import copysign, inf, nan, sqrt
from typing import Final, NamedTuple, final

import numpy as np

from outrider.data import Datum, Kind, Stream
from outrider.data.agents import Message
from outrider.errors import UsageError
from outrider.filters.channels import site_position
from outrider.filters.following import Belief, FollowerFilter, Outcome
from outrider.team.leader import ASK_TIME, FIX, TELL_TIME, TargetFix, stamp, stamped
from outrider.team.search import GROWS_S
from outrider.typing import Floats

LATE: Final = 4.5  # s: a target's fix older than that is carried on by its filter
FIXES: Final = 20  # that are remembered
PAIRED_S: Final = 0.05  # s between fixes of one moment
LATEST: Final = 9  # fixes of which the delay is told
ASKED_S: Final = 1.0  # s between two questions for the time
ANSWERS: Final = 8  # of which the quickest counts


class Known(NamedTuple):
    """Position and velocity (3,), covariance (6, 6), and how long ago [s] that was."""

    p: Floats
    v: Floats
    P: Floats
    age: float = 0.0

    @property
    def x(self) -> Floats:
        """(6,)."""
        return np.concatenate([self.p, self.v])

    @property
    def now(self) -> Floats:
        """(3,) m, carried on."""
        return self.p + self.v * self.age


@final
@dataclass(slots=True, kw_only=True)
class Clocks:
    """By how much another clock is ahead, from questions and answers: sure but for half of the quickest one."""

    asked_s: float = -inf
    _answers: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=ANSWERS))

    def ask(self, t: int, sender: str, receiver: str) -> tuple[Message, ...]:
        """A question, if it is time for one."""
        if t * 1e-9 - self.asked_s < ASKED_S:
            return ()
        self.asked_s = t * 1e-9
        return (Message(sender=sender, receiver=receiver, topic=ASK_TIME, t=t, data={"asked": stamp(t)}),)

    def hear(self, m: Message, t: int) -> None:
        """An answer, heard at t [ns]."""
        asked, clock = stamped(m.data["asked"]), stamped(m.data["clock"])
        self._answers.append(((t - asked) * 1e-9, (clock - (asked + t) / 2) * 1e-9))

    @property
    def ahead_s(self) -> float:
        """At least that much [s] the other is ahead; NaN before the first answer."""
        if not self._answers:
            return nan
        trip, off = min(self._answers)
        return copysign(max(abs(off) - 0.5 * trip, 0.0), off)


@final
@dataclass(slots=True, kw_only=True)
class Bearings:
    """`take` records, `hear` messages; then `here` and `there`.

    own, target : their filters;  start : ns, of the seconds of both;  raw : guidance sees the newest pair of fixes of
    one moment alone, as in swarm2023, while the filters only watch;  heading : stream of the nose's direction, "": none
    """

    leader: str
    own: FollowerFilter
    target: FollowerFilter
    datum: Datum
    start: int
    gnss: str = "gnss"
    velocity: str = "gnss_velocity"
    heading: str = ""
    raw: bool = False
    clocks: Clocks = field(default_factory=Clocks)
    outcomes: Counter[tuple[str, Outcome]] = field(default_factory=lambda: Counter[tuple[str, Outcome]]())
    jumps: int = 0
    fix_s: float = -inf
    _fixes: deque[tuple[float, Floats]] = field(default_factory=lambda: deque(maxlen=FIXES))
    _there: deque[tuple[float, Floats]] = field(default_factory=lambda: deque(maxlen=FIXES))
    _last: tuple[Belief, Belief] | None = None
    _doubt: tuple[float, Known] | None = None
    _delays: deque[float] = field(default_factory=lambda: deque(maxlen=LATEST))

    def seconds(self, t: int) -> float:
        """Since the start."""
        return (t - self.start) * 1e-9

    def take(self, t: int, records: Sequence[Stream]) -> None:
        """One's own fixes and headings that came by t [ns]."""
        now = self.seconds(t)
        for s in records:
            if s.name == self.gnss and s.kind is Kind.GNSS:
                p, var = site_position(s, self.datum), np.where(np.isfinite(s.var), s.var, 1.0)
                for k in range(len(s)):
                    out = self.own.add_fix(self.seconds(int(s.t[k])), p[k], var[k], now=now).outcome
                    self._count("own", out)
                    if out.good:
                        self.fix_s = max(self.fix_s, self.seconds(int(s.t[k])))
                    if np.isfinite(p[k]).all():
                        self._fixes.append((self.seconds(int(s.t[k])), p[k]))
            elif s.name == self.velocity and s.kind is Kind.GNSS_VELOCITY:
                for k in range(len(s)):
                    var = np.where(np.isfinite(s.var[k]), s.var[k], 1.0)
                    self._count("velocity", self.own.add_velocity(self.seconds(int(s.t[k])), s.z[k], var, now=now)[0])
            elif s.name == self.heading and s.kind is Kind.HEADING:
                for k in range(len(s)):
                    angle, var = float(s.z[k, 0]), float(s.var[k, 0])
                    self._count("heading", self.own.add_course(self.seconds(int(s.t[k])), angle, var, heading=True)[0])

    def hear(self, t: int, inbox: Sequence[Message]) -> list[Outcome]:
        """What the target says, heard at t [ns]: what became of its fixes."""
        out: list[Outcome] = []
        for m in inbox:
            if m.sender != self.leader:
                continue
            if m.topic == TELL_TIME:
                self.clocks.hear(m, t)
            if m.topic == FIX:
                out.append(self._target(TargetFix.of(m), t))
        return out

    def _target(self, fix: TargetFix, t: int) -> Outcome:
        taken, now = self.seconds(fix.t), self.seconds(t)
        out = self.target.add_fix(taken, fix.p, fix.sigma**2, now=now).outcome
        self._count("target", out)
        turned = False
        if out.good and np.isfinite(fix.v).all():
            how = self.target.add_velocity(taken, fix.v, fix.v_sigma**2, now=now).outcome
            self._count("target velocity", how)
            turned = how is Outcome.GATED
        if out.good or out is Outcome.GATED:
            self._doubt = self._doubted(fix, taken) if turned or not out.good else None
        self.jumps = 0 if out.good else self.jumps + (out in (Outcome.GATED, Outcome.TOO_FAR))
        if out.good:
            self._delays.append(now - taken)
            self._last = self.target.belief(taken), self.target.belief(taken + GROWS_S)
        self._there.append((taken, fix.p))
        return out

    def _doubted(self, fix: TargetFix, taken: float) -> tuple[float, Known] | None:
        """A fix or velocity that did not fit, as it was told; None where nobody can have flown to. Of a fix without a
        velocity it is the mean one since the last fix that was believed."""
        if not self.target.reachable(taken, fix.p, fix.sigma**2):
            return None
        v, v_var = fix.v, fix.v_sigma**2
        if not np.isfinite(v).all():
            last = self.last[0]
            since = max(taken - last.t, PAIRED_S)
            v, v_var = (fix.p - last.p) / since, (fix.sigma**2 + np.diag(last.P)[:3]) / since**2
        return taken, Known(fix.p, v, np.diag(np.concatenate([fix.sigma**2, v_var])))

    def doubt(self, t: int) -> Known | None:
        """Where the target was by its newest fix, if that did not fit and may be true all the same: it is not followed,
        but avoided. None once a fix fits again, and `LATE` after."""
        if self._doubt is None or self.seconds(t) - self._doubt[0] > LATE:
            return None
        taken, known = self._doubt
        return known._replace(age=max(self.seconds(t) - taken, 0.0))

    @property
    def last(self) -> tuple[Belief, Belief]:
        """The target at its newest fix that was believed, and what that is worth `GROWS_S` later; after the first."""
        if self._last is None:
            raise UsageError("nothing has been heard of the target", fix="ask `heard_s` first")
        return self._last

    @property
    def delay_s(self) -> float:
        """How old the target's fixes are when they come; the median of the latest, NaN before the first."""
        return float(np.median(self._delays)) if self._delays else nan

    def here(self, t: int, ahead_s: float = 0.0) -> Known | None:
        """Where it is `ahead_s` after t [ns]; None before the first fix."""
        if self.raw:
            pair = self._pair()
            return None if pair is None else pair[0]
        return _known(self.own.belief(self.seconds(t) + ahead_s)) if self.own.started else None

    def wind(self, t: int) -> Floats:
        """(3,) m/s by which it flies otherwise than it is told, as its filter has learnt; zero without such a state."""
        b = self.believed(t)
        return np.zeros(3) if b is None else b.w

    def believed(self, t: int) -> Belief | None:
        """What its own filter says, whether or not guidance listens."""
        return self.own.belief(self.seconds(t)) if self.own.started else None

    def there(self, t: int) -> Known | None:
        """Where the target was at its newest fix, and how long ago; None before the first."""
        if self.raw:
            pair = self._pair()
            return None if pair is None else pair[1]
        if not self.target.started:
            return None
        now = self.seconds(t)
        fix_t = self.target.belief(now).fix_t
        at = min(max(fix_t, now - LATE), now)
        return _known(self.target.belief(at), now - at)

    def heard_s(self, t: int) -> float:
        """Age of the target's newest fix that was believed [s], infinite before the first."""
        return self.seconds(t) - self.target.belief(self.seconds(t)).fix_t if self.target.started else inf

    def sigma(self, t: int) -> float:
        """Standard deviation of its own place, along the worst axis [m]; infinite before the first fix."""
        b = self.believed(t)
        return inf if b is None else sqrt(float(np.diag(b.P)[:3].max()))

    def _pair(self) -> tuple[Known, Known] | None:
        """Both fixes of the newest moment of which there are both; the target's velocity is unknown."""
        for t_1, there in reversed(self._there):
            for t_0, here in reversed(self._fixes):
                if abs(t_1 - t_0) < PAIRED_S:
                    unknown = np.diag([0.0, 0.0, 0.0, inf, inf, inf])
                    return Known(here, np.zeros(3), unknown), Known(there, np.zeros(3), unknown)
        return None

    def _count(self, who: str, outcome: Outcome) -> None:
        self.outcomes[who, outcome] += 1


def _known(b: Belief, age: float = 0.0) -> Known:
    return Known(b.p, b.v, b.P[:6, :6], age)
