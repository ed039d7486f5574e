"""Inertial sensors. White noise is a density [unit/sqrt(Hz)]; biases belong to the truth: filters estimate them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import inf
from typing import final

import numpy as np
from numpy.random import Generator

from outrider.core.rotations import quats_exp, quats_multiply, quats_to_matrices
from outrider.data import Kind, Stream
from outrider.sim.noise import gauss_markov, white
from outrider.sim.sensors.base import STRAIGHT, Device, Quaternion, Setting, Vector, record, sampled
from outrider.sim.truth import Truth
from outrider.typing import Floats

GM_PEAK = 0.618  # of the Allan deviation of a Gauss-Markov process, per unit of its standard deviation
FLICKER_FLOOR = 0.664  # of the Allan deviation of flicker noise, per unit of bias instability


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Imu:
    """Body rate and specific force of an IMU at `lever` [m, body], turned by `mount` (q_body_sensor).

    z = M (w or f + bias) + instability + white noise + vibration, then cut off at the range of the sensor; M holds
    scale and misalignment errors, drawn once. The instability is a Gauss-Markov process whose Allan deviation peaks at
    the floor of flicker noise of the given bias instability. By default an IMU has white noise and no more.
    """

    name: str = "imu"
    rate_hz: float = 100.0
    gyro_density: float = 2e-4  # rad/s/sqrt(Hz)
    accel_density: float = 2e-3  # m/s^2/sqrt(Hz)
    mount: Quaternion = STRAIGHT
    lever: Vector = (0.0, 0.0, 0.0)
    gyro_instability: float = 0.0  # rad/s
    accel_instability: float = 0.0  # m/s^2
    instability_tau_s: float = 100.0
    gyro_scale: float = 0.0  # one sigma
    accel_scale: float = 0.0
    misalignment: float = 0.0  # rad, one sigma
    gyro_range: float = inf  # rad/s
    accel_range: float = inf  # m/s^2
    vibration: float = 0.0  # m/s^2, amplitude on each axis
    vibration_hz: float = 87.0

    def device(self, setting: Setting, rng: Generator) -> Device:
        matrices, instability = self._slow(setting, rng.spawn(1)[0])
        sigma = np.repeat([self.gyro_density, self.accel_density], 3) * np.sqrt(self.rate_hz)
        variance = sigma**2
        limit = np.repeat([self.gyro_range, self.accel_range], 3)
        limited = bool(np.isfinite(limit).any())
        R = None if self.mount == STRAIGHT else quats_to_matrices(np.array(self.mount))  # R_body_sensor

        def sense(own: Truth, others: Mapping[str, Truth]) -> Stream:
            here = sampled(self._felt(own), self.rate_hz)
            z = np.empty((len(here), 6))
            np.add(here.w, here.bias.gyro, out=z[:, :3])
            np.add(here.f, here.bias.accel, out=z[:, 3:])
            if R is not None:
                z[:, :3], z[:, 3:] = z[:, :3] @ R, z[:, 3:] @ R
            if matrices is not None:
                z = z @ matrices.T
            if instability is not None:
                z += instability[np.rint(setting.seconds(here.t) * self.rate_hz).astype(np.int64)]
            z += white(rng, len(here), 6, sigma)
            if self.vibration:
                phase = 2 * np.pi * self.vibration_hz * setting.seconds(here.t)
                z[:, 3:] += self.vibration * np.sin(phase[:, None] + np.array([0.0, 2.1, 4.2]))
            if limited:
                np.clip(z, -limit, limit, out=z)
            return record(self, Kind.IMU, here, z, variance, frame=self.name)

        return sense

    def _felt(self, own: Truth) -> Truth:
        """The truth with the specific force at the sensor: f + w' x l + w x (w x l)."""
        if not any(self.lever):
            return own
        spin = np.zeros_like(own.w)
        spin[1:] = np.diff(own.w, axis=0) / own.dt
        lever = np.array(self.lever)
        return replace(own, f=own.f + np.cross(spin, lever) + np.cross(own.w, np.cross(own.w, lever)))

    def _slow(self, setting: Setting, rng: Generator) -> tuple[Floats | None, Floats | None]:
        """(6, 6) scale and misalignment, (n, 6) instability at every record of the run; None where there is none."""
        draws = rng.standard_normal((6, 3))
        matrices = None
        if self.gyro_scale or self.accel_scale or self.misalignment:
            matrices = np.eye(6)
            for k, scale in ((0, self.gyro_scale), (3, self.accel_scale)):
                off = self.misalignment * (1.0 - np.eye(3))
                matrices[k : k + 3, k : k + 3] += draws[k : k + 3] * (np.eye(3) * scale + off)
        if not (self.gyro_instability or self.accel_instability):
            return matrices, None
        n = int(setting.duration_s * self.rate_hz) + 2
        sigma = np.repeat([self.gyro_instability, self.accel_instability], 3) * FLICKER_FLOOR / GM_PEAK
        return matrices, gauss_markov(rng, n, 6, 1.0 / self.rate_hz, tuple(sigma.tolist()), self.instability_tau_s)


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
        here = sampled(truth, self.rate_hz)
        turned = quats_multiply(quats_exp(np.array([0.0, 0.0, self.yaw_error])), here.q)
        noise = quats_exp(white(rng, len(here), 3, self.sigma))
        z = quats_multiply(quats_multiply(turned, noise), np.array(self.mount))
        return record(self, Kind.ATTITUDE, here, z, np.square(self.sigma), frame=self.frame)
