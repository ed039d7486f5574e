"""From channels to filters: process noise and slow errors by what the log's own records say of their sensors."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from outrider.core.geodesy import gravity
from outrider.data import Fix, Kind, Stream
from outrider.filters.align import ABSOLUTE
from outrider.filters.channels import ABSURD, FLOAT_OVERCONFIDENCE, Channel
from outrider.filters.engine import Filter
from outrider.models.motion import LaggedFollower, Motion, OmnidirectionalBody, PlanarRobot, StrapdownIns
from outrider.models.sensors import Sensor
from outrider.models.sensors.layout import MOUNT, OWN
from outrider.typing import Floats
from outrider.workflows.draft import Draft, Plan

# The part of a receiver's error that stays for minutes: so many times what it states, by fix type [m] if it is silent.
SLOW_FACTOR: Final = 2.0
SLOW_ERROR: Final = {Fix.FIXED: 0.0, Fix.FLOAT: 0.4, Fix.DGNSS: 1.0, Fix.SBAS: 1.5, Fix.SINGLE: 2.0, Fix.UNKNOWN: 1.5}
NOTABLE: Final = 0.02  # share of its records that a fix type must have to count
RELATIVE: Final = frozenset(
    {Sensor.GYRO, Sensor.TWIST, Sensor.WHEELS_DIFFERENTIAL, Sensor.WHEELS_MECANUM, Sensor.ACKERMANN,
     Sensor.BODY_VELOCITY}
)  # fmt: skip
STANDARD_GRAVITY: Final = 9.80665  # m/s^2
FEW: Final = 11  # samples of an IMU that say nothing about its noise


def assemble(d: Draft) -> Plan:
    """The filters of a draft."""
    slow = slow_gnss_error(d)
    theta, coasting, own = VEHICLES[d.motion](d, slow)
    spread = {"velocity": 2.0, "yaw_rate": 0.5, "rate": 0.5, "acceleration": 1.0, "wind": 1e-3}
    upstream = d.cfg.preset == "robot_localization"
    chosen = [c for c in d.channels if not (upstream and c.sensor in ABSOLUTE)]
    for c in d.channels:
        if c not in chosen:
            d.roles[c.stream] = "not used: the upstream profile has no GNSS"
    chosen = [in_body_axes(c) if d.log.streams[c.stream].kind is Kind.IMU else c for c in chosen]
    whole = Filter(motion=d.motion, theta=theta, coasting=coasting, channels=tuple(chosen), history=d.cfg.history_s)
    return Plan(
        whole=whole,
        local=local_filter(whole) if d.cfg.local else None,
        datum=d.datum,
        verdicts=d.verdicts,
        roles=d.roles,
        spread={**spread, **own, "gnss_bias": max(slow, 1e-3)},
        mounted=frozenset(s.name for s in d.log if d.mounted(s)),
        findings=tuple(d.findings),
        log=d.log,
    )


Vehicle = tuple[Floats, Floats, Mapping[str, float]]  # theta, theta without input, initial standard deviations


def planar(d: Draft, slow: float) -> Vehicle:
    """A wheeled robot."""
    given = {k: v for k, v in d.cfg.planar.model_dump().items() if v is not None}
    ranged = any(c.sensor in (Sensor.RANGE, Sensor.RANGE_BEARING) for c in d.channels)
    model = PlanarRobot(gnss_bias=slow, range_bias=1.0 if ranged else 0.0, **given)
    spread = {
        "gyro_bias": model.initial_gyro_bias,
        "wheel_scale": model.initial_scale,
        "range_bias": max(model.range_bias, 1e-3),
    }
    return model.theta(), model.theta(), spread


def strapdown(d: Draft, slow: float) -> Vehicle:
    """Anything that an IMU drives."""
    usual = StrapdownIns()
    gyro, accel = sampling_noise(d.passed(next(c.stream for c in d.channels if c.sensor is None)))
    ins = replace(
        usual,
        gyro_noise=d.cfg.strapdown.gyro_noise or max(usual.gyro_noise, gyro),
        accel_noise=d.cfg.strapdown.accel_noise or max(usual.accel_noise, accel),
        gnss_bias=slow,
        gnss_bias_up=1.5 * slow,
        gravity=gravity(d.datum.lat, d.datum.alt) if d.datum else STANDARD_GRAVITY,
    )
    spread = {"gyro_bias": ins.initial_gyro_bias, "accel_bias": ins.initial_accel_bias, "baro_bias": 1000.0}
    return ins.theta(), replace(ins, gyro_noise=0.3, accel_noise=2.0).theta(), spread


def omnidirectional(d: Draft, slow: float) -> Vehicle:
    """robot_localization's fifteen states."""
    told = d.cfg.process_noise
    theta = (OmnidirectionalBody() if told is None else OmnidirectionalBody(process_noise=told)).theta()
    return theta, theta, {}


def follower(d: Draft, slow: float) -> Vehicle:
    """A point of which only positions are known."""
    theta = LaggedFollower(acceleration=2.0).theta()
    return theta, theta, {}


VEHICLES: Final = {
    Motion.PLANAR: planar,
    Motion.STRAPDOWN: strapdown,
    Motion.OMNIDIRECTIONAL: omnidirectional,
    Motion.FOLLOWER: follower,
}


def sampling_noise(s: Stream) -> tuple[float, float]:
    """White densities [rad/s, m/s^2 per sqrt(Hz)] of a sampled IMU: what one sample says little about the next.

    Half the variance of successive differences holds noise, aliased vibration and motion between samples alike; over
    one period it acts as a density of that deviation times sqrt(dt). A fast unit gets less than our default from it, a
    log that keeps only every tenth sample far more.
    """
    if len(s) < FEW:
        return 0.0, 0.0
    dt = np.diff(s.t) * 1e-9
    usual = (dt > 0) & (dt < 3 * np.median(dt)) & np.isfinite(s.z[1:]).all(axis=1) & np.isfinite(s.z[:-1]).all(axis=1)
    if usual.sum() < FEW - 1:
        return 0.0, 0.0
    jump = np.diff(s.z, axis=0)[usual]
    density = np.sqrt(0.5 * np.mean(jump**2, axis=0) * np.median(dt[usual]))
    return float(density[:3].max()), float(density[3:].max())


def slow_gnss_error(d: Draft) -> float:
    """Standard deviation [m] of the slowly varying error, by the worst fix type that is more than a few records."""
    worst = 0.0
    for c in d.channels:
        if c.sensor is not Sensor.GNSS_POSITION or c.scored:
            continue
        s = d.passed(c.stream)
        fix = s.extra.get("fix", np.full(len(s), float(Fix.UNKNOWN.value)))
        claims = claimed_sigma(s)
        for kind, silent in SLOW_ERROR.items():
            here = fix == kind.value
            if here.mean() > NOTABLE and kind is not Fix.FIXED:
                stated = claims[here & np.isfinite(claims)]
                factor = SLOW_FACTOR * (FLOAT_OVERCONFIDENCE if kind is Fix.FLOAT else 1.0)
                worst = max(worst, factor * float(np.median(stated)) if stated.size else silent)
    return worst


def claimed_sigma(s: Stream) -> Floats:
    """(n,) horizontal standard deviation [m] by the receiver itself, NaN where it states none."""
    var = np.where((s.var[:, :2] > 0.0) & (s.var[:, :2] < ABSURD), s.var[:, :2], np.nan).mean(axis=1)
    stated = np.where(s.extra["hacc"] > 0.0, s.extra["hacc"], np.nan) if "hacc" in s.extra else np.nan
    return np.where(np.isfinite(var), np.sqrt(var), stated)


def in_body_axes(c: Channel) -> Channel:
    """A channel of an IMU: its records arrive turned into body axes, so the kernel must not turn them again."""
    return replace(c, mount=c.theta[MOUNT:OWN].copy(), theta=straightened(c.theta))


def straightened(theta: Floats) -> Floats:
    """The same lever arm, no rotation."""
    out = theta.copy()
    out[MOUNT:OWN] = np.eye(3).ravel()
    return out


def local_filter(whole: Filter) -> Filter | None:
    """The same vehicle without anything absolute: wheels and IMU only (REP-105's odom frame)."""
    if whole.motion is not Motion.PLANAR:
        return None
    channels = tuple(c for c in whole.channels if c.sensor in RELATIVE and not c.scored)
    return replace(whole, channels=channels) if channels else None


__all__ = ["assemble"]
