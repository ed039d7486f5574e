"""Whether a robot that drives comes nearer to its goal at all."""

from dataclasses import dataclass
from math import inf
from typing import Final, final

import numpy as np

from outrider.typing import Floats

GAIN: Final = 0.25  # m that count as nearer
MOVES: Final = 0.05  # m/s or rad/s


@final
@dataclass(slots=True, kw_only=True)
class Progress:
    """Watches the way that is left.

    patience_s : s of driving without coming nearer than ever before;  slow : m/s with which a detour is believed to be
    driven: as much more time as that takes.
    """

    patience_s: float
    slow: float
    least: float = inf
    _far: float = 0.0
    _spent: float = 0.0
    _time: float = inf

    def step(self, t_s: float, left: float, *, drives: bool) -> bool:
        """Whether it has been in vain for too long. left : m of way to the goal;  drives : time counts."""
        dt = max(t_s - self._time, 0.0)
        self._time = t_s
        if left < self.least - GAIN:
            self.least, self._far, self._spent = left, left, 0.0
            return False
        self._far = max(self._far, left)
        self._spent += dt if drives else 0.0
        return self._spent > self.patience_s + (self._far - self.least) / self.slow


def drives(now: Floats, asked: Floats) -> bool:
    """Whether a robot moves, or does not ask to; one that asks and is held back by somebody else does neither."""
    return bool(np.abs(now).max() > MOVES or np.abs(asked).max() <= MOVES)


def way_left(points: Floats, p: Floats) -> float:
    """m along a polyline (n, 2) to its end, from the corner nearest to p (2,) on, and to there."""
    gaps = np.hypot(*(points - p).T)
    k = int(gaps.argmin())
    return float(gaps[k] + np.hypot(*np.diff(points[k:], axis=0).T).sum())
