"""Alignment: the heading is found from motion within what it claims, from rest and on the move, or called unknown."""

from dataclasses import replace

import numpy as np
import pytest
from support import AT_ANTENNA, COMPILED, batch, channel, drone, parts, queued, rover

from outrider.core.rotations import quats_exp, quats_to_rpy
from outrider.data import EventLog, Verdict
from outrider.eval.consistency import average_test
from outrider.filters.align import UNKNOWN_HEADING, Alignment, align, turn
from outrider.filters.channels import Records
from outrider.filters.engine import Filter, queue
from outrider.filters.step import ROWS
from outrider.models.motion import LaggedFollower, Motion, PlanarRobot
from outrider.models.sensors import GnssPosition, Heading, YawOfAttitude
from outrider.sim import Attitude, BodyTwist, Gnss, Imu, Truth, drift, drive, drone_log, generator, sense
from outrider.sim import Heading as HeadingSensor
from outrider.sim.logs import ANTENNA

ROVER_SPREAD = {"velocity": 2.0, "yaw_rate": 0.5, "gyro_bias": 0.01, "wheel_scale": 0.05, "gnss_bias": 1e-3}
DRONE_SPREAD = {
    "velocity": 2.0,
    "gyro_bias": 0.02,
    "accel_bias": 0.3,
    "baro_bias": 1000.0,
    "gnss_bias": 1e-3,
    "wind": 1e-3,
}
SENSORS = (Imu(rate_hz=25.0), BodyTwist(), Gnss(lever=ANTENNA, phase_s=0.013))
needs_speed = pytest.mark.compiled  # a bank of filters


def tour(
    seed: int, yaw: float, *, moving: bool = False, seconds: float = 60.0, sensors=SENSORS, **how
) -> tuple[EventLog, Truth]:
    """A robot that starts anywhere in any direction, at rest or (`moving`) in the middle of a drive."""
    truth = drive(
        generator(seed, "robot", "motion"), seconds + 15.0 * moving, 50.0, start=(5.0, -3.0, yaw), stops=False, **how
    )
    if moving:
        truth = truth.select(truth.t >= truth.t[0] + 15_000_000_000)
    truth = drift(truth, generator(seed, "robot", "drift"))
    return sense(truth, sensors, seed), truth


def aligned(f: Filter, log: EventLog, spread=ROVER_SPREAD) -> Alignment:
    found = align(f, queued(f, log), spread)
    assert found is not None
    return found


def yaw_error(f: Filter, a: Alignment, log: EventLog, truth: Truth) -> tuple[float, float]:
    """Error of the heading at the start, and the claimed standard deviation."""
    at = truth.at(np.array([log.span[0] + round(a.t_start * 1e9)]))
    true = float(quats_to_rpy(at.q)[0, 2])
    if "heading" in f.layout:
        yaw, sd = float(a.prior.x[f.layout.state("heading")][0]), float(a.prior.std("heading")[0])
    else:
        yaw = float(quats_to_rpy(a.prior.x[f.layout.state("attitude")][None])[0, 2])
        sd = float(a.prior.std("attitude")[2])
    return float(np.angle(np.exp(1j * (yaw - true)))), sd


# ------------------------------------------------------------------------------------------------ the first fix


@pytest.mark.parametrize("count", [1, 3])
def test_the_first_fix_counts_once(count):
    """After `count` fixes with white and slow errors the stated position and slow error are consistent over seeds."""
    sigma, slow = 0.3, 2.0
    theta = PlanarRobot(gnss_bias=slow).theta()
    fix = channel("gnss", GnssPosition(), use=(0, 1))
    f = Filter(motion=Motion.PLANAR, theta=theta, coasting=theta, channels=(fix,))
    rng, position, bias = np.random.default_rng(5), f.layout.error("position"), f.layout.error("gnss_bias")
    t, nees = 1_000_000 * np.arange(count), []
    for _ in range(100):
        truth, off = rng.normal(size=2) * 50.0, slow * rng.normal(size=2)
        z, r = np.zeros((count, ROWS)), np.full((count, ROWS), np.inf)
        z[:, :2], r[:, :2] = truth + off + sigma * rng.normal(size=(count, 2)), sigma**2
        q = queue([Records(t, t, z, r, np.zeros(count, np.int64), np.arange(count))], 0, f.history)
        a = align(f, q, {"velocity": 1e-3, "yaw_rate": 1e-3, "gnss_bias": slow})
        assert a is not None
        s, _ = batch(f, q, a.prior, t_start=a.t_start)
        rows = [*range(position.start, position.stop), *range(bias.start, bias.stop)]
        e = np.concatenate([s.x[:2] - truth, s.x[f.layout.state("gnss_bias")] - off])
        nees.append(e @ np.linalg.solve(s.P[np.ix_(rows, rows)], e))
    assert average_test(np.array(nees), 4).inside
    np.testing.assert_allclose(s.P[0, 0], slow**2 + sigma**2 / count, rtol=1e-3)
    np.testing.assert_allclose(s.P[0, bias.start], -(slow**2), rtol=1e-3)  # where the one is wrong, so is the other


# ------------------------------------------------------------------------------------------------ heading from motion


@needs_speed
@pytest.mark.parametrize("moving", [False, True], ids=["from rest", "on the move"])
def test_motion_tells_the_heading(moving):
    """Twelve directions: every error within three of the claimed deviations, and their spread not far above one."""
    f, ratios = rover(), []
    for seed in range(12):
        log, truth = tour(seed, 2 * np.pi * seed / 12 - 3.0, moving=moving)
        a = aligned(f, log)
        error, sd = yaw_error(f, a, log, truth)
        assert a.heading_known and sd < 0.3
        ratios.append(error / sd)
    assert np.abs(ratios).max() < 3.0
    assert np.sqrt(np.mean(np.square(ratios))) < 1.3


@needs_speed
def test_motion_tells_the_heading_backwards():
    """A robot that reverses out of its shed looks the other way."""
    f = rover()
    log, truth = tour(3, 0.7, speed=-1.5)
    a = aligned(f, log)
    error, sd = yaw_error(f, a, log, truth)
    assert a.heading_known and abs(error) < 3.0 * sd


@needs_speed
def test_a_drone_finds_its_heading_in_flight():
    f, ratios = drone(), []
    for seed in range(4):
        log, truth = drone_log(seed, 60.0, rate_hz=50.0)
        a = aligned(f, log, DRONE_SPREAD)
        error, sd = yaw_error(f, a, log, truth)
        assert a.heading_known
        ratios.append(error / sd)
    assert np.abs(ratios).max() < 3.0


@needs_speed
def test_who_never_moves_does_not_know():
    f = rover()
    log, _ = tour(1, 1.0, seconds=40.0, speed=0.0, turn=0.0)
    a = aligned(f, log)
    assert not a.heading_known
    assert a.prior.std("heading")[0] == UNKNOWN_HEADING
    assert any("not observable" in how for how in a.how)


@needs_speed
def test_withheld_fixes_have_no_vote():
    """What is held back to score the filter must not leak into its start."""
    f = rover()
    log, _ = tour(1, 1.0)
    records = parts(f, log)
    first = int(records[0].t.min())
    records[0].flag[records[0].t > first] = Verdict.WITHHELD
    a = align(f, queue(records, log.span[0], f.history), ROVER_SPREAD)
    assert a is not None and not a.heading_known


@needs_speed
def test_one_wild_fix_does_not_turn_the_heading():
    f = rover()
    log, truth = tour(2, -2.0)
    records = parts(f, log)
    records[0].z[60, :2] += (4000.0, -3000.0)
    a = align(f, queue(records, log.span[0], f.history), ROVER_SPREAD)
    assert a is not None and a.heading_known
    error, sd = yaw_error(f, a, log, truth)
    assert abs(error) < 3.0 * sd


# ------------------------------------------------------------------------------------------------ heading by a source


def compass(f: Filter, sigma: float = 0.05) -> Filter:
    """The filter with the IMU's own attitude as a heading."""
    return replace(f, channels=(*f.channels, channel("imu_attitude", YawOfAttitude(sigma=sigma))))


@needs_speed
@pytest.mark.parametrize("wrong", [1.2, np.pi, -2.0])
def test_a_wrong_compass_loses_against_motion(wrong):
    f = compass(rover())
    log, truth = tour(4, 0.5, sensors=(*SENSORS, Attitude(yaw_error=wrong)))
    a = aligned(f, log)
    error, sd = yaw_error(f, a, log, truth)
    assert abs(error) < 3.0 * sd < 1.0
    assert any("motion" in how for how in a.how)


@needs_speed
def test_a_right_compass_is_kept():
    f = compass(rover())
    log, truth = tour(4, 0.5, sensors=(*SENSORS, Attitude()))
    a = aligned(f, log)
    error, sd = yaw_error(f, a, log, truth)
    assert abs(error) < 3.0 * sd and sd <= 0.15
    assert any("imu_attitude" in how for how in a.how)


@pytest.mark.parametrize("yaw", [-3.1, -1.0, 0.0, 2.2, 3.14])
def test_two_antennas_tell_the_heading_at_once(yaw):
    """Also across the cut at 180 degrees, where a plain mean would point the other way."""
    f = rover(channels=(channel("gnss", GnssPosition(mount=AT_ANTENNA), use=(0, 1)), channel("heading", Heading())))
    log, truth = tour(1, yaw, seconds=3.0, sensors=(SENSORS[2], HeadingSensor(sigma=0.02)), speed=0.0, turn=0.0)
    a = aligned(f, log)
    error, sd = yaw_error(f, a, log, truth)
    assert a.heading_known and abs(error) < 3.0 * sd and sd <= 0.1


# ------------------------------------------------------------------------------------------------ place, level, nothing


def test_the_start_is_the_first_usable_fix():
    f = rover(channels=rover().channels[:1])
    log, truth = tour(1, 0.0, seconds=3.0, speed=0.0, turn=0.0)
    records = parts(f, log)
    records[0].flag[:4] = Verdict.NO_FIX
    a = align(f, queue(records, log.span[0], f.history), ROVER_SPREAD)
    assert a is not None
    assert a.t_start == pytest.approx((records[0].t[4] - log.span[0]) * 1e-9)
    at = truth.at(records[0].t[4:5])
    error = a.prior.x[f.layout.state("position")] - at.p[0, :2]
    assert (np.abs(error) < 3.0 * a.prior.std("position")).all()


def test_without_positions_the_start_is_the_origin():
    f = rover(channels=rover().channels[1:])
    log, _ = tour(1, 2.0, seconds=3.0)
    a = aligned(f, log)
    assert not a.prior.x[f.layout.state("position")].any() and a.prior.x[f.layout.state("heading")][0] == 0.0
    assert a.prior.std("position").max() < 1e-2 and a.prior.std("heading")[0] < 1e-2
    assert any("origin" in how for how in a.how) and any("by definition" in how for how in a.how)


def test_nothing_usable_is_no_alignment():
    f = rover()
    log, _ = tour(1, 0.0, seconds=2.0, speed=0.0, turn=0.0)
    records = parts(f, log)
    for part in records:
        part.flag[:] = Verdict.NOT_FINITE
    assert align(f, queue(records, log.span[0], f.history), ROVER_SPREAD) is None
    empty = log.with_streams(*(s.select(slice(0, 0)) for s in log))
    assert align(f, queue(parts(f, empty), 0, f.history), ROVER_SPREAD) is None


def test_a_vehicle_without_attitude_needs_none():
    theta = LaggedFollower().theta()
    fix = channel("gnss", GnssPosition())
    f = Filter(motion=Motion.FOLLOWER, theta=theta, coasting=theta, channels=(fix,))
    log, _ = tour(1, 0.0, seconds=2.0, speed=0.0, turn=0.0)
    a = aligned(f, log, {"velocity": 2.0})
    assert not a.heading_known and (a.prior.std("velocity") == 2.0).all()


def still_drone(tilt: tuple[float, float], rate=(0.0, 0.0, 0.0), noise: float = 0.01) -> tuple[Filter, EventLog]:
    """An IMU at rest, tilted, with a gyro bias; a fix so that there is a start."""
    from outrider.data import Kind, stream

    f = drone(channels=drone().channels[:2])
    rng, n = np.random.default_rng(5), 50
    roll, pitch = tilt
    up = np.array([-np.sin(pitch), np.sin(roll) * np.cos(pitch), np.cos(roll) * np.cos(pitch)])
    t = 1_000_000_000 + 20_000_000 * np.arange(n)
    gyro = np.array(rate) + 0.001 * rng.standard_normal((n, 3))
    z = np.hstack([gyro, 9.806 * up + noise * rng.standard_normal((n, 3))])
    log, _ = tour(1, 0.0, seconds=2.0, speed=0.0, turn=0.0)
    gnss = log.streams["gnss"].select(slice(0, 3))
    gnss = replace(gnss, t=t[:3], t_arrival=t[:3])
    return f, EventLog(streams={"imu": stream("imu", Kind.IMU, t, z), "gnss": gnss})


@pytest.mark.parametrize(
    "tilt", [(0.2, -0.3), *(pytest.param(t, marks=needs_speed) for t in ((-1.0, 0.4), (3.0, 0.1)))]
)
def test_gravity_levels_at_rest(tilt):
    f, log = still_drone(tilt, rate=(0.01, -0.02, 0.005))
    a = aligned(f, log, DRONE_SPREAD)
    rpy = quats_to_rpy(a.prior.x[f.layout.state("attitude")][None])[0]
    assert np.abs(rpy[:2] - tilt).max() < 3.0 * 0.03
    bias = a.prior.x[f.layout.state("gyro_bias")]
    assert np.abs(bias - [0.01, -0.02, 0.005]).max() < 3.0 * a.prior.std("gyro_bias")[0]
    assert any("at rest" in how for how in a.how)


def test_a_steady_turn_is_no_gyro_bias():
    """Turning on the spot at a constant rate looks calm; a gyro is not off by 17 degrees a second."""
    f, log = still_drone((0.0, 0.0), rate=(0.0, 0.0, 0.3))
    a = aligned(f, log, DRONE_SPREAD)
    assert not a.prior.x[f.layout.state("gyro_bias")].any()
    assert (a.prior.std("gyro_bias") == DRONE_SPREAD["gyro_bias"]).all()


def test_shaking_levels_roughly():
    f, log = still_drone((0.1, 0.0), noise=3.0)
    a = aligned(f, log, DRONE_SPREAD)
    rpy = quats_to_rpy(a.prior.x[f.layout.state("attitude")][None])[0]
    assert abs(rpy[0] - 0.1) < 3.0 * a.prior.std("attitude")[0]
    assert any("in motion" in how for how in a.how)


@pytest.mark.parametrize("yaw", [0.0, 1.0, -2.5, np.pi])
def test_turning_keeps_the_level(yaw):
    f = drone()
    x = f.layout.zeros()
    x[f.layout.state("attitude")] = quats_exp(np.array([[0.2, -0.1, 0.0]]))[0]
    before = quats_to_rpy(x[f.layout.state("attitude")][None])[0]
    turn(f, x, yaw)
    after = quats_to_rpy(x[f.layout.state("attitude")][None])[0]
    np.testing.assert_allclose(after[:2], before[:2], atol=1e-12)
    assert abs(np.angle(np.exp(1j * (after[2] - before[2] - yaw)))) < 1e-12
    g = rover()
    planar = g.layout.zeros()
    turn(g, planar, yaw)
    assert planar[g.layout.state("heading")][0] == yaw


def test_alignment_is_repeatable():
    f = rover() if COMPILED else rover(channels=rover().channels[1:])
    log, _ = tour(6, 1.3, seconds=20.0 if COMPILED else 2.0)
    one, two = aligned(f, log), aligned(f, log)
    assert one.prior.x.tobytes() == two.prior.x.tobytes() and one.prior.P.tobytes() == two.prior.P.tobytes()
