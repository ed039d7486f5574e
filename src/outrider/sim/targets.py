"""What a target may do: commanded velocities over time, and what becomes of its signal. Truth, for who follows it."""

from enum import Enum
from math import cos, sin
from typing import Final

from outrider._kernel import kernel
from outrider.typing import Floats

STRAIGHT, TURN, STOP, REVERSE, CLIMB, HOVER, SPEEDS, SILENT, JUMP = range(9)
JUMPS_BY: Final = 50.0  # m
JUMPS_FOR: Final = 5.0  # s


class Behaviour(Enum):
    """What it does at its moment; the value is the sentence a user reads."""

    STRAIGHT = "it flies straight on"
    TURN = "it slows down to half and turns by 90 degrees"
    STOP = "it stops dead"
    REVERSE = "it comes back the way it went"
    CLIMB = "it goes on climbing by 45 degrees"
    HOVER = "it hovers all the time"
    SPEEDS = "it changes between its speed and 0.3 of it every four seconds"
    SILENT = "its signal is lost, and a second later it stops"
    JUMP = "its fixes lie 50 m further on for five seconds, and a second later it stops"

    @property
    def code(self) -> int:
        """The number by which kernels know it."""
        return tuple(Behaviour).index(self)


@kernel
def target_velocity(behaviour: int, t: float, event: float, speed: float, heading: float, out: Floats) -> None:
    """out (3,) <- the velocity [m/s] that the target is told at t, ENU; `event` is its moment, both in s.

    heading : rad, of its way before
    """
    v, angle, up = speed, heading, 0.0
    since = t - event
    if behaviour == TURN:
        v = 0.5 * speed if -1.0 <= since < 1.0 else speed
        angle += 0.5 * 3.141592653589793 if since >= 0.0 else 0.0
    elif behaviour == HOVER or (behaviour == STOP and since >= 0.0):
        v = 0.0
    elif behaviour == REVERSE and since >= 0.0:
        v = -speed
    elif behaviour == CLIMB and since >= 0.0:
        v = up = 0.7071067811865476 * speed
    elif behaviour == SPEEDS and since >= 0.0:
        v = speed if int(since / 4.0) % 2 == 1 else 0.3 * speed
    elif behaviour in (SILENT, JUMP) and since >= 1.0:
        v = 0.0
    out[0], out[1], out[2] = v * cos(angle), v * sin(angle), up


@kernel
def heard(behaviour: int, t: float, event: float) -> bool:
    """Whether the fix that it takes at t goes out."""
    return behaviour != SILENT or t < event


@kernel
def displaced(behaviour: int, t: float, event: float) -> float:
    """How far ahead of the target its fix lies [m]."""
    return JUMPS_BY if behaviour == JUMP and event <= t < event + JUMPS_FOR else 0.0
