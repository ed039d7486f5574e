"""coop2024's ground robot: pose, velocity in the world and yaw rate, both random walks, and the bias of its gyro.

Beside the paper's seven states stand what its receiver is off by for minutes and how far the map it looks at lies from
where it says (the parked aircraft of the paper, "known within a margin of error"); their variance is zero unless given.
"""

from dataclasses import dataclass
from math import cos, exp, sin
from typing import Final, final

import numpy as np

from outrider._kernel import kernel
from outrider.core.angles import wrap
from outrider.data import Manifold, StateLayout
from outrider.models.kinematics import (
    K_BG,
    K_BN,
    K_M,
    K_P,
    K_R,
    K_V,
    K_W,
    T_BG,
    T_BN,
    T_M,
    T_P,
    T_TH,
    T_V,
    T_W,
)
from outrider.typing import Floats

LAYOUT: Final = StateLayout(
    ("position", 2, "m"),
    ("heading", Manifold.ANGLE, "rad"),
    ("velocity", 2, "m/s"),
    ("yaw_rate", 1, "rad/s"),
    ("gyro_bias", 1, "rad/s"),
    ("gnss_bias", 2, "m"),
    ("map_error", 3, "m m rad"),
)
PX, PY, YAW, VX, VY, W, BG, BN, M = 0, 1, 2, 3, 4, 5, 6, 7, 9


@kernel
def propagate(x: Floats, dt: float, u: Floats, theta: Floats, F: Floats, Q: Floats) -> None:
    """x <- F x with F (12, 12) and noise Q (12, 12).  coop2024 (3), (4); the paper gives no Q.

    p' = v, yaw' = w;  v, w: random walks, integrated exactly;  gyro bias: random walk;  gnss_bias: Gauss-Markov;
    map_error: constant.  u is not used.  theta: see `DriftingRover.theta`.
    """
    for i in range(2):
        drift(x, PX + i, VX + i, dt, theta[0], F, Q)
    drift(x, YAW, W, dt, theta[1], F, Q)
    x[YAW] = wrap(x[YAW])
    Q[BG, BG] = theta[2] * theta[2] * dt
    keep = exp(-dt / theta[4])
    for i in range(2):
        x[BN + i] *= keep
        F[BN + i, BN + i] = keep
        Q[BN + i, BN + i] = theta[3] * theta[3] * (1.0 - keep * keep)


@kernel
def drift(x: Floats, p: int, v: int, dt: float, density: float, F: Floats, Q: Floats) -> None:
    """x[p]' = x[v], x[v]' = white noise of the given density [unit of v per sqrt(s)]."""
    x[p] += dt * x[v]
    F[p, v] = dt
    q = density * density
    Q[p, p] = q * dt * dt * dt / 3.0
    Q[p, v] = Q[v, p] = q * dt * dt / 2.0
    Q[v, v] = q * dt


@kernel
def kinematic_view(x: Floats, u: Floats, theta: Floats, k: Floats, K: Floats) -> None:
    """Write the kinematic view k and its Jacobian K (T_SIZE, 12). Height, roll and pitch are zero."""
    c, s = cos(x[YAW]), sin(x[YAW])
    k[K_R], k[K_R + 1], k[K_R + 3], k[K_R + 4], k[K_R + 8] = c, -s, s, c, 1.0
    for i in range(2):
        k[K_P + i], k[K_V + i], k[K_BN + i] = x[PX + i], x[VX + i], x[BN + i]
        K[T_P + i, PX + i] = K[T_V + i, VX + i] = K[T_BN + i, BN + i] = 1.0
    k[K_W + 2], k[K_BG + 2] = x[W], x[BG]
    K[T_TH + 2, YAW] = K[T_W + 2, W] = K[T_BG + 2, BG] = 1.0
    for i in range(3):
        k[K_M + i] = x[M + i]
        K[T_M + i, M + i] = 1.0


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class DriftingRover:
    """How fast velocity and rate may change; the defaults are papers' coop2024 with sqrt(0.05) and sqrt(0.2)."""

    acceleration: float = 0.2236  # m/s per sqrt(s)
    yaw_acceleration: float = 0.4472  # rad/s per sqrt(s)
    gyro_bias_walk: float = 0.0  # rad/s per sqrt(s)
    gnss_bias: float = 0.0  # m, standard deviation of the slowly varying GNSS error; 0: white
    gnss_time: float = 300.0  # s

    def theta(self) -> Floats:
        """Kernel parameters, in the order that `propagate` reads them."""
        return np.array([self.acceleration, self.yaw_acceleration, self.gyro_bias_walk, self.gnss_bias, self.gnss_time])
