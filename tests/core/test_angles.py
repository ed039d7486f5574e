"""Folding of angles."""

from math import cos, inf, isnan, nan, nextafter, pi, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from outrider.core.angles import turn, wrap, wrap_all

edges = st.sampled_from([pi, -pi, nextafter(pi, 4), nextafter(-pi, -4), 3 * pi, -3 * pi, 2 * pi, 0.0, 5e-324])
angles = st.one_of(edges, st.floats(-1e6, 1e6))


@settings(derandomize=True)
@given(angles)
def test_inside_and_the_same_direction(a: float) -> None:
    b = wrap(a)
    assert -pi < b <= pi
    assert_allclose([cos(b), sin(b)], [cos(a), sin(a)], rtol=0, atol=1e-15 * max(1.0, abs(a)))
    folded = wrap_all([a])[0]  # the compiler may round once where numpy rounds twice
    assert -pi < folded <= pi
    assert_allclose(np.exp(1j * folded), np.exp(1j * b), rtol=0, atol=1e-15 * max(1.0, abs(a)))
    assert wrap(b) == b


@settings(derandomize=True)
@given(st.floats(-pi, pi, exclude_min=True))
def test_an_angle_inside_is_left_alone(a: float) -> None:
    assert wrap(a) == a
    assert wrap_all(a) == a


@pytest.mark.parametrize("a", [nan, inf, -inf])
def test_not_an_angle(a: float) -> None:
    assert isnan(wrap(a))
    assert np.isnan(wrap_all(a))


def test_shapes_are_kept() -> None:
    assert wrap_all(np.full((2, 3), 7.0)).shape == (2, 3)


def test_around_every_seam_rounding_never_leaks_out() -> None:
    """Odd multiples of pi and their neighbours: the quotient may round to the wrong turn."""
    for k in range(-2001, 2002, 2):
        for a in (k * pi, nextafter(k * pi, inf), nextafter(k * pi, -inf)):
            assert -pi < wrap(a) <= pi
            assert abs(abs(wrap(a)) - pi) < 1e-11
            assert -pi < wrap_all(a) <= pi


def test_turning_a_vector() -> None:
    v = np.array([2.0, 1.0])
    turn(pi / 2, v, v)  # in place
    assert_allclose(v, [-1.0, 2.0], rtol=0, atol=1e-15)
