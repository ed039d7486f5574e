"""A drone that follows another: it knows by its filters, decides by `Rendezvous`, flies by a law, and keeps apart.

swarm2023, algorithms 1 to 3. Whatever the law wants, the safety filter below it lets through only what can still be
taken back in time.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from math import atan2, ceil, hypot, inf, nan
from typing import Final, Protocol, final

import numpy as np

from outrider.core.angles import wrap
from outrider.core.rotations import quats_exp
from outrider.data import Kind, Stream, stream
from outrider.data.agents import Action, Message
from outrider.filters.following import Outcome
from outrider.guidance.los import line_of_sight, zone_speed
from outrider.guidance.pursuit import Pursuit, pursued
from outrider.guidance.rendezvous import Rendezvous, Senses, Signal, Stage, Why, Zones, advance
from outrider.safety.admissible import EASE, Fixes, adapted, least_set_point
from outrider.safety.separation import HOLDS, Hold, Separation, kept_apart
from outrider.safety.shortfall import Lack, lacking
from outrider.team.bearings import Bearings, Known
from outrider.team.follow import TURN, within
from outrider.team.search import CredibleTrack, credible_track
from outrider.team.trail import Trail
from outrider.typing import Floats

SHY: Final = (Stage.WAIT, Stage.HOLD, Stage.HOME)
CLIMBS: Final = 0.5  # 1/s: rate of climb by what is missing of the height, of laws that are level
SAID: Final = (Outcome.REACQUIRED, Outcome.TOO_FAR, Outcome.FUTURE)
WARY: Final = "the target's fix or velocity does not fit what it flew: not followed yet, but kept clear of"
OUTRUN: Final = 0.9  # share of its speed below which a target that was too fast can be followed again


class Law(Enum):
    """How it approaches; the value is what it does."""

    LOS = "it flies at the target"
    BEZIER = "it flies along a Bezier curve through the target's trail"
    ZONE = "it flies at the target, slower the nearer it is"
    VECTOR = "it flies as the target does, and closes the distance beside"


class SetPoint(Protocol):
    """How far away to stay."""

    def distance(self, target_speed: float, delay_s: float) -> float:
        """m, from a target of that speed [m/s] known so late [s], NaN: not yet known; NaN where no distance is safe."""
        ...


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Fixed:
    """Always the same distance [m]."""

    m: float

    def distance(self, target_speed: float, delay_s: float) -> float:
        """See `SetPoint`."""
        return self.m


@final
@dataclass(slots=True, kw_only=True)
class Adaptive:
    """As near as the target's speed, the link's delay and the noise allow: farther at once, nearer by and by.

    fixes : what is known of both, and when;  wanted : m, no nearer than that;  fall : m, a period, at most
    """

    separation: Separation
    fixes: Fixes
    wanted: float = 0.0
    fall: float = 0.02
    now: float = 0.0
    _delay: float = -1.0
    _spread: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def distance(self, target_speed: float, delay_s: float) -> float:
        """See `SetPoint`."""
        delay = max(ceil(10.0 * delay_s - 1e-6) / 10.0, 0.0) if delay_s == delay_s else self.fixes.latency_s
        if delay != self._delay:
            self._delay, self._spread = delay, replace(self.fixes, latency_s=delay).spread(self.separation.lag_s)
        age, speed = 1.0 / self.fixes.rate_hz + delay, min(target_speed, 0.99 * self.separation.speed)
        least = float(least_set_point(speed, age, *self._spread, self.separation.theta()))
        if not least < inf:
            return nan
        self.now = float(adapted(self.now, max(least + EASE, self.wanted), self.fall))
        return self.now


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Style:
    """How it flies. far, near : laws outside and inside the rendezvous zone;  speed, far_speed : m/s, at most, inside
    and outside;  target_speed : m/s, that of the target where it is given instead of estimated;  gain : 1/s and brake :
    m/s^2 of the vector law;  turn : rad/s at most;  command_s : s between two commands;  latency_s : from a command to
    its effect;  climb, sink : m/s, what its vehicle can at most;  floor : m over the site's origin below which it does
    not sink, whatever backs off, but where it started."""

    far: Law = Law.VECTOR
    near: Law = Law.VECTOR
    speed: float = 2.5
    far_speed: float = 3.0
    target_speed: float = nan
    gain: float = 0.5
    brake: float = 1.0
    turn: float = 1.0
    command_s: float = 0.1
    latency_s: float = 0.0
    climb: float = inf
    sink: float = inf
    floor: float = 2.0


@final
@dataclass(slots=True)
class Flown:
    """What it did, once a period. t : ns;  rows of distance as estimated, set-point [m], stage, what safety did; and
    how many times nothing could be guaranteed for which reason."""

    t: list[int] = field(default_factory=list[int])
    distance: list[float] = field(default_factory=list[float])
    set_point: list[float] = field(default_factory=list[float])
    stage: list[Stage] = field(default_factory=list[Stage])
    hold: list[Hold] = field(default_factory=list[Hold])
    lack: Counter[Lack] = field(default_factory=lambda: Counter[Lack]())


@final
@dataclass(slots=True, kw_only=True)
class Pursuer:
    """An `Agent`. separation : None for no safety filter, as in swarm2023;  home : (3,) m, where it started;  promise :
    what its set-point holds against, which is its first note."""

    name: str
    bearings: Bearings
    zones: Zones
    style: Style
    set_point: SetPoint
    separation: Separation | None
    trail: Trail
    home: Floats
    period_s: float = 0.1
    promise: str = ""
    mission: Rendezvous = field(default_factory=Rendezvous)
    counts: Counter[tuple[Stage, Why]] = field(default_factory=lambda: Counter[tuple[Stage, Why]]())
    blocked: int = 0
    flown: Flown = field(default_factory=Flown)
    _command: Floats = field(default_factory=lambda: np.zeros(3))
    _due_s: float = -inf
    _unfit: bool = False
    _wary: bool = False
    _promised: bool = False

    def act(self, t: int, records: Sequence[Stream], inbox: Sequence[Message]) -> Action:
        """Take and hear, decide, fly, keep apart."""
        b, seconds = self.bearings, self.bearings.seconds(t)
        b.take(t, records)
        heard = b.hear(t, inbox)
        here, there = b.here(t), b.there(t)
        goal = self._goal(there)
        before, wary = self.mission, self._wary
        self.mission = advance(before, self._senses(t, here, there, goal), self.zones)
        if there is not None:
            self.trail.see(seconds, there.now)
        if seconds >= self._due_s - 1e-9:
            self._due_s = max(self._due_s, seconds - self.style.command_s) + self.style.command_s
            self._fly(t, here, there, goal)
        b.own.add_command(seconds, self._command)
        messages = b.clocks.ask(t, self.name, b.leader)
        return Action(
            command=np.array([*self._command, self._turn(records)]), messages=messages, records=self._records(t),
            done=self.mission.stage is Stage.HOME, note=self._note(before, heard, wary),
        )  # fmt: skip

    def _goal(self, there: Known | None) -> float:
        """m to stay away; NaN where it cannot."""
        speed = 0.0 if there is None else float(np.linalg.norm(there.v))
        return self.set_point.distance(speed, self.bearings.delay_s)

    def _senses(self, t: int, here: Known | None, there: Known | None, goal: float) -> Senses:
        b, seconds = self.bearings, self.bearings.seconds(t)
        if there is not None:  # faster than it can fly, by more than it may be wrong about that
            surely = float(np.linalg.norm(there.v)) - 3.0 * float(np.sqrt(np.diag(there.P)[3:].max()))
            self._unfit = surely > self.style.speed * (OUTRUN if self._unfit else 1.0)
        distance = nan if here is None or there is None else float(np.linalg.norm(there.now - here.p))
        return Senses(
            t_s=seconds, distance=distance, heard_s=b.heard_s(t),
            jumps=b.jumps, fix_s=seconds - b.fix_s if here is not None else 0.0,
            sigma=b.sigma(t) if here is not None else 0.0, clocks_s=b.clocks.ahead_s,
            unfit=there is not None and (self._unfit or goal != goal),
            home=float(np.linalg.norm(self.home - here.p)) if here is not None else inf,
        )  # fmt: skip

    def _fly(self, t: int, here: Known | None, there: Known | None, goal: float) -> None:
        """The command that is due, and what is kept of it."""
        hold, self._wary = Hold.UNKNOWN, False
        if here is None:
            self._command = np.zeros(3)
            return
        want = self._wanted(t, here, there, goal)
        if there is None:
            self._command = want
            return
        if self.separation is None:
            self._command, hold = want, Hold.FREE
        else:
            acts = self.bearings.here(t, self.style.latency_s) or here
            kept, hold = self._kept(t, want, acts, there, self.separation)
            kept[2] = max(kept[2], CLIMBS * (min(self.style.floor, self.home[2]) - acts.p[2]))
            self._command = kept - self.bearings.wind(t)  # told so, it flies as it should
        self._command[2] = min(max(self._command[2], -self.style.sink), self.style.climb)
        f = self.flown
        f.t.append(t)
        f.distance.append(float(np.linalg.norm(there.now - here.p)))
        f.set_point.append(goal)
        f.stage.append(self.mission.stage)
        f.hold.append(hold)

    def _kept(self, t: int, want: Floats, acts: Known, there: Known, keeps: Separation) -> tuple[Floats, Hold]:
        """The safe command (3,): clear of the target as it is believed, and as a fix that does not fit tells it."""
        lost = self.bearings.heard_s(t) > self.zones.lost_s
        threats = [(*self._track(t).nearest(acts.p), 0.0) if lost else (there.x, there.P, there.age)]
        if (doubt := self.bearings.doubt(t)) is not None:
            threats.append((doubt.x, doubt.P, doubt.age))
        kept, hold, lack = want, Hold.FREE, None
        for k, (x, P, age) in enumerate(threats):
            kept, done = kept_apart(kept, acts.x, x, keeps, P=acts.P + P, age_s=age)
            lack = lacking(acts.x, x, keeps, acts.P + P, age) if done is Hold.CANNOT_HOLD else lack
            self._wary = k > 0 and done is not Hold.FREE
            hold = max(hold, done, key=HOLDS.index)
        if lack is not None:
            self.flown.lack[lack] += 1
        return kept, hold

    def _wanted(self, t: int, here: Known, there: Known | None, goal: float) -> Floats:
        """(3,) m/s that its stage asks for."""
        stage, style = self.mission.stage, self.style
        if there is None or stage in SHY:
            return np.zeros(3)
        if stage is Stage.RETURN:
            return within(style.gain * (self.home - here.p), style.speed)
        if stage is Stage.SEARCH:
            track = self._track(t)
            return track.over(here.p, track.above(self.separation, goal, here.P), style.gain, style.far_speed)
        far = stage is Stage.LOCALISE
        return self._by_law(
            style.far if far else style.near, here, there, goal, style.far_speed if far else style.speed
        )

    def _track(self, t: int) -> CredibleTrack:
        """Where a silent target may be."""
        stops_s = self.separation.other_lag_s if self.separation else 0.0
        return credible_track(*self.bearings.last, self.bearings.seconds(t), self.style.far_speed, stops_s)

    def _by_law(self, law: Law, here: Known, there: Known, goal: float, speed: float) -> Floats:
        style = self.style
        if law is Law.VECTOR:
            rules = Pursuit(speed=speed, gain=style.gain, brake=style.brake)
            return pursued(here.p, there.x, goal, rules, age_s=there.age + style.latency_s)
        out, q = np.empty(3), there.now
        if law is Law.ZONE:
            v = style.target_speed
            v = float(np.linalg.norm(there.v)) if v != v else v
            speed = float(zone_speed(float(np.linalg.norm(q - here.p)), goal, min(v, style.speed), style.speed))
        at = self.trail.aim(here.p) if law is Law.BEZIER else q
        line_of_sight(np.ascontiguousarray(here.p), np.ascontiguousarray(q if at is None else at), speed, out)
        out[2] = float(np.clip(CLIMBS * (q[2] - here.p[2]), -1.0, 1.0))
        return out

    def _turn(self, records: Sequence[Stream]) -> float:
        """rad/s: the nose goes where it flies."""
        heading = next((float(s.z[-1, 0]) for s in records if s.kind is Kind.HEADING and len(s)), nan)
        if heading != heading or hypot(*self._command[:2]) < 0.2:
            return 0.0
        off = wrap(atan2(self._command[1], self._command[0]) - heading)
        return float(np.clip(TURN * off, -self.style.turn, self.style.turn))

    def _records(self, t: int) -> tuple[Stream, ...]:
        b = self.bearings.believed(t)
        if b is None:
            return ()
        yaw = atan2(b.v[1], b.v[0]) if hypot(*b.v[:2]) > 0.2 else 0.0
        q = quats_exp(np.array([[0.0, 0.0, yaw]]))[0]
        z = np.concatenate([b.p, q, b.v])[None]
        return (stream("estimate", Kind.ESTIMATE, np.array([t]), z, robot=self.name, frame="base_link"),)

    def _note(self, before: Rendezvous, heard: Sequence[Outcome], wary: bool) -> str:
        """What changed, in sentences."""
        m, said = self.mission, [self.promise] if self.promise and not self._promised else []
        self._promised = True
        if m.stage is not before.stage or m.why is not before.why:
            self.counts[m.stage, m.why] += 1
            said.append(f"{m.stage.value}: {m.why.value}")
        if m.signal is not before.signal:
            self.blocked += m.signal is Signal.BLOCKED
            said.append(m.signal.value)
        said += [f"the target's fix: {o.value}" for o in heard if o in SAID]
        if self._wary and not wary:
            said.append(WARY)
        return "; ".join(said)
