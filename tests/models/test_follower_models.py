"""The follower's discrete steps against scipy's matrix exponential, and the printed model's growth."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from outrider.errors import ConfigError
from outrider.filters.following.steps import predict
from outrider.models.motion import follower
from outrider.models.motion.following import (
    CONSTANT_VELOCITY,
    STEP,
    FollowerModel,
    Variant,
    lag_step,
    literal_step,
)  # fmt: skip


def step(model: FollowerModel, dt: float) -> np.ndarray:
    c = np.zeros((3, STEP))
    lag_step(dt, model.theta(), c)
    return c


def van_loan(tau: float, a: float, w: float, dt: float):
    """(F, B, Q) of one axis by the matrix exponential."""
    A = np.array([[0.0, 1.0, 0.0], [0.0, -1.0 / tau, 1.0 / tau], [0.0, 0.0, 0.0]])
    M = np.zeros((6, 6))
    M[:3, :3], M[:3, 3:], M[3:, 3:] = -A, np.diag([0.0, a * a, w * w]), A.T
    return expm(A * dt), expm(A * dt) @ expm(M * dt)[:3, 3:]


@settings(max_examples=40)
@given(tau=st.floats(0.05, 20.0), share=st.floats(0.01, 3.0), a=st.floats(0.0, 2.0), w=st.floats(0.0, 1.0))
def test_the_lag_is_solved_exactly(tau, share, a, w):
    dt = share * tau
    model = FollowerModel(lag=tau, lag_z=tau, acceleration=max(a, 1e-3), acceleration_z=a, wind=w, wind_z=w)
    c = step(model, dt)
    F, Q = van_loan(tau, a, w, dt)
    np.testing.assert_allclose(c[2, :4], [F[0, 1], F[1, 1], F[0, 2], F[1, 2]], rtol=1e-12, atol=1e-13)
    found = np.array([[c[2, 4], c[2, 5], c[2, 7]], [c[2, 5], c[2, 6], c[2, 8]], [c[2, 7], c[2, 8], c[2, 9]]])
    np.testing.assert_allclose(found, Q, rtol=1e-11, atol=1e-11 * max(np.abs(Q).max(), 1e-300))


def test_the_mean_is_the_closed_solution():
    """x(t) of v' = (u - v) / tau by hand, and by the general engine's model of the same drone."""
    tau, dt, u = 0.7, 0.9, np.array([2.0, -1.0, 0.3])
    x, P = np.array([1.0, 2.0, 3.0, 0.5, -0.4, 0.1]), np.eye(6)
    v0, p0, e = x[3:].copy(), x[:3].copy(), np.exp(-dt / tau)
    other, F, Q = x.copy(), np.eye(6), np.zeros((6, 6))
    predict(x, P, u, step(FollowerModel(lag=tau, lag_z=tau), dt))
    np.testing.assert_allclose(x[3:], u + (v0 - u) * e, rtol=0, atol=1e-12)
    np.testing.assert_allclose(x[:3], p0 + u * dt + (v0 - u) * tau * (1 - e), rtol=0, atol=1e-12)
    follower.propagate(other, dt, u, np.array([tau, 0.3]), F, Q)
    np.testing.assert_allclose(other, x, rtol=0, atol=1e-12)


@settings(max_examples=25)
@given(dt=st.floats(0.01, 3.0), share=st.floats(0.05, 0.95), tau=st.sampled_from([0.2, 0.5, 2.0, CONSTANT_VELOCITY]))
def test_two_short_steps_are_one_long_one(dt, share, tau):
    model = FollowerModel(lag=tau, lag_z=tau, acceleration=0.4, acceleration_z=0.2, wind=0.1, wind_z=0.05)
    rng = np.random.default_rng(5)
    A = rng.normal(size=(9, 9))
    x, P, u = rng.normal(size=9), A @ A.T, rng.normal(size=3)
    x2, P2 = x.copy(), P.copy()
    predict(x, P, u, step(model, dt))
    predict(x2, P2, u, step(model, share * dt))
    predict(x2, P2, u, step(model, dt - share * dt))
    np.testing.assert_allclose(x2, x, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(P2, P, rtol=1e-11, atol=1e-12)


def test_the_printed_model_reaches_twenty_metres_a_second():
    """swarm2023 section 3.1: ten seconds of a commanded 2 m/s, without measurements (papers.md B1)."""
    u = np.tile([2.0, 0.0, 0.0], (10, 1))
    ends = {}
    for variant in (Variant.PAPER_LITERAL, Variant.INCREMENT, Variant.LAG):
        c = step(FollowerModel(lag=1e-3, lag_z=1e-3), 1.0) if variant is Variant.LAG else literal_step(1.0, np.zeros(6))
        x, P = np.zeros(6), np.zeros((6, 6))
        for row in variant.inputs(u):
            predict(x, P, row, c)
        ends[variant] = x[[0, 3]]
    np.testing.assert_allclose(ends[Variant.PAPER_LITERAL], [90.0, 20.0], atol=1e-12)
    np.testing.assert_allclose(ends[Variant.INCREMENT], [18.0, 2.0], atol=1e-12)  # p uses the speed before the step
    np.testing.assert_allclose(ends[Variant.LAG], [20.0, 2.0], atol=3e-3)
    assert [v.exact for v in Variant] == [True, True, False]


def test_a_target_turns_more_than_it_brakes():
    """Noise across the course is stronger, whatever the course; a hovering one may go anywhere."""
    model = FollowerModel.target(acceleration=0.2, turn=1.0, acceleration_z=0.1)
    c = step(model, 0.5)
    for course in np.linspace(-3.0, 3.0, 7):
        x, P = np.zeros(6), np.zeros((6, 6))
        d, l = np.array([np.cos(course), np.sin(course)]), np.array([-np.sin(course), np.cos(course)])
        x[3:5] = 3.0 * d
        predict(x, P, np.zeros(3), c)
        V = P[3:5, 3:5]
        np.testing.assert_allclose([d @ V @ d, l @ V @ l, d @ V @ l], [0.02, 0.5, 0.0], atol=1e-14)
        np.testing.assert_allclose(P, P.T, atol=0)
        assert np.linalg.eigvalsh(P)[0] > -1e-15
    x, P = np.zeros(6), np.zeros((6, 6))
    predict(x, P, np.zeros(3), c)
    np.testing.assert_allclose(np.diag(P)[3:], [0.5, 0.5, 0.005], atol=1e-14)


@pytest.mark.parametrize(
    "bad", [{"lag": 0.0}, {"lag": np.inf}, {"acceleration": -1.0}, {"wind": np.nan}, {"turn": 0.1}]
)
def test_impossible_numbers_are_refused(bad):
    with pytest.raises(ConfigError):
        FollowerModel(**bad)
