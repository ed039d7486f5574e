"""In doubt a robot stops; and what a patrol robot makes of orders, passages and its battery."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, cast

import numpy as np
import pytest

from outrider.data import Kind, Stream, stream
from outrider.data.agents import Message
from outrider.data.driving import DriveLimits, LocalOutcome, LocalPlan, Situation, Steering
from outrider.data.footprint import Footprint
from outrider.data.grid import Costmap, Grid
from outrider.data.routes import Path, PathOutcome
from outrider.data.scan import Scan
from outrider.errors import ConfigError
from outrider.guidance.patrol import Duty, Ended, Order, Rules
from outrider.mapping.inflation import Inflation
from outrider.team.driver import Answer, Drive, Driver, DriverSettings
from outrider.team.ground import Ground
from outrider.team.navigator import Fused
from outrider.team.patrol import Battery, Patrol
from outrider.team.words import ASK, CANCEL, GRANT, STATUS, Status, number_message, number_of, order_message
from outrider.typing import Floats

S = 1_000_000_000
AHEAD = np.array([0.5, 0.0, 0.1])


class Straight:
    def plan(self, costmap: Costmap, start: Floats, goal: Floats, *, budget_s: float = np.inf) -> Path:
        if goal[0] > 9.0:
            return Path(outcome=PathOutcome.NO_WAY)
        return Path(outcome=PathOutcome.FOUND, points=np.vstack([start, goal]), length=float(np.hypot(*(goal - start))))


class Ahead:
    limits = DriveLimits(steering=Steering.DIFFERENTIAL, forward=1.0, turn=1.0, acceleration=1.0, turn_acceleration=1.0)

    def plan(self, now: Situation, last: LocalPlan | None = None) -> LocalPlan:
        return LocalPlan(outcome=LocalOutcome.DRIVE, time=now.time, twist=AHEAD.copy())


def driver(**settings: float) -> Driver:
    ground = Grid(cells=np.zeros((40, 40), np.uint8), resolution=0.5, origin=np.array([-10.0, -10.0]))
    return Driver(
        ground=ground, footprint=Footprint.circle(0.3), planner=Straight(), local=Ahead(),
        inflation=Inflation(inscribed=0.3), settings=replace(DriverSettings(), **settings),
    )  # fmt: skip


def fused(**changes: Any) -> Fused:
    here = Fused(
        t=0, p=np.zeros(3), v=np.array([0.5, 0.0, 0.0]), q=np.array([0.0, 0.0, 0.0, 1.0]), heading=0.0, w=0.0,
        P=0.01 * np.eye(3),
    )  # fmt: skip
    return replace(here, **changes)


def scan(ranges: float = np.inf) -> Scan:
    return Scan(pose=np.zeros(3), bearings=np.linspace(-3.0, 3.0, 8), ranges=np.full(8, ranges), reach=10.0)


@pytest.mark.parametrize(
    ("here", "scans", "says"),
    [
        ({"p": np.array([np.nan, 0.0, 0.0])}, [scan()], "not finite"),
        ({"heading": np.inf}, [scan()], "not finite"),
        ({"v": np.array([np.nan, 0.0, 0.0])}, [scan()], "not finite"),
        ({"w": np.nan}, [scan()], "not finite"),
        ({"P": np.full((3, 3), np.nan)}, [scan()], "not finite"),
        ({"P": 4.0 * np.eye(3)}, [scan()], "known to 2.0 m only"),
        ({}, [scan(np.nan)], "scan"),
        ({}, [], "no scan for 1.5 s"),
    ],
)
def test_who_is_blind_stops_and_says_why(here: dict[str, Any], scans: list[Scan], says: str) -> None:
    d = driver()
    d.go(np.array([5.0, 0.0, np.nan]))
    before = d.step(10.0, fused(), [scan()])
    assert before.state is Drive.UNDER_WAY and before.twist.tolist() == AHEAD.tolist()
    after = d.step(11.5, fused(**here), scans)
    assert after.state is Drive.BLIND and says in after.reason and after.twist.tolist() == [0.0, 0.0, 0.0]
    assert d.step(11.6, fused(), [scan()]).state is Drive.UNDER_WAY


def test_a_goal_out_of_reach_is_waited_for_and_given_up() -> None:
    d = driver(patience_s=3.0)
    d.go(np.array([9.5, 0.0, 0.0]))
    told = [d.step(t, fused(), [scan()]) for t in (0.0, 2.0, 3.5)]
    assert [a.state for a in told] == [Drive.WAITING, Drive.WAITING, Drive.UNREACHABLE]
    assert told[2].reason == PathOutcome.NO_WAY.value and not told[2].twist.any()
    d.go(None)
    assert d.step(4.0, fused(), [scan()]).state is Drive.IDLE


LIMITS = DriveLimits(
    steering=Steering.DIFFERENTIAL, forward=1.0, turn=1.0, acceleration=0.5, turn_acceleration=1.0
)  # fmt: skip


@dataclass
class Navigation:
    robot: str = "robot"

    def record(self, now: Fused) -> Stream:
        return stream("estimate", Kind.ESTIMATE, np.array([now.t]), np.zeros((1, 10)))


@dataclass
class Body:
    """Stands for `Ground`: says what the test wants the driver to say."""

    says: Answer = field(default_factory=lambda: Answer(state=Drive.UNDER_WAY, twist=AHEAD.copy()))
    here: Fused = field(default_factory=fused)
    goals: list[Floats] = field(default_factory=list)
    navigator: Navigation = field(default_factory=Navigation)
    limits: DriveLimits = field(default_factory=lambda: LIMITS)

    @property
    def driver(self) -> "Body":
        return self

    def go(self, goal: Floats) -> None:
        self.goals.append(goal)

    def aim(self, t: int, records: Sequence[Stream], inbox: Sequence[Message]) -> tuple[Fused, Answer]:
        return replace(self.here, t=t), self.says

    def give(self, t: int, here: Fused, answer: Answer) -> Answer:
        return answer

    def gives_way(self, t: int, here: Fused, order: int) -> str:
        return ""


STOPS = np.array([[1.0, 0.0, np.nan], [2.0, 0.0, np.nan]])
DOCK = np.array([-1.0, 0.0, 0.0])


def patrol(body: Body, **more: Any) -> Patrol:
    return Patrol(name="robot", body=cast("Ground", body), stops=STOPS, dock=DOCK, **more)


def order(number: int = 0) -> Message:
    told = Order(number=number, alert=7, view=np.array([3.0, 3.0, 0.5]), hold_s=1.0, until_s=100.0)
    return order_message("station", "robot", 0, told)


def said(messages: Sequence[Message]) -> Status:
    (status,) = (Status.of(m) for m in messages if m.topic == STATUS)
    return status


def test_an_order_said_again_is_one_order_and_its_end_is_said_again_too() -> None:
    body = Body()
    robot = patrol(body)
    for k in range(3):  # the station repeats it until it hears
        robot.act(k * S, [], [order()])
    assert robot.mission.duty is Duty.RESPOND and body.goals[-1].tolist() == [3.0, 3.0, 0.5]
    body.says = Answer(state=Drive.ARRIVED)
    robot.act(3 * S, [], [])
    assert said(robot.act(4 * S, [], []).messages).duty is Duty.OBSERVE
    ends = [said(robot.act(t * S, [], [order()] if t < 8 else []).messages).ended for t in range(5, 18)]
    assert all(e == ((0, Ended.OBSERVED),) for e in ends[:9]) and ends[-1] == ()
    robot.act(20 * S, [], [order(1)])
    robot.act(21 * S, [], [number_message(CANCEL, "station", "robot", 0, 1)])
    assert robot.mission.order is None and said(robot.act(22 * S, [], []).messages).ended == ((1, Ended.CANCELLED),)


def test_it_waits_before_a_passage_until_it_is_granted_and_asks_no_more_behind_it() -> None:
    def asks(messages: Sequence[Message]) -> list[int]:
        return [number_of(m) for m in messages if m.topic == ASK]

    gate = np.array([[1.0, -1.0], [3.0, -1.0], [3.0, 1.0], [1.0, 1.0]])
    way = Path(outcome=PathOutcome.FOUND, points=np.array([[-8.0, 0.0], [0.0, 0.0], [5.0, 0.0]]), length=13.0)
    body = Body(says=Answer(state=Drive.UNDER_WAY, twist=AHEAD.copy(), path=way))
    robot = patrol(body, passages=(gate,))
    for k, (east, granted, waits, wanted) in enumerate(
        [(-7.5, False, False, -1), (-4.0, False, False, 0), (-2.0, False, True, 0), (-2.0, True, False, 0),
         (-1.5, False, False, 0), (-1.0, False, True, 0), (0.2, True, False, 0),
         (2.0, True, False, 0), (3.5, True, False, -1), (0.2, False, True, 0)]
    ):  # fmt: skip
        body.here = fused(p=np.array([east, 0.0, 0.0]))
        grant = number_message(GRANT, "station", "robot", k * S, 0)
        action = robot.act(k * S, [], [grant] if granted else [])
        assert action.command is not None
        assert (not action.command.any()) is waits, east
        assert asks(action.messages) == [wanted], east


def test_a_battery_runs_down_sends_it_to_the_dock_and_is_charged_there() -> None:
    b = Battery(standing_h=10.0, driving_h=2.0, charging_h=1.0)
    assert b.after(1.0, 3600.0, moving=True, docked=False) == 0.5
    assert b.after(1.0, 3600.0, moving=False, docked=False) == pytest.approx(0.9)
    assert b.after(0.5, 1800.0, moving=True, docked=True) == 1.0 and b.after(0.1, 1e6, moving=True, docked=False) == 0.0
    with pytest.raises(ConfigError, match="battery"):
        Battery(driving_h=0.0)
    body = Body()
    robot = patrol(body, rules=Rules(low=0.2, full=0.9), share=0.19, battery=Battery(charging_h=0.001))
    robot.act(0, [], [])
    assert robot.mission.duty is Duty.CHARGE and body.goals[-1] is DOCK and robot.share < 0.19
    body.says = Answer(state=Drive.ARRIVED)
    for k in range(40):
        robot.act((k + 1) * S // 10, [], [])
    assert robot.share > 0.9 and robot.mission.duty is Duty.PATROL
