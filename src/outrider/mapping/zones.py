"""Where a robot may not go, how fast it may go, and which way."""

from dataclasses import dataclass
from math import cos, inf
from typing import Final, final

import numpy as np
import shapely
from numpy.typing import NDArray

from outrider.core.flat import inside_polygon
from outrider.data.grid import LETHAL, Grid
from outrider.data.site import Shape
from outrider.typing import Bools, Floats

ASIDE: Final = 0.3  # m
_HAIR: Final = 1e-9  # a right angle is not against
_DEAREST: Final = 252  # of the cells that may be crossed
_STEPS: Final = ((0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1))  # rows, columns


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
        return 0.0 if self.barred(p) else self.speed_limit(p)

    def speed_limit(self, p: Floats) -> float:
        """m/s that speed zones allow at (2,) m, inf where there is none."""
        return min((s.speed for s in self.speed if _holds(s, p)), default=inf)

    def slowest(self, points: Floats) -> float:
        """m/s allowed on the whole of a way (n, 2) m. Given the way that a robot needs to stop, it is slow in time."""
        return min((self.speed_at(p) for p in points), default=0.0)

    def against(self, p: Floats, heading: float) -> Shape | None:
        """The one-way zone at (2,) m that moving along `heading` [rad] goes against (by more than a right angle)."""
        return next((s for s in self.one_way if _holds(s, p) and cos(heading - s.heading) < -_HAIR), None)

    @property
    def ways(self) -> NDArray[np.uint8] | None:
        """(rows, cols) bits of the directions in which cells may be left (see `Costmap`), None where all may.

        A step is barred that begins or ends in a one-way zone, or within `ASIDE` of it, and goes against it: a robot
        that goes along its edge is not to stray into it.
        """
        if not self.one_way:
            return None
        out = np.full(self.keep_out.shape, 255, np.uint8)
        for shape in self.one_way:
            within = self._within(shape, ASIDE)
            padded = np.pad(within, 1)
            for d in np.flatnonzero(np.cos(0.25 * np.pi * np.arange(8) - shape.heading) < -_HAIR).tolist():
                row, col = _STEPS[d]
                ends = padded[1 + row : 1 + row + len(within), 1 + col : 1 + col + within.shape[1]]
                out[within | ends] &= np.uint8(255 - (1 << d))
        return out

    def least_costs(self, speed: float, weight: float) -> NDArray[np.uint8] | None:
        """(rows, cols) what cells cost a robot of `speed` [m/s] so that a metre in a speed zone costs as many metres of
        free ground as could be driven meanwhile; None where no zone slows it.

        weight : of the planner's `Traversal`, of which the dearest cell costs 1 + weight.
        """
        slow = [s for s in self.speed if s.speed < speed]
        if not slow or weight <= 0.0:
            return None
        out = np.zeros(self.keep_out.shape, np.uint8)
        for shape in slow:
            cost = min((speed / shape.speed - 1.0) * _DEAREST / weight, _DEAREST)
            within = self._within(shape)
            out[within] = np.maximum(out[within], np.uint8(round(cost)))
        return out

    def _within(self, shape: Shape, aside: float = 0.0) -> Bools:
        """(rows, cols) whether the middle of a cell is in a shape, or no further than `aside` [m] from it."""
        rows, cols = self.keep_out.shape
        x, y = (self.on.origin[k] + (np.arange(n) + 0.5) * self.on.resolution for k, n in enumerate((cols, rows)))
        area = shapely.Polygon(shape.points, [*shape.holes]).buffer(aside)
        return shapely.contains_xy(area, *np.meshgrid(x, y))


def _holds(shape: Shape, p: Floats) -> bool:
    x, y = float(p[0]), float(p[1])
    rings = [np.ascontiguousarray(r, np.float64) for r in (shape.points, *shape.holes)]
    return sum(bool(inside_polygon(r, 0, len(r), x, y)) for r in rings) % 2 == 1
