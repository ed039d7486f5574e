"""Flights to be filtered, what filters leave behind, and what they all compute in the same way."""

from enum import IntEnum
from math import atan2, hypot, log, pi
from typing import NamedTuple

import numpy as np

from outrider._kernel import inlined, kernel
from outrider.core.angles import wrap
from outrider.typing import Floats, Ints


class Seen(IntEnum):
    """What was measured at an event. Beside a fix z[0:3] there may be a direction of flight z[3:6], see `sight`."""

    NOTHING = 0
    ANGLE = 1  # [rad]
    COSINES = 2  # swarm2023: h = v / |v|
    PRINTED = 3  # swarm2023: h, and the distance d = |v| dt flown since


class Log(NamedTuple):
    """Events of one flight, in the order of time."""

    step: Ints  # (E,) which step leads to it, a row of C
    u: Floats  # (E, 3) its input
    kind: Ints  # (E,) `Seen`
    z: Floats  # (E, 6)
    r: Floats  # (E, 6) variances; inf at 0 where there is no fix
    C: Floats  # (S, 3, STEP) steps
    dt: Floats  # (S,) their lengths
    slowest: float  # m/s, below which there is no direction


class Track(NamedTuple):
    """What a filter thought after each event, before it (predicted), and how likely it found what it saw."""

    x: Floats  # (E, n)
    P: Floats  # (E, n, n)
    xp: Floats
    Pp: Floats
    likelihood: Floats  # (E,) logarithm


class Work(NamedTuple):
    """Scratch. For the ensemble N members, else none."""

    w: Floats  # (9,)
    L: Floats  # (n, n)
    Y: Floats  # (2 n, 3) what was seen less what the points would see
    y: Floats  # (3,)
    S: Floats  # (3, 3)
    C: Floats  # (3, n)
    X: Floats  # (n, N) members
    E: Floats  # (n, N) noise


def workspace(n: int, members: int = 0) -> Work:
    """Scratch for n states and so many members."""
    shapes = ((9,), (n, n), (2 * n, 3), (3,), (3, 3), (3, n), (n, members), (n, members))
    return Work(*(np.zeros(s) for s in shapes))


@inlined
def sight(kind: int, vx: float, vy: float, dt: float, z: Floats, y: Floats) -> int:
    """y <- z - h(v); returns how many numbers."""
    if kind == 1:
        y[0] = wrap(z[3] - atan2(vy, vx))
        return 1
    speed = hypot(vx, vy)
    y[0], y[1], y[2] = z[3] - vx / speed, z[4] - vy / speed, z[5] - speed * dt
    return kind


@kernel
def tells(kind: int, x: Floats, P: Floats, slowest: float) -> bool:
    """Whether there is a direction to be fused: the flight fast enough and, but for swarm2023's kinds, surely so."""
    if kind == 0:
        return False
    air = x.size == 9
    vx, vy = x[3] - (x[6] if air else 0.0), x[4] - (x[7] if air else 0.0)
    square = vx * vx + vy * vy
    return square > slowest * slowest and (kind > 1 or square > 4.0 * (P[3, 3] + P[4, 4]))


@kernel
def evidence(nis: float, det: float, m: int) -> float:
    """Logarithm of the density of an innovation."""
    return -0.5 * (nis + log(det) + m * log(2.0 * pi))


@kernel
def keep(x: Floats, P: Floats, to_x: Floats, to_P: Floats) -> None:
    """Write a belief down."""
    for i in range(x.size):
        to_x[i] = x[i]
        for j in range(x.size):
            to_P[i, j] = P[i, j]
