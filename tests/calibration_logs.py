"""Generated logs with sensors that sit, count and stamp otherwise than anybody told, and what the truth of it is."""

from dataclasses import replace

import numpy as np

from outrider.core.attitudes import quats_to_matrices, rpy_to_quats
from outrider.data import EventLog
from outrider.sim.logs import drone_log, sense, wheeled_log
from outrider.sim.motion import drive
from outrider.sim.noise import generator
from outrider.sim.sensors import Attitude, BodyTwist, Gnss, GnssVelocity, Imu
from outrider.sim.truth import Drift, drift
from outrider.typing import Floats

True_ = dict[tuple[str, str], float]  # (source, parameter) -> value, in the words and units of the table


def late(log: EventLog, name: str, seconds: float) -> EventLog:
    s, off = log.streams[name], round(seconds * 1e9)
    return log.with_streams(replace(s, t=s.t + off, t_arrival=s.t_arrival + off))


def times(log: EventLog, name: str, columns: slice, gain: float) -> EventLog:
    z = log.streams[name].z.copy()
    z[:, columns] *= gain
    return log.with_streams(replace(log.streams[name], z=z))


def turned(log: EventLog, name: str, R: Floats) -> EventLog:
    """The IMU bolted on by R (body from sensor)."""
    z = log.streams[name].z
    return log.with_streams(replace(log.streams[name], z=np.hstack([z[:, :3] @ R, z[:, 3:] @ R])))


def wheeled(seed: int, duration_s: float = 150.0) -> tuple[EventLog, True_]:
    """A rover of which nobody wrote down anything."""
    rng = np.random.default_rng([seed, 7])
    lever = (*rng.uniform(-0.6, 0.6, 2).tolist(), 0.5)
    fix, wheel = rng.uniform(-0.2, 0.2, 2).tolist()
    gyro, turn = rng.uniform(0.98, 1.02), rng.uniform(0.93, 1.07)
    rpy = rng.uniform(-1.0, 1.0, 3) * [8.0, 8.0, 15.0]
    sensors = (Imu(), BodyTwist(), Gnss(lever=lever, latency_s=0.12, phase_s=0.013), Attitude())
    log, truth = wheeled_log(seed, duration_s, sensors=sensors)
    log = replace(late(late(log, "gnss", fix), "wheels", wheel), mounts={})
    log = times(times(log, "imu", slice(0, 3), 1.0 / gyro), "wheels", slice(3, 6), 1.0 / turn)
    log = turned(log, "imu", quats_to_matrices(rpy_to_quats(np.radians(rpy))).reshape(3, 3))
    return log, {
        ("gnss", "lever arm, forward"): lever[0], ("gnss", "lever arm, left"): lever[1],
        ("gnss", "delay against the IMU"): fix, ("wheels", "delay against the IMU"): wheel,
        ("wheels", "speed scale"): 1.0 + float(truth.bias.wheels[0]), ("imu", "turn rate scale"): gyro,
        ("wheels", "turn rate scale against the gyro"): turn / gyro,
        ("imu", "mount, roll"): rpy[0], ("imu", "mount, pitch"): rpy[1], ("imu", "mount, yaw"): rpy[2],
    }  # fmt: skip


def flown(seed: int, duration_s: float = 90.0) -> tuple[EventLog, True_]:
    """A drone whose antenna and receiver's clock nobody wrote down."""
    rng = np.random.default_rng([seed, 8])
    lever = (*rng.uniform(-0.4, 0.4, 2).tolist(), 0.1)
    fix = float(rng.uniform(-0.2, 0.2))
    sensors = (Imu(rate_hz=200.0), Gnss(lever=lever, latency_s=0.2), GnssVelocity(lever=lever, latency_s=0.2))
    log, _ = drone_log(seed, duration_s, sensors=sensors, errors=Drift())
    log = replace(late(late(log, "gnss", fix), "gnss_velocity", fix), mounts={})
    return log, {
        ("gnss", "lever arm, forward"): lever[0], ("gnss", "lever arm, left"): lever[1],
        ("gnss", "delay against the IMU"): fix,
    }  # fmt: skip


def straight(seed: int) -> EventLog:
    """A rover that drives straight on: turns, levers across and the gyro's scale show in nothing."""
    truth = drive(generator(seed, "robot", "motion"), 120.0, turn=0.0)
    truth = drift(truth, generator(seed, "robot", "drift"))
    return sense(truth, (Imu(), BodyTwist(), Gnss(lever=(0.3, 0.2, 0.5))), seed)


def parked(seed: int) -> EventLog:
    """A rover that never moves."""
    truth = drive(generator(seed, "robot", "motion"), 60.0, speed=0.0, turn=0.0)
    return sense(truth, (Imu(), BodyTwist(), Gnss(lever=(0.3, 0.2, 0.5))), seed)
