"""Follow a moving target at a distance: its velocity fed forward, the distance held along the line of sight."""

from dataclasses import dataclass
from math import isfinite, sqrt
from typing import Final, final

import numpy as np

from outrider._kernel import kernel
from outrider.errors import ConfigError
from outrider.typing import Floats

_NEAR: Final = 1e-9  # m

SLOW: Final = 0.5  # m/s, below which a course says less and less
L_SPEED, L_GAIN, L_BRAKE, L_ASTERN = range(4)


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
    """out (3,) <- the velocity that holds `set_point` [m] from the target, behind it, within the speed.

    u = w + c(D - set_point) n + t  from p to the target at q + w age, which was at q with velocity w a while `age` ago;
    t, across n and at most half its speed, leads to the place behind it on its own level. What the speed leaves beside
    these is for closing.
    """
    dx, dy, dz = q[0] + age * w[0] - p[0], q[1] + age * w[1] - p[1], q[2] + age * w[2] - p[2]
    far, most = sqrt(dx * dx + dy * dy + dz * dz), theta[L_SPEED]
    inverse = 1.0 / far if far > _NEAR else 0.0
    a, b, c = dx * inverse, dy * inverse, dz * inverse
    close = closing_speed(far - set_point, theta[L_GAIN], theta[L_BRAKE])
    wx, wy, wz = w[0], w[1], w[2]
    fast, along = sqrt(wx * wx + wy * wy), a * wx + b * wy
    if fast > 0.0:  # across n towards astern, level with it: against what of its level velocity is not along n
        swing = theta[L_ASTERN] * set_point * min(1.0, fast / SLOW) / fast
        tx, ty, tz = swing * (along * a - wx), swing * (along * b - wy), swing * along * c
        hard = sqrt(tx * tx + ty * ty + tz * tz)
        share = 0.5 * fast / hard if hard > 0.5 * fast else 1.0
        wx, wy, wz = wx + share * tx, wy + share * ty, wz + share * tz
    along, square = a * wx + b * wy + c * wz, wx * wx + wy * wy + wz * wz
    whole, scale = square + close * (2.0 * along + close), 1.0
    if whole > most * most:
        if square < most * most:
            root = sqrt(along * along + most * most - square)
            close = min(max(close, -along - root), -along + root)
        else:  # it outruns the follower
            scale = most / sqrt(whole)
    out[0], out[1], out[2] = (
        scale * (wx + close * a),
        scale * (wy + close * b),
        scale * (wz + close * c),
    )


@kernel
def hasten(v: Floats, share: float, speed: float, out: Floats) -> None:
    """out (3,) <- the command with which a vehicle of velocity v (3,) answers in `share` of its lag to `out`.

    v' = (u - v) / lag  with  u = v + (u_0 - v) / share  is  v' = (u_0 - v) / (share lag),  until |u| <= speed binds.
    """
    for i in range(3):
        out[i] = v[i] + (out[i] - v[i]) / share
    fast = sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2])
    if fast > speed:
        for i in range(3):
            out[i] *= speed / fast


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Pursuit:
    """The default law.

    speed : m/s, most that is commanded;  gain : 1/s, of the distance near the set-point, at most about half of one over
    the lag of the vehicle;  brake : m/s^2, with which it comes to the set-point from afar
    astern : 1/s, with which it swings to behind the target; 0 : it stays on the bearing from which it came
    """

    speed: float
    gain: float = 0.5
    brake: float = 1.0
    astern: float = 0.3

    def __post_init__(self) -> None:
        for name in ("speed", "gain", "brake"):
            if not (isfinite(value := getattr(self, name)) and value > 0.0):
                raise ConfigError(f"{name} is {value}", where="pursuit", fix="it must be positive")
        if not (isfinite(self.astern) and self.astern >= 0.0):
            raise ConfigError(f"astern is {self.astern}", where="pursuit", fix="it must not be negative")

    def theta(self) -> Floats:
        """Kernel parameters, in the order that `pursue` reads them."""
        return np.array([self.speed, self.gain, self.brake, self.astern])


def pursued(p: Floats, target: Floats, set_point: float, law: Pursuit, *, age_s: float = 0.0) -> Floats:
    """The velocity (3,) [m/s] that follows a target (6,) known `age_s` ago; see `pursue`."""
    out, x = np.empty(3), np.array(target, np.float64)
    pursue(np.array(p, np.float64), x[:3], x[3:], float(age_s), float(set_point), law.theta(), out)
    return out
