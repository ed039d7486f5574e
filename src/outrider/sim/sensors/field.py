"""Sensors of height and heading: barometer, magnetometer, two antennas."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.random import Generator

from outrider.core.angles import wrap_all
from outrider.core.rotations import quats_conjugate, quats_multiply, quats_to_rpy
from outrider.data import Altitude, Kind, Stream
from outrider.sim.noise import white
from outrider.sim.sensors.base import STRAIGHT, Quaternion, Vector, record, sampled
from outrider.sim.truth import Truth, rotate


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Baro:
    """Pressure altitude: height above the datum plus `reference` [m] and the truth's walking offset."""

    name: str = "baro"
    rate_hz: float = 10.0
    sigma: float = 0.15  # m
    reference: float = 0.0

    def sample(self, truth: Truth, rng: Generator) -> Stream:
        here = sampled(truth, self.rate_hz)
        z = (here.p[:, 2] + here.bias.baro + self.reference)[:, None] + white(rng, len(here), 1, self.sigma)
        return record(self, Kind.BARO, here, z, np.array([self.sigma**2]), altitude=Altitude.PRESSURE)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Magnetometer:
    """The field in the sensor's frame: R_sensor_world field + hard iron. `field` in the world (ENU), any unit."""

    name: str = "mag"
    field: Vector
    rate_hz: float = 20.0
    sigma: float = 0.01  # in the unit of the field
    hard_iron: Vector = (0.0, 0.0, 0.0)  # sensor
    mount: Quaternion = STRAIGHT
    frame: str = "imu"

    def sample(self, truth: Truth, rng: Generator) -> Stream:
        here = sampled(truth, self.rate_hz)
        q = quats_conjugate(quats_multiply(here.q, np.array(self.mount)))
        z = rotate(q, np.array(self.field)) + np.array(self.hard_iron) + white(rng, len(here), 3, self.sigma)
        return record(self, Kind.MAG, here, z, np.full(3, self.sigma**2), frame=self.frame)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Heading:
    """True heading, as two antennas give it."""

    name: str = "heading"
    rate_hz: float = 5.0
    sigma: float = 0.01  # rad
    offset: float = 0.0

    def sample(self, truth: Truth, rng: Generator) -> Stream:
        here = sampled(truth, self.rate_hz)
        yaw = quats_to_rpy(here.q)[:, 2:] + self.offset + white(rng, len(here), 1, self.sigma)
        return record(self, Kind.HEADING, here, wrap_all(yaw), np.array([self.sigma**2]))
