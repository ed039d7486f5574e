"""Where a plan starts and ends, whether a robot may stand there, and the nearest place where it may."""

from dataclasses import dataclass
from typing import Final, final

import numpy as np
from scipy import ndimage

from outrider.data.grid import Costmap
from outrider.data.routes import PathOutcome
from outrider.errors import UsageError
from outrider.planning.traversal import Traversal
from outrider.typing import Bools, Floats, Ints

_WINDOW: Final = 64  # cells around a place that are looked at first


@final
@dataclass(frozen=True, slots=True)
class Ends:
    """Row and column of the first and the last cell; `outcome`: why there can be no way between them."""

    start: tuple[int, int]
    goal: tuple[int, int]
    outcome: PathOutcome | None

    def suggest(self, costmap: Costmap, traversal: Traversal) -> Floats | None:
        """(2,) m: where to start instead, or the reachable place nearest to the goal."""
        if self.outcome in (PathOutcome.START_OUTSIDE, PathOutcome.START_BLOCKED):
            cell = nearest_cell(passable(costmap, traversal), self.start)
            return None if cell is None else costmap.centre_of(cell)
        return nearest_reachable(costmap, traversal, self.start, self.goal)


def find_ends(costmap: Costmap, traversal: Traversal, start: Floats, goal: Floats, budget_s: float) -> Ends:
    """Check what a plan is asked for."""
    for name, p in (("start", start), ("goal", goal)):
        if np.shape(p) != (2,) or not np.isfinite(p).all():
            raise UsageError(
                f"{np.asarray(p).tolist()} is no position", where=f"plan, {name}", fix="two finite numbers, in metres"
            )
    if not budget_s > 0.0:
        raise UsageError(f"a budget of {budget_s:g} s", where="plan", fix="more than 0 s")
    cells = [_cell(costmap, np.asarray(p, np.float64)) for p in (start, goal)]
    outcome = None
    for (row, col), outside, blocked in (
        (cells[1], PathOutcome.GOAL_OUTSIDE, PathOutcome.GOAL_BLOCKED),
        (cells[0], PathOutcome.START_OUTSIDE, PathOutcome.START_BLOCKED),
    ):
        if not (0 <= row < costmap.cells.shape[0] and 0 <= col < costmap.cells.shape[1]):
            outcome = outside
        elif np.isinf(traversal.weights[costmap.cells[row, col]]):
            outcome = blocked
    return Ends(cells[0], cells[1], outcome)


def _cell(costmap: Costmap, p: Floats) -> tuple[int, int]:
    far = 2.0**31 * costmap.resolution
    row, col = costmap.cell_of(np.clip(p, costmap.origin - far, costmap.origin + far))
    return int(row), int(col)


def passable(costmap: Costmap, traversal: Traversal) -> Bools:
    """(rows, cols) whether a robot's centre may be in a cell."""
    return np.isfinite(traversal.weights)[costmap.cells]


def nearest_reachable(
    costmap: Costmap, traversal: Traversal, start: tuple[int, int], goal: tuple[int, int]
) -> Floats | None:
    """(2,) m: the middle of the cell nearest to the goal that some way from the start leads to."""
    order = 2 if traversal.corner_cutting else 1  # without cutting, two straights reach whatever a diagonal does
    rooms = np.empty(costmap.cells.shape, np.int32)
    joined = ndimage.generate_binary_structure(2, order)
    ndimage.label(passable(costmap, traversal), structure=joined, output=rooms)
    cell = nearest_cell(rooms == rooms[start], goal)
    return None if cell is None else costmap.centre_of(cell)


def nearest_cell(wanted: Bools, to: tuple[int, int]) -> Ints | None:
    """(2,) row and column of the wanted cell nearest to a cell, which may be off the map; None if there is none."""
    rows, cols = wanted.shape
    row, col = min(max(to[0], 0), rows - 1), min(max(to[1], 0), cols - 1)
    reach = _WINDOW
    while True:
        south, west = max(row - reach, 0), max(col - reach, 0)
        found = np.argwhere(wanted[south : row + reach + 1, west : col + reach + 1]) + np.array([south, west])
        gap = np.hypot(*(found - to).T) if len(found) else np.zeros(0)
        everywhere = reach >= max(rows, cols)
        if len(found) and (everywhere or gap.min() <= reach):  # what is outside the window is further than that
            return found[int(gap.argmin())]
        if everywhere:
            return None
        reach *= 4
