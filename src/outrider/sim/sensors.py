"""Sensors as frozen parameters and one function: truth in, `Stream` out. Noise only; see `outrider.sim.faults`.

White noise of rate sensors is given as a density [unit/sqrt(Hz)], of others as a standard deviation per record. Slow
errors (biases, scale, offsets) are part of the truth, see `outrider.sim.truth.drift`, because filters estimate them.
"""

from dataclasses import dataclass
from typing import Protocol, final

import numpy as np
from numpy.random import Generator

from outrider.core.angles import wrap_all
from outrider.core.geodesy import enu_to_geodetic
from outrider.core.rotations import quats_conjugate, quats_exp, quats_multiply, quats_to_rpy
from outrider.data import Altitude, Fix, Kind, Stream, stream
from outrider.sim.noise import white
from outrider.sim.truth import Truth, rotate
from outrider.typing import Floats, Ints

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
STRAIGHT: Quaternion = (0.0, 0.0, 0.0, 1.0)


class Sensor(Protocol):
    """Anything that can turn truth into one stream."""

    @property
    def name(self) -> str:
        """Of its stream; also the key of its random numbers."""
        ...

    def sample(self, truth: Truth, rng: Generator) -> Stream:
        """What the sensor records along the truth."""
        ...


def stamps(truth: Truth, rate_hz: float, phase_s: float = 0.0) -> Ints:
    """Evenly spaced stamps [ns] within the truth."""
    span = float(truth.t[-1] - truth.t[0]) * 1e-9 - phase_s
    k = np.arange(int(span * rate_hz + 1e-9) + 1)
    t = truth.t[0] + np.rint((phase_s + k / rate_hz) * 1e9).astype(np.int64)
    return t[t <= truth.t[-1]]


def _record(sensor: Sensor, kind: Kind, truth: Truth, z: Floats, variance: Floats, **more: object) -> Stream:
    """A stream with one variance for all rows; `latency_s` says how much later it arrives."""
    late = round(float(more.pop("latency_s", 0.0)) * 1e9)  # type: ignore[arg-type]
    var = np.tile(variance, (truth.t.size, 1))
    return stream(sensor.name, kind, truth.t, z, var=var, t_arrival=truth.t + late, robot=truth.robot, **more)


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
        return _record(self, Kind.IMU, here, z, sigma**2, frame=self.name)


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
        return _record(self, Kind.ATTITUDE, here, z, np.square(self.sigma), frame=self.frame)


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
        return _record(self, Kind.TWIST, here, z, variance, frame=self.frame)


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
        here = truth.at(stamps(truth, self.rate_hz, self.phase_s))
        n, sigma = len(here), np.array([self.sigma, self.sigma, self.sigma_up])
        p = here.p + rotate(here.q, np.array(self.lever)) + here.bias.gnss + white(rng, n, 3, 1.0) * sigma
        site = truth.datum
        z = np.column_stack(enu_to_geodetic(p, site.lat, site.lon, site.alt))
        extra = {"fix": self.fix.value, "satellites": self.satellites, "hdop": 0.8}
        extra |= {"hacc": self.sigma, "vacc": self.sigma_up}
        columns = {name: np.full(n, float(value)) for name, value in extra.items()}
        options = {"frame": self.name, "latency_s": self.latency_s, "altitude": Altitude.ELLIPSOID, "extra": columns}
        return _record(self, Kind.GNSS, here, z, sigma**2, **options)


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
        here = truth.at(stamps(truth, self.rate_hz, self.phase_s))
        sigma = np.array([self.sigma, self.sigma, self.sigma_up])
        z = here.v + rotate(here.q, np.cross(here.w, np.array(self.lever))) + white(rng, len(here), 3, 1.0) * sigma
        return _record(self, Kind.GNSS_VELOCITY, here, z, sigma**2, frame=self.frame, latency_s=self.latency_s)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Baro:
    """Pressure altitude: height above the datum plus `reference` [m] and the truth's walking offset."""

    name: str = "baro"
    rate_hz: float = 10.0
    sigma: float = 0.15  # m
    reference: float = 0.0

    def sample(self, truth: Truth, rng: Generator) -> Stream:
        here = truth.at(stamps(truth, self.rate_hz))
        z = (here.p[:, 2] + here.bias.baro + self.reference)[:, None] + white(rng, len(here), 1, self.sigma)
        return _record(self, Kind.BARO, here, z, np.array([self.sigma**2]), altitude=Altitude.PRESSURE)


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
        here = truth.at(stamps(truth, self.rate_hz))
        q = quats_conjugate(quats_multiply(here.q, np.array(self.mount)))
        z = rotate(q, np.array(self.field)) + np.array(self.hard_iron) + white(rng, len(here), 3, self.sigma)
        return _record(self, Kind.MAG, here, z, np.full(3, self.sigma**2), frame=self.frame)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Heading:
    """True heading, as two antennas give it."""

    name: str = "heading"
    rate_hz: float = 5.0
    sigma: float = 0.01  # rad
    offset: float = 0.0

    def sample(self, truth: Truth, rng: Generator) -> Stream:
        here = truth.at(stamps(truth, self.rate_hz))
        yaw = quats_to_rpy(here.q)[:, 2:] + self.offset + white(rng, len(here), 1, self.sigma)
        return _record(self, Kind.HEADING, here, wrap_all(yaw), np.array([self.sigma**2]))
