"""Rigid rotorcraft of any layout: quad-, hexa-, octorotors."""

from dataclasses import dataclass, field
from math import cos, exp, isfinite, pi, sin
from typing import Final, Self, final

import numpy as np

from outrider._kernel import kernel
from outrider.errors import ConfigError
from outrider.models.vehicles.airborne import (
    FLYING,
    TOUCHING,
    UNPLACED,
    X_MODE,
    X_Q,
    X_V,
    in_world,
    place,
    settle,
    start_in_air,
    touches,
    write_row,
)
from outrider.models.vehicles.autopilot import T_DELAY, T_DIRECT, T_MAX, T_SPEED, X_INTEGRAL, fly_velocity
from outrider.models.vehicles.base import (
    ROW_SIZE,
    STANDARD_GRAVITY,
    delay_steps,
    delayed,
    require_not_negative,
    require_positive,
    require_slower,
    turn_over,
)
from outrider.models.vehicles.multirotor import AIR_INPUTS, velocity_command
from outrider.models.vehicles.rigid import X_ROTORS, rigid_step, spin_rotors, wrench
from outrider.typing import Floats


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Rotor:
    """A rotor that blows along body z, at (x, y) from the centre of mass."""

    x: float  # m
    y: float  # m
    spin: int  # +1 counter-clockwise seen from above, -1 clockwise
    thrust: float = 1.5e-5  # N per (rad/s)^2
    torque: float = 2.5e-7  # N m per (rad/s)^2


def ring(count: int, arm: float, *, first: float | None = None) -> tuple[Rotor, ...]:
    """Rotors of alternating spin on a circle, counter-clockwise from `first` [rad]: half a gap left of the nose."""
    start = pi / count if first is None else first
    angles = [start + 2.0 * pi * i / count for i in range(count)]
    return tuple(Rotor(x=arm * cos(a), y=arm * sin(a), spin=-1 if i % 2 else 1) for i, a in enumerate(angles))


QUAD: Final = ring(4, 0.25)


def mixer(rotors: tuple[Rotor, ...]) -> Floats:
    """(4, n) thrust and torque (3) per squared rotor speed."""
    rows = [(r.thrust, r.y * r.thrust, -r.x * r.thrust, -r.spin * r.torque) for r in rotors]
    return np.array(rows, np.float64).reshape(-1, 4).T


@kernel
def new_goals(x: Floats, u: Floats, k: int, theta: Floats, rotors: Floats) -> bool:
    """Goals of the rotors for the command that acts now; whether it wants to be in the air."""
    n, delay, top = rotors.shape[0], int(theta[T_DELAY]), theta[T_MAX]
    cursor = X_ROTORS + 2 * n
    if theta[T_DIRECT] > 0.0:
        for i in range(n):
            x[X_ROTORS + n + i] = min(max(delayed(x, cursor, delay, u, k, i), 0.0), top)
        turn_over(x, cursor, delay)
        return True
    s = T_SPEED
    command = velocity_command(x, cursor, delay, u, k, theta[s], theta[s + 1], theta[s + 2], theta[s + 3])
    if x[X_MODE] == FLYING or command[2] > 0.0:
        fly_velocity(x, command, theta, rotors)
        return True
    for i in range(3):
        x[X_INTEGRAL + i] = 0.0
    for i in range(n):
        x[X_ROTORS + n + i] = 0.0
    return False


@kernel
def lifts(x: Floats, theta: Floats, rotors: Floats) -> bool:
    """Whether the rotors, as they turn now, carry more than the weight."""
    return in_world(x, 0.0, 0.0, wrench(x, rotors, 1.0)[0])[2] > theta[1] * theta[2]


@kernel
def run_rotorcraft(
    x: Floats, u: Floats, air: Floats, ground: Floats, theta: Floats, rotors: Floats, out: Floats
) -> None:
    """Every row of u is one step. x = p, q, v, w, a, mode, integrals (3), speeds (n), goals (n), cursor, commands.

    theta as in `rigid` and `autopilot`;  rotors (n, 9) = x, y, spin, thrust and torque coefficient, M+ (4).
    """
    n, h = rotors.shape[0], theta[0]
    if x[X_MODE] == UNPLACED:
        place(x, ground)
        if x[X_MODE] == FLYING:
            hover(x, theta, rotors)
    for k in range(u.shape[0]):
        wants = new_goals(x, u, k, theta, rotors)
        if touches(x, ground):
            x[X_MODE] = TOUCHING
        elif wants and x[X_V + 2] > -0.05 and lifts(x, theta, rotors):
            x[X_MODE] = FLYING
        if x[X_MODE] == FLYING:
            rigid_step(x, (air[k, 0], air[k, 1], air[k, 2]), theta, rotors)
        else:
            settle(x, ground, h)
            spin_rotors(x, n, exp(-h / theta[9]))
        write_row(x, theta[1], out, k)
        for i in range(n):
            out[k, ROW_SIZE + i] = x[X_ROTORS + i]


@kernel
def hover(x: Floats, theta: Floats, rotors: Floats) -> None:
    """The rotors carry the weight."""
    n = rotors.shape[0]
    for i in range(n):
        x[X_ROTORS + i] = x[X_ROTORS + n + i] = (rotors[i, 5] * theta[1] * theta[2]) ** 0.5


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Rotorcraft:
    """A rigid body under rotors, flown by velocity commands v_east, v_north, v_up, yaw_rate or, `direct`, rotor speeds.

    The body origin is the centre of mass, its axes the principal ones. Raises ConfigError for rotors that cannot push,
    roll, pitch and yaw independently or cannot hover, and for impossible numbers.
    """

    rotors: tuple[Rotor, ...] = QUAD
    mass: float = 1.5  # kg
    inertia: tuple[float, float, float] = (0.03, 0.03, 0.05)  # kg m^2
    drag: tuple[float, float, float] = (0.2, 0.2, 0.3)  # kg/s along the body axes
    rotor_lag_s: float = 0.03
    min_speed: float = 100.0  # rad/s, in the air
    max_speed: float = 900.0  # rad/s
    direct: bool = False
    tau_s: float = 0.5  # of the velocity controller
    trim: float = 0.5  # 1/s^2, its integral gain
    acceleration: float = 5.0  # m/s^2, horizontal
    vertical_acceleration: float = 4.0  # m/s^2
    tilt_lag_s: float = 0.15
    tilt_rate: float = 4.0  # rad/s, commanded
    rate_lag_s: float = 0.06
    speed: float = 12.0  # m/s, horizontal
    climb: float = 4.0  # m/s
    sink: float = 2.0  # m/s
    yaw_rate: float = 1.5  # rad/s
    latency_s: float = 0.0
    radius: float = 0.4  # m, bounding cylinder
    height: float = 0.3
    step_s: float = 0.005
    gravity: float = STANDARD_GRAVITY
    _theta: Floats = field(init=False, repr=False, compare=False)
    _rotors: Floats = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        require_positive(self, mass=self.mass, radius=self.radius, height=self.height, max_speed=self.max_speed)
        require_positive(
            self, gravity=self.gravity, speed=self.speed, climb=self.climb, sink=self.sink, yaw_rate=self.yaw_rate
        )
        require_positive(self, acceleration=self.acceleration, vertical_acceleration=self.vertical_acceleration)
        require_positive(self, tilt_rate=self.tilt_rate, **dict(zip(("j_x", "j_y", "j_z"), self.inertia, strict=True)))
        require_not_negative(self, trim=self.trim, min_speed=self.min_speed)
        require_not_negative(self, **dict(zip(("drag_x", "drag_y", "drag_z"), self.drag, strict=True)))
        lags = {"tau_s": self.tau_s, "tilt_lag_s": self.tilt_lag_s, "rate_lag_s": self.rate_lag_s}
        require_slower(self, self.step_s, rotor_lag_s=self.rotor_lag_s, **lags)
        theta = (
            self.step_s, self.gravity, self.mass, *self.inertia, *self.drag, self.rotor_lag_s, self.min_speed,
            self.max_speed, self.tau_s, self.trim, self.acceleration, self.vertical_acceleration, self.tilt_lag_s,
            self.tilt_rate, self.rate_lag_s, self.speed, self.climb, self.sink, self.yaw_rate,
            delay_steps(self, self.latency_s, self.step_s), float(self.direct),
        )  # fmt: skip
        object.__setattr__(self, "_theta", np.array(theta, np.float64))
        object.__setattr__(self, "_rotors", self._table())

    def _table(self) -> Floats:
        """(n, 9) what kernels read of the rotors."""
        where = type(self).__name__
        for r in self.rotors:
            if r.spin not in (-1, 1) or not all(isfinite(a) for a in (r.x, r.y)) or not min(r.thrust, r.torque) > 0.0:
                raise ConfigError(f"{r} cannot work", where=where, fix="spin is +1 or -1, coefficients are positive")
        M = mixer(self.rotors)
        if np.linalg.matrix_rank(M / np.abs(M).max(axis=1, initial=1e-300, keepdims=True), tol=1e-6) < 4:
            fix = "four or more rotors around the centre of mass, of both spins"
            raise ConfigError("these rotors cannot push, roll, pitch and yaw independently", where=where, fix=fix)
        allocation = np.linalg.pinv(M)
        squares = allocation[:, 0] * self.mass * self.gravity
        if squares.min() < self.min_speed**2 or squares.max() >= self.max_speed**2:
            fix = f"hovering takes {np.sqrt(np.maximum(squares, 0.0)).round()} rad/s"
            raise ConfigError("these rotors cannot hover within their speeds", where=where, fix=fix)
        own = np.array([(r.x, r.y, r.spin, r.thrust, r.torque) for r in self.rotors], np.float64)
        return np.concatenate((own, allocation), axis=1, dtype=np.float64)

    @classmethod
    def hexarotor(cls) -> Self:
        """Six rotors on arms of 0.4 m, 3 kg."""
        return cls(rotors=ring(6, 0.4), mass=3.0, inertia=(0.09, 0.09, 0.16), drag=(0.3, 0.3, 0.5), radius=0.6)

    @property
    def inputs(self) -> tuple[str, ...]:
        return self.actuators if self.direct else AIR_INPUTS

    @property
    def actuators(self) -> tuple[str, ...]:
        return tuple(f"rotor_{i}" for i in range(len(self.rotors)))

    @property
    def width(self) -> int:
        return X_ROTORS + 2 * len(self.rotors) + 1 + int(self._theta[T_DELAY]) * len(self.inputs)

    def start(self, p: Floats, yaw: float) -> Floats:
        """At rest; within 2 cm of the ground, or below it, it stands there with still rotors, else it hovers."""
        return start_in_air(self.width, p, yaw)

    def launch(self, p: Floats, q: Floats, v: Floats) -> Floats:
        """In the air at p, q, v with rotors that carry it, for instance as it leaves a moving pad."""
        x = start_in_air(self.width, p, 0.0)
        x[X_Q : X_Q + 4], x[X_V : X_V + 3], x[X_MODE] = q, v, FLYING
        hover(x, self._theta, self._rotors)
        return x

    def run(self, x: Floats, u: Floats, air: Floats, ground: Floats, out: Floats) -> None:
        """See `Vehicle`."""
        run_rotorcraft(x, u, air, ground, self._theta, self._rotors, out)
