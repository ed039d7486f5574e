"""Parameters of sensors that a log may tell by its innovations, with their units and what may be expected of them."""

from dataclasses import dataclass
from enum import Enum
from typing import Final, final

from outrider.models.motion import Motion


class What(Enum):
    """Kind of a parameter; the value says it in words."""

    LEVER_X = "lever arm, forward"
    LEVER_Y = "lever arm, left"
    LEVER_Z = "lever arm, up"
    SPEED = "speed scale"
    RATE = "turn rate scale"
    DELAY = "delay against the IMU"


LEVERS: Final = (What.LEVER_X, What.LEVER_Y, What.LEVER_Z)
UNITS = {**dict.fromkeys(LEVERS, "m"), What.SPEED: "", What.RATE: "", What.DELAY: "s"}
STEPS = {
    What.LEVER_X: 0.05,
    What.LEVER_Y: 0.05,
    What.LEVER_Z: 0.05,
    What.SPEED: 0.01,
    What.RATE: 0.01,
    What.DELAY: 0.08,
}
"""Of the finite differences."""
PRIORS = {**dict.fromkeys(LEVERS, 3.0), What.SPEED: 0.3, What.RATE: 0.3, What.DELAY: 1.0}
"""Deviations of what may be expected at all."""
WIDEST = {**dict.fromkeys(LEVERS, 0.5), What.SPEED: 0.05, What.RATE: 0.05, What.DELAY: 0.15}
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
        return self.what in LEVERS

    @property
    def axis(self) -> int:
        """Of a lever arm."""
        return LEVERS.index(self.what)


@final
@dataclass(frozen=True, slots=True)
class Noise:
    """A standard deviation that may be multiplied. name : of a stream, or of a density of the process, whose `row` of
    theta it then is."""

    name: str
    row: int | None = None


DENSITIES: Final = {
    Motion.PLANAR: tuple(
        Noise(name, row)
        for row, name in enumerate(("acceleration", "lateral", "", "yaw_acceleration", "heading_walk", "position_walk"))
        if name
    ),
    Motion.STRAPDOWN: (Noise("gyro_noise", 0), Noise("accel_noise", 1)),
}
"""Process noise that shows in the innovations of positions, by the keys of the configuration's section."""
