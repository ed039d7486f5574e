"""Discrete steps of a drone that answers velocity commands: the exact lag, and the two readings of swarm2023's model.

Every variant is, axis by axis, the same affine step of position p, velocity over ground v and wind w,

    p <- p + reach v + drift (u + w),    v <- keep v + gain (u + w),    w <- w,

so one filter serves all. A step is a table c (3, STEP) of numbers: an axis per row, noise covariances included.
"""

from dataclasses import dataclass
from enum import Enum
from math import expm1
from typing import Final, final

import numpy as np

from outrider._kernel import kernel
from outrider.data import StateLayout
from outrider.errors import ConfigError
from outrider.typing import Floats

STILL_AIR: Final = StateLayout(("position", 3, "m"), ("velocity", 3, "m/s"))
WINDY: Final = StateLayout(("position", 3, "m"), ("velocity", 3, "m/s"), ("wind", 3, "m/s"))
REACH, KEEP, DRIFT, GAIN, Q_PP, Q_PV, Q_VV, Q_PW, Q_VW, Q_WW, TURN = range(11)
STEP: Final = 11  # numbers that describe one axis of a step
THETA: Final = 10  # parameters of the lag model
CONSTANT_VELOCITY: Final = 1e12  # s, a lag that no flight is long enough to notice
_NODES = (
    0.019855071751231884, 0.10166676129318664, 0.2372337950418355, 0.4082826787521751,
    0.5917173212478249, 0.7627662049581645, 0.8983332387068134, 0.9801449282487681,
)  # fmt: skip
_WEIGHTS = (
    0.05061426814518813, 0.11119051722668724, 0.15685332293894363, 0.18134189168918100,
    0.18134189168918100, 0.15685332293894363, 0.11119051722668724, 0.05061426814518813,
)  # fmt: skip


@kernel
def lag_step(dt: float, theta: Floats, c: Floats) -> None:
    """c (3, STEP) <- the exact step over dt [s] of  v' = (u + w - v) / tau + white,  p' = v,  w' = white.

    theta (THETA,) = tau, then white acceleration [m/s^2 per sqrt(Hz)], then wind's random walk [m/s per sqrt(s)], all
    for x, y, z, then the factor by which acceleration across a horizontal course is stronger than along it, less one.
    Noise is integrated by Gauss's rule of 16th order on pieces not longer than tau: exact to rounding up to 1000 tau,
    where the obvious closed forms lose digits for steps much shorter than tau.
    """
    for i in range(3):
        tau, a2, w2 = theta[i], theta[3 + i] * theta[3 + i], theta[6 + i] * theta[6 + i]
        gone = -expm1(-dt / tau)
        for j in range(11):
            c[i, j] = 0.0
        c[i, 0], c[i, 1], c[i, 2], c[i, 3] = tau * gone, 1.0 - gone, dt - tau * gone, gone
        pieces = min(1 + int(dt / tau), 1000)
        h = dt / pieces
        for piece in range(pieces):
            for k in range(8):
                s, weight = (piece + _NODES[k]) * h, _WEIGHTS[k] * h
                e = -expm1(-s / tau)
                p, q = tau * e, s - tau * e  # what a unit of velocity and of wind does to the position after s
                c[i, 4] += weight * (a2 * p * p + w2 * q * q)
                c[i, 5] += weight * (a2 * p * (1.0 - e) + w2 * q * e)
                c[i, 6] += weight * (a2 * (1.0 - e) * (1.0 - e) + w2 * e * e)
                c[i, 7] += weight * w2 * q
                c[i, 8] += weight * w2 * e
        c[i, 9], c[i, 10] = w2 * dt, theta[9]


def literal_step(dt: float, q: Floats) -> Floats:
    """c (3, STEP) of  p <- p + v dt,  v <- v + u  with noise variances q (6,) a step: swarm2023 section 3.1 as printed.

    Its input is called a velocity and added to the velocity: ten steps of 2 m/s end at 20 m/s. Fed with the *change*
    of the commanded velocity instead it is the variant `increment`.
    """
    c = np.zeros((3, STEP))
    c[:, REACH], c[:, KEEP], c[:, GAIN] = dt, 1.0, 1.0
    c[:, Q_PP], c[:, Q_VV] = q[:3], q[3:]
    return c


class Variant(Enum):
    """How a command moves the drone."""

    LAG = "velocity follows the command with a lag, solved exactly"
    INCREMENT = "velocity changes at once by the change of the command"
    PAPER_LITERAL = "the command is added to the velocity at every step, as swarm2023 prints it"

    @property
    def exact(self) -> bool:
        """Whether it can be right at all."""
        return self is not Variant.PAPER_LITERAL

    def inputs(self, u: Floats) -> Floats:
        """(steps, 3) what a step of this variant takes as u, from the velocities (steps, 3) commanded during each."""
        return np.diff(u, axis=0, prepend=np.zeros((1, u.shape[1]))) if self is Variant.INCREMENT else u


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class FollowerModel:
    """A drone seen from outside: lag towards the command plus wind, disturbed by white acceleration.

    The defaults are those of a small multirotor in moderate air. A target whose commands are unknown is
    `FollowerModel.target()`. Raises ConfigError for impossible numbers.
    """

    lag: float = 0.5  # s, horizontal
    lag_z: float = 0.5
    acceleration: float = 0.3  # m/s^2 per sqrt(Hz), horizontal (along the course, if turn is given)
    acceleration_z: float = 0.1
    wind: float = 0.0  # m/s per sqrt(s), random walk of the horizontal wind
    wind_z: float = 0.0
    turn: float | None = None  # m/s^2 per sqrt(Hz) across the course; None: as along it

    def __post_init__(self) -> None:
        for name in ("lag", "lag_z", "acceleration"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise ConfigError(f"{name} = {getattr(self, name)} of a follower", fix="give a positive number")
        for name in ("acceleration_z", "wind", "wind_z"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise ConfigError(f"{name} = {getattr(self, name)} of a follower", fix="zero or a positive number")
        if self.turn is not None and not self.acceleration <= self.turn < np.inf:
            raise ConfigError(f"turn = {self.turn} is below acceleration = {self.acceleration}", fix="raise it")

    @classmethod
    def target(cls, *, acceleration: float = 0.3, turn: float = 1.0, acceleration_z: float = 0.2) -> "FollowerModel":
        """Constant velocity, with accelerations along and (stronger) across its course."""
        return cls(
            lag=CONSTANT_VELOCITY, lag_z=CONSTANT_VELOCITY, acceleration=acceleration, acceleration_z=acceleration_z,
            turn=turn,
        )  # fmt: skip

    def theta(self) -> Floats:
        """Parameters (THETA,) in the order that `lag_step` reads them."""
        across = 0.0 if self.turn is None else (self.turn / self.acceleration) ** 2 - 1.0
        return np.array([
            self.lag, self.lag, self.lag_z, self.acceleration, self.acceleration, self.acceleration_z,
            self.wind, self.wind, self.wind_z, across,
        ])  # fmt: skip
