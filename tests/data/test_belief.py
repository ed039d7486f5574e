"""Standard deviations of a belief whose errors are not those of its states."""

import numpy as np
import pytest

from outrider.core.manifold import local, retract
from outrider.data import Gaussian, StateLayout
from outrider.filters.engine import own_variance

LAYOUT = StateLayout(("p", 1, "m"), ("velocity", 2, "m/s"), ("scale", 1, ""), stretches=(("velocity", "scale"),))


def belief() -> Gaussian:
    A = np.random.default_rng(4).normal(size=(4, 4)) * 1e-3
    return Gaussian(np.array([3.0, 2.0, -1.0, 0.25]), A @ A.T, LAYOUT)


def test_the_deviation_of_a_stretched_vector_is_that_of_its_samples() -> None:
    b, rng = belief(), np.random.default_rng(5)
    draws = rng.multivariate_normal(np.zeros(4), b.P, 40_000)
    states = np.tile(b.x, (len(draws), 1))
    for x, d in zip(states, draws, strict=True):
        retract(x, d, LAYOUT.table)
    for name in ("p", "velocity", "scale"):
        assert b.std(name) == pytest.approx(states[:, LAYOUT.state(name)].std(axis=0), rel=0.02)
    spread = [np.sqrt(own_variance(b.x, b.P, LAYOUT.table, i)) for i in range(4)]
    assert spread == pytest.approx(np.concatenate([b.std(name) for name in ("p", "velocity", "scale")]), rel=1e-12)


def test_what_the_wheels_measure_is_flat_and_there_and_back_is_the_same() -> None:
    x, d, e = belief().x.copy(), np.array([0.1, 0.3, -0.2, 0.15]), np.zeros(4)
    retract(x, d, LAYOUT.table)
    assert x[1:3] / (1.0 + x[3]) == pytest.approx(np.array([2.0, -1.0]) / 1.25 + d[1:3])
    local(x, belief().x, LAYOUT.table, e)
    np.testing.assert_allclose(e, d, atol=1e-14)
