"""Generated logs with sensors that sit, count and stamp otherwise than anybody told, and what the truth of it is."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation, RotationSpline

from outrider.core.attitudes import quats_to_matrices, rpy_to_quats
from outrider.core.magnetism import field_enu
from outrider.data import EventLog
from outrider.sim.logs import drone_log, sense, wheeled_log
from outrider.sim.motion import drive
from outrider.sim.noise import generator
from outrider.sim.sensors import (
    Attitude,
    BodyTwist,
    Gnss,
    GnssVelocity,
    Imu,
    Magnetometer,
    SteeringEncoder,
    WheelEncoders,
)  # fmt: skip
from outrider.sim.truth import EPOCH, SITE, Drift, Truth, drift
from outrider.typing import Floats

FIELD = tuple(field_enu(SITE.lat, SITE.lon, SITE.alt, EPOCH)[0].tolist())

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


def wheeled(seed: int, duration_s: float = 80.0) -> tuple[EventLog, True_]:
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


def flown(seed: int, duration_s: float = 50.0) -> tuple[EventLog, True_]:
    """A drone whose antenna and receiver's clock nobody wrote down."""
    rng = np.random.default_rng([seed, 8])
    lever = tuple(rng.uniform(-0.4, 0.4, 3).tolist())
    fix = float(rng.uniform(-0.2, 0.2))
    gnss, velocity = Gnss(lever=lever, latency_s=0.2), GnssVelocity(lever=lever, latency_s=0.2)
    sensors = (Imu(rate_hz=200.0), gnss, velocity)
    log, _ = drone_log(seed, duration_s, sensors=sensors, errors=Drift())
    log = replace(late(late(log, "gnss", fix), "gnss_velocity", fix), mounts={})
    return log, {
        ("gnss", "lever arm, forward"): lever[0], ("gnss", "lever arm, left"): lever[1],
        ("gnss", "lever arm, up"): lever[2], ("gnss", "delay against the IMU"): fix,
    }  # fmt: skip


def magnetized(log: EventLog, name: str, seed: int, *, level: bool) -> tuple[EventLog, True_]:
    """The magnetometer beside iron, z = M m + b with M and b drawn, and what the table says of it. Of a robot that only
    yaws the part that it shows: what the steady vertical field makes of soft iron counts as hard iron."""
    rng = np.random.default_rng([seed, 9])
    b, s = rng.uniform(-0.3, 0.3, 3), rng.uniform(-0.1, 0.1, 6)
    M = np.linalg.inv(np.eye(3) + np.array([[s[0], s[3], s[4]], [s[3], s[1], s[5]], [s[4], s[5], s[2]]]))
    z = log.streams[name].z @ M.T + b
    n = 2 if level else 3
    centre = b[:n] + M[:n, n:].sum(axis=1) * FIELD[2] if level else b
    W = np.linalg.inv(M[:n, :n])
    W, names = W / W[0, 0], ("forward", "left", "up")
    true = {(name, f"hard iron, {names[k]}"): float(centre[k]) for k in range(n)}
    true |= {(name, f"soft iron, {names[k]} over forward"): float(W[k, k]) for k in range(1, n)}
    true |= {
        (name, f"soft iron, {names[k]} with {names[m]}"): float(W[k, m]) for k in range(n) for m in range(k + 1, n)
    }
    return log.with_streams(replace(log.streams[name], z=z)), true


def steered(seed: int, duration_s: float = 60.0) -> tuple[EventLog, True_]:
    """A car of which nobody wrote down the wheel base, whose steering is off, with a compass beside iron."""
    rng = np.random.default_rng([seed, 10])
    base, zero, wheel = rng.uniform(0.5, 2.5), np.radians(rng.uniform(-4.0, 4.0)), float(rng.uniform(-0.15, 0.15))
    truth = rolling(seed, duration_s)
    v, w = forward(truth)
    truth = replace(truth, actuators=np.column_stack([v, np.clip(np.arctan2(base * w, v), -1.2, 1.2)]))
    gnss = Gnss(lever=(0.3, 0.1, 0.5), latency_s=0.12, phase_s=0.013)
    sensors = (Imu(), SteeringEncoder(offset=float(zero)), gnss, Magnetometer(field=FIELD))
    log, iron = magnetized(late(sense(truth, sensors, seed), "steering", wheel), "mag", seed, level=True)
    return log, iron | {
        ("steering", "delay against the IMU"): wheel, ("steering", "wheel base"): float(base),
        ("steering", "steering zero"): float(np.degrees(zero)), ("steering", "speed scale"): 1.0,
    }  # fmt: skip


def tracked(seed: int, duration_s: float = 60.0) -> tuple[EventLog, True_]:
    """A robot that tells the speeds of its left and right wheels, whose radii are not quite what it takes them for.
    Ticks are counted up to the stamp, and so are half a period old."""
    rng = np.random.default_rng([seed, 11])
    track, scale, wheel = rng.uniform(0.3, 1.2), rng.uniform(0.95, 1.05), float(rng.uniform(-0.15, 0.15))
    truth = rolling(seed, duration_s)
    v, w = forward(truth)
    truth = replace(truth, actuators=np.column_stack([v - 0.5 * track * w, v + 0.5 * track * w]) / scale)
    sensors = (Imu(), WheelEncoders(wheels=2, rate_hz=25.0, sigma=0.02), Gnss(lever=(0.3, 0.1, 0.5), phase_s=0.013))
    return late(sense(truth, sensors, seed), "encoders", wheel), {
        ("encoders", "delay against the IMU"): wheel + 0.02, ("encoders", "wheel track"): float(track),
        ("encoders", "speed scale"): float(scale),
    }  # fmt: skip


def tumbled(seed: int, duration_s: float = 60.0) -> tuple[EventLog, True_]:
    """An IMU with a compass beside iron, turned by hand every way."""
    truth = rolling(seed, duration_s)
    t = (truth.t - truth.t[0]) * 1e-9
    knots = np.arange(0.0, duration_s + 6.0, 3.0)
    spline = RotationSpline(knots, Rotation.random(len(knots), random_state=seed))
    turn, still = spline(t), np.zeros((len(t), 3))
    held = turn.inv().apply(np.array([0.0, 0.0, truth.gravity]))
    truth = replace(truth, q=turn.as_quat(), w=spline(t, 1), f=held, p=still, v=still)
    return magnetized(sense(truth, (Imu(), Magnetometer(field=FIELD)), seed), "mag", seed, level=False)


def rolling(seed: int, duration_s: float) -> Truth:
    truth = drive(generator(seed, "robot", "motion"), duration_s)
    return drift(truth, generator(seed, "robot", "drift"), Drift(wheels_start=0.0))


def wandering(seed: int, duration_s: float = 150.0, smooth: float = 1.8, tau: float = 7.0) -> tuple[EventLog, True_]:
    """A rover whose receiver states 1 m, scatters by 0.05 m and wanders: by `smooth` [m] smoothly (Matern 3/2) within
    `tau` [s], and beside it by 0.5 m within 30 s (Gauss-Markov)."""
    rng = np.random.default_rng([seed, 12])
    scale = float(rng.uniform(0.93, 1.07))
    gnss = Gnss(lever=(0.3, 0.1, 0.5), rate_hz=2.5, sigma=0.05, phase_s=0.013)
    log, truth = wheeled_log(seed, duration_s, sensors=(Imu(), BodyTwist(), gnss))
    s = log.streams["gnss"]
    far = np.abs(s.t[:, None] - s.t) * 1e-9
    covariance = smooth**2 * (1.0 + far / tau) * np.exp(-far / tau) + 0.25 * np.exp(-far / 30.0)
    e = np.linalg.cholesky(covariance + 1e-9 * np.eye(len(s))) @ rng.standard_normal((len(s), 2)) / 6.37e6
    z = s.z + np.column_stack([e[:, 0], e[:, 1] / np.cos(s.z[:, 0]), np.zeros(len(s))])
    claims = {**s.extra, "hacc": np.ones(len(s))}
    log = log.with_streams(replace(s, z=z, var=np.ones(s.var.shape), extra=claims))
    log = times(log, "wheels", slice(0, 3), 1.0 / scale)
    return log, {("wheels", "speed scale"): scale * (1.0 + float(truth.bias.wheels[0]))}


def forward(truth: Truth) -> tuple[Floats, Floats]:
    """Speed and yaw rate of a robot that does not slide."""
    return np.hypot(truth.v[:, 0], truth.v[:, 1]), truth.w[:, 2]


def straight(seed: int) -> EventLog:
    """A rover that drives straight on: turns, levers across and the gyro's scale show in nothing."""
    truth = drive(generator(seed, "robot", "motion"), 60.0, turn=0.0)
    truth = drift(truth, generator(seed, "robot", "drift"))
    return sense(truth, (Imu(), BodyTwist(), Gnss(lever=(0.3, 0.2, 0.5))), seed)


def parked(seed: int) -> EventLog:
    """A rover that never moves."""
    truth = drive(generator(seed, "robot", "motion"), 60.0, speed=0.0, turn=0.0)
    return sense(truth, (Imu(), BodyTwist(), Gnss(lever=(0.3, 0.2, 0.5))), seed)
