"""Gusts have the variance, the correlation and the scales of the Dryden model."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from outrider.sim.noise import generator
from outrider.sim.world import Wind

GUSTY = Wind(mean=(5.0, 0.0, 0.0), sigma=(1.0, 2.0, 0.5), length=(50.0, 25.0, 10.0))


def test_variance_and_correlation() -> None:
    """R_u = sigma^2 e^-x, R_v = R_w = sigma^2 e^-x (1 - x/2) with x = V tau / L: from the Dryden spectra."""
    n, dt = 20_000, 1.0
    gust = GUSTY.sample(generator(1, "world", "wind"), n, dt) - [5.0, 0.0, 0.0]
    for axis in range(3):
        x = 5.0 * dt / GUSTY.length[axis] * np.arange(8)
        expected = np.exp(-x) * (1.0 if axis == 0 else 1.0 - 0.5 * x)
        g = gust[:, axis] / GUSTY.sigma[axis]
        found = [np.mean(g[: n - k] * g[k:]) for k in range(8)]
        assert_allclose(found, expected, atol=0.08)


def test_variance_is_right_at_any_step_and_from_the_first_sample_on() -> None:
    for dt in (0.01, 3.0, 100.0):
        runs = np.array([GUSTY.sample(generator(k, "world", "wind"), 3, dt) for k in range(1000)])
        assert_allclose(runs.std(axis=0), [GUSTY.sigma] * 3, rtol=0.08)


def test_step_halving_keeps_the_process() -> None:
    """The second-order filter's slope at the origin, -1.5 / T, tells a wrong discretization at once."""
    dt = 0.01
    g = GUSTY.sample(generator(3, "world", "wind"), 20_000, dt)[:, 1] / GUSTY.sigma[1]
    rate = np.mean(np.diff(g) ** 2) / 2.0 / dt  # R(0) - R(dt) over dt
    assert rate == pytest.approx(1.5 * 5.0 / 25.0, rel=0.05)


def test_a_longer_run_begins_with_the_shorter() -> None:
    short, long = (GUSTY.sample(generator(7, "world", "wind"), n, 0.1) for n in (50, 80))
    assert (long[:50] == short).all()


def test_axes_turn_with_the_mean_wind() -> None:
    north = Wind(mean=(0.0, 5.0, 0.0), sigma=GUSTY.sigma, length=GUSTY.length)
    a, b = (w.sample(generator(2, "world", "wind"), 100, 0.5) - w.mean for w in (GUSTY, north))
    assert_allclose(b, a[:, [1, 0, 2]] * [-1.0, 1.0, 1.0], atol=1e-14)
    still = Wind(mean=(1.0, 2.0, 3.0)).sample(generator(2, "world", "wind"), 4, 0.5)
    assert (still == [1.0, 2.0, 3.0]).all()


def test_low_altitude_table() -> None:
    """MIL-F-8785C: at 1000 ft the three scales meet; at 20 ft sigma_u = 0.1 W_20 / (0.177 + 0.01646)^0.4."""
    high = Wind.dryden((10.0, 0.0, 0.0), height=304.8)
    assert_allclose(high.length, 304.8)
    assert_allclose(high.sigma, 1.0)
    low = Wind.dryden((3.0, 4.0, 0.0), height=6.096)
    assert_allclose(low.sigma, [0.5 / 0.19346**0.4] * 2 + [0.5])
    assert_allclose(low.length, [6.096 / 0.19346**1.2] * 2 + [6.096])
    assert Wind.dryden((3.0, 4.0, 0.0), height=0.1).length[2] == pytest.approx(3.048)  # never below 10 ft
    assert Wind.dryden((0.0, 0.0, 0.0), height=20.0, at_20_ft=7.0).sigma[2] == pytest.approx(0.7)


def test_airspeed_carries_the_gusts_past() -> None:
    fast = Wind(mean=GUSTY.mean, sigma=GUSTY.sigma, length=GUSTY.length, airspeed=10.0)
    a, b = (w.sample(generator(2, "world", "wind"), 100, dt) for w, dt in ((GUSTY, 0.2), (fast, 0.1)))
    assert_allclose(a, b, rtol=0, atol=1e-14)
