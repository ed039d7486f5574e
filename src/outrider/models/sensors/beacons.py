"""Ranges and bearings to beacons whose places are known."""

from dataclasses import dataclass
from math import atan2, sqrt
from typing import ClassVar, final

from outrider._kernel import kernel
from outrider.core.angles import wrap
from outrider.models.kinematics import K_BR, T_BR
from outrider.models.sensors.geometry import (
    Vector,
    clear,
    dot,
    mix,
    sensor_axis,
    target_from_origin,
    target_row,
    triple,
)
from outrider.models.sensors.layout import LEVER, OWN, STRAIGHT, Mount, Sensor, deviations
from outrider.typing import Floats

# Nearer than this [m] the direction to the beacon, and so the Jacobian, means nothing.
_NEAREST = 1e-3


@kernel
def range_row(k: Floats, theta: Floats, r: Vector, D: Floats, row: int) -> float:
    """|r - l| + b_r, the range to the beacon at r in the body; NaN for one that is here."""
    q = mix(1.0, r, -1.0, triple(theta, LEVER))
    distance = sqrt(dot(q, q))
    if not distance > _NEAREST:
        return float("nan")
    target_row(k, r, mix(1.0 / distance, q, 0.0, q), D, row)
    D[row, T_BR] = 1.0
    return distance + k[K_BR]


@kernel
def beacon_range(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """z[1] = |p + R l - beacon| + b_r [m], z[0] names the beacon;  theta[12:15] its place in the site frame [m]."""
    clear(D, 1)
    h = range_row(k, theta, target_from_origin(k, triple(theta, OWN)), D, 0)
    if h != h:
        return 0
    y[0] = z[1] - h
    return 1


@kernel
def bearing_row(k: Floats, theta: Floats, r: Vector, D: Floats, row: int) -> float:
    """atan2(s_y, s_x), s = R_bs' (r - l): bearing of a place r in the body; NaN for one that is overhead or here."""
    q = mix(1.0, r, -1.0, triple(theta, LEVER))
    b_x, b_y = sensor_axis(theta, 0), sensor_axis(theta, 1)
    x, y = dot(b_x, q), dot(b_y, q)
    level2 = x * x + y * y
    if not level2 > _NEAREST * _NEAREST:
        return float("nan")
    target_row(k, r, mix(x / level2, b_y, -y / level2, b_x), D, row)
    return atan2(y, x)


@kernel
def bearing(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """z[2] as `range_bearing`, whose z[1] is not read."""
    clear(D, 1)
    h = bearing_row(k, theta, target_from_origin(k, triple(theta, OWN)), D, 0)
    if h != h:
        return 0
    y[0] = wrap(z[2] - h)
    return 1


@kernel
def range_bearing(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """z[1] as `beacon_range`; z[2] = atan2(s_y, s_x), s = R_bs' (R' (beacon - p) - l): bearing, left positive [rad]."""
    clear(D, 2)
    r = target_from_origin(k, triple(theta, OWN))
    h = range_row(k, theta, r, D, 0)
    b = bearing_row(k, theta, r, D, 1)
    if h != h or b != b:
        return 0
    y[0] = z[1] - h
    y[1] = wrap(z[2] - b)
    return 2


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Range:
    """Range to one beacon; all beacons share one offset."""

    code: ClassVar[Sensor] = Sensor.RANGE
    mount: Mount = STRAIGHT
    beacon: tuple[float, float, float]  # m, site frame
    sigma: float = 0.1  # m

    def theta(self) -> Floats:
        return self.mount.theta(*self.beacon)

    def sigmas(self) -> Floats:
        return deviations(self, self.sigma)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class RangeBearing:
    """Range and bearing to one beacon."""

    code: ClassVar[Sensor] = Sensor.RANGE_BEARING
    mount: Mount = STRAIGHT
    beacon: tuple[float, float, float]  # m, site frame
    sigma_range: float = 0.1  # m
    sigma_bearing: float = 0.02  # rad

    def theta(self) -> Floats:
        return self.mount.theta(*self.beacon)

    def sigmas(self) -> Floats:
        return deviations(self, self.sigma_range, self.sigma_bearing)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Bearing:
    """Bearing to one beacon, without its range."""

    code: ClassVar[Sensor] = Sensor.BEARING
    mount: Mount = STRAIGHT
    beacon: tuple[float, float, float]  # m, site frame
    sigma: float = 0.02  # rad

    def theta(self) -> Floats:
        return self.mount.theta(*self.beacon)

    def sigmas(self) -> Floats:
        return deviations(self, self.sigma)
