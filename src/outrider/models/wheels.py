"""Which rim speeds go with which motion of the body: the geometry that odometry, vehicles and planners share.

Body forward-left-up. A wheel is (x, y, g): its contact point [m] and the angle [rad], left of forward, of the axis of
the roller that touches the ground; along that axis the ground cannot slip. An ordinary or an omni wheel has g = 0.
"""

from dataclasses import dataclass, field
from math import isfinite, pi, tan
from typing import Self, final

import numpy as np

from outrider.errors import ConfigError
from outrider.typing import Floats

Wheel = tuple[float, float, float]


def mecanum_matrix(wheels: tuple[Wheel, ...]) -> Floats:
    """(n, 3) rim speeds of wheels (x, y, roller angle) per u_x, u_y, w_z; below rank 3 some motion goes unseen."""
    return np.array([(1.0, tan(g), x * tan(g) - y) for x, y, g in wheels]).reshape(-1, 3)


def mecanum_rank(wheels: tuple[Wheel, ...]) -> int:
    """How many of forward, sideways and turning the wheels can tell apart."""
    return int(np.linalg.matrix_rank(mecanum_matrix(wheels), tol=1e-6)) if wheels else 0


def mecanum_rectangle(half_length: float, half_width: float) -> tuple[Wheel, ...]:
    """Front left, front right, rear left, rear right at 45 degrees; an X when seen from above."""
    a, b, g = half_length, half_width, 0.25 * pi
    return ((a, b, -g), (a, -b, g), (-a, b, g), (-a, -b, -g))


def require_mecanum(wheels: tuple[Wheel, ...], where: str) -> None:
    """ConfigError unless every wheel can drive and all together tell forward, sideways and turning apart."""
    for wheel in wheels:
        if len(wheel) != 3 or not all(isfinite(a) for a in wheel) or abs(wheel[2]) > 0.49 * pi:
            fix = "x and y in metres, angle in radians between -pi/2 and pi/2"
            raise ConfigError(f"wheel {wheel} cannot drive", where=where, fix=fix)
    if mecanum_rank(wheels) < 3:
        fix = "neighbouring wheels need opposite roller angles"
        raise ConfigError("these wheels cannot tell forward, sideways and turning apart", where=where, fix=fix)


@final
@dataclass(frozen=True, slots=True)
class WheelKinematics:
    """Between the twist (u_x, u_y, w_z) of the body origin and the rim speeds of n wheels:  V = J u,  u = J+ V.

    wheels : (x m, y m, roller angle rad) of each.  J (n, 3) is `inverse`, its pseudo-inverse (3, n) is `forward`.

    Raises ConfigError unless J has full rank.  Source: amr2025 section 2, for any number of wheels.
    """

    wheels: tuple[Wheel, ...]
    inverse: Floats = field(init=False, repr=False, compare=False)
    forward: Floats = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        require_mecanum(self.wheels, "wheels")
        inverse = mecanum_matrix(self.wheels)
        object.__setattr__(self, "inverse", inverse)
        object.__setattr__(self, "forward", np.ascontiguousarray(np.linalg.pinv(inverse)))

    @classmethod
    def rectangle(cls, half_length: float, half_width: float) -> Self:
        """Four wheels as in `mecanum_rectangle`."""
        return cls(mecanum_rectangle(half_length, half_width))

    def rims(self, twist: Floats) -> Floats:
        """Rim speeds (..., n) [m/s] of twists (..., 3)."""
        return np.asarray(twist) @ self.inverse.T

    def twist(self, rims: Floats) -> Floats:
        """The twist (..., 3) that explains rim speeds (..., n) best."""
        return np.asarray(rims) @ self.forward.T

    def slip(self, rims: Floats) -> Floats:
        """What of the rim speeds (..., n) no twist explains [m/s]: zero when nothing slips."""
        return np.asarray(rims) - self.rims(self.twist(rims))


def rpm(rims: Floats, radius: float, gear: float = 1.0) -> Floats:
    """Motor speeds [r/min] of rim speeds [m/s]; radius of the wheel [m], `gear` turns of the motor per wheel turn."""
    return np.asarray(rims) / radius * gear * (30.0 / pi)
