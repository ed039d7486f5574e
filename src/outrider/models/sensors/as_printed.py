"""Sensors of coop2024 with the matrices as they are printed: wrong on purpose, for the paper's preset and its tests.

None of them is the derivative of what it predicts, so their `Spec` is not `exact`. The printed H have no columns for
attitude; since here a Jacobian goes through the kinematic view, in which rates and specific force depend on it, D holds
what cancels that. Symbols as in the paper: psi, theta, gamma are yaw, pitch and roll, l the antenna above the body.
"""

from dataclasses import dataclass
from math import atan2, cos, sin, sqrt
from typing import ClassVar, final

from outrider._kernel import kernel
from outrider.models.kinematics import (
    K_BA,
    K_BG,
    K_BN,
    K_F,
    K_P,
    K_R,
    K_V,
    K_W,
    T_BA,
    T_BG,
    T_BN,
    T_F,
    T_P,
    T_TH,
    T_V,
    T_W,
)
from outrider.models.sensors.geometry import clear, cross, dot, in_body, put, triple
from outrider.models.sensors.layout import LEVER, OWN, STRAIGHT, Mount, Sensor, deviations
from outrider.typing import Floats


@kernel
def angles(k: Floats) -> tuple[float, float, float]:
    """psi, theta, gamma of R."""
    cp = sqrt(k[K_R] * k[K_R] + k[K_R + 3] * k[K_R + 3])
    return atan2(k[K_R + 3], k[K_R]), atan2(-k[K_R + 6], cp), atan2(k[K_R + 7], k[K_R + 8])


@kernel
def euler_rates(k: Floats) -> tuple[float, float, float]:
    """psi', theta', gamma' from the body rate."""
    _, p, r = angles(k)
    w = triple(k, K_W)
    yaw = (w[1] * sin(r) + w[2] * cos(r)) / cos(p)
    return yaw, w[1] * cos(r) - w[2] * sin(r), w[0] + sin(p) * yaw


@kernel
def put_rates(k: Floats, a: tuple[float, float, float], D: Floats, row: int) -> None:
    """D[row] += that of a' (psi', theta', gamma'), as if those did not depend on the attitude: no h_D_attitude."""
    _, p, r = angles(k)
    cp, sp, cr, sr = cos(p), sin(p), cos(r), sin(r)
    # rows of g^-1: rates of the angles by body rates
    b_y = (a[0] + sp * a[2]) / cp
    b = (a[2], b_y * sr + a[1] * cr, b_y * cr - a[1] * sr)
    put(D, row, T_W, 1.0, b)
    # what d(g r) by pitch and by roll would add through the view, taken back; turned from angles into the body
    yaw, pitch, _ = euler_rates(k)
    by_pitch = -(-cp * yaw * b[0] - sp * sr * yaw * b[1] - sp * cr * yaw * b[2])
    by_roll = -((cp * cr * yaw - sr * pitch) * b[1] + (-cp * sr * yaw - cr * pitch) * b[2])
    c_y = sp * by_roll / cp
    put(D, row, T_TH, 1.0, (by_roll, c_y * sr + by_pitch * cr, c_y * cr - by_pitch * sr))


@kernel
def odometry(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """z[0:3] = v, z[3:6] = w: velocities of the body compared with those in the world.  coop2024 (6)"""
    clear(D, 6)
    for i in range(3):
        y[i], y[3 + i] = z[i] - k[K_V + i], z[3 + i] - k[K_W + i]
        D[i, T_V + i] = D[3 + i, T_W + i] = 1.0
    return 6


@kernel
def gnss_position(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """z[0:3] = p + R l + b_n, the lever arm taken off with the estimated attitude: no h_D_attitude.  (9), (20)"""
    clear(D, 3)
    l = triple(theta, LEVER)
    for i in range(3):
        y[i] = z[i] - k[K_P + i] - dot(triple(k, K_R + 3 * i), l) - k[K_BN + i]
        D[i, T_P + i] = D[i, T_BN + i] = 1.0
    return 3


@kernel
def gnss_velocity_ground(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """z[0:2] = v + psi' R l: the rate times the lever arm itself, not its perpendicular.  coop2024 (8), (9)"""
    clear(D, 3)
    l = triple(theta, LEVER)
    for i in range(3):
        arm = dot(triple(k, K_R + 3 * i), l) if i < 2 else 0.0
        y[i] = z[i] - k[K_V + i] - k[K_W + 2] * arm
        D[i, T_V + i], D[i, T_W + 2] = 1.0, arm
    return 3


@kernel
def gnss_velocity_air(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """z[0:3] = v + l (h_theta theta' + h_gamma gamma'), nothing of psi', nothing upwards.  coop2024 (19), (20)"""
    clear(D, 3)
    l = theta[LEVER + 2]
    psi, p, r = angles(k)
    rates = euler_rates(k)
    h_x = (0.0, l * cos(psi) * cos(p), -l * (cos(psi) * sin(p) * sin(r) - sin(psi) * cos(r)))
    h_y = (0.0, l * sin(psi) * cos(p), -l * (sin(psi) * sin(p) * sin(r) + cos(psi) * cos(r)))
    for i in range(3):
        y[i] = z[i] - k[K_V + i] - (dot(h_x, rates) if i == 0 else (dot(h_y, rates) if i == 1 else 0.0))
        D[i, T_V + i] = 1.0
    put_rates(k, h_x, D, 0)
    put_rates(k, h_y, D, 1)
    return 3


@kernel
def gyro_row(p: float, r: float, i: int) -> tuple[float, float, float]:
    """Row i of g as printed: 1 / (cos gamma - sin theta tan gamma) where 1 / cos gamma + ... belongs.  (17)"""
    if i == 0:
        return -sin(p), 0.0, 1.0
    tan_r = sin(r) / cos(r)
    share = 1.0 / (cos(r) - sin(p) * tan_r)
    return (cos(p) * tan_r * share, share, 0.0) if i == 1 else (cos(p) * share, -tan_r * share, 0.0)


@kernel
def gyro(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """z[0:3] = g r + b_g with g as printed, singular at pitch = roll = 45 deg; no h_D_attitude.  coop2024 (16), (17)"""
    clear(D, 3)
    _, p, r = angles(k)
    rates = euler_rates(k)
    for i in range(3):
        g = gyro_row(p, r, i)
        y[i] = z[i] - dot(g, rates) - k[K_BG + i]
        put_rates(k, g, D, i)
        D[i, T_BG + i] = 1.0
    return 3


@kernel
def accelerometer(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """z[0:3] = R' n + b_a: no gravity, no h_D_attitude.  coop2024 (16), (17).  theta[12] gravity of the view [m/s^2]"""
    clear(D, 3)
    f = triple(k, K_F)
    down = in_body(k, (0.0, 0.0, theta[OWN]))
    unit = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    for i in range(3):
        y[i] = z[i] - (f[i] - down[i]) - k[K_BA + i]
        D[i, T_F + i] = D[i, T_BA + i] = 1.0
        put(D, i, T_TH, -1.0, cross(unit[i], f))
    return 3


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PrintedOdometry:
    """Wheel odometry compared with velocities in the world."""

    code: ClassVar[Sensor] = Sensor.PRINTED_ODOMETRY
    mount: Mount = STRAIGHT
    sigma_v: float = 0.4  # m/s
    sigma_w: float = 0.05  # rad/s

    def theta(self) -> Floats:
        return self.mount.theta()

    def sigmas(self) -> Floats:
        return deviations(self, *(self.sigma_v,) * 3, *(self.sigma_w,) * 3)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PrintedGnssPosition:
    """GNSS position without the column of attitude."""

    code: ClassVar[Sensor] = Sensor.PRINTED_GNSS_POSITION
    mount: Mount = STRAIGHT
    sigma: float = 0.7  # m

    def theta(self) -> Floats:
        return self.mount.theta()

    def sigmas(self) -> Floats:
        return deviations(self, *(self.sigma,) * 3)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PrintedGnssVelocityGround:
    """GNSS velocity with the ground robot's printed lever arm."""

    code: ClassVar[Sensor] = Sensor.PRINTED_GNSS_VELOCITY_GROUND
    mount: Mount = STRAIGHT
    sigma: float = 0.05  # m/s

    def theta(self) -> Floats:
        return self.mount.theta()

    def sigmas(self) -> Floats:
        return deviations(self, *(self.sigma,) * 3)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PrintedGnssVelocityAir:
    """GNSS velocity with the aerial robot's printed lever arm, of which only the height counts."""

    code: ClassVar[Sensor] = Sensor.PRINTED_GNSS_VELOCITY_AIR
    mount: Mount = STRAIGHT
    sigma: float = 0.05  # m/s

    def theta(self) -> Floats:
        return self.mount.theta()

    def sigmas(self) -> Floats:
        return deviations(self, *(self.sigma,) * 3)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PrintedGyro:
    """Gyroscope along the body's axes, with the printed matrix of rates."""

    code: ClassVar[Sensor] = Sensor.PRINTED_GYRO
    mount: Mount = STRAIGHT
    sigma: float = 0.01  # rad/s

    def theta(self) -> Floats:
        return self.mount.theta()

    def sigmas(self) -> Floats:
        return deviations(self, *(self.sigma,) * 3)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PrintedAccelerometer:
    """Accelerometer along the body's axes that feels no gravity."""

    code: ClassVar[Sensor] = Sensor.PRINTED_ACCELEROMETER
    mount: Mount = STRAIGHT
    gravity: float = 9.80665  # m/s^2, what the process model adds to its specific force
    sigma: float = 0.015  # m/s^2

    def theta(self) -> Floats:
        return self.mount.theta(self.gravity)

    def sigmas(self) -> Floats:
        return deviations(self, *(self.sigma,) * 3)
