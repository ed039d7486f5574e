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
from outrider.models.motion.turning import rotation, swing, turn
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
    R = rotation(x, X_Q)
    m0 = (x[X_V] + h * x[X_A]) * dt  # the step in body axes
    m1 = (x[X_V + 1] + h * x[X_A + 1]) * dt
    m2 = (x[X_V + 2] + h * x[X_A + 2]) * dt
    s0 = R[0] * m0 + R[1] * m1 + R[2] * m2  # and in the world's
    s1 = R[3] * m0 + R[4] * m1 + R[5] * m2
    s2 = R[6] * m0 + R[7] * m1 + R[8] * m2
    swing(F, P_, TH, 1.0, s0, s1, s2, R)
    p0, p1, p2 = x[X_W] * dt, x[X_W + 1] * dt, x[X_W + 2] * dt
    turn(F, TH, W_, p0, p1, p2, dt)
    rotate_right(x, X_Q, p0, p1, p2)
    for i in range(3):
        x[P_ + i] += s0 if i == 0 else (s1 if i == 1 else s2)
        x[X_V + i] += x[X_A + i] * dt
        F[V_ + i, A_ + i] = dt
        for j in range(3):
            F[P_ + i, V_ + j], F[P_ + i, A_ + j] = dt * R[3 * i + j], h * dt * R[3 * i + j]
    for i in range(15):
        Q[i, i] = theta[i] * dt


@kernel
def kinematic_view(x: Floats, u: Floats, theta: Floats, k: Floats, K: Floats) -> None:
    """Write the kinematic view k and its Jacobian K (T_SIZE, 15). Specific force is a - g in body axes."""
    R, g = rotation(x, X_Q), theta[15]
    for i in range(9):
        k[K_R + i] = R[i]
    for i in range(3):
        k[K_P + i] = x[P_ + i]
        k[K_V + i] = R[3 * i] * x[X_V] + R[3 * i + 1] * x[X_V + 1] + R[3 * i + 2] * x[X_V + 2]
        k[K_W + i] = x[X_W + i]
        k[K_F + i] = x[X_A + i] + g * R[6 + i]
        K[T_P + i, P_ + i] = K[T_TH + i, TH + i] = K[T_W + i, W_ + i] = K[T_F + i, A_ + i] = 1.0
        for j in range(3):
            K[T_V + i, V_ + j] = R[3 * i + j]
    swing(K, T_V, TH, 1.0, k[K_V], k[K_V + 1], k[K_V + 2], R)
    # d(R' g e_z) = [R' g e_z]x dth
    g0, g1, g2 = g * R[6], g * R[7], g * R[8]
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
