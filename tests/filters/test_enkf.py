"""The ensemble filter: seeded, mean preserving, on rotations, with explicit inflation."""

import numpy as np
import pytest

from outrider.core.manifold import local
from outrider.data.belief import Gaussian, Manifold, StateLayout
from outrider.errors import ConfigError
from outrider.filters import enkf

VECTOR = StateLayout(("position", 2, "m"), ("velocity", 2, "m/s"))
CURVED = StateLayout(("attitude", Manifold.ROTATION, "rad"), ("heading", Manifold.ANGLE, "rad"), ("s", 2, "m"))


def start(layout=VECTOR, members=60, seed=0, scale=0.3):
    rng = np.random.default_rng(seed)
    n = layout.error_size
    A = rng.normal(size=(n, n))
    x = layout.zeros()
    return enkf.sample(Gaussian(x, scale**2 * (A @ A.T / n + 0.1 * np.eye(n)), layout), members, rng)


def drift(X, dt):
    return X + dt * np.concatenate([X[:, 2:], np.zeros_like(X[:, 2:])], axis=1)


def first_two(X):
    return np.array([0.4, -0.2]) - X[:, :2]


def test_the_same_seed_gives_the_same_bits():
    def run(seed):
        rng = np.random.default_rng(seed)
        b = enkf.predict(start(), drift, 0.1, 0.01 * np.eye(4), rng)
        return enkf.update(b, first_two, 0.1 * np.eye(2), rng).belief.X

    assert np.array_equal(run(5), run(5))
    assert not np.array_equal(run(5), run(6))


def test_normals_are_numpys_own_stream_centred():
    out = np.zeros((50, 3))
    L = np.array([[2.0, 0, 0], [-1.0, 0.5, 0], [0.3, 0, 1.0]])
    enkf.draw(np.random.default_rng(9), L, np.zeros(3), out)
    plain = np.random.default_rng(9).standard_normal((50, 3))
    np.testing.assert_allclose(out, (plain - plain.mean(axis=0)) @ L.T, atol=1e-14)


@pytest.mark.parametrize("layout", [VECTOR, CURVED])
def test_sample_has_the_mean_asked_for(layout):
    mean, E = enkf.moments(start(layout))
    d = np.zeros(layout.error_size)
    local(mean.x, layout.zeros(), layout.table, d)
    np.testing.assert_allclose(d, 0.0, atol=1e-9)
    np.testing.assert_allclose(E.sum(axis=0), 0.0, atol=1e-9)


def test_sample_has_the_covariance_asked_for_even_if_singular():
    P = np.array([[4.0, 2.0, 0, 0], [2.0, 1.0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 9.0]])
    b = enkf.sample(Gaussian(np.zeros(4), P, VECTOR), 3000, np.random.default_rng(1))
    sample = enkf.moments(b)[0].P
    np.testing.assert_allclose(sample, P, atol=5 * 9 * np.sqrt(2 / 3000))
    assert abs(np.linalg.det(sample[:2, :2])) < 1e-12 and abs(sample[2, 2]) < 1e-20


def test_square_root_update_keeps_the_mean_of_the_formula():
    b = start(CURVED)
    prior, E = enkf.moments(b)

    def residual(X):
        return np.array([0.4, -0.2]) - X[:, 5:]

    Y = residual(b.X)
    S = np.cov(Y.T) + 0.1 * np.eye(2)
    K = -(E.T @ (Y - Y.mean(axis=0)) / 59) @ np.linalg.inv(S)
    post, _ = enkf.moments(enkf.update_square_root(b, residual, np.full(2, 0.1)).belief)
    d = np.zeros(6)
    local(post.x, prior.x, CURVED.table, d)
    np.testing.assert_allclose(d[3:], (K @ Y.mean(axis=0))[3:], atol=1e-12)
    # tangent vectors at the old mean average to the correction; on the rotation that is the mean to second order
    np.testing.assert_allclose(d[:3], (K @ Y.mean(axis=0))[:3], atol=2e-2)


def test_inflation_scales_the_spread_and_nothing_else():
    b, rng = start(CURVED), np.random.default_rng
    plain = enkf.moments(enkf.predict(b, lambda X, dt: X, 1.0, np.zeros((6, 6)), rng(0)))[0]
    wide = enkf.moments(enkf.predict(b, lambda X, dt: X, 1.0, np.zeros((6, 6)), rng(0), inflation=1.2))[0]
    np.testing.assert_allclose(wide.P, 1.44 * plain.P, atol=1e-9)
    np.testing.assert_allclose(wide.x, plain.x, atol=1e-9)


def test_considered_members_do_not_move():
    b = start()
    got = enkf.update(b, first_two, np.full(2, 0.1), np.random.default_rng(2), consider=("velocity",)).belief
    np.testing.assert_allclose(got.X[:, 2:], b.X[:, 2:], atol=1e-14)
    assert np.abs(got.X[:, :2] - b.X[:, :2]).max() > 0.01


def test_perturbed_and_deterministic_updates_agree_in_the_mean():
    b = start(members=3000)
    a = enkf.moments(enkf.update(b, first_two, np.full(2, 0.1), np.random.default_rng(2)).belief)[0]
    c = enkf.moments(enkf.update_square_root(b, first_two, np.full(2, 0.1)).belief)[0]
    np.testing.assert_allclose(a.x, c.x, atol=1e-12)  # the perturbations are centred
    np.testing.assert_allclose(a.P, c.P, atol=5 * 0.1 * np.sqrt(2 / 3000))


def test_steps_leave_their_input_alone():
    b = start()
    before = b.X.copy()
    enkf.predict(b, lambda X, dt: X, 0.1, np.eye(4), np.random.default_rng(0), inflation=1.1)
    enkf.update(b, first_two, np.full(2, 0.1), np.random.default_rng(0))
    enkf.update_square_root(b, first_two, np.full(2, 0.1))
    assert np.array_equal(b.X, before)


def test_one_member_is_no_ensemble():
    with pytest.raises(ConfigError, match="an ensemble of 1"):
        start(members=1)
