"""Robots that keep clear of one another, each by what it knows of the others: lines of `halfplanes`, and a velocity."""

from dataclasses import dataclass
from math import inf
from typing import final

import numpy as np

from outrider._kernel import inlined, kernel
from outrider.errors import ConfigError, UsageError
from outrider.guidance.halfplanes import braking, chosen, reciprocal
from outrider.guidance.neighbours import Cells, nearest, sort_into_cells
from outrider.typing import Floats, Ints

A_KEEP, A_PART, A_HORIZON, A_LEFT, A_SPEED, A_HARDEST, A_BRAKE, A_REACH, A_REACT, A_RETREAT = range(10)
"""Places in `Avoidance.theta`."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Avoidance:
    """How robots keep clear of each other. Lengths in m, speeds in m/s, between centres.

    separation : never to be less;  margin : kept on top by the braking lines, for what estimates are wrong;  comfort :
    on top of that by the reciprocal lines;  horizon_s : how far these look ahead;  left : see `reciprocal`;
    speed, acceleration : of the robot;  brake : what it plans to brake with;  response_s : lag of its velocity;
    react_s : from a decision to a change of motion, lag and all delays together;  retreat : 1/s, see `braking`.
    """

    separation: float = 1.5
    margin: float = 0.5
    comfort: float = 0.3
    horizon_s: float = 3.0
    left: float = 0.1
    speed: float = 5.0
    acceleration: float = 4.0
    brake: float = 3.0
    response_s: float = 0.5
    react_s: float = 0.9
    retreat: float = 1.0

    def __post_init__(self) -> None:
        positive = ("separation", "horizon_s", "speed", "acceleration", "brake", "response_s", "react_s")
        for name in positive:
            if not 0.0 < getattr(self, name) < inf:
                raise ConfigError(f"is {getattr(self, name)}", where=f"avoidance {name}", fix="a number above 0")
        for name in ("margin", "comfort", "retreat", "left"):
            if not 0.0 <= getattr(self, name) < inf:
                raise ConfigError(f"is {getattr(self, name)}", where=f"avoidance {name}", fix="0 or more")
        if self.brake > self.acceleration:
            raise ConfigError(
                f"brake {self.brake:g} is above acceleration {self.acceleration:g}", where="avoidance",
                fix="a robot cannot plan to brake harder than it can",
            )  # fmt: skip

    def theta(self) -> Floats:
        """Kernel parameters, in the order of the `A_` numbers."""
        keep = self.separation + self.margin
        return np.array([
            keep, keep + self.comfort, self.horizon_s, self.left, self.speed, self.acceleration, self.brake,
            self.acceleration * self.response_s, self.react_s, self.retreat,
        ])  # fmt: skip


@inlined
def write_lines(lines: Floats, k: int, n: int, p: tuple[float, float], v: tuple[float, float],
                o: tuple[float, float], unsure: float, share: float, theta: Floats) -> None:  # fmt: skip
    """Rows k and n + k of `lines` <- the braking and the reciprocal line for the kth of n others, at p from here with
    velocity o, known to `unsure` [m] besides the margin; share : 1 for who does not avoid, else 1/2."""
    keep, part = theta[A_KEEP] + unsure, theta[A_PART] + unsure
    lines[k, 0], lines[k, 1], lines[k, 2] = braking(
        p[0], p[1], v[0], v[1], o[0], o[1], keep, theta[A_REACT], theta[A_BRAKE], theta[A_HARDEST], share,
        theta[A_RETREAT],
    )  # fmt: skip
    lines[n + k, 0], lines[n + k, 1], lines[n + k, 2] = reciprocal(
        p[0], p[1], v[0], v[1], o[0], o[1], part, theta[A_HORIZON], theta[A_LEFT], share
    )


@kernel
def avoid_all(
    p: Floats, v: Floats, want: Floats, theta: Floats, reach: float, layer: float, side: float, first: Ints,
    members: Ints, lines: Floats, ids: Ints, squared: Floats, out: Floats, ranks: Ints,
) -> None:  # fmt: skip
    """out (n, 2) <- the velocity of each of n robots at p (n, 2 or 3) that want `want`; ranks (n) <- what gave way.

    Who is within `reach` and less than `layer` above or below is a neighbour, at most ids.size of them, the nearest.
    lines (2 ids.size, 3), ids, squared, first, members : scratch, see `neighbours`.
    """
    sort_into_cells(p, side, first, members)
    for i in range(p.shape[0]):
        n = nearest(p, side, first, members, i, reach, layer, ids, squared)
        for k in range(n):
            j = ids[k]
            write_lines(lines, k, n, (p[j, 0] - p[i, 0], p[j, 1] - p[i, 1]), (v[i, 0], v[i, 1]), (v[j, 0], v[j, 1]),
                        0.0, 0.5, theta)  # fmt: skip
        out[i, 0], out[i, 1], ranks[i] = chosen(
            lines, n, 2 * n, (want[i, 0], want[i, 1]), (v[i, 0], v[i, 1]), theta[A_REACH], theta[A_SPEED]
        )


def avoid(
    p: Floats, v: Floats, want: Floats, rules: Avoidance = Avoidance(), *, reach: float = 20.0, most: int = 12,
    layer: float = inf,
) -> tuple[Floats, Ints]:  # fmt: skip
    """(n, 2) velocities, and (n,) what gave way (`KEPT`, `PARTED`, `BROKEN`), of robots that all know all.

    p (n, 2 or 3) m, v, want (n, 2) m/s, world;  reach : m, how far a robot looks;  most : neighbours that count, the
    nearest;  layer : m, robots farther apart in height ignore each other. Raises `UsageError` for other shapes, or NaN.
    """
    n = len(p)
    if p.ndim != 2 or p.shape[1] not in (2, 3) or not v.shape == want.shape == (n, 2) or most < 1:
        raise UsageError(
            f"places {p.shape}, velocities {v.shape}, wanted {want.shape}", where="avoid",
            fix="(n, 2 or 3), (n, 2), (n, 2)",
        )  # fmt: skip
    p, v, want = (np.ascontiguousarray(a, np.float64) for a in (p, v, want))
    if not (np.isfinite(p).all() and np.isfinite(v).all() and np.isfinite(want).all()):
        raise UsageError("a place or a velocity is not finite", where="avoid", fix="leave out who does not know it")
    cells, out, ranks = Cells(n, reach), np.zeros((n, 2)), np.zeros(n, np.int64)
    avoid_all(
        p, v, want, rules.theta(), reach, layer, cells.side, cells.first, cells.members, np.zeros((2 * most, 3)),
        np.zeros(most, np.int64), np.zeros(most), out, ranks,
    )  # fmt: skip
    return out, ranks
