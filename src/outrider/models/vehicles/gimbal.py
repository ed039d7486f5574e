"""Gimbals: two or three motors between the body and a camera.

    R_body_camera = R_z(yaw) R_x(roll) R_y(pitch) R_mount

from the body outwards; a gimbal of two axes leaves out the roll. The camera looks along its x axis, y to its left, z
up; a positive pitch looks down, so (0, 0, pi/2) is the camera that looks at the ground.
"""

from dataclasses import dataclass, field
from math import asin, atan2, cos, exp, pi, sin
from typing import Final, final

import numpy as np

from outrider._kernel import kernel
from outrider.core.rotations import quats_to_matrices
from outrider.errors import ConfigError
from outrider.models.vehicles.base import require_positive, require_slower
from outrider.typing import Floats

GIMBAL_AXES: Final = ("yaw", "roll", "pitch")
_STRAIGHT: Final = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


@kernel
def run_gimbal(x: Floats, u: Floats, theta: Floats, out: Floats) -> None:
    """Every row of u (n, 3) is one step of angles commanded; x (3,) angles, out (n, 3) angles at the end of a step.

    theta (9,) = step, lag, rate, then lower (3) and upper limit (3) [rad]. The way to the goal shrinks by exp(-h/lag)
    or by h rate, whichever is less.
    """
    h = theta[0]
    for k in range(u.shape[0]):
        for i in range(3):
            goal = min(max(u[k, i], theta[3 + i]), theta[6 + i])
            step = (goal - x[i]) * (1.0 - exp(-h / theta[1]))
            x[i] += min(max(step, -h * theta[2]), h * theta[2])
            out[k, i] = x[i]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Gimbal:
    """Angles (yaw, roll, pitch) [rad] that follow commands with a lag, limited in rate and range.

    An axis whose range is (0, 0) is missing. Raises ConfigError for ranges that do not contain zero.
    """

    yaw: tuple[float, float] = (-pi, pi)  # rad, least and greatest
    roll: tuple[float, float] = (-0.7, 0.7)
    pitch: tuple[float, float] = (-0.5, 0.5 * pi)
    rate: float = 2.0  # rad/s
    lag_s: float = 0.05
    mount: tuple[float, ...] = _STRAIGHT  # R_mount, row-major: how the camera sits on the innermost axis
    step_s: float = 0.005
    _theta: Floats = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        require_positive(self, rate=self.rate)
        require_slower(self, self.step_s, lag_s=self.lag_s)
        ranges = (self.yaw, self.roll, self.pitch)
        for name, (low, high) in zip(GIMBAL_AXES, ranges, strict=True):
            if not -2.0 * pi <= low <= 0.0 <= high <= 2.0 * pi:
                fix = "least and greatest angle in radians, zero between them"
                raise ConfigError(f"range of {name} is {low:g} to {high:g}", where=type(self).__name__, fix=fix)
        R = np.array(self.mount, np.float64)
        if R.size != 9 or np.abs(R.reshape(3, 3) @ R.reshape(3, 3).T - np.eye(3)).max() > 1e-4:
            raise ConfigError("mount is no rotation", where=type(self).__name__, fix="nine numbers, row-major")
        limits = [*(low for low, _ in ranges), *(high for _, high in ranges)]
        object.__setattr__(self, "_theta", np.array([self.step_s, self.lag_s, self.rate, *limits]))

    @classmethod
    def two_axes(cls) -> "Gimbal":
        """Yaw and pitch only: the horizon tilts with the body."""
        return cls(roll=(0.0, 0.0))

    def start(self) -> Floats:
        """Angles (3,) straight ahead."""
        return np.zeros(3)

    def run(self, x: Floats, u: Floats, out: Floats) -> None:
        """Advance the angles x (3,) in place by len(u) steps;  u, out (n, 3). Pieces give the bits of the whole."""
        run_gimbal(x, u, self._theta, out)

    def camera(self, angles: Floats) -> Floats:
        """R_body_camera (..., 3, 3) of angles (..., 3)."""
        yaw, roll, pitch = np.moveaxis(np.asarray(angles, np.float64), -1, 0)
        z, x, y = np.zeros((*yaw.shape, 4)), np.zeros((*yaw.shape, 4)), np.zeros((*yaw.shape, 4))
        z[..., 2], z[..., 3] = np.sin(0.5 * yaw), np.cos(0.5 * yaw)
        x[..., 0], x[..., 3] = np.sin(0.5 * roll), np.cos(0.5 * roll)
        y[..., 1], y[..., 3] = np.sin(0.5 * pitch), np.cos(0.5 * pitch)
        turned = quats_to_matrices(z) @ quats_to_matrices(x) @ quats_to_matrices(y)
        return np.asarray(turned @ np.array(self.mount).reshape(3, 3), np.float64)


def point(direction: Floats) -> Floats:
    """Angles (3,), without roll, that look along a direction (3,) of the body;  straight up or down: yaw zero."""
    x, y, z = (float(a) for a in direction)
    flat = float(np.hypot(x, y))
    return np.array([atan2(y, x) if flat > 0.0 else 0.0, 0.0, atan2(-z, flat)])


def stabilize(q: Floats, heading: float, down: float) -> Floats:
    """Angles (3,) that hold the camera's heading and downward angle [rad] level in the site frame, on a body at q (4,).

    R_body_camera = R' R_z(heading) R_y(down) = R_z(yaw) R_x(roll) R_y(pitch), solved exactly for |roll| < pi/2.
    """
    ch, sh, cd, sd = cos(heading), sin(heading), cos(down), sin(down)
    M = quats_to_matrices(q).T @ np.array([[ch * cd, -sh, ch * sd], [sh * cd, ch, sh * sd], [-sd, 0.0, cd]])
    return np.array([atan2(-M[0, 1], M[1, 1]), asin(min(max(M[2, 1], -1.0), 1.0)), atan2(-M[2, 0], M[2, 2])])
