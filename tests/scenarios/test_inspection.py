"""The two robots around the airliner in open loop: what is seen when, records against truth, and a few runs."""

import numpy as np
import pytest

from outrider.campaign import grid, run_trials
from outrider.campaign.cooperation import PAPER, cooperation
from outrider.errors import ConfigError
from outrider.filters.cooperative import Source
from outrider.models.sensors import Sensor
from outrider.scenarios.build import build
from outrider.scenarios.files import load_scenario
from outrider.scenarios.inspection import Faults, Tuning, common, crew, sense, tours
from outrider.typing import Floats


@pytest.mark.compiled
def test_tours_keep_clear_of_the_aircraft_and_of_sight_of_each_other_as_in_the_paper() -> None:
    """Overlaps "a few times", lidar "most of the time" (coop2024, IV)."""
    way, world = tours(), build(*load_scenario("airliner-tour", {})).world
    seen = np.zeros(900, np.bool_)
    seen[way.camera // 20 - 1] = True
    windows = int(np.sum(np.diff(seen.astype(int)) == 1) + seen[0])
    assert windows >= 4 and 0.2 < seen.mean() < 0.8
    assert 0.75 <= way.lidar.size / 180 <= 1.0
    for robot in (way.ugv, way.uav):
        assert world.clearance(robot.p + np.array([0.0, 0.0, 0.3])).min() > 0.3
    apart = np.linalg.norm((way.ugv.p - way.uav.p)[way.camera, :2], axis=1)
    assert apart.max() < 5.0


def error(tuning: Tuning, faults: Faults, sensor: Sensor) -> Floats:
    """How far records are from those of another seed, over sigma."""
    one, two = (next(q for q in sense(n, faults, tuning) if q.sensor and q.sensor.code is sensor) for n in (1, 2))
    return (one.z - two.z) / np.sqrt(2.0)


@pytest.mark.compiled
def test_noise_is_what_the_paper_prints() -> None:
    plain = Faults(gyro_bias=0.0, accel_bias=0.0)
    for sensor, sigma in ((Sensor.GNSS_POSITION, 0.7), (Sensor.BARO, 0.25), (Sensor.SPECIFIC_FORCE, 0.015)):
        assert error(Tuning(), plain, sensor).std() == pytest.approx(sigma, rel=0.03)


@pytest.mark.compiled
def test_a_seed_has_the_same_noise_for_every_method_and_fault() -> None:
    plain, biased = (sense(3, f, Tuning()) for f in (Faults(), Faults(gnss_bias=0.41)))
    moved = [k for k, (a, b) in enumerate(zip(plain, biased, strict=True)) if not np.array_equal(a.z, b.z)]
    assert [plain[k].sensor.code for k in moved if plain[k].sensor] == [Sensor.GNSS_POSITION] * 2
    shift = [np.ptp(biased[k].z - plain[k].z, axis=0).max() for k in moved]
    assert max(shift) < 1e-9  # a constant
    one, other = (biased[k].z[0] - plain[k].z[0] for k in moved)
    np.testing.assert_allclose(one, other, atol=1e-9)  # the same for both


def lidar_of(faults: Faults) -> Source:
    return next(q for q in sense(5, faults, Tuning()) if q.sensor and q.sensor.code is Sensor.MAP_POSE)


@pytest.mark.compiled
def test_an_aircraft_off_its_place_shifts_what_the_lidar_says() -> None:
    faults = Faults(aircraft=0.2, aircraft_yaw=0.02)
    here, there = (lidar_of(f) for f in (Faults(), faults))
    assert 0.05 < np.abs(here.z - there.z)[:, :2].mean() < 1.5
    assert len(common(Tuning(gnss_bias=0.4, common=True))) == 1 and common(Tuning(common=True)) == []
    ugv, uav = crew(5, Tuning(aircraft=0.2, consider=True, gnss_bias=0.4))
    assert ugv.consider == ("gnss_bias", "map_error") and uav.consider == ("gnss_bias",)
    assert np.diag(ugv.belief.P)[-3] == pytest.approx(0.04)


def test_a_trial_refuses_what_it_does_not_know() -> None:
    with pytest.raises(ConfigError, match="no parameter 'gnss_bais'"):
        cooperation({"method": "joint", "gnss_bais": 0.4}, 0)
    with pytest.raises(ConfigError, match="ci does not talk by radio"):
        cooperation({"method": "ci", "loss": 0.5}, 0)


@pytest.mark.compiled
def test_a_few_seeds_of_what_the_evidence_shows() -> None:
    """The order and the honesty of the methods, with 3 seeds; bounds with 60 stand in the evidence."""
    methods = ["local", "naive", "split_ci", "distributed", "joint"]
    done = run_trials(cooperation, grid(method=methods), 3)
    assert not done.failed
    shown = ("uav_position", "uav_yaw", "uav_nees", "ugv_position")
    mean = {m: {q: float(done.column(q, method=m).mean()) for q in shown} for m in methods}
    assert mean["joint"]["ugv_position"] <= 0.045 and mean["joint"]["uav_position"] <= 0.075
    assert mean["distributed"]["uav_position"] == pytest.approx(mean["joint"]["uav_position"], rel=0.05)
    for measure in ("uav_position", "uav_yaw"):
        assert mean["distributed"][measure] < mean["split_ci"][measure] < mean["local"][measure]
    assert mean["naive"]["uav_nees"] > 1.5 > 1.3 > mean["joint"]["uav_nees"]
    assert mean["split_ci"]["uav_nees"] < 1.05


@pytest.mark.compiled
def test_a_bias_is_cured_by_states_for_it_and_by_nothing_else() -> None:
    cases = [{"method": "joint", "gnss_bias": 0.41, "tuned_gnss_bias": b} for b in (0.0, 0.41)]
    done = run_trials(cooperation, cases, 2)
    blind, aware = (done.column("uav_position", **c).mean() for c in cases)
    assert aware < 0.085 and blind > 2.0 * aware
    assert done.column("uav_nees", **cases[0]).mean() > 3.0 > 1.6 > done.column("uav_nees", **cases[1]).mean()


@pytest.mark.compiled
def test_the_papers_world_has_the_papers_errors() -> None:
    done = run_trials(cooperation, [{"method": m, **PAPER} for m in ("none", "naive")], 2)
    alone, together = (done.column("ugv_position", method=m).mean() for m in ("none", "naive"))
    assert 0.3 < alone < 0.9 and together < 0.7 * alone
