"""Wheel odometry as a base reckons it."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.random import Generator

from outrider.core.rotations import quats_conjugate
from outrider.data import Kind, Stream
from outrider.sim.noise import white
from outrider.sim.sensors.base import record, stamps
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
        here = truth.at(stamps(truth, self.rate_hz))
        n, known = len(here), np.array([0, 5] if self.rolling else range(6))
        body = rotate(quats_conjugate(here.q), here.v) / (1.0 + here.bias.wheels[:, None])
        sigma = np.repeat([self.sigma_v, self.sigma_w], 3)
        measured = np.hstack([body, here.w]) + white(rng, n, 6, 1.0) * sigma
        z, variance = np.zeros((n, 6)), np.full(6, np.nan)
        z[:, known], variance[known] = measured[:, known], sigma[known] ** 2
        return record(self, Kind.TWIST, here, z, variance, frame=self.frame)
