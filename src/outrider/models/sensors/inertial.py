"""Gyroscope and accelerometer as measurements, and what they say of a robot that stands still.

A record of an IMU comes in its two halves: z[0:3] are the three columns of the gyroscope or of the accelerometer.
"""

from dataclasses import dataclass
from typing import ClassVar, final

from outrider._kernel import kernel
from outrider.models.kinematics import K_BA, K_BG, K_F, K_W, T_BA, T_BG, T_F, T_W
from outrider.models.sensors.geometry import clear, dot, mix, put, sensor_axis, triple
from outrider.models.sensors.layout import LEVER, STRAIGHT, Mount, Sensor, deviations
from outrider.typing import Floats


@kernel
def gyro(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """z[0:3] = R_bs' (w + b_g) [rad/s]."""
    clear(D, 3)
    w = mix(1.0, triple(k, K_W), 1.0, triple(k, K_BG))
    for i in range(3):
        b = sensor_axis(theta, i)
        y[i] = z[i] - dot(b, w)
        put(D, i, T_W, 1.0, b)
        put(D, i, T_BG, 1.0, b)
    return 3


@kernel
def zero_rate(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """z[0:3] = R_bs' b_g: all that a gyro feels at rest is its bias [rad/s]."""
    clear(D, 3)
    for i in range(3):
        b = sensor_axis(theta, i)
        y[i] = z[i] - dot(b, triple(k, K_BG))
        put(D, i, T_BG, 1.0, b)
    return 3


@kernel
def specific_force(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """z[0:3] = R_bs' (f + w x (w x l) + b_a) [m/s^2]; the lever arm's dw/dt x l is left out: k holds no dw/dt."""
    clear(D, 3)
    f = mix(1.0, triple(k, K_F), 1.0, triple(k, K_BA))
    w, l = triple(k, K_W), triple(theta, LEVER)
    for i in range(3):
        b = sensor_axis(theta, i)
        # w x (w x l) = w (w'l) - l (w'w)
        y[i] = z[i] - dot(b, f) - dot(b, w) * dot(w, l) + dot(b, l) * dot(w, w)
        put(D, i, T_W, dot(w, l), b)
        put(D, i, T_W, 1.0, mix(dot(b, w), l, -2.0 * dot(b, l), w))
        put(D, i, T_F, 1.0, b)
        put(D, i, T_BA, 1.0, b)
    return 3


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Gyro:
    """Rate gyroscope, as a measurement of the model's rate."""

    code: ClassVar[Sensor] = Sensor.GYRO
    mount: Mount = STRAIGHT
    sigma: float = 0.01  # rad/s

    def theta(self) -> Floats:
        return self.mount.theta()

    def sigmas(self) -> Floats:
        return deviations(self, self.sigma, self.sigma, self.sigma)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class ZeroRate:
    """The robot is known to stand still: the gyro shows its bias."""

    code: ClassVar[Sensor] = Sensor.ZERO_RATE
    mount: Mount = STRAIGHT
    sigma: float = 0.003  # rad/s

    def theta(self) -> Floats:
        return self.mount.theta()

    def sigmas(self) -> Floats:
        return deviations(self, self.sigma, self.sigma, self.sigma)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class SpecificForce:
    """Accelerometer, as a measurement of the model's specific force; vibration is part of the sigma."""

    code: ClassVar[Sensor] = Sensor.SPECIFIC_FORCE
    mount: Mount = STRAIGHT
    sigma: float = 0.5  # m/s^2

    def theta(self) -> Floats:
        return self.mount.theta()

    def sigmas(self) -> Floats:
        return deviations(self, self.sigma, self.sigma, self.sigma)
