"""The robots of an inspection: one on the ground that carries a pad, and a drone that lives on it. Agents."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import cos, sin
from typing import Final, final

import numpy as np

from outrider.core.rotations import quats_to_matrices
from outrider.data import Kind, Stream
from outrider.data.agents import Action, Message
from outrider.guidance.flight import Flight, FlightRules, Phase, Senses, advance
from outrider.team.crew import Crew
from outrider.team.follow import Follower, within
from outrider.team.navigator import Fused
from outrider.team.words import PAD, WISH, Pad, number_message, number_of
from outrider.typing import Bools, Floats

HEARD_S: Final = 2.0  # s after which what somebody said is too old
STOOD: Final = 0.15  # m/s, slower counts as standing
GAP: Final = 1.0  # m that robots on the ground keep between them, beside their sizes
GLANCE: Final = 0.2  # share of a sighting of the pad that counts at once
OVER_PAD: Final = 2.5  # m above the pad at which a drone lines up
SINK: Final = 0.4  # m/s towards the pad
TOUCH: Final = 0.12  # m/s onto it
HALT: Final = 0.06  # m/s, slower than told to sink is standing
NEAR: Final = 0.35  # m above the pad from where on it may touch at any moment
JOLT: Final = (0.06, 0.01)  # m/s and rad by which that may push it, each period
UNSTATED: Final = np.full((1, len(Kind.ESTIMATE.columns)), np.nan)  # variances
GENTLE: Final = 0.8  # m/s^2, of a drone's commands


@final
@dataclass(slots=True, kw_only=True)
class Shots:
    """Pictures that fall due on the way: times (k,) s of the path at which to take them. taken : (ns, which)."""

    due: Floats
    taken: list[tuple[int, int]] = field(default_factory=list[tuple[int, int]])
    _next: int = 0

    def look(self, t: int, s: float) -> None:
        """Take those that are due at s [s] of the path."""
        while self._next < self.due.size and self.due[self._next] <= s:
            self.taken.append((t, self._next))
            self._next += 1


@final
@dataclass(slots=True, kw_only=True)
class Rover:
    """An `Agent` on the ground. pad : (3,) m, of its pad in its body;  open_s : times of its path at which nothing is
    above it;  drone : whom it carries, "" for nobody;  radius : m, its own."""

    name: str
    crew: Crew
    follower: Follower
    shots: Shots
    speed: float
    pad: Floats
    open_s: Floats
    drone: str = ""
    radius: float = 0.5
    period_s: float = 0.1
    _wish: bool = False
    _ready: bool = False
    _others: dict[str, Pad] = field(default_factory=dict[str, Pad])
    _told: str = ""

    def act(self, t: int, records: Sequence[Stream], inbox: Sequence[Message]) -> Action:
        """Fuse, hear, drive on, or to where a drone can land."""
        self.crew.take(self.name, t, records)
        here = self.crew.now(self.name, t)
        for m in inbox:
            if m.topic == WISH and m.receiver == self.name:
                self._wish = number_of(m) > 0
            elif m.topic == PAD:
                self._others[m.sender] = Pad.of(m)
        f = self.follower
        goal = float(self.open_s[np.abs(self.open_s - f.s).argmin()]) if self._wish and self.open_s.size else None
        goal = f.s if self._yields(t, here) else goal
        v, w = f.step(here, self.period_s, goal)
        self.shots.look(t, f.s)
        speed = float(np.hypot(*here.v[:2]))
        still = speed < STOOD or (self._ready and speed < 2.0 * STOOD)
        ready = self._ready = self._wish and goal is not None and abs(goal - f.s) < 0.5 and still
        c, s = cos(here.heading), sin(here.heading)
        v = within(v[:2], self.speed)
        place = np.array([here.p[0] + c * self.pad[0] - s * self.pad[1], here.p[1] + s * self.pad[0] + c * self.pad[1]])
        pose = np.array([*place, self.pad[2], here.heading])
        said = Pad(carrier=self.name, t=t, pose=pose, velocity=here.v[:2].copy(), ready=ready).message()
        return Action(
            command=np.array([c * v[0] + s * v[1], c * v[1] - s * v[0], w]), messages=(said,),
            records=(_estimate(here, self.name),), done=f.over and not self.drone, note=self._note(ready=ready),
        )  # fmt: skip

    def _yields(self, t: int, here: Fused) -> bool:
        """Whether somebody who comes first by name is near, ahead of it."""
        v = self.follower.path.at(np.array([self.follower.s]))[1][0, :2]
        for name, said in self._others.items():
            gap = said.pose[:2] - here.p[:2]
            near = float(np.hypot(*gap)) < 2.0 * self.radius + GAP
            if name < self.name and near and (t - said.t) * 1e-9 < HEARD_S and float(v @ gap) > 0.0:
                return True
        return False

    def _note(self, *, ready: bool) -> str:
        told = ""
        if self.follower.over:
            told = "its path is over"
        elif self._wish:
            told = "it stands in the open for the drone" if ready else "it drives to where a drone can land or leave"
        new, self._told = told != self._told, told
        return told if new else ""


@final
@dataclass(slots=True, kw_only=True)
class Sightings:
    """Where the pad is, by the camera: the drone above its middle (3,) m, site frame, carried on by both velocities."""

    above: Floats = field(default_factory=lambda: np.full(3, np.nan))
    seen_s: float = -np.inf

    def carry(self, v: Floats, dt: float) -> None:
        """On by v (3,) m/s, of the drone over the pad."""
        self.above = self.above + v * dt

    def see(self, above: Floats, t_s: float) -> None:
        """A sighting."""
        fresh = t_s - self.seen_s < HEARD_S and bool(np.isfinite(self.above).all())
        self.above = self.above + GLANCE * (above - self.above) if fresh else above
        self.seen_s = t_s


@final
@dataclass(slots=True, kw_only=True)
class Drone:
    """An `Agent` in the air. camera : stream that sees the carrier, by `number`, and turned by `mount` (3, 3), at
    `lever` (3,) m;  pad : (3,) m, in the carrier's body;  high : m, above everything;  free_s, free : of its path,
    whether nothing is above;  endurance_s, charge_s : from full to empty, and back."""

    name: str
    carrier: str
    crew: Crew
    follower: Follower
    shots: Shots
    speed: float
    camera: str
    number: float
    mount: Floats
    lever: Floats
    pad: Floats
    high: float
    free_s: Floats
    free: Bools
    endurance_s: float = np.inf
    charge_s: float = 30.0
    rules: FlightRules = field(default_factory=FlightRules)
    period_s: float = 0.1
    flight: Flight = field(default_factory=Flight)
    battery: float = 1.0
    landings: list[tuple[int, Floats]] = field(default_factory=list[tuple[int, Floats]])
    sight: Sightings = field(default_factory=Sightings)
    _heard: Pad | None = None
    _sinking_s: float = 0.0
    _told: Floats = field(default_factory=lambda: np.zeros(3))

    def act(self, t: int, records: Sequence[Stream], inbox: Sequence[Message]) -> Action:
        """Fuse, see, decide, fly."""
        self.crew.take(self.name, t, records)
        here = self.crew.now(self.name, t)
        for m in inbox:
            if m.topic == PAD and m.sender == self.carrier:
                self._heard = Pad.of(m)
        self._look(t, here, records)
        before = self.flight
        docked = before.phase is Phase.DOCKED
        used = self.period_s / (-self.charge_s if docked else self.endurance_s)
        self.battery = min(max(self.battery - used, 0.0), 1.0)
        self.flight = advance(before, self._senses(t, here), self.rules)
        command = self._gently(self._command(t, here))
        changed = self.flight.phase is not before.phase
        if changed and self.flight.phase is Phase.DOCKED:
            self.landings.append((t, self.sight.above.copy()))
        wish = number_message(WISH, self.name, self.carrier, t, int(self._wishes()))
        over = self.follower.over and self.flight.phase is Phase.DOCKED and self.flight.charges > 0
        note = f"{self.flight.phase.value}: {self.flight.reason}" if changed else ""
        done = over or self.flight.phase is Phase.LOST
        return Action(
            command=command, messages=(wish,), records=(_estimate(here, self.name),), note=note, done=done,
        )  # fmt: skip

    def _gently(self, command: Floats) -> Floats:
        """The command, with no more acceleration than the filter expects; from the pad it starts anew."""
        if self.flight.phase is Phase.DOCKED:
            self._told = np.zeros(3)
            return command
        self._told = self._told + within(command[:3] - self._told, GENTLE * self.period_s)
        return np.array([*self._told, command[3]])

    def _wishes(self) -> bool:
        """Whether the carrier should stand in the open."""
        phase, left = self.flight.phase, not self.follower.over
        if phase is Phase.DOCKED:
            return left and self.battery >= self.rules.full
        return phase not in (Phase.GO, Phase.SINK, Phase.INSPECT)

    def _look(self, t: int, here: Fused, records: Sequence[Stream]) -> None:
        """Where the pad is, by the newest sightings."""
        still = self._heard.velocity if self._heard is not None else np.zeros(2)
        self.sight.carry(here.v - np.array([*still, 0.0]), self.period_s)
        for s in records:
            if s.name != self.camera:
                continue
            R = quats_to_matrices(here.q[None])[0]
            for i in np.flatnonzero(s.z[:, 0] == self.number).tolist():
                body = self.mount @ s.z[i, 1:4] + self.lever  # of the carrier's origin, from here
                turned = R @ self.mount @ quats_to_matrices(s.z[i : i + 1, 4:8])[0]
                heading = np.arctan2(turned[1, 0], turned[0, 0])
                c, k = np.cos(heading), np.sin(heading)
                x, y, z = self.pad.tolist()
                pad = R @ body + np.array([c * x - k * y, k * x + c * y, z])
                self.sight.see(-pad, int(s.t[i]) * 1e-9)

    def _goal(self, t: int) -> Floats:
        """(3,) m where the phase goes."""
        place, pad = self.follower.place(), self._pad(t)
        if self.flight.phase is Phase.CLIMB:
            near = float(np.hypot(*(place - pad)[:2])) < self.rules.reach
            return np.array([pad[0], pad[1], place[2] if near else self.high])
        if self.flight.phase in (Phase.GO, Phase.RISE):
            return np.array([place[0], place[1], self.high])
        if self.flight.phase is Phase.RETURN:
            return np.array([pad[0], pad[1], self.high])
        if self.flight.phase in (Phase.LOWER, Phase.ALIGN, Phase.DESCEND, Phase.ABORT, Phase.LOST):
            return pad + np.array([0.0, 0.0, OVER_PAD * (1.0 + self.flight.tries)])  # higher up it sees more
        return place

    def _pad(self, t: int) -> Floats:
        """(3,) m, of the pad's middle as the carrier says."""
        if self._heard is None:
            return self.follower.place()
        ago = (t - self._heard.t) * 1e-9
        return self._heard.pose[:3] + np.array([*self._heard.velocity * min(ago, HEARD_S), 0.0])

    def _senses(self, t: int, here: Fused) -> Senses:
        goal = self._goal(t)
        ready = self._heard is not None and self._heard.ready and (t - self._heard.t) * 1e-9 < HEARD_S
        above = self.sight.above if np.isfinite(self.sight.above).all() else np.full(3, np.inf)
        still = self._heard.velocity if self._heard is not None else np.zeros(2)
        return Senses(
            t_s=t * 1e-9, battery=self.battery, left=not self.follower.over, ready=ready,
            near=float(np.hypot(*(goal - here.p)[:2])), up=float(goal[2] - here.p[2]),
            free=bool(self.free[np.abs(self.free_s - self.follower.s).argmin()]),
            unseen_s=t * 1e-9 - self.sight.seen_s, aside=float(np.hypot(*above[:2])),
            slow=float(np.hypot(*(here.v[:2] - still))), landed=self._sinking_s > 1.0 and above[2] < 0.35,
        )  # fmt: skip

    def _command(self, t: int, here: Fused) -> Floats:
        phase = self.flight.phase
        if phase is Phase.DESCEND and self.sight.above[2] < NEAR:
            self.crew.jolt(self.name, *JOLT)
        sinks = phase is Phase.DESCEND and here.v[2] > -HALT and self._told[2] <= -TOUCH
        self._sinking_s = self._sinking_s + self.period_s if sinks else 0.0
        if phase is Phase.DOCKED:
            return np.array([0.0, 0.0, -0.1, 0.0])
        if phase in (Phase.INSPECT, Phase.LEAVE):
            v, w = self.follower.step(here, self.period_s)
            self.shots.look(t, self.follower.s)
            return np.array([*within(v, 1.3 * self.speed), w])
        if phase in (Phase.ALIGN, Phase.DESCEND) and t * 1e-9 - self.sight.seen_s < self.rules.unseen_s:
            still = self._heard.velocity if self._heard is not None else np.zeros(2)
            flat = within(-0.8 * self.sight.above[:2], 0.6) + still
            down = max(TOUCH, 0.5 * float(self.sight.above[2]))
            up = -down if phase is Phase.DESCEND else 0.8 * (self._goal(t)[2] - here.p[2])
            return np.array([*flat, float(np.clip(up, -SINK, SINK)), 0.0])
        gap = self._goal(t) - here.p
        if phase is Phase.LOWER:
            gap[2] = 0.0 if float(np.hypot(*gap[:2])) > self.rules.reach else gap[2]
        return np.array([*within(0.8 * gap, 1.5 * self.speed), 0.0])


def _estimate(here: Fused, robot: str) -> Stream:
    """The estimate as a record of the log."""
    z = np.concatenate([here.p, here.q, here.v])[None]
    t = np.array([here.t])
    return Stream(
        name="estimate", kind=Kind.ESTIMATE, t=t, z=z, var=UNSTATED, t_arrival=t, robot=robot, frame="base_link"
    )
