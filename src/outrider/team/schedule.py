"""Commands known beforehand."""

from dataclasses import dataclass
from typing import final

import numpy as np

from outrider.errors import ConfigError
from outrider.typing import Floats


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Schedule:
    """Commands at given times, each held until the next. t_s : (m,) seconds since the start;  u : (m, inputs)."""

    t_s: Floats
    u: Floats

    def __post_init__(self) -> None:
        if self.u.ndim != 2 or self.t_s.shape != self.u.shape[:1] or not len(self.u):
            raise ConfigError(f"{self.t_s.shape} times for commands {self.u.shape}", where="schedule", fix="a row each")
        if not bool(np.isfinite(self.t_s).all() and np.isfinite(self.u).all() and (np.diff(self.t_s) > 0).all()):
            raise ConfigError("times do not increase, or are no numbers", where="schedule", fix="sort the rows")

    def plan(self, seconds: Floats) -> Floats:
        """(n, inputs) the command in force at each time; nothing is commanded before the first."""
        row = np.searchsorted(self.t_s, seconds + 1e-9, side="right") - 1
        return np.where((row < 0)[:, None], 0.0, self.u[np.maximum(row, 0)])
