"""Draws have the covariance asked for, full rank or not; what is no covariance is refused."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from outrider.core import sampling
from outrider.errors import DataError


@settings(derandomize=True, max_examples=50)
@given(st.integers(1, 7), st.integers(0, 7), st.floats(-8.0, 8.0), st.integers(0, 1000))
def test_the_root_of_any_covariance(d: int, rank: int, magnitude: float, seed: int) -> None:
    A = np.random.default_rng(seed).normal(size=(d, min(rank, d))) * 10.0**magnitude
    P = A @ A.T
    L = sampling.covariance_root(P)
    assert_array_equal(L.shape, P.shape)
    scale = np.abs(P).max(initial=1e-300)
    assert_allclose(L @ L.T, P, rtol=0, atol=1e-13 * scale)
    assert_allclose(L, L.T, rtol=0, atol=1e-13 * np.sqrt(scale))


def test_moments(rng: np.random.Generator) -> None:
    P = np.array([[4.0, 1.9, 0.0], [1.9, 1.0, 0.0], [0.0, 0.0, 0.0]])
    draws = sampling.normal(rng, P, 40_000)
    assert_array_equal(draws[:, 2], 0.0)
    assert_allclose(draws.mean(axis=0), 0.0, rtol=0, atol=4 * 2.0 / 200)
    assert_allclose(np.cov(draws.T), P, rtol=0, atol=0.12)


def test_perfectly_correlated_components_stay_so(rng: np.random.Generator) -> None:
    draws = sampling.correlated(rng.standard_normal((100, 2)), [[1.0, 2.0], [2.0, 4.0]])
    assert_allclose(draws[:, 1], 2.0 * draws[:, 0], rtol=0, atol=1e-7)
    assert np.std(draws[:, 0]) > 0.7


def test_same_generator_same_bits() -> None:
    a, b = (sampling.normal(np.random.default_rng(4), np.eye(2), 5) for _ in range(2))
    assert_array_equal(a, b)


@pytest.mark.parametrize(
    ("P", "words"),
    [
        ([[1.0, 2.0], [2.0, 1.0]], "negative eigenvalue"),
        ([[1.0, 0.5], [0.0, 1.0]], "symmetric"),
        ([[np.nan]], "finite square"),
        ([[1.0, 0.0]], "finite square"),
        ([1.0], "finite square"),
    ],
)
def test_what_is_no_covariance(P: list[list[float]], words: str) -> None:
    with pytest.raises(DataError, match=words):
        sampling.covariance_root(P)


def test_gauss_markov_is_stationary_and_forgets(rng: np.random.Generator) -> None:
    dt, tau, sigma = 0.5, 2.0, 3.0
    b = sampling.gauss_markov(rng.standard_normal((60, 4000)), dt, tau, sigma)
    assert_allclose(b.std(axis=1), sigma, rtol=0.06)
    lagged = (b[10:] * b[:-10]).mean() / sigma**2
    assert lagged == pytest.approx(np.exp(-10 * dt / tau), abs=0.02)


def test_random_walk_grows_with_the_root_of_time(rng: np.random.Generator) -> None:
    w = sampling.random_walk(rng.standard_normal((100, 4000)), 0.25, 2.0)
    assert_allclose(w[[0, 3, 99]].std(axis=1), 2.0 * np.sqrt([0.25, 1.0, 25.0]), rtol=0.05)
