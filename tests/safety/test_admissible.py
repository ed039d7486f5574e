"""How close: exact cases, what it depends on, and what is refused with which remedy."""

from dataclasses import replace
from math import inf, pi

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from outrider.errors import ConfigError
from outrider.safety.admissible import (
    EASE,
    Fixes,
    adapted,
    admissible,
    least_distance,
    least_set_point,
    nearest_coming_back,
    promise,
)
from outrider.safety.separation import Separation

LIKE = Separation(distance=3.0, lag_s=1.0, acceleration=5.0, speed=2.5, other_lag_s=1.0)


def test_the_case_of_the_paper_is_accepted_and_chosen_within_two_and_a_half_metres() -> None:
    answer = admissible(LIKE, Fixes(rate_hz=1.0, latency_s=0.3), 2.0, most=5.5)
    assert 5.0 < answer.set_point <= 5.5
    assert answer.set_point == pytest.approx(answer.least + EASE)


def test_a_wall_is_the_stopping_distance() -> None:
    """Instant answers, a target that stands at once, no noise: v (age + period) + v^2 / 2 b."""
    wall = Separation(distance=2.0, period_s=0.2, lag_s=0.0, acceleration=3.0, speed=6.0, other_lag_s=0.0)
    least = least_set_point(4.0, 1.5, 0.0, 0.0, 0.0, wall.theta())
    assert least == pytest.approx(2.0 + 4.0 * (1.5 + 0.2) + 16.0 / 6.0, abs=0.01)


def test_a_target_that_rests_costs_only_the_noise() -> None:
    assert least_set_point(0.0, 1.3, 0.04, 0.0, 0.0, LIKE.theta()) == pytest.approx(3.0 + 4.0 * 0.2, abs=0.02)


def test_what_costs_distance() -> None:
    fixes = Fixes(rate_hz=2.0, latency_s=0.2)
    base = admissible(LIKE, fixes, 1.5).least
    for worse, f, v in (
        (LIKE, replace(fixes, rate_hz=1.0), 1.5),
        (LIKE, replace(fixes, latency_s=0.5), 1.5),
        (LIKE, replace(fixes, sigma=0.5), 1.5),
        (LIKE, replace(fixes, velocity_sigma=inf), 1.5),
        (LIKE, fixes, 2.0),
        (replace(LIKE, distance=3.5), fixes, 1.5),
        (replace(LIKE, other_lag_s=0.2), fixes, 1.5),
        (replace(LIKE, acceleration=1.0), fixes, 1.5),
        (replace(LIKE, approach=1.0), fixes, 1.5),
        (replace(LIKE, sigmas=5.0), fixes, 1.5),
    ):
        assert admissible(worse, f, v).least > base + 0.05


@pytest.mark.parametrize("velocity_sigma", [0.05, inf])
def test_the_spread_is_that_of_the_riccati_equation(velocity_sigma: float) -> None:
    f = Fixes(rate_hz=2.0, latency_s=0.0, sigma=0.2, velocity_sigma=velocity_sigma, own_acceleration=1e-6)
    T, q = 0.5, f.acceleration**2
    F, Q = np.array([[1.0, T], [0.0, 1.0]]), q * np.array([[T**3 / 3, T**2 / 2], [T**2 / 2, T]])
    H = np.eye(2) if velocity_sigma < inf else np.array([[1.0, 0.0]])
    R = np.diag([f.sigma**2, velocity_sigma**2][: len(H)])
    prior = solve_discrete_are(F.T, H.T, Q, R)
    after = prior - prior @ H.T @ np.linalg.solve(H @ prior @ H.T + R, H @ prior)
    pp, pv, vv = f.spread(0.5)
    own = 0.02 * f.sigma**2  # of a follower that nothing disturbs there is little left to know
    np.testing.assert_allclose([pp, pv, vv], [after[0, 0], after[0, 1], after[1, 1]], rtol=0.02, atol=own)


@pytest.mark.parametrize(
    ("change", "speed", "word"),
    [
        ({}, 2.5, "never catches up"),
        ({}, 3.0, "a faster follower"),
        ({"set_point": 4.0}, 2.0, "fixes at 5 Hz"),
        ({"most": 3.2}, 2.0, "a set-point farther away"),
        ({"set_point": 3.0}, 2.0, "a smaller R_d"),
        ({}, -1.0, "target speed"),
        ({}, float("nan"), "target speed"),
    ],
)
def test_what_cannot_hold_is_refused_with_what_to_change(change: dict[str, float], speed: float, word: str) -> None:
    with pytest.raises(ConfigError, match=word):
        admissible(LIKE, Fixes(), speed, **change)


def test_a_slower_target_is_the_remedy_where_faster_fixes_are_none() -> None:
    with pytest.raises(ConfigError, match=r"a target of at most 1 m/s"):
        admissible(LIKE, Fixes(rate_hz=10.0), 2.0, set_point=3.5)


def test_a_target_that_comes_back_takes_three_metres_more_or_is_refused() -> None:
    back = replace(LIKE, approach=2.0)
    assert admissible(back, Fixes(), 2.0).set_point > admissible(LIKE, Fixes(), 2.0).set_point + 3.0
    with pytest.raises(ConfigError, match="it takes"):
        admissible(back, Fixes(), 2.0, most=5.5)


def test_the_law_that_holds_R_d_itself_needs_more_than_three_metres_at_1_hz() -> None:
    """planning.md 3.6: 3.8 m beside the bodies for a target that stands at once, at 1 Hz without delay."""
    wall = Separation(distance=3.0, period_s=0.1, lag_s=0.5, acceleration=2.5, speed=2.5, other_lag_s=0.0)
    exact = Fixes(latency_s=0.0, sigma=1e-6, velocity_sigma=1e-6, acceleration=1e-6, own_acceleration=1e-6)
    beside = least_distance(wall, exact, 2.0, contact=1e-6)
    assert 2.0 * 1.0 + 4.0 / (2 * 2.5) < beside < 3.8
    assert least_distance(wall, replace(exact, rate_hz=10.0), 2.0, contact=1e-6) < beside - 1.7


def test_adapts_up_at_once_and_down_slowly() -> None:
    assert adapted(5.0, 6.0, 0.1) == 6.0
    assert adapted(5.0, 3.0, 0.1) == pytest.approx(4.9)
    assert adapted(5.0, 4.95, 0.1) == 4.95


def test_a_slow_follower_is_warned_of() -> None:
    assert "it comes up slowly" in admissible(replace(LIKE, speed=2.2), Fixes(), 2.0).warnings[0]
    assert not admissible(LIKE, Fixes(), 1.5).warnings


@pytest.mark.parametrize("name", ["rate_hz", "sigma", "acceleration", "own_acceleration", "velocity_sigma"])
def test_fixes_of_impossible_numbers_are_refused(name: str) -> None:
    for value in (0.0, -1.0, float("nan")):
        with pytest.raises(ConfigError, match=name):
            Fixes(**{name: value})
    with pytest.raises(ConfigError, match="latency_s"):
        Fixes(latency_s=-0.1)


def test_how_near_a_target_comes_that_turns_back_is_what_the_set_point_is_short_of() -> None:
    fixes = Fixes(rate_hz=5.0, latency_s=0.1)
    declared = replace(LIKE, approach=1.5)
    needs = admissible(declared, fixes, 1.5).least
    assert nearest_coming_back(declared, fixes, 1.5, needs) == pytest.approx(3.0, abs=0.01)
    assert nearest_coming_back(LIKE, fixes, 1.5, needs) == pytest.approx(3.0, abs=0.01)
    assert nearest_coming_back(LIKE, fixes, 1.5, needs - 1.2) == pytest.approx(1.8, abs=0.01)
    assert nearest_coming_back(LIKE, fixes, 2.5, 50.0) == -inf


def test_a_promise_says_what_it_does_not_cover() -> None:
    fixes = Fixes(rate_hz=5.0, latency_s=0.1)
    at = admissible(LIKE, fixes, 2.0).set_point
    said = promise(LIKE, fixes, 2.0, at)
    assert f"may get within {nearest_coming_back(LIKE, fixes, 2.0, at):.2g} m at worst ('approach: 2'" in said
    assert "may hit it" in promise(LIKE, Fixes(rate_hz=1.0, latency_s=0.3), 2.0, 5.49)
    back = replace(LIKE, approach=2.0, turn=pi)
    whole = promise(back, fixes, 2.0, admissible(back, fixes, 2.0).set_point)
    assert "undeclared" not in whole and whole.endswith("turns by up to 180 degrees, or comes back at up to 2 m/s")
