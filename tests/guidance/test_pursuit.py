"""The vector law: where it rests, what it never exceeds, how it approaches."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.errors import ConfigError
from outrider.guidance.pursuit import Pursuit, closing_speed, hasten, pursued

LAW = Pursuit(speed=2.5, gain=0.5, brake=1.0)


def test_goes_along_at_the_set_point() -> None:
    for w in ([2.0, 0, 0], [1.0, 0, 0.5], [0, 0, 0]):
        np.testing.assert_allclose(pursued(np.zeros(3), [5.0, 0, 0, *w], 5.0, LAW), w, atol=1e-12)


def test_swings_to_behind_the_target_on_its_level() -> None:
    for start in ([0, 5.0, 0], [4.0, 0, 3.0], [0, 0, -5.0]):
        p, v, q, w = np.array(start), np.zeros(3), np.zeros(3), np.array([2.0, 0.0, 0.0])
        nearest = 5.0
        for _ in range(600):
            u = pursued(p, np.r_[q, w], 5.0, LAW)
            v += (u - v) * (1.0 - np.exp(-0.1 / 0.5))
            p, q = p + 0.1 * v, q + 0.1 * w
            nearest = min(nearest, float(np.linalg.norm(q - p)))
        np.testing.assert_allclose(q - p, [5.0, 0.0, 0.0], atol=0.05)
        assert nearest > 3.5
    stays = Pursuit(speed=2.5, astern=0.0)
    np.testing.assert_allclose(pursued(np.zeros(3), [0, 5.0, 0, 2.0, 0, 0], 5.0, stays), [2.0, 0, 0], atol=1e-12)


def test_predicts_over_the_age_of_what_it_knows() -> None:
    now = pursued(np.zeros(3), [9.0, 1.0, 0.0, 1.0, -1.0, 0.5], 4.0, LAW)
    old = pursued(np.zeros(3), [7.0, 3.0, -1.0, 1.0, -1.0, 0.5], 4.0, LAW, age_s=2.0)
    np.testing.assert_allclose(old, now, atol=1e-12)


@settings(max_examples=80)
@given(st.integers(0, 10**6))
def test_keeps_its_speed_and_turns_with_the_world(seed: int) -> None:
    rng = np.random.default_rng(seed)
    p, q, w = rng.normal(size=(3, 3)) * [[5.0], [5.0], [1.5]]
    u = pursued(p, np.r_[q, w], 4.0, LAW)
    assert np.linalg.norm(u) <= 2.5 + 1e-9
    c, s = np.cos(seed), np.sin(seed)
    R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])  # up is up: it swings to the target's level
    np.testing.assert_allclose(pursued(R @ p, np.r_[R @ q, R @ w], 4.0, LAW), R @ u, atol=1e-9)


@settings(max_examples=50)
@given(st.floats(0.1, 2.0), st.floats(0.2, 5.0), st.floats(0.0, 100.0))
def test_closing_can_be_braked_and_is_odd(gain: float, brake: float, error: float) -> None:
    c = closing_speed(error, gain, brake)
    assert c / gain + 0.5 * c * c / brake == pytest.approx(error, rel=1e-9, abs=1e-12)  # reaction and stopping way
    assert closing_speed(-error, gain, brake) == -c
    assert closing_speed(1e-6, gain, brake) == pytest.approx(gain * 1e-6, rel=1e-4)


@pytest.mark.parametrize("bearing", range(8))
def test_reaches_the_set_point_from_eight_bearings(bearing: int) -> None:
    a = bearing * np.pi / 4
    p, v, q, w = np.array([9 * np.cos(a), 9 * np.sin(a), 3.0]), np.zeros(3), np.zeros(3), np.array([0.0, 2.0, 0.0])
    for _ in range(900):
        u = pursued(p, np.r_[q, w], 5.0, LAW)
        v += (u - v) * (1.0 - np.exp(-0.1 / 0.5))
        p, q = p + 0.1 * v, q + 0.1 * w
    assert np.linalg.norm(q - p) == pytest.approx(5.0, abs=0.05)
    np.testing.assert_allclose(v, w, atol=0.05)


def test_a_target_that_outruns_it_is_followed_at_full_speed() -> None:
    u = pursued(np.zeros(3), [10.0, 0, 0, 4.0, 0, 0], 5.0, LAW)
    np.testing.assert_allclose(u, [2.5, 0, 0], atol=1e-12)


def test_at_the_very_place_of_the_target_it_falls_back() -> None:
    np.testing.assert_allclose(pursued(np.zeros(3), [0, 0, 0, 1.0, 0, 0], 5.0, LAW), [0.5, 0, 0])


def test_impossible_numbers_are_refused() -> None:
    with pytest.raises(ConfigError, match="gain"):
        Pursuit(speed=2.0, gain=0.0)


def test_hastened_commands_answer_in_a_share_of_the_lag() -> None:
    v, want = np.array([1.0, 0.0, 0.0]), np.array([0.5, 0.4, 0.0])
    for k in range(20):
        out = want.copy()
        hasten(v, 0.25, 9.0, out)
        v = v + (out - v) * 0.01 / 1.0  # lag 1 s
        exact = want + (np.array([1.0, 0.0, 0.0]) - want) * (1.0 - 0.01 / 0.25) ** (k + 1)
        np.testing.assert_allclose(v, exact, atol=1e-12)
    out = np.array([9.0, 0.0, 9.0])
    hasten(np.zeros(3), 0.5, 2.5, out)
    np.testing.assert_allclose(out, np.array([1.0, 0.0, 1.0]) * 2.5 / 2**0.5)
