"""Every filter estimates an attitude and a gyro bias consistently: NEES within chi-square bounds over many seeds."""

import numpy as np
import pytest
from scipy.special import chdtri

from outrider._kernel import enabled
from outrider.core.manifold import local, retract
from outrider.core.rotations import (
    matrices_to_quats,
    quat_exp,
    quat_multiply,
    quats_to_matrices,
    right_jacobian,
    so3_exp,
)
from outrider.data.belief import Gaussian, Manifold, StateLayout
from outrider.filters import ekf, enkf, ukf

LAYOUT = StateLayout(("attitude", Manifold.ROTATION, "rad"), ("gyro_bias", 3, "rad/s"))
P0 = np.diag([0.15, 0.15, 0.3, 0.02, 0.02, 0.02]) ** 2
DT, STEPS = 0.5, 8
SEEDS, MEMBERS = (50, 150) if enabled() else (10, 60)  # as plain Python only the path is checked
GYRO, BIAS_WALK, SIGHT = 0.01, 1e-3, 0.03
Q = np.diag([GYRO**2 * DT] * 3 + [BIAS_WALK**2 * DT] * 3)
DIRECTIONS = np.array([[0.0, 0.0, 1.0], [0.0, 0.8, -0.6]])  # gravity and field, world frame
R = np.full(6, SIGHT**2)


def turned(x, rate):
    """One step of the attitude: q <- q Exp((rate - bias) DT)."""
    out, dq = x.copy(), np.zeros(4)
    quat_exp((rate - x[4:]) * DT, dq)
    quat_multiply(x[:4], dq, out[:4])
    return out


def seen(X):
    """(..., 6) the directions in the body frame."""
    return np.einsum("...ji,kj->...ki", quats_to_matrices(X[..., :4]), DIRECTIONS).reshape(*X.shape[:-1], 6)


def jacobian_of_turn(x, rate):
    phi, F = (rate - x[4:]) * DT, np.eye(6)
    so3_exp(-phi, turn := np.zeros((3, 3)))
    right_jacobian(phi, Jr := np.zeros((3, 3)))
    F[:3, :3], F[:3, 3:] = turn, -Jr * DT
    return F


def jacobian_of_sight(x):
    H = np.zeros((6, 6))
    for k, (a, b, c) in enumerate(seen(x).reshape(2, 3)):
        H[3 * k : 3 * k + 3, :3] = [[0, -c, b], [c, 0, -a], [-b, a, 0]]
    return H


def ekf_step(b, rate, z, noise, _rng):
    b = ekf.predict(b, turned(b.x, rate), jacobian_of_turn(b.x, rate), Q)
    return ekf.update(b, z - seen(b.x), jacobian_of_sight(b.x), noise).belief


def iekf_step(b, rate, z, noise, _rng):
    b = ekf.predict(b, turned(b.x, rate), jacobian_of_turn(b.x, rate), Q)
    return ekf.iterate(b, lambda x: (z - seen(x), jacobian_of_sight(x)), noise, steps=4, tolerance=1e-4).belief


def ukf_step(b, rate, z, noise, _rng):
    b = ukf.predict(b, lambda x, dt: turned(x, rate), DT, Q).belief
    return ukf.update(b, lambda x: z - seen(x), noise).belief


def turned_all(X, rate):
    q = matrices_to_quats(quats_to_matrices(X[:, :4]) @ quats_to_matrices(_exp_all((rate - X[:, 4:]) * DT)))
    return np.concatenate([q, X[:, 4:]], axis=1)


def _exp_all(phi):
    half = 0.5 * np.linalg.norm(phi, axis=1, keepdims=True)
    return np.concatenate([0.5 * phi * np.sinc(half / np.pi), np.cos(half)], axis=1)


def enkf_step(b, rate, z, noise, rng):
    b = enkf.predict(b, lambda X, dt: turned_all(X, rate), DT, Q, rng)
    return enkf.update(b, lambda X: z - seen(X), noise, rng).belief


def etkf_step(b, rate, z, noise, rng):
    b = enkf.predict(b, lambda X, dt: turned_all(X, rate), DT, Q, rng)
    return enkf.update_square_root(b, lambda X: z - seen(X), noise).belief


def nees(step, seed, noise=R):
    """Normalised squared error of the last estimate; the start is drawn from P0."""
    rng = np.random.default_rng(seed)
    truth = LAYOUT.zeros()
    retract(truth, rng.normal(size=6), LAYOUT.table)
    start, error = truth.copy(), -rng.normal(size=6) * np.sqrt(np.diag(P0))
    retract(start, error, LAYOUT.table)
    b = Gaussian(start, P0, LAYOUT)
    if step in (enkf_step, etkf_step):
        b = enkf.sample(b, MEMBERS, rng)
    for _ in range(STEPS):
        rate = 0.4 * rng.normal(size=3)
        truth = turned(truth, rate)
        retract(truth, rng.normal(size=6) * np.sqrt(np.diag(Q)), LAYOUT.table)
        z = seen(truth) + SIGHT * rng.normal(size=6)
        b = step(b, rate, z, noise, rng)
    if step in (enkf_step, etkf_step):
        b = enkf.moments(b)[0]
    e = np.zeros(6)
    local(truth, b.x, LAYOUT.table, e)
    return e @ np.linalg.solve(b.P, e)


def bounds(seeds, tests=10):
    """Two-sided chi-square bounds of the summed NEES, 99.9 % over all tests of this file together."""
    tail = 0.0005 / tests
    return chdtri(6 * seeds, 1 - tail), chdtri(6 * seeds, tail)


@pytest.mark.parametrize("step", [ekf_step, iekf_step, ukf_step])
def test_nees_is_within_its_bounds(step):
    low, high = bounds(SEEDS)
    assert low < sum(nees(step, seed) for seed in range(SEEDS)) < high


@pytest.mark.parametrize("step", [enkf_step, etkf_step])
def test_nees_of_an_ensemble_is_within_its_bounds(step):
    """A covariance estimated from N members inflates the NEES by (N - 1) / (N - n - 2), here 5 %."""
    low, high = bounds(SEEDS)
    total = sum(nees(step, seed) for seed in range(SEEDS))
    assert low < total < high * (MEMBERS - 1) / (MEMBERS - 6 - 2)


@pytest.mark.compiled
@pytest.mark.skipif(not enabled(), reason="needs all 50 seeds, too slow as plain Python")
@pytest.mark.parametrize("step", [ekf_step, ukf_step, etkf_step])
@pytest.mark.parametrize("factor", [0.3, 4.0])
def test_a_mismatched_noise_leaves_the_bounds(step, factor):
    low, high = bounds(SEEDS)
    total = sum(nees(step, seed, R * factor) for seed in range(SEEDS))
    assert total > high if factor < 1 else total < low
