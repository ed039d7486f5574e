"""Height and what is seen of the ground: barometer, range finder, optical flow. The ground is level at theta[12]."""

from dataclasses import dataclass
from typing import ClassVar, final

from outrider._kernel import kernel
from outrider.models.kinematics import K_BB, K_R, K_W, T_BB, T_P, T_TH, T_W
from outrider.models.sensors.geometry import (
    clear,
    cross,
    dot,
    mix,
    point,
    point_row,
    put,
    sensor_axis,
    triple,
    velocity_row,
)
from outrider.models.sensors.layout import LEVER, OWN, STRAIGHT, Mount, Sensor, deviations
from outrider.typing import Floats

# Tilted further than this (78 degrees from looking straight down) the beam does not meet level ground usefully.
_STEEP = 0.2
# Nearer than this [m] a camera sees no texture.
_NEAREST = 0.05


@kernel
def baro(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """z[0] = (p + R l)_z + b_b [m]."""
    clear(D, 1)
    y[0] = z[0] - point(k, theta, 2) - k[K_BB]
    point_row(k, theta, 2, D, 0)
    D[0, T_BB] = 1.0
    return 1


@kernel
def steepness(k: Floats, theta: Floats) -> float:
    """Cosine of the angle between the beam, the sensor's -z axis, and straight down."""
    return dot(triple(k, K_R + 6), sensor_axis(theta, 2))


@kernel
def distance_row(k: Floats, theta: Floats, distance: float, scale: float, D: Floats, row: int) -> None:
    """Adds scale d(distance): where the beam meets the ground, l - distance e_z in the body, the height is given."""
    up = triple(k, K_R + 6)
    share = scale / steepness(k, theta)
    D[row, T_P + 2] += share
    put(D, row, T_TH, share, cross(mix(1.0, triple(theta, LEVER), -distance, sensor_axis(theta, 2)), up))


@kernel
def range_finder(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """z[0] = ((p + R l)_z - ground) / cos(tilt) [m], along the sensor's -z axis;  theta[12] height of the ground [m].

    A predicted place below the ground is no reason for silence: only this sensor could mend it.
    """
    clear(D, 1)
    c = steepness(k, theta)
    if not c > _STEEP:
        return 0
    distance = (point(k, theta, 2) - theta[OWN]) / c
    y[0] = z[0] - distance
    distance_row(k, theta, distance, 1.0, D, 0)
    return 1


@kernel
def flow(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """z[0:2] = [w_x + u_y / d, w_y - u_x / d] [rad/s];  theta[12] height of the ground [m].

    u and w are the sensor's own velocity and rate in its axes (forward-left-up when it looks straight down), d its
    distance to the ground along -z. The sign is that of a rotation: turning about +x gives a positive flow_x; so does
    moving left. Moving forward gives a negative flow_y. (Of MAVLink's forward-right-down flow, x is the same and y the
    opposite.)
    """
    clear(D, 2)
    c = steepness(k, theta)
    height = point(k, theta, 2) - theta[OWN]
    if not (c > _STEEP and height > _NEAREST):
        return 0
    d = height / c
    for i in range(2):
        b = sensor_axis(theta, i)
        sign = 1.0 - 2.0 * i
        slide = velocity_row(k, theta, sensor_axis(theta, 1 - i), sign / d, D, i)
        distance_row(k, theta, d, -slide / d, D, i)
        put(D, i, T_W, 1.0, b)
        y[i] = z[i] - dot(b, triple(k, K_W)) - slide
    return 2


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Baro:
    """Pressure altitude, less its offset."""

    code: ClassVar[Sensor] = Sensor.BARO
    mount: Mount = STRAIGHT
    sigma: float = 0.5  # m

    def theta(self) -> Floats:
        return self.mount.theta()

    def sigmas(self) -> Floats:
        return deviations(self, self.sigma)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class RangeFinder:
    """Distance to level ground along the sensor's -z axis."""

    code: ClassVar[Sensor] = Sensor.RANGE_FINDER
    mount: Mount = STRAIGHT
    ground: float = 0.0  # m, height of the ground in the site frame
    sigma: float = 0.1  # m

    def theta(self) -> Floats:
        return self.mount.theta(self.ground)

    def sigmas(self) -> Floats:
        return deviations(self, self.sigma)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Flow:
    """Optical flow over level ground."""

    code: ClassVar[Sensor] = Sensor.FLOW
    mount: Mount = STRAIGHT
    ground: float = 0.0  # m, height of the ground in the site frame
    sigma: float = 0.1  # rad/s

    def theta(self) -> Floats:
        return self.mount.theta(self.ground)

    def sigmas(self) -> Floats:
        return deviations(self, self.sigma, self.sigma)
