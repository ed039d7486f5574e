"""What a cell of a costmap costs a planner to cross."""

from dataclasses import dataclass
from typing import Final, final

import numpy as np

from outrider.data.grid import INSCRIBED, UNKNOWN
from outrider.errors import ConfigError
from outrider.planning.search import BLOCKED, SLANT, UNIT
from outrider.typing import Floats, Ints

_GRADES: Final = 252  # the dearest cell that may be crossed
_HEAVIEST: Final = 64.0  # times free ground: what integer costs of a long way leave room for


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Traversal:
    """The rules of a step from cell a to its neighbour b, straight (1) or diagonal (sqrt 2 cells):

        cost = length * (w_a + w_b) / 2,   w = 1 + weight * cell / 252

    in cells of free ground. Cells of 253 and more are never entered.

    weight : what it is worth to stay away from things: the dearest cell costs as much as 1 + weight free ones;
    unknown : the cost, 0..252, that a cell nobody has seen is taken to have; None: it is never entered;
    corner_cutting : whether a diagonal step may pass a taken cell. If so the rule is that of scikit-image's
    MCP_Geometric; if not, that of the MovingAI benchmarks, and of robots that are wider than a point.
    """

    weight: float = 3.0
    unknown: int | None = None
    corner_cutting: bool = False

    def __post_init__(self) -> None:
        if not 0.0 <= self.weight < _HEAVIEST:
            raise ConfigError(
                f"weight is {self.weight:g}", where="traversal", fix=f"0 and more, less than {_HEAVIEST:g}"
            )
        if self.unknown is not None and not 0 <= self.unknown <= _GRADES:
            raise ConfigError(
                f"unknown is {self.unknown}", where="traversal", fix=f"0..{_GRADES}, or none: do not enter"
            )

    @property
    def weights(self) -> Floats:
        """(256,) w of a cell of each cost, inf where it is never entered."""
        cost = np.arange(256)
        w = np.where(cost < INSCRIBED, 1.0 + self.weight * cost / _GRADES, np.inf)
        if self.unknown is not None:
            w[UNKNOWN] = w[self.unknown]
        return w

    def halves(self) -> tuple[Ints, Ints]:
        """(256,) of half a straight and half a diagonal step, in the units of `search`, `BLOCKED` where w is inf."""
        w = self.weights
        barred = np.isinf(w)
        straight, diagonal = (
            np.rint(np.where(barred, 0.0, w) * unit / 4).astype(np.int64) * 2 for unit in (UNIT, SLANT)
        )
        return np.where(barred, BLOCKED, straight), np.where(barred, BLOCKED, diagonal)
