"""A wheeled robot on the plane: pose, body velocity, yaw rate, gyro bias, wheel scale.

Sensors correct velocity and rate, the motion model only says how fast they may change. Two more states hold what a
GNSS receiver is off by for minutes, and one what all range beacons share; their noise is zero unless a sensor needs
them.
"""

from dataclasses import dataclass
from math import cos, exp, sin, sqrt
from typing import Final, final

import numpy as np

from outrider._kernel import kernel
from outrider.core.angles import wrap
from outrider.data import Manifold, StateLayout
from outrider.models.kinematics import (
    K_BG,
    K_BN,
    K_BR,
    K_P,
    K_R,
    K_S,
    K_V,
    K_W,
    T_BG,
    T_BN,
    T_BR,
    T_P,
    T_S,
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
    ("wheel_scale", 1, ""),
    ("gnss_bias", 2, "m"),
    ("range_bias", 1, "m"),
    stretches=(("velocity", "wheel_scale"),),
)
PX, PY, YAW, VX, VY, W, BG, SC, BN, BR = 0, 1, 2, 3, 4, 5, 6, 7, 8, 10


@kernel
def propagate(x: Floats, dt: float, u: Floats, theta: Floats, F: Floats, Q: Floats) -> None:
    """x <- f(x, dt), with its Jacobian F (11, 11) and noise Q (11, 11).

    p' = R(yaw + w dt/2) v dt;  yaw' = w dt;  v_x, w: random walks;  v_y decays within tau (wheels roll, they do not
    slide);  biases: random walk, or Gauss-Markov with a time constant.  Outside the entries written here F is the
    identity and Q zero.  u is not used.  theta: see `PlanarRobot.theta`.
    """
    accel, lateral, tau_lateral, alpha, walk_heading, walk_position = (
        theta[0],
        theta[1],
        theta[2],
        theta[3],
        theta[4],
        theta[5],
    )
    vx, vy, w = x[VX], x[VY], x[W]
    mid = x[YAW] + 0.5 * w * dt
    c, s = cos(mid), sin(mid)
    decay = exp(-dt / tau_lateral)
    reach = tau_lateral * (1.0 - decay)  # integral of the decay over dt
    step_x, step_y = c * vx * dt - s * vy * reach, s * vx * dt + c * vy * reach

    x[PX] += step_x
    x[PY] += step_y
    x[YAW] = wrap(x[YAW] + w * dt)
    x[VY] = decay * vy

    F[PX, YAW], F[PY, YAW] = -step_y, step_x
    grown = 1.0 + x[SC]  # errors of velocity are in what the wheels say, see `stretches`
    F[PX, VX], F[PX, VY] = grown * c * dt, -grown * s * reach
    F[PY, VX], F[PY, VY] = grown * s * dt, grown * c * reach
    F[PX, SC], F[PY, SC] = step_x / grown, step_y / grown
    F[PX, W], F[PY, W] = -0.5 * step_y * dt, 0.5 * step_x * dt
    F[YAW, W] = dt
    F[VY, VY] = decay

    travelled = sqrt(vx * vx + vy * vy) * dt
    q_p = walk_position * walk_position * travelled
    q_v, q_l, q_w = (
        accel * accel * dt,
        lateral * lateral * (1.0 - decay * decay),
        alpha * alpha * dt,
    )
    h = 0.5 * dt
    # A white acceleration over dt moves the end velocity by q and the position by q dt/2 on average.
    Q[PX, PX] = q_p + h * h * (c * c * q_v + s * s * q_l)
    Q[PY, PY] = q_p + h * h * (s * s * q_v + c * c * q_l)
    Q[PX, PY] = Q[PY, PX] = h * h * c * s * (q_v - q_l)
    Q[PX, VX] = Q[VX, PX] = h * c * q_v / grown
    Q[PY, VX] = Q[VX, PY] = h * s * q_v / grown
    Q[PX, VY] = Q[VY, PX] = -h * s * q_l / grown
    Q[PY, VY] = Q[VY, PY] = h * c * q_l / grown
    Q[W, W] = q_w
    Q[YAW, YAW] = walk_heading * walk_heading * travelled + h * h * q_w
    Q[YAW, W] = Q[W, YAW] = h * q_w
    Q[BG, BG] = theta[6] * theta[6] * dt
    # a scale that walks changes what the wheels say of a speed, and not the speed
    q_s, a, b = theta[7] * theta[7] * travelled, -vx / (grown * grown), -decay * vy / (grown * grown)
    Q[SC, SC] = q_s
    Q[VX, SC] = Q[SC, VX] = a * q_s
    Q[VY, SC] = Q[SC, VY] = b * q_s
    Q[VX, VX] = q_v / (grown * grown) + a * a * q_s
    Q[VY, VY] = q_l / (grown * grown) + b * b * q_s
    Q[VX, VY] = Q[VY, VX] = a * b * q_s
    keep = exp(-dt / theta[9])
    for i in range(2):
        x[BN + i] *= keep
        F[BN + i, BN + i] = keep
        Q[BN + i, BN + i] = theta[8] * theta[8] * (1.0 - keep * keep)
    keep = exp(-dt / theta[11])
    x[BR] *= keep
    F[BR, BR] = keep
    Q[BR, BR] = theta[10] * theta[10] * (1.0 - keep * keep)


@kernel
def kinematic_view(x: Floats, u: Floats, theta: Floats, k: Floats, K: Floats) -> None:
    """Write the kinematic view k and its Jacobian K (T_SIZE, 11). Height, roll and pitch are zero."""
    c, s = cos(x[YAW]), sin(x[YAW])
    k[K_P], k[K_P + 1] = x[PX], x[PY]
    k[K_R], k[K_R + 1], k[K_R + 3], k[K_R + 4], k[K_R + 8] = c, -s, s, c, 1.0
    k[K_V], k[K_V + 1] = c * x[VX] - s * x[VY], s * x[VX] + c * x[VY]
    k[K_W + 2], k[K_BG + 2], k[K_S] = x[W], x[BG], x[SC]
    k[K_BN], k[K_BN + 1], k[K_BR] = x[BN], x[BN + 1], x[BR]
    K[T_P, PX] = K[T_P + 1, PY] = K[T_TH + 2, YAW] = 1.0
    K[T_V, YAW], K[T_V + 1, YAW] = -k[K_V + 1], k[K_V]
    grown = 1.0 + x[SC]
    K[T_V, VX], K[T_V, VY], K[T_V + 1, VX], K[T_V + 1, VY] = c * grown, -s * grown, s * grown, c * grown
    K[T_V, SC], K[T_V + 1, SC] = k[K_V] / grown, k[K_V + 1] / grown
    K[T_W + 2, W] = K[T_BG + 2, BG] = K[T_S, SC] = 1.0
    K[T_BN, BN] = K[T_BN + 1, BN + 1] = K[T_BR, BR] = 1.0


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PlanarRobot:
    """How much a wheeled robot may change its motion. One set for every robot; override per robot, not per log."""

    acceleration: float = 1.0  # m/s per sqrt(s): forward
    lateral: float = 0.10  # m/s: slip across the wheels, standard deviation
    lateral_time: float = 0.5  # s: how long a slip lasts; large for mecanum wheels
    yaw_acceleration: float = 1.0  # rad/s per sqrt(s)
    heading_walk: float = 0.02  # rad per sqrt(m) travelled: gyro scale, slopes, skidding
    position_walk: float = 0.05  # m per sqrt(m) travelled
    gyro_bias_walk: float = 2e-5  # rad/s per sqrt(s)
    scale_walk: float = 2e-4  # 1 per sqrt(m)
    gnss_bias: float = 0.0  # m, standard deviation of the slowly varying GNSS error; 0: white
    gnss_time: float = 60.0  # s
    range_bias: float = 0.0  # m
    range_time: float = 3600.0  # s
    initial_gyro_bias: float = 0.01  # rad/s
    initial_scale: float = 0.05

    def theta(self) -> Floats:
        """Kernel parameters, in the order that `propagate` reads them."""
        return np.array(
            [
                self.acceleration, self.lateral, self.lateral_time, self.yaw_acceleration, self.heading_walk,
                self.position_walk, self.gyro_bias_walk, self.scale_walk, self.gnss_bias, self.gnss_time,
                self.range_bias, self.range_time,
            ]
        )  # fmt: skip
