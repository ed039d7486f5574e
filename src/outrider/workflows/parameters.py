"""Parameters of sensors that a log may tell by its innovations, with their units and what may be expected of them."""

from dataclasses import dataclass
from enum import Enum
from typing import final


class What(Enum):
    """Kind of a parameter; the value says it in words."""

    LEVER_X = "lever arm, forward"
    LEVER_Y = "lever arm, left"
    SPEED = "speed scale"
    RATE = "turn rate scale"
    DELAY = "delay against the IMU"


UNITS = {What.LEVER_X: "m", What.LEVER_Y: "m", What.SPEED: "", What.RATE: "", What.DELAY: "s"}
STEPS = {What.LEVER_X: 0.05, What.LEVER_Y: 0.05, What.SPEED: 0.01, What.RATE: 0.01, What.DELAY: 0.08}
"""Of the finite differences."""
PRIORS = {What.LEVER_X: 3.0, What.LEVER_Y: 3.0, What.SPEED: 0.3, What.RATE: 0.3, What.DELAY: 1.0}
"""Deviations of what may be expected at all."""
WIDEST = {What.LEVER_X: 0.5, What.LEVER_Y: 0.5, What.SPEED: 0.05, What.RATE: 0.05, What.DELAY: 0.15}
"""Half of the widest 95 % interval that still says something."""


@final
@dataclass(frozen=True, slots=True)
class Parameter:
    """One number. streams : whose, the first is its name (a receiver's velocities share its antenna)."""

    what: What
    streams: tuple[str, ...]

    @property
    def source(self) -> str:
        """Whose it is."""
        return self.streams[0]

    @property
    def moves(self) -> bool:
        """Whether it is a lever arm."""
        return self.what in (What.LEVER_X, What.LEVER_Y)

    @property
    def axis(self) -> int:
        """Of a lever arm."""
        return 0 if self.what is What.LEVER_X else 1
