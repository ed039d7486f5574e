"""The distance filter against exact stopping distances, symmetries, and the worst that the other may do."""

from math import exp, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.errors import ConfigError
from outrider.safety.separation import Hold, Separation, brake, kept_apart, largest_approach, lowest

SMALL = settings(max_examples=60)
LIKE = Separation(distance=3.0, period_s=0.1, lag_s=1.0, acceleration=5.0, speed=2.5, other_lag_s=1.0)


@SMALL
@given(st.floats(0.1, 40.0), st.floats(0.5, 5.0), st.floats(0.05, 1.0))
def test_equals_the_exact_stopping_distance_in_one_dimension(gap: float, b: float, period: float) -> None:
    limits = Separation(distance=3.0, period_s=period, lag_s=0.0, acceleration=b, speed=30.0, other_lag_s=0.0)
    u = largest_approach(3.0 + gap, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, limits.theta())
    assert u * period + 0.5 * u * u / b == pytest.approx(gap, rel=1e-4)


@SMALL
@given(st.floats(3.0, 20.0), st.floats(-2.0, 2.5), st.floats(-1.0, 2.5), st.floats(0.0, 3.0), st.floats(0.0, 1.5))
def test_flying_the_admissible_command_and_braking_holds_the_distance(
    gap: float, v: float, s: float, age: float, approach: float
) -> None:
    limits = Separation(
        distance=3.0, period_s=0.3, lag_s=0.6, acceleration=3.0, speed=2.5, other_lag_s=0.8, approach=approach
    )
    low = min(s, -approach)
    u = largest_approach(gap, v, s, low, age, 0.0, 0.0, 0.0, limits.theta())
    if not -2.5 <= u <= 2.5:
        return
    h, x = 0.002, 0.0
    lost = min(0.0, other(gap, s, low, 0.8, age) - 3.0)
    for k in range(3000):
        t = k * h
        told = u if t < 0.3 else -2.5
        v += h * max(-3.0, min(3.0, (told - v) / 0.6)) if t >= 0.3 else h * (told - v) / 0.6
        x += h * v
        apart = other(gap, s, low, 0.8, age + t + h) - x - 3.0
        if t >= 0.3:  # what was lost before comes back with 1/s
            assert apart >= lost * exp(-(t + h)) - 0.012


def other(gap: float, s: float, low: float, lag: float, t: float) -> float:
    """Where the other is when it has lagged from s to low for t seconds."""
    return gap + low * t + (s - low) * lag * (1.0 - exp(-t / lag))


@SMALL
@given(st.integers(0, 10**6), st.booleans())
def test_turned_and_mirrored_with_the_world(seed: int, mirror: bool) -> None:
    rng = np.random.default_rng(seed)
    want, p, v, q, w = rng.normal(size=(5, 3)) * [[2.0], [3.0], [1.5], [5.0], [1.5]]
    A = rng.normal(size=(6, 6)) * 0.2
    P = A @ A.T
    R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    R = R * np.sign(np.linalg.det(R)) * (-1.0 if mirror else 1.0)
    RR = np.kron(np.eye(2), R)
    out, hold = kept_apart(want, np.r_[p, v], np.r_[q, w], LIKE, P=P, age_s=0.7)
    turned, same = kept_apart(R @ want, np.r_[R @ p, R @ v], np.r_[R @ q, R @ w], LIKE, P=RR @ P @ RR.T, age_s=0.7)
    assert same is hold
    np.testing.assert_allclose(turned, R @ out, atol=1e-6)


@SMALL
@given(st.integers(0, 10**6))
def test_never_closes_faster_than_the_barrier_and_never_than_wanted(seed: int) -> None:
    rng = np.random.default_rng(seed)
    want, v, w = rng.normal(size=(3, 3)) * 2.0
    q = rng.normal(size=3) * 6.0
    out, hold = kept_apart(want, np.r_[np.zeros(3), v], np.r_[q, w], LIKE, age_s=0.5)
    rest = q + w * (1.0 - exp(-0.5))
    n = rest / np.linalg.norm(rest)
    low = lowest(float(n @ w), float(np.linalg.norm(w)), LIKE.theta())
    most = largest_approach(float(n @ q), float(n @ v), float(n @ w), low, 0.5, 0.0, 0.0, 0.0, LIKE.theta())
    assert out @ n <= max(min(want @ n, most), -2.5) + 1e-9
    assert hold is not Hold.FREE or np.array_equal(out, want)
    if hold is not Hold.FREE:
        assert np.linalg.norm(out) <= 2.5 + 1e-9
        across, aside = want - (want @ n) * n, out - (out @ n) * n
        np.testing.assert_allclose(np.cross(across, aside), 0.0, atol=1e-9)  # along what was wanted, or less


@SMALL
@given(st.floats(3.0, 15.0), st.floats(0.0, 2.5), st.floats(0.2, 2.5))
def test_less_is_admitted_the_nearer_faster_older_and_vaguer(gap: float, v: float, s: float) -> None:
    theta = LIKE.theta()
    u = largest_approach(gap, v, s, 0.0, 0.5, 0.01, 0.0, 0.01, theta)
    assert largest_approach(gap - 0.1, v, s, 0.0, 0.5, 0.01, 0.0, 0.01, theta) < u
    assert largest_approach(gap, v + 0.1, s, 0.0, 0.5, 0.01, 0.0, 0.01, theta) < u
    assert largest_approach(gap, v, s - 0.1, 0.0, 0.5, 0.01, 0.0, 0.01, theta) < u
    assert largest_approach(gap, v, s, 0.0, 0.5, 0.04, 0.0, 0.04, theta) < u


def test_a_target_that_may_come_back_needs_more() -> None:
    back = Separation(distance=3.0, lag_s=1.0, speed=2.5, other_lag_s=1.0, approach=2.0)
    own, target = np.array([0, 0, 0, 2.0, 0, 0]), np.array([3.2, 0, 0, 2.0, 0, 0])
    want = np.array([2.0, 0.0, 0.0])
    assert kept_apart(want, own, target, LIKE, age_s=0.5)[1] is Hold.FREE
    assert kept_apart(want, own, target, back, age_s=0.5)[1] is Hold.CANNOT_HOLD


@SMALL
@given(st.floats(0.0, 3.0), st.floats(0.0, np.pi), st.floats(0.0, np.pi), st.floats(0.0, 2.0))
def test_the_worst_of_all_turns(speed: float, phi: float, turn: float, approach: float) -> None:
    """Against every turn that is allowed, one by one."""
    theta = Separation(distance=3.0, speed=2.5, approach=approach, turn=turn).theta()
    along = [speed * np.cos(phi + a) for a in np.linspace(-turn, turn, 721)]
    worst = min(*along, -approach)
    assert lowest(speed * np.cos(phi), speed, theta) == pytest.approx(worst, abs=1e-4 * speed + 1e-9)


def test_every_word_is_said() -> None:
    want, at = np.array([2.0, 0.0, 0.0]), np.zeros(6)
    slow = Separation(distance=3.0, lag_s=0.1, speed=2.5, other_lag_s=0.0)
    words = {gap: kept_apart(want, at, [gap, 0, 0, 0, 0, 0], slow)[1] for gap in (9.0, 3.2, 2.9, 0.3)}
    assert words == {9.0: Hold.FREE, 3.2: Hold.LIMITED, 2.9: Hold.RETREATING, 0.3: Hold.CANNOT_HOLD}


@pytest.mark.parametrize("hole", range(5))
def test_a_missing_number_hovers(hole: int) -> None:
    given_ = [np.array([2.0, 0.0, 0.0]), np.zeros(6), np.array([9.0, 0, 0, 0, 0, 0]), np.zeros((6, 6)), 0.2]
    if hole < 4:
        given_[hole].flat[1] = np.nan
    else:
        given_[4] = np.nan
    out, hold = kept_apart(given_[0], given_[1], given_[2], LIKE, P=given_[3], age_s=given_[4])
    assert hold is Hold.UNKNOWN
    assert not out.any()


def test_the_same_place_cannot_hold() -> None:
    out, hold = kept_apart(np.ones(3), np.zeros(6), np.zeros(6), LIKE)
    assert hold is Hold.CANNOT_HOLD
    assert not out.any()


def test_the_assured_brake_is_below_what_the_vehicle_can() -> None:
    vehicles = ((1.0, 5.0, 2.5, 0.0), (0.5, 5.0, 2.5, 2.0), (0.0, 3.0, 8.0, 1.0), (1.0, 1.0, 12.0, 3.0))
    for lag, a, V, back in vehicles:
        theta = Separation(distance=3.0, lag_s=lag, acceleration=a, speed=V).theta()
        tau, v_b = brake(-back, V, theta)
        for v in np.linspace(-back, V, 9):
            can = a if lag == 0.0 else min(a, (v + V) / lag)
            assert 0.0 < (v + v_b) / tau <= can + 1e-4


@pytest.mark.parametrize("name", ["distance", "period_s", "speed", "acceleration"])
def test_impossible_numbers_are_refused(name: str) -> None:
    for value in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ConfigError, match=name):
            Separation(**({"distance": 3.0} | {name: value}))


def test_an_other_as_fast_as_the_follower_is_refused() -> None:
    with pytest.raises(ConfigError, match="a faster follower"):
        Separation(distance=3.0, speed=2.0, approach=2.0)


def test_spread_is_taken_where_the_other_comes_to_rest() -> None:
    """One standard deviation of speed is worth lag metres once it rests: exact for an old fix."""
    theta = Separation(distance=3.0, lag_s=0.0, acceleration=2.0, speed=9.0, other_lag_s=1.5, sigmas=2.0).theta()
    sure = largest_approach(10.0, 0.0, 1.0, 0.0, 60.0, 0.0, 0.0, 0.0, theta)
    vague = largest_approach(10.0 + 2.0 * sqrt(0.01 + 1.5**2 * 0.04), 0.0, 1.0, 0.0, 60.0, 0.01, 0.0, 0.04, theta)
    assert vague == pytest.approx(sure, rel=1e-9)
