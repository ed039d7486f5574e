"""Ground vehicles that steer with the speeds of their wheels: mecanum (or omni) and differential."""

from dataclasses import dataclass, field
from typing import Final, final

import numpy as np

from outrider._kernel import kernel
from outrider.models.vehicles.base import (
    ROW_SIZE,
    STANDARD_GRAVITY,
    STILL,
    delay_steps,
    delayed,
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
from outrider.models.wheels import WheelKinematics, mecanum_rectangle
from outrider.typing import Floats

X_TWIST: Final = X_OWN
X_RATE: Final = X_OWN + 3
X_CURSOR: Final = X_OWN + 6


@kernel
def fastest_rim(inverse: Floats, a: float, b: float, c: float) -> float:
    """max |J (a, b, c)|."""
    most = 0.0
    for i in range(inverse.shape[0]):
        most = max(most, abs(inverse[i, 0] * a + inverse[i, 1] * b + inverse[i, 2] * c))
    return most


@kernel
def twist_step(x: Floats, u: Floats, k: int, theta: Floats, inverse: Floats) -> None:
    """T' = (u - T) / lag for the twist T that the wheels roll, trapezoidal.

    A command that some wheel cannot turn fast enough for, and a change it cannot follow, are scaled down as a whole:
    the direction is kept and the wheels never work against each other.
    """
    h, lag, limit, top, delay = theta[0], theta[2], theta[3], theta[4], int(theta[8])
    a, b = delayed(x, X_CURSOR, delay, u, k, 0), delayed(x, X_CURSOR, delay, u, k, 1)
    c = delayed(x, X_CURSOR, delay, u, k, 2)
    turn_over(x, X_CURSOR, delay)
    fast = fastest_rim(inverse, a, b, c)
    share = top / fast if fast > top else 1.0
    scale = 1.0 / (lag + 0.5 * h)
    a = (a * share - x[X_TWIST] - 0.5 * h * x[X_RATE]) * scale
    b = (b * share - x[X_TWIST + 1] - 0.5 * h * x[X_RATE + 1]) * scale
    c = (c * share - x[X_TWIST + 2] - 0.5 * h * x[X_RATE + 2]) * scale
    hard = fastest_rim(inverse, a, b, c)
    share = limit / hard if hard > limit else 1.0 if hard > STILL else 0.0
    for i, rate in enumerate((a, b, c)):
        x[X_TWIST + i] += 0.5 * h * (x[X_RATE + i] + rate * share)
        x[X_RATE + i] = rate * share


@kernel
def rolled(x: Floats, omni: bool, axle: float) -> Motion:
    """The motion of the body origin, slip included; without rollers the axle, so far ahead, goes straight."""
    ux, uy, w = x[X_TWIST], x[X_TWIST + 1], x[X_TWIST + 2]
    ax, ay, alpha = x[X_RATE], x[X_RATE + 1], x[X_RATE + 2]
    if not omni:
        uy, ay = -axle * w, -axle * alpha
    return slipping(x, (ux, uy, w, ax, ay, alpha), omni)


@kernel
def run_wheeled(x: Floats, u: Floats, ground: Floats, theta: Floats, inverse: Floats, out: Floats) -> None:
    """Every row of u is one step. x = p, yaw, slips and rates (4), twist (3), its rate (3), cursor, delayed commands.

    theta = step, gravity, lag, acceleration, top speed, lag of slip, rollers or not, axle, delay;  inverse J (n, 3).
    """
    h, omni, axle = theta[0], theta[6] > 0.0, theta[7]
    for k in range(u.shape[0]):
        before = rolled(x, omni, axle)
        twist_step(x, u, k, theta, inverse)
        slip_step(x, ground, theta[5], h)
        ride(x, h, theta[1], ground, before, rolled(x, omni, axle), out, k)
        for i in range(inverse.shape[0]):
            rim = inverse[i, 0] * x[X_TWIST] + inverse[i, 1] * x[X_TWIST + 1] + inverse[i, 2] * x[X_TWIST + 2]
            out[k, ROW_SIZE + i] = rim


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Mecanum:
    """A base on any number of mecanum (roller angle 0: omni) wheels, each on its own motor. Commands: v_x, v_y, w_z.

    A command beyond the motors' speed, and an acceleration beyond theirs, is scaled down as a whole.
    Raises ConfigError for wheels without full rank and for impossible numbers.
    """

    wheels: tuple[tuple[float, float, float], ...] = mecanum_rectangle(0.4, 0.3)  # x m, y m, roller angle rad
    drive: Drive = GEARED
    latency_s: float = 0.0
    grip_s: float = 0.1  # how fast slip follows the ground
    radius: float = 0.6  # m, bounding cylinder
    height: float = 0.5
    step_s: float = 0.005
    gravity: float = STANDARD_GRAVITY
    kinematics: WheelKinematics = field(init=False, repr=False, compare=False)
    _theta: Floats = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "kinematics", WheelKinematics(self.wheels))
        object.__setattr__(self, "_theta", _theta_of(self, omni=True))

    @property
    def inputs(self) -> tuple[str, ...]:
        return WHEEL_INPUTS

    @property
    def actuators(self) -> tuple[str, ...]:
        return tuple(f"wheel_{i}" for i in range(len(self.wheels)))

    @property
    def width(self) -> int:
        return _width_of(self._theta)

    def start(self, p: Floats, yaw: float) -> Floats:
        """At rest; z follows the ground from the first step on."""
        return start_on_wheels(self.width, p, yaw)

    def run(self, x: Floats, u: Floats, air: Floats, ground: Floats, out: Floats) -> None:
        """See `Vehicle`."""
        run_wheeled(x, u, ground, self._theta, self.kinematics.inverse, out)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Differential:
    """Two driven wheels on one axle, or skid steering with its effective track. Commands: v_x, (v_y ignored), w_z."""

    track: float = 0.5  # m
    axle: float = 0.0  # m, the axle lies so far ahead of the body origin
    drive: Drive = GEARED
    latency_s: float = 0.0
    grip_s: float = 0.1
    radius: float = 0.5  # m, bounding cylinder
    height: float = 0.5
    step_s: float = 0.005
    gravity: float = STANDARD_GRAVITY
    inverse: Floats = field(init=False, repr=False, compare=False)  # (2, 3) rim speeds, left and right, per twist
    _theta: Floats = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        require_positive(self, track=self.track)
        half = 0.5 * self.track
        object.__setattr__(self, "inverse", np.array([[1.0, 0.0, -half], [1.0, 0.0, half]]))
        object.__setattr__(self, "_theta", _theta_of(self, omni=False, axle=self.axle))

    @property
    def inputs(self) -> tuple[str, ...]:
        return WHEEL_INPUTS

    @property
    def actuators(self) -> tuple[str, ...]:
        return "wheel_left", "wheel_right"

    @property
    def width(self) -> int:
        return _width_of(self._theta)

    def start(self, p: Floats, yaw: float) -> Floats:
        """At rest; z follows the ground from the first step on."""
        return start_on_wheels(self.width, p, yaw)

    def run(self, x: Floats, u: Floats, air: Floats, ground: Floats, out: Floats) -> None:
        """See `Vehicle`."""
        run_wheeled(x, u, ground, self._theta, self.inverse, out)


def _theta_of(vehicle: Mecanum | Differential, *, omni: bool, axle: float = 0.0) -> Floats:
    drive = vehicle.drive
    require_slower(vehicle, vehicle.step_s, lag_s=drive.lag_s, grip_s=vehicle.grip_s)
    require_positive(vehicle, radius=vehicle.radius, height=vehicle.height)
    delay = delay_steps(vehicle, vehicle.latency_s, vehicle.step_s)
    limits = (drive.lag_s, drive.acceleration, drive.top_speed, vehicle.grip_s)
    return np.array([vehicle.step_s, vehicle.gravity, *limits, float(omni), axle, delay])


def _width_of(theta: Floats) -> int:
    return X_CURSOR + 1 + int(theta[8]) * len(WHEEL_INPUTS)
