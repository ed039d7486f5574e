"""The sensors of the simulator against what was asked of them."""

from dataclasses import replace

import numpy as np
import pytest
from devices import NOWHERE, sampled

from outrider.core.geodesy import geodetic_to_enu
from outrider.core.rotations import quats_multiply, quats_to_matrices, rpy_to_quats
from outrider.data import Fix
from outrider.errors import ConfigError
from outrider.sim import Imu, Truth, drive, fly, follow
from outrider.sim.noise import gauss_markov
from outrider.sim.places import parked_airliner
from outrider.sim.sensors import (
    Baro,
    Clocked,
    Faulty,
    GnssReceiver,
    Lidar,
    ObjectPose,
    Quality,
    RobotCamera,
    Spell,
    StereoVelocity,
    Uwb,
    WheelEncoders,
    Wrong,
)  # fmt: skip
from outrider.sim.world import Wall, World
from outrider.typing import Floats


def rng() -> np.random.Generator:
    return np.random.default_rng(11)


def resting(seconds: float, rate_hz: float = 50.0, p: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Truth:
    still = follow(np.zeros((1, 3)), 1.0, seconds, rate_hz)
    return replace(still, p=still.p + np.array(p))


def allan(z: Floats, m: int) -> float:
    """Overlapping Allan deviation over m records."""
    sums = np.vstack([np.zeros((1, z.shape[1])), np.cumsum(z, axis=0)])
    means = (sums[m:] - sums[:-m]) / m
    return float(np.sqrt(0.5 * np.mean((means[m:] - means[:-m]) ** 2)))


def error(s, truth: Truth) -> Floats:
    site = truth.datum
    return geodetic_to_enu(*s.z.T, site.lat, site.lon, site.alt) - truth.at(s.t).p


@pytest.mark.compiled
def test_the_allan_deviation_of_an_imu_has_its_floor_at_the_bias_instability() -> None:
    imu = Imu(rate_hz=20.0, gyro_density=1e-9, accel_density=1e-9, gyro_instability=1e-4, instability_tau_s=5.0)
    z = sampled(imu, resting(20_000.0, 20.0), rng()).z[:, :3]
    peak = max(allan(z, round(20.0 * 5.0 * k)) for k in (1.6, 1.9, 2.2))
    assert peak == pytest.approx(0.664e-4, rel=0.1)


def test_a_gauss_markov_process_forgets_as_it_should() -> None:
    x = gauss_markov(rng(), 200_000, 1, 0.1, 2.0, 3.0)[:, 0]
    assert x.std() == pytest.approx(2.0, rel=0.05)
    for lag in (1, 10, 30, 60):
        assert np.mean(x[lag:] * x[:-lag]) / x.var() == pytest.approx(np.exp(-0.1 * lag / 3.0), abs=0.04)


def test_an_imu_away_from_the_origin_feels_the_turn() -> None:
    """At a lever arm: the second derivative of its own path, from the path itself."""
    truth, lever = fly(np.random.default_rng(8), 30.0, 400.0), np.array([0.4, -0.2, 0.3])
    z = sampled(Imu(rate_hz=400.0, gyro_density=0.0, accel_density=0.0, lever=(0.4, -0.2, 0.3)), truth, rng()).z
    path = truth.p + np.einsum("nij,j->ni", quats_to_matrices(truth.q), lever)
    h = truth.dt
    a = (path[2:] - 2 * path[1:-1] + path[:-2]) / h**2 + np.array([0.0, 0.0, truth.gravity])
    f = np.einsum("nji,nj->ni", quats_to_matrices(truth.q[1:-1]), a)
    np.testing.assert_allclose(z[1:-1, 3:], f, atol=0.03)


def test_an_imu_clips_shakes_and_is_crooked() -> None:
    clipped = sampled(Imu(accel_range=5.0), resting(2.0), rng()).z
    assert clipped[:, 5].max() == 5.0
    shaken = sampled(
        Imu(rate_hz=1000.0, accel_density=0.0, vibration=3.0, vibration_hz=40.0), resting(1.0, 1000.0), rng()
    )
    spectrum = np.abs(np.fft.rfft(shaken.z[:1000, 3]))
    assert spectrum.argmax() == 40 and np.abs(shaken.z[:, 3]).max() == pytest.approx(3.0, rel=0.02)
    crooked = sampled(Imu(accel_density=0.0, accel_scale=0.01, misalignment=0.02), resting(2.0), rng()).z
    assert 0 < abs(crooked[0, 5] - 9.80665) < 0.4 and np.abs(crooked[0, 3:5]).max() > 1e-3


def test_encoders_count_every_tick() -> None:
    patrol = drive(np.random.default_rng(8), 60.0, 50.0)
    speed = np.linalg.norm(patrol.v, axis=1)
    truth = replace(patrol, actuators=np.column_stack([speed, 2.0 * speed]))
    s = sampled(WheelEncoders(wheels=2, tick=0.01, rate_hz=20.0), truth, rng())
    np.testing.assert_allclose(s.z / 20.0 / 0.01, np.rint(s.z / 20.0 / 0.01), atol=1e-6)
    way = np.sum(s.z, axis=0) / 20.0
    went = np.trapezoid(speed, dx=truth.dt)
    np.testing.assert_allclose(way, np.array([1.0, 2.0]) * went, atol=0.011)
    np.testing.assert_allclose(s.extra["motor_1_rpm"], s.z[:, 1] / 0.1 * 30 / np.pi)


def test_encoders_tell_the_mean_speed_since_their_last_record() -> None:
    """Over steps as long as half a period: sums from one end would be late, or early, by half a step."""
    patrol = drive(np.random.default_rng(8), 60.0, 20.0)
    speed = np.linalg.norm(patrol.v, axis=1)
    s = sampled(WheelEncoders(wheels=1, tick=0.0, rate_hz=10.0), replace(patrol, actuators=speed[:, None]), rng())
    went = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * patrol.dt)])[::2]
    np.testing.assert_allclose(s.z[1:, 0], 10.0 * np.diff(went)[: len(s.z) - 1], atol=1e-9)


def test_a_receiver_stays_in_each_solution_as_long_as_asked() -> None:
    dwell = {Fix.FIXED: 30.0, Fix.FLOAT: 10.0}
    s = sampled(GnssReceiver(rate_hz=1.0, dwell_s=dwell), resting(40_000.0, 1.0), rng())
    fixed = s.extra["fix"] == Fix.FIXED.value
    assert fixed.mean() == pytest.approx(0.75, abs=0.03) and (s.extra["fix"][~fixed] == Fix.FLOAT.value).all()
    off = np.linalg.norm(error(s, resting(40_000.0, 1.0))[:, :2], axis=1)
    assert off[fixed].mean() < 0.05 < off[~fixed].mean()


def test_receivers_of_one_region_err_alike_and_others_do_not() -> None:
    slow = {Fix.SINGLE: Quality(white=0.0, slow=1.0, tau_s=50.0)}
    truth = resting(200.0, 5.0)
    other = replace(truth, robot="other")
    for common, alike in (("valley", True), ("", False)):
        r = GnssReceiver(dwell_s={Fix.SINGLE: np.inf}, qualities=slow, common=common)
        a = error(sampled(r, truth, rng()), truth)
        b = error(sampled(r, other, np.random.default_rng(12)), other)
        assert np.allclose(a, b, atol=1e-6) is alike


def test_spells_and_claims() -> None:
    spells = (
        Spell(start_s=10.0, end_s=20.0, fix=Fix.NONE), Spell(start_s=30.0, end_s=40.0, fix=Fix.FLOAT),
        Spell(start_s=50.0, end_s=60.0, offset=(9.0, -6.0, 0.0)), Spell(start_s=70.0, end_s=80.0, null=True),
    )  # fmt: skip
    truth = resting(100.0, 10.0)
    s = sampled(GnssReceiver(spells=spells, claims=0.2), truth, rng())
    since = (s.t - truth.start) * 1e-9

    def within(a: float, b: float) -> np.ndarray:
        return (since >= a) & (since < b)

    assert not within(10, 20).any() and (s.extra["fix"][within(30, 40)] == Fix.FLOAT.value).all()
    assert error(s, truth)[within(50, 60)].mean(axis=0) == pytest.approx([9.0, -6.0, 0.0], abs=0.05)
    assert (s.z[within(70, 80)] == 0.0).all() and (s.extra["fix"][within(70, 80)] == Fix.NONE.value).all()
    assert s.extra["hacc"][0] == pytest.approx(0.2 * np.hypot(0.01, 0.01))
    with pytest.raises(ConfigError):
        Spell(start_s=5.0, end_s=5.0)


def test_walls_hide_satellites_and_reflect() -> None:
    corners = [np.array([[x, -30.0], [x + 1, -30.0], [x + 1, 30.0], [x, 30.0]]) for x in (-4.0, 3.0)]
    street = World(
        name="street", walls=tuple(Wall(name=f"house {i}", outline=c, high=40.0) for i, c in enumerate(corners))
    )
    truth = resting(20.0, 5.0)
    free = sampled(GnssReceiver(obstructed=True), truth, rng(), World(name="open"))
    hidden = sampled(GnssReceiver(obstructed=True), truth, rng(), street)
    assert (free.extra["satellites"] == 16).all() and (len(hidden) == 0 or hidden.extra["satellites"].max() < 12)
    echo = error(sampled(GnssReceiver(multipath=3.0), truth, rng(), street), truth)
    assert (
        np.linalg.norm(echo, axis=1).mean()
        > 5 * np.linalg.norm(error(sampled(GnssReceiver(), truth, rng()), truth), axis=1).mean()
    )


def test_a_lidar_sees_a_wall_and_drops_what_it_should() -> None:
    wall = Wall(name="wall", outline=np.array([[5.0, -50.0], [6.0, -50.0], [6.0, 50.0], [5.0, 50.0]]))
    s = sampled(
        Lidar(beams=181, field=np.pi, sigma=0.0, drop=0.2), resting(20.0), rng(), World(name="w", walls=(wall,))
    )
    angles = Lidar(beams=181, field=np.pi).angles()
    expected = 5.0 / np.cos(angles)
    hit = np.isfinite(s.z)
    assert s.extra["angle_min"][0] == -np.pi / 2 and hit[:, expected < 29.0].mean() == pytest.approx(0.8, abs=0.01)
    np.testing.assert_allclose(s.z[hit], np.broadcast_to(expected, s.z.shape)[hit], rtol=1e-9)
    assert not hit[:, expected > 30.1].any()


def test_the_pose_from_an_airliner_ends_where_its_legs_overlap() -> None:
    world, sensor = parked_airliner(), ObjectPose(object="airliner", rate_hz=5.0)
    beside, behind = resting(5.0, p=(-10.0, 10.0, 0.0)), resting(5.0, p=(-12.0, 18.71, 0.0))
    assert len(sampled(sensor, beside, rng(), world)) == 26 and len(sampled(sensor, behind, rng(), world)) == 0
    z = sampled(ObjectPose(object="airliner", rate_hz=50.0), resting(60.0, p=(-10.0, 10.0, 0.0)), rng(), world).z
    assert z[:, 0].std() == pytest.approx(0.05, rel=0.1) and z[:, 0].mean() == pytest.approx(-10.0, abs=0.005)
    with pytest.raises(ConfigError, match="knows no object 'tractor'"):
        sampled(ObjectPose(object="tractor"), beside, rng(), world)


UP = tuple(rpy_to_quats(np.array([[0.0, -np.pi / 2, 0.0]]))[0].tolist())


def test_a_camera_sees_another_robot_in_its_cone_only() -> None:
    below = resting(5.0)
    above = {"drone": replace(resting(5.0, p=(1.0, 2.0, 6.0)), robot="drone")}
    camera = RobotCamera(mount=UP, sigma=0.0, sigma_angle=0.0)
    s = sampled(camera, below, rng(), NOWHERE, above)
    turned = quats_to_matrices(np.array([UP]))[0].T @ np.array([1.0, 2.0, 6.0])
    np.testing.assert_allclose(s.z[0, 1:4], turned, atol=1e-12)
    assert s.z[0, 1] == pytest.approx(6.0)  # along its axis, upwards
    np.testing.assert_allclose(quats_multiply(np.array([UP]), s.z[:1, 4:])[0], [0, 0, 0, 1], atol=1e-12)
    for sees, there in ((False, (20.0, 0.0, 1.0)), (False, (0.0, 0.0, 16.0)), (True, (0.0, 0.0, 14.0))):
        others = {"drone": replace(resting(5.0, p=there), robot="drone")}
        assert (len(sampled(camera, below, rng(), NOWHERE, others)) > 0) is sees
    roof = Wall(name="roof", outline=np.array([[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]]), low=3.0, high=4.0)
    assert len(sampled(camera, below, rng(), World(name="hall", walls=(roof,)), above)) == 0


def test_a_lidar_sees_other_robots_before_the_wall_behind_them() -> None:
    wall = Wall(name="wall", outline=np.array([[8.0, -50.0], [9.0, -50.0], [9.0, 50.0], [8.0, 50.0]]), high=9.0)
    world, lidar = World(name="w", walls=(wall,)), Lidar(beams=4, sigma=0.0)
    others = {"cart": replace(resting(1.0, p=(5.0, 0.1, 0.0)), robot="cart")}
    alone, past = (
        sampled(lidar, resting(1.0), rng(), world).z[0],
        sampled(lidar, resting(1.0), rng(), world, others).z[0],
    )
    assert alone[2] == pytest.approx(8.0)  # straight ahead
    assert past[2] == pytest.approx(5.0 - np.sqrt(0.3**2 - 0.1**2))
    assert past[[0, 1, 3]].tolist() == alone[[0, 1, 3]].tolist()
    flying = {"drone": replace(resting(1.0, p=(5.0, 0.0, 2.0)), robot="drone")}
    assert sampled(lidar, resting(1.0), rng(), world, flying).z[0].tolist() == alone.tolist()


@pytest.mark.parametrize("rate_hz", [0.0, -5.0, np.nan, np.inf])
def test_a_sensor_that_never_records_is_refused(rate_hz: float) -> None:
    with pytest.raises(ConfigError, match=r"imu: a rate of .* Hz"):
        sampled(Imu(rate_hz=rate_hz), resting(1.0), rng())


def test_stereo_needs_a_surface_and_uwb_a_line_of_sight() -> None:
    wall = Wall(name="wall", outline=np.array([[2.0, -50.0], [3.0, -50.0], [3.0, 50.0], [2.0, 50.0]]), high=9.0)
    world = World(name="w", walls=(wall,))
    assert len(sampled(StereoVelocity(), resting(10.0), rng(), world)) == 21
    assert len(sampled(StereoVelocity(), resting(10.0, p=(-9.0, 0.0, 0.0)), rng(), world)) == 0
    anchors = {1: (-3.0, 4.0, 0.0), 2: (10.0, 0.0, 0.0)}
    s = sampled(Uwb(anchors=anchors, sigma=0.0, offset=0.1), resting(5.0), rng(), world)
    free, hidden = s.z[s.z[:, 0] == 1, 1], s.z[s.z[:, 0] == 2, 1]
    np.testing.assert_allclose(free, 5.1)
    np.testing.assert_allclose(hidden, 10.6)


def test_clocks_and_failures_wrap_any_sensor() -> None:
    truth = resting(20.0)
    good = sampled(Baro(), truth, rng())
    late = sampled(Clocked(sensor=Baro(), offset_s=0.5, drift=1e-3), truth, rng())
    np.testing.assert_array_equal(late.z, good.z)
    np.testing.assert_allclose(late.t - good.t, 0.5e9 + 1e-3 * (good.t - truth.start), atol=1)
    hit = (good.t - truth.start >= 5e9) & (good.t - truth.start < 8e9)
    spoilt = {how: sampled(Faulty(sensor=Baro(), start_s=5, end_s=8, how=how, by=3.0), truth, rng()) for how in Wrong}
    assert len(spoilt[Wrong.SILENT]) == len(good) - hit.sum()
    assert np.isnan(spoilt[Wrong.NAN].z[hit]).all() and (spoilt[Wrong.FROZEN].z[hit] == good.z[~hit][49]).all()
    np.testing.assert_allclose(spoilt[Wrong.SHIFTED].z[hit], good.z[hit] + 3.0)
    for s in spoilt.values():
        np.testing.assert_array_equal(s.z[-50:], good.z[-50:])


def test_a_camera_misses_nobody_at_the_edge_of_its_view() -> None:
    """Whom it certainly does not see costs nothing; in doubt it looks."""
    camera = RobotCamera(rate_hz=50.0, reach=15.0, half_angle=1.2, mount=(0.0, -np.sqrt(0.5), 0.0, np.sqrt(0.5)))
    own = resting(1.0)
    for off, seen in ((1.2 - 1e-9, True), (1.2 + 1e-9, False)):
        for distance, near in ((15.0 - 1e-8, True), (15.0 + 1e-8, False)):
            place = np.array([np.sin(off), 0.0, np.cos(off)]) * distance
            other = replace(own, p=own.p + place, robot="other")
            z = sampled(camera, own, rng(), others={"other": other}).z
            assert len(z) == (len(own) if seen and near else 0)
