"""Wheel odometry as a base reckons it, and the encoders below it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.random import Generator

from outrider.core.rotations import quats_conjugate
from outrider.data import Kind, Stream
from outrider.errors import ConfigError
from outrider.sim.noise import white
from outrider.sim.sensors.base import Device, Setting, record, sampled, stamps
from outrider.sim.truth import Truth, rotate


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class BodyTwist:
    """Wheel odometry: measured = true / (1 + scale error) + noise. A rolling base (`rolling`) only knows v_x and w_z
    and reports zero, without a variance, for the rest."""

    name: str = "wheels"
    rate_hz: float = 20.0
    sigma_v: float = 0.03  # m/s
    sigma_w: float = 0.02  # rad/s
    rolling: bool = True
    frame: str = "base_link"

    def sample(self, truth: Truth, rng: Generator) -> Stream:
        here = sampled(truth, self.rate_hz)
        n, known = len(here), np.array([0, 5] if self.rolling else range(6))
        body = rotate(quats_conjugate(here.q), here.v) / (1.0 + here.bias.wheels[:, None])
        sigma = np.repeat([self.sigma_v, self.sigma_w], 3)
        measured = np.empty((n, 6))
        measured[:, :3], measured[:, 3:] = body, here.w
        measured += white(rng, n, 6, sigma)
        z, variance = measured, np.full(6, np.nan)
        if self.rolling:
            z = np.zeros((n, 6))
            z[:, known] = measured[:, known]
        variance[known] = sigma[known] ** 2
        return record(self, Kind.TWIST, here, z, variance, frame=self.frame)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class WheelEncoders:
    """Rim speed of each of the first `wheels` actuators, from ticks counted between two records.

    tick : rim distance [m] of one tick, 0 for none;  scale : relative error of the wheel radius, one sigma, drawn once
    per wheel;  gear : motor turns per wheel turn, for the motor speed in r/min that goes beside (`extra`).
    """

    name: str = "encoders"
    wheels: int = 4
    rate_hz: float = 50.0
    tick: float = 2e-4
    scale: float = 0.0
    sigma: float = 0.0  # m/s
    radius: float = 0.1  # m
    gear: float = 1.0
    frame: str = "base_link"

    def device(self, setting: Setting, rng: Generator) -> Device:
        factor = 1.0 + self.scale * rng.spawn(1)[0].standard_normal(self.wheels)
        travelled, counted = np.zeros(self.wheels), np.zeros(self.wheels)
        rest = (self.tick * self.rate_hz) ** 2 / 6.0 if self.tick else 0.0  # difference of two rounded counts

        def sense(own: Truth, others: Mapping[str, Truth]) -> Stream:
            nonlocal travelled, counted
            t = stamps(own, self.rate_hz)
            if own.actuators.shape[1] < self.wheels:
                what, fix = f"has {own.actuators.shape[1]} actuators", f"`wheels`: so many, not {self.wheels}"
                raise ConfigError(what, where=f"robot {own.robot}: {self.name}", fix=fix)
            rim = own.actuators[:, : self.wheels] * factor
            steps = 0.5 * (rim[1:] + rim[:-1]) * own.dt
            way = travelled + np.vstack([np.zeros(self.wheels), np.cumsum(steps, axis=0)])
            travelled = way[-1]
            at = np.column_stack([np.interp(t - own.t[0], own.t - own.t[0], column) for column in way.T])
            counts = np.floor(at / self.tick) * self.tick if self.tick else at
            moved = np.diff(np.vstack([counted, counts]), axis=0)
            counted = counts[-1] if t.size else counted
            z = moved * self.rate_hz + white(rng, t.size, self.wheels, self.sigma)
            rpm = z / self.radius * self.gear * 30.0 / np.pi
            extra = {f"motor_{i}_rpm": rpm[:, i] for i in range(self.wheels)}
            variance = np.full(self.wheels, max(self.sigma**2 + rest, 1e-12))
            return record(self, Kind.WHEELS, own.at(t), z, variance, frame=self.frame, extra=extra)

        return sense


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class SteeringEncoder:
    """Speed of the rear axle and angle of the front wheels: columns `speed` and `angle` of the actuators."""

    name: str = "steering"
    rate_hz: float = 50.0
    speed: int = 0
    angle: int = -1
    sigma_speed: float = 0.02  # m/s
    sigma_angle: float = 0.003  # rad
    offset: float = 0.0  # rad, of the angle's zero
    frame: str = "base_link"

    def sample(self, truth: Truth, rng: Generator) -> Stream:
        here = sampled(truth, self.rate_hz)
        columns = here.actuators.shape[1]
        if not all(-columns <= k < columns for k in (self.speed, self.angle)):
            what = f"has {columns} actuators, none of number {self.speed} or {self.angle}"
            raise ConfigError(what, where=f"robot {truth.robot}: {self.name}", fix="a steered vehicle has them")
        sigma = np.array([self.sigma_speed, self.sigma_angle])
        z = (
            here.actuators[:, [self.speed, self.angle]]
            + np.array([0.0, self.offset])
            + white(rng, len(here), 2, 1.0) * sigma
        )
        return record(self, Kind.ACKERMANN, here, z, sigma**2, frame=self.frame)
