"""Whole logs with their truth: a wheeled robot, a drone, and the patrol that `outrider demo` shows."""

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from outrider.core.geodesy import gravity
from outrider.core.magnetism import field_enu
from outrider.data import EventLog, Fix
from outrider.models.motion.planar import PlanarRobot
from outrider.sim import faults as spoil
from outrider.sim.motion import GENTLE, drive, fly, follow
from outrider.sim.noise import generator
from outrider.sim.sensors import (
    Attitude,
    Baro,
    BodyTwist,
    Gnss,
    GnssVelocity,
    Imu,
    Magnetometer,
    Plain,
    Sensor,
    Setting,
    make_device,
)  # fmt: skip
from outrider.sim.truth import EPOCH, SITE, Drift, Place, Truth, drift
from outrider.sim.world import World
from outrider.typing import Floats

ANTENNA = (0.20, 0.05, 0.60)  # m, body: where the demo robots carry their GNSS antenna


def sense(
    truth: Truth, sensors: Iterable[Sensor | Plain], seed: int, mounts: Mapping[str, Floats] | None = None
) -> EventLog:
    """Every sensor's record of the truth, each from random numbers of its own."""
    world = World(name="flat", datum=truth.datum, gravity=truth.gravity)
    setting = Setting(world=world, robot=truth.robot, start=truth.start, end=int(truth.t[-1]), seed=seed)
    devices = {s.name: make_device(s, setting, generator(seed, truth.robot, s.name)) for s in sensors}
    streams = {name: device(truth, {}) for name, device in devices.items()}
    return signed(EventLog(streams=streams, path=f"simulated-{seed}", mounts=mounts or {}))


def wheeled_log(
    seed: int,
    duration_s: float = 120.0,
    *,
    rate_hz: float = 100.0,
    exact: bool = False,
    model: PlanarRobot = GENTLE,
    errors: Drift | None = None,
    sensors: Sequence[Sensor | Plain] | None = None,
    faults: Sequence[str] = (),
    robot: str = "robot",
) -> tuple[EventLog, Truth]:
    """A wheeled robot with IMU, wheels, RTK and the IMU's own attitude; `faults` are names in `outrider.sim.FAULTS`."""
    truth = drive(generator(seed, robot, "motion"), duration_s, rate_hz, exact=exact, model=model, place=_place(robot))
    truth = drift(truth, generator(seed, robot, "drift"), errors or (Drift.of(model) if exact else Drift()))
    log = sense(truth, _wheeled(rate_hz) if sensors is None else sensors, seed, antenna())
    return _spoilt(log, faults, seed, robot), truth


def drone_log(
    seed: int,
    duration_s: float = 90.0,
    *,
    rate_hz: float = 200.0,
    speed: float = 4.0,
    errors: Drift = Drift(gnss_sigma=0.5, gnss_sigma_up=1.0, baro_start=1.0, baro_walk=0.02),
    sensors: Sequence[Sensor | Plain] | None = None,
    faults: Sequence[str] = (),
    robot: str = "drone",
) -> tuple[EventLog, Truth]:
    """A drone with IMU, single-point GNSS and its velocity, barometer and magnetometer."""
    truth = fly(generator(seed, robot, "motion"), duration_s, rate_hz, speed=speed, place=_place(robot))
    truth = drift(truth, generator(seed, robot, "drift"), errors)
    log = sense(truth, _flying(rate_hz) if sensors is None else sensors, seed, antenna())
    return _spoilt(log, faults, seed, robot), truth


def demo_log(seed: int = 1) -> tuple[EventLog, Truth]:
    """Five and a half minutes of patrol with what goes wrong outdoors: a 40 s GNSS outage under trees, a float stretch
    whose receiver is far too sure of itself, a reflection off a wall, and a compass that is wrong by 40 degrees."""
    robot = "rover"
    control, duration = _patrol()
    truth = follow(control, 1.0, duration, 100.0, start=(-38.0, -22.0, 0.0), place=_place(robot))
    truth = drift(truth, generator(seed, robot, "drift"), Drift(gyro_start=4e-3))
    truth = replace(truth, bias=replace(truth.bias, wheels=truth.bias.wheels + 0.03))
    log = sense(truth, _wheeled(100.0), seed, antenna())
    rng = generator(seed, robot, "faults")
    log = spoil.outage(log, "gnss", 150.0, 190.0)
    log = spoil.degrade(log, "gnss", 225.0, 255.0, Fix.FLOAT, 0.5, rng, told=0.1)
    log = spoil.jump(log, "gnss", 275.0, 279.0, (9.0, -6.0, 3.0))
    log = spoil.turn_heading(log, "imu_attitude", np.deg2rad(40.0))
    return signed(replace(log, path=f"demo-{seed}")), truth


def antenna(frame: str = "gnss") -> dict[str, Floats]:
    """The mounts of `wheeled_log` and `drone_log`, as a log's static transforms state them."""
    T = np.eye(4)
    T[:3, 3] = ANTENNA
    return {frame: T, "imu": np.eye(4)}


def _wheeled(rate_hz: float) -> tuple[Sensor | Plain, ...]:
    gnss = Gnss(lever=ANTENNA, latency_s=0.12, phase_s=0.013)
    return Imu(rate_hz=rate_hz), BodyTwist(), gnss, Attitude()


def _flying(rate_hz: float) -> tuple[Sensor | Plain, ...]:
    site = SITE
    gnss = Gnss(sigma=0.4, sigma_up=0.7, lever=ANTENNA, fix=Fix.SINGLE, satellites=14, latency_s=0.2)
    doppler = GnssVelocity(lever=ANTENNA, latency_s=0.2)
    east, north, up = field_enu(site.lat, site.lon, site.alt, EPOCH)[0].tolist()
    return Imu(rate_hz=rate_hz), gnss, doppler, Baro(reference=site.alt), Magnetometer(field=(east, north, up))


def _place(robot: str) -> Place:
    return Place(gravity=gravity(SITE.lat, SITE.alt), datum=SITE, robot=robot)


def _spoilt(log: EventLog, names: Sequence[str], seed: int, robot: str) -> EventLog:
    for name in names:
        log = spoil.apply(log, name, generator(seed, robot, f"fault {name}"))
    return signed(log)


def signed(log: EventLog) -> EventLog:
    """The log with the hash of its contents, as a file would have."""
    digest = hashlib.sha256()
    for name in sorted(log.streams):
        s = log.streams[name]
        for array in (s.t, s.t_arrival, s.z, s.var):
            digest.update(name.encode())
            digest.update(np.ascontiguousarray(array).data)
    return replace(log, sha256=digest.hexdigest())


def _patrol() -> tuple[Floats, float]:
    """Commands (v_x, 0, w), one a second, and their duration: along the fence, through three rows, a roundabout, home.

    A leg is (speed [m/s], turn [rad], seconds); its turn is exact, for a B-spline keeps the sum of its control points.
    """
    quarter, half = np.pi / 2, np.pi
    left, right, row = (1.2, quarter, 4), (1.2, -quarter, 4), (1.8, 0.0, 26)
    legs = [
        (0.0, 0.0, 10), (1.8, 0.0, 40), left, (1.8, 0.0, 22), left, (1.8, 0.0, 12),  # along the fence
        (0.0, 0.0, 9), (1.8, 0.0, 26), left, (1.5, 0.0, 4), left,  # a look at something, on to the rows
        row, (1.0, -half, 7), row, (1.0, half, 7), row,
        (1.0, -2.0 * half, 24), (1.8, 0.0, 6), right, (1.8, 0.0, 8), right, (1.8, 0.0, 33), (0.0, 0.0, 12),
    ]  # fmt: skip
    rows: list[list[float]] = []
    for v, angle, seconds in legs:
        weave = (
            0.08 * np.sin(np.arange(seconds) * 0.9) if v and not angle else np.zeros(seconds)
        )  # nobody drives a ruler
        rows += [[v, 0.0, angle / seconds + w] for w in weave - weave.mean()]
    return np.array(rows), float(len(rows) - 3)
