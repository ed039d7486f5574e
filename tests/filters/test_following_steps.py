"""Compiled follower steps against plain algebra, rows against single ones."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.filters import ekf
from outrider.filters.following import steps
from outrider.models.motion.following import STEP, FollowerModel, lag_step

MODEL = FollowerModel(acceleration=0.4, wind=0.05, wind_z=0.02)


def some(n: int, seed: int):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, n))
    return rng.normal(size=n), A @ A.T + 0.1 * np.eye(n), rng


def dense(c: np.ndarray, n: int):
    """(F, B, Q) of a step as matrices."""
    F, B, Q = np.eye(n), np.zeros((n, 3)), np.zeros((n, n))
    for i in range(3):
        reach, keep, drift, gain, pp, pv, vv, pw, vw, ww, _ = c[i]
        F[i, 3 + i], F[3 + i, 3 + i], B[i, i], B[3 + i, i] = reach, keep, drift, gain
        Q[i, i], Q[i, 3 + i], Q[3 + i, 3 + i] = pp, pv, vv
        if n == 9:
            F[i, 6 + i], F[3 + i, 6 + i] = drift, gain
            Q[i, 6 + i], Q[3 + i, 6 + i], Q[6 + i, 6 + i] = pw, vw, ww
    return F, B, np.triu(Q) + np.triu(Q, 1).T


@settings(max_examples=25)
@given(n=st.sampled_from([6, 9]), seed=st.integers(0, 10_000), dt=st.floats(0.01, 2.0))
def test_a_step_is_the_kalman_filter(n, seed, dt):
    x, P, rng = some(n, seed)
    u, c = rng.normal(size=3), np.zeros((3, STEP))
    lag_step(dt, MODEL.theta(), c)
    F, B, Q = dense(c, n)
    want_x, want_P = F @ x + B @ u, F @ P @ F.T + Q
    steps.predict(x, P, u, c)
    np.testing.assert_allclose(x, want_x, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(P, want_P, rtol=1e-11, atol=1e-11)


@settings(max_examples=40)
@given(
    n=st.sampled_from([6, 9]),
    at=st.sampled_from([0, 3]),
    seed=st.integers(0, 10_000),
    seen=st.lists(st.booleans(), min_size=3, max_size=3).filter(any),
)
def test_an_update_is_the_kalman_filter(n, at, seed, seen):
    x, P, rng = some(n, seed)
    z, r = rng.normal(size=3), rng.uniform(0.01, 2.0, 3)
    r[~np.array(seen)] = np.inf
    rows = np.flatnonzero(seen)
    H, y, R = np.eye(n)[at + rows], (z - x[at : at + 3])[rows], np.diag(r[rows])
    S = H @ P @ H.T + R
    K = np.linalg.solve(S, H @ P).T
    want_x, want_P = x + K @ y, (np.eye(n) - K @ H) @ P @ (np.eye(n) - K @ H).T + K @ R @ K.T
    nis, det = steps.update(x, P, at, z, r, np.inf)
    np.testing.assert_allclose(x, want_x, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(P, want_P, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose([nis, det], [y @ np.linalg.solve(S, y), np.linalg.det(S)], rtol=1e-9)
    np.testing.assert_array_equal(P, P.T)


def test_what_the_gate_refuses_changes_nothing():
    x, P, _ = some(9, 3)
    before = x.copy(), P.copy()
    nis, _ = steps.update(x, P, 0, x[:3] + 50.0, np.full(3, 0.1), 16.0)
    assert nis > 16.0
    nis, _ = steps.update_course(x, P, 0.0, 1e-12, True, 0.0, 1e-9, np.zeros(9))
    np.testing.assert_array_equal(x, before[0])
    np.testing.assert_array_equal(P, before[1])


def test_a_thousandfold_sharper_fix_leaves_a_true_covariance():
    """P of 1e10 m^2 and r of 1e-10 m^2, as swarm2023's tuning has them: the rest is r, not rounding."""
    x, P = np.zeros(6), 1e10 * np.eye(6)
    steps.update(x, P, 0, np.ones(3), np.full(3, 1e-10), np.inf)
    np.testing.assert_allclose(np.diag(P)[:3], 1e-10, rtol=1e-12)


@pytest.mark.parametrize(("n", "air"), [(6, True), (9, False), (9, True)])
def test_course_and_heading_have_the_right_jacobian(n, air):
    """Against differences, and the update against the general filter."""
    x, P, _ = some(n, 11)
    P *= 0.01
    x[3:5] = 3.0, -2.0

    def direction(y):
        v = y[3:5] - (y[6:8] if air and n == 9 else 0.0)
        return np.arctan2(v[1], v[0])

    h = 1e-6
    H = np.array([[(direction(x + h * e) - direction(x - h * e)) / (2 * h) for e in np.eye(n)]])
    angle, r = direction(x) + 0.05, 0.02
    S = (H @ P @ H.T).item() + r
    want_x, want_P = x + (P @ H.T).ravel() * 0.05 / S, P - P @ H.T @ H @ P / S
    w = np.zeros(9)
    nis, s = steps.update_course(x, P, angle, r, air, 0.5, np.inf, w)
    np.testing.assert_allclose([nis, s], [0.05**2 / S, S], rtol=1e-8)
    np.testing.assert_allclose(x, want_x, atol=1e-8)
    np.testing.assert_allclose(P, want_P, atol=1e-8)


def test_a_heading_is_through_the_air_and_a_course_over_ground():
    """North over ground in a wind from the west: the nose points west of north, and only `heading` fits that."""
    x, P = np.zeros(9), np.diag([1.0] * 3 + [0.01] * 3 + [0.01] * 3)
    x[4], x[6] = 4.0, 1.0
    nose, w = np.arctan2(4.0, -1.0), np.zeros(9)
    fits, _ = steps.update_course(x.copy(), P.copy(), nose, 1e-3, True, 0.5, np.inf, w)
    wrong, _ = steps.update_course(x.copy(), P.copy(), nose, 1e-3, False, 0.5, np.inf, w)
    assert fits < 1e-9 < 10.0 < wrong
    slow, _ = steps.update_course(x.copy(), 300.0 * P, nose, 1e-3, True, 0.5, np.inf, w)
    assert np.isnan(slow)  # 4 m/s, give or take 2.4, says no direction


def test_rows_are_single_robots():
    rng, N = np.random.default_rng(2), 7
    X, P = rng.normal(size=(N, 9)), np.stack([some(9, k)[1] for k in range(N)])
    U, Z, R = rng.normal(size=(N, 3)), rng.normal(size=(N, 3)), rng.uniform(0.1, 1.0, (N, 3))
    Z[2] = np.nan
    x, p, c, nis = X.copy(), P.copy(), np.zeros((3, STEP)), np.zeros(N)
    lag_step(0.1, MODEL.theta(), c)
    ahead = np.zeros((N, 9))
    steps.forecast_rows(X, U, c, ahead)
    steps.predict_rows(X, P, U, c)
    np.testing.assert_allclose(ahead, X, atol=1e-15)
    fused = steps.update_rows(X, P, 0, Z, R, 16.0, nis)
    for k in range(N):
        steps.predict(x[k], p[k], U[k], c)
        if k != 2:
            steps.update(x[k], p[k], 0, Z[k], R[k], 16.0)
    np.testing.assert_array_equal(X, x)
    np.testing.assert_array_equal(P, p)
    assert np.isnan(nis[2]) and fused == np.sum(nis <= 16.0)


def test_agrees_with_the_general_filter():
    """The error-state filter of the engine, fed the same matrices."""
    x, P, rng = some(6, 8)
    z, r, n = rng.normal(size=3), np.array([0.1, 0.2, 0.3]), 6
    y, w = z - x[:3], ekf.workspace(n, 3)
    H = np.eye(6)[:3].copy()
    nis = ekf.innovate(P, H, r, y, 3, w)
    ours, _ = steps.update(x, P, 0, z, r, np.inf)
    np.testing.assert_allclose(ours, nis, rtol=1e-12)
    np.testing.assert_allclose(P, w.M[:, :6], atol=1e-12)
