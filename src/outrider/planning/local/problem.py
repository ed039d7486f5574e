"""What the optimiser is given: a problem as arrays, weights, and scratch that is reused from cycle to cycle."""

from typing import Final, NamedTuple

import numpy as np

from outrider.planning.local.banded import BAND
from outrider.typing import Floats

KNOT: Final = 4  # unknowns of a knot: x, y, heading, time from now


class Weights(NamedTuple):
    """Weights of the squared residuals. A limit w is exceeded by about 1 / w of itself where that saves time."""

    duration: float = 1.0
    evenness: float = 100.0
    velocity: float = 40.0
    acceleration: float = 20.0
    slip: float = 300.0
    turning_radius: float = 400.0
    backward: float = 1.0
    turning: float = 0.05
    obstacle: float = 60.0
    passing: float = 40.0


class Problem(NamedTuple):
    """One situation. Twists in the body frame, places in the site frame. Few arrays: each costs compiling time."""

    weights: Weights
    dt: float  # s, wanted between knots
    share: float  # of the limits that is used
    top: float  # m/s
    holonomic: bool
    radius: float  # m, smallest turning radius, 0 for none
    through: bool  # the end is passed at speed
    gap: float  # m, wanted to obstacles
    horizon: float  # s, how long an obstacle is believed to keep its velocity
    reaction: float  # s, from when somebody sets off until the robot stands
    slowest: float  # m/s, as slow as it passes somebody
    west: float  # m, of the field
    south: float
    resolution: float
    rows: Floats  # (m, 5) velocity set, see `DriveLimits.rows`; row 1 limits turning
    rates: Floats  # (4, 3) acceleration axes in shares of their limits, and the twist now
    discs: Floats  # (k, 3) x, y, radius of the discs that cover the body
    obstacles: Floats  # (n, 5) x, y, radius, v_x, v_y
    wary: Floats  # (m, 5) the same of what stands and may set off
    field: Floats  # (rows, cols) m, empty for none


class Work(NamedTuple):
    """Scratch for bands of at most `capacity` knots."""

    z: Floats  # (2, capacity, 4) the band, and the one on trial
    M: Floats  # (4, 4 capacity + BAND, BAND) banded matrices: normal, normal on trial, damping, factor
    b: Floats  # (4, 4 capacity + BAND) right-hand side, the same on trial, step, one that nobody reads
    u: Floats  # (capacity, 3, 9) derivatives of the twist of each step by its two knots, and the twist
    s: Floats  # (15, 12) rows in use below


G, V, THETA, C, RATE, DA, E = range(7)  # rows of Work.s
W3, Q5 = 7, 10  # first rows of a 3 x 3 and a 5 x 5 matrix


def workspace(capacity: int) -> Work:
    """Scratch, and the band in it."""
    n = KNOT * capacity + BAND
    return Work(
        z=np.zeros((2, capacity, KNOT)),
        M=np.zeros((4, n, BAND)),
        b=np.zeros((4, n)),
        u=np.zeros((capacity, 3, 9)),
        s=np.zeros((15, 12)),
    )
