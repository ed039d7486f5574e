"""What a base can do, what surrounds it, and what a local planner answers."""

from dataclasses import dataclass, field
from enum import Enum
from math import inf, isfinite, nan
from typing import Final, Protocol, final

import numpy as np

from outrider.data.surroundings import OPEN, Surroundings
from outrider.errors import ConfigError, DataError
from outrider.typing import Floats

NOWHERE: Final = np.empty((0, 2))
REST: Final = np.zeros(3)


class Steering(Enum):
    """Which motions a base can make."""

    DIFFERENTIAL = "differential"  # forward, backward, turning on the spot
    CAR = "car"  # no tighter than its smallest radius
    HOLONOMIC = "holonomic"  # any direction, whichever way it faces


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class DriveLimits:
    """Velocities and accelerations that a base may be asked for; body frame, forward-left-up.

    forward, backward, sideways : m/s;  turn : rad/s;  acceleration, deceleration : m/s^2;  turn_acceleration : rad/s^2,
    also for slowing down;  min_radius : m, of a car;  rims : (n, 3) rim speeds per u_x, u_y, w_z (see
    `WheelKinematics.inverse`), none of which exceeds rim_speed : m/s. Four mecanum wheels make of these the octahedron
    |u_x| + |u_y| + L |w_z| <= rim_speed, two wheels on an axle |u_x| + b |w_z| <= rim_speed.

    Raises ConfigError for limits with which the base could not move.
    """

    steering: Steering
    forward: float
    turn: float
    acceleration: float
    turn_acceleration: float
    backward: float = 0.0
    sideways: float = 0.0
    deceleration: float = 0.0  # 0: as `acceleration`
    min_radius: float = 0.0
    rims: Floats = field(default_factory=lambda: np.empty((0, 3)))
    rim_speed: float = np.inf
    _rows: list[list[float]] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.deceleration == 0.0:
            object.__setattr__(self, "deceleration", self.acceleration)
        must = ("forward", "turn", "acceleration", "turn_acceleration", "deceleration")
        extra = {Steering.CAR: ("min_radius",), Steering.HOLONOMIC: ("sideways",)}.get(self.steering, ())
        for name in must + extra:
            if not 0.0 < getattr(self, name) < np.inf:
                fix = "a positive number; a base that turns on the spot is not a car"
                raise ConfigError(f"{name} of {getattr(self, name):g}", where="drive limits", fix=fix)
        if not (0.0 <= self.backward < np.inf and 0.0 <= self.sideways < np.inf):
            raise ConfigError("backward or sideways below zero or not finite", where="drive limits", fix="0 or more")
        if self.sideways > 0.0 and self.steering is not Steering.HOLONOMIC:
            raise ConfigError(f"a {self.steering.value} base does not go sideways", where="drive limits", fix="0")
        if self.rims.ndim != 2 or self.rims.shape[1:] != (3,) or not np.isfinite(self.rims).all():
            raise ConfigError(f"rims of shape {self.rims.shape}", where="drive limits", fix="a row of three per wheel")
        if not self.rim_speed > 0.0:
            raise ConfigError(f"rim_speed of {self.rim_speed:g} m/s", where="drive limits", fix="a positive number")
        object.__setattr__(self, "_rows", self.rows.tolist())

    @property
    def rows(self) -> Floats:
        """(m, 5) the velocity set, low <= a u_x + b u_y + c w_z <= high: a, b, c, low, high, in shares of limits."""
        back = self.backward / self.forward
        out = [(1.0 / self.forward, 0.0, 0.0, -back, 1.0), (0.0, 0.0, 1.0 / self.turn, -1.0, 1.0)]
        if self.sideways > 0.0:
            out.append((0.0, 1.0 / self.sideways, 0.0, -1.0, 1.0))
        if np.isfinite(self.rim_speed):
            out += [(*(rim / self.rim_speed), -1.0, 1.0) for rim in self.rims]
        return np.array(out)

    @property
    def axes(self) -> Floats:
        """(3, 3) rows a with |a . du/dt| <= 1. A holonomic base gains nothing by accelerating at a slant."""
        a, w = 1.0 / self.acceleration, 1.0 / self.turn_acceleration
        if self.steering is Steering.HOLONOMIC:
            return np.array([[a, a, 0.0], [a, -a, 0.0], [0.0, 0.0, w]])
        return np.diag([a, a, w])

    def excess(self, twist: Floats) -> float:
        """The largest share of a limit that a twist (3,) asks for: at most 1 for one that is allowed."""
        x, y, w = twist.tolist()
        most = 0.0 if isfinite(x + y + w) else nan
        for a, b, c, low, high in self._rows:
            asked = a * x + b * y + c * w
            end = high if asked > 0.0 else -low
            most = max(most, abs(asked) / end if end > 0.0 else inf if abs(asked) > 1e-12 else 0.0)
        return most


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Situation:
    """What a local planner is asked.

    time : s, any origin;  pose : (3,) east, north [m], heading [rad];  twist : (3,) body frame, as it moves now;
    goal : (3,) pose to reach;  path : (n, 2) m, site frame, from a global planner, empty for the straight line;
    through : whether the goal is passed at speed, since the path goes on;  faces : whether the heading there matters.

    Raises DataError for a pose, twist or goal that is not finite.
    """

    time: float
    pose: Floats
    goal: Floats
    twist: Floats = field(default_factory=lambda: REST)
    path: Floats = field(default_factory=lambda: NOWHERE)
    surroundings: Surroundings = OPEN
    through: bool = False
    faces: bool = True

    def __post_init__(self) -> None:
        for name in ("pose", "twist", "goal"):
            value: Floats = getattr(self, name)
            if value.shape != (3,) or not np.isfinite(value).all():
                fix = "three finite numbers; without localisation a robot stops"
                raise DataError(f"{name} is {value.tolist()}", where="local planning", fix=fix)
        if self.path.ndim != 2 or self.path.shape[1:] != (2,) or not np.isfinite(self.path).all():
            raise DataError("the path is not finite rows of x, y", where="local planning", fix="plan it again")
        if not np.isfinite(self.time):
            raise DataError(f"the time is {self.time}", where="local planning")


class LocalOutcome(Enum):
    """What the robot is told to do, and why."""

    DRIVE = "the way is free"
    ARRIVED = "the robot stands at its goal"
    SLOW = "something is in the way further on: slower, to be able to stop before it"
    STOP = "something is in the way within the stopping distance: a controlled stop"
    GIVE_WAY = "somebody comes near: out of the way, or slower"
    BACK_OUT = "nothing leads on from here: backing out the way it came"
    REPLAN = "nothing leads on from here, and there is no room behind: plan another path, or move what is in the way"


@final
@dataclass(frozen=True, slots=True)
class Conflict:
    """Where a trajectory would touch something.

    knot : of the trajectory, the last before;  pose : (3,) there;  time : s from now;  obstacle : row in
    `Surroundings.discs`, -1 for a cell of the field;  at : (2,) m, site frame, the obstacle then.
    """

    knot: int
    pose: Floats
    time: float
    obstacle: int
    at: Floats

    def __str__(self) -> str:
        what = "an occupied cell" if self.obstacle < 0 else f"obstacle {self.obstacle}"
        where = f"({self.pose[0]:.2f}, {self.pose[1]:.2f}) in {self.time:.1f} s"
        return f"pose {self.knot} at {where} touches {what} at ({self.at[0]:.2f}, {self.at[1]:.2f})"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class LocalPlan:
    """What a local planner answers.

    twist : (3,) the command, body frame;  band : (n, 4) x, y, heading and time from now of the planned poses;
    clearance : m, smallest distance to anything along it, inf in the open;  conflict : what stops it;  blocked : how
    many answers in a row were not DRIVE;  classes : how many ways around things were compared;  switched : whether the
    robot now passes something on the other side;  iterations : of the optimisation.
    """

    outcome: LocalOutcome
    time: float
    twist: Floats
    band: Floats = field(default_factory=lambda: np.empty((0, 4)))
    clearance: float = np.inf
    conflict: Conflict | None = None
    blocked: int = 0
    classes: int = 1
    switched: bool = False
    iterations: int = 0
    explored: float = -np.inf  # s, when other ways were last looked for

    @property
    def reason(self) -> str:
        """One line for the user."""
        return self.outcome.value if self.conflict is None else f"{self.outcome.value} ({self.conflict})"

    @property
    def duration(self) -> float:
        """Time to the goal [s], 0 without a trajectory."""
        return float(self.band[-1, 3]) if len(self.band) else 0.0


class LocalPlanner(Protocol):
    """Turns a situation into a command, many times a second."""

    @property
    def limits(self) -> DriveLimits:
        """What the base that it commands can do."""
        ...

    def plan(self, now: Situation, last: LocalPlan | None = None) -> LocalPlan:
        """The answer; `last` is the one before, to start from. Every way to fail is an outcome."""
        ...
