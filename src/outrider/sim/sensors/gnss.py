"""GNSS receivers."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.random import Generator

from outrider.core.geodesy import enu_to_geodetic
from outrider.data import Altitude, Fix, Kind, Stream
from outrider.sim.noise import white
from outrider.sim.sensors.base import Vector, record, sampled
from outrider.sim.truth import Truth, rotate


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Gnss:
    """Position of an antenna at `lever` [m, body] in latitude, longitude and ellipsoidal height, stamped when taken and
    delivered `latency_s` later. Adds the truth's slow GNSS error."""

    name: str = "gnss"
    rate_hz: float = 5.0
    sigma: float = 0.015  # m, east and north
    sigma_up: float = 0.03  # m
    lever: Vector = (0.0, 0.0, 0.0)
    fix: Fix = Fix.FIXED
    satellites: int = 18
    latency_s: float = 0.0
    phase_s: float = 0.0

    def sample(self, truth: Truth, rng: Generator) -> Stream:
        here = sampled(truth, self.rate_hz, self.phase_s)
        n, sigma = len(here), np.array([self.sigma, self.sigma, self.sigma_up])
        p = here.p + rotate(here.q, np.array(self.lever)) + here.bias.gnss + white(rng, n, 3, 1.0) * sigma
        site = truth.datum
        z = np.column_stack(enu_to_geodetic(p, site.lat, site.lon, site.alt))
        extra = {"fix": self.fix.value, "satellites": self.satellites, "hdop": 0.8}
        extra |= {"hacc": self.sigma, "vacc": self.sigma_up}
        columns = {name: np.full(n, float(value)) for name, value in extra.items()}
        options = {"frame": self.name, "latency_s": self.latency_s, "altitude": Altitude.ELLIPSOID, "extra": columns}
        return record(self, Kind.GNSS, here, z, sigma**2, **options)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class GnssVelocity:
    """Velocity of the antenna in the world, from Doppler."""

    name: str = "gnss_velocity"
    rate_hz: float = 5.0
    sigma: float = 0.05  # m/s, east and north
    sigma_up: float = 0.1
    lever: Vector = (0.0, 0.0, 0.0)
    latency_s: float = 0.0
    phase_s: float = 0.0
    frame: str = "gnss"

    def sample(self, truth: Truth, rng: Generator) -> Stream:
        here = sampled(truth, self.rate_hz, self.phase_s)
        sigma = np.array([self.sigma, self.sigma, self.sigma_up])
        z = here.v + rotate(here.q, np.cross(here.w, np.array(self.lever))) + white(rng, len(here), 3, 1.0) * sigma
        return record(self, Kind.GNSS_VELOCITY, here, z, sigma**2, frame=self.frame, latency_s=self.latency_s)
