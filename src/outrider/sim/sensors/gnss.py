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
from outrider.typing import Floats


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
        n, sigma, site = len(here), np.array([self.sigma, self.sigma, self.sigma_up]), truth.datum
        p = here.p + rotate(here.q, np.array(self.lever)) + here.bias.gnss + white(rng, n, 3, 1.0) * sigma
        z = np.empty((n, 3))
        z[:, 0], z[:, 1], z[:, 2] = enu_to_geodetic(p, site.lat, site.lon, site.alt)
        extra = {"fix": self.fix.value, "satellites": self.satellites, "hdop": 0.8}
        extra |= {"hacc": self.sigma, "vacc": self.sigma_up}
        each = np.repeat(np.array(list(extra.values()), np.float64)[:, None], n, axis=1)
        columns = dict(zip(extra, each, strict=True))
        options = {"frame": self.name, "altitude": Altitude.ELLIPSOID, "extra": columns}
        return record(self, Kind.GNSS, here, z, sigma**2, latency_s=self.latency_s, **options)


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
        z = here.v + rotate(here.q, _swung(here.w, self.lever)) + white(rng, len(here), 3, 1.0) * sigma
        return record(self, Kind.GNSS_VELOCITY, here, z, sigma**2, frame=self.frame, latency_s=self.latency_s)


def _swung(w: Floats, lever: Vector) -> Floats:
    """w x lever of rows w (n, 3)."""
    x, y, z = w.T
    out = np.empty(w.shape)
    out[:, 0] = y * lever[2] - z * lever[1]
    out[:, 1] = z * lever[0] - x * lever[2]
    out[:, 2] = x * lever[1] - y * lever[0]
    return out
