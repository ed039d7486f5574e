"""The station of a patrol: it takes alerts, sends the robot with the shortest way, and keeps the book of what became
of each. It knows the site and what robots say of themselves, no more."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final, Protocol, final

import numpy as np

from outrider.data import Stream
from outrider.data.agents import Action, Message
from outrider.data.alerts import Alert, AlertState
from outrider.data.grid import Costmap
from outrider.data.routes import GlobalPlanner
from outrider.guidance.dispatch import Passages, assign
from outrider.guidance.patrol import Duty, Ended, Order
from outrider.planning.view import viewpoints
from outrider.team.words import ASK, CANCEL, GRANT, STATUS, Status, number_message, number_of, order_message
from outrider.typing import Floats

SILENT_S: Final = 5.0  # s without a status after which a robot is not counted on
TRIED: Final = 3  # viewpoints to which a way is looked for
BECAME: Final = {
    Ended.OBSERVED: AlertState.OBSERVED,
    Ended.CANCELLED: AlertState.CANCELLED,
    Ended.TIMED_OUT: AlertState.TIMED_OUT,
}
"""The other ends of a response leave the alert to another robot."""


class Feed(Protocol):
    """Where alerts come from: a schedule, a file that grows, a network."""

    def due(self, t: int) -> tuple[Sequence[Alert], Sequence[int]]:
        """Alerts raised and numbers of alerts called off up to t [ns], since the last call."""
        ...


@final
@dataclass(frozen=True, slots=True)
class Entry:
    """An alert in the book. tried : robots that could not do it;  log : (t ns, state, robot)."""

    alert: Alert
    state: AlertState = AlertState.WAITING
    robot: str = ""
    order: Order | None = None
    tried: frozenset[str] = frozenset()
    cost: float = np.inf
    log: tuple[tuple[int, AlertState, str], ...] = ()

    def became(self, t: int, state: AlertState, robot: str = "", **changes: object) -> "Entry":
        """The entry with one more line."""
        log = (*self.log, (t, state, robot))
        return replace(self, state=state, robot=robot, log=log, **changes)  # type: ignore[arg-type]


@final
@dataclass(slots=True, kw_only=True)
class Station:
    """An `Agent` that stands. costmap : of the site as drawn;  near, far : m, from where to look at an alert;
    same : m, within which two alerts are one."""

    name: str
    feed: Feed
    costmap: Costmap
    planner: GlobalPlanner
    near: float = 2.0
    far: float = 6.0
    same: float = 0.5
    period_s: float = 0.5
    book: dict[int, Entry] = field(default_factory=dict[int, Entry])
    passages: Passages = field(default_factory=Passages)
    _heard: dict[str, Status] = field(default_factory=dict[str, Status])
    _orders: dict[int, int] = field(default_factory=dict[int, int])

    def act(self, t: int, records: Sequence[Stream], inbox: Sequence[Message]) -> Action:
        """Listen, book, assign, tell."""
        for m in inbox:
            self._hear(t, m)
        notes = self._take(t)
        self._expire(t)
        notes += self._send(t)
        return Action(command=np.zeros(0), messages=tuple(self._words(t)), note="; ".join(notes))

    @property
    def open(self) -> int:
        """How many alerts have not ended."""
        return sum(not e.state.ended for e in self.book.values())

    def _hear(self, t: int, m: Message) -> None:
        if m.topic == STATUS:
            status = self._heard[m.sender] = Status.of(m)
            for number, how in status.ended:
                self._report(t, number, how)
            e = self._about(status.order)
            if e is not None and status.duty is Duty.OBSERVE and e.state is AlertState.ASSIGNED:
                self.book[e.alert.number] = e.became(t, AlertState.ON_SCENE, e.robot)
        elif m.topic == ASK:
            asked = number_of(m)
            held = [k for k, who in self.passages.holder.items() if who == m.sender and k != str(asked)]
            for passage in held:
                self.passages = self.passages.left(passage, m.sender)
            self.passages = self.passages.asked(str(asked), m.sender) if asked >= 0 else self.passages.lost(m.sender)

    def _about(self, order: int) -> Entry | None:
        """The entry that an order serves now."""
        e = self.book.get(self._orders.get(order, -1))
        return e if e is not None and e.order is not None and e.order.number == order else None

    def _report(self, t: int, order: int, how: Ended) -> None:
        """What a robot says became of its order; said again and again, booked once."""
        e = self._about(order)
        if e is None or e.state.ended:
            return
        state = BECAME.get(how, AlertState.WAITING)
        tried = e.tried | ({e.robot} if how is Ended.UNREACHABLE else frozenset[str]())
        robot = e.robot if state.ended else ""
        self.book[e.alert.number] = e.became(t, state, robot, order=None, tried=tried)

    def _take(self, t: int) -> list[str]:
        raised, cancelled = self.feed.due(t)
        notes: list[str] = []
        for alert in raised:
            twin = next((e for e in self.book.values() if self._repeats(e, alert)), None)
            state = AlertState.WAITING if twin is None else AlertState.DUPLICATE
            number = alert.number if alert.number not in self.book else max(self.book) + 1
            self.book[number] = Entry(replace(alert, number=number)).became(t, state)
            notes.append(f"alert {number} at ({alert.p[0]:.1f}, {alert.p[1]:.1f}) from {alert.source or 'somebody'}")
        for number in cancelled:
            entry = self.book.get(number)
            if entry is not None and not entry.state.ended:
                self.book[number] = entry.became(t, AlertState.CANCELLED, entry.robot, order=None)
        return notes

    def _repeats(self, e: Entry, alert: Alert) -> bool:
        gap = float(np.hypot(*(e.alert.p - alert.p)))
        return not e.state.ended and e.state is not AlertState.DUPLICATE and gap < self.same

    def _expire(self, t: int) -> None:
        """Alerts for which nobody is under way in time, and robots that have gone silent."""
        for number, e in self.book.items():
            late = t - e.alert.t > e.alert.patience_s * 1e9
            if e.state is AlertState.WAITING and late:
                self.book[number] = e.became(t, AlertState.TIMED_OUT)
            elif e.state in (AlertState.ASSIGNED, AlertState.ON_SCENE) and not self._fresh(t, e.robot):
                self.book[number] = e.became(t, AlertState.WAITING, order=None)

    def _fresh(self, t: int, robot: str) -> bool:
        return robot in self._heard and t - self._heard[robot].t < SILENT_S * 1e9

    def _send(self, t: int) -> list[str]:
        """The free robots to the waiting alerts, by the least sum of ways."""
        busy = {e.robot for e in self.book.values() if e.state in (AlertState.ASSIGNED, AlertState.ON_SCENE)}
        free = [
            s for name, s in sorted(self._heard.items())
            if self._fresh(t, name) and name not in busy and s.order < 0 and s.duty in (Duty.PATROL, Duty.STAND)
        ]  # fmt: skip
        waiting = [e for _, e in sorted(self.book.items()) if e.state is AlertState.WAITING]
        known = [name for name in self._heard if self._fresh(t, name)]
        if not waiting or not known:
            return []
        ways = {(s.robot, e.alert.number): self._way(s, e) for s in free for e in waiting}
        for e in waiting:
            if self._hopeless(e, known, ways):
                self.book[e.alert.number] = e.became(t, AlertState.UNREACHABLE)
        costs = np.array([[ways[s.robot, e.alert.number][0] for e in waiting] for s in free]).reshape(-1, len(waiting))
        notes: list[str] = []
        for i, j in assign(costs) if len(free) else ():
            robot, e = free[i].robot, waiting[j]
            cost, view = ways[robot, e.alert.number]
            until = e.alert.t * 1e-9 + e.alert.patience_s
            number = len(self._orders)
            self._orders[number] = e.alert.number
            order = Order(number=number, alert=e.alert.number, view=view, hold_s=e.alert.hold_s, until_s=until)
            self.book[e.alert.number] = e.became(t, AlertState.ASSIGNED, robot, order=order, cost=cost)
            notes.append(f"{robot} goes to alert {e.alert.number}, {cost:.0f} m")
        return notes

    def _hopeless(self, e: Entry, known: Sequence[str], ways: Mapping[tuple[str, int], tuple[float, Floats]]) -> bool:
        """Whether every robot was asked, or tried, and none can."""
        number = e.alert.number
        return all(r in e.tried or ((r, number) in ways and not np.isfinite(ways[r, number][0])) for r in known)

    def _way(self, s: Status, e: Entry) -> tuple[float, Floats]:
        """Length of the shortest way to a place with a view [m], and that place."""
        best, where = np.inf, np.zeros(3)
        if s.robot in e.tried:
            return best, where
        places = viewpoints(self.costmap, e.alert.p, near=self.near, far=self.far)
        straight = np.hypot(*(places[:, :2] - s.pose[:2]).T)
        found = 0
        for k in np.argsort(straight, kind="stable").tolist():
            if straight[k] >= best or found >= TRIED:
                break
            path = self.planner.plan(self.costmap, s.pose[:2], places[k, :2])
            if path.found:
                found += 1
                if path.length < best:
                    best, where = path.length, places[k]
        return best, where

    def _words(self, t: int) -> list[Message]:
        """Orders until they are followed, cancellations until they are heard, grants."""
        out: list[Message] = []
        for e in self.book.values():
            status = self._heard.get(e.robot)
            if (
                e.state is AlertState.ASSIGNED
                and e.order is not None
                and (not status or status.order != e.order.number)
            ):
                out.append(order_message(self.name, e.robot, t, e.order))
        for name, status in self._heard.items():
            if status.order >= 0 and self._about(status.order) is None:
                out.append(number_message(CANCEL, self.name, name, t, status.order))
        for passage, robot in self.passages.holder.items():
            out.append(number_message(GRANT, self.name, robot, t, int(passage)))
        return out
