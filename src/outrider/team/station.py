"""The station of a patrol: it takes alerts, sends the robot with the shortest way, and keeps the book of what became
of each. It knows the site and what robots say of themselves, no more."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Final, Protocol, final

import numpy as np

from outrider.data import Stream
from outrider.data.agents import Action, Message
from outrider.data.alerts import Alert, AlertState, News
from outrider.data.grid import Costmap
from outrider.data.routes import GlobalPlanner
from outrider.guidance.dispatch import Passages, assign
from outrider.guidance.patrol import Duty, Ended, Order
from outrider.planning.reach import Reach, Reaches
from outrider.planning.view import viewpoints
from outrider.team.words import ASK, CANCEL, GRANT, STATUS, Status, number_message, number_of, order_message
from outrider.typing import Floats, Ints

SILENT_S: Final = 5.0  # s without a status after which a robot is not counted on
SILENT: Final = "nothing was heard of the robot any more"
BECAME: Final = {
    Ended.OBSERVED: AlertState.OBSERVED,
    Ended.CANCELLED: AlertState.CANCELLED,
    Ended.TIMED_OUT: AlertState.TIMED_OUT,
}
"""The other ends of a response leave the alert to another robot."""


class Feed(Protocol):
    """Where alerts come from: a schedule, a file that grows, a network."""

    def due(self, t: int) -> News:
        """What has come up to t [ns], since the last call."""
        ...


@final
@dataclass(frozen=True, slots=True)
class Entry:
    """An alert in the book. tried : robots that cannot get there;  view, cost, way : (3,) where the last robot was sent
    to, and its way there, in metres of free ground and in metres;  log : (t ns, state, robot);  returned : those who
    gave it back (t ns, robot, why);  twin : the alert that it repeats, -1 for none."""

    alert: Alert
    state: AlertState = AlertState.WAITING
    robot: str = ""
    order: Order | None = None
    tried: frozenset[str] = frozenset()
    view: Floats | None = None
    cost: float = np.inf
    way: float = np.inf
    log: tuple[tuple[int, AlertState, str], ...] = ()
    returned: tuple[tuple[int, str, str], ...] = ()
    twin: int = -1

    def became(self, t: int, state: AlertState, robot: str = "", **changes: object) -> "Entry":
        """The entry with one more line."""
        log = (*self.log, (t, state, robot))
        return replace(self, state=state, robot=robot, log=log, **changes)  # type: ignore[arg-type]


@final
@dataclass(slots=True, kw_only=True)
class Station:
    """An `Agent` that stands. costmap : of the site as drawn;  planner : of the ways that robots are sent on;  reach :
    what ways cost;  near, far : m, from where to look at an alert;  same : m, within which two alerts are one;
    lease_s : silence after which a passage is free again;  faults : lines of its feed that it could not use."""

    name: str
    feed: Feed
    costmap: Costmap
    planner: GlobalPlanner
    reach: Reaches = field(default_factory=Reach)
    near: float = 2.0
    far: float = 6.0
    same: float = 0.5
    lease_s: float = 30.0
    period_s: float = 0.5
    book: dict[int, Entry] = field(default_factory=dict[int, Entry])
    passages: Passages = field(default_factory=Passages)
    faults: int = 0
    _heard: dict[str, Status] = field(default_factory=dict[str, Status])
    _orders: dict[int, int] = field(default_factory=dict[int, int])
    _views: dict[int, tuple[Floats, Ints]] = field(default_factory=dict[int, tuple[Floats, Ints]])

    def act(self, t: int, records: Sequence[Stream], inbox: Sequence[Message]) -> Action:
        """Listen, book, assign, tell."""
        before, held = {number: len(e.log) for number, e in self.book.items()}, dict(self.passages.holder)
        for m in inbox:
            self._hear(t, m)
        notes = self._take(t)
        self._expire(t)
        self._send(t)
        for number, e in self.book.items():
            notes += [self._told(e, *line) for line in e.log[before.get(number, 0) :]]
        for k, robot in self.passages.holder.items():
            notes += [f"passage {k} is {robot}'s"] if held.get(k) != robot else []
        return Action(command=np.zeros(0), messages=tuple(self._words(t)), note="; ".join(notes))

    @staticmethod
    def _told(e: Entry, t: int, state: AlertState, robot: str) -> str:
        who = f" ({robot}, {e.way:.0f} m)" if state is AlertState.ASSIGNED else f" ({robot})" if robot else ""
        return f"alert {e.alert.number}: {state.value}{who}"

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
        returned = e.returned if state.ended else (*e.returned, (t, e.robot, how.value))
        self.book[e.alert.number] = e.became(t, state, robot, order=None, tried=tried, returned=returned)

    def _take(self, t: int) -> list[str]:
        """Book what has come; what to say about it."""
        news = self.feed.due(t)
        notes = [*news.notes, *news.faults]
        self.faults += len(news.faults)
        for alert in news.raised:
            twin = next((e for e in self.book.values() if self._repeats(e, alert)), None)
            state = AlertState.WAITING if twin is None else AlertState.DUPLICATE
            known = alert.number in self.book or alert.number < 0
            number = max(self.book, default=0) + 1 if known else alert.number
            entry = Entry(replace(alert, number=number), twin=-1 if twin is None else twin.alert.number)
            self.book[number] = entry.became(t, state)
            notes.append(f"alert {number} at ({alert.p[0]:.1f}, {alert.p[1]:.1f}) m from {alert.source or 'somebody'}")
        for number in news.cancelled:
            entry = self.book.get(number)
            if entry is None or entry.state.ended:
                notes.append(f"alert {number} is called off, but {'there is none' if entry is None else 'has ended'}")
            else:
                self.book[number] = entry.became(t, AlertState.CANCELLED, entry.robot, order=None)
        return notes

    def _repeats(self, e: Entry, alert: Alert) -> bool:
        gap = float(np.hypot(*(e.alert.p - alert.p)))
        return not e.state.ended and e.state is not AlertState.DUPLICATE and gap < self.same

    def _expire(self, t: int) -> None:
        """Alerts for which nobody is under way in time, and robots that have gone silent."""
        for number, e in self.book.items():
            late = t - e.alert.t > e.alert.patience_s * 1e9
            if e.state in (AlertState.ASSIGNED, AlertState.ON_SCENE) and not self._fresh(t, e.robot):
                returned = (*e.returned, (t, e.robot, SILENT))
                self.book[number] = e = e.became(t, AlertState.WAITING, order=None, returned=returned)
            if e.state is AlertState.WAITING and late:
                self.book[number] = e.became(t, AlertState.TIMED_OUT)
        for robot in self._heard:
            if not self._fresh(t, robot):
                self.passages = self.passages.lost(robot)
        for passage, robot in dict(self.passages.holder).items():
            if robot in self._heard and t - self._heard[robot].t > self.lease_s * 1e9:
                self.passages = self.passages.left(passage, robot)

    def _fresh(self, t: int, robot: str) -> bool:
        return robot in self._heard and t - self._heard[robot].t < SILENT_S * 1e9

    def _send(self, t: int) -> None:
        """The free robots to the waiting alerts, by the least sum of ways."""
        busy = {e.robot for e in self.book.values() if e.state in (AlertState.ASSIGNED, AlertState.ON_SCENE)}
        known = [s for name, s in sorted(self._heard.items()) if self._fresh(t, name)]
        free = [
            s for s in known if s.robot not in busy and s.order < 0 and s.duty in (Duty.PATROL, Duty.STAND)
        ]  # fmt: skip
        waiting = [e for _, e in sorted(self.book.items()) if e.state is AlertState.WAITING]
        if not waiting or not known:
            return
        costs, views = self._ways(free, waiting)
        for j, e in enumerate(waiting):
            lost = {s.robot for i, s in enumerate(free) if not np.isfinite(costs[i, j])}
            waiting[j] = self.book[e.alert.number] = e = replace(e, tried=e.tried | lost)
            if {s.robot for s in known} <= e.tried:
                self.book[e.alert.number] = e.became(t, AlertState.UNREACHABLE)
        for i, j in assign(costs):
            self._order(t, free[i], waiting[j], float(costs[i, j]), views[i, j])

    def _ways(self, free: Sequence[Status], waiting: Sequence[Entry]) -> tuple[Floats, Floats]:
        """(robots, alerts) what it costs to come to a place with a view, and (robots, alerts, 3) the place."""
        costs, views = np.full((len(free), len(waiting)), np.inf), np.zeros((len(free), len(waiting), 3))
        looks = [self._view(e.alert) for e in waiting]
        first = np.cumsum([0, *(len(places) for places, _ in looks)])
        for i, s in enumerate(free):
            if all(s.robot in e.tried for e in waiting):
                continue
            every = self.reach.costs(self.costmap, s.pose[:2], np.vstack([places[:, :2] for places, _ in looks]))
            for j, (places, grades) in enumerate(looks):
                way = every[first[j] : first[j + 1]]
                if s.robot in waiting[j].tried or not np.isfinite(way).any():
                    continue
                best = np.flatnonzero(grades == grades[np.isfinite(way)].min())
                k = int(best[way[best].argmin()])
                costs[i, j], views[i, j] = way[k], places[k]
        return costs, views

    def _view(self, alert: Alert) -> tuple[Floats, Ints]:
        if alert.number not in self._views:
            look = viewpoints(self.costmap, alert.p, near=self.near, far=self.far, sigma=alert.sigma)
            self._views[alert.number] = look
        return self._views[alert.number]

    def _order(self, t: int, s: Status, e: Entry, cost: float, view: Floats) -> None:
        """Send a robot to an alert; to go now costs what the planner finds, which cuts the corners of the search."""
        path = self.planner.plan(self.costmap, s.pose[:2], view[:2])
        number = len(self._orders)
        self._orders[number] = e.alert.number
        until = e.alert.t * 1e-9 + e.alert.patience_s
        order = Order(number=number, alert=e.alert.number, view=view, hold_s=e.alert.hold_s, until_s=until)
        told = {"cost": path.cost, "way": path.length} if path.found else {"cost": cost, "way": cost}
        self.book[e.alert.number] = e.became(t, AlertState.ASSIGNED, s.robot, order=order, view=view, **told)

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
