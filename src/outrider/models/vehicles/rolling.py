"""The part that all ground vehicles share: drives, slip, and a twist integrated on the inclined plane.

Pose and yaw come from the twist (u_x, u_y, w) at both ends of a step by the corrected trapezoidal rule,
int f = h/2 (f0 + f1) + h^2/12 (f0' - f1'), exact for a rate that is linear in time.
"""

from dataclasses import dataclass
from math import cos, pi, sin
from typing import Final, final

import numpy as np

from outrider._kernel import kernel
from outrider.models.vehicles.base import ROW_F, ROW_Q, ROW_V, ROW_W, answer, require_positive
from outrider.models.vehicles.terrain import height_at, plane_quat, slip_at
from outrider.typing import Floats

# The first components of the state; yaw turns about the ground's normal.
X_P: Final = 0
X_YAW: Final = 3
X_SLIP: Final = 4  # longitudinal and its rate, lateral and its rate
X_OWN: Final = 8

WHEEL_INPUTS: Final = ("v_x", "v_y", "w_z")

Motion = tuple[float, float, float, float, float, float]  # u_x, u_y, w and their rates


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """A wheel on a motor whose speed answers with a first-order lag."""

    wheel_radius: float = 0.1  # m
    gear: float = 20.0  # turns of the motor per turn of the wheel
    max_rpm: float = 4000.0  # r/min of the motor
    lag_s: float = 0.1
    acceleration: float = 2.0  # m/s^2 at the rim

    def __post_init__(self) -> None:
        require_positive(self, wheel_radius=self.wheel_radius, gear=self.gear, max_rpm=self.max_rpm)
        require_positive(self, lag_s=self.lag_s, acceleration=self.acceleration)

    @property
    def top_speed(self) -> float:
        """Rim speed at `max_rpm` [m/s]."""
        return self.max_rpm * pi / 30.0 / self.gear * self.wheel_radius


GEARED: Final = Drive()


def start_on_wheels(width: int, p: Floats, yaw: float) -> Floats:
    """A state of zeros but for the pose."""
    x = np.zeros(width)
    x[X_P : X_P + 3], x[X_YAW] = p, yaw
    return x


@kernel
def slip_step(x: Floats, ground: Floats, lag: float, h: float) -> None:
    """Longitudinal and lateral slip follow the patch with a lag: a velocity that jumped would be an infinite force."""
    goal_x, goal_y = slip_at(ground, x[X_P], x[X_P + 1])
    answer(x, X_SLIP, goal_x, lag, np.inf, h)
    answer(x, X_SLIP + 2, goal_y, lag, np.inf, h)


@kernel
def slipping(x: Floats, m: Motion, omni: bool) -> Motion:
    """What is left of the motion m where the ground slips: longitudinally by a, laterally by b.

    Rollers carry sideways motion themselves: u_x (1 - a), u_y (1 - b), w (1 - a). Without rollers sideways motion comes
    of turning, and lateral slip is understeer: u_x (1 - a); u_y and w (1 - a) (1 - b).
    """
    ux, uy, w, ax, ay, alpha = m
    f, f_dot, g, g_dot = 1.0 - x[X_SLIP], -x[X_SLIP + 1], 1.0 - x[X_SLIP + 2], -x[X_SLIP + 3]
    if omni:
        return f * ux, g * uy, f * w, f * ax + f_dot * ux, g * ay + g_dot * uy, f * alpha + f_dot * w
    g, g_dot = f * g, f_dot * g + f * g_dot
    return f * ux, g * uy, g * w, f * ax + f_dot * ux, g * ay + g_dot * uy, g * alpha + g_dot * w


@kernel
def in_plane(yaw: float, m: Motion) -> Motion:
    """(sin, cos of yaw, v_1, v_2, a_1, a_2): velocity and acceleration in the axes of the plane."""
    ux, uy, w, ax, ay, _ = m
    s, c = sin(yaw), cos(yaw)
    ax, ay = ax - w * uy, ay + w * ux
    return s, c, c * ux - s * uy, s * ux + c * uy, c * ax - s * ay, s * ax + c * ay


@kernel
def ride(
    x: Floats, h: float, gravity: float, ground: Floats, before: Motion, after: Motion, out: Floats, k: int
) -> None:
    """Advance position and yaw by a step between two motions, and write all of row k but the actuators."""
    yaw = x[X_YAW] + 0.5 * h * (before[2] + after[2]) + h * h / 12.0 * (before[5] - after[5])
    _, _, v0, w0, a0, b0 = in_plane(x[X_YAW], before)
    s, c, v1, w1, a1, b1 = in_plane(yaw, after)
    x[X_YAW] = yaw
    d1 = 0.5 * h * (v0 + v1) + h * h / 12.0 * (a0 - a1)
    d2 = 0.5 * h * (w0 + w1) + h * h / 12.0 * (b0 - b1)

    qx, qy, qw = plane_quat(ground)  # the columns of its matrix: (xx, xy, xz), (xy, yy, yz)
    xx, yy, xy = 1.0 - 2.0 * qy * qy, 1.0 - 2.0 * qx * qx, 2.0 * qx * qy
    xz, yz = -2.0 * qw * qy, 2.0 * qw * qx
    x[X_P] += xx * d1 + xy * d2
    x[X_P + 1] += xy * d1 + yy * d2
    x[X_P + 2] = height_at(ground, x[X_P], x[X_P + 1])
    for i in range(3):
        out[k, i] = x[X_P + i]
    half_s, half_c = sin(0.5 * yaw), cos(0.5 * yaw)
    out[k, ROW_Q], out[k, ROW_Q + 1] = qx * half_c + qy * half_s, qy * half_c - qx * half_s
    out[k, ROW_Q + 2], out[k, ROW_Q + 3] = qw * half_s, qw * half_c
    out[k, ROW_V], out[k, ROW_V + 1], out[k, ROW_V + 2] = xx * v1 + xy * w1, xy * v1 + yy * w1, xz * v1 + yz * w1
    out[k, ROW_W], out[k, ROW_W + 1], out[k, ROW_W + 2] = 0.0, 0.0, after[2]
    f1, f2 = a1 + gravity * xz, b1 + gravity * yz
    out[k, ROW_F], out[k, ROW_F + 1] = c * f1 + s * f2, c * f2 - s * f1
    out[k, ROW_F + 2] = gravity * (1.0 - 2.0 * (qx * qx + qy * qy))
