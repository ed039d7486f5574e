"""Along a timed path on one's own estimate: no faster than one keeps up, and to a stop where that is asked for."""

from dataclasses import dataclass
from math import hypot, sqrt
from typing import Final, Protocol, final

import numpy as np

from outrider.core.angles import wrap
from outrider.team.navigator import Fused
from outrider.typing import Floats

SLACK: Final = 0.4  # m behind the path up to which it is followed at its own speed
RAMP: Final = 1.0  # 1/s by which the share of the path's speed changes
TURN: Final = 1.5  # 1/s: rate of turning by the error of the heading


class Path(Protocol):
    """When to be where."""

    @property
    def duration(self) -> float:
        """s."""
        ...

    def at(self, t: Floats) -> tuple[Floats, Floats]:
        """Place and velocity (k, 3) at times (k,)."""
        ...


@final
@dataclass(slots=True, kw_only=True)
class Follower:
    """s : s of the path that are done;  rate : how fast it is followed, as a share;  gain : 1/s, of what is off."""

    path: Path
    gain: float = 0.8
    turn: float = 0.8  # rad/s at most
    s: float = 0.0
    rate: float = 0.0

    @property
    def over(self) -> bool:
        """Whether all of it is done."""
        return self.s >= self.path.duration - 1e-9

    def place(self) -> Floats:
        """(3,) m where it should be."""
        return self.path.at(np.array([self.s]))[0][0]

    def step(self, here: Fused, period_s: float, to_s: float | None = None) -> tuple[Floats, float]:
        """Velocity (3,) in the site frame and turn rate for the next period; towards `to_s` of the path, by default its
        end."""
        goal = self.path.duration if to_s is None else to_s
        behind = _length(self.place() - here.p)
        wanted = _clipped(goal - self.s, -1.0, 1.0) * _clipped(2.0 - behind / SLACK, 0.0, 1.0)
        self.rate += _clipped(wanted - self.rate, -RAMP * period_s, RAMP * period_s)
        self.s = _clipped(self.s + self.rate * period_s, 0.0, self.path.duration)
        p, v = (row[0] for row in self.path.at(np.array([self.s])))
        return self.rate * v + self.gain * (p - here.p), self.turning(here, v)

    def turning(self, here: Fused, v: Floats) -> float:
        """rad/s towards where a velocity points."""
        if hypot(v[0], v[1]) < 0.05:
            return 0.0
        off = wrap(float(np.arctan2(v[1], v[0])) - here.heading)
        return _clipped(TURN * off, -self.turn, self.turn)


def _clipped(x: float, low: float, high: float) -> float:
    return min(max(x, low), high)


def _length(v: Floats) -> float:
    return sqrt(float(v.dot(v)))


def within(v: Floats, speed: float) -> Floats:
    """The velocity, no faster than `speed`."""
    fast = _length(v)
    return v * (speed / fast) if fast > speed else v
