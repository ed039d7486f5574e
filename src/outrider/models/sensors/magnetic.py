"""Magnetometers: where the field points, as a heading or as a vector. The strength of the field is never used.

The reference is declared by the caller (`outrider.core.magnetism` knows it for any place and date).
"""

from dataclasses import dataclass
from math import atan2, cos, pi, sin, sqrt
from typing import ClassVar, final

from outrider._kernel import kernel
from outrider.core.angles import wrap
from outrider.errors import ConfigError
from outrider.models.kinematics import T_TH
from outrider.models.sensors.geometry import (
    Vector,
    clear,
    cross,
    dot,
    in_body,
    in_mount,
    in_world,
    put,
    sensor_axis,
    triple,
)
from outrider.models.sensors.layout import OWN, STRAIGHT, Mount, Sensor, deviations
from outrider.typing import Floats

# Squared share of the field that must be horizontal to name a direction (5 %, found only beside the magnetic poles).
_DIP = 0.0025


@kernel
def mag_heading(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """y = north - azimuth(m), m = R R_bs z[0:3]: the field's azimuth, levelled by the attitude, against magnetic north.

    theta[12] declination, east positive [rad];  theta[13] inclination, down positive [rad], only to simulate. A wrong
    tilt turns the levelled field in proportion to the dip, hence the columns of roll and pitch.
    """
    clear(D, 1)
    m = in_world(k, in_mount(theta, triple(z, 0)))
    h2 = m[0] * m[0] + m[1] * m[1]
    if not h2 > _DIP * dot(m, m):
        return 0
    y[0] = wrap(0.5 * pi - theta[OWN] - atan2(m[1], m[0]))
    # dm = (R dth) x m, so d azimuth = (e_z - m_z [m_x, m_y, 0] / h2)' R dth
    tilt = -m[2] / h2
    put(D, 0, T_TH, 1.0, in_body(k, (tilt * m[0], tilt * m[1], 1.0)))
    return 1


@kernel
def mag_vector(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """z[0:3]/|z| = R_bs' R' m;  theta[12:15] unit field m, east-north-up."""
    clear(D, 3)
    strength = sqrt(dot(triple(z, 0), triple(z, 0)))
    if not strength > 0.0:
        return 0
    u = in_body(k, triple(theta, OWN))
    for i in range(3):
        b = sensor_axis(theta, i)
        y[i] = z[i] / strength - dot(b, u)
        put(D, i, T_TH, 1.0, cross(b, u))
    return 3


@kernel
def field_of(theta: Floats) -> Vector:
    """Unit field east-north-up of declination theta[12] and inclination theta[13]."""
    level = cos(theta[OWN + 1])
    return level * sin(theta[OWN]), level * cos(theta[OWN]), -sin(theta[OWN + 1])


@kernel
def simulate_mag(k: Floats, theta: Floats, field: Vector, z: Floats) -> None:
    """z[0:3] = R_bs' R' field."""
    u = in_body(k, field)
    for i in range(3):
        z[i] = dot(sensor_axis(theta, i), u)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class MagHeading:
    """Compass: the heading alone, so that iron nearby cannot tilt the robot."""

    code: ClassVar[Sensor] = Sensor.MAG_HEADING
    mount: Mount = STRAIGHT
    declination: float  # rad, east positive
    inclination: float = 1.1  # rad, down positive; only to simulate
    sigma: float = 0.1  # rad

    def theta(self) -> Floats:
        return self.mount.theta(self.declination, self.inclination)

    def sigmas(self) -> Floats:
        return deviations(self, self.sigma)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class MagVector:
    """Magnetometer as a direction in space."""

    code: ClassVar[Sensor] = Sensor.MAG_VECTOR
    mount: Mount = STRAIGHT
    field: tuple[float, float, float]  # east-north-up, made a unit vector
    sigma: float = 0.05  # share of the field

    def __post_init__(self) -> None:
        strength = sqrt(sum(a * a for a in self.field))
        if not 0.0 < strength < float("inf"):
            raise ConfigError(f"field {self.field} has no direction", where=self.code.name.lower())
        object.__setattr__(self, "field", tuple(a / strength for a in self.field))

    def theta(self) -> Floats:
        return self.mount.theta(*self.field)

    def sigmas(self) -> Floats:
        return deviations(self, self.sigma, self.sigma, self.sigma)
