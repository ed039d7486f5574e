"""Where the one that is followed has been, and the point of its trail to fly at. swarm2023, algorithm 1."""

from dataclasses import dataclass, field
from enum import Enum
from math import inf
from typing import final

import numpy as np

from outrider.core.bezier import bezier
from outrider.typing import Floats


class Aim(Enum):
    """Which point of the curve is flown at."""

    POINTS = "one after the other, as swarm2023 does: some may lie behind"
    END = "its end"


@final
@dataclass(slots=True, kw_only=True)
class Trail:
    """degree : n of the curve, so many points every `every_s` s make one;  aim : which of its points is flown at."""

    degree: int = 3
    every_s: float = 1.0
    aim_at: Aim = Aim.END
    _seen: list[Floats] = field(default_factory=list[Floats])
    _curve: Floats | None = None
    _step: int = 0
    _next_s: float = -inf

    def see(self, t_s: float, p: Floats) -> None:
        """Where it is."""
        if t_s < self._next_s - 1e-9:
            return
        self._next_s = t_s + self.every_s
        self._seen.append(p.copy())
        self._step += 1
        if len(self._seen) > self.degree and (self._curve is None or self._step > self.degree):
            self._curve, self._step = np.array(self._seen[-self.degree - 1 :]), 0
        del self._seen[: -self.degree - 1]

    def aim(self, p: Floats) -> Floats | None:
        """(3,) m to fly at; None before there is a curve."""
        if self._curve is None:
            return None
        if self.aim_at is Aim.END:
            return self._seen[-1]
        return bezier(self._curve, min(self._step / self.degree, 1.0))
