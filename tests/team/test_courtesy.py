"""Of two robots that meet exactly one stops, and in time."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from outrider.guidance.patrol import Duty
from outrider.team.courtesy import NEAR, gives_way, rank
from outrider.team.words import Status

S = 1_000_000_000
WIDE, BRAKING = 0.9, 0.6


def status(robot: str, p: tuple[float, float], v: tuple[float, float], order: int = -1, t: float = 0.0) -> Status:
    return Status(
        robot=robot, t=round(t * S), pose=np.array([*p, 0.0]), velocity=np.array(v), duty=Duty.PATROL, order=order,
        battery=1.0, ended=(),
    )  # fmt: skip


def stops(me: Status, other: Status, t: float = 0.0) -> bool:
    own = rank(me.robot, me.order)
    for_whom = gives_way(round(t * S), me.pose[:2], me.velocity, own, [other], wide=WIDE, braking=BRAKING)
    assert for_whom in ("", other.robot)
    return for_whom != ""


def test_the_second_stops_head_on_with_room_for_both_to_stop() -> None:
    a, b = status("a", (0.0, 0.0), (1.0, 0.0)), status("b", (4.2, 0.0), (-1.0, 0.0))
    assert stops(b, a) and not stops(a, b)
    assert 4.2 - WIDE > 2.0 * 1.0 / (2.0 * BRAKING) + NEAR / 2.0  # both stop from 1 m/s, and are not near then
    assert not stops(status("b", (7.0, 0.0), (-1.0, 0.0)), a)  # far
    assert not stops(status("b", (-3.0, 0.0), (-1.0, 0.0)), a)  # leaves
    assert not stops(status("b", (3.5, 2.5), (-1.0, 0.0)), a)  # passes well aside
    assert not stops(b, status("a", (0.0, 0.0), (0.0, 0.0)))  # who stands is for planners to go around
    assert not stops(b, a, t=4.0)  # too old


def test_who_follows_an_order_goes_first() -> None:
    a, b = status("a", (0.0, 0.0), (1.0, 0.0)), status("b", (4.0, 0.0), (-1.0, 0.0), order=3)
    assert stops(a, b) and not stops(b, a)


def test_nobody_stops_for_who_comes_from_behind() -> None:
    assert not stops(status("b", (2.0, 0.0), (0.5, 0.0)), status("a", (0.0, 0.0), (1.0, 0.0)))


speeds = st.floats(-1.0, 1.0)


@given(st.floats(-5, 5), st.floats(-5, 5), speeds, speeds, speeds, speeds, st.booleans(), st.booleans())
def test_never_both_stop(x: float, y: float, a: float, b: float, c: float, d: float, one: bool, two: bool) -> None:
    me = status("a", (0.0, 0.0), (a, b), order=1 if one else -1)
    other = status("b", (x, y), (c, d), order=2 if two else -1)
    assert not (stops(me, other) and stops(other, me))


@pytest.mark.parametrize("turn", np.linspace(0.0, 2.0, 9))
def test_it_has_stopped_before_they_touch_wherever_the_other_comes_from(turn: float) -> None:
    """The first goes straight on and never brakes; the second reacts in 0.4 s and brakes."""
    dt, v = 0.02, 0.8
    way = np.array([np.cos(np.pi - turn), np.sin(np.pi - turn)])
    a, b, speed, since = -6.0 * way * v, np.array([-6.0 * v, 0.0]), v, 0.0  # they would meet at the origin
    nearest = np.inf
    for k in range(600):
        other = status("a", tuple(a), tuple(v * way), t=k * dt)
        wants = stops(status("b", tuple(b), (speed, 0.0)), other, t=k * dt)
        since = since + dt if wants else 0.0
        speed = max(speed - BRAKING * dt, 0.0) if since > 0.4 else speed
        a, b = a + v * way * dt, b + np.array([speed, 0.0]) * dt
        nearest = min(nearest, float(np.hypot(*(a - b))))
        if speed == 0.0:
            break
    assert nearest > WIDE
