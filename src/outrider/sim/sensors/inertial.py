"""Inertial sensors. White noise is a density [unit/sqrt(Hz)]; biases belong to the truth: filters estimate them."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.random import Generator

from outrider.core.rotations import quats_conjugate, quats_exp, quats_multiply
from outrider.data import Kind, Stream
from outrider.sim.noise import white
from outrider.sim.sensors.base import STRAIGHT, Quaternion, Vector, record, stamps
from outrider.sim.truth import Truth, rotate


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Imu:
    """Body rate and specific force of an IMU turned by `mount` (q_body_sensor) and placed at the body origin."""

    name: str = "imu"
    rate_hz: float = 100.0
    gyro_density: float = 2e-4  # rad/s/sqrt(Hz)
    accel_density: float = 2e-3  # m/s^2/sqrt(Hz)
    mount: Quaternion = STRAIGHT

    def sample(self, truth: Truth, rng: Generator) -> Stream:
        here = truth.at(stamps(truth, self.rate_hz))
        n, q = len(here), quats_conjugate(np.tile(self.mount, (len(here), 1)))
        sigma = np.repeat([self.gyro_density, self.accel_density], 3) * np.sqrt(self.rate_hz)
        z = np.hstack([rotate(q, here.w + here.bias.gyro), rotate(q, here.f + here.bias.accel)])
        z += white(rng, n, 6, 1.0) * sigma
        return record(self, Kind.IMU, here, z, sigma**2, frame=self.name)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Attitude:
    """Attitude as the IMU's own filter claims it. `yaw_error` [rad] turns it about the vertical, as iron does."""

    name: str = "imu_attitude"
    rate_hz: float = 20.0
    sigma: Vector = (0.005, 0.005, 0.02)  # rad, about the body axes
    yaw_error: float = 0.0
    mount: Quaternion = STRAIGHT
    frame: str = "imu"

    def sample(self, truth: Truth, rng: Generator) -> Stream:
        here = truth.at(stamps(truth, self.rate_hz))
        turned = quats_multiply(quats_exp(np.array([0.0, 0.0, self.yaw_error])), here.q)
        noise = quats_exp(white(rng, len(here), 3, self.sigma))
        z = quats_multiply(quats_multiply(turned, noise), np.array(self.mount))
        return record(self, Kind.ATTITUDE, here, z, np.square(self.sigma), frame=self.frame)
