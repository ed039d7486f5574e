"""Strapdown inertial navigation: the IMU drives the prediction, everything else corrects it.

Error state of 21: position, velocity (world), attitude (body side), gyro and accelerometer bias, slowly varying GNSS
error, horizontal wind, barometer offset. Flat and non-rotating Earth in the site's tangent plane: right for sites of a
few kilometres and MEMS sensors (the Earth's 15 deg/h ends up in the gyro bias).
"""

from dataclasses import dataclass
from math import exp
from typing import Final, final

import numpy as np

from outrider._kernel import kernel
from outrider.core.manifold import rotate_right
from outrider.data import Manifold, StateLayout
from outrider.models.kinematics import (
    K_BA,
    K_BB,
    K_BG,
    K_BN,
    K_F,
    K_P,
    K_R,
    K_V,
    K_W,
    K_WIND,
    T_BA,
    T_BB,
    T_BG,
    T_BN,
    T_F,
    T_P,
    T_TH,
    T_V,
    T_W,
    T_WIND,
)  # fmt: skip
from outrider.models.motion.turning import rotation, swing, turn
from outrider.typing import Floats

LAYOUT: Final = StateLayout(
    ("position", 3, "m"),
    ("velocity", 3, "m/s"),
    ("attitude", Manifold.ROTATION, "rad"),
    ("gyro_bias", 3, "rad/s"),
    ("accel_bias", 3, "m/s^2"),
    ("gnss_bias", 3, "m"),
    ("wind", 2, "m/s"),
    ("baro_bias", 1, "m"),
)
P_, V_, TH, BG, BA, BN, WI, BB = 0, 3, 6, 9, 12, 15, 18, 20  # error rows
X_Q, X_BG, X_BA, X_BN, X_WI, X_BB = 6, 10, 13, 16, 19, 21  # state rows


@kernel
def propagate(x: Floats, dt: float, u: Floats, theta: Floats, F: Floats, Q: Floats) -> None:
    """x <- f(x, u, dt), with its Jacobian F (21, 21) and noise Q (21, 21).  u = gyro, specific force (body).

    v' = R f + g;  p' = v + v' dt/2;  R' = R Exp(w dt);  R is taken at mid-interval.  The noises are white densities of
    gyro and accelerometer, and random walks of the rest.  theta[12] is gravity.  What the gyro's bias does to velocity
    within the step, of second order in dt, is left out of F.
    """
    w0, w1, w2 = u[0] - x[X_BG], u[1] - x[X_BG + 1], u[2] - x[X_BG + 2]
    f0, f1, f2 = u[3] - x[X_BA], u[4] - x[X_BA + 1], u[5] - x[X_BA + 2]
    h = 0.5 * dt
    before = rotation(x, X_Q)
    rotate_right(x, X_Q, w0 * h, w1 * h, w2 * h)
    R = rotation(x, X_Q)
    rotate_right(x, X_Q, w0 * h, w1 * h, w2 * h)
    a0 = R[0] * f0 + R[1] * f1 + R[2] * f2
    a1 = R[3] * f0 + R[4] * f1 + R[5] * f2
    a2 = R[6] * f0 + R[7] * f1 + R[8] * f2
    # dv' = -[R f]x R(0) dth - R dba;  the position moves by half of that times dt
    swing(F, V_, TH, dt, a0, a1, a2, before)
    swing(F, P_, TH, h * dt, a0, a1, a2, before)
    turn(F, TH, BG, w0 * dt, w1 * dt, w2 * dt, -dt)
    for i in range(3):
        acc = a0 if i == 0 else (a1 if i == 1 else a2 - theta[12])
        x[P_ + i] += (x[V_ + i] + h * acc) * dt
        x[V_ + i] += acc * dt
        F[P_ + i, V_ + i] = dt
        for j in range(3):
            F[V_ + i, BA + j] = -dt * R[3 * i + j]
            F[P_ + i, BA + j] = -h * dt * R[3 * i + j]

    q_g, q_a = theta[0] * theta[0] * dt, theta[1] * theta[1] * dt
    q_p = theta[11] * theta[11] * dt
    for i in range(3):
        Q[P_ + i, P_ + i] = h * h * q_a + q_p
        Q[P_ + i, V_ + i] = Q[V_ + i, P_ + i] = h * q_a
        Q[V_ + i, V_ + i] = q_a
        Q[TH + i, TH + i] = q_g
        Q[BG + i, BG + i] = theta[2] * theta[2] * dt
        Q[BA + i, BA + i] = theta[3] * theta[3] * dt
    keep = exp(-dt / theta[5])
    for i in range(3):
        sigma = theta[4] if i < 2 else theta[6]
        x[X_BN + i] *= keep
        F[BN + i, BN + i] = keep
        Q[BN + i, BN + i] = sigma * sigma * (1 - keep * keep)
    Q[WI, WI] = Q[WI + 1, WI + 1] = theta[7] * theta[7] * dt
    Q[BB, BB] = theta[8] * theta[8] * dt


@kernel
def kinematic_view(x: Floats, u: Floats, theta: Floats, k: Floats, K: Floats) -> None:
    """Write the kinematic view k and its Jacobian K (T_SIZE, 21). Rates and specific force come from the last input."""
    R = rotation(x, X_Q)
    for i in range(9):
        k[K_R + i] = R[i]
    for i in range(3):
        k[K_P + i], k[K_V + i] = x[P_ + i], x[V_ + i]
        k[K_BG + i], k[K_BA + i], k[K_BN + i] = x[X_BG + i], x[X_BA + i], x[X_BN + i]
        k[K_W + i], k[K_F + i] = u[i] - x[X_BG + i], u[3 + i] - x[X_BA + i]
        K[T_P + i, P_ + i] = K[T_V + i, V_ + i] = K[T_TH + i, TH + i] = 1.0
        K[T_BG + i, BG + i] = K[T_BA + i, BA + i] = K[T_BN + i, BN + i] = 1.0
        K[T_W + i, BG + i] = K[T_F + i, BA + i] = -1.0
    k[K_WIND], k[K_WIND + 1], k[K_BB] = x[X_WI], x[X_WI + 1], x[X_BB]
    K[T_WIND, WI] = K[T_WIND + 1, WI + 1] = K[T_BB, BB] = 1.0


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class StrapdownIns:
    """Noise of a MEMS inertial unit on a vehicle that vibrates, and of what drifts beside it."""

    gyro_noise: float = 0.005  # rad/s per sqrt(Hz)
    accel_noise: float = 0.08  # m/s^2 per sqrt(Hz)
    gyro_bias_walk: float = 5e-5  # rad/s per sqrt(s)
    accel_bias_walk: float = 2e-3  # m/s^2 per sqrt(s)
    gnss_bias: float = 0.0  # m, horizontal standard deviation of the slowly varying GNSS error; 0: white
    gnss_time: float = 60.0  # s
    gnss_bias_up: float = 0.0  # m
    wind_walk: float = 0.0  # m/s per sqrt(s)
    baro_walk: float = 0.05  # m per sqrt(s)
    position_walk: float = 0.0  # m per sqrt(s)
    gravity: float = 9.80665  # m/s^2, replaced by the site's
    initial_gyro_bias: float = 0.02  # rad/s
    initial_accel_bias: float = 0.3  # m/s^2
    initial_baro_bias: float = 5.0  # m

    def theta(self) -> Floats:
        """Kernel parameters, in the order that `propagate` reads them."""
        return np.array(
            [
                self.gyro_noise, self.accel_noise, self.gyro_bias_walk, self.accel_bias_walk, self.gnss_bias,
                self.gnss_time, self.gnss_bias_up, self.wind_walk, self.baro_walk, 0.0, 0.0, self.position_walk,
                self.gravity,
            ]
        )  # fmt: skip
