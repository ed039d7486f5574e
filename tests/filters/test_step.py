"""One event, whatever it holds: the estimate stays finite, the covariance one, and every record has a verdict."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import channel, drone, prior, rover, same, start

from outrider.data import Verdict
from outrider.filters import step as one
from outrider.filters.engine import Filter, OnlineFilter
from outrider.filters.step import C_INPUT, C_NOW, C_RESETS, OUT_DOF, OUT_NIS, OUT_S, OUT_STATE, OUT_VERDICT, OUT_Y, ROWS
from outrider.models.motion import LaggedFollower, Motion, OmnidirectionalBody
from outrider.models.sensors import Attitude, Gyro, Heading, Nonholonomic, Position, Range, SpecificForce, Twist

NASTY = [0.0, -0.0, 1.0, -1.0, 1e-320, 1e-12, 1e6, -1e9, 1e20, 1e150, 1e308, -1e308, np.inf, -np.inf, np.nan]
numbers = st.one_of(st.sampled_from(NASTY), st.floats(-100.0, 100.0), st.floats())
rows = st.lists(numbers, min_size=ROWS, max_size=ROWS).map(np.array)
kind_rows = st.lists(st.floats(-3.0, 3.0), min_size=ROWS, max_size=ROWS).map(np.array)
gaps = st.one_of(st.just(0.0), st.floats(0.0, 1.0), st.sampled_from([5.0, 60.0, -0.5]))
flags = st.sampled_from([Verdict.USED] * 6 + [Verdict.WITHHELD, Verdict.FROZEN])
events = st.lists(
    st.tuples(st.integers(0, 9), gaps, st.one_of(rows, kind_rows), st.one_of(rows, kind_rows.map(np.abs)), flags),
    min_size=1,
    max_size=12,
)


def omnidirectional() -> Filter:
    """Fifteen states with every kind of Jacobian."""
    theta = OmnidirectionalBody().theta()
    models = (Position(), Attitude(), Twist(), Gyro(), SpecificForce(), Heading(), Range(beacon=(3.0, 0.0, 1.0)))
    channels = tuple(channel(m.code.name, m, reset=(0, 3) if k == 0 else (0, 0)) for k, m in enumerate(models))
    return Filter(motion=Motion.OMNIDIRECTIONAL, theta=theta, coasting=theta, channels=channels)


def follower(*, probability: float = 0.999, reset: tuple[int, int] = (0, 3)) -> Filter:
    theta = LaggedFollower().theta()
    fix = channel("position", Position(sigma=0.1), reset=reset, probability=probability)
    return Filter(motion=Motion.FOLLOWER, theta=theta, coasting=theta, channels=(fix,))


def assert_sound(s: one.State, before: float = 0.1) -> None:
    """Finite, symmetric, no negative eigenvalue beyond rounding: of what a variance was before a perfect record, of a
    deviation of `before`."""
    assert np.isfinite(s.x).all() and np.isfinite(s.P).all() and np.isfinite(s.u).all()
    assert (s.P == s.P.T).all()
    scale = np.maximum(np.sqrt(np.diag(s.P)), max(1e-6, 3e-6 * before))  # four roundings of before^2
    assert np.linalg.eigvalsh(s.P / np.outer(scale, scale))[0] > -1e-4


@pytest.mark.compiled
@pytest.mark.parametrize("make", [rover, drone, omnidirectional, follower])
@settings(max_examples=60, derandomize=True)
@given(sequence=events)
def test_no_record_can_spoil_the_estimate(make, sequence):
    f = make()
    filter_, t, before = OnlineFilter(f, start(f), 0.0), 0.0, 0.1
    for src, gap, z, r, flag in sequence:
        t += gap
        before = max(
            before, t, float(np.sqrt(np.diag(filter_.state.P).max()))
        )  # what it does not see, it soon knows not
        out = filter_.process(t, src % len(f.channels), z, r, flag=int(flag))
        verdict = Verdict(int(out[OUT_VERDICT]))
        if flag not in (Verdict.USED, Verdict.WITHHELD):
            assert verdict in (flag, Verdict.LATE)
        assert_sound(filter_.state, before)
    # and it can still be used
    for k in range(5):
        filter_.process(t + 3.0 + k, len(f.channels) - 1, np.zeros(ROWS), np.ones(ROWS))
        assert_sound(filter_.state)


@pytest.mark.compiled
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e308, 1e150, 1e20, 1e5])
def test_a_bad_input_is_refused_and_the_next_good_one_is_not(bad):
    f = drone()
    filter_, rest = OnlineFilter(f, start(f), 0.0), np.array([0.0, 0.0, 0.0, 0.0, 0.0, 9.806])
    for k in range(5):
        filter_.process(0.02 * k, 0, rest, np.ones(6))
    before = one.snapshot(filter_.state)
    for column in range(6):
        z = rest.copy()
        z[column] = bad
        out = filter_.process(0.1, 0, z, np.ones(6), order=column)
        assert out[OUT_VERDICT] == Verdict.IMPLAUSIBLE
        for name in ("x", "P", "u", "age"):
            assert getattr(filter_.state, name).tobytes() == getattr(before, name).tobytes()
        assert filter_.state.clock[C_INPUT] == before.clock[C_INPUT]
    assert filter_.process(0.12, 0, rest, np.ones(6))[OUT_VERDICT] == Verdict.INPUT
    assert np.abs(filter_.state.x[:6]).max() < 1e-3


def test_an_input_that_would_overflow_the_covariance_is_refused():
    """The velocity moves by the specific force times an attitude of which nothing is known: too much for any number."""
    f = drone()
    filter_, hard = OnlineFilter(f, prior(f.layout, 1e14), 0.0), np.full(6, 999.0)
    seen = {int(filter_.process(0.1 * k, 0, hard, np.ones(6))[OUT_VERDICT]) for k in range(9)}
    assert Verdict.DIVERGED in seen
    assert_sound(filter_.state)


@pytest.mark.parametrize("make", [drone, omnidirectional])
def test_turning_many_radians_a_step_is_followed(make):
    """Exp(-w dt) only turns the attitude's covariance, however fast, and every step adds its noise."""
    f = make()
    x, u = f.layout.zeros(), np.array([300.0, -200.0, 100.0, 0.0, 0.0, 9.806])
    if "rate" in f.layout:
        x[f.layout.state("rate")] = u[:3]
    s = one.state(x, 1e-6 * np.eye(f.layout.error_size), 0.0, len(f.channels))
    s.u[:], s.fed[0], s.clock[C_INPUT] = u, u, 0.0
    a = f.layout.error("attitude")
    before = np.trace(s.P[a, a])
    one.predict(f.model(), s, 0.4, one.scratch(f.layout.size, f.layout.error_size))
    assert one.healthy(s)
    assert before < np.trace(s.P[a, a]) < 0.1


def test_rows_without_a_usable_variance_are_left_out():
    f = follower()
    belief = prior(f.layout)
    whole, partial = OnlineFilter(f, belief, 0.0), OnlineFilter(f, belief, 0.0)
    only_x = replace(f, channels=(channel("x", Position(), use=(0,)),))
    alone = OnlineFilter(only_x, belief, 0.0)
    for bad in (np.inf, np.nan, -1.0, -np.inf):
        z, r = np.array([0.5, 7.0, 7.0]), np.array([0.04, bad, bad])
        out = partial.process(0.0, 0, z, r)
        assert out[OUT_DOF] == 1
        alone.process(0.0, 0, z, np.array([0.04, np.inf, np.inf]))
    assert partial.state.x.tobytes() == alone.state.x.tobytes()
    assert partial.state.P.tobytes() == alone.state.P.tobytes()
    none = whole.process(0.0, 0, np.zeros(3), np.full(3, np.nan))
    assert none[OUT_VERDICT] == Verdict.NOT_OBSERVING and none[OUT_DOF] == 0
    assert (whole.state.P == belief.P).all()


def test_a_value_that_is_no_number_costs_its_row_only():
    f = follower()
    filter_ = OnlineFilter(f, prior(f.layout), 0.0)
    out = filter_.process(0.0, 0, np.array([0.5, np.nan, 0.5]), np.full(3, 0.25))
    assert out[OUT_VERDICT] == Verdict.USED and out[OUT_DOF] == 2
    np.testing.assert_allclose(np.diag(filter_.state.P)[:3], [0.2, 1.0, 0.2])
    np.testing.assert_allclose(filter_.state.x[:3], [0.4, 0.0, 0.4])


def test_rows_keep_their_places_when_others_are_missing():
    """The innovation is by the sensor's rows, whichever of them a record has."""
    f = follower(reset=(0, 3))
    for missing in range(3):
        filter_ = OnlineFilter(f, prior(f.layout), 0.0)
        z, r = np.array([0.1, 0.2, 0.3]), np.full(3, 0.25)
        (z if missing else r)[missing] = np.nan
        out = filter_.process(0.0, 0, z, r)
        there = np.arange(3) != missing
        np.testing.assert_allclose(out[OUT_Y : OUT_Y + 3][there], np.array([0.1, 0.2, 0.3])[there])
        np.testing.assert_allclose(out[OUT_S : OUT_S + 3][there], np.sqrt(1.25))
        assert np.isnan(out[[OUT_Y + missing, OUT_S + missing]]).all()
        assert np.isnan(out[OUT_Y + 3 : OUT_S]).all()


def test_a_reset_by_a_record_without_its_first_row_moves_the_rows_it_has():
    f = follower()
    filter_ = OnlineFilter(f, prior(f.layout, 0.1), 0.0)
    for k in range(60):
        out = filter_.process(0.25 * k, 0, np.array([np.nan, 300.0, -200.0]), np.full(3, 0.01))
        if out[OUT_VERDICT] == Verdict.RESET:
            break
    assert out[OUT_VERDICT] == Verdict.RESET
    np.testing.assert_allclose(filter_.state.x[:3], [0.0, 300.0, -200.0], atol=5.0)


def test_a_perfect_measurement_is_believed_and_its_repetition_is_harmless():
    f = follower(probability=1.0)
    filter_ = OnlineFilter(f, prior(f.layout), 0.0)
    for k in range(3):
        filter_.process(0.0, 0, np.array([0.5, 0.2, 0.1]), np.zeros(3), order=k)
        np.testing.assert_allclose(filter_.state.x[:3], [0.5, 0.2, 0.1])
        assert_sound(filter_.state)


def test_the_outcome_is_the_textbooks():
    """Verdict, NIS, innovation, its deviation against the plain formulas of a Kalman filter."""
    f = follower()
    filter_ = OnlineFilter(f, prior(f.layout, 1.0, position=2.0), 0.0)
    out = filter_.process(0.0, 0, np.array([1.0, -1.0, 0.5]), np.full(3, 0.25))
    S = 4.25
    assert out[OUT_VERDICT] == Verdict.USED and out[OUT_DOF] == 3
    assert out[OUT_NIS] == pytest.approx((1.0 + 1.0 + 0.25) / S)
    np.testing.assert_allclose(out[OUT_Y : OUT_Y + 3], [1.0, -1.0, 0.5])
    np.testing.assert_allclose(out[OUT_S : OUT_S + 3], np.sqrt(S))
    assert np.isnan(out[OUT_Y + 3 : OUT_S]).all() and np.isnan(out[OUT_S + 3 : OUT_STATE]).all()
    np.testing.assert_allclose(filter_.state.x[:3], np.array([1.0, -1.0, 0.5]) * 4.0 / S)
    np.testing.assert_allclose(np.diag(filter_.state.P)[:3], 4.0 * 0.25 / S)


def test_prediction_does_not_depend_on_how_a_gap_is_cut():
    """A constant velocity is linear: one step of a second or ten of a tenth give the same mean and covariance."""
    f = follower()
    x = f.layout.zeros()
    x[f.layout.state("velocity")] = (1.0, -2.0, 0.5)
    model, ws = f.model(), one.scratch(6, 6)
    long, short = (one.state(x, np.eye(6), 0.0, 1) for _ in range(2))
    model.limits[0] = 1.0
    one.predict(model, long, 1.0, ws)
    model.limits[0] = 0.1
    one.predict(model, short, 1.0, ws)
    np.testing.assert_allclose(short.x, long.x, atol=1e-12)
    np.testing.assert_allclose(short.P, long.P, atol=1e-12)
    assert long.clock[C_NOW] == short.clock[C_NOW] == 1.0
    np.testing.assert_allclose(long.x[:3], [1.0, -2.0, 0.5])
    assert long.P[0, 0] == pytest.approx(1.0 + 1.0 + 1.0 / 3.0)


def test_time_never_runs_backwards():
    f = follower()
    s, ws = one.state(f.layout.zeros(), np.eye(6), 5.0, 1), one.scratch(6, 6)
    before = one.snapshot(s)
    one.predict(f.model(), s, 4.0, ws)
    assert same(before, s)


def test_snapshots_restore_to_the_bit():
    f = rover()
    filter_ = OnlineFilter(f, start(f), 0.0)
    saved = one.snapshot(filter_.state)
    filter_.process(1.0, 0, np.full(3, 0.3), np.ones(3))
    assert not same(saved, filter_.state)
    one.restore(filter_.state, saved)
    assert same(saved, filter_.state)


def test_age_says_what_was_looked_at_directly():
    f = rover()
    filter_ = OnlineFilter(f, start(f), 0.0)
    filter_.process(1.0, 0, np.full(3, 0.3), np.ones(3))
    age = filter_.state.age
    assert (age[f.layout.error("position")] == 1.0).all() and (age[f.layout.error("heading")] == 1.0).all()  # lever arm
    assert np.isneginf(age[f.layout.error("velocity")]).all() and np.isneginf(age[f.layout.error("gyro_bias")]).all()


def test_an_unobserved_record_is_named():
    """A constraint without rows, a beacon at the robot itself."""
    theta = LaggedFollower().theta()
    here = channel("range", Range(beacon=(0.0, 0.0, 0.0)))
    f = Filter(motion=Motion.FOLLOWER, theta=theta, coasting=theta, channels=(here,))
    filter_ = OnlineFilter(f, prior(f.layout), 0.0)
    assert filter_.process(0.0, 0, np.array([1.0, 3.0]), np.ones(1))[OUT_VERDICT] == Verdict.NOT_OBSERVING


def test_constraints_need_no_record():
    """A wheeled drone that cannot slide: the constraint takes speed out of sideways and leaves forward alone."""
    f = omnidirectional()
    f = replace(f, channels=(channel("rails", Nonholonomic(sigma_lateral=0.01, sigma_vertical=0.01), probability=1.0),))
    x = f.layout.zeros()
    x[f.layout.state("velocity")] = (2.0, 1.0, -1.0)
    filter_ = OnlineFilter(f, prior(f.layout, 1.0, x, attitude=1e-4), 0.0)
    filter_.process(0.0, 0, np.full(ROWS, np.nan), np.full(ROWS, 1e-4))
    v = filter_.state.x[f.layout.state("velocity")]
    assert v[0] == pytest.approx(2.0, abs=1e-3) and np.abs(v[1:]).max() < 1e-2


def test_a_reset_opens_the_covariance_and_stays_sound():
    f = rover()
    belief = start(f)
    rng = np.random.default_rng(0)
    A = rng.normal(size=belief.P.shape)
    belief.P[:] = 1e-2 * (A @ A.T) + 1e-6 * np.eye(A.shape[0])
    s, ws = one.state(belief.x, belief.P, 0.0, len(f.channels)), one.scratch(f.layout.size, f.layout.error_size)
    ws.y[:2], ws.row[:2] = (30.0, -40.0), (0, 1)
    one.widen(f.sources(), s, 0, 2, ws)
    assert_sound(s)
    assert s.P[0, 0] == pytest.approx(belief.P[0, 0] + 900.0) and s.P[1, 1] == pytest.approx(belief.P[1, 1] + 1600.0)
    assert not s.P[0, 2:].any() and not s.P[2:, 1].any()
    np.testing.assert_array_equal(s.P[2:, 2:], belief.P[2:, 2:])
    assert s.clock[C_RESETS] == 1


@pytest.mark.parametrize("bad", [np.nan, np.inf, -1.0, 1e31])
def test_healthy_notices(bad):
    f = follower()
    s = one.state(f.layout.zeros(), np.eye(6), 0.0, 1)
    assert one.healthy(s)
    s.P[3, 3] = bad
    assert not one.healthy(s)
    s.P[3, 3], s.x[2] = 1.0, np.nan
    assert not one.healthy(s)
