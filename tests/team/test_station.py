"""The station's book: every alert comes to a named end, whatever robots and radio do."""

from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.data.agents import Message
from outrider.data.alerts import Alert, AlertState, News
from outrider.data.grid import LETHAL, Costmap
from outrider.data.routes import Path, PathOutcome
from outrider.guidance.patrol import Duty, Ended
from outrider.planning.astar import AStar
from outrider.planning.reach import Reach
from outrider.planning.traversal import Traversal
from outrider.planning.view import viewpoints
from outrider.team.station import SILENT_S, Station
from outrider.team.words import ASK, CANCEL, GRANT, ORDER, Status, number_message, number_of, order_of
from outrider.typing import Floats

S = 1_000_000_000


@dataclass
class Straight:
    """A planner that knows no obstacles, but no way to the west."""

    def plan(self, costmap: Costmap, start: Floats, goal: Floats, *, budget_s: float = np.inf) -> Path:
        if goal[0] < 0.0:
            return Path(outcome=PathOutcome.NO_WAY)
        return Path(outcome=PathOutcome.FOUND, points=np.vstack([start, goal]), length=float(np.hypot(*(goal - start))))

    def costs(self, costmap: Costmap, start: Floats, places: Floats) -> Floats:
        return np.where(places[:, 0] < 0.0, np.inf, np.hypot(*(places - start).T))


@dataclass
class Schedule:
    alerts: list[Alert]
    calls_off: list[tuple[int, int]] = field(default_factory=list)
    told: int = -1

    def due(self, t: int) -> News:
        raised = tuple(a for a in self.alerts if self.told < a.t <= t)
        off = tuple(n for when, n in self.calls_off if self.told < when <= t)
        self.told = t
        return News(raised=raised, cancelled=off)


def ground(taken: bool = False) -> Costmap:
    cells = np.zeros((400, 800), np.uint8)
    if taken:
        cells[:, 600:] = LETHAL
    return Costmap(cells=cells, resolution=0.1, origin=np.array([-40.0, -20.0]))


def alert(number: int, t: float = 0.0, p: tuple[float, float] = (10.0, 0.0), **more: float) -> Alert:
    return Alert(**({"number": number, "t": round(t * S), "p": np.array(p), "sigma": 0.0} | more))


def said(robot: str, t: float, p: tuple[float, float], duty: Duty = Duty.PATROL, order: int = -1, **more) -> Message:
    ended = tuple(more.get("ended", ()))
    status = Status(
        robot=robot, t=round(t * S), pose=np.array([*p, 0.0]), velocity=np.zeros(2), duty=duty, order=order,
        battery=1.0, ended=ended,
    )  # fmt: skip
    return status.message()


def station(*alerts: Alert, **more) -> Station:
    ways = Straight()
    return Station(
        name="station", feed=Schedule(list(alerts), **more), costmap=ground(), planner=ways, reach=ways, lease_s=20.0
    )


def at(s: Station, t: float, *messages: Message) -> list[Message]:
    return list(s.act(round(t * S), (), messages).messages)


def states(s: Station) -> list[AlertState]:
    return [state for _, state, _ in s.book[1].log]


def test_the_nearest_robot_is_sent_until_it_goes_and_the_alert_is_observed() -> None:
    s = station(alert(1))
    near, far = said("near", 0.0, (6.0, 9.0)), said("far", 0.0, (-20.0, 0.0))
    for t in (0.5, 1.0):  # said again as long as the robot does not follow
        (message,) = at(s, t, *((near, far) if t == 0.5 else ()))
        assert (message.topic, message.receiver, order_of(message).alert) == (ORDER, "near", 1)
    order = order_of(message)
    assert 2.0 <= np.hypot(*(order.view[:2] - [10.0, 0.0])) <= 6.0
    assert order.view[2] == pytest.approx(np.arctan2(-order.view[1], 10.0 - order.view[0]))
    assert at(s, 1.5, said("near", 1.5, (6, 9), Duty.RESPOND, order.number)) == []
    at(s, 9.0, said("near", 9.0, (8, 2), Duty.OBSERVE, order.number))
    done = [(order.number, Ended.OBSERVED)]
    at(s, 12.0, said("near", 12.0, (8, 2), ended=done))
    at(s, 12.5, said("near", 12.5, (8, 2), ended=done))  # repeated: booked once
    assert states(s) == [AlertState.WAITING, AlertState.ASSIGNED, AlertState.ON_SCENE, AlertState.OBSERVED]
    assert s.open == 0


def test_two_alerts_go_to_two_robots_by_the_least_sum() -> None:
    s = station(alert(1, p=(10.0, 0.0)), alert(2, p=(20.0, 0.0)))
    out = at(s, 0.5, said("a", 0.0, (14.0, 5.0)), said("b", 0.0, (30.0, 5.0)))
    assert {order_of(m).alert: m.receiver for m in out} == {1: "a", 2: "b"}


@pytest.mark.parametrize(
    ("how", "then"),
    [
        (Ended.CANCELLED, AlertState.CANCELLED),
        (Ended.TIMED_OUT, AlertState.TIMED_OUT),
        (Ended.UNREACHABLE, AlertState.UNREACHABLE),  # by the only robot there is
        (Ended.BATTERY, AlertState.ASSIGNED),  # and again to whoever is free
        (Ended.BLIND, AlertState.ASSIGNED),
    ],
)
def test_what_becomes_of_an_alert_when_a_response_ends(how: Ended, then: AlertState) -> None:
    s = station(alert(1))
    (message,) = at(s, 0.5, said("a", 0.0, (6.0, 9.0)))
    at(s, 2.0, said("a", 2.0, (6.0, 9.0), ended=[(order_of(message).number, how)]))
    at(s, 2.5)
    assert s.book[1].state is then
    back = [(robot, why) for _, robot, why in s.book[1].returned]
    assert back == ([] if how in (Ended.CANCELLED, Ended.TIMED_OUT) else [("a", how.value)])


def test_a_silent_robot_is_replaced_and_called_off_when_it_is_back() -> None:
    s = station(alert(1))
    (first,) = at(s, 0.5, said("a", 0.5, (6.0, 9.0)), said("b", 0.5, (-20.0, 0.0)))
    number = order_of(first).number
    at(s, 1.0, said("a", 1.0, (6.0, 9.0), Duty.RESPOND, number), said("b", 1.0, (-20.0, 0.0)))
    late = 2.0 + SILENT_S
    out = at(s, late, said("b", late, (-20.0, 0.0)))
    assert [m.receiver for m in out if m.topic == ORDER] == ["b"]
    back = at(s, late + 1, said("a", late + 1, (6.0, 5.0), Duty.RESPOND, number))
    assert [(m.receiver, number_of(m)) for m in back if m.topic == CANCEL] == [("a", number)]


def test_alerts_that_nobody_can_serve_end_too() -> None:
    s = station(alert(1, p=(-30.0, 0.0)))  # no way to the west
    at(s, 0.5, said("a", 0.5, (6.0, 9.0)))
    assert s.book[1].state is AlertState.UNREACHABLE
    s = station(alert(1, patience_s=3.0))  # nobody is there
    for t in (1.0, 2.0, 4.0):
        at(s, t)
    assert s.book[1].state is AlertState.TIMED_OUT
    s = station(alert(1), calls_off=[(5 * S, 1)])
    (message,) = at(s, 0.5, said("a", 0.5, (6.0, 9.0)))
    out = at(s, 5.5, said("a", 5.5, (6.0, 9.0), Duty.RESPOND, order_of(message).number))
    assert s.book[1].state is AlertState.CANCELLED and [m.topic for m in out] == [CANCEL]


def test_an_alert_said_twice_is_one_and_a_number_used_twice_is_another() -> None:
    s = station(alert(1), alert(2, p=(10.2, 0.0)), alert(1, p=(0.0, 12.0)))
    at(s, 0.5)
    assert [e.state for _, e in sorted(s.book.items())] == [
        AlertState.WAITING,
        AlertState.DUPLICATE,
        AlertState.WAITING,
    ]
    assert sorted(s.book) == [1, 2, 3]


def test_passages_are_granted_one_after_the_other() -> None:
    def granted(out: list[Message]) -> list[tuple[str, int]]:
        return [(m.receiver, number_of(m)) for m in out if m.topic == GRANT]

    def asks(robot: str, k: int) -> Message:
        return number_message(ASK, robot, "station", 0, k)

    s = station()
    assert granted(at(s, 0.5, asks("a", 0), asks("b", 0))) == [("a", 0)]
    assert granted(at(s, 1.0, asks("a", 0), asks("b", 0))) == [("a", 0)]
    assert granted(at(s, 1.5, asks("a", -1), asks("b", 0))) == [("b", 0)]


def test_a_passage_of_a_robot_that_died_is_free_again_and_dead_robots_are_in_no_queue() -> None:
    def granted(out: list[Message]) -> list[tuple[str, int]]:
        return [(m.receiver, number_of(m)) for m in out if m.topic == GRANT]

    def asks(robot: str, t: float) -> list[Message]:
        return [said(robot, t, (6.0, 9.0)), number_message(ASK, robot, "station", round(t * S), 0)]

    s = station()
    assert granted(at(s, 0.5, *asks("a", 0.5), *asks("b", 0.5), *asks("c", 0.5))) == [("a", 0)]
    assert granted(at(s, 19.0, *asks("c", 19.0))) == [("a", 0)]  # it may still be in there
    assert granted(at(s, 21.0, *asks("c", 21.0))) == [("c", 0)]  # b has died as well: it is not the next


def test_a_reservation_never_goes_round_in_a_circle() -> None:
    s = station()
    at(s, 0.5, number_message(ASK, "a", "station", 0, 0), number_message(ASK, "b", "station", 0, 1))
    assert s.passages.holder == {"0": "a", "1": "b"}
    at(s, 1.0, number_message(ASK, "a", "station", 0, 1))  # out of 0, wants 1
    assert s.passages.holder == {"1": "b"} and s.passages.queue["1"] == ("a",)
    at(s, 1.5, number_message(ASK, "b", "station", 0, 0))
    assert s.passages.holder == {"1": "a", "0": "b"}


def test_what_the_feed_could_not_use_is_said_and_counted_and_so_are_vain_cancellations() -> None:
    class Broken:
        def due(self, t: int) -> News:
            return News(faults=("alerts.jsonl:3: unknown key", "alerts.jsonl:4: is no JSON"), cancelled=(9,))

    s = station()
    s.feed = Broken()
    note = s.act(S, (), ()).note
    assert s.faults == 2 and "alerts.jsonl:3" in note and "alert 9 is called off, but there is none" in note


def test_it_tells_what_becomes_of_an_alert_with_robot_and_way() -> None:
    s = station(alert(-1, p=(10.0, 0.0)))
    note = s.act(S // 2, (), [said("a", 0.5, (16.0, 0.0))]).note
    assert "alert 1 at (10.0, 0.0) m" in note and "alert 1: a robot is on its way (a, 0 m)" in note


@given(seed=st.integers(0, 1000), weight=st.sampled_from([0.0, 3.0]))
@settings(max_examples=15)
def test_costs_of_ways_are_those_of_an_exact_search(seed: int, weight: float) -> None:
    rng = np.random.default_rng(seed)
    cells = np.where(rng.random((30, 40)) < 0.25, LETHAL, rng.integers(0, 200, (30, 40))).astype(np.uint8)
    costmap = Costmap(cells=cells, resolution=0.5, origin=np.array([-3.0, 2.0]))
    free = np.argwhere(cells < LETHAL)
    start, *goals = costmap.centre_of(free[rng.choice(len(free), 6, replace=False)])
    rules = Traversal(weight=weight)
    reach = Reach(traversal=rules)
    for _ in range(2):  # its memory is used again
        costs = reach.costs(costmap, start, np.array([*goals, [1e4, 0.0]]))
    paths = [AStar(traversal=rules).plan(costmap, start, g) for g in goals]
    assert costs[:-1].tolist() == pytest.approx([p.cost if p.found else np.inf for p in paths], rel=1e-9)
    assert costs[-1] == np.inf


def test_a_robot_beside_the_map_is_taken_to_be_where_it_may_be() -> None:
    cells = np.zeros((20, 20), np.uint8)
    cells[:, 10:] = LETHAL
    costmap, goal = Costmap(cells=cells, resolution=0.5, origin=np.zeros(2)), np.array([[0.25, 0.25]])
    assert Reach().costs(costmap, np.array([5.4, 0.25]), goal) == pytest.approx([4.5])
    assert Reach().costs(costmap, np.array([7.0, 0.25]), goal) == np.inf


def test_one_looks_from_where_nothing_is_in_between() -> None:
    places, _ = viewpoints(ground(taken=True), np.array([17.0, 0.0]), near=2.0, far=6.0)
    assert len(places) > 5 and (places[:, 0] < 20.0).all()
    wall = ground()
    wall.cells[150:250, 480:482] = LETHAL  # between 8.0 and 8.2 m east, 10 m long
    open_ground, _ = viewpoints(ground(), np.array([10.0, 0.0]), near=3.0, far=6.0)
    seen, _ = viewpoints(wall, np.array([10.0, 0.0]), near=3.0, far=6.0)
    behind = [p[(p[:, 0] < 8.0) & (np.abs(p[:, 1]) < 3.0)] for p in (open_ground, seen)]
    assert len(behind[0]) > 5 and len(behind[1]) == 0 and len(seen) > 20


def test_the_less_is_known_of_where_it_is_the_more_one_stands_off_and_the_more_must_be_in_sight() -> None:
    target = np.array([10.0, 0.0])
    for sigma, nearest in ((0.0, 2.0), (1.0, 4.0), (1.5, 5.0), (5.0, 6.0)):
        places, _ = viewpoints(ground(), target, near=2.0, far=6.0, sigma=sigma)
        assert np.hypot(*(places[:, :2] - target).T).min() == pytest.approx(nearest)
    wall = ground()
    wall.cells[200:260, 500:502] = LETHAL  # 10.0 to 10.2 m east, north of the target only
    sure, grades = viewpoints(wall, target, near=2.0, far=6.0)
    assert (grades == 0).mean() > 0.85 and sure[grades == 0, 1].max() > 5.0  # nearly everybody sees one point
    unsure, grades = viewpoints(wall, target, near=2.0, far=6.0, sigma=1.0)
    best = unsure[grades == 0]
    assert len(best) > 20 and best[:, 1].max() < 3.1  # both sides of it are seen from its open end only
    assert (grades == 2).any() and (np.diff(grades) >= 0).all()
