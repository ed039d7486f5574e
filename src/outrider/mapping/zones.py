"""Where a robot may not go, how fast it may go, and which way."""

from dataclasses import dataclass
from math import cos, inf
from typing import final

import numpy as np
from numpy.typing import NDArray

from outrider.core.flat import inside_polygon
from outrider.data.grid import LETHAL, Grid
from outrider.data.site import Shape
from outrider.typing import Floats


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Zones:
    """The limits of a site, on the cells of its map.

    keep_out : (rows, cols) uint8, 254 where nobody may go, else 0, on the grid `on`;  speed, one_way : shapes with
    areas. Beyond the map nothing is allowed: a robot that has left its zones' map has no limits that it knows.
    """

    on: Grid
    keep_out: NDArray[np.uint8]
    speed: tuple[Shape, ...] = ()
    one_way: tuple[Shape, ...] = ()

    def barred(self, p: Floats) -> bool:
        """Whether (2,) m is in a keep-out zone, or beyond the map."""
        row, col = self.on.cell_of(p).tolist()
        rows, cols = self.keep_out.shape
        return not (0 <= row < rows and 0 <= col < cols) or bool(self.keep_out[row, col] == LETHAL)

    def speed_at(self, p: Floats) -> float:
        """m/s allowed at (2,) m: the lowest of all zones there, inf where there is none, 0 where nobody may go."""
        return 0.0 if self.barred(p) else min((s.speed for s in self.speed if _holds(s, p)), default=inf)

    def slowest(self, points: Floats) -> float:
        """m/s allowed on the whole of a way (n, 2) m. Given the way that a robot needs to stop, it is slow in time."""
        return min((self.speed_at(p) for p in points), default=0.0)

    def against(self, p: Floats, heading: float) -> Shape | None:
        """The one-way zone at (2,) m that moving along `heading` [rad] goes against (by more than a right angle)."""
        return next((s for s in self.one_way if _holds(s, p) and cos(heading - s.heading) < 0.0), None)


def _holds(shape: Shape, p: Floats) -> bool:
    x, y = float(p[0]), float(p[1])
    rings = [np.ascontiguousarray(r, np.float64) for r in (shape.points, *shape.holes)]
    return sum(bool(inside_polygon(r, 0, len(r), x, y)) for r in rings) % 2 == 1
