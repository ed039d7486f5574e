"""Half-planes and the nearest velocity, against scipy's optimisers; what two robots do by them."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog, minimize

from outrider.errors import ConfigError, UsageError
from outrider.guidance.avoidance import Avoidance, avoid
from outrider.guidance.halfplanes import (
    BROKEN,
    KEPT,
    PARTED,
    braking,
    chosen,
    nearest_velocity,
    reciprocal,
    way_to_rest,
)
from outrider.typing import Floats

SEED = st.integers(0, 2**32 - 1)
SPEED, REACH = 5.0, 2.0


def problem(seed: int, n: int) -> tuple[Floats, tuple[float, float], tuple[float, float]]:
    """Lines, the velocity now, the wanted one."""
    rng = np.random.default_rng(seed)
    angle = rng.uniform(-np.pi, np.pi, n)
    lines = np.column_stack([np.cos(angle), np.sin(angle), rng.uniform(-2.0, 4.0, n)])
    v, want = rng.uniform(-3.0, 3.0, (2, 2))
    return lines, (float(v[0]), float(v[1])), (float(want[0]), float(want[1]))


def excess(lines: Floats, x: Floats, v: tuple[float, float]) -> float:
    """By how much x breaks the worst of all lines and discs."""
    discs = [np.hypot(*(x - v)) - REACH, np.hypot(*x) - max(SPEED, np.hypot(*v))]
    return float(max([*(lines[:, :2] @ x - lines[:, 2]), *discs]))


def scipy_nearest(lines: Floats, v: tuple[float, float], want: tuple[float, float]) -> Floats:
    """The same problem by SLSQP."""
    limits = [
        {"type": "ineq", "fun": lambda x: lines[:, 2] - lines[:, :2] @ x},
        {"type": "ineq", "fun": lambda x: REACH**2 - (x[0] - v[0]) ** 2 - (x[1] - v[1]) ** 2},
        {"type": "ineq", "fun": lambda x: max(SPEED**2, v[0] ** 2 + v[1] ** 2) - x @ x},
    ]
    return minimize(lambda x: np.sum((x - want) ** 2), np.array(v), constraints=limits, options={"ftol": 1e-13}).x


@settings(max_examples=60)
@given(SEED, st.integers(0, 8))
def test_the_nearest_velocity_keeps_every_line_and_is_scipys(seed: int, n: int) -> None:
    lines, v, want = problem(seed, n)
    x, y, found = nearest_velocity(lines, n, n, 0.0, want, v, REACH, SPEED)
    theirs = scipy_nearest(lines, v, want)
    if not found:
        assert excess(lines, theirs, v) > -1e-6  # nothing is inside for them either
        return
    assert excess(lines, np.array([x, y]), v) < 1e-6
    if excess(lines, theirs, v) < 1e-6:
        ours, others = np.hypot(x - want[0], y - want[1]), np.hypot(*(theirs - want))
        assert ours <= others + 1e-5


@settings(max_examples=40)
@given(SEED, st.integers(1, 8), st.integers(0, 4))
def test_lines_give_way_by_rank_and_by_the_least_amount(seed: int, n: int, firm: int) -> None:
    lines, v, want = problem(seed, n + firm)
    x, y, rank = chosen(lines, firm, n + firm, want, v, REACH, SPEED)
    at = np.array([x, y])
    off = lines[:, :2] @ at - lines[:, 2]
    assert np.hypot(*(at - v)) <= REACH * (1 + 1e-6)
    if rank == KEPT:
        assert off.max() < 1e-6
        return
    eased = lines if rank == PARTED else lines[:firm]
    if rank == PARTED and firm:
        assert off[:firm].max() < 1e-6
    soft = np.arange(len(eased)) >= (firm if rank == PARTED else 0)
    # min e: a.x <= b + e for soft lines, within polygons inside and outside of the discs: a bound from either side
    around = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
    ring = np.column_stack([np.cos(around), np.sin(around)])
    least: list[float] = []
    for share in (1.0, np.cos(np.pi / 720)):
        top = max(SPEED, float(np.hypot(*v)))
        A = np.vstack([
            np.column_stack([eased[:, :2], -soft.astype(float)]),
            np.column_stack([ring, np.zeros(720)]),
            np.column_stack([ring, np.zeros(720)]),
        ])  # fmt: skip
        b = np.concatenate([eased[:, 2], ring @ v + REACH * share, np.full(720, top * share)])
        done = linprog([0.0, 0.0, 1.0], A_ub=A, b_ub=b, bounds=[(None, None)] * 2 + [(0.0, None)])
        assume(done.status == 0)
        least.append(float(done.fun))
    worst = max(0.0, float((off[: len(eased)])[soft].max()))
    assert least[0] - 1e-5 <= worst <= least[1] + 1e-5
    assert rank in (PARTED, BROKEN)


@settings(max_examples=60)
@given(SEED, st.floats(0.0, 0.5))
def test_two_that_keep_their_reciprocal_lines_do_not_meet_within_the_horizon(seed: int, left: float) -> None:
    rng = np.random.default_rng(seed)
    p, v, o = rng.uniform(-8.0, 8.0, 2), rng.uniform(-4.0, 4.0, 2), rng.uniform(-4.0, 4.0, 2)
    R, T = 1.5, 3.0
    assume(np.hypot(*p) > R * 1.01)
    a = np.array(reciprocal(*p, *v, *o, R, T, left, 0.5))
    b = np.array(reciprocal(*-p, *o, *v, R, T, left, 0.5))
    np.testing.assert_allclose(a[:2], -b[:2], atol=1e-9)  # the same line, from both sides
    for _ in range(20):
        mine, theirs = rng.uniform(-6.0, 6.0, 2), rng.uniform(-6.0, 6.0, 2)
        mine -= max(0.0, a[:2] @ mine - a[2]) * a[:2]
        theirs -= max(0.0, b[:2] @ theirs - b[2]) * b[:2]
        t = np.linspace(0.0, T, 400)
        assert np.hypot(*(p[:, None] + np.outer(theirs - mine, t))).min() > R - 1e-6


@settings(max_examples=80)
@given(SEED)
def test_two_that_keep_their_braking_lines_can_always_stop(seed: int) -> None:
    rng = np.random.default_rng(seed)
    keep, react, brake = 2.0, 0.8, 3.0
    p, v, o = rng.uniform(-12.0, 12.0, 2), rng.uniform(-4.0, 4.0, 2), rng.uniform(-4.0, 4.0, 2)
    n, D = p / np.hypot(*p), float(np.hypot(*p))
    rest = way_to_rest(v @ n, react, brake) + way_to_rest(-o @ n, react, brake)
    assume(D - keep - rest > 0.0)
    a = np.array(braking(*p, *v, *o, keep, react, brake, np.inf, 0.5, 0.5))
    b = np.array(braking(*-p, *o, *v, keep, react, brake, np.inf, 0.5, 0.5))
    assert a[2] >= 0.0 <= b[2]  # standing is allowed
    assert way_to_rest(a[2], react, brake) + way_to_rest(b[2], react, brake) <= D - keep + 1e-9
    # alone against one that stays as it is, all of the room is allowed, and not more
    alone = np.array(braking(*p, *v, 0.0, 0.0, keep, react, brake, np.inf, 1.0, 0.5))
    assert way_to_rest(alone[2], react, brake) == pytest.approx(D - keep)


def test_who_goes_away_may_be_followed_by_what_it_needs_to_stop() -> None:
    a = braking(6.0, 0.0, 3.0, 0.0, 3.0, 0.0, 2.0, 0.5, 3.0, 4.0, 1.0, 0.5)
    assert way_to_rest(a[2], 0.5, 3.0) == pytest.approx(6.0 - 2.0 + 9.0 / 8.0)
    near = braking(1.5, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0, 0.5, 3.0, 4.0, 0.5, 0.5)
    assert near == pytest.approx((1.0, 0.0, -0.25))  # too near: it goes away


def fly(p: Floats, goals: Floats, seconds: float, rules: Avoidance, speed: float = 3.0) -> tuple[Floats, float]:
    """Where robots end that know all, with the lag of their velocity; and the least distance between two of them."""
    v, dt, least = np.zeros_like(p), 0.1, np.inf
    for _ in range(round(seconds / dt)):
        to = goals - p
        d = np.maximum(np.hypot(to[:, 0], to[:, 1]), 1e-9)[:, None]
        out, _ = avoid(p, v, to / d * np.minimum(speed, d), rules)
        v = v + np.clip((out - v) / rules.response_s, -rules.acceleration, rules.acceleration) * dt
        p = p + v * dt
        d2 = np.hypot(*(p[:, None] - p[None]).transpose(2, 0, 1)) + np.diag(np.full(len(p), np.inf))
        least = min(least, float(d2.min()))
    return p, least


def test_an_exact_mirror_image_is_passed_on_the_right_by_both() -> None:
    rules = Avoidance()
    p = np.array([[-15.0, 0.0], [15.0, 0.0]])
    half, least = fly(p, -p, 6.0, rules)
    assert half[0, 1] < -0.3 and half[1, 1] > 0.3  # each to its right
    np.testing.assert_allclose(half[0], -half[1], atol=1e-9)
    assert least >= rules.separation
    done, least = fly(p, -p, 20.0, rules)
    np.testing.assert_allclose(done, -p, atol=0.1)
    assert least >= rules.separation


def test_a_robot_that_is_passed_clearly_on_the_left_is_passed_there() -> None:
    p, v = np.array([[0.0, 0.0], [10.0, -1.2]]), np.array([[2.0, 0.0], [-2.0, 0.0]])
    out, ranks = avoid(p, v, v)
    assert out[0, 1] > 0.0 > out[1, 1] and (ranks == KEPT).all()


def test_who_is_in_another_layer_is_no_neighbour() -> None:
    p, v = np.array([[0.0, 0.0, 10.0], [4.0, 0.0, 14.0]]), np.array([[3.0, 0.0], [-3.0, 0.0]])
    np.testing.assert_array_equal(avoid(p, v, v, layer=3.0)[0], v)
    assert avoid(p, v, v, layer=5.0)[0][0, 0] < 3.0


def test_rules_that_cannot_be() -> None:
    with pytest.raises(ConfigError, match="brake harder"):
        Avoidance(brake=5.0)
    with pytest.raises(ConfigError, match="separation"):
        Avoidance(separation=0.0)
    with pytest.raises(ConfigError, match="margin"):
        Avoidance(margin=float("nan"))


def test_what_is_no_place_or_velocity_is_refused() -> None:
    p, v = np.zeros((3, 2)), np.zeros((3, 2))
    for bad in ((p, v[:2], v), (p, v, v[:, :1]), (p.ravel(), v, v)):
        with pytest.raises(UsageError, match="places"):
            avoid(*bad)
    with pytest.raises(UsageError, match="not finite"):
        avoid(p, v, np.where(np.eye(3)[:, :2] > 0, np.nan, v))


def test_robots_in_one_place_do_not_give_nan() -> None:
    out, _ = avoid(np.zeros((4, 2)), np.zeros((4, 2)), np.ones((4, 2)))
    assert np.isfinite(out).all()
