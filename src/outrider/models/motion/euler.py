"""coop2024's aerial robot: 21 states with Gauss-Markov acceleration and rates of the Euler angles yaw, pitch, roll.

Deviation: the paper's k2 and k4 ("air resistance and damping") become exp(-dt / tau) with the noise that keeps the
variance, since factors per step without a step mean nothing. Euler rates are singular at 90 degrees of pitch, which
the paper's form cannot avoid; `StrapdownIns` has no such pole. Three more states hold a slowly varying GNSS error.
"""

from dataclasses import dataclass
from math import cos, exp, sin
from typing import Final, final

import numpy as np

from outrider._kernel import kernel
from outrider.core.angles import wrap
from outrider.data import Manifold, StateLayout
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
from outrider.typing import Floats

LAYOUT: Final = StateLayout(
    ("position", 3, "m"),
    ("velocity", 3, "m/s"),
    ("acceleration", 3, "m/s^2"),
    ("yaw", Manifold.ANGLE, "rad"),
    ("pitch", Manifold.ANGLE, "rad"),
    ("roll", Manifold.ANGLE, "rad"),
    ("euler_rate", 3, "rad/s"),
    ("accel_bias", 3, "m/s^2"),
    ("gyro_bias", 3, "rad/s"),
    ("gnss_bias", 3, "m"),
)
P_, V_, A_, E_, R_, BA, BG, BN = 0, 3, 6, 9, 12, 15, 18, 21


@kernel
def propagate(x: Floats, dt: float, u: Floats, theta: Floats, F: Floats, Q: Floats) -> None:
    """x <- F x with F (24, 24) and noise Q (24, 24).  coop2024 (14), (15).

    p' = v, v' = n, n <- k2 n;  e' = r, r <- k4 r;  k = exp(-dt / tau).  u is not used.  theta: `EulerBody.theta`.
    """
    k2, k4, keep = exp(-dt / theta[0]), exp(-dt / theta[2]), exp(-dt / theta[7])
    for i in range(3):
        x[P_ + i] += dt * x[V_ + i]
        x[V_ + i] += dt * x[A_ + i]
        x[A_ + i] *= k2
        x[E_ + i] = wrap(x[E_ + i] + dt * x[R_ + i])
        x[R_ + i] *= k4
        x[BN + i] *= keep
        F[P_ + i, V_ + i] = F[V_ + i, A_ + i] = F[E_ + i, R_ + i] = dt
        F[A_ + i, A_ + i], F[R_ + i, R_ + i], F[BN + i, BN + i] = k2, k4, keep
        Q[A_ + i, A_ + i] = theta[1] * theta[1] * (1.0 - k2 * k2)
        Q[R_ + i, R_ + i] = theta[3] * theta[3] * (1.0 - k4 * k4)
        Q[BA + i, BA + i] = theta[4] * theta[4] * dt
        Q[BG + i, BG + i] = theta[5] * theta[5] * dt
        Q[BN + i, BN + i] = theta[6] * theta[6] * (1.0 - keep * keep)


@kernel
def kinematic_view(x: Floats, u: Floats, theta: Floats, k: Floats, K: Floats) -> None:
    """Write the kinematic view k and its Jacobian K (T_SIZE, 24).

    R = Rz(yaw) Ry(pitch) Rx(roll);  body rate w = g r, coop2024 (16) with g of `euler_matrix`;  an error de of the
    angles turns the body by g de;  specific force f = R' (n + [0, 0, gravity]), df = f x (g de).
    """
    cy, sy, cp, sp = cos(x[E_]), sin(x[E_]), cos(x[E_ + 1]), sin(x[E_ + 1])
    cr, sr = cos(x[E_ + 2]), sin(x[E_ + 2])
    k[K_R], k[K_R + 1], k[K_R + 2] = cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr
    k[K_R + 3], k[K_R + 4], k[K_R + 5] = sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr
    k[K_R + 6], k[K_R + 7], k[K_R + 8] = -sp, cp * sr, cp * cr
    euler_matrix(sp, cp, sr, cr, K, T_TH, E_)
    euler_matrix(sp, cp, sr, cr, K, T_W, R_)
    yaw, pitch = x[R_], x[R_ + 1]
    for i in range(3):
        k[K_P + i], k[K_V + i], k[K_BA + i] = x[P_ + i], x[V_ + i], x[BA + i]
        k[K_BG + i], k[K_BN + i] = x[BG + i], x[BN + i]
        k[K_W + i] = K[T_W + i, R_] * yaw + K[T_W + i, R_ + 1] * pitch + K[T_W + i, R_ + 2] * x[R_ + 2]
        k[K_F + i] = k[K_R + i] * x[A_] + k[K_R + 3 + i] * x[A_ + 1] + k[K_R + 6 + i] * (x[A_ + 2] + theta[8])
        K[T_P + i, P_ + i] = K[T_V + i, V_ + i] = K[T_BA + i, BA + i] = 1.0
        K[T_BG + i, BG + i] = K[T_BN + i, BN + i] = 1.0
        for j in range(3):
            K[T_F + i, A_ + j] = k[K_R + 3 * j + i]
    K[T_W, E_ + 1], K[T_W + 1, E_ + 1], K[T_W + 2, E_ + 1] = -cp * yaw, -sp * sr * yaw, -sp * cr * yaw
    K[T_W + 1, E_ + 2], K[T_W + 2, E_ + 2] = cp * cr * yaw - sr * pitch, -cp * sr * yaw - cr * pitch
    f0, f1, f2 = k[K_F], k[K_F + 1], k[K_F + 2]
    for j in range(3):
        a, b, c = K[T_TH, E_ + j], K[T_TH + 1, E_ + j], K[T_TH + 2, E_ + j]
        K[T_F, E_ + j], K[T_F + 1, E_ + j], K[T_F + 2, E_ + j] = f1 * c - f2 * b, f2 * a - f0 * c, f0 * b - f1 * a


@kernel
def euler_matrix(sp: float, cp: float, sr: float, cr: float, K: Floats, row: int, column: int) -> None:
    """K[row:row+3, column:column+3] = g, body rate by rates of yaw, pitch, roll. (16) has other denominators."""
    K[row, column], K[row, column + 2] = -sp, 1.0
    K[row + 1, column], K[row + 1, column + 1] = cp * sr, cr
    K[row + 2, column], K[row + 2, column + 1] = cp * cr, -sr


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class EulerBody:
    """How fast a hexrotor may accelerate and turn."""

    acceleration_time: float = 1.0  # s
    acceleration: float = 0.5  # m/s^2, standard deviation
    rate_time: float = 0.5  # s
    rate: float = 0.3  # rad/s, standard deviation
    accel_bias_walk: float = 0.0  # m/s^2 per sqrt(s)
    gyro_bias_walk: float = 0.0  # rad/s per sqrt(s)
    gnss_bias: float = 0.0  # m, standard deviation of the slowly varying GNSS error; 0: white
    gnss_time: float = 300.0  # s
    gravity: float = 9.80665  # m/s^2

    def theta(self) -> Floats:
        """Kernel parameters, in the order that `propagate` reads them."""
        return np.array(
            [
                self.acceleration_time, self.acceleration, self.rate_time, self.rate, self.accel_bias_walk,
                self.gyro_bias_walk, self.gnss_bias, self.gnss_time, self.gravity,
            ]
        )  # fmt: skip
