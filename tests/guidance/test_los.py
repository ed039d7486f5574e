"""The guidance of swarm2023, repaired and as printed, against its own anchor points."""

from math import cos, hypot, pi, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.guidance.los import (
    line_of_sight,
    line_of_sight_printed,
    separation,
    zone_speed,
    zone_speed_printed,
)

STEP = 0.1


def chase(law: object, start: tuple[float, float], seconds: float = 60.0) -> float:
    """The last distance to a target that goes north at 2 m/s; lag 0.5 s, R_d 3 m, v_m 2.5 m/s, no noise."""
    p, v, q, u = np.array([*start, 7.0]), np.zeros(3), np.array([0.0, 7.0, 7.0]), np.empty(3)
    for _ in range(round(seconds / STEP)):
        law(p, q, zone_speed(separation(p, q), 3.0, 2.0, 2.5), u)  # type: ignore[operator]
        v += (u - v) * (1.0 - np.exp(-STEP / 0.5))
        p += STEP * v
        q[1] += STEP * 2.0
    return float(hypot(*(q - p)[:2]))


@pytest.mark.parametrize("k", range(8))
def test_converges_from_eight_bearings(k: int) -> None:
    start = 6.0 * cos(k * pi / 4), 7.0 + 6.0 * sin(k * pi / 4)
    assert chase(line_of_sight, start) == pytest.approx(3.0, abs=0.05)


def test_the_printed_form_ends_more_than_150_m_away() -> None:
    """45 s of rendezvous: 180 m from 6 m behind the target, 26 m from the paper's start beside it, instead of 3 m."""
    assert chase(line_of_sight_printed, (0.0, 1.0), 45.0) == pytest.approx(179.7, abs=0.5)
    assert chase(line_of_sight_printed, (-5.0, 7.0), 45.0) == pytest.approx(26.0, abs=0.5)
    assert chase(line_of_sight, (-5.0, 7.0), 45.0) == pytest.approx(3.0, abs=0.05)


def test_the_course_is_that_of_the_target() -> None:
    out = np.empty(3)
    for k in range(8):
        line_of_sight(np.zeros(3), np.array([cos(k), sin(k), 4.0]), 2.0, out)
        np.testing.assert_allclose(out, [2.0 * cos(k), 2.0 * sin(k), 0.0], atol=1e-12)
    line_of_sight(np.ones(3), np.ones(3), 2.0, out)
    assert not out.any()


@pytest.mark.parametrize(
    ("distance", "speed"), [(0.0, 0.0), (1.5, 0.0), (2.25, 1.0), (3.0, 2.0), (3.75, 2.25), (4.5, 2.5), (6.0, 2.5)]
)
def test_anchor_points(distance: float, speed: float) -> None:
    assert zone_speed(distance, 3.0, 2.0, 2.5) == pytest.approx(speed, abs=1e-12)


@settings(max_examples=50)
@given(st.floats(0.5, 20.0), st.floats(0.0, 5.0), st.floats(0.0, 5.0))
def test_continuous_and_within_its_range(R_d: float, v_target: float, more: float) -> None:
    v_most = v_target + more
    for corner in (0.5 * R_d, R_d, 1.5 * R_d):
        below, above = (zone_speed(corner * (1 + e), R_d, v_target, v_most) for e in (-1e-9, 1e-9))
        assert above == pytest.approx(below, abs=1e-6)
    speeds = [zone_speed(d * R_d, R_d, v_target, v_most) for d in np.linspace(0.0, 3.0, 61)]
    assert min(speeds) >= 0.0
    assert max(speeds) <= v_most
    assert np.all(np.diff(speeds) >= -1e-12)


def test_the_printed_branch_jumps_from_two_to_nothing() -> None:
    assert zone_speed_printed(3.0, 3.0, 2.0, 2.5) == pytest.approx(2.0)
    assert zone_speed_printed(3.0 - 1e-9, 3.0, 2.0, 2.5) == 0.0
    assert zone_speed_printed(4.0, 3.0, 2.0, 2.5) == zone_speed(4.0, 3.0, 2.0, 2.5)
