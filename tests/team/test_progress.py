"""Who drives and comes no nearer is told so; one on a detour and one that is held back are not."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from outrider.team.progress import Progress, drives, way_left


def vain(lefts: np.ndarray, *, step: float = 0.5, counts: bool = True, patience_s: float = 20.0) -> float:
    """When a robot with these metres left is told that it drives in vain, inf for never."""
    watch = Progress(patience_s=patience_s, slow=0.2)
    for k, left in enumerate(lefts):
        if watch.step(100.0 + step * k, float(left), drives=counts):
            return step * k
    return np.inf


def test_who_circles_is_told_after_his_patience() -> None:
    """0.5 m about 0.5 m of way: it cannot gain, and what it could still gain on the circle is paid for with time."""
    k = np.arange(400)
    left = np.where(k < 40, 20.0 - 0.5 * k, 0.5 + 0.5 * np.sin(0.3 * k))
    assert 20.0 < vain(left) - 20.0 < 20.0 + 1.0 / 0.2 + 2.5


@given(far=st.floats(1.0, 200.0), speed=st.floats(0.25, 1.0), detours=st.integers(1, 4))
def test_detours_that_are_driven_are_no_circles(far: float, speed: float, detours: int) -> None:
    """Before each door the way turns out to be shut, and another one leads `far` metres further round."""
    left = [np.arange(far + 30.0 / (j + 1), 10.0 / (j + 1), -0.5 * speed) for j in range(detours)]
    assert vain(np.concatenate([*left, np.arange(10.0 / detours, 0.0, -0.5 * speed)])) == np.inf


def test_time_in_which_it_is_held_back_does_not_count() -> None:
    assert vain(np.full(400, 5.0), counts=False) == np.inf
    assert vain(np.full(400, 5.0)) == pytest.approx(20.5)
    asks, rests = np.array([0.06, 0.0, 0.0]), np.zeros(3)
    assert not drives(rests, asks)  # held back by somebody else
    assert drives(rests, rests)  # does not ask to move: it hovers
    assert drives(np.array([0.0, 0.0, 0.3]), asks)


def test_the_way_that_is_left_is_that_of_the_path() -> None:
    way = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 1.0], [2.0, 2.0]])
    assert way_left(way, np.array([1.0, 0.3])) == pytest.approx(0.3 + 3.0)
    assert way_left(way, np.array([2.0, 2.5])) == pytest.approx(0.5)
