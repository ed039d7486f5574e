"""Ranges that are too long in proportion: found by the places of beacons, whatever offset and outliers they have."""

import numpy as np
import pytest

from outrider.data import EventLog, Kind, stream
from outrider.workflows.config import FuseConfig
from outrider.workflows.doctor import examine

pytestmark = pytest.mark.compiled

BEACONS = {1.0: (-30.0, 5.0, 1.0), 2.0: (25.0, -20.0, 2.0), 3.0: (10.0, 40.0, 1.0), 4.0: (-15.0, -30.0, 0.5)}


def drive(seed: int, scale: float, beacons: int = 4, duration: float = 300.0) -> EventLog:
    """A robot in bends among beacons; ranges with 0.3 m of noise, 0.5 m too long by a constant, 3 % of them wild."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, duration, 0.1)
    w = 0.25 * np.sin(0.11 * t) + 0.1
    yaw = 0.3 + np.concatenate([[0.0], np.cumsum(0.05 * (w[1:] + w[:-1]))])
    step = 0.1 * np.column_stack([np.cos(yaw), np.sin(yaw)])
    p = np.cumsum(step, axis=0)
    zero, ns = np.zeros(len(t)), np.round(t * 1e9).astype(np.int64) + 10**18
    rows = np.arange(0, len(t), 3)
    ids = np.array(list(BEACONS))[np.arange(len(rows)) % beacons]
    to = np.array([BEACONS[float(b)] for b in ids])
    far = np.linalg.norm(np.column_stack([p[rows] - to[:, :2], -to[:, 2]]), axis=1)
    told = scale * far + 0.5 + rng.normal(0.0, 0.3, len(rows)) + np.where(rng.random(len(rows)) < 0.03, 8.0, 0.0)
    imu = np.column_stack([zero, zero, w + rng.normal(0.0, 0.005, len(t)), zero, zero, zero + 9.81])
    wheels = np.column_stack([1.0 + rng.normal(0.0, 0.02, len(t)), zero, zero, zero, zero, w])
    streams = [stream("imu", Kind.IMU, ns, imu), stream("wheels", Kind.TWIST, ns, wheels),
               stream("uwb", Kind.RANGE, ns[rows], np.column_stack([ids, told]))]  # fmt: skip
    return EventLog(streams={s.name: s for s in streams}, beacons=BEACONS)


@pytest.mark.parametrize("scale", [0.95, 1.07])
def test_a_scale_is_found_by_the_places_of_the_beacons(scale: float) -> None:
    found = examine(drive(1, scale), FuseConfig())
    (said,) = [f for f in found.findings if f.code == "range-scale"]
    assert found.prescribed["sources"]["uwb"]["range_gain"] == pytest.approx(1.0 / scale, rel=0.012)
    assert said.evidence is not None
    assert np.median(said.evidence.curves[0].y) == pytest.approx(scale, abs=0.02)


@pytest.mark.parametrize("seed", [2, 3, 4])
def test_ranges_without_a_scale_are_left_alone(seed: int) -> None:
    assert "range-scale" not in {f.code for f in examine(drive(seed, 1.0), FuseConfig()).findings}


def test_two_beacons_tell_no_scale_and_what_is_told_stays() -> None:
    assert "range-scale" not in {f.code for f in examine(drive(5, 1.07, beacons=2), FuseConfig()).findings}
    cfg = FuseConfig.model_validate({"sources": {"uwb": {"range_gain": 0.9}}})
    assert "uwb" not in examine(drive(5, 1.07), cfg).prescribed.get("sources", {})
