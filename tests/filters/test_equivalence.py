"""On linear-Gaussian problems every filter is the Kalman filter."""

from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.data.belief import Ensemble, Gaussian, StateLayout
from outrider.filters import ekf, enkf, ukf


class Problem(NamedTuple):
    """x' = F x + w, z = H x + v, and a few measurements."""

    F: np.ndarray
    Q: np.ndarray
    H: np.ndarray
    R: np.ndarray
    belief: Gaussian
    zs: np.ndarray


def spd(rng, n, low=0.1):
    A = rng.normal(size=(n, n))
    return A @ A.T / n + low * np.eye(n)


def problem(seed, n, m, steps=6) -> Problem:
    rng = np.random.default_rng(seed)
    F = np.eye(n) + 0.3 * rng.normal(size=(n, n)) * (rng.random((n, n)) < 0.4)
    H = rng.normal(size=(m, n)) * (rng.random((m, n)) < 0.6)
    belief = Gaussian(rng.normal(size=n), spd(rng, n), StateLayout(("s", n, "m")))
    return Problem(F, 0.2 * spd(rng, n), H, spd(rng, m), belief, rng.normal(size=(steps, m)))


def kalman(p: Problem):
    """The textbook filter, in information form so that it shares no line with ours."""
    x, P, out = p.belief.x, p.belief.P, []
    for z in p.zs:
        x, P = p.F @ x, p.F @ P @ p.F.T + p.Q
        information = np.linalg.inv(P) + p.H.T @ np.linalg.inv(p.R) @ p.H
        x = np.linalg.solve(information, np.linalg.solve(P, x) + p.H.T @ np.linalg.solve(p.R, z))
        P = np.linalg.inv(information)
        out.append((x, P))
    return out


def run_ekf(p: Problem):
    b, out = p.belief, []
    for z in p.zs:
        b = ekf.predict(b, p.F @ b.x, p.F, p.Q)
        b = ekf.update(b, z - p.H @ b.x, p.H, p.R).belief
        out.append((b.x, b.P))
    return out


def run_iterated(p: Problem):
    b, out = p.belief, []
    for z in p.zs:
        b = ekf.predict(b, p.F @ b.x, p.F, p.Q)
        b = ekf.iterate(b, lambda x, z=z: (z - p.H @ x, p.H), p.R).belief
        out.append((b.x, b.P))
    return out


def run_ukf(p: Problem, spread=ukf.CUBATURE):
    b, out = p.belief, []
    for z in p.zs:
        b = ukf.predict(b, lambda x, dt: p.F @ x, 1.0, p.Q, spread=spread).belief
        b = ukf.update(b, lambda x, z=z: z - p.H @ x, p.R, spread=spread).belief
        out.append((b.x, b.P))
    return out


def run_ukf_wide(p: Problem):
    return run_ukf(p, ukf.Spread(alpha=0.7, beta=2.0, kappa=1.0))


def compare(ours, reference, tolerance=1e-9):
    for (x, P), (x_ref, P_ref) in zip(ours, reference, strict=True):
        np.testing.assert_allclose(x, x_ref, atol=tolerance * max(1.0, np.abs(x_ref).max()), rtol=0)
        np.testing.assert_allclose(P, P_ref, atol=tolerance * max(1.0, np.abs(P_ref).max()), rtol=0)


@pytest.mark.parametrize("run", [run_ekf, run_iterated, run_ukf, run_ukf_wide])
@settings(max_examples=12, derandomize=True)
@given(seed=st.integers(0, 10_000), n=st.integers(1, 7), m=st.integers(1, 5))
def test_filter_is_kalman_on_linear_problems(run, seed, n, m):
    p = problem(seed, n, m)
    compare(run(p), kalman(p))


def test_a_wrong_noise_would_be_noticed():
    p = problem(1, 4, 2)
    with pytest.raises(AssertionError):
        compare(run_ukf(p._replace(Q=p.Q * 1.0001)), kalman(p))


def test_agrees_with_filterpy():
    peer = pytest.importorskip("filterpy.kalman", reason="filterpy is not installed (dependency group bench)")
    p = problem(7, 6, 3)
    kf = peer.KalmanFilter(6, 3)
    kf.x, kf.P, kf.F, kf.Q, kf.H, kf.R = p.belief.x.copy(), p.belief.P.copy(), p.F, p.Q, p.H, p.R
    out = []
    for z in p.zs:
        kf.predict()
        kf.update(z)
        out.append((kf.x.copy(), kf.P.copy()))
    compare(run_ekf(p), out)
    compare(run_ukf(p), out)


@settings(max_examples=10, derandomize=True)
@given(seed=st.integers(0, 10_000), n=st.integers(2, 6), m=st.integers(2, 5))
def test_independent_measurements_one_by_one_equal_all_at_once(seed, n, m):
    p = problem(seed, n, m)
    R = np.diag(p.R).copy()
    joint = ekf.update(p.belief, p.zs[0] - p.H @ p.belief.x, p.H, R)
    single, single_ukf = p.belief, p.belief
    for k in np.random.default_rng(seed).permutation(m):
        row, z = p.H[[k]], p.zs[0, [k]]
        single = ekf.update(single, z - row @ single.x, row, R[[k]]).belief
        single_ukf = ukf.update(single_ukf, lambda x, z=z, row=row: z - row @ x, R[[k]]).belief
    compare([(single.x, single.P)], [(joint.belief.x, joint.belief.P)], 1e-10)
    compare([(single_ukf.x, single_ukf.P)], [(joint.belief.x, joint.belief.P)], 1e-10)


def exact_ensemble(belief: Gaussian, members, rng) -> Ensemble:
    """Members whose sample mean and covariance are the belief's to rounding."""
    n = belief.x.size
    W = rng.normal(size=(members, n))
    W -= W.mean(axis=0)
    W = W @ np.linalg.inv(np.linalg.cholesky(W.T @ W / (members - 1))).T
    return Ensemble(belief.x + W @ np.linalg.cholesky(belief.P).T, belief.layout)


@settings(max_examples=12, derandomize=True)
@given(seed=st.integers(0, 10_000), n=st.integers(1, 6), m=st.integers(1, 5))
def test_square_root_ensemble_is_kalman_given_exact_moments(seed, n, m):
    p, rng = problem(seed, n, m), np.random.default_rng(seed)
    ensemble = exact_ensemble(p.belief, 2 * n + 6, rng)
    ours = enkf.update_square_root(ensemble, lambda X: p.zs[0] - X @ p.H.T, p.R)
    truth = ekf.update(p.belief, p.zs[0] - p.H @ p.belief.x, p.H, p.R)
    moments, _ = enkf.moments(ours.belief)
    compare([(moments.x, moments.P)], [(truth.belief.x, truth.belief.P)])
    assert ours.nis == pytest.approx(truth.nis, rel=1e-9)
    np.testing.assert_allclose(ours.S, truth.S, atol=1e-9)


@pytest.mark.parametrize("square_root", [False, True])
def test_ensemble_is_kalman_within_its_sampling_error(square_root):
    """Mean: regression theory gives a variance of at most P_prior (1 + NIS) / N; variances: 2 P^2 / N."""
    members, z_mean, z_var = 400, [], []
    for seed in range(25):
        p, rng = problem(seed, 4, 3, steps=1), np.random.default_rng(seed)
        prior = enkf.predict(enkf.sample(p.belief, members, rng), lambda X, dt, p=p: X @ p.F.T, 1.0, p.Q, rng)
        residual = lambda X, p=p: p.zs[0] - X @ p.H.T  # noqa: E731
        post = enkf.update_square_root(prior, residual, p.R) if square_root else enkf.update(prior, residual, p.R, rng)
        b = ekf.predict(p.belief, p.F @ p.belief.x, p.F, p.Q)
        exact = ekf.update(b, p.zs[0] - p.H @ b.x, p.H, p.R)
        moments, _ = enkf.moments(post.belief)
        variance = np.diag(b.P)
        z_mean.append((moments.x - exact.belief.x) / np.sqrt(variance * (1.0 + exact.nis) / members))
        z_var.append((np.diag(moments.P) - np.diag(exact.belief.P)) / (variance * np.sqrt(2.0 / members)))
    assert np.abs(z_mean).max() < 4.5 and np.sqrt(np.mean(np.square(z_mean))) < 1.2
    assert np.abs(z_var).max() < 4.5 and np.sqrt(np.mean(np.square(z_var))) < 1.2
    assert np.sqrt(np.mean(np.square(z_mean))) > 0.02  # it is a sample, not the formula
