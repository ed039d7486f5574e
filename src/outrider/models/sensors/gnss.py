"""Satellite receivers and other sources of position: an antenna at a lever arm."""

from dataclasses import dataclass
from typing import ClassVar, final

from outrider._kernel import kernel
from outrider.models.kinematics import K_BN, K_R, K_V, K_W, T_BN, T_TH, T_V, T_W
from outrider.models.sensors.geometry import clear, cross, dot, point, point_row, put, triple
from outrider.models.sensors.layout import LEVER, STRAIGHT, Mount, Sensor, deviations
from outrider.typing import Floats


@kernel
def gnss_position(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """z[0:3] = p + R l + b_n: antenna in the site frame [m], with the slowly varying error b_n."""
    clear(D, 3)
    for i in range(3):
        y[i] = z[i] - point(k, theta, i) - k[K_BN + i]
        point_row(k, theta, i, D, i)
        D[i, T_BN + i] = 1.0
    return 3


@kernel
def position(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """z[0:3] = p + R l: any other source of a position in the site frame [m]."""
    clear(D, 3)
    for i in range(3):
        y[i] = z[i] - point(k, theta, i)
        point_row(k, theta, i, D, i)
    return 3


@kernel
def gnss_velocity(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """z[0:3] = v + R (w x l): velocity of the antenna, east-north-up [m/s]."""
    clear(D, 3)
    l = triple(theta, LEVER)
    c = cross(triple(k, K_W), l)
    for i in range(3):
        r = triple(k, K_R + 3 * i)
        y[i] = z[i] - k[K_V + i] - dot(r, c)
        put(D, i, T_TH, 1.0, cross(c, r))
        put(D, i, T_W, 1.0, cross(l, r))
        D[i, T_V + i] = 1.0
    return 3


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class GnssPosition:
    """GNSS fix of an antenna; the sigmas hold for a plain fix of unknown quality."""

    code: ClassVar[Sensor] = Sensor.GNSS_POSITION
    mount: Mount = STRAIGHT
    sigma_horizontal: float = 2.0  # m
    sigma_vertical: float = 4.0  # m

    def theta(self) -> Floats:
        return self.mount.theta()

    def sigmas(self) -> Floats:
        return deviations(self, self.sigma_horizontal, self.sigma_horizontal, self.sigma_vertical)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class GnssVelocity:
    """GNSS velocity (Doppler) of an antenna."""

    code: ClassVar[Sensor] = Sensor.GNSS_VELOCITY
    mount: Mount = STRAIGHT
    sigma_horizontal: float = 0.15  # m/s
    sigma_vertical: float = 0.3  # m/s

    def theta(self) -> Floats:
        return self.mount.theta()

    def sigmas(self) -> Floats:
        return deviations(self, self.sigma_horizontal, self.sigma_horizontal, self.sigma_vertical)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Position:
    """Position in the site frame: total station, motion capture, a fix by beacons."""

    code: ClassVar[Sensor] = Sensor.POSITION
    mount: Mount = STRAIGHT
    sigma: float = 0.1  # m

    def theta(self) -> Floats:
        return self.mount.theta()

    def sigmas(self) -> Floats:
        return deviations(self, self.sigma, self.sigma, self.sigma)
