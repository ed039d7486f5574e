"""Velocity felt by the body: cameras, Doppler logs, pitot tubes, and the constraints of wheels and of standstill."""

from dataclasses import dataclass
from typing import ClassVar, final

from outrider._kernel import kernel
from outrider.models.kinematics import K_V, K_WIND, T_TH, T_V, T_WIND
from outrider.models.sensors.geometry import clear, cross, dot, in_body, in_world, put, sensor_axis, velocity_row
from outrider.models.sensors.layout import OWN, STRAIGHT, Mount, Sensor, deviations
from outrider.typing import Floats


@kernel
def body_velocity(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """z[0:3] = R_bs' (R' v + w x l) [m/s]."""
    clear(D, 3)
    for i in range(3):
        y[i] = z[i] - velocity_row(k, theta, sensor_axis(theta, i), 1.0, D, i)
    return 3


@kernel
def nonholonomic(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """0 = (R' v + w x l) along the mount's left and up: wheels neither slide nor jump at l (the fixed axle).

    z is not read.
    """
    clear(D, 2)
    for i in range(2):
        y[i] = -velocity_row(k, theta, sensor_axis(theta, 1 + i), 1.0, D, i)
    return 2


@kernel
def zero_velocity(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """0 = v [m/s]: the robot stands still. z is not read."""
    clear(D, 3)
    for i in range(3):
        y[i] = -k[K_V + i]
        D[i, T_V + i] = 1.0
    return 3


@kernel
def airspeed(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """z[0] = forward part of R_bs' (R' (v - wind) + w x l) [m/s];  theta[12] the lowest speed that it can read."""
    clear(D, 1)
    b = sensor_axis(theta, 0)
    wind = in_body(k, (k[K_WIND], k[K_WIND + 1], 0.0))
    h = velocity_row(k, theta, b, 1.0, D, 0) - dot(b, wind)
    if not h > theta[OWN]:
        return 0
    y[0] = z[0] - h
    put(D, 0, T_TH, -1.0, cross(b, wind))
    forward = in_world(k, b)
    D[0, T_WIND], D[0, T_WIND + 1] = -forward[0], -forward[1]
    return 1


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class BodyVelocity:
    """Velocity in the sensor's axes: stereo camera, Doppler log, radar."""

    code: ClassVar[Sensor] = Sensor.BODY_VELOCITY
    mount: Mount = STRAIGHT
    sigma: float = 0.1  # m/s

    def theta(self) -> Floats:
        return self.mount.theta()

    def sigmas(self) -> Floats:
        return deviations(self, self.sigma, self.sigma, self.sigma)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Nonholonomic:
    """A wheeled robot moves neither sideways nor up at its fixed axle (the lever arm)."""

    code: ClassVar[Sensor] = Sensor.NONHOLONOMIC
    mount: Mount = STRAIGHT
    sigma_lateral: float = 0.1  # m/s
    sigma_vertical: float = 0.1  # m/s

    def theta(self) -> Floats:
        return self.mount.theta()

    def sigmas(self) -> Floats:
        return deviations(self, self.sigma_lateral, self.sigma_vertical)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class ZeroVelocity:
    """The robot is known to stand still."""

    code: ClassVar[Sensor] = Sensor.ZERO_VELOCITY
    sigma: float = 0.02  # m/s

    def theta(self) -> Floats:
        return STRAIGHT.theta()

    def sigmas(self) -> Floats:
        return deviations(self, self.sigma, self.sigma, self.sigma)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Airspeed:
    """Pitot tube. Silent below `lowest`, judged by the predicted airspeed."""

    code: ClassVar[Sensor] = Sensor.AIRSPEED
    mount: Mount = STRAIGHT
    lowest: float = 3.0  # m/s
    sigma: float = 1.0  # m/s

    def theta(self) -> Floats:
        return self.mount.theta(self.lowest)

    def sigmas(self) -> Floats:
        return deviations(self, self.sigma)
