"""Follow a moving target at a distance: its velocity fed forward, the distance held along the line of sight."""

from dataclasses import dataclass
from math import isfinite, sqrt
from typing import Final, final

import numpy as np

from outrider._kernel import kernel
from outrider.errors import ConfigError
from outrider.typing import Floats

_NEAR: Final = 1e-9  # m

L_SPEED, L_GAIN, L_BRAKE = range(3)


@kernel
def closing_speed(error: float, gain: float, brake: float) -> float:
    """How fast to close `error` [m] of distance [m/s]: gain * error near by, a stop with `brake` from afar.

    c = -b T + sqrt((b T)^2 + 2 b e) with T = 1 / gain, whose slope at 0 is the gain; an error that is negative,
    too near, is mirrored.
    """
    reach = brake / gain
    c = sqrt(reach * reach + 2.0 * brake * abs(error)) - reach
    return c if error >= 0.0 else -c


@kernel
def pursue(p: Floats, q: Floats, w: Floats, age: float, set_point: float, theta: Floats, out: Floats) -> None:
    """out (3,) <- the velocity that holds `set_point` [m] from the target, within the speed.

    u = w + c(D - set_point) n  from p to the target at q + w age, which was at q with velocity w a while `age` ago.
    Its velocity comes first: what the speed leaves is for closing. At no distance at all it goes along with the target.
    """
    dx, dy, dz = q[0] + age * w[0] - p[0], q[1] + age * w[1] - p[1], q[2] + age * w[2] - p[2]
    far, most = sqrt(dx * dx + dy * dy + dz * dz), theta[L_SPEED]
    inverse = 1.0 / far if far > _NEAR else 0.0
    a, b, c = dx * inverse, dy * inverse, dz * inverse
    close = closing_speed(far - set_point, theta[L_GAIN], theta[L_BRAKE])
    along, square = a * w[0] + b * w[1] + c * w[2], w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    whole, scale = square + close * (2.0 * along + close), 1.0
    if whole > most * most:
        if square < most * most:
            root = sqrt(along * along + most * most - square)
            close = min(max(close, -along - root), -along + root)
        else:  # it outruns the follower
            scale = most / sqrt(whole)
    out[0], out[1], out[2] = (
        scale * (w[0] + close * a),
        scale * (w[1] + close * b),
        scale * (w[2] + close * c),
    )


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Pursuit:
    """The default law.

    speed : m/s, most that is commanded;  gain : 1/s, of the distance near the set-point, at most about half of one over
    the lag of the vehicle;  brake : m/s^2, with which it comes to the set-point from afar
    """

    speed: float
    gain: float = 0.5
    brake: float = 1.0

    def __post_init__(self) -> None:
        for name in ("speed", "gain", "brake"):
            if not (isfinite(value := getattr(self, name)) and value > 0.0):
                raise ConfigError(f"{name} is {value}", where="pursuit", fix="it must be positive")

    def theta(self) -> Floats:
        """Kernel parameters, in the order that `pursue` reads them."""
        return np.array([self.speed, self.gain, self.brake])


def pursued(p: Floats, target: Floats, set_point: float, law: Pursuit, *, age_s: float = 0.0) -> Floats:
    """The velocity (3,) [m/s] that follows a target (6,) known `age_s` ago; see `pursue`."""
    out, x = np.empty(3), np.array(target, np.float64)
    pursue(np.array(p, np.float64), x[:3], x[3:], float(age_s), float(set_point), law.theta(), out)
    return out
