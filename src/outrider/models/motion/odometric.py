"""A wheeled robot on the plane that is driven by its own odometry: pose, and what its odometry is wrong by.

The cheap model for logs of odometry at a high rate: records drive the prediction instead of correcting a velocity, so a
team of such robots is a filter of seven states each.
"""

from dataclasses import dataclass
from math import cos, exp, sin
from typing import Final, final

import numpy as np

from outrider._kernel import kernel
from outrider.core.angles import wrap
from outrider.data import Manifold, StateLayout
from outrider.models.kinematics import K_BR, K_P, K_R, K_V, K_W, T_BR, T_P, T_TH, T_V, T_W
from outrider.typing import Floats

LAYOUT: Final = StateLayout(
    ("position", 2, "m"),
    ("heading", Manifold.ANGLE, "rad"),
    ("speed_scale", 1, ""),
    ("turn_scale", 1, ""),
    ("curvature", 1, "1/m"),
    ("range_bias", 1, "m"),
)
PX, PY, YAW, SV, SW, KA, BR = range(7)


@kernel
def propagate(x: Floats, dt: float, u: Floats, theta: Floats, F: Floats, Q: Floats) -> None:
    """x <- f(x, u, dt), with its Jacobian F (7, 7) and noise Q (7, 7).

    p' = R(yaw + w dt/2) (v dt, 0);  yaw' = w dt;  v = (1 + s_v) u[0];  w = (1 + s_w) u[1] + a v.  Scales and a, the
    curvature of wheels of unequal size: random walks;  the range bias: Gauss-Markov.  u[2], u[3] : further noise of
    speed and rate [m/s, rad/s per sqrt(Hz)], where odometry is missing.  theta: see `OdometricRobot.theta`.
    """
    v = (1.0 + x[SV]) * u[0]
    w = (1.0 + x[SW]) * u[1] + x[KA] * v
    mid = x[YAW] + 0.5 * w * dt
    c, s = cos(mid), sin(mid)
    step_x, step_y = c * v * dt, s * v * dt
    x[PX] += step_x
    x[PY] += step_y
    x[YAW] = wrap(x[YAW] + w * dt)

    F[PX, YAW], F[PY, YAW] = -step_y, step_x
    F[PX, SV], F[PY, SV] = c * u[0] * dt, s * u[0] * dt
    half_x, half_y = -0.5 * step_y * dt, 0.5 * step_x * dt  # by w
    F[PX, SV], F[PY, SV] = F[PX, SV] + half_x * x[KA] * u[0], F[PY, SV] + half_y * x[KA] * u[0]
    F[PX, SW], F[PY, SW], F[YAW, SW] = half_x * u[1], half_y * u[1], u[1] * dt
    F[PX, KA], F[PY, KA], F[YAW, KA] = half_x * v, half_y * v, v * dt
    F[YAW, SV] = x[KA] * u[0] * dt

    travelled, turned = abs(v) * dt, abs(w) * dt
    along = theta[0] * theta[0] * travelled + (theta[5] * theta[5] + u[2] * u[2]) * dt
    across = theta[1] * theta[1] * travelled + theta[5] * theta[5] * dt
    q_w = theta[2] * theta[2] * turned + theta[3] * theta[3] * travelled + (theta[4] * theta[4] + u[3] * u[3]) * dt
    g_x, g_y = -0.5 * step_y, 0.5 * step_x  # what an error of the turn does to the step
    Q[PX, PX] = c * c * along + s * s * across + g_x * g_x * q_w
    Q[PY, PY] = s * s * along + c * c * across + g_y * g_y * q_w
    Q[PX, PY] = Q[PY, PX] = c * s * (along - across) + g_x * g_y * q_w
    Q[PX, YAW] = Q[YAW, PX] = g_x * q_w
    Q[PY, YAW] = Q[YAW, PY] = g_y * q_w
    Q[YAW, YAW] = q_w
    Q[SV, SV] = Q[SW, SW] = theta[6] * theta[6] * travelled
    Q[KA, KA] = theta[7] * theta[7] * travelled
    keep = exp(-dt / theta[9])
    x[BR] *= keep
    F[BR, BR] = keep
    Q[BR, BR] = theta[8] * theta[8] * (1.0 - keep * keep)


@kernel
def kinematic_view(x: Floats, u: Floats, theta: Floats, k: Floats, K: Floats) -> None:
    """Write the kinematic view k and its Jacobian K (T_SIZE, 7). Height, roll and pitch are zero."""
    c, s = cos(x[YAW]), sin(x[YAW])
    v = (1.0 + x[SV]) * u[0]
    k[K_P], k[K_P + 1] = x[PX], x[PY]
    k[K_R], k[K_R + 1], k[K_R + 3], k[K_R + 4], k[K_R + 8] = c, -s, s, c, 1.0
    k[K_V], k[K_V + 1] = c * v, s * v
    k[K_W + 2], k[K_BR] = (1.0 + x[SW]) * u[1] + x[KA] * v, x[BR]
    K[T_P, PX] = K[T_P + 1, PY] = K[T_TH + 2, YAW] = 1.0
    K[T_V, YAW], K[T_V + 1, YAW] = -k[K_V + 1], k[K_V]
    K[T_V, SV], K[T_V + 1, SV] = c * u[0], s * u[0]
    K[T_W + 2, SV], K[T_W + 2, SW], K[T_W + 2, KA] = x[KA] * u[0], u[1], v
    K[T_BR, BR] = 1.0


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class OdometricRobot:
    """How wrong odometry may be. Walks are standard deviations per root of what they grow with."""

    distance_walk: float = 0.04  # m per sqrt(m) travelled, along
    side_walk: float = 0.025  # m per sqrt(m) travelled, across
    turn_walk: float = 0.08  # rad per sqrt(rad) turned
    heading_walk: float = 0.045  # rad per sqrt(m) travelled
    heading_rest: float = 1e-3  # rad per sqrt(s), at rest, too
    position_rest: float = 1e-3  # m per sqrt(s), at rest, too
    scale_walk: float = 1e-3  # 1 per sqrt(m) travelled
    curvature_walk: float = 1e-3  # 1/m per sqrt(m) travelled
    range_bias: float = 0.03  # m, of all ranges that it measures
    range_time: float = 60.0  # s
    initial_speed_scale: float = 0.05
    initial_turn_scale: float = 0.1
    initial_curvature: float = 0.05  # 1/m

    def theta(self) -> Floats:
        """Kernel parameters, in the order that `propagate` reads them."""
        return np.array(
            [
                self.distance_walk, self.side_walk, self.turn_walk, self.heading_walk, self.heading_rest,
                self.position_rest, self.scale_walk, self.curvature_walk, self.range_bias, self.range_time,
            ]
        )  # fmt: skip
