"""A simulated team that sees barcodes: what it logs is what was asked for."""

import numpy as np
import pytest

from outrider.core.attitudes import wrap_all
from outrider.errors import ConfigError
from outrider.sim.barcodes import BarcodeTeam, barcode_log

TEAM = BarcodeTeam(robots=2, duration_s=300.0, misread=0.0)


def test_the_same_seed_gives_the_same_log() -> None:
    one, two, other = (barcode_log(TEAM, seed)[0] for seed in (1, 1, 2))
    for name, s in one.streams.items():
        np.testing.assert_array_equal(s.z, two.streams[name].z)
        assert s.z.shape != other.streams[name].z.shape or not np.array_equal(s.z, other.streams[name].z)


def test_sightings_scatter_as_told() -> None:
    log, truth = barcode_log(TEAM, 1)
    s, path = log.streams["robot1/measurement"], truth["robot1"]
    rows = s.z[:, 0] > 2
    p = np.column_stack([np.interp(s.t[rows], path.t, path.p[:, i]) for i in range(2)])
    yaw = np.interp(s.t[rows], path.t, np.unwrap(path.yaw))
    d = np.array([log.beacons[k][:2] for k in s.z[rows, 0].tolist()]) - p
    r, b = s.z[rows, 1] - np.hypot(*d.T), wrap_all(s.z[rows, 2] - np.arctan2(d[:, 1], d[:, 0]) + yaw)
    middle = np.abs(b) < 0.03  # ground truth has a gap, over which it is interpolated
    assert middle.mean() > 0.97
    assert np.std(r[middle]) == pytest.approx(0.12, rel=0.06)
    assert np.std(b[middle]) == pytest.approx(np.radians(0.5), rel=0.10)
    assert np.hypot(*d.T).max() < TEAM.reach + 0.1


def test_barcodes_are_misread_as_often_as_told() -> None:
    log, _ = barcode_log(BarcodeTeam(robots=3, duration_s=300.0, misread=0.2, landmarks=10), 1)
    z = np.vstack([s.z for s in log if s.name.endswith("measurement")])
    assert np.mean(z[:, 0] < 0) == pytest.approx(0.1, abs=0.02)  # half of them as nobody's


def test_who_may_see_landmarks() -> None:
    log, _ = barcode_log(BarcodeTeam(robots=3, duration_s=120.0, misread=0.0, seers=1, shown=4), 1)
    assert set(log.streams["robot1/measurement"].z[:, 0]) <= {2.0, 3.0, 4.0, 5.0, 6.0, 7.0}
    assert set(log.streams["robot2/measurement"].z[:, 0]) <= {1.0, 3.0}


def test_impossible_teams_are_refused() -> None:
    with pytest.raises(ConfigError, match="1 to 20 robots"):
        barcode_log(BarcodeTeam(robots=0), 1)
