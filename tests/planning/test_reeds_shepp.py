"""Ways of a car that also reverses: length against OMPL's state space, ends, bends and cusps."""

import numpy as np
import pytest
from bases import CAR, situation
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.planning.local.bands import along
from outrider.planning.local.dubins import dubins
from outrider.planning.local.reeds_shepp import driven, reeds_shepp
from outrider.typing import Floats

RADIUS = 1.3
somewhere = st.tuples(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(-3.0, 3.0))


def length(pieces: list[Floats]) -> float:
    return sum(abs(float(p[0])) for p in pieces)


def test_no_way_is_longer_than_ompls() -> None:
    base = pytest.importorskip("ompl.base")
    space, rng = base.ReedsSheppStateSpace(RADIUS), np.random.default_rng(4)
    a, b = space.allocState(), space.allocState()
    near = rng.choice([0.02, 0.3, 1.0], (400, 1))
    ends = np.column_stack([rng.uniform(-5.0, 5.0, (400, 2)) * near, rng.uniform(-3.1, 3.1, 400)])
    for start, goal in zip(rng.uniform(-3.0, 3.0, (400, 3)), ends, strict=True):
        for state, pose in ((a, start), (b, goal + start * [1.0, 1.0, 0.0])):
            state.setX(float(pose[0])), state.setY(float(pose[1])), state.setYaw(float(pose[2]))
        ours = length(reeds_shepp(start, goal + start * [1.0, 1.0, 0.0], RADIUS))
        assert ours == pytest.approx(space.distance(a, b), abs=1e-6)


@given(start=somewhere, goal=somewhere, back=st.floats(1.0, 4.0), cusp=st.floats(0.0, 3.0))
@settings(max_examples=60)
def test_it_arrives_and_bends_no_more_than_its_radius(start, goal, back: float, cusp: float) -> None:
    pieces = reeds_shepp(np.array(start), np.array(goal), RADIUS, back=back, cusp=cusp)
    z = driven(np.array(start), pieces, 0.05)
    np.testing.assert_allclose(z[-1, :2], goal[:2], atol=1e-6)
    assert abs(np.sin(0.5 * (z[-1, 2] - goal[2]))) < 1e-6
    for way, turned in pieces:
        assert abs(turned) * RADIUS <= abs(way) + 1e-9
    shortest = length(reeds_shepp(np.array(start), np.array(goal), RADIUS))
    ahead = dubins(np.array(start), np.array(goal), RADIUS, 0.01)
    assert shortest <= min(length(pieces) + 1e-9, 1.001 * np.hypot(*np.diff(ahead[:, :2], axis=0).T).sum() + 1e-3)


def test_a_step_aside_is_a_shuffle_and_not_a_circle() -> None:
    """4 cm to the side: forward only that is a whole circle."""
    goal = np.array([0.0, 0.04, 0.0])
    pieces = reeds_shepp(np.zeros(3), goal, 1.0)
    assert length(pieces) < 1.2
    assert {np.sign(p[0]) for p in pieces} == {-1.0, 1.0}
    assert np.hypot(*np.diff(dubins(np.zeros(3), goal, 1.0, 0.01)[:, :2], axis=0).T).sum() > 6.0
    assert reeds_shepp(goal, goal, 1.0) == []


def test_a_band_stands_where_it_turns_back() -> None:
    z = along(np.zeros((2, 2)), situation((0.0, 0.3, 0.0)), CAR, 0.1, 240)
    step = np.diff(z[:, :2], axis=0)
    ahead = np.cos(z[:-1, 2]) * step[:, 0] + np.sin(z[:-1, 2]) * step[:, 1]
    turns = np.flatnonzero(ahead[1:] * ahead[:-1] < 0.0)
    assert turns.size
    speed = np.abs(ahead) / np.diff(z[:, 3])
    assert max(min(speed[k], speed[k + 1]) for k in turns) < 0.15 * speed.max() + 0.05
