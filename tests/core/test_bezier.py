"""Bezier curves against SciPy's Bernstein polynomials and splines, exact lengths, and the printed corner misses."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.interpolate import BPoly, CubicSpline

from outrider.core.bezier import BezierPath, bezier, bezier_slope, through
from outrider.errors import DataError

SMALL = settings(max_examples=40)


@SMALL
@given(st.integers(1, 17), st.integers(0, 10**6))
def test_equals_bernstein_polynomials_of_any_degree(degree: int, seed: int) -> None:
    points = np.random.default_rng(seed).normal(size=(degree + 1, 3))
    peer = BPoly(points[:, None, :], [0.0, 1.0])
    s = np.linspace(0.0, 1.0, 11)
    np.testing.assert_allclose(bezier(points, s), peer(s), atol=1e-12)
    np.testing.assert_allclose(bezier_slope(points, s), peer.derivative()(s), atol=1e-10)
    np.testing.assert_allclose(bezier(points, 0.3), peer(0.3), atol=1e-12)


@SMALL
@given(st.integers(3, 9), st.integers(0, 10**6), st.sampled_from([1, 2]))
def test_pieces_pass_through_the_points_and_are_smooth(count: int, seed: int, continuity: int) -> None:
    p = np.cumsum(np.random.default_rng(seed).uniform(0.3, 2.0, size=(count, 3)), axis=0)
    pieces = through(p, continuity=continuity)
    np.testing.assert_allclose(pieces[:, 0], p[:-1])
    np.testing.assert_allclose(pieces[:, -1], p[1:])
    h = np.linalg.norm(np.diff(p, axis=0), axis=1)
    for k in range(len(pieces) - 1):
        left, right = bezier_slope(pieces[k], 1.0) / h[k], bezier_slope(pieces[k + 1], 0.0) / h[k + 1]
        np.testing.assert_allclose(left, right, atol=1e-9)
        if continuity == 2:
            a, b = np.diff(pieces[k], 2, axis=0)[-1] / h[k] ** 2, np.diff(pieces[k + 1], 2, axis=0)[0] / h[k + 1] ** 2
            np.testing.assert_allclose(a, b, atol=1e-8)


def test_two_times_smooth_is_the_natural_spline() -> None:
    p = np.cumsum(np.random.default_rng(1).uniform(0.3, 2.0, size=(7, 2)), axis=0)
    t = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(p, axis=0), axis=1))])
    peer, pieces = CubicSpline(t, p, bc_type="natural"), through(p, continuity=2)
    for k in range(6):
        np.testing.assert_allclose(bezier(pieces[k], 0.37), peer(t[k] + 0.37 * (t[k + 1] - t[k])), atol=1e-10)


def test_lengths_and_places_by_arc_length() -> None:
    parabola = BezierPath(np.array([[[0.0, 0.0], [1.0, 2.0], [2.0, 0.0]]]))
    exact = quad(lambda s: np.hypot(2.0, 4.0 - 8.0 * s), 0.0, 1.0)[0]
    assert parabola.length == pytest.approx(exact, rel=1e-9)
    for way in np.linspace(0.0, exact, 9):
        s = parabola.at(way)[0] / 2.0  # x = 2 s
        assert quad(lambda u: np.hypot(2.0, 4.0 - 8.0 * u), 0.0, s)[0] == pytest.approx(way, abs=1e-7)
    np.testing.assert_allclose(parabola.at(-1.0), [0, 0])
    np.testing.assert_allclose(parabola.at(99.0), [2, 0], atol=1e-12)


@SMALL
@given(st.integers(0, 10**6), st.floats(0.05, 0.95))
def test_the_nearest_point_of_a_place_on_the_path_is_that_place(seed: int, share: float) -> None:
    p = np.cumsum(np.random.default_rng(seed).uniform(0.5, 2.0, size=(6, 3)), axis=0)
    path = BezierPath(through(p))
    way = share * path.length
    assert path.nearest(path.at(way)) == pytest.approx(way, abs=1e-5)
    assert np.linalg.norm(path.direction(way)) == pytest.approx(1.0)


@pytest.mark.parametrize(("count", "miss"), [(3, 0.71), (5, 1.06), (9, 1.55), (17, 2.22)])
def test_one_curve_misses_a_corner_and_pieces_do_not(count: int, miss: float) -> None:
    """A 90 degree turn sampled every 2 m, the corner in the middle."""
    half = (count - 1) // 2
    leg = 2.0 * np.arange(half, 0, -1)
    p = np.concatenate([np.column_stack([-leg, 0 * leg]), [[0.0, 0.0]], np.column_stack([0 * leg, leg[::-1]])])
    s = np.linspace(0.0, 1.0, 2001)
    assert np.linalg.norm(bezier(p, s), axis=1).min() == pytest.approx(miss, abs=0.01)
    pieces = through(p)
    assert min(np.linalg.norm(bezier(piece, s), axis=1).min() for piece in pieces) < 1e-12


def test_one_place_is_no_curve_and_equal_points_are_left_out() -> None:
    for points in (np.zeros((0, 3)), np.zeros((1, 3)), np.zeros((5, 3)), np.array([[0.0, 0, 0], [np.nan, 0, 0]])):
        with pytest.raises(DataError, match="two or more"):
            through(points)
    p = np.array([[0.0, 0, 0], [0, 0, 0], [1, 0, 0], [1, 0, 0]])
    np.testing.assert_allclose(BezierPath(through(p)).at(0.25), [0.25, 0, 0], atol=1e-12)
