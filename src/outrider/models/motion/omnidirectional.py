"""A body that may move any way in 3-D at nearly constant acceleration: the 15 states of robot_localization.

Deviation: the attitude is a quaternion with a body-side error instead of Euler angles, so there is no pole at 90 deg
of pitch; velocity, rate and acceleration are in body axes as there.
"""

from dataclasses import dataclass, field
from typing import Final, final

import numpy as np

from outrider._kernel import kernel
from outrider.core.manifold import rotate_right
from outrider.data import Manifold, StateLayout
from outrider.models.kinematics import K_F, K_P, K_R, K_V, K_W, T_F, T_P, T_TH, T_V, T_W
from outrider.models.motion.strapdown import matrix
from outrider.typing import Floats

LAYOUT: Final = StateLayout(
    ("position", 3, "m"),
    ("attitude", Manifold.ROTATION, "rad"),
    ("velocity", 3, "m/s"),
    ("rate", 3, "rad/s"),
    ("acceleration", 3, "m/s^2"),
)
P_, TH, V_, W_, A_ = 0, 3, 6, 9, 12  # error rows
X_Q, X_V, X_W, X_A = 3, 7, 10, 13  # state rows


@kernel
def propagate(x: Floats, dt: float, u: Floats, theta: Floats, F: Floats, Q: Floats) -> None:
    """x <- f(x, dt), with its Jacobian F (15, 15) and noise Q = diag(theta) dt.

    p' = R (v + a dt/2);  R' = R Exp(w dt);  v' = a;  w and a are random walks.
    """
    h = 0.5 * dt
    a, b, c, d = x[X_Q], x[X_Q + 1], x[X_Q + 2], x[X_Q + 3]
    R00, R01, R02 = 1 - 2 * (b * b + c * c), 2 * (a * b - c * d), 2 * (a * c + b * d)
    R10, R11, R12 = 2 * (a * b + c * d), 1 - 2 * (a * a + c * c), 2 * (b * c - a * d)
    R20, R21, R22 = 2 * (a * c - b * d), 2 * (b * c + a * d), 1 - 2 * (a * a + b * b)
    m0 = (x[X_V] + h * x[X_A]) * dt  # the step in body axes
    m1 = (x[X_V + 1] + h * x[X_A + 1]) * dt
    m2 = (x[X_V + 2] + h * x[X_A + 2]) * dt
    for i in range(3):
        r0, r1, r2 = (R00, R01, R02) if i == 0 else ((R10, R11, R12) if i == 1 else (R20, R21, R22))
        x[P_ + i] += r0 * m0 + r1 * m1 + r2 * m2
        F[P_ + i, TH], F[P_ + i, TH + 1], F[P_ + i, TH + 2] = (
            -(r1 * m2 - r2 * m1),
            -(r2 * m0 - r0 * m2),
            -(r0 * m1 - r1 * m0),
        )
        F[P_ + i, V_], F[P_ + i, V_ + 1], F[P_ + i, V_ + 2] = r0 * dt, r1 * dt, r2 * dt
        F[P_ + i, A_], F[P_ + i, A_ + 1], F[P_ + i, A_ + 2] = r0 * dt * h, r1 * dt * h, r2 * dt * h
    p0, p1, p2 = x[X_W] * dt, x[X_W + 1] * dt, x[X_W + 2] * dt
    rotate_right(x, X_Q, p0, p1, p2)
    n2 = p0 * p0 + p1 * p1 + p2 * p2
    F[TH, TH], F[TH, TH + 1], F[TH, TH + 2] = 1 - 0.5 * (n2 - p0 * p0), p2 + 0.5 * p0 * p1, -p1 + 0.5 * p0 * p2
    F[TH + 1, TH], F[TH + 1, TH + 1], F[TH + 1, TH + 2] = (
        -p2 + 0.5 * p0 * p1,
        1 - 0.5 * (n2 - p1 * p1),
        p0 + 0.5 * p1 * p2,
    )
    F[TH + 2, TH], F[TH + 2, TH + 1], F[TH + 2, TH + 2] = (
        p1 + 0.5 * p0 * p2,
        -p0 + 0.5 * p1 * p2,
        1 - 0.5 * (n2 - p2 * p2),
    )
    for i in range(3):
        x[X_V + i] += x[X_A + i] * dt
        F[TH + i, W_ + i] = dt
        F[V_ + i, A_ + i] = dt
    for i in range(15):
        Q[i, i] = theta[i] * dt


@kernel
def kinematic_view(x: Floats, u: Floats, theta: Floats, k: Floats, K: Floats) -> None:
    """Write the kinematic view k and its Jacobian K (T_SIZE, 15). Specific force is a - g in body axes."""
    matrix(x, X_Q, k, K_R)
    g = theta[15]
    for i in range(3):
        r0, r1, r2 = k[K_R + 3 * i], k[K_R + 3 * i + 1], k[K_R + 3 * i + 2]
        v0, v1, v2 = x[X_V], x[X_V + 1], x[X_V + 2]
        k[K_P + i] = x[P_ + i]
        k[K_V + i] = r0 * v0 + r1 * v1 + r2 * v2
        k[K_W + i] = x[X_W + i]
        k[K_F + i] = x[X_A + i] + g * k[K_R + 6 + i]
        K[T_P + i, P_ + i] = K[T_TH + i, TH + i] = K[T_W + i, W_ + i] = K[T_F + i, A_ + i] = 1.0
        K[T_V + i, V_], K[T_V + i, V_ + 1], K[T_V + i, V_ + 2] = r0, r1, r2
        K[T_V + i, TH], K[T_V + i, TH + 1], K[T_V + i, TH + 2] = (
            -(r1 * v2 - r2 * v1),
            -(r2 * v0 - r0 * v2),
            -(r0 * v1 - r1 * v0),
        )
    # d(R' g e_z) = [R' g e_z]x dth
    g0, g1, g2 = g * k[K_R + 6], g * k[K_R + 7], g * k[K_R + 8]
    K[T_F, TH + 1], K[T_F, TH + 2] = -g2, g1
    K[T_F + 1, TH], K[T_F + 1, TH + 2] = g2, -g0
    K[T_F + 2, TH], K[T_F + 2, TH + 1] = -g1, g0


# robot_localization's defaults, variance per second: x y z, roll pitch yaw, velocities, rates, accelerations
_DEFAULT_Q: Final = (0.05, 0.05, 0.06, 0.03, 0.03, 0.06, 0.025, 0.025, 0.04, 0.01, 0.01, 0.02, 0.01, 0.01, 0.015)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class OmnidirectionalBody:
    """Process noise as robot_localization states it: 15 variances per second."""

    process_noise: tuple[float, ...] = field(default=_DEFAULT_Q)
    gravity: float = 9.80665  # m/s^2, replaced by the site's

    def theta(self) -> Floats:
        """Kernel parameters: the 15 variances per second, then gravity."""
        return np.array([*self.process_noise, self.gravity])
