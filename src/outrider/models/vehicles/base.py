"""What all vehicles share: the row they write, the checks of their parameters, the delay of their commands.

A row tells of the instant at the END of a step: p, v of the body origin (site frame), q = R_site_body, w and f the
body rate and the specific force at the body origin (body frame), then the actuators.

Accelerations are continuous: within a step they go linearly from one value to the next, so a command that jumps takes
effect over the step it is given in, and what a simulated IMU reads off the rows integrates back to the motion.
"""

from math import isfinite
from typing import Final, Protocol

import numpy as np

from outrider._kernel import kernel
from outrider.errors import ConfigError
from outrider.typing import Floats

ROW_P: Final = 0
ROW_Q: Final = 3
ROW_V: Final = 7
ROW_W: Final = 10
ROW_F: Final = 13
ROW_SIZE: Final = 16  # actuators follow

STANDARD_GRAVITY: Final = 9.80665  # m/s^2
STILL: Final = 1e-9  # what is closer than this to where it goes is there: things come to rest exactly
LEVEL: Final = np.zeros((1, 5))
"""The table of a level ground without slippery patches, see `outrider.models.vehicles.terrain`."""


class Vehicle(Protocol):
    """Anything that moves by commands. Parameters are frozen; the state is one array that the caller owns."""

    @property
    def step_s(self) -> float:
        """Integration step [s]."""
        ...

    @property
    def gravity(self) -> float:
        """[m/s^2], down."""
        ...

    @property
    def radius(self) -> float:
        """Of the bounding cylinder [m]."""
        ...

    @property
    def height(self) -> float:
        """Of the bounding cylinder [m]."""
        ...

    @property
    def width(self) -> int:
        """Size of the state."""
        ...

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the columns of a command."""
        ...

    @property
    def actuators(self) -> tuple[str, ...]:
        """Names of the actuator columns of a row."""
        ...

    def start(self, p: Floats, yaw: float) -> Floats:
        """The state (width,) at rest at p (3,) [m], heading yaw [rad]."""
        ...

    def run(self, x: Floats, u: Floats, air: Floats, ground: Floats, out: Floats) -> None:
        """Advance x in place by len(u) steps.

        u (n, len(inputs)) one command per step;  air (n, 3) wind [m/s], site frame;  ground (1 + m, 5), see `terrain`;
        out (n, 16 + len(actuators)) one row per step. Many steps at once and one by one give the same bits.
        """
        ...


def first_row(vehicle: Vehicle, x: Floats, ground: Floats = LEVEL) -> Floats:
    """The row (16 + len(actuators),) of a vehicle that rests in state x: what an idle step would write."""
    out = np.empty((1, ROW_SIZE + len(vehicle.actuators)))
    vehicle.run(x.copy(), np.zeros((1, len(vehicle.inputs))), np.zeros((1, 3)), ground, out)
    return out[0]


def require_positive(vehicle: object, **values: float) -> None:
    """Raise ConfigError for the first value that is not a positive number."""
    for name, value in values.items():
        if not (isfinite(value) and value > 0.0):
            raise ConfigError(f"{name} is {value}", where=type(vehicle).__name__, fix="it must be positive")


def require_not_negative(vehicle: object, **values: float) -> None:
    """Raise ConfigError for the first value that is negative or no number."""
    for name, value in values.items():
        if not (isfinite(value) and value >= 0.0):
            raise ConfigError(f"{name} is {value}", where=type(vehicle).__name__, fix="it must not be negative")


def require_slower(vehicle: object, step_s: float, **values: float) -> None:
    """Raise ConfigError for the first time constant [s] that a step cannot resolve."""
    require_positive(vehicle, step_s=step_s, **values)
    for name, value in values.items():
        if value < step_s:
            fix = f"at least the step, {step_s:g} s"
            raise ConfigError(f"{name} of {value:g} s is shorter than a step", where=type(vehicle).__name__, fix=fix)


def delay_steps(vehicle: object, latency_s: float, step_s: float) -> int:
    """How many steps a command waits; ConfigError unless the latency is a whole number of steps."""
    require_not_negative(vehicle, latency_s=latency_s)
    steps = round(latency_s / step_s)
    if abs(steps * step_s - latency_s) > 1e-6 * step_s:
        fix = f"a multiple of the step, {step_s:g} s"
        raise ConfigError(f"latency of {latency_s:g} s cannot be exact", where=type(vehicle).__name__, fix=fix)
    return steps


@kernel
def delayed(x: Floats, cursor: int, delay: int, u: Floats, k: int, i: int) -> float:
    """Column i of the command that acts in this step, once u[k] has been given; first column 0, `turn_over` last.

    x[cursor] points into the ring of the `delay` last commands, which follows it; before the first command: zeros.
    """
    now = float(u[k, i])
    if delay == 0:
        return now
    slot = cursor + 1 + int(x[cursor]) * u.shape[1] + i
    then = float(x[slot])
    x[slot] = now
    return then


@kernel
def turn_over(x: Floats, cursor: int, delay: int) -> None:
    """Move the ring of delayed commands on by one step."""
    x[cursor] = x[cursor] + 1.0 if x[cursor] + 1.5 < delay else 0.0


@kernel
def answer(x: Floats, i: int, goal: float, lag: float, limit: float, h: float) -> None:
    """One step of x[i], with its rate x[i + 1], by the trapezoidal rule:  x' = (goal - x) / lag,  |x'| <= limit."""
    rate = limited((goal - x[i] - 0.5 * h * x[i + 1]) / (lag + 0.5 * h), limit)
    x[i] += 0.5 * h * (x[i + 1] + rate)
    x[i + 1] = rate
    if abs(goal - x[i]) < STILL and abs(rate) < STILL:
        x[i], x[i + 1] = goal, 0.0


@kernel
def limited(value: float, limit: float) -> float:
    """value, within +-limit."""
    return min(max(value, -limit), limit)
