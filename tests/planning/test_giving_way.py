"""What a robot still does when its way is taken: each named answer, reached; and out of the way of whoever comes."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from bases import DIFFERENTIAL, MECANUM
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.data.driving import DriveLimits, LocalOutcome, LocalPlan, Situation
from outrider.data.footprint import Footprint
from outrider.data.surroundings import Surroundings
from outrider.planning.local.fallback import PATIENCE, Blocked, answer
from outrider.planning.local.yielding import Yielding, YieldSettings
from outrider.safety.clearance import around, body_of
from outrider.safety.stopping import moved
from outrider.typing import Floats

DISC = Footprint.circle(0.4)
PERIOD = 0.1


def wall(x: float, y0: float = -2.0, y1: float = 2.0) -> Floats:
    y = np.linspace(y0, y1, 41)
    return np.column_stack([np.full(41, x), y, np.full(41, 0.05), np.zeros((41, 2))])


def asked(discs: Floats, twist: Floats, speed: float = 0.8, blocked: int = 0, limits: DriveLimits = DIFFERENTIAL):
    """The answer to a straight band at `speed` whose planner has found no way around the discs."""
    t = np.linspace(0.0, 4.0, 41)
    band = np.column_stack([speed * t, np.zeros(41), np.zeros(41), t])
    now = Situation(time=1.0, pose=np.zeros(3), twist=twist, goal=np.array([9.0, 0.0, 0.0]),
                    surroundings=Surroundings(discs=discs))  # fmt: skip
    a = around(now.surroundings, 4.0)
    from outrider.planning.local.teb import Band, _conflict
    from outrider.safety.clearance import clash

    hit = clash(band, body_of(DISC), a)
    conflict = None if hit.free else _conflict(Band(band, hit, 4.0, 0))
    plan = LocalPlan(outcome=LocalOutcome.DRIVE, time=1.0, twist=np.array([speed, 0.0, 0.0]), band=band,
                     conflict=conflict)  # fmt: skip
    last = LocalPlan(outcome=LocalOutcome.STOP, time=0.9, twist=np.zeros(3), blocked=blocked)
    return answer(Blocked(limits, PERIOD, body_of(DISC), a), now, plan, last)


FAST, REST = np.array([0.8, 0.0, 0.0]), np.zeros(3)


@pytest.mark.parametrize(
    ("discs", "twist", "blocked", "outcome"),
    [
        (np.empty((0, 5)), FAST, 0, LocalOutcome.DRIVE),
        (wall(0.9), 0.6 * FAST, 0, LocalOutcome.SLOW),
        (wall(0.6), FAST, 0, LocalOutcome.STOP),
        (wall(0.46), REST, 0, LocalOutcome.STOP),
        (wall(0.46), REST, PATIENCE, LocalOutcome.BACK_OUT),
        (np.vstack([wall(0.46), wall(-0.5)]), REST, PATIENCE, LocalOutcome.REPLAN),
    ],
)
def test_every_fallback_is_reached_and_says_what_stands_there(
    discs: Floats, twist: Floats, blocked: int, outcome: LocalOutcome
) -> None:
    told = asked(discs, twist, blocked=blocked)
    assert told.outcome is outcome
    assert (told.conflict is None) is (outcome is LocalOutcome.DRIVE)
    if outcome is LocalOutcome.SLOW:
        assert 0.0 < told.twist[0] < 0.8
    if outcome is LocalOutcome.STOP:
        assert told.twist[0] == pytest.approx(max(twist[0] - 0.06, 0.0))
    if outcome is LocalOutcome.BACK_OUT:
        assert told.twist[0] < 0.0
    if outcome is LocalOutcome.REPLAN:
        assert not told.twist.any()
    if told.conflict is not None:
        assert "touches obstacle" in told.reason


@dataclass
class Straight:
    """A planner that drives straight on, whoever comes."""

    limits: DriveLimits
    speed: float

    def plan(self, now: Situation, last: LocalPlan | None = None) -> LocalPlan:
        t = np.linspace(0.0, 5.0, 51)
        u = np.array([self.speed, 0.0, 0.0])
        band = np.column_stack([moved(now.pose, u, t), t])
        return LocalPlan(outcome=LocalOutcome.DRIVE, time=now.time, twist=u, band=band)


def met(limits: DriveLimits, speed: float, man: Floats, seconds: float = 8.0) -> tuple[float, list[LocalPlan], Floats]:
    """The least room to a disc (5,) that goes on as it does, of a base that does as told; answers; the last pose."""
    planner = Yielding(planner=Straight(limits, speed), footprint=DISC)
    pose, twist, room, plans, last = np.zeros(3), np.array([speed, 0.0, 0.0]), np.inf, [], None
    for k in range(round(seconds / PERIOD)):
        there = man.copy()
        there[:2] += man[3:] * PERIOD * k
        now = Situation(time=PERIOD * k, pose=pose, twist=twist, goal=np.array([20.0, 0.0, 0.0]),
                        surroundings=Surroundings(discs=there[None]))  # fmt: skip
        last = planner.plan(now, last)
        plans.append(last)
        pose, twist = moved(pose, last.twist, np.array([PERIOD]))[0], last.twist
        room = min(room, float(np.hypot(*(there[:2] - pose[:2]))) - man[2] - 0.4)
    return room, plans, pose


@pytest.mark.parametrize("name", ["differential", "mecanum"])
@given(ahead=st.floats(3.0, 5.0), late=st.floats(-1.0, 1.0), left=st.booleans())
@settings(max_examples=12)
def test_who_crosses_is_not_touched(name: str, ahead: float, late: float, left: bool) -> None:
    """At 1.4 m/s, at the place where the robot would be within a second."""
    limits = {"differential": DIFFERENTIAL, "mecanum": MECANUM}[name]
    side, t = (1.0 if left else -1.0), ahead / 0.8 + late
    room, plans, pose = met(limits, 0.8, np.array([ahead, side * 1.4 * t, 0.3, 0.0, -side * 1.4]))
    assert room > 0.0
    assert (
        plans[-1].outcome is LocalOutcome.DRIVE and plans[-1].twist[0] == 0.8 and pose[0] > 0.0
    )  # and then it goes on


@pytest.mark.parametrize("aside", [-0.5, 0.0, 0.2])
def test_a_robot_that_stands_goes_out_of_the_way_of_who_comes(aside: float) -> None:
    room, plans, _ = met(MECANUM, 0.0, np.array([7.0, aside, 0.3, -1.4, 0.0]))
    assert room > 0.0
    assert LocalOutcome.GIVE_WAY in {p.outcome for p in plans}
    assert "somebody comes" in next(p for p in plans if p.outcome is LocalOutcome.GIVE_WAY).reason


@dataclass
class Home:
    """A planner that drives to its goal straight ahead and stops there, whoever comes."""

    limits: DriveLimits

    def plan(self, now: Situation, last: LocalPlan | None = None) -> LocalPlan:
        gap = now.goal[:2] - now.pose[:2]
        far = float(np.hypot(*gap))
        speed = min(0.8, float(np.sqrt(2.0 * 0.5 * far)), 10.0 * far)
        u = np.array([*(speed * gap / max(far, 1e-9)), 0.0])
        t = np.linspace(0.0, max(far / max(speed, 0.1), 0.1), 21)
        band = np.column_stack([now.pose[0] + gap[0] * t / t[-1], now.pose[1] + gap[1] * t / t[-1], 0.0 * t, t])
        return LocalPlan(outcome=LocalOutcome.DRIVE, time=now.time, twist=u, band=band)


@pytest.mark.compiled
@pytest.mark.parametrize(("behind", "aside"), [(3.0, -0.5), (3.6, -0.3), (4.2, 0.1), (4.8, 0.4)])
def test_who_catches_up_at_the_goal_is_let_past_beside_it(behind: float, aside: float) -> None:
    """He is faster, so that running on before him leads nowhere: aside by what he needs, and back."""
    planner = Yielding(planner=Home(MECANUM), footprint=DISC)
    pose, twist, goal, last = np.zeros(3), np.array([0.8, 0.0, 0.0]), np.array([1.0, 0.0, 0.0]), None
    room, past, given = np.inf, 0.0, 0
    for k in range(70):
        man = np.array([0.14 * k - behind, aside, 0.3, 1.4, 0.0])
        now = Situation(time=0.1 * k, pose=pose, twist=twist, goal=goal, surroundings=Surroundings(discs=man[None]))
        last = planner.plan(now, last)
        given += last.outcome is LocalOutcome.GIVE_WAY
        pose, twist = moved(pose, last.twist, np.array([PERIOD]))[0], last.twist
        room = min(room, float(np.hypot(*(man[:2] - pose[:2]))) - 0.7)
        past = max(past, float(pose[0]) - 1.0)
    assert given and room > 0.1
    assert past < 0.05
    assert np.hypot(*(pose[:2] - goal[:2])) < 0.1


@given(
    people=st.lists(
        st.tuples(st.floats(-6, 6), st.floats(-6, 6), st.floats(-2, 2), st.floats(-2, 2)), min_size=1, max_size=6
    ),
    u=st.floats(-0.3, 0.8),
)
@settings(max_examples=40)
def test_giving_way_keeps_the_limits_of_the_base(people: list[tuple[float, ...]], u: float) -> None:
    discs = np.array([[x, y, 0.3, vx, vy] for x, y, vx, vy in people])
    now = Situation(time=0.0, pose=np.zeros(3), twist=np.array([u, 0.0, 0.0]), goal=np.array([9.0, 0.0, 0.0]),
                    surroundings=Surroundings(discs=discs))  # fmt: skip
    inner = Straight(DIFFERENTIAL, 0.8)
    told = Yielding(planner=inner, footprint=DISC).plan(now)
    assert told.outcome in (LocalOutcome.DRIVE, LocalOutcome.GIVE_WAY)
    assert np.isfinite(told.twist).all() and DIFFERENTIAL.excess(told.twist) <= 1.0 + 1e-9
    if told.outcome is LocalOutcome.GIVE_WAY:
        assert abs(told.twist[0] - u) <= 0.06 + 1e-9 and abs(told.twist[2]) <= 0.15 + 1e-9
    still = replace(now, surroundings=Surroundings(discs=discs * [1, 1, 1, 0, 0]))
    assert Yielding(planner=inner, footprint=DISC, settings=YieldSettings()).plan(still) is not None
    assert Yielding(planner=inner, footprint=DISC).plan(still).outcome is LocalOutcome.DRIVE
