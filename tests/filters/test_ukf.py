"""The unscented filter: weights, means on rotations, nonlinear moments, repair of a broken covariance."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.core.manifold import local, retract
from outrider.data.belief import Gaussian, Manifold, StateLayout
from outrider.errors import ConfigError, DataError
from outrider.filters import ekf, ukf

ATTITUDE = StateLayout(("attitude", Manifold.ROTATION, "rad"), ("heading", Manifold.ANGLE, "rad"), ("s", 2, "m"))


def vector(n):
    return StateLayout(("s", n, "m"))


@settings(max_examples=30, derandomize=True)
@given(n=st.integers(1, 30), alpha=st.floats(0.1, 1.5), kappa=st.floats(0, 3))
def test_weights_reproduce_mean_and_covariance(n, alpha, kappa):
    wm, wc, gamma = ukf.Spread(alpha=alpha, kappa=kappa, beta=2.0).weights(n)
    assert wm.sum() == pytest.approx(1.0, abs=1e-9)
    assert 2 * wc[1] * gamma**2 == pytest.approx(1.0)


def test_no_weight_of_the_default_is_negative():
    for n in (1, 6, 15, 30):
        wm, wc, _ = ukf.CUBATURE.weights(n)
        assert (wm >= 0).all() and (wc >= 0).all() and wm[0] == 0
    with pytest.raises(ConfigError, match="no sigma points"):
        ukf.Spread(kappa=-6.0).weights(6)


@settings(max_examples=20, derandomize=True)
@given(seed=st.integers(0, 10_000), size=st.floats(0, 0.6))
def test_sigma_points_have_the_belief_as_moments(seed, size):
    """Draw and recover without a process in between: nothing changes, rotations included."""
    rng = np.random.default_rng(seed)
    x, A = ATTITUDE.zeros(), rng.normal(size=(6, 6))
    retract(x, rng.normal(size=6), ATTITUDE.table)
    P = size**2 * (A @ A.T / 6 + 0.1 * np.eye(6)) + 1e-6 * np.eye(6)
    got = ukf.predict(Gaussian(x, P, ATTITUDE), lambda x, dt: x, 1.0, np.zeros((6, 6))).belief
    d = np.zeros(6)
    local(got.x, x, ATTITUDE.table, d)
    np.testing.assert_allclose(d, 0.0, atol=1e-9)
    np.testing.assert_allclose(got.P, P, atol=1e-9)


def test_mean_of_rotations_balances_their_tangent_vectors(rng):
    layout = StateLayout(("attitude", Manifold.ROTATION, "rad"))
    X, E = np.zeros((30, 4)), np.zeros((30, 3))
    for row in X:
        row[3] = 1.0
        retract(row, 0.8 * rng.normal(size=3), layout.table)
    x, weights = np.zeros(4), np.full(30, 1 / 30)
    ukf.tangent_mean(X, weights, layout.table, x, E, np.zeros(3))
    for row, e in zip(X, E, strict=True):
        local(row, x, layout.table, d := np.zeros(3))
        np.testing.assert_allclose(d, e, atol=1e-8)
    np.testing.assert_allclose(E.mean(axis=0), 0.0, atol=1e-9)


def test_headings_are_averaged_across_the_wrap():
    layout = StateLayout(("heading", Manifold.ANGLE, "rad"))
    X = np.array([[3.1], [-3.1]])
    x, E = np.zeros(1), np.zeros((2, 1))
    ukf.tangent_mean(X, np.full(2, 0.5), layout.table, x, E, np.zeros(1))
    assert abs(abs(x[0]) - np.pi) < 1e-12
    np.testing.assert_allclose(np.abs(E), np.pi - 3.1)


def test_polar_to_cartesian_mean_is_better_than_linear(rng):
    """Range 1 +- 0.02, bearing 90 +- 15 deg: the mean lies inside the arc; n + kappa = 3 (Julier, Uhlmann 2004)."""
    belief = Gaussian(np.array([1.0, np.pi / 2]), np.diag([0.02, np.deg2rad(15)]) ** 2, vector(2))

    def f(x, dt):
        return np.array([x[0] * np.cos(x[1]), x[0] * np.sin(x[1])])

    got = ukf.predict(belief, f, 1.0, np.zeros((2, 2)), spread=ukf.Spread(kappa=1.0)).belief
    exact = np.exp(-0.5 * np.deg2rad(15) ** 2)
    assert abs(got.x[1] - exact) < 0.02 * abs(1.0 - exact)
    sample = np.array([f(belief.x + rng.normal(size=2) * np.sqrt(np.diag(belief.P)), 1.0) for _ in range(4000)])
    np.testing.assert_allclose(np.diag(got.P), sample.var(axis=0), rtol=0.12)


@settings(max_examples=25, derandomize=True)
@given(seed=st.integers(0, 10_000), noise=st.floats(-8, 1), n=st.integers(1, 6))
def test_updated_covariance_is_symmetric_and_positive(seed, noise, n):
    rng = np.random.default_rng(seed)
    A = np.linalg.qr(rng.normal(size=(n, n)))[0]
    belief = Gaussian(rng.normal(size=n), (A * 10.0 ** rng.uniform(-9, 2, n)) @ A.T, vector(n))
    C = rng.normal(size=(3, n))
    for _ in range(3):
        got = ukf.update(belief, lambda x: -np.sin(C @ x) - 0.2 * (C @ x) ** 2, np.full(3, 10.0**noise))
        belief = got.belief
        assert np.array_equal(belief.P, belief.P.T)
        assert np.linalg.eigvalsh(belief.P).min() > -1e-15
        assert got.nis >= 0


def test_considered_state_agrees_with_the_extended_filter():
    layout = StateLayout(("position", 2, "m"), ("bias", 1, "m"))
    A = np.random.default_rng(1).normal(size=(3, 3))
    b, H, r = Gaussian(np.zeros(3), A @ A.T, layout), np.array([[1.0, 0, 1], [0, 1, -1]]), np.array([0.5, 0.8])
    ours = ukf.update(b, lambda x: np.ones(2) - H @ x, r, consider=("bias",)).belief
    other = ekf.update(b, np.ones(2), H, r, consider=("bias",)).belief
    np.testing.assert_allclose(ours.x, other.x, atol=1e-12)
    np.testing.assert_allclose(ours.P, other.P, atol=1e-12)


# ------------------------------------------------------------------------------------------------ repair


def test_repair_reports_what_it_did():
    good = np.diag([1e6, 1e-12])
    fine = ukf.repaired(good)
    assert fine.raised == 0 and fine.lowest == pytest.approx(1.0)
    np.testing.assert_allclose(fine.P, good, rtol=1e-12)
    bad = ukf.repaired(np.array([[1.0, 2.0], [2.0, 1.0]]))
    assert bad.raised == 1 and bad.lowest == pytest.approx(-1.0)
    assert np.linalg.eigvalsh(bad.P).min() > 0
    assert (np.diag(bad.P) >= 1.0).all()  # never more confident than before


def test_broken_covariance_is_repaired_and_said_so():
    broken = Gaussian(np.zeros(3), np.diag([1.0, 4.0, -1e-9]), vector(3))
    predicted = ukf.predict(broken, lambda x, dt: x, 1.0, np.zeros((3, 3)))
    assert predicted.repaired == 1
    np.testing.assert_allclose(np.diag(predicted.belief.P)[:2], [1.0, 4.0], atol=1e-9)
    assert ukf.update(broken, lambda x: np.ones(1) - x[:1], np.ones(1)).repaired == 1
    assert ukf.update(predicted.belief, lambda x: np.ones(1) - x[:1], np.ones(1)).repaired == 0


def test_nan_is_refused():
    lost = Gaussian(np.zeros(2), np.full((2, 2), np.nan), vector(2))
    with pytest.raises(DataError, match="not finite"):
        ukf.predict(lost, lambda x, dt: x, 1.0, np.eye(2))
    with pytest.raises(DataError, match="innovation covariance"):
        ukf.update(Gaussian(np.zeros(2), np.eye(2), vector(2)), lambda x: np.full(1, np.nan), np.ones(1))
