"""Who is followed: it flies its legs, and tells others its fixes and the time. An agent of a vehicle or a carried body.

A carried one flies exactly where it should, which `Legs.path` works out beforehand; it only talks.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import exp, hypot, inf
from typing import Final, final

import numpy as np

from outrider.core.angles import wrap
from outrider.data import Datum, Kind, Stream
from outrider.data.agents import Action, Message
from outrider.errors import ConfigError
from outrider.filters.channels import site_position
from outrider.team.follow import TURN
from outrider.team.navigator import Navigator
from outrider.team.tour import GROUNDED
from outrider.typing import Floats

FIX: Final = "fix"
ASK_TIME: Final = "ask time"
TELL_TIME: Final = "tell time"
UNSTATED: Final = 1.0  # m, of a fix that claims nothing
SLOWS: Final = 0.8  # 1/s: m/s by which it may be faster for every metre to where it must be slow
Window = tuple[float, float]  # s since the start


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class TargetFix:
    """A satellite fix of the one that is followed. t : ns, on its clock;  p : (3,) m, site frame, and its standard
    deviations sigma (3,);  v : (3,) m/s or NaN where it tells none, and v_sigma (3,)."""

    t: int
    p: Floats
    sigma: Floats
    v: Floats = field(default_factory=lambda: np.full(3, np.nan))
    v_sigma: Floats = field(default_factory=lambda: np.full(3, np.inf))

    def message(self, sender: str, now: int) -> Message:
        """To everybody, sent at `now` [ns]."""
        data = {"stamp": stamp(self.t), "p": self.p, "sigma": self.sigma, "v": self.v, "v_sigma": self.v_sigma}
        return Message(sender=sender, topic=FIX, t=now, data=data)

    @classmethod
    def of(cls, m: Message) -> "TargetFix":
        """From a message of that topic."""
        told = {name: m.data[name] for name in ("p", "sigma", "v", "v_sigma")}
        return cls(t=stamped(m.data["stamp"]), **told)


def stamp(t: int) -> Floats:
    """Whole seconds and nanoseconds of a stamp [ns], which floats hold."""
    return np.array([t // 10**9, t % 10**9], np.float64)


def stamped(x: Floats) -> int:
    """The stamp [ns] of `stamp`."""
    return int(x[0]) * 10**9 + int(x[1])


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Way:
    """How far it is: the waypoint that is next, and until when [s] it waits."""

    next: int = 0
    until_s: float = -inf


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Legs:
    """Straight legs through waypoints (m, 3) m at speeds (m,) m/s, waiting (m,) s at each; the last one is the end.

    stops_s : spells in which it stops dead, wherever it is;  corner : share of its speed with which it passes a
    waypoint;  reach : m, how near counts as there.  Raises ConfigError for shapes and numbers that cannot be.
    """

    waypoints: Floats
    speeds: Floats
    waits_s: Floats
    stops_s: tuple[Window, ...] = ()
    corner: float = 0.5
    reach: float = 0.5

    def __post_init__(self) -> None:
        n = len(self.waypoints)
        if not n or self.waypoints.shape != (n, 3) or not np.isfinite(self.waypoints).all():
            raise ConfigError(f"waypoints {self.waypoints.shape}", where="legs", fix="rows of east, north, up [m]")
        if self.speeds.shape != (n,) or not (self.speeds > 0).all():
            raise ConfigError(f"{self.speeds.size} speeds for {n} waypoints", where="legs", fix="one above 0 for each")
        if self.waits_s.shape != (n,) or not (self.waits_s >= 0).all():
            raise ConfigError(
                f"{self.waits_s.size} waits for {n} waypoints", where="legs", fix="one, 0 s or more, each"
            )

    def go(self, way: Way, p: Floats, t_s: float) -> tuple[Way, Floats]:
        """How far it is then, and the velocity (3,) to fly at p (3,) m."""
        still, m = np.zeros(3), len(self.waypoints)
        if way.next >= m or t_s < way.until_s or any(a <= t_s < b for a, b in self.stops_s):
            return way, still
        k, gap = way.next, self.waypoints[way.next] - p
        distance = float(np.linalg.norm(gap))
        halts = k == m - 1 or self.waits_s[k] > 0.0
        if distance <= (0.05 if halts else self.reach):
            return Way(next=k + 1, until_s=t_s + float(self.waits_s[k])), still if halts else self._velocity(k + 1, p)
        return way, self._velocity(k, p)

    def _velocity(self, k: int, p: Floats) -> Floats:
        gap = self.waypoints[k] - p
        distance = float(np.linalg.norm(gap))
        halts = k == len(self.waypoints) - 1 or self.waits_s[k] > 0.0
        slow = 0.0 if halts else self.corner * float(self.speeds[k])
        return gap * (min(float(self.speeds[k]), slow + SLOWS * distance) / max(distance, 1e-9))

    def path(self, start: Floats, duration_s: float, every_s: float, tau_s: float, hard: float) -> Floats:
        """(n, 3) m every `every_s` s from rest at `start`, as a lag of tau_s [s] flies it, accelerating by `hard`
        [m/s^2] at most."""
        steps = max(round(every_s / 0.01), 1)
        h = every_s / steps
        p, v, way = start.copy(), np.zeros(3), Way()
        out = [p.copy()]
        for k in range(round(duration_s / every_s) * steps):
            way, u = self.go(way, p, k * h)
            a = (u - v) * (1.0 - exp(-h / tau_s)) / h
            a *= min(1.0, hard / max(float(np.linalg.norm(a)), 1e-9))
            p, v = p + v * h + 0.5 * a * h * h, v + a * h
            if (k + 1) % steps == 0:
                out.append(p.copy())
        return np.array(out)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Spoof:
    """Fixes of a spell are told `by` (3,) m off."""

    spell_s: Window
    by: tuple[float, float, float]


@final
@dataclass(slots=True, kw_only=True)
class Leader:
    """An `Agent`. tells : the stream of its receiver, of which it tells every fix, with the velocity
    of the same moment in `tells_velocity`, if there is one;  start : ns;  navigator : on which
    it flies, None for a body that is carried;  silent_s : spells in which it tells nothing;  spoofs : what is wrong
    with what it tells;  clock_s : by which its clock is ahead;  turn : rad/s at most."""

    name: str
    legs: Legs
    datum: Datum
    start: int
    tells: str = "gnss"
    tells_velocity: str = "gnss_velocity"
    navigator: Navigator | None = None
    silent_s: tuple[Window, ...] = ()
    spoofs: tuple[Spoof, ...] = ()
    clock_s: float = 0.0
    turn: float = 1.0
    period_s: float = 0.1
    way: Way = field(default_factory=Way)

    def act(self, t: int, records: Sequence[Stream], inbox: Sequence[Message]) -> Action:
        """Tell what is new, answer, fly on."""
        silent = any(a <= (t - self.start) * 1e-9 < b for a, b in self.silent_s)
        said = () if silent else (*self._fixes(t, records), *self._times(t, inbox))
        if self.navigator is None:
            return Action(messages=said)
        self.navigator.take(records)
        here = self.navigator.now(t)
        before = self.way.next
        self.way, v = self.legs.go(self.way, here.p, (t - self.start) * 1e-9)
        off = wrap(float(np.arctan2(v[1], v[0])) - here.heading) if hypot(v[0], v[1]) > 0.1 else 0.0
        command = np.array([*v, float(np.clip(TURN * off, -self.turn, self.turn))])
        note = f"waypoint {self.way.next} of {len(self.legs.waypoints)} reached" if self.way.next > before else ""
        return Action(command=command, messages=said, records=(self.navigator.record(here),), note=note)

    @property
    def landing(self) -> bool:
        """Whether it flies down to the ground: to a waypoint on it."""
        heights = self.legs.waypoints[:, 2]
        if self.navigator is not None:
            heights = heights[[min(self.way.next, len(heights) - 1)]]
        return bool((heights <= GROUNDED).any())

    def _fixes(self, t: int, records: Sequence[Stream]) -> list[Message]:
        out: list[Message] = []
        for s in records:
            if s.name != self.tells or s.kind is not Kind.GNSS:
                continue
            p, sigma = site_position(s, self.datum), np.sqrt(np.where(np.isfinite(s.var), s.var, UNSTATED**2))
            for k in np.flatnonzero(np.isfinite(p).all(axis=1)).tolist():
                since = (int(s.t[k]) - self.start) * 1e-9
                by = sum((np.array(x.by) for x in self.spoofs if x.spell_s[0] <= since < x.spell_s[1]), np.zeros(3))
                v, v_sigma = self._velocity(int(s.t[k]), records)
                fix = TargetFix(t=int(s.t[k]) + self._ahead, p=p[k] + by, sigma=sigma[k], v=v, v_sigma=v_sigma)
                out.append(fix.message(self.name, t))
        return out

    def _velocity(self, t: int, records: Sequence[Stream]) -> tuple[Floats, Floats]:
        """That of the moment t [ns], and its standard deviations; NaN without."""
        for s in records:
            rows = np.flatnonzero(s.t == t) if s.name == self.tells_velocity and s.kind is Kind.GNSS_VELOCITY else ()
            for k in rows:
                return s.z[k].copy(), np.sqrt(np.where(np.isfinite(s.var[k]), s.var[k], UNSTATED**2))
        return np.full(3, np.nan), np.full(3, np.inf)

    def _times(self, t: int, inbox: Sequence[Message]) -> list[Message]:
        """What its clock says, to everybody who asks."""
        return [
            Message(sender=self.name, receiver=m.sender, topic=TELL_TIME, t=t,
                    data={"asked": m.data["asked"], "clock": stamp(t + self._ahead)})
            for m in inbox if m.topic == ASK_TIME and m.receiver == self.name
        ]  # fmt: skip

    @property
    def _ahead(self) -> int:
        return round(self.clock_s * 1e9)
