"""Smoothness and length of paths, against what geometry says exactly."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from outrider.errors import DataError
from outrider.eval.paths import length, resampled, smoothness


def test_a_straight_line_is_perfectly_smooth() -> None:
    assert smoothness(np.array([[0.0, 0.0], [3.0, 4.0]]), 0.5) == pytest.approx(1.0)
    assert length(np.array([[0.0, 0.0], [3.0, 4.0], [3.0, 5.0]])) == 6.0


@pytest.mark.parametrize(("side", "spacing"), [(2.0, 0.5), (5.0, 0.5), (3.0, 0.1)])
def test_one_right_angle(side: float, spacing: float) -> None:
    """N = 2 side / spacing + 1 points, one of whose N - 2 turns is pi / 2."""
    corner = np.array([[0.0, 0.0], [side, 0.0], [side, side]])
    n = round(2 * side / spacing) + 1
    assert smoothness(corner, spacing) == pytest.approx(1.0 - 0.5 / (n - 2))


def test_a_polygon_in_a_circle() -> None:
    """Every segment of a regular polygon with k corners turns by 2 pi / k: SMC = 1 - 2 / k."""
    k = 40
    angle = 2 * np.pi * np.arange(k + 1) / k
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    side = 2 * np.sin(np.pi / k)
    assert smoothness(ring, side) == pytest.approx(1.0 - 2.0 / k, abs=1e-9)


def test_turning_back_each_time_is_worst() -> None:
    there_and_back = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 0.0], [1.0, 0.0], [0.0, 0.0]])
    assert smoothness(there_and_back, 1.0) == pytest.approx(0.0)


def test_standing_changes_nothing_and_two_points_tell_nothing() -> None:
    bent = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0]])
    stood = np.repeat(bent, 7, axis=0)
    assert smoothness(stood) == smoothness(bent)
    assert np.isnan(smoothness(np.zeros((5, 2)))) and np.isnan(smoothness(np.array([[0.0, 0.0], [0.3, 0.0]])))
    with pytest.raises(DataError, match="a spacing of 0 m"):
        smoothness(bent, 0.0)


@given(st.lists(st.tuples(st.floats(-50, 50), st.floats(-50, 50)), min_size=2, max_size=20), st.floats(0.1, 3.0))
def test_places_are_evenly_spaced_on_the_path(points: list[tuple[float, float]], spacing: float) -> None:
    p = np.array(points)
    q = resampled(p, spacing)
    assert (q[0] == p[0]).all() or length(p) == 0.0
    np.testing.assert_allclose(q[-1], p[-1] if length(p) > 0.0 else q[-1], atol=1e-9)
    assert len(q) - 1 == pytest.approx(np.ceil(length(p) / spacing), abs=1.01)
    assert (np.hypot(*np.diff(q, axis=0).T) <= spacing * (1 + 1e-9)).all()
