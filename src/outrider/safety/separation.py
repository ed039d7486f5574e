"""Keep a true distance to something that moves: the largest velocity towards it that can still be taken back in time.

Along the line of sight n, from the follower to where the other would be by now had it braked at its last fix, the
follower answers its command u with a lag for one period and then brakes as hard as it surely can. The other, unseen
since that fix, lags to a stop, to a turn, or to coming back. The command is admissible if at every time t

    x_other(t) - x_own(t; u) >= R_d + k sigma(t),

and x_own is linear in u: the largest u is the least quotient over t. Distances along a fixed n are never more than the
true ones, so what is kept along n is kept in space. What is lost already is regained with 1 / `REGAIN`.

It is the stopping distance of planning (a barrier robust to delay) for sampled commands and a vehicle with a lag;
Alan et al., "Control barrier functions and input-to-state safety", IEEE Control Systems 2022, for the idea.
"""

from dataclasses import dataclass
from enum import Enum
from math import acos, cos, exp, expm1, isfinite, log, pi, sqrt
from typing import Final, final

import numpy as np

from outrider._kernel import kernel
from outrider.errors import ConfigError
from outrider.typing import Floats

FREE: Final = 0
LIMITED: Final = 1
RETREATING: Final = 2
CANNOT_HOLD: Final = 3
UNKNOWN: Final = 4
TIMES: Final = 12  # at which the gap is looked at, before the least is refined
NARROWED: Final = 15
SPARE: Final = 0.98  # of its speed, at which it retreats; what comes faster is answered no longer than that
GOLDEN: Final = 0.6180339887498949
REGAIN: Final = 1.0  # 1/s
_LONGEST: Final = 1e6  # s, a brake that does not depend on speed
_NEAR: Final = 1e-9  # m

# theta: see `Separation.theta`
T_DISTANCE, T_PERIOD, T_LAG, T_SPEED, T_ACCELERATION, T_OTHER, T_APPROACH, T_SIGMAS, T_TURN = range(9)


class Hold(Enum):
    """What the filter did to a command; the value is the sentence a user reads."""

    FREE = "the distance holds: the command goes through"
    LIMITED = "the approach is slowed so that the distance holds"
    RETREATING = "it backs off so that the distance holds"
    CANNOT_HOLD = "the distance cannot be guaranteed any more: it backs off as fast as it can; fly further away"
    UNKNOWN = "a position or velocity is missing: it hovers"


HOLDS: Final = tuple(Hold)
"""By the code of `keep_apart`."""


@kernel
def brake(slowest: float, fastest: float, theta: Floats) -> tuple[float, float]:
    """(tau_b [s], v_b [m/s]) of a deceleration (v + v_b) / tau_b that the vehicle can reach at all these velocities.

    The chord of min(acceleration, (v + speed) / lag), which is concave, between `slowest` and `fastest` [m/s].
    """
    lag, most, V = theta[T_LAG], theta[T_ACCELERATION], theta[T_SPEED]
    a = min(most, (slowest + V) / lag) if lag > 0.0 else most
    b = min(most, (fastest + V) / lag) if lag > 0.0 else most
    tau = 1.0 / max((b - a) / max(fastest - slowest, _NEAR), 1.0 / _LONGEST)
    return tau, a * tau - slowest


@kernel
def bears(
    t: float, gap: float, v: float, s: float, low: float, age: float, pp: float, pv: float, vv: float, debt: float,
    tau_b: float, v_b: float, theta: Floats,
) -> float:  # fmt: skip
    """The largest command that keeps the distance at one time, t [s] after the period in which it acts."""
    lag, tau_o, period = theta[T_LAG], theta[T_OTHER], theta[T_PERIOD]
    answer = 1.0 - exp(-period / lag) if lag > 0.0 else 1.0
    stop = -tau_b * expm1(-t / tau_b)
    lever = tau_o * (1.0 - exp(-(age + period + t) / tau_o)) if tau_o > 0.0 else 0.0
    spread = theta[T_SIGMAS] * sqrt(max(pp + lever * (2.0 * pv + lever * vv), 0.0))
    room = gap + low * (age + period + t) + (s - low) * lever - theta[T_DISTANCE] - spread
    room -= debt * exp(-REGAIN * (period + t)) + lag * answer * v + (1.0 - answer) * v * stop - v_b * (t - stop)
    return room / (period - lag * answer + answer * stop)


@kernel
def lowest(s: float, speed: float, theta: Floats) -> float:
    """The least that the other's velocity along n, now s, may become [m/s]: it stops, turns, or comes back.

    speed : m/s, of the other. With a course phi off n and turns of up to theta_T it is speed cos(phi + theta_T).
    """
    low, turn = min(s, -theta[T_APPROACH]), theta[T_TURN]
    if speed > 0.0:
        low = min(low, speed * cos(min(acos(min(max(s / speed, -1.0), 1.0)) + turn, pi)))
    return low


@kernel
def largest_approach(
    gap: float, v: float, s: float, low: float, age: float, pp: float, pv: float, vv: float, theta: Floats
) -> float:
    """The largest admissible command [m/s] along n; what is below -speed cannot be held.

    gap : m, from the follower now to the other at its fix, along n;  v, s : m/s, follower now, other then, along n
    low : m/s, what s becomes at worst, see `lowest`;
    age : s, since that fix;  pp, pv, vv : covariance of relative position and velocity along n, then
    """
    tau_o, fastest = theta[T_OTHER], max(v, theta[T_SPEED])
    slowest = max(low, -SPARE * theta[T_SPEED])
    tau_b, v_b = brake(slowest, fastest, theta)
    lever = tau_o * (1.0 - exp(-age / tau_o)) if tau_o > 0.0 else 0.0
    spread = theta[T_SIGMAS] * sqrt(max(pp + lever * (2.0 * pv + lever * vv), 0.0))
    debt = min(gap + low * age + (s - low) * lever - theta[T_DISTANCE] - spread, 0.0)
    step = tau_b * log((fastest + v_b) / (slowest + v_b)) / TIMES  # until it is no faster than the other
    least, at = bears(0.0, gap, v, s, low, age, pp, pv, vv, debt, tau_b, v_b, theta), 0
    for j in range(1, TIMES + 1):
        u = bears(j * step, gap, v, s, low, age, pp, pv, vv, debt, tau_b, v_b, theta)
        if u < least:
            least, at = u, j
    a, b = max(at - 1, 0) * step, min(at + 1, TIMES) * step
    for _ in range(NARROWED):  # golden section
        width = GOLDEN * (b - a)
        if bears(b - width, gap, v, s, low, age, pp, pv, vv, debt, tau_b, v_b, theta) < bears(
            a + width, gap, v, s, low, age, pp, pv, vv, debt, tau_b, v_b, theta
        ):
            b = a + width
        else:
            a = b - width
    return min(least, bears(0.5 * (a + b), gap, v, s, low, age, pp, pv, vv, debt, tau_b, v_b, theta))


@kernel
def keep_apart(
    want: Floats, p: Floats, v: Floats, q: Floats, w: Floats, P: Floats, age: float, theta: Floats, out: Floats
) -> int:
    """out (3,) <- the commanded velocity `want` (3,), no faster towards the other than it can take back; a code.

    p, v (3,) own position and velocity when the command begins to act;  q, w (3,) the other's at its last fix, and
    `age` [s] how long ago that was;  P (6, 6) covariance of the relative position and velocity;  theta : `Separation`.
    All in the site frame (ENU). The tangential part of a command keeps its direction.
    """
    whole = age
    for i in range(3):
        whole += want[i] + p[i] + v[i] + q[i] + w[i]
    tau = theta[T_OTHER]
    lever = tau * (1.0 - exp(-age / tau)) if tau > 0.0 else 0.0
    x, y, z = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    a, b, c = x + lever * w[0], y + lever * w[1], z + lever * w[2]
    far = sqrt(a * a + b * b + c * c)
    if not np.isfinite(whole) or not age >= 0.0 or not far > _NEAR:
        out[0] = out[1] = out[2] = 0.0
        return UNKNOWN if not (np.isfinite(whole) and age >= 0.0) else CANNOT_HOLD
    a, b, c = a / far, b / far, c / far
    pp = pv = vv = 0.0
    for i in range(3):
        n_i = a if i == 0 else b if i == 1 else c
        for j in range(3):
            nn = n_i * (a if j == 0 else b if j == 1 else c)
            pp += nn * P[i, j]
            pv += nn * P[i, 3 + j]
            vv += nn * P[3 + i, 3 + j]
    s = a * w[0] + b * w[1] + c * w[2]
    low = lowest(s, sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]), theta)
    most = largest_approach(
        a * x + b * y + c * z,
        a * v[0] + b * v[1] + c * v[2],
        s,
        low,
        age, pp, pv, vv, theta,
    )  # fmt: skip
    wish = a * want[0] + b * want[1] + c * want[2]
    if not np.isfinite(most):
        out[0] = out[1] = out[2] = 0.0
        return UNKNOWN
    if wish <= most:
        out[0], out[1], out[2] = want[0], want[1], want[2]
        return FREE
    limit = theta[T_SPEED]
    along = max(most, -limit)
    x, y, z = want[0] - wish * a, want[1] - wish * b, want[2] - wish * c
    aside = sqrt(x * x + y * y + z * z)
    room = sqrt(max(limit * limit - along * along, 0.0))
    share = min(room / aside, 1.0) if aside > 0.0 else 0.0
    out[0], out[1], out[2] = along * a + share * x, along * b + share * y, along * c + share * z
    return CANNOT_HOLD if most < -limit else RETREATING if most < 0.0 else LIMITED


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Separation:
    """What is kept, and what both can do.

    distance : m, R_d, between the two positions
    period_s : s, how long a command acts before the next one does, and what the vehicle takes to begin with it
    lag_s, acceleration, speed : own answer v' = (u - v) / lag within +-acceleration, |u| <= speed
    other_lag_s : s, of the other's answer; 0 : it stands at once, as before a wall
    turn : rad, by how much it may change its course at once, as seen from the side
    approach : m/s, how fast it may come towards the follower, whatever it does now; 0 : it never comes back
    sigmas : standard deviations of the relative position that are kept besides

    Raises ConfigError for impossible numbers, and for an other that comes back as fast as the follower can fly.
    """

    distance: float
    period_s: float = 0.12
    lag_s: float = 0.5
    acceleration: float = 5.0
    speed: float = 12.0
    other_lag_s: float = 0.5
    turn: float = 0.5 * pi
    approach: float = 0.0
    sigmas: float = 4.0

    def __post_init__(self) -> None:
        for name in ("distance", "period_s", "acceleration", "speed"):
            if not (isfinite(value := getattr(self, name)) and value > 0.0):
                raise ConfigError(f"{name} is {value}", where="separation", fix="it must be positive")
        for name in ("lag_s", "other_lag_s", "turn", "approach", "sigmas"):
            if not (isfinite(value := getattr(self, name)) and value >= 0.0):
                raise ConfigError(f"{name} is {value}", where="separation", fix="it must not be negative")
        if self.approach >= self.speed:
            what = f"the other may come at {self.approach:g} m/s and the follower flies no faster than {self.speed:g}"
            raise ConfigError(what, where="separation", fix="a faster follower, or an other that does not come back")

    def theta(self) -> Floats:
        """Kernel parameters, in the order that `keep_apart` reads them."""
        own = (self.distance, self.period_s, self.lag_s, self.speed, self.acceleration)
        return np.array([*own, self.other_lag_s, self.approach, self.sigmas, self.turn])


def kept_apart(
    want: Floats, own: Floats, other: Floats, separation: Separation, *, P: Floats | None = None, age_s: float = 0.0
) -> tuple[Floats, Hold]:
    """The safe command (3,) [m/s] and what was done to it; see `keep_apart`.

    own, other : (6,) position and velocity;  P : (6, 6) of their difference, exact if left out
    """
    out = np.empty(3)
    spread = np.zeros((6, 6)) if P is None else np.ascontiguousarray(P, np.float64)
    x, y = np.array(own, np.float64), np.array(other, np.float64)
    code = keep_apart(
        np.array(want, np.float64), x[:3], x[3:], y[:3], y[3:], spread, float(age_s), separation.theta(), out
    )
    return out, HOLDS[code]
