"""Attitude and heading from outside: another filter's quaternion, a dual antenna, a compass in degrees.

E is the error rotation R_hat' R_z. Its innovation y = Log(E) is a rotation vector in the body, and -dy/dth = Jl(y)^-1,
which is I for a small y. E itself stands for a moment in the rate columns of D, so that nothing is allocated.
"""

from dataclasses import dataclass
from math import atan2
from typing import ClassVar, final

from outrider._kernel import kernel
from outrider.core.angles import wrap
from outrider.core.rotations import left_jacobian_inverse, quat_from_matrix, so3_log
from outrider.models.kinematics import K_R, T_TH, T_W
from outrider.models.sensors.geometry import (
    Vector,
    clear,
    cross,
    dot,
    in_body,
    in_world,
    is_rotation,
    mix,
    put,
    sensor_axis,
    triple,
    turned,
)
from outrider.models.sensors.layout import MOUNT, OWN, STRAIGHT, Mount, Sensor, deviations
from outrider.typing import Floats

# Squared sine of the angle to the vertical below which an axis has no heading (0.6 degrees).
_PLUMB = 1e-4


@kernel
def error_rows(y: Floats, D: Floats, row: int) -> None:
    """From E in D[row:row+3, T_W:T_W+3]: y[row:row+3] = Log(E), D[.., T_TH:] = Jl(y)^-1; E is wiped."""
    E, phi = D[row : row + 3, T_W : T_W + 3], y[row : row + 3]
    so3_log(E, phi)
    left_jacobian_inverse(phi, D[row : row + 3, T_TH : T_TH + 3])
    for i in range(3):
        E[i, 0] = E[i, 1] = E[i, 2] = 0.0


@kernel
def attitude_rows(k: Floats, q: Floats, theta: Floats, y: Floats, D: Floats, row: int) -> None:
    """y[row:row+3] = Log(R' R(q) R_bs') and its rows of D."""
    for j in range(3):
        e = in_body(k, turned(q, triple(theta, MOUNT + 3 * j)))
        D[row, T_W + j], D[row + 1, T_W + j], D[row + 2, T_W + j] = e
    error_rows(y, D, row)


@kernel
def sensor_attitude(k: Floats, theta: Floats, D: Floats, q: Floats) -> None:
    """q[0:4] of R R_bs; D[0:3] is scratch."""
    R = D[0:3, T_W : T_W + 3]
    for j in range(3):
        R[0, j], R[1, j], R[2, j] = in_world(k, sensor_axis(theta, j))
    quat_from_matrix(R, q)


@kernel
def attitude(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """z[0:4] = quaternion of R R_bs;  y = Log(R' R_z R_bs'), in body axes [rad]."""
    clear(D, 3)
    if not is_rotation(z):
        return 0
    attitude_rows(k, z, theta, y, D, 0)
    return 3


@kernel
def azimuth_row(k: Floats, b: Vector, D: Floats, row: int) -> float:
    """Azimuth [rad] of the body direction b, counter-clockwise from east, with tilt; NaN for one that is plumb."""
    x, r_x, r_y = in_world(k, b), triple(k, K_R), triple(k, K_R + 3)
    h2 = x[0] * x[0] + x[1] * x[1]
    if not h2 > _PLUMB * dot(x, x):
        return float("nan")
    put(D, row, T_TH, 1.0 / h2, cross(b, mix(x[0], r_y, -x[1], r_x)))
    return atan2(x[1], x[0])


@kernel
def heading(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """z[0] = azimuth of R R_bs e_x + c [rad], counter-clockwise from east;  theta[12] offset c that the sensor adds."""
    clear(D, 1)
    azimuth = azimuth_row(k, sensor_axis(theta, 0), D, 0)
    if azimuth != azimuth:
        return 0
    y[0] = wrap(z[0] - azimuth - theta[OWN])
    return 1


@kernel
def yaw_of_attitude(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """z[0:4] = quaternion of R R_bs, of which only the yaw is used: y = yaw(R_z R_bs') - yaw(R) [rad]."""
    clear(D, 1)
    azimuth = azimuth_row(k, (1.0, 0.0, 0.0), D, 0)
    if azimuth != azimuth or not is_rotation(z):
        return 0
    forward = turned(z, triple(theta, MOUNT))
    if not forward[0] * forward[0] + forward[1] * forward[1] > _PLUMB:
        return 0
    y[0] = wrap(atan2(forward[1], forward[0]) - azimuth)
    return 1


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Heading:
    """Heading of the mount's forward axis, e.g. the baseline of a dual antenna."""

    code: ClassVar[Sensor] = Sensor.HEADING
    mount: Mount = STRAIGHT
    offset: float = 0.0  # rad, what the sensor reads more than the heading of its mount
    sigma: float = 0.02  # rad

    def theta(self) -> Floats:
        return self.mount.theta(self.offset)

    def sigmas(self) -> Floats:
        return deviations(self, self.sigma)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Attitude:
    """All three angles of another estimator's attitude."""

    code: ClassVar[Sensor] = Sensor.ATTITUDE
    mount: Mount = STRAIGHT
    sigma_tilt: float = 0.02  # rad
    sigma_yaw: float = 0.1  # rad

    def theta(self) -> Floats:
        return self.mount.theta()

    def sigmas(self) -> Floats:
        return deviations(self, self.sigma_tilt, self.sigma_tilt, self.sigma_yaw)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class YawOfAttitude:
    """The yaw alone of another estimator's attitude."""

    code: ClassVar[Sensor] = Sensor.YAW_OF_ATTITUDE
    mount: Mount = STRAIGHT
    sigma: float = 0.1  # rad

    def theta(self) -> Floats:
        return self.mount.theta()

    def sigmas(self) -> Floats:
        return deviations(self, self.sigma)
