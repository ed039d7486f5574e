"""Ground vehicles with wheels that turn to the side: Ackermann steering in front, or both axles.

Each axle is seen as one wheel in its middle, at angle d_f and d_r; no wheel slides sideways, so with v the speed along
the body (u_x) and L the wheel base

    w = v (tan d_f - tan d_r) / L,    u_y = v tan d_r - x_r w        (x_r: the rear axle, negative behind the origin)

The left and right wheels of an axle stand so that all four turn about one point. Source: coop2024 (5).
"""

from dataclasses import dataclass, field
from math import atan, cos, pi, sqrt, tan
from typing import Final, final

import numpy as np

from outrider._kernel import kernel
from outrider.errors import ConfigError
from outrider.models.vehicles.base import (
    ROW_SIZE,
    STANDARD_GRAVITY,
    answer,
    delay_steps,
    delayed,
    limited,
    require_positive,
    require_slower,
    turn_over,
)
from outrider.models.vehicles.rolling import (
    GEARED,
    WHEEL_INPUTS,
    X_OWN,
    Drive,
    Motion,
    ride,
    slip_step,
    slipping,
    start_on_wheels,
)
from outrider.typing import Floats

X_SPEED: Final = X_OWN  # u_x and its rate
X_FRONT: Final = X_OWN + 2  # angle and its rate
X_REAR: Final = X_OWN + 4
X_CURSOR: Final = X_OWN + 6

_WHEELS: Final = ("front_left", "front_right", "rear_left", "rear_right")
_MOVES = 1e-6  # m/s, commanded; below it a yaw rate asks for no steering angle


@kernel
def curved(x: Floats, base: float, rear: float) -> Motion:
    """The motion of the body origin without slip."""
    v, a = x[X_SPEED], x[X_SPEED + 1]
    f, r, cos_f, cos_r = tan(x[X_FRONT]), tan(x[X_REAR]), cos(x[X_FRONT]), cos(x[X_REAR])
    f_dot, r_dot = x[X_FRONT + 1] / (cos_f * cos_f), x[X_REAR + 1] / (cos_r * cos_r)
    w, alpha = v * (f - r) / base, (a * (f - r) + v * (f_dot - r_dot)) / base
    return v, v * r - rear * w, w, a, a * r + v * r_dot - rear * alpha, alpha


@kernel
def steer_step(x: Floats, u: Floats, k: int, theta: Floats) -> None:
    """Speed and steering angles answer the command that acts now; a vehicle told to stand keeps its angles.

    Beyond the limit the tangents of both angles are scaled alike, so that turning and going sideways keep their shares.
    """
    h, base, rear, delay = theta[0], theta[6], theta[7], int(theta[12])
    a, b = delayed(x, X_CURSOR, delay, u, k, 0), delayed(x, X_CURSOR, delay, u, k, 1)
    c = delayed(x, X_CURSOR, delay, u, k, 2)
    turn_over(x, X_CURSOR, delay)
    front, back = x[X_FRONT], x[X_REAR]
    if abs(a) > _MOVES:
        f, r = (b + (base + rear) * c) / a, (b + rear * c) / a
        if theta[11] == 0.0:
            f, r = base * c / a, 0.0
        most, limit = max(abs(f), abs(r)), tan(theta[10])
        share = limit / most if most > limit else 1.0
        front, back = atan(f * share), atan(r * share)
    answer(x, X_SPEED, limited(a, theta[4]), theta[2], theta[3], h)
    answer(x, X_FRONT, front, theta[8], theta[9], h)
    answer(x, X_REAR, back, theta[8], theta[9], h)


@kernel
def write_wheels(x: Floats, theta: Floats, out: Floats, k: int) -> None:
    """Rim speeds of the four wheels, then the angles of those that steer."""
    base, rear, half = theta[6], theta[7], 0.5 * theta[13]
    ahead = tan(x[X_REAR])
    curvature = (tan(x[X_FRONT]) - ahead) / base
    sideways = ahead - rear * curvature
    for i in range(4):
        axle, side = base + rear if i < 2 else rear, half if i % 2 == 0 else -half
        along, across = 1.0 - curvature * side, sideways + curvature * axle
        out[k, ROW_SIZE + i] = x[X_SPEED] * sqrt(along * along + across * across)
        if ROW_SIZE + 4 + i < out.shape[1]:
            out[k, ROW_SIZE + 4 + i] = atan(across / along)


@kernel
def run_steered(x: Floats, u: Floats, ground: Floats, theta: Floats, out: Floats) -> None:
    """Every row of u is one step. x = p, yaw, slips (4), speed, front and rear angle with rates (6), cursor, commands.

    theta = step, gravity, lag, acceleration, top speed, lag of slip, wheel base, rear axle, lag of steering, its rate,
    its limit, both axles or not, delay, track.
    """
    h, base, rear = theta[0], theta[6], theta[7]
    for k in range(u.shape[0]):
        before = slipping(x, curved(x, base, rear), False)
        steer_step(x, u, k, theta)
        slip_step(x, ground, theta[5], h)
        ride(x, h, theta[1], ground, before, slipping(x, curved(x, base, rear), False), out, k)
        write_wheels(x, theta, out, k)


def axle_angle(left: Floats, right: Floats) -> Floats:
    """(...) rad: the angle of the wheel in the middle that the two of an axle stand for;  2 cot d = cot l + cot r."""
    a, b = np.tan(left), np.tan(right)
    total = np.where(a + b == 0.0, 1.0, a + b)
    return np.arctan(2.0 * a * b / total)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Steering:
    """The steering gear of one or both axles: first-order, limited in rate and angle (of the middle of an axle)."""

    limit: float = 0.6  # rad
    rate: float = 1.0  # rad/s
    lag_s: float = 0.1

    def __post_init__(self) -> None:
        require_positive(self, limit=self.limit, rate=self.rate, lag_s=self.lag_s)


STEERING: Final = Steering()


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Steered:
    """A car. Commands: v_x, v_y, w_z of the body origin; v_y is ignored unless both axles steer.

    One motor drives the wheels through differentials, so its speed goes with u_x. From a stop the wheels turn once a
    speed is commanded. Raises ConfigError where the inner wheel would have to turn about itself, and for impossible
    numbers.
    """

    wheel_base: float = 0.8  # m
    track: float = 0.6  # m
    rear: float = 0.0  # m, of the rear axle ahead of the body origin: negative when the origin lies between the axles
    both_axles: bool = False
    steering: Steering = STEERING
    drive: Drive = GEARED
    latency_s: float = 0.0
    grip_s: float = 0.1
    radius: float = 0.8  # m, bounding cylinder
    height: float = 0.8
    step_s: float = 0.005
    gravity: float = STANDARD_GRAVITY
    _theta: Floats = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        require_positive(self, wheel_base=self.wheel_base, track=self.track, radius=self.radius, height=self.height)
        lags = {"steering lag_s": self.steering.lag_s, "lag_s": self.drive.lag_s, "grip_s": self.grip_s}
        require_slower(self, self.step_s, **lags)
        limit = self.steering.limit
        if not (limit < 0.49 * pi and tan(limit) * self.track * (1.0 + self.both_axles) < 1.9 * self.wheel_base):
            fix = "a smaller steering limit or track, or a longer wheel base"
            raise ConfigError(f"a turn at {limit:g} rad would be about a wheel", where=type(self).__name__, fix=fix)
        theta = (
            self.step_s, self.gravity, self.drive.lag_s, self.drive.acceleration, self.drive.top_speed, self.grip_s,
            self.wheel_base, self.rear, self.steering.lag_s, self.steering.rate, limit, float(self.both_axles),
            delay_steps(self, self.latency_s, self.step_s), self.track,
        )  # fmt: skip
        object.__setattr__(self, "_theta", np.array(theta, np.float64))

    @property
    def inputs(self) -> tuple[str, ...]:
        return WHEEL_INPUTS

    @property
    def actuators(self) -> tuple[str, ...]:
        steered = _WHEELS if self.both_axles else _WHEELS[:2]
        return (*(f"wheel_{name}" for name in _WHEELS), *(f"steer_{name}" for name in steered))

    @property
    def width(self) -> int:
        return X_CURSOR + 1 + int(self._theta[12]) * len(WHEEL_INPUTS)

    def start(self, p: Floats, yaw: float) -> Floats:
        """At rest, wheels straight; z follows the ground from the first step on."""
        return start_on_wheels(self.width, p, yaw)

    def run(self, x: Floats, u: Floats, air: Floats, ground: Floats, out: Floats) -> None:
        """See `Vehicle`."""
        run_steered(x, u, ground, self._theta, out)
