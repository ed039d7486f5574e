"""Faults put into a robot that drives: what comes in is lost, late or not finite, and it comes to rest, saying why."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, cast

import numpy as np
import pytest

from outrider.data import Kind, Stream, stream
from outrider.data.driving import DriveLimits, LocalOutcome, LocalPlan, LocalPlanner, Situation, Steering
from outrider.data.footprint import Footprint
from outrider.data.grid import Costmap, Grid
from outrider.data.routes import Path, PathOutcome
from outrider.mapping.inflation import Inflation
from outrider.planning.replan import Choice
from outrider.safety.stage import Reason
from outrider.team.driver import Answer, Drive, Driver
from outrider.team.ground import Ground
from outrider.team.navigator import Fused, Navigator
from outrider.typing import Floats

pytestmark = pytest.mark.compiled  # every one inflates a map, many times

S = 1_000_000_000
LIMITS = DriveLimits(
    steering=Steering.DIFFERENTIAL, forward=1.0, backward=0.5, turn=1.0, acceleration=1.0, turn_acceleration=2.0
)
FAST = np.array([0.8, 0.0, 0.0])


@dataclass
class Own:
    """Stands for a navigator: knows what the test wants it to know."""

    here: Fused
    newest: int = 0
    robot: str = "robot"

    def take(self, news: Sequence[Stream]) -> None: ...

    def now(self, t: int) -> Fused:
        return replace(self.here, t=t)


@dataclass
class Steady:
    """A planner that wants one twist, whatever happens."""

    twist: Floats
    limits: DriveLimits = LIMITS

    def plan(self, now: Situation, last: LocalPlan | None = None) -> LocalPlan:
        return LocalPlan(outcome=LocalOutcome.DRIVE, time=now.time, twist=self.twist.copy())


class Way:
    """A planner whose paths are given."""

    def __init__(self, paths: Sequence[Path]) -> None:
        self.paths, self.asked = list(paths), 0

    def plan(self, costmap: Costmap, start: Floats, goal: Floats, *, budget_s: float = np.inf) -> Path:
        self.asked += 1
        return self.paths[0] if len(self.paths) == 1 else self.paths.pop(0)


def path(*points: tuple[float, float], cost: float | None = None) -> Path:
    p = np.array(points)
    p = np.concatenate([np.linspace(a, b, 20) for a, b in pairwise(p)])
    length = float(np.hypot(*np.diff(p, axis=0).T).sum())
    return Path(outcome=PathOutcome.FOUND, points=p, length=length, cost=length if cost is None else cost)


STRAIGHT = path((0.0, 0.0), (12.0, 0.0))


def fused(**more: Any) -> Fused:
    here = Fused(
        t=0, p=np.zeros(3), v=FAST, q=np.array([0.0, 0.0, 0.0, 1.0]), heading=0.0, w=0.0, P=0.01 * np.eye(3)
    )  # fmt: skip
    return replace(here, **more)


def robot(
    local: LocalPlanner | None = None, *, way: Way | None = None, sees: bool = True, scan_s: float = 0.1
) -> Ground:
    ground = Grid(cells=np.zeros((200, 300), np.uint8), resolution=0.1, origin=np.array([-10.0, -10.0]))
    driver = Driver(
        ground=ground, footprint=Footprint.circle(0.3), planner=way or Way([STRAIGHT]), local=local or Steady(FAST),
        inflation=Inflation(inscribed=0.3), sees=sees,
    )  # fmt: skip
    driver.go(np.array([12.0, 0.0, np.nan]))
    return Ground(navigator=cast(Navigator, Own(fused())), driver=driver, scan_s=scan_s)


def lidar(t: int, ranges: Floats) -> Stream:
    n = len(ranges)
    extra = {"angle_min": -np.pi, "angle_step": 2.0 * np.pi / n, "range_max": 15.0}
    return stream("scan", Kind.SCAN, np.array([t]), ranges[None], robot="robot", frame="scan",
                  extra={k: np.array([v]) for k, v in extra.items()})  # fmt: skip


OPEN = np.full(180, np.inf)


def cycles(g: Ground, first: int, last: int, *, own: Fused | None = None, ranges: Floats | None = OPEN,
           age: int = 0) -> list[Answer]:  # fmt: skip
    """From cycle to cycle, of 0.1 s; None: no scan comes."""
    nav, out = cast(Own, g.navigator), []
    for k in range(first, last):
        t = k * S // 10
        nav.here, nav.newest = own or fused(), t - age
        out.append(g.drive(t, [] if ranges is None else [lidar(t, ranges)], [])[1])
    return out


def going() -> Ground:
    g = robot()
    answers = cycles(g, 0, 20)
    np.testing.assert_allclose(answers[-1].twist, FAST)
    assert answers[-1].state is Drive.UNDER_WAY
    return g


@pytest.mark.parametrize(
    ("fault", "reason", "says"),
    [
        ({"ranges": np.full(180, np.nan)}, Reason.BLIND, "lidar"),
        ({"ranges": None}, Reason.NO_SCAN, "no scan"),
        ({"own": fused(p=np.full(3, np.nan))}, Reason.BAD_POSE, "not finite"),
        ({"own": fused(heading=np.inf)}, Reason.BAD_POSE, "not finite"),
        ({"own": fused(P=np.full((3, 3), np.nan))}, None, "not finite"),
        ({"own": fused(P=9.0 * np.eye(3))}, None, "known to 3.0 m only"),
        ({"age": 2 * S}, Reason.NO_LOCALISATION, "estimator"),
    ],
)
def test_a_fault_ends_in_a_controlled_stop_with_its_reason(
    fault: dict[str, Any], reason: Reason | None, says: str
) -> None:
    g = going()
    answers = cycles(g, 20, 45, **fault)
    speeds = [0.8] + [float(a.twist[0]) for a in answers]
    drops = -np.diff(speeds)
    assert (drops <= 0.1 + 1e-9).all() and (drops >= -1e-9).all()  # 1 m/s^2, and never faster again
    assert speeds[-1] == 0.0 and all(np.isfinite(a.twist).all() for a in answers)
    assert says in answers[-1].reason
    if reason is not None:
        times, n = g.interventions[reason]
        assert times == 1 and n >= 7
        assert sum(f"safety: {reason.value}" in a.note for a in answers) == 1
    again = cycles(g, 45, 70)
    assert again[-1].twist[0] == pytest.approx(0.8)


@pytest.mark.parametrize("every", [1, 2, 3])
def test_scans_may_come_at_any_rate_and_two_may_be_lost(every: int) -> None:
    """Of a lidar that scans every `every` cycles: lost two in a row it drives on, lost four it stops, and says why."""
    g, answers = robot(scan_s=0.1 * every), list[Answer]()
    for k in range(0, 20 * every, every):
        answers = cycles(g, k, k + 1) + cycles(g, k + 1, k + every, ranges=None)
    assert answers[-1].twist[0] == pytest.approx(0.8) and Reason.NO_SCAN not in g.interventions
    k = 20 * every
    assert cycles(g, k, k + 2 * every, ranges=None)[-1].state is Drive.UNDER_WAY
    assert Reason.NO_SCAN not in g.interventions
    cycles(g, k + 2 * every, k + 4 * every + 2, ranges=None)
    assert g.interventions[Reason.NO_SCAN][0] == 1


def test_a_robot_that_circles_at_its_goal_gives_it_up_and_says_so() -> None:
    """Its planner drives a circle of 1 m before the goal for ever: 60 s, and what a metre takes, later."""
    g = robot(Steady(np.array([0.5, 0.0, 0.5])))
    answers = list[Answer]()
    for k in range(900):
        turned = 0.05 * k
        at = np.array([11.0 + np.sin(turned), 1.0 - np.cos(turned), 0.0])
        own = fused(p=at, v=0.5 * np.array([np.cos(turned), np.sin(turned), 0.0]), heading=turned, w=0.5)
        answers += cycles(g, k, k + 1, own=own)
    given_up = [k for k, a in enumerate(answers) if a.state is Drive.UNREACHABLE]
    assert given_up and 600 < given_up[0] < 850 and given_up == list(range(given_up[0], 900))
    assert "comes no nearer" in answers[-1].reason and not answers[-1].twist.any()
    g.driver.go(np.array([11.0, 0.0, np.nan]))
    assert cycles(g, 900, 901, own=own)[-1].state is Drive.UNDER_WAY  # another goal, another try


def test_a_command_that_is_not_finite_never_reaches_the_motors() -> None:
    wants = Steady(FAST)
    g = robot(wants)
    cycles(g, 0, 20)
    wants.twist = np.array([np.nan, 0.0, 0.0])
    answers = cycles(g, 20, 32)
    assert all(np.isfinite(a.twist).all() for a in answers) and not answers[-1].twist.any()
    assert g.interventions[Reason.BAD_COMMAND] == (1, 12)


def test_it_starts_with_its_first_scan_and_without_a_lidar_at_once() -> None:
    g = robot()
    assert not any(a.twist.any() for a in cycles(g, 0, 5, ranges=None)) and g.interventions == {}
    assert cycles(g, 5, 8)[-1].twist[0] > 0.0
    assert cycles(robot(sees=False), 0, 3, ranges=None)[-1].twist[0] > 0.0


def test_a_wall_that_nobody_planned_for_stops_it() -> None:
    """The driver wants 0.8 m/s for ever; the monitor sees the wall come nearer than it can be braked for."""
    g = going()
    x = 0.0
    for k in range(20, 80):
        angle = -np.pi + 2.0 * np.pi / 180 * np.arange(180)
        with np.errstate(divide="ignore"):
            r = np.where(np.abs(angle) < 1.2, (3.0 - x) / np.cos(angle), np.inf)
        (answer,) = cycles(g, k, k + 1, ranges=np.where(r < 15.0, r, np.inf))
        x += 0.1 * float(answer.twist[0])
    assert 2.5 < x < 2.7
    assert g.interventions[Reason.APPROACHING][0] == 1


BENT = path((0.0, 0.0), (6.0, 3.0), (12.0, 0.0))


@pytest.mark.parametrize(
    ("later", "wall", "choice", "followed"),
    [
        (path((0.0, 0.0), (12.0, 0.1), cost=11.5), False, Choice.KEPT, STRAIGHT),  # 4 % better: not worth it
        (path((0.0, 0.0), (12.0, 0.1), cost=9.0), False, Choice.BETTER, None),
        (BENT, True, Choice.BLOCKED, BENT),
        (Path(outcome=PathOutcome.NO_WAY), True, Choice.STOP, None),
    ],
)
def test_a_path_is_given_up_for_a_reason(later: Path, wall: bool, choice: Choice, followed: Path | None) -> None:
    way = Way([STRAIGHT, later])
    g = robot(way=way)
    cycles(g, 0, 5)
    assert way.asked == 1 and g.driver.choices[Choice.FIRST] == 1
    angle = -np.pi + 2.0 * np.pi / 180 * np.arange(180)
    ranges = np.where(np.abs(angle) < 0.2, 3.0, np.inf) if wall else OPEN
    answers = cycles(g, 5, 12 if wall else 25, ranges=ranges)
    assert way.asked >= 2 and g.driver.choices[choice] >= 1
    assert answers[-1].path is (followed or later)
    if choice is Choice.STOP:
        assert answers[-1].state is Drive.WAITING and PathOutcome.NO_WAY.value in answers[-1].reason


def test_a_free_path_is_not_planned_anew_every_cycle() -> None:
    way = Way([STRAIGHT])
    g = robot(way=way)
    cycles(g, 0, 61)
    assert way.asked == 4  # at 0, 2, 4 and 6 s
