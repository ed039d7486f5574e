"""A ground robot on patrol: its round, orders of the station, the dock; one at a time through narrow passages."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final, final

import numpy as np

from outrider.core.flat import inside_polygon
from outrider.data import Stream
from outrider.data.agents import Action, Message
from outrider.errors import ConfigError
from outrider.guidance.patrol import Duty, Inputs, Mission, Order, Report, Rules, Transition, advance
from outrider.team.driver import Answer, Drive
from outrider.team.ground import Ground
from outrider.team.navigator import Fused
from outrider.team.words import ASK, CANCEL, GRANT, ORDER, Status, number_message, number_of, order_of
from outrider.typing import Floats

SAID_S: Final = 0.5  # s between two messages about oneself
REPEATS_S: Final = 10.0  # s for which a report is said again
LOOK_AHEAD: Final = 8.0  # m of path within which a passage is asked for
WAIT_BEFORE: Final = 3.0  # m to a passage at which the robot waits: others come out past it
REACTION_S: Final = 0.4  # s until a robot brakes
GRANTED_S: Final = 2.0  # s for which a grant holds that is not said again
PATHLESS_S: Final = 10.0  # s for which a robot without a path keeps a passage that it was granted


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Battery:
    """Hours that a full one lasts standing and driving, and that it takes to charge."""

    standing_h: float = 10.0
    driving_h: float = 3.0
    charging_h: float = 1.0

    def __post_init__(self) -> None:
        if not min(self.standing_h, self.driving_h, self.charging_h) > 0.0:
            raise ConfigError("no time at all", where="battery", fix="positive hours")

    def after(self, share: float, seconds: float, *, moving: bool, docked: bool) -> float:
        """Share left."""
        hours = -self.charging_h if docked else (self.driving_h if moving else self.standing_h)
        return float(np.clip(share - seconds / 3600.0 / hours, 0.0, 1.0))


@final
@dataclass(slots=True, kw_only=True)
class Patrol:
    """An `Agent`. stops : (n, 3) east, north [m], heading [rad] (NaN: any), visited in turn;  dock : (3,);  passages :
    outlines (k, 2) m of which only one robot may be in each;  transition : what the mission becomes."""

    name: str
    body: Ground
    stops: Floats
    dock: Floats
    station: str = "station"
    passages: tuple[Floats, ...] = ()
    battery: Battery = field(default_factory=Battery)
    rules: Rules = field(default_factory=Rules)
    share: float = 1.0
    period_s: float = 0.1
    transition: Transition = advance
    mission: Mission = field(default_factory=Mission)
    _answer: Answer = field(default_factory=lambda: Answer(state=Drive.IDLE))
    _granted: tuple[int, int] = (-1, 0)
    _wanted: int = -1
    _led: int = 0  # ns, when it last had a path
    _ended: tuple[tuple[int, Report], ...] = ()
    _said: int = -(10**18)

    def act(self, t: int, records: Sequence[Stream], inbox: Sequence[Message]) -> Action:
        """Hear, decide what to be about, drive there, say so."""
        order, cancelled = self._hear(inbox)
        before = self.mission
        note = self._decide(t, order, cancelled)
        self.body.driver.go(self._goal())
        here, self._answer = self.body.aim(t, records, inbox)
        order = -1 if self.mission.order is None else self.mission.order.number
        stands = self._passage(t, here) or self.mission.duty is Duty.EMPTY or self.body.gives_way(t, here, order) != ""
        self._answer = self.body.give(t, here, self._answer.at_rest if stands else self._answer)
        note = "; ".join(x for x in (note, self._answer.note) if x)
        self._drain(here)
        changed = self.mission.duty is not before.duty
        return Action(
            command=self._answer.twist, messages=self._words(t, here, changed=changed), note=note,
            records=(self.body.navigator.record(here),),
        )  # fmt: skip

    def _hear(self, inbox: Sequence[Message]) -> tuple[Order | None, tuple[int, ...]]:
        """A new order, and orders that are called off."""
        done = {number for _, (number, _) in self._ended}
        mine = -1 if self.mission.order is None else self.mission.order.number
        order, cancelled = None, list[int]()
        for m in inbox:
            if m.topic == ORDER and order_of(m).number not in (*done, mine):
                order = order_of(m)
            elif m.topic == CANCEL:
                cancelled.append(number_of(m))
            elif m.topic == GRANT:
                self._granted = (number_of(m), m.t)
        return order, tuple(cancelled)

    def _decide(self, t: int, order: Order | None, cancelled: tuple[int, ...]) -> str:
        before = self.mission
        inputs = Inputs(
            t_s=t * 1e-9,
            arrived=self._answer.state is Drive.ARRIVED,
            unreachable=self._answer.state is Drive.UNREACHABLE,
            blind=self._answer.state is Drive.BLIND,
            battery=self.share,
            order=order,
            cancelled=cancelled,
            stops=len(self.stops),
        )
        self.mission, ended = self.transition(before, inputs, self.rules)
        self._ended = tuple((when, r) for when, r in self._ended if t - when < REPEATS_S * 1e9)
        self._ended += tuple((t, r) for r in ended)
        told = [f"order {number}: {how.value}" for number, how in ended]
        if self.mission.duty is not before.duty:
            told.append(self.mission.duty.value)
        if inputs.unreachable and before.duty is Duty.PATROL and before.stop != self.mission.stop:
            told.append(f"stop {before.stop + 1} cannot be reached")
        if told and (inputs.unreachable or inputs.blind):
            told.append(self._answer.reason)
        return "; ".join(told)

    def _goal(self) -> Floats:
        m = self.mission
        if m.order is not None:
            return m.order.view
        return self.dock if m.duty is Duty.CHARGE else self.stops[m.stop]

    def _passage(self, t: int, here: Fused) -> bool:
        """Ask for the passage that comes next; whether to wait before it."""
        self._wanted, gap = self._next_passage(here) if self._has_path(t) else (self._wanted, 0.0)
        if self._wanted != self._granted[0]:
            self._granted = (-1, 0)  # a grant is for one way through
        granted = self._wanted == self._granted[0] and t - self._granted[1] < GRANTED_S * 1e9
        v, limits = float(np.hypot(*here.v[:2])), self.body.driver.limits
        stop = v * v / (2.0 * limits.acceleration) + v * REACTION_S
        return self._wanted >= 0 and 0.0 < gap < WAIT_BEFORE + stop and not granted

    def _has_path(self, t: int) -> bool:
        """Whether a path says which passage comes next. Who drives through a passage hides the way through it: a robot
        that waits does not lose its place in the queue for that."""
        path = self._answer.path
        self._led = t if path is not None and path.found else self._led
        granted = self._granted[0] >= 0 and self._granted[0] == self._wanted
        return self._wanted < 0 or self._led == t or (granted and t - self._led > PATHLESS_S * 1e9)

    def _next_passage(self, here: Fused) -> tuple[int, float]:
        """The passage that the robot is in, at 0 m, or that its path comes to, and how far off [m]; -1 for none."""
        path = self._answer.path
        points = here.p[None, :2] if path is None or not path.found else _ahead(path.points, here.p[:2], LOOK_AHEAD)
        gone = np.hypot(*(points - here.p[:2]).T)
        found = list[tuple[float, int]]()
        for k, outline in enumerate(self.passages):
            for p, s in zip(points.tolist(), gone.tolist(), strict=True):
                if inside_polygon(outline, 0, len(outline), p[0], p[1]):
                    found.append((s, k))
                    break
        gap, k = min(found, default=(0.0, -1))
        return k, gap

    def _drain(self, here: Fused) -> None:
        docked = self.mission.duty is Duty.CHARGE and self._answer.state is Drive.ARRIVED
        moving = float(np.hypot(here.v[0], here.v[1])) > 0.05
        self.share = self.battery.after(self.share, self.period_s, moving=moving, docked=docked)

    def _words(self, t: int, here: Fused, *, changed: bool) -> tuple[Message, ...]:
        """About itself, twice a second and whenever something changed."""
        if not changed and t - self._said < SAID_S * 1e9:
            return ()
        self._said = t
        status = Status(
            robot=self.name, t=t, pose=np.array([here.p[0], here.p[1], here.heading]), velocity=here.v[:2].copy(),
            duty=self.mission.duty, order=-1 if self.mission.order is None else self.mission.order.number,
            battery=self.share, ended=tuple(r for _, r in self._ended),
        )  # fmt: skip
        return status.message(), number_message(ASK, self.name, self.station, t, self._wanted)


def _ahead(points: Floats, p: Floats, reach: float) -> Floats:
    """(m, 2) of a path from the robot on, about every 0.2 m, over `reach` [m]."""
    gap = np.diff(points, axis=0)
    share = np.clip(((p - points[:-1]) * gap).sum(axis=1) / np.maximum((gap**2).sum(axis=1), 1e-12), 0.0, 1.0)
    off = np.hypot(*(points[:-1] + share[:, None] * gap - p).T)
    rest = np.vstack([p[None], points[int(off.argmin()) + 1 :] if off.size else points])
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(rest, axis=0).T))])
    every = np.arange(0.0, min(reach, float(s[-1])) + 1e-9, 0.2)
    return np.column_stack([np.interp(every, s, rest[:, k]) for k in range(2)])
