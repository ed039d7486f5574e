"""Whole logs: the same seed gives the same bytes, and every named fault does what its name says, to its source only."""

import numpy as np
import pytest

from outrider.core.geodesy import geodetic_to_enu
from outrider.core.rotations import quats_conjugate, quats_log, quats_multiply
from outrider.data import Altitude, EventLog, Fix, Kind
from outrider.errors import ConfigError
from outrider.sim import FAULTS, demo_log, drone_log, wheeled_log
from outrider.sim import faults as spoil
from outrider.sim.truth import SITE


@pytest.fixture(scope="module")
def clean() -> EventLog:
    return wheeled_log(2, 60.0, rate_hz=50.0)[0]


@pytest.fixture(scope="module")
def demo():
    return demo_log(1)


def enu(log: EventLog) -> np.ndarray:
    return geodetic_to_enu(*log.streams["gnss"].z.T, SITE.lat, SITE.lon, SITE.alt)


def window(log: EventLog, source: str, start: float, end: float) -> np.ndarray:
    return spoil.within(log, source, start, end)


@pytest.mark.parametrize("make", [wheeled_log, drone_log], ids=["wheeled", "drone"])
def test_same_seed_same_bytes(make):
    one, two, other = (make(seed, 20.0, rate_hz=50.0)[0] for seed in (7, 7, 8))
    assert one.sha256 == two.sha256 != other.sha256
    for name in one.streams:
        assert one.streams[name].z.tobytes() == two.streams[name].z.tobytes()


def test_a_fault_leaves_other_sources_alone(clean):
    spoilt = wheeled_log(2, 60.0, rate_hz=50.0, faults=["gnss-outage", "gnss-jump"])[0]
    assert spoilt.sha256 != clean.sha256
    for name in ("imu", "wheels", "imu_attitude"):
        assert spoilt.streams[name].z.tobytes() == clean.streams[name].z.tobytes()


@pytest.mark.parametrize("name", FAULTS)
def test_every_named_fault_changes_its_kind_reproducibly(clean, name):
    rng = np.random.default_rng
    one, two = spoil.apply(clean, name, rng(3)), spoil.apply(clean, name, rng(3))
    changed = set()
    for before, after, again in zip(clean, one, two, strict=True):
        same = all(getattr(before, c).tobytes() == getattr(after, c).tobytes() for c in ("z", "t", "t_arrival"))
        if not same:
            changed.add(before.kind)
        assert after.z.tobytes() == again.z.tobytes()
    assert changed == {FAULTS[name][0]}


def test_faults_pile_up_without_a_crash(clean):
    rng = np.random.default_rng(0)
    log = clean
    for name in (*FAULTS, *reversed(FAULTS)):
        log = spoil.apply(log, name, rng)
    assert len(log) > 0


def test_outage_jump_and_nulls(clean):
    assert not window(spoil.outage(clean, "gnss", 20.0, 30.0), "gnss", 20.0, 30.0).any()
    hit = window(clean, "gnss", 20.0, 30.0)
    moved = enu(spoil.jump(clean, "gnss", 20.0, 30.0, (15.0, -10.0, 5.0))) - enu(clean)
    np.testing.assert_allclose(moved[hit], [[15.0, -10.0, 5.0]] * int(hit.sum()), atol=2e-3)
    np.testing.assert_allclose(moved[~hit], 0.0, atol=1e-8)
    null = spoil.null_fixes(clean, "gnss", 20.0, 30.0).streams["gnss"]
    assert np.all(null.z[hit] == 0.0) and np.all(null.z[~hit] != 0.0)
    assert np.all(null.extra["fix"][hit] == Fix.NONE.value) and np.all(null.var[hit] == 0.0)


def test_degraded_fixes_err_by_sigma_and_state_what_they_are_told(clean):
    spoilt = spoil.degrade(clean, "gnss", 10.0, 60.0, Fix.FLOAT, 0.5, np.random.default_rng(0), told=0.1)
    s, hit = spoilt.streams["gnss"], window(clean, "gnss", 10.0, 60.0)
    error = (enu(spoilt) - enu(clean))[hit]
    assert np.sqrt(np.mean(error[:, :2] ** 2)) == pytest.approx(0.5, rel=0.35)
    np.testing.assert_allclose(s.var[hit, 0], 0.05**2)
    assert np.all(s.extra["fix"][hit] == Fix.FLOAT.value) and np.all(s.extra["fix"][~hit] == Fix.FIXED.value)


def test_headings_turn_about_the_vertical(clean):
    turned = spoil.turn_heading(clean, "imu_attitude", 0.7).streams["imu_attitude"].z
    delta = quats_log(quats_multiply(turned, quats_conjugate(clean.streams["imu_attitude"].z)))
    np.testing.assert_allclose(delta, [[0.0, 0.0, 0.7]] * len(delta), atol=1e-12)


def test_clocks_duplicates_and_shuffling(clean):
    late = spoil.clock_jump(clean, "wheels", 30.0, 5.0).streams["wheels"]
    shift = late.t - clean.streams["wheels"].t
    assert set(shift.tolist()) == {0, 5_000_000_000}
    twice = spoil.duplicates(clean, "imu", np.random.default_rng(0), 0.1).streams["imu"]
    assert len(twice) / len(clean.streams["imu"]) == pytest.approx(1.1, abs=0.03)
    mixed, kept = spoil.shuffled(clean, "gnss", np.random.default_rng(0), 0.8).streams["gnss"], clean.streams["gnss"]
    assert np.any(np.diff(mixed.t) < 0) and np.all(np.diff(mixed.t_arrival) >= 0)
    np.testing.assert_array_equal(mixed.select(np.argsort(mixed.t)).z, kept.z)


def test_unknown_names_are_answered_with_the_known_ones(clean):
    with pytest.raises(ConfigError, match="gnss-outage"):
        wheeled_log(1, 10.0, faults=["gps-outage"])
    with pytest.raises(ConfigError, match="wheels"):
        spoil.outage(clean, "odom", 0.0, 1.0)


def test_exact_log_has_the_models_own_biases():
    scales = [wheeled_log(i, 1.0, rate_hz=10.0, exact=True)[1].bias.wheels[0] for i in range(60)]
    assert np.std(scales) == pytest.approx(0.05, rel=0.3)


def test_demo_is_a_patrol_that_comes_home(demo):
    log, truth = demo
    assert 300.0 <= log.duration <= 360.0
    assert truth.trajectory().length > 400.0 and np.linalg.norm(truth.p[-1] - truth.p[0]) < 10.0
    speed = np.linalg.norm(truth.v, axis=1)
    assert speed.max() < 2.0 and np.sum(speed[1000:-1500] < 1e-6) > 300  # a stop on the way
    rates = {s.name: round(s.rate) for s in log}
    assert rates == {"imu": 100, "wheels": 20, "gnss": 5, "imu_attitude": 20}
    assert log.streams["gnss"].altitude is Altitude.ELLIPSOID and set(log.mounts) == {"gnss", "imu"}


def test_demo_shows_its_faults(demo):
    log, truth = demo
    gnss = log.streams["gnss"]
    since = (gnss.t - log.span[0]) * 1e-9
    assert np.diff(since).max() == pytest.approx(40.2, abs=0.3)
    assert np.sum(gnss.extra["fix"] == Fix.FLOAT.value) == pytest.approx(150, abs=2)
    error = np.linalg.norm((enu(log) - truth.at(gnss.t).p)[:, :2], axis=1)
    assert error[(since > 275.2) & (since < 278.8)].min() > 10.0
    assert np.percentile(error[since < 150.0], 99) < 0.3  # lever arm and centimetres
    attitude = log.of(Kind.ATTITUDE)[0]
    yaw = quats_log(quats_multiply(attitude.z, quats_conjugate(truth.at(attitude.t).q)))[:, 2]
    assert np.rad2deg(np.median(yaw)) == pytest.approx(40.0, abs=0.5)
