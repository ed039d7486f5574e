"""Truth against itself: what the IMU would feel, integrated again by another method, must be where the robot went."""

from dataclasses import replace

import numpy as np
import pytest

from outrider.core.rotations import quats_exp, quats_log, quats_multiply, quats_to_matrices
from outrider.errors import ConfigError
from outrider.models.motion import PlanarRobot, StrapdownIns
from outrider.sim import GENTLE, Drift, Place, Truth, drift, drive, fly, follow, generator

SHARP = PlanarRobot(acceleration=0.3, lateral=0.05, yaw_acceleration=0.1, heading_walk=0.0, position_walk=0.0)


def reintegrated(truth: Truth) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """p, v, q at the end from rate and specific force alone, to fourth order over pairs of steps."""
    h = 2.0 * truth.dt
    up = np.array([0.0, 0.0, truth.gravity])
    p, v, q = truth.p[0].copy(), truth.v[0].copy(), truth.q[0].copy()
    for k in range(0, len(truth) - 2, 2):
        w, f = truth.w[k : k + 3], truth.f[k : k + 3]
        # Magnus expansion: rotation over the first step and over both.
        half = h * (5 * w[0] + 8 * w[1] - w[2]) / 24 + h * h / 48 * np.cross(w[0], w[1])
        whole = h * (w[0] + 4 * w[1] + w[2]) / 6 + h * h / 12 * np.cross(w[0], w[2])
        q1, q2 = quats_multiply(q, quats_exp(half)), quats_multiply(q, quats_exp(whole))
        a = [quats_to_matrices(x) @ y - up for x, y in zip((q, q1, q2), f, strict=True)]
        p = p + h * v + h * h * (a[0] + 2 * a[1]) / 6
        v = v + h * (a[0] + 4 * a[1] + a[2]) / 6
        q = q2
    return p, v, q


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize(
    "make",
    [
        lambda rng: drive(rng, 30.0, 25.0),
        lambda rng: fly(rng, 30.0, 50.0),
        lambda rng: fly(rng, 30.0, 50.0, wobble=0.2),
    ],
    ids=["drive", "fly", "fly-free"],
)
def test_rates_and_forces_integrate_back_to_the_path(make, seed):
    truth = make(np.random.default_rng(seed))
    p, v, q = reintegrated(truth)
    assert np.linalg.norm(truth.p, axis=1).max() > 2.0
    np.testing.assert_allclose(p, truth.p[-1], atol=1e-4)
    np.testing.assert_allclose(v, truth.v[-1], atol=1e-5)
    np.testing.assert_allclose(quats_log(quats_multiply(q * [-1, -1, -1, 1], truth.q[-1])), 0.0, atol=1e-6)


def test_a_wrong_rate_does_not_integrate_back():
    truth = fly(np.random.default_rng(0), 20.0, 100.0)
    wrong = replace(truth, w=truth.w + np.array([1e-3, 0.0, 0.0]))
    assert np.linalg.norm(reintegrated(wrong)[0] - truth.p[-1]) > 0.1


def test_exact_drive_is_a_path_of_its_velocity_and_rate():
    truth = drive(np.random.default_rng(3), 30.0, 100.0, exact=True, model=SHARP)
    p = np.vstack([np.zeros(3), np.cumsum(0.5 * (truth.v[1:] + truth.v[:-1]) * truth.dt, axis=0)])
    np.testing.assert_allclose(p, truth.p, atol=1e-3)
    yaw = np.unwrap(truth.trajectory().yaw)
    np.testing.assert_allclose(np.gradient(yaw, truth.dt)[1:-1], truth.w[1:-1, 2], atol=0.03)


def test_exact_drive_has_the_variances_of_its_model():
    model = PlanarRobot(
        acceleration=0.4, lateral=0.1, lateral_time=0.5, yaw_acceleration=0.05, heading_walk=0.02, position_walk=0.05
    )
    runs, seconds = 300, 4.0
    body, rate, excess = np.zeros((runs, 2)), np.zeros(runs), np.zeros(runs)
    for i in range(runs):
        truth = drive(np.random.default_rng(i), seconds, 20.0, exact=True, model=model)
        R = quats_to_matrices(truth.q[-1])
        body[i], rate[i] = (R.T @ truth.v[-1])[:2], truth.w[-1, 2]
        turned = np.sum(0.5 * (truth.w[1:, 2] + truth.w[:-1, 2])) * truth.dt
        travelled = np.linalg.norm(truth.v, axis=1).sum() * truth.dt
        excess[i] = (truth.trajectory().yaw[-1] - turned) / np.sqrt(travelled)
    sd = np.array([body[:, 0].std(), body[:, 1].std(), rate.std(), excess.std()])
    np.testing.assert_allclose(sd, [0.4 * seconds**0.5, 0.1, 0.05 * seconds**0.5, 0.02], rtol=0.12)


def test_robots_stand_before_they_move_and_respect_their_speed():
    rover, drone = drive(np.random.default_rng(1), 60.0, 20.0), fly(np.random.default_rng(1), 60.0, 50.0)
    for truth, fastest in ((rover, 1.8), (drone, 4.0)):
        speed = np.linalg.norm(truth.v, axis=1)
        still = truth.t - truth.t[0] < 5e9
        assert speed[still].max() < 1e-12 and np.abs(truth.w[still]).max() < 1e-12
        np.testing.assert_allclose(truth.f[still], [[0, 0, truth.gravity]] * int(still.sum()), atol=1e-12)
        assert 0.4 * fastest < speed.max() <= fastest + 1e-9
    assert np.abs(rover.p[:, 2]).max() == 0.0
    assert drone.p[:, 2].min() > -1e-12 and drone.p[:, 2].max() > 2.0
    np.testing.assert_allclose(drone.p[-1], drone.p[0], atol=1e-9)  # it lands where it began


def test_drone_without_wobble_feels_thrust_only_along_its_own_up():
    truth = fly(np.random.default_rng(2), 30.0, 50.0)
    np.testing.assert_allclose(truth.f[:, :2], 0.0, atol=1e-12)
    assert np.abs(fly(np.random.default_rng(2), 30.0, 50.0, wobble=0.2).f[:, :2]).max() > 0.5


def test_commanded_turns_are_exact():
    control = np.array([[0.0, 0.0, 0.0]] * 5 + [[1.0, 0.0, np.pi / 8]] * 4 + [[0.0, 0.0, 0.0]] * 5)
    truth = follow(control, 1.0, 11.0, 20.0, start=(2.0, -1.0, 0.3))
    np.testing.assert_allclose(truth.p[0], [2.0, -1.0, 0.0])
    np.testing.assert_allclose(truth.trajectory().yaw[[0, -1]], [0.3, 0.3 + np.pi / 2], atol=1e-12)


def test_truth_between_its_samples():
    truth = fly(np.random.default_rng(5), 20.0, 100.0)
    coarse = truth.select(slice(None, None, 4))
    back = coarse.at(truth.t[: 4 * (len(coarse) - 1)])
    n = len(back)
    np.testing.assert_allclose(back.p, truth.p[:n], atol=1e-5)
    np.testing.assert_allclose(back.v, truth.v[:n], atol=3e-3)
    np.testing.assert_allclose(np.abs(np.sum(back.q * truth.q[:n], axis=1)), 1.0, atol=1e-6)
    np.testing.assert_array_equal(coarse.at(coarse.t).p, coarse.p)
    with pytest.raises(ConfigError, match="not extrapolated"):
        truth.at(truth.t + 1)


def test_slow_errors_start_and_walk_as_told():
    still = follow(np.zeros((1, 3)), 1.0, 20.0, 5.0)
    how = Drift(gyro_start=0.5, gyro_walk=0.2, accel_start=0.0, accel_walk=0.1, gnss_sigma=2.0, gnss_sigma_up=4.0,
                gnss_tau_s=5.0, baro_start=3.0, wheels_start=0.05)  # fmt: skip
    draws = [drift(still, np.random.default_rng(i), how).bias for i in range(300)]
    gyro, accel, gnss = (np.array([getattr(b, n) for b in draws]) for n in ("gyro", "accel", "gnss"))
    np.testing.assert_allclose(gyro[:, 0].std(axis=0), 0.5, rtol=0.15)
    np.testing.assert_allclose((gyro[:, -1] - gyro[:, 0]).std(axis=0), 0.2 * 20**0.5, rtol=0.15)
    np.testing.assert_allclose(accel[:, -1].std(axis=0), 0.1 * 20**0.5, rtol=0.15)
    np.testing.assert_allclose(gnss[:, [0, 50, 100]].std(axis=0), [[2.0, 2.0, 4.0]] * 3, rtol=0.15)
    correlation = np.mean(gnss[:, 25:100, 0] * gnss[:, :75, 0]) / 4.0  # 5 s apart
    assert correlation == pytest.approx(np.exp(-1.0), abs=0.08)
    assert np.std([b.wheels[0] for b in draws]) == pytest.approx(0.05, rel=0.15)
    assert np.std([b.baro[0] for b in draws]) == pytest.approx(3.0, rel=0.15)


def test_wheels_wear_with_the_way_and_not_with_time():
    how = Drift(wheels_start=0.0, wheels_walk=0.01)
    still, moving = follow(np.zeros((1, 3)), 1.0, 20.0, 5.0), follow(np.array([[2.0, 0, 0]]), 1.0, 20.0, 5.0)
    assert np.all(drift(still, np.random.default_rng(0), how).bias.wheels == 0.0)
    ends = [drift(moving, np.random.default_rng(i), how).bias.wheels[-1] for i in range(300)]
    assert np.std(ends) == pytest.approx(0.01 * 40**0.5, rel=0.15)


def test_drift_follows_the_process_model():
    assert Drift.of(GENTLE).wheels_start == GENTLE.initial_scale
    assert Drift.of(StrapdownIns(gnss_bias=0.7)).gnss_sigma == 0.7


def test_changing_one_slow_error_leaves_the_others():
    truth = drive(np.random.default_rng(0), 10.0, 10.0)
    one = drift(truth, generator(1, "a", "drift"), Drift()).bias
    other = drift(truth, generator(1, "a", "drift"), Drift(gyro_start=9.0, gnss_sigma=1.0)).bias
    np.testing.assert_array_equal(one.accel, other.accel)
    np.testing.assert_array_equal(one.wheels, other.wheels)


def test_too_short_a_truth_is_refused():
    with pytest.raises(ConfigError, match="three samples"):
        drive(np.random.default_rng(0), 0.0, 100.0, place=Place(robot="a"))
