"""A robot's outline against the square cells of a map: exact, for everything within `radius` of a convex outline."""

from enum import Enum
from math import cos, floor, hypot, inf, sin
from typing import Any, final

import numpy as np

from outrider._kernel import inlined, kernel
from outrider.data.footprint import Footprint
from outrider.data.grid import LETHAL, UNKNOWN, Costmap
from outrider.errors import DataError
from outrider.mapping.inflation import Inflation
from outrider.typing import Floats, Ints


class Stand(Enum):
    """Whether a robot can stand somewhere."""

    CLEAR = "nothing is in the way"
    TAKEN = "the footprint covers a cell that is taken: move away from it, or turn"
    UNKNOWN = "the footprint covers a cell that nobody has seen: look there first, or allow unknown ground"
    OUTSIDE = "the footprint leaves the map: draw more of the site"


_STANDS = tuple(Stand)


@final
class FootprintCheck:
    """Whether a footprint fits at a pose on a costmap, where 253 (`INSCRIBED`) alone is not safe.

    The footprint is held against every lethal cell as a closed square. Where the cost at its middle says that nothing
    lethal can be as near as its circumscribed radius, that is not needed: `inflation` is the one that made the costmap,
    or None for a costmap that promises nothing.
    """

    def __init__(
        self,
        footprint: Footprint,
        *,
        resolution: float,
        inflation: Inflation | None = None,
        unknown_blocks: bool = True,
    ) -> None:
        self.footprint, self._unknown = footprint, unknown_blocks
        self._placed = np.empty_like(footprint.outline)
        self.safe_below = _safe_below(footprint, resolution, inflation, unknown_blocks)

    def __call__(self, costmap: Costmap, pose: Floats) -> tuple[Stand, Ints]:
        """At pose (3,): east, north [m], heading [rad]; and the row and column that is in the way, (-1, -1) if none.

        Raises DataError for a pose that is not finite.
        """
        if not np.isfinite(pose).all():
            raise DataError("a pose that is not finite", where="footprint check")
        x, y, heading = pose.tolist()
        code, row, col = stands(
            costmap.cells,
            float(costmap.origin[0]),
            float(costmap.origin[1]),
            costmap.resolution,
            self.footprint.outline,
            self.footprint.radius,
            self.safe_below,
            self._unknown,
            x,
            y,
            heading,
            self._placed,
        )
        return _STANDS[code], np.array([row, col])


def _safe_below(footprint: Footprint, resolution: float, inflation: Inflation | None, unknown_blocks: bool) -> int:
    """Costs below this, at the footprint's middle, promise that it touches nothing lethal; 0: none does."""
    if inflation is None or unknown_blocks:  # cost does not tell how far the unknown is
        return 0
    needed = footprint.circumscribed + np.sqrt(2.0) * resolution  # from middle of cell to middle of cell
    return int(inflation.cost(np.array([needed]))[0]) if needed < inflation.radius - resolution else 0


@kernel
def stands(
    cells: Any,
    west: float,
    south: float,
    resolution: float,
    outline: Floats,
    radius: float,
    safe_below: int,
    unknown_blocks: bool,
    x: float,
    y: float,
    heading: float,
    placed: Floats,
) -> tuple[int, int, int]:
    """0 clear, 1 taken, 2 unknown, 3 outside; row and column of the cell in the way, -1 where there is none.

    placed : (n, 2), overwritten with the outline at the pose;  see `FootprintCheck`.
    """
    rows, cols = cells.shape
    if not (west <= x < west + cols * resolution and south <= y < south + rows * resolution):
        return 3, -1, -1
    row, col = min(floor((y - south) / resolution), rows - 1), min(floor((x - west) / resolution), cols - 1)
    if cells[row, col] == LETHAL:
        return 1, row, col
    if cells[row, col] < safe_below:
        return 0, -1, -1
    c, s = cos(heading), sin(heading)
    for i in range(outline.shape[0]):
        placed[i, 0] = x + c * outline[i, 0] - s * outline[i, 1]
        placed[i, 1] = y + s * outline[i, 0] + c * outline[i, 1]
    r0, r1, c0, c1 = _cells(west, south, resolution, placed, radius)
    if r0 < 0 or c0 < 0 or r1 >= rows or c1 >= cols:
        return 3, -1, -1
    seen, seen_row, seen_col = 0, -1, -1
    for row in range(r0, r1 + 1):
        for col in range(c0, c1 + 1):
            cost = cells[row, col]
            if cost == LETHAL or (unknown_blocks and cost == UNKNOWN and seen == 0):
                bx, by = west + col * resolution, south + row * resolution
                if touches(placed, radius, bx, by, bx + resolution, by + resolution):
                    if cost == LETHAL:
                        return 1, row, col
                    seen, seen_row, seen_col = 2, row, col
    return seen, seen_row, seen_col


@kernel
def _cells(west: float, south: float, resolution: float, outline: Floats, radius: float) -> tuple[int, int, int, int]:
    """First and last row, first and last column of the box around an outline, also beyond the map."""
    low_x, high_x, low_y, high_y = inf, -inf, inf, -inf
    for i in range(outline.shape[0]):
        low_x, high_x = min(low_x, outline[i, 0] - radius), max(high_x, outline[i, 0] + radius)
        low_y, high_y = min(low_y, outline[i, 1] - radius), max(high_y, outline[i, 1] + radius)
    r0, r1 = floor((low_y - south) / resolution), floor((high_y - south) / resolution)
    return r0, r1, floor((low_x - west) / resolution), floor((high_x - west) / resolution)


@kernel
def stamp(
    cells: Any, west: float, south: float, resolution: float, outline: Floats, radius: float, share: float, value: int
) -> None:
    """Set every cell that comes within `radius` of a convex outline (n, 2) [m].

    share : of a cell's side around its middle that counts: 0.5 for whole squares, 0 for their middles.
    """
    rows, cols = cells.shape
    r0, r1, c0, c1 = _cells(west, south, resolution, outline, radius)
    for row in range(max(r0, 0), min(r1, rows - 1) + 1):
        for col in range(max(c0, 0), min(c1, cols - 1) + 1):
            x, y, half = west + (col + 0.5) * resolution, south + (row + 0.5) * resolution, share * resolution
            if touches(outline, radius, x - half, y - half, x + half, y + half):
                cells[row, col] = value


@kernel
def touches(outline: Floats, radius: float, x0: float, y0: float, x1: float, y1: float) -> bool:
    """Whether a closed box comes within `radius` of a convex outline (n, 2), counter-clockwise.

    They overlap unless the box is beyond an edge of the outline, or the outline beyond a side of the box; if they do
    not, a corner of one is what is nearest to the other.
    """
    n = outline.shape[0]
    x, y, half_x, half_y = 0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.5 * (x1 - x0), 0.5 * (y1 - y0)
    low_x, high_x, low_y, high_y = inf, -inf, inf, -inf
    beyond = n == 1
    bx, by = outline[n - 1, 0], outline[n - 1, 1]
    for i in range(n):
        ax, ay = outline[i, 0], outline[i, 1]
        low_x, high_x, low_y, high_y = min(low_x, ax), max(high_x, ax), min(low_y, ay), max(high_y, ay)
        ex, ey = ax - bx, ay - by
        inmost = ex * (y - by) - ey * (x - bx) + abs(ex) * half_y + abs(ey) * half_x
        beyond = beyond or inmost < 0.0
        bx, by = ax, ay
    if not (beyond or low_x > x1 or high_x < x0 or low_y > y1 or high_y < y0):
        return True
    if low_x - radius > x1 or high_x + radius < x0 or low_y - radius > y1 or high_y + radius < y0:
        return False
    for i in range(n):
        ax, ay = outline[i, 0], outline[i, 1]
        gap_x, gap_y = max(x0 - ax, ax - x1, 0.0), max(y0 - ay, ay - y1, 0.0)
        if gap_x * gap_x + gap_y * gap_y <= radius * radius:
            return True
        for k in range(4 if radius > 0.0 else 0):
            px, py = (x0 if k & 1 == 0 else x1), (y0 if k & 2 == 0 else y1)
            if segment_distance(ax, ay, bx - ax, by - ay, px, py) <= radius:
                return True
        bx, by = ax, ay
    return False


@inlined
def segment_distance(ax: float, ay: float, ex: float, ey: float, px: float, py: float) -> float:
    """Of (px, py) from the segment that starts at (ax, ay) and goes (ex, ey) [m]."""
    ee = ex * ex + ey * ey
    s = min(max(((px - ax) * ex + (py - ay) * ey) / ee, 0.0), 1.0) if ee > 0.0 else 0.0
    return hypot(px - ax - s * ex, py - ay - s * ey)
