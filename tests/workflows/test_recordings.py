"""Real recordings, as much of them as a minute allows; the full protocols are in `tests/evidence`."""

from pathlib import Path

import numpy as np
import pytest

from outrider.data import Outcome
from outrider.eval.metrics import position_errors, velocity_errors
from outrider.io.mavlink import read_sim_truth
from outrider.io.replay import read_change_indication
from outrider.workflows.fuse import fuse
from recorded import (
    COPTER,
    FIXES,
    FLIGHT,
    REPLAYS,
    STATES,
    UPSTREAM_END,
    against,
    at,
    husky,
    outages,
    recording,
    rms,
    unused,
)

pytestmark = pytest.mark.compiled


def test_husky_names_its_compass_and_meets_fixes_it_has_not_seen(recordings: Path):
    run = husky(recordings, withhold={FIXES: 5})
    assert "heading-conflict" in [f.code for f in run.findings]
    assert run.outcome is Outcome.DEGRADED
    score = unused(run)
    assert score.rmse <= 2.1
    assert 0.3 <= score.nis_per_dof <= 1.3
    assert 0.90 <= score.coverage <= 0.995


def test_husky_through_outages(recordings: Path):
    score, pooled = outages(recordings, 60.0, every_s=20.0)
    assert score.rmse.size >= 12
    assert score.median <= 3.1
    assert pooled.nis_per_dof <= 1.3


def test_husky_without_gnss_as_upstream_has_it(recordings: Path):
    run = husky(recordings, preset="robot_localization")
    assert np.hypot(*(run.fused.pose.p[-1, :2] - UPSTREAM_END)) <= 1.05


def test_velocity_beside_ekf2(recordings: Path):
    run = fuse(recording(recordings / REPLAYS / "iris_gps.csv"))
    pairs = against(run, read_change_indication(recordings / STATES / "iris_gps.csv"))
    assert rms(velocity_errors(pairs)) <= 0.1


def test_a_copter_admits_when_it_is_lost_and_recovers(recordings: Path):
    log = recording(recordings / COPTER)
    run = fuse(log)
    pairs = against(run, read_sim_truth(recordings / COPTER))
    t = (pairs.reference.t - log.span[0]) * 1e-9
    valid = at(run.fused.pose.t, pairs.reference.t, run.fused.pose.valid)
    assert not valid[(t > 81.9) & (t < 99.9)].any()  # while the autopilot's own flags are down
    assert valid[(t > 39.3) & (t < 75.0)].all()
    assert np.linalg.norm(position_errors(pairs)[t > 100.1], axis=1).max() < 0.5


def test_a_real_flight_beside_its_receiver(recordings: Path):
    run = fuse(recording(recordings / FLIGHT))
    pairs = against(run, run.tracks["vehicle_gps_position"])
    assert len(pairs) > 150
    assert rms(position_errors(pairs, 2)) <= 0.30
