"""From the corners of cells to a line that can be driven: shortened where there is sight, evenly divided, smoothed.

Nothing here makes a way longer or dearer, or leads it into a cell that must not be entered.
"""

from dataclasses import dataclass, field, replace
from math import floor, hypot, inf
from time import perf_counter
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from outrider._kernel import kernel
from outrider.data.grid import Costmap
from outrider.data.routes import GlobalPlanner, Path
from outrider.errors import ConfigError
from outrider.planning.traversal import Traversal
from outrider.typing import Floats, Ints

_SLACK: Final = 1e-9  # relative: what two sums of the same costs may differ by
_SAME: Final = 1e-9  # cells: nearer to a corner than this, a line leads through it


@kernel
def line_cost(
    cells: NDArray[np.uint8], weights: Floats, cutting: int, x: float, y: float, to_x: float, to_y: float
) -> float:
    """Integral of the weight of the ground along a straight line, in cells; inf through a cell that is not entered.

    cells : (rows, cols);  weights : (256,);  x to the east and y to the north, in cells from the map's corner.
    Through the corner of a taken cell a line leads only if corners may be cut.
    J. Amanatides, A. Woo, "A fast voxel traversal algorithm for ray tracing", Eurographics 1987.
    """
    rows, cols = cells.shape
    dx, dy = to_x - x, to_y - y
    length, col, row = hypot(dx, dy), floor(x), floor(y)
    by_col, by_row = 1 if dx > 0.0 else -1, 1 if dy > 0.0 else -1
    every_col, every_row = abs(1.0 / dx) if dx != 0.0 else inf, abs(1.0 / dy) if dy != 0.0 else inf
    t_col = (col + (dx > 0.0) - x) / dx if dx != 0.0 else inf
    t_row = (row + (dy > 0.0) - y) / dy if dy != 0.0 else inf
    t, total = 0.0, 0.0
    while True:
        if row < 0 or row >= rows or col < 0 or col >= cols:
            return inf
        w = float(weights[cells[row, col]])
        if w == inf:
            return inf
        out = min(t_col, t_row)
        if out >= 1.0:
            return total + (1.0 - t) * length * w
        total, t = total + (out - t) * length * w, out
        if abs(t_col - t_row) * length < _SAME:
            across, along = col + by_col, row + by_row
            if across < 0 or across >= cols or along < 0 or along >= rows:
                return inf
            if not cutting and weights[cells[row, across]] + weights[cells[along, col]] == inf:
                return inf
            row, col, t_row, t_col = along, across, t_row + every_row, t_col + every_col
        elif t_col < t_row:
            col, t_col = col + by_col, t_col + every_col
        else:
            row, t_row = row + by_row, t_row + every_row


@kernel
def _line_costs(cells: NDArray[np.uint8], weights: Floats, cutting: int, points: Floats, out: Floats) -> None:
    """`line_cost` between points and the next ones."""
    for i in range(out.size):
        out[i] = line_cost(cells, weights, cutting, points[i, 0], points[i, 1], points[i + 1, 0], points[i + 1, 1])


@kernel
def _pull(cells: NDArray[np.uint8], weights: Floats, cutting: int, points: Floats, kept: Ints) -> int:
    """Indices of the points that a string pulled tight still touches, into `kept`; their number."""
    n = points.shape[0]
    kept[0], count, first, along = 0, 1, 0, 0.0
    for i in range(1, n):
        along += line_cost(cells, weights, cutting, points[i - 1, 0], points[i - 1, 1], points[i, 0], points[i, 1])
        if i == first + 1:
            continue
        straight = line_cost(cells, weights, cutting, points[first, 0], points[first, 1], points[i, 0], points[i, 1])
        if straight > along * (1.0 + _SLACK):
            first = i - 1
            kept[count], count = first, count + 1
            along = line_cost(cells, weights, cutting, points[first, 0], points[first, 1], points[i, 0], points[i, 1])
    kept[count] = n - 1
    return count + 1


@kernel
def _relax(cells: NDArray[np.uint8], weights: Floats, cutting: int, points: Floats, rounds: int, share: float) -> int:
    """Move every point towards the middle of its neighbours, where that does not cost more; the number of moves."""
    moves = 0
    for _ in range(rounds):
        for i in range(1, points.shape[0] - 1):
            ax, ay, bx, by = points[i - 1, 0], points[i - 1, 1], points[i + 1, 0], points[i + 1, 1]
            x, y = points[i, 0], points[i, 1]
            to_x, to_y = x + share * (0.5 * (ax + bx) - x), y + share * (0.5 * (ay + by) - y)
            new = line_cost(cells, weights, cutting, ax, ay, to_x, to_y)
            new += line_cost(cells, weights, cutting, to_x, to_y, bx, by)
            old = line_cost(cells, weights, cutting, ax, ay, x, y) + line_cost(cells, weights, cutting, x, y, bx, by)
            if new <= old:
                points[i, 0], points[i, 1] = to_x, to_y
                moves += 1
    return moves


def shorten(costmap: Costmap, traversal: Traversal, points: Floats) -> Floats:
    """(m, 2) m: the points that are left when straight lines replace whatever is not cheaper than they are.

    points : (n, 2) m, every one in sight of the next.
    """
    kept = np.empty(len(points) + 1, np.int64)
    n = _pull(costmap.cells, traversal.weights, int(traversal.corner_cutting), _in_cells(costmap, points), kept)
    return points[kept[:n]] if len(points) > 1 else points


def resample(points: Floats, spacing: float) -> Floats:
    """(m, 2) m: every piece of a line divided evenly, into parts no longer than `spacing` [m]; all corners are kept."""
    gap = np.diff(points, axis=0)
    parts = np.maximum(np.ceil(np.hypot(gap[:, 0], gap[:, 1]) / spacing - 1e-9), 1.0).astype(np.int64)
    k = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
    share = (k / np.repeat(parts, parts))[:, None]
    inner = np.repeat(points[:-1], parts, axis=0) + share * np.repeat(gap, parts, axis=0)
    return np.concatenate([inner, points[-1:]])


def smooth(costmap: Costmap, traversal: Traversal, points: Floats, *, rounds: int = 40, share: float = 0.5) -> Floats:
    """(n, 2) m: corners rounded, both ends kept; every move leaves the way as cheap or cheaper, and no longer.

    Around a taken cell without dear ground about it the shortest way has a corner, and keeps it.
    share : of the way to the middle between its neighbours that a point goes in each of the rounds.
    """
    moved = _in_cells(costmap, points)
    _relax(costmap.cells, traversal.weights, int(traversal.corner_cutting), moved, rounds, share)
    inner = costmap.origin + moved[1:-1] * costmap.resolution
    return np.concatenate([points[:1], inner, points[len(inner) + 1 :]])


def cost_along(costmap: Costmap, traversal: Traversal, points: Floats) -> float:
    """Metres of free ground that straight lines through the points are worth; inf where one must not lead."""
    return float(np.sum(costs_along(costmap, traversal, points)))


def costs_along(costmap: Costmap, traversal: Traversal, points: Floats) -> Floats:
    """(n - 1,) the same for each of the lines through points (n, 2)."""
    out = np.empty(max(len(points) - 1, 0))
    p, cutting = _in_cells(costmap, points), int(traversal.corner_cutting)
    _line_costs(costmap.cells, traversal.weights, cutting, p, out)
    return out * costmap.resolution


def lawful(costmap: Costmap, points: Floats) -> bool:
    """Whether lines through points (n, 2) m leave every cell in a way in which it may be left."""
    if costmap.ways is None:
        return True
    fine = resample(points, 0.5 * costmap.resolution)
    cell = np.clip(costmap.cell_of(fine), 0, np.array(costmap.cells.shape) - 1)
    leaves = (cell[1:] != cell[:-1]).any(axis=1)
    gap, cell = np.diff(fine, axis=0)[leaves], cell[:-1][leaves]
    ways = costmap.ways[tuple(cell.T)].astype(np.int64)
    eighth = np.arctan2(gap[:, 1], gap[:, 0]) / (0.25 * np.pi)
    low, high = np.floor(eighth + _SAME).astype(np.int64), np.ceil(eighth - _SAME).astype(np.int64)
    return bool((ways >> (low % 8) & ways >> (high % 8) & 1).all())


def _in_cells(costmap: Costmap, points: Floats) -> Floats:
    return np.ascontiguousarray((points - costmap.origin) / costmap.resolution)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Refined:
    """What another planner finds, shortened, divided and smoothed.

    planner : finds the way;  traversal : its rules;  spacing [m] between points;  rounds : of smoothing, 0 for none.
    """

    planner: GlobalPlanner
    traversal: Traversal = field(default_factory=Traversal)
    spacing: float = 0.1
    rounds: int = 40

    def __post_init__(self) -> None:
        if not (0.0 < self.spacing < inf) or self.rounds < 0:
            said = f"spacing {self.spacing:g} m, {self.rounds} rounds"
            raise ConfigError(said, where="refined", fix="a positive spacing, and 0 or more rounds")

    def plan(self, costmap: Costmap, start: Floats, goal: Floats, *, budget_s: float = np.inf) -> Path:
        """See `GlobalPlanner`. Of a budget that has run out the rest is saved on smoothing, not on the path."""
        begun = perf_counter()
        path = self.planner.plan(costmap, start, goal, budget_s=budget_s)
        if len(path.points) < 2:
            return path
        points = resample(shorten(costmap, self.traversal, path.points), self.spacing)
        if perf_counter() - begun < budget_s:
            points = smooth(costmap, self.traversal, points, rounds=self.rounds)
        if not lawful(costmap, points):  # a straight line leads where steps from cell to cell did not
            points = resample(path.points, self.spacing)
        length = float(np.hypot(*np.diff(points, axis=0).T).sum())
        cost = cost_along(costmap, self.traversal, points)
        return replace(path, points=points, length=length, cost=cost, seconds=perf_counter() - begun)
