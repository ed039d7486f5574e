"""The extended filter: its covariance algebra, considered states, the iterated update."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.core.manifold import local, retract
from outrider.data.belief import Gaussian, Manifold, StateLayout
from outrider.errors import ConfigError, DataError
from outrider.filters import ekf

PLANE = StateLayout(("position", 2, "m"))


def orthogonal(rng, n):
    return np.linalg.qr(rng.normal(size=(n, n)))[0]


def near_singular(rng, n, low, high):
    """Eigenvalues spread over many decades."""
    U = orthogonal(rng, n)
    P = (U * 10.0 ** rng.uniform(low, high, n)) @ U.T
    return 0.5 * (P + P.T)


@settings(max_examples=40, derandomize=True)
@given(
    seed=st.integers(0, 10_000),
    n=st.integers(1, 7),
    m=st.integers(1, 7),
    low=st.floats(-14, 0),
    noise=st.floats(-8, 1),
)
def test_covariance_stays_symmetric_and_positive(seed, n, m, low, noise):
    rng = np.random.default_rng(seed)
    belief = Gaussian(np.zeros(n), near_singular(rng, n, low, 2.0), StateLayout(("s", n, "")))
    for _ in range(4):
        H = rng.normal(size=(m, n))
        belief = ekf.update(belief, rng.normal(size=m), H, np.full(m, 10.0**noise)).belief
        assert np.array_equal(belief.P, belief.P.T)
        assert np.linalg.eigvalsh(belief.P).min() >= -1e-13
        assert np.isfinite(belief.x).all()


def test_the_short_form_would_fail_where_joseph_holds():
    """A tight measurement of a vague state: (I - K H) P loses its sign, the Joseph form is right to the last digit."""
    worst_short = worst = 0.0
    for seed in range(300):
        rng = np.random.default_rng(seed)
        P, H, r = near_singular(rng, 6, 4.0, 8.0), rng.normal(size=(3, 6)), np.full(3, 1e-8)
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + np.diag(r))
        short = (np.eye(6) - K @ H) @ P
        ours = ekf.update(Gaussian(np.zeros(6), P, StateLayout(("s", 6, ""))), np.zeros(3), H, r).belief.P
        worst_short = min(worst_short, np.linalg.eigvalsh(0.5 * (short + short.T)).min())
        worst = min(worst, np.linalg.eigvalsh(ours).min())
    assert worst_short < -4 * np.finfo(float).eps * 1e8
    assert worst > -np.finfo(float).eps * 1e8


@settings(max_examples=20, derandomize=True)
@given(seed=st.integers(0, 10_000), n=st.integers(1, 17))
def test_joseph_equals_the_printed_formula_for_any_gain(seed, n):
    rng = np.random.default_rng(seed)
    P, H, K, r = near_singular(rng, n, -2, 1), rng.normal(size=(3, n)), rng.normal(size=n), rng.uniform(0.1, 2)
    h = H[1] = np.where(rng.random(n) < 0.5, H[1], 0.0)
    w = ekf.workspace(n, 3)
    w.G.fill(7.0)  # stale
    w.M[:, :n], w.c[:n], w.K[:n] = P, h @ P, K
    ekf.entries(H, 1, w.on)
    A = np.eye(n) - np.outer(K, h)
    expected = A @ P @ A.T + r * np.outer(K, K)
    ekf.joseph(H, r, 1, w)
    np.testing.assert_allclose(w.M[:, :n], expected, atol=1e-11 * np.abs(expected).max())


@settings(max_examples=20, derandomize=True)
@given(seed=st.integers(0, 10_000), n=st.integers(1, 17), m=st.integers(1, 8))
def test_one_after_the_other_is_the_joint_update(seed, n, m):
    """Correction, covariance, joint NIS and predicted variances, with stale contents and considered states."""
    rng = np.random.default_rng(seed)
    P, r, y = near_singular(rng, n, -2, 1), rng.uniform(0.1, 2, m), rng.normal(size=m)
    H = np.where(rng.random((m, n)) < 0.6, rng.normal(size=(m, n)), 0.0)
    keep = (rng.random(n) < 0.7).astype(float)
    S = H @ P @ H.T + np.diag(r)
    K = keep[:, None] * (P @ H.T @ np.linalg.inv(S))
    A = np.eye(n) - K @ H
    x, w = np.zeros(n), ekf.workspace(n, m + 2)
    for a in (w.s, w.c, w.K, w.G, w.dx, w.on):
        a.fill(7)
    got = P.copy()
    assert ekf.innovate(got, H, r, y, m, w) == pytest.approx(y @ np.linalg.solve(S, y), rel=1e-8)
    assert np.array_equal(got, P)  # nothing happens before the gate
    np.testing.assert_allclose(w.s[:m], np.diag(S), rtol=1e-9)
    ekf.correct(x, got, keep, StateLayout(("s", n, "")).table, w)
    np.testing.assert_allclose(x, K @ y, atol=1e-9)
    np.testing.assert_allclose(got, A @ P @ A.T + K @ np.diag(r) @ K.T, atol=1e-9)


@settings(max_examples=20, derandomize=True)
@given(seed=st.integers(0, 10_000), n=st.integers(1, 17))
def test_a_process_jacobian_may_fill_up_and_thin_out(seed, n):
    """The places of non-zeros are remembered; a matrix with others, or with fewer, is multiplied as well."""
    rng = np.random.default_rng(seed)
    P, w = near_singular(rng, n, -2, 1), ekf.workspace(n, 1)
    for share in (0.1, 0.6, 0.2):
        F, Q = np.where(rng.random((n, n)) < share, rng.normal(size=(n, n)), 0.0), near_singular(rng, n, -2, 1)
        expected = F @ P @ F.T + Q
        ekf.propagate(P, F, Q, w)
        assert np.array_equal(P, P.T)
        np.testing.assert_allclose(P, expected, atol=1e-11 * max(1.0, np.abs(expected).max()))


@settings(max_examples=15, derandomize=True)
@given(seed=st.integers(0, 10_000), m=st.integers(1, 4))
def test_correlated_noise_gives_the_same_posterior_as_the_printed_formula(seed, m):
    rng = np.random.default_rng(seed)
    P, H, R, y = near_singular(rng, 5, -1, 1), rng.normal(size=(m, 5)), near_singular(rng, m, -1, 1), rng.normal(size=m)
    got = ekf.update(Gaussian(np.zeros(5), P, StateLayout(("s", 5, ""))), y, H, R)
    S = H @ P @ H.T + R
    K = P @ H.T @ np.linalg.inv(S)
    np.testing.assert_allclose(got.S, S, atol=1e-10)
    np.testing.assert_allclose(got.belief.x, K @ y, atol=1e-9)
    np.testing.assert_allclose(got.belief.P, P - K @ S @ K.T, atol=1e-9)
    assert got.nis == pytest.approx(y @ np.linalg.solve(S, y), rel=1e-8)


def test_steps_leave_their_input_alone():
    belief = Gaussian(np.ones(2), np.eye(2), PLANE)
    ekf.update(belief, np.ones(1), np.ones((1, 2)), np.ones(1))
    ekf.predict(belief, np.zeros(2), 2 * np.eye(2), np.eye(2))
    assert np.array_equal(belief.x, np.ones(2)) and np.array_equal(belief.P, np.eye(2))


def test_a_perfect_measurement_is_allowed():
    got = ekf.update(Gaussian(np.zeros(2), np.eye(2), PLANE), np.array([3.0]), np.array([[1.0, 0.0]]), np.zeros(1))
    np.testing.assert_allclose(got.belief.x, [3.0, 0.0])
    np.testing.assert_allclose(got.belief.P, [[0.0, 0.0], [0.0, 1.0]], atol=1e-15)


@pytest.mark.parametrize("R", [np.array([-5.0]), np.array([[1.0, 2.0], [2.0, 1.0]]), np.array([np.nan])])
def test_impossible_noise_is_refused(R):
    m = R.shape[0]
    with pytest.raises(DataError, match="not positive definite"):
        ekf.update(Gaussian(np.zeros(2), np.eye(2), PLANE), np.zeros(m), np.eye(2)[:m], R)


# ------------------------------------------------------------------------------------------------ considered states

BIASED = StateLayout(("position", 2, "m"), ("bias", 1, "m"))


def test_considered_state_is_untouched_but_correlated():
    P = np.diag([4.0, 4.0, 1.0])
    H = np.array([[1.0, 0.0, 1.0], [0.0, 1.0, 1.0]])
    got = ekf.update(Gaussian(np.zeros(3), P, BIASED), np.ones(2), H, np.ones(2), consider=("bias",)).belief
    assert got.x[2] == 0.0 and got.P[2, 2] == 1.0
    assert got.P[0, 2] < -0.1  # an error of the bias has gone into the position
    with pytest.raises(ConfigError, match="no state 'drift'"):
        ekf.update(got, np.ones(2), H, np.ones(2), consider=("drift",))


def monte_carlo_covariance(consider, runs=4000):
    """Sample and stated covariance after six updates of a position through a constant, unknown bias."""
    rng = np.random.default_rng(3)
    H, r, P = np.array([[1.0, 0.0, 1.0], [0.0, 1.0, -1.0]]), np.array([0.5, 0.8]), np.diag([4.0, 9.0, 2.0])
    truth = rng.normal(size=(runs, 3)) * np.sqrt(np.diag(P))
    x = np.zeros((runs, 3))
    belief = Gaussian(np.zeros(3), P, BIASED)
    for _ in range(6):
        # one covariance serves all runs: the gain is what the update makes of unit innovations
        gain = np.stack([ekf.update(belief, y, H, r, consider=consider).belief.x - belief.x for y in np.eye(2)], axis=1)
        z = truth @ H.T + rng.normal(size=(runs, 2)) * np.sqrt(r)
        x += (z - x @ H.T) @ gain.T
        belief = ekf.update(belief, np.zeros(2), H, r, consider=consider).belief
    error = truth - x
    return error.T @ error / runs, belief.P


def test_considered_covariance_is_what_happens():
    """Standard error of a sample covariance: sqrt((P_ii P_jj + P_ij^2) / runs)."""
    sample, stated = monte_carlo_covariance(("bias",))
    standard_error = np.sqrt((np.outer(np.diag(stated), np.diag(stated)) + stated**2) / 4000)
    assert np.abs((sample - stated) / standard_error).max() < 4.5


def test_dropping_the_bias_would_be_overconfident():
    """The same with the bias left out of the model: the stated covariance is far too small."""
    sample, _ = monte_carlo_covariance(("bias",))
    ignored = Gaussian(np.zeros(2), np.diag([4.0, 9.0]), PLANE)
    for _ in range(6):
        ignored = ekf.update(ignored, np.zeros(2), np.eye(2), np.array([0.5, 0.8])).belief
    assert sample[0, 0] > 5 * ignored.P[0, 0]


# ------------------------------------------------------------------------------------------------ iterated update

BEACONS = np.array([[0.0, 0.0], [30.0, 0.0], [10.0, 25.0]])


def ranges(z):
    def model(x):
        d = x - BEACONS
        h = np.linalg.norm(d, axis=1)
        return z - h, d / h[:, None]

    return model


def test_iterated_update_beats_the_single_one_on_ranges():
    rng, P = np.random.default_rng(5), np.diag([60.0, 60.0])
    single, iterated, cost = [], [], []
    for _ in range(60):
        truth = np.array([12.0, 8.0])
        belief = Gaussian(truth + rng.normal(size=2) * np.sqrt(np.diag(P)), P, PLANE)
        z = np.linalg.norm(truth - BEACONS, axis=1) + rng.normal(size=3) * 0.2
        model = ranges(z)
        one = ekf.update(belief, *model(belief.x), np.full(3, 0.04)).belief
        many = ekf.iterate(belief, model, np.full(3, 0.04)).belief
        single.append(one.x - truth)
        iterated.append(many.x - truth)
        objective = [
            float((b.x - belief.x) @ np.linalg.solve(P, b.x - belief.x) + np.sum(model(b.x)[0] ** 2) / 0.04)
            for b in (one, many)
        ]
        cost.append(objective)
    rms = [np.sqrt(np.mean(np.square(e))) for e in (single, iterated)]
    assert rms[1] < 0.3 * rms[0]
    assert rms[1] < 0.3  # the noise allows about 0.2 m
    assert all(after <= before + 1e-9 for before, after in cost)


def test_iterated_update_ends_at_the_most_probable_attitude():
    """On a rotation: the gradient of the posterior is zero there, to the tolerance."""
    layout = StateLayout(("attitude", Manifold.ROTATION, "rad"))
    rng = np.random.default_rng(2)
    truth = layout.zeros()
    retract(truth, np.array([0.5, -0.4, 0.6]), layout.table)
    directions = np.eye(3)[:2]

    def seen(x):
        return np.concatenate([matrix(x).T @ d for d in directions])

    z = seen(truth) + 0.01 * rng.normal(size=6)

    def model(x):
        R = matrix(x)
        H = np.concatenate([cross(R.T @ d) for d in directions])  # R Exp(e): d(R'd) = (R'd) x e
        return z - seen(x), H

    P, r = np.diag([0.3, 0.4, 0.5]), np.full(6, 0.02)
    got = ekf.iterate(Gaussian(layout.zeros(), P, layout), model, r, steps=60, tolerance=1e-12).belief

    def objective(d):
        x, e = got.x.copy(), np.zeros(3)
        retract(x, d, layout.table)
        local(x, layout.zeros(), layout.table, e)
        return e @ np.linalg.solve(P, e) + np.sum(model(x)[0] ** 2 / r)

    step = 1e-5
    gradient = [(objective(step * d) - objective(-step * d)) / (2 * step) for d in np.eye(3)]
    assert np.abs(gradient).max() < 1e-5


def matrix(q):
    x, y, z, w = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def cross(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


# ------------------------------------------------------------------------------------------ change of tangent space

MIXED = StateLayout(("position", 2, "m"), ("attitude", Manifold.ROTATION, "rad"), ("heading", Manifold.ANGLE, "rad"))


@settings(max_examples=20, derandomize=True)
@given(seed=st.integers(0, 10_000), scale=st.floats(0, 2.5))
def test_transport_is_the_jacobian_of_changing_the_point(seed, scale):
    rng = np.random.default_rng(seed)
    x, dx = MIXED.zeros(), rng.normal(size=6)
    dx[2:5] *= scale / np.linalg.norm(dx[2:5])
    moved = x.copy()
    retract(moved, dx, MIXED.table)

    def column(j):
        e, there, d = dx.copy(), x.copy(), np.zeros(6)
        e[j] += 1e-6
        retract(there, e, MIXED.table)
        local(there, moved, MIXED.table, d)
        return d / 1e-6

    J = np.stack([column(j) for j in range(6)], axis=1)
    P = near_singular(rng, 6, -1, 1)
    got = P.copy()
    ekf.transport(got, dx, MIXED.table, False, np.zeros((3, 3)))
    assert np.array_equal(got, got.T)
    np.testing.assert_allclose(got, J @ P @ J.T, atol=2e-4)
    np.testing.assert_allclose(ekf.tangent_map(dx, MIXED), J, atol=1e-5)
    ekf.transport(got, dx, MIXED.table, True, np.zeros((3, 3)))
    np.testing.assert_allclose(got, P, atol=1e-10)
