"""Where a robot starts: exact sightings give the exact pose, whatever else was misread; too little gives none."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.core.attitudes import wrap_all
from outrider.filters.cooperative.placing import CAUTION, FEWEST, Pairs, place
from outrider.typing import Floats

T = 0.1 * np.arange(200)
WAY = np.column_stack([0.1 * T, 0.02 * T**2, np.arctan(0.4 * T)])  # in the robot's own frame
MARKS = np.array([[4.0, 1.0], [6.0, -3.0], [-2.0, 5.0]])


def turned(p: Floats, pose: Floats) -> Floats:
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return p @ np.array([[c, s], [-s, c]]) + pose[:2]


def looked_at(frame: Floats, marks: Floats, n: int = 24, noise: Floats | None = None) -> Pairs:
    """Landmarks in turn; the world is the robot's frame moved by `frame`."""
    t = np.sort(np.tile(np.linspace(1.0, 10.0, n), 1))
    world = marks[np.arange(n) % len(marks)]
    own = turned(world - frame[:2], np.array([0.0, 0.0, -frame[2]]))
    return Pairs(t, own + (0.0 if noise is None else noise), world, np.full(n, 0.15**2), np.arange(n))


@settings(max_examples=40)
@given(st.floats(-50, 50), st.floats(-50, 50), st.floats(-np.pi, np.pi))
def test_exact_sightings_give_the_exact_pose(x: float, y: float, turn: float) -> None:
    frame = np.array([x, y, turn])
    found = place(looked_at(frame, MARKS), T, WAY)
    assert found is not None
    here = np.array([np.interp(found.t, T, WAY[:, i]) for i in range(3)])
    np.testing.assert_allclose(found.pose[:2], turned(here[None, :2], frame)[0], atol=1e-6)
    assert abs(wrap_all(np.array([found.pose[2] - here[2] - turn]))[0]) < 1e-6
    assert found.rows.size >= FEWEST and found.t == pytest.approx(looked_at(frame, MARKS).t[found.rows.max()])


def test_a_third_may_be_misread() -> None:
    frame = np.array([3.0, -1.0, 2.0])
    pairs = looked_at(frame, MARKS)
    rng = np.random.default_rng(4)
    wrong = np.arange(24) % 3 == 1
    pairs.world[wrong] = rng.uniform(-10, 10, (8, 2))
    found = place(pairs, T, WAY)
    assert found is not None and not wrong[found.rows].any()
    here = np.array([np.interp(found.t, T, WAY[:, i]) for i in range(3)])
    np.testing.assert_allclose(found.pose[:2], turned(here[None, :2], frame)[0], atol=1e-6)


def test_one_landmark_is_not_enough() -> None:
    assert place(looked_at(np.zeros(3), MARKS[:1]), T, WAY) is None


def test_few_sightings_are_not_enough() -> None:
    assert place(looked_at(np.zeros(3), MARKS, n=FEWEST - 1), T, WAY) is None


def test_of_two_poses_that_explain_as_much_none_is_taken() -> None:
    one, two = (looked_at(np.array(f), MARKS) for f in ([0.0, 0.0, 0.0], [8.0, 3.0, 2.5]))
    order = np.argsort(np.concatenate([one.t, two.t]), kind="stable")
    both = Pairs(*(np.concatenate([a, b])[order] for a, b in zip(one, two, strict=True)))
    assert place(both, T, WAY) is None


def test_it_waits_until_after_a_time() -> None:
    found = place(looked_at(np.zeros(3), MARKS), T, WAY, after=6.0)
    assert found is not None and found.t > 6.0


def test_it_knows_how_wrong_it_is() -> None:
    """Mean NEES of noise as told: 1/CAUTION and less per degree of freedom, as the covariance is enlarged by that."""
    rng = np.random.default_rng(5)
    nees = []
    for _ in range(150):
        found = place(looked_at(np.array([1.0, 2.0, 0.5]), MARKS, noise=rng.normal(size=(24, 2)) * 0.15), T, WAY)
        assert found is not None
        here = np.array([np.interp(found.t, T, WAY[:, i]) for i in range(3)])
        e = found.pose - [*turned(here[None, :2], np.array([1.0, 2.0, 0.5]))[0], here[2] + 0.5]
        e[2] = wrap_all(e[2:])[0]
        nees.append(e @ np.linalg.solve(found.P, e) / 3.0)
    assert 0.3 / CAUTION < np.mean(nees) < 1.3 / CAUTION
