"""Sensors against the truth they sample: noise levels, conventions, mounts and lever arms, each checked by hand."""

from itertools import pairwise

import numpy as np
import pytest
from devices import sampled

from outrider.core.geodesy import geodetic_to_enu
from outrider.core.rotations import quats_multiply, quats_to_matrices, rpy_to_quats
from outrider.data import Altitude, Fix, Kind
from outrider.sim import (
    Attitude,
    Baro,
    BodyTwist,
    Drift,
    Gnss,
    GnssVelocity,
    Heading,
    Imu,
    Magnetometer,
    Truth,
    drift,
    drive,
    fly,
    follow,
    generator,
    sense,
)  # fmt: skip

LEVER = (0.5, -0.3, 0.8)
TILTED = tuple(float(x) for x in rpy_to_quats(np.array([0.5, -0.2, 2.0])))


@pytest.fixture(scope="module")
def flight() -> Truth:
    truth = fly(np.random.default_rng(8), 40.0, 100.0)
    return drift(truth, np.random.default_rng(9), Drift(gnss_sigma=1.0, baro_start=2.0))


@pytest.fixture(scope="module")
def patrol() -> Truth:
    return drift(drive(np.random.default_rng(8), 60.0, 50.0), np.random.default_rng(9))


def test_imu_noise_falls_with_averaging_as_white_noise_does():
    still = follow(np.zeros((1, 3)), 1.0, 400.0, 50.0)
    z = sampled(Imu(rate_hz=50.0, gyro_density=1e-3, accel_density=0.02), still, np.random.default_rng(0)).z
    for columns, density in ((slice(0, 3), 1e-3), (slice(3, 6), 0.02)):
        for seconds in (0.02, 0.2, 2.0):  # Allan deviation of white noise: density / sqrt(tau)
            m = round(50.0 * seconds)
            means = z[: len(z) // m * m, columns].reshape(-1, m, 3).mean(axis=1)
            allan = np.sqrt(0.5 * np.mean(np.diff(means, axis=0) ** 2))
            assert allan == pytest.approx(density / seconds**0.5, rel=0.12)
    np.testing.assert_allclose(z[:, 5].mean(), still.gravity, atol=0.01)  # at rest, up


def test_imu_adds_bias_and_turns_into_its_mount(flight):
    quiet = sampled(Imu(gyro_density=0.0, accel_density=0.0, mount=TILTED), flight, np.random.default_rng(0))
    R = quats_to_matrices(np.array(TILTED))
    np.testing.assert_allclose(quiet.z[:, :3] @ R.T, flight.w + flight.bias.gyro, atol=1e-12)
    np.testing.assert_allclose(quiet.z[:, 3:] @ R.T, flight.f + flight.bias.accel, atol=1e-11)
    np.testing.assert_array_equal(quiet.t, flight.t)


def test_wheels_measure_too_little_when_scale_is_positive(patrol):
    s = BodyTwist(sigma_v=0.0, sigma_w=0.0).sample(patrol, np.random.default_rng(0))
    here = patrol.at(s.t)
    speed = np.linalg.norm(here.v, axis=1)
    np.testing.assert_allclose(s.z[:, 0] * (1.0 + here.bias.wheels), speed, atol=2e-4)
    np.testing.assert_allclose(s.z[:, 5], here.w[:, 2])
    assert np.all(s.z[:, 1:5] == 0.0) and np.isnan(s.var[:, 1:5]).all() and not np.isnan(s.var[:, [0, 5]]).any()


def test_full_twist_holds_all_six(flight):
    s = BodyTwist(rolling=False, sigma_v=0.1, sigma_w=0.05, rate_hz=50.0).sample(flight, np.random.default_rng(0))
    here = flight.at(s.t)
    body = np.einsum("nji,nj->ni", quats_to_matrices(here.q), here.v) / (1.0 + here.bias.wheels[:, None])
    np.testing.assert_allclose((s.z - np.hstack([body, here.w])).std(axis=0), [0.1] * 3 + [0.05] * 3, rtol=0.1)


def test_gnss_is_the_antenna_with_slow_and_white_error(flight):
    sensor = Gnss(rate_hz=20.0, sigma=0.2, sigma_up=0.5, lever=LEVER, latency_s=0.15, fix=Fix.FLOAT)
    s = sensor.sample(flight, np.random.default_rng(1))
    here, site = flight.at(s.t), flight.datum
    antenna = here.p + np.einsum("nij,j->ni", quats_to_matrices(here.q), LEVER)
    error = geodetic_to_enu(*s.z.T, site.lat, site.lon, site.alt) - antenna - here.bias.gnss
    np.testing.assert_allclose(error.std(axis=0), [0.2, 0.2, 0.5], rtol=0.1)
    np.testing.assert_allclose(s.var[0], [0.04, 0.04, 0.25])
    assert np.all(s.t_arrival - s.t == 150_000_000)
    assert s.altitude is Altitude.ELLIPSOID and set(s.extra["fix"]) == {Fix.FLOAT.value}


def test_gnss_velocity_is_that_of_the_antenna(flight):
    position = Gnss(rate_hz=100.0, sigma=0.0, sigma_up=0.0, lever=LEVER)
    velocity = GnssVelocity(rate_hz=100.0, sigma=0.0, sigma_up=0.0, lever=LEVER)
    clean = drift(flight, np.random.default_rng(0), Drift())
    site, rng = flight.datum, np.random.default_rng(0)
    p = geodetic_to_enu(*position.sample(clean, rng).z.T, site.lat, site.lon, site.alt)
    moving = np.gradient(p, flight.dt, axis=0)[2:-2]
    np.testing.assert_allclose(velocity.sample(clean, rng).z[2:-2], moving, atol=5e-3)


def test_attitude_heading_and_magnetometer_agree_on_north(flight):
    rng = np.random.default_rng(0)
    claimed = Attitude(sigma=(0.0, 0.0, 0.0), yaw_error=0.7, mount=TILTED, rate_hz=10.0).sample(flight, rng)
    here = flight.at(claimed.t)
    turned = quats_multiply(rpy_to_quats(np.array([0.0, 0.0, 0.7])), quats_multiply(here.q, np.array(TILTED)))
    np.testing.assert_allclose(np.abs(np.sum(claimed.z * turned, axis=1)), 1.0, atol=1e-12)
    assert claimed.var.shape[1] == 3

    heading = Heading(sigma=0.0, offset=3.0, rate_hz=10.0).sample(flight, rng).z[:, 0]
    assert np.all(np.abs(heading) <= np.pi)
    np.testing.assert_allclose(np.exp(1j * heading), np.exp(1j * (here.trajectory().yaw + 3.0)), atol=1e-12)

    field = (0.02, 0.4, -0.9)
    mag = Magnetometer(field=field, sigma=0.0, hard_iron=(0.1, 0.0, 0.0), mount=TILTED, rate_hz=10.0).sample(
        flight, rng
    )
    R = quats_to_matrices(quats_multiply(here.q, np.array(TILTED)))
    np.testing.assert_allclose(np.einsum("nij,nj->ni", R, mag.z - [0.1, 0.0, 0.0]), [field] * len(mag), atol=1e-12)


def test_attitude_noise_is_about_the_body_axes(flight):
    s = Attitude(sigma=(0.01, 0.02, 0.05), rate_hz=100.0).sample(flight, np.random.default_rng(0))
    R = np.einsum("nji,njk->nik", quats_to_matrices(flight.q), quats_to_matrices(s.z))
    np.testing.assert_allclose([R[:, 2, 1].std(), R[:, 0, 2].std(), R[:, 1, 0].std()], [0.01, 0.02, 0.05], rtol=0.1)


def test_baro_holds_offset_and_reference(flight):
    s = Baro(sigma=0.3, reference=100.0, rate_hz=50.0).sample(flight, np.random.default_rng(0))
    here = flight.at(s.t)
    rest = s.z[:, 0] - here.p[:, 2] - here.bias.baro - 100.0
    assert abs(rest.mean()) < 0.05 and rest.std() == pytest.approx(0.3, rel=0.1)


def test_every_sensor_fills_a_stream_of_its_kind_and_rate(flight):
    sensors = [Imu(), Attitude(), BodyTwist(), Gnss(phase_s=0.05), GnssVelocity(), Baro(), Heading(),
               Magnetometer(field=(0.0, 1.0, 0.0))]  # fmt: skip
    kinds = {Kind.IMU, Kind.ATTITUDE, Kind.TWIST, Kind.GNSS, Kind.GNSS_VELOCITY, Kind.BARO, Kind.HEADING, Kind.MAG}
    log = sense(flight, sensors, seed=1)
    assert {s.kind for s in log} == kinds
    for sensor, s in zip(sensors, log, strict=True):
        assert s.rate == pytest.approx(sensor.rate_hz, rel=1e-3)
        assert np.isfinite(s.z).all() and s.t[0] >= flight.t[0] and s.t[-1] <= flight.t[-1]


def test_random_numbers_belong_to_the_sensor(patrol):
    few = sense(patrol, [Imu(), Gnss()], seed=4)
    more = sense(patrol, [Heading(), Gnss(), Baro(), Imu(), Imu(name="imu2")], seed=4)
    for name in few.streams:
        assert few.streams[name].z.tobytes() == more.streams[name].z.tobytes()
    draws = [generator(4, r, s).random() for r, s in (("a", "imu"), ("a", "imu2"), ("b", "imu"), ("imu", "a"))]
    draws.append(generator(5, "a", "imu").random())
    assert all(x != y for x, y in pairwise(sorted(draws)))
