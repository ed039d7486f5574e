"""A multirotor with an autopilot that flies commanded velocities, seen from outside: a first-order response.

The path is that of `outrider.models.motion.follower`, v' = (u - v) / tau, within limits and pushed by the wind; body
z follows the thrust that such a path needs.
"""

from dataclasses import dataclass, field
from math import exp, hypot
from typing import Final, final

import numpy as np

from outrider._kernel import kernel
from outrider.models.vehicles.airborne import (
    FLYING,
    TOUCHING,
    UNPLACED,
    X_A,
    X_MODE,
    X_OWN,
    X_Q,
    X_V,
    glide,
    in_body,
    lean_towards,
    place,
    settle,
    spin,
    start_in_air,
    touches,
    write_row,
)
from outrider.models.vehicles.base import (
    STANDARD_GRAVITY,
    delay_steps,
    delayed,
    limited,
    require_not_negative,
    require_positive,
    require_slower,
    turn_over,
)
from outrider.typing import Floats

AIR_INPUTS: Final = ("v_east", "v_north", "v_up", "yaw_rate")
CLIMB: Final = AIR_INPUTS.index("v_up")
X_YAW_RATE: Final = X_OWN
X_CURSOR: Final = X_OWN + 1

Quadruple = tuple[float, float, float, float]


@kernel
def velocity_command(
    x: Floats, cursor: int, delay: int, u: Floats, k: int, speed: float, climb: float, sink: float, yaw: float
) -> Quadruple:
    """(v_east, v_north, v_up, yaw rate) that act now, within their limits; the horizontal direction is kept."""
    a, b = delayed(x, cursor, delay, u, k, 0), delayed(x, cursor, delay, u, k, 1)
    c, d = delayed(x, cursor, delay, u, k, 2), delayed(x, cursor, delay, u, k, 3)
    turn_over(x, cursor, delay)
    fast = hypot(a, b)
    scale = speed / fast if fast > speed else 1.0
    return a * scale, b * scale, min(max(c, -sink), climb), limited(d, yaw)


@kernel
def fly_step(x: Floats, u: Quadruple, air: Floats, k: int, theta: Floats) -> None:
    """One step in the air under the command u: v' = (u - v) / tau within limits + drag wind, trapezoidal."""
    h, gravity, drag = theta[0], theta[1], theta[3]
    scale = 1.0 / (theta[2] + 0.5 * h)
    ax = (u[0] - x[X_V] - 0.5 * h * x[X_A]) * scale
    ay = (u[1] - x[X_V + 1] - 0.5 * h * x[X_A + 1]) * scale
    az = limited((u[2] - x[X_V + 2] - 0.5 * h * x[X_A + 2]) * scale, theta[5])
    hard = hypot(ax, ay)
    level = theta[4] / hard if hard > theta[4] else 1.0
    east, north, up = drag * air[k, 0], drag * air[k, 1], drag * air[k, 2]
    lift = (  # the thrust that this takes, per mass
        x[X_A] + drag * x[X_V] - east,
        x[X_A + 1] + drag * x[X_V + 1] - north,
        x[X_A + 2] + drag * x[X_V + 2] - up + gravity,
    )
    phi_x, phi_y = lean_towards(x, lift[0], lift[1], lift[2])
    quick = hypot(phi_x, phi_y) / theta[7]
    pace = (theta[8] / quick if quick > theta[8] else 1.0) / theta[7]
    x[X_YAW_RATE] += (u[3] - x[X_YAW_RATE]) * (1.0 - exp(-h / theta[6]))
    wx, wy, wz = in_body(x, 0.0, 0.0, x[X_YAW_RATE])
    spin(x, wx + phi_x * pace, wy + phi_y * pace, wz, h)
    push = theta[2] * scale  # implicit in the wind, too
    glide(x, 0, ax * level + east * push, h)
    glide(x, 1, ay * level + north * push, h)
    glide(x, 2, az + up * push, h)


@kernel
def run_multirotor(x: Floats, u: Floats, air: Floats, ground: Floats, theta: Floats, out: Floats) -> None:
    """Every row of u is one step. x = p, q, v, w, a, mode, yaw rate, cursor, delayed commands.

    theta = step, gravity, tau, drag, acceleration, vertical acceleration, lag of yaw, lag of tilt, tilt rate,
    speed, climb, sink, yaw rate, delay.
    """
    delay = int(theta[13])
    if x[X_MODE] == UNPLACED:
        place(x, ground)
    for k in range(u.shape[0]):
        command = velocity_command(x, X_CURSOR, delay, u, k, theta[9], theta[10], theta[11], theta[12])
        if touches(x, ground):
            x[X_MODE], x[X_YAW_RATE] = TOUCHING, 0.0
        elif command[2] > 0.0:
            x[X_MODE] = FLYING
        if x[X_MODE] == FLYING:
            fly_step(x, command, air, k, theta)
        else:
            settle(x, ground, theta[0])
        write_row(x, theta[1], out, k)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Multirotor:
    """First-order response to velocity commands in the site frame: v_east, v_north, v_up, yaw_rate.

    v' = (u - v) / tau_s + drag wind. The autopilot makes good the drag in still air, the wind it feels as a
    disturbance. On the ground it stays until it is told to climb. Raises ConfigError for impossible numbers.
    """

    tau_s: float = 0.5  # velocity response
    acceleration: float = 5.0  # m/s^2, horizontal
    vertical_acceleration: float = 4.0  # m/s^2, less than gravity
    speed: float = 12.0  # m/s, horizontal
    climb: float = 4.0  # m/s
    sink: float = 2.0  # m/s
    yaw_rate: float = 1.5  # rad/s
    yaw_lag_s: float = 0.2
    tilt_lag_s: float = 0.08
    tilt_rate: float = 4.0  # rad/s
    drag: float = 0.1  # 1/s, m/s^2 per m/s of wind
    latency_s: float = 0.0
    radius: float = 0.4  # m, bounding cylinder
    height: float = 0.3
    step_s: float = 0.005
    gravity: float = STANDARD_GRAVITY
    _theta: Floats = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        require_slower(self, self.step_s, tau_s=self.tau_s, yaw_lag_s=self.yaw_lag_s, tilt_lag_s=self.tilt_lag_s)
        require_positive(self, acceleration=self.acceleration, speed=self.speed, climb=self.climb, sink=self.sink)
        require_positive(self, yaw_rate=self.yaw_rate, tilt_rate=self.tilt_rate, radius=self.radius, height=self.height)
        require_positive(self, gravity=self.gravity, vertical_acceleration=self.vertical_acceleration)
        require_positive(self, thrust_left_when_sinking=self.gravity - self.vertical_acceleration)
        require_not_negative(self, drag=self.drag)
        theta = (
            self.step_s, self.gravity, self.tau_s, self.drag, self.acceleration, self.vertical_acceleration,
            self.yaw_lag_s, self.tilt_lag_s, self.tilt_rate, self.speed, self.climb, self.sink, self.yaw_rate,
            delay_steps(self, self.latency_s, self.step_s),
        )  # fmt: skip
        object.__setattr__(self, "_theta", np.array(theta, np.float64))

    @property
    def inputs(self) -> tuple[str, ...]:
        return AIR_INPUTS

    @property
    def actuators(self) -> tuple[str, ...]:
        return ()

    @property
    def width(self) -> int:
        return X_CURSOR + 1 + int(self._theta[13]) * len(AIR_INPUTS)

    def start(self, p: Floats, yaw: float) -> Floats:
        """At rest; within 2 cm of the ground, or below it, it stands on the ground, else it hovers."""
        return start_in_air(self.width, p, yaw)

    def launch(self, p: Floats, q: Floats, v: Floats) -> Floats:
        """In the air at p, q, v, for instance as it leaves a moving pad."""
        x = start_in_air(self.width, p, 0.0)
        x[X_Q : X_Q + 4], x[X_V : X_V + 3], x[X_MODE] = q, v, FLYING
        return x

    def run(self, x: Floats, u: Floats, air: Floats, ground: Floats, out: Floats) -> None:
        """See `Vehicle`."""
        run_multirotor(x, u, air, ground, self._theta, out)
