"""Starts in flight: velocity and attitude by the first seconds, and even flight that is not taken for rest."""

import numpy as np
import pytest

from outrider.core.rotations import so3_exp
from outrider.data import EventLog, Fix, Outcome
from outrider.filters.moving_start import start_of, way
from outrider.sim.logs import ANTENNA, drone_log
from outrider.sim.sensors import Gnss, Imu
from outrider.sim.truth import Drift
from outrider.typing import Floats
from outrider.workflows.config import FuseConfig
from outrider.workflows.fuse import fuse

G = 9.81


def turned(*phi: float) -> Floats:
    R = np.empty((3, 3))
    so3_exp(np.array(phi), R)
    return R


def test_the_start_that_made_the_way():
    """Rates about a skew axis, forces of a given path, and an attitude that is told 30 degrees wrong."""
    t = np.arange(0.0, 5.0, 0.002)
    w = np.array([0.3, -0.2, 0.5])
    a = np.column_stack([2.0 * np.sin(2.0 * t), np.cos(3.0 * t), 0.5 * np.sin(t)])
    R0, v0, lever = turned(0.1, -0.4, 2.0), np.array([3.0, -4.0, 0.5]), np.array([0.2, 0.1, 0.4])
    R = np.array([R0 @ turned(*(w * s)) for s in t])
    force = np.einsum("nji,nj->ni", R, a + np.array([0.0, 0.0, G]))
    p = np.column_stack([  # integrals of a, twice
        v0[0] * t + 0.5 * (2.0 * t - np.sin(2.0 * t)), v0[1] * t + (1.0 - np.cos(3.0 * t)) / 9.0,
        v0[2] * t + 0.5 * (t - np.sin(t)),
    ])  # fmt: skip
    at = np.arange(0, len(t), 250)
    fixes, sigma = (p + R @ lever)[at], np.full((len(at), 3), 0.01)
    loose = np.full(6, 1e3)
    found = start_of(
        way(t, np.tile(w, (len(t), 1)), force), t[at], fixes, sigma, lever, turned(0.3, 0.3, 0.2) @ R0, loose, G
    )
    assert found is not None
    assert found[0] == pytest.approx(v0, abs=0.02)
    assert found[1] == pytest.approx(R0, abs=0.01)
    fixes[3] += 30.0  # a reflection: no motion of this body
    assert start_of(way(t, np.tile(w, (len(t), 1)), force), t[at], fixes, sigma, lever, R0, loose, G) is None


@pytest.mark.compiled
@pytest.mark.parametrize("seed", [1, 5])
def test_a_flight_that_is_joined_under_way(seed: int):
    """Seed 5 flies evenly in a wide turn when it is joined: at rest it would have no more to feel."""
    rtk = Gnss(rate_hz=1.0, sigma=0.05, sigma_up=0.08, lever=ANTENNA, fix=Fix.FIXED)
    log, truth = drone_log(seed, 40.0, errors=Drift(), sensors=(Imu(rate_hz=200.0), rtk))
    joined = log.span[0] + 20_000_000_000
    log = EventLog(streams={s.name: s.select(s.t >= joined) for s in log}, mounts=log.mounts)
    assert truth.datum is not None
    datum = {"lat_deg": np.degrees(truth.datum.lat), "lon_deg": np.degrees(truth.datum.lon), "alt_m": truth.datum.alt}
    run = fuse(log, FuseConfig.model_validate({"datum": datum}))
    assert run.outcome is Outcome.OK
    at = np.searchsorted(truth.t, run.fused.t).clip(0, len(truth.t) - 1)
    error = np.linalg.norm(run.fused.pose.p - truth.p[at], axis=1)
    first = run.fused.t < run.fused.t[0] + 1_000_000_000
    assert np.sqrt(np.mean(error[first] ** 2)) < 0.3
    assert error.max() < 2.0
