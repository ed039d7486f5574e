"""Signed distances in the plane, and upright: polygons, the cells of a grid, discs.

A polygon is a run of `count` vertices from `first` on in an array (n, 2), closed by itself, either way round. Signed
distances are exact and negative inside; `upright` makes a column of a flat shape.
"""

from math import hypot, inf, sqrt
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from outrider._kernel import kernel
from outrider.typing import Bools, Floats

Runs: TypeAlias = NDArray[np.int32]
Squares: TypeAlias = NDArray[np.uint8]


@kernel
def upright(flat: float, low: float, high: float, z: float) -> float:
    """Signed distance from a shape that stands between two heights, from its distance in the plane."""
    if flat == inf:
        return inf
    level = max(low - z, z - high)
    return hypot(max(flat, 0.0), max(level, 0.0)) + min(max(flat, level), 0.0)


@kernel
def inside_polygon(outline: Floats, first: int, count: int, x: float, y: float) -> bool:
    """Whether a ray towards +x crosses the outline an odd number of times."""
    inside = False
    bx, by = outline[first + count - 1, 0], outline[first + count - 1, 1]
    for i in range(first, first + count):
        ax, ay = outline[i, 0], outline[i, 1]
        if (ay > y) != (by > y) and x < ax + (y - ay) * (bx - ax) / (by - ay):
            inside = not inside
        bx, by = ax, ay
    return inside


@kernel
def polygon_distance(outline: Floats, first: int, count: int, x: float, y: float) -> float:
    """Signed distance [m] of (x, y) from a polygon."""
    best = inf
    bx, by = outline[first + count - 1, 0], outline[first + count - 1, 1]
    for i in range(first, first + count):
        ax, ay = outline[i, 0], outline[i, 1]
        ex, ey, px, py = bx - ax, by - ay, x - ax, y - ay
        ee = ex * ex + ey * ey
        s = min(max((px * ex + py * ey) / ee, 0.0), 1.0) if ee > 0.0 else 0.0
        px, py = px - s * ex, py - s * ey
        best = min(best, px * px + py * py)
        bx, by = ax, ay
    return -sqrt(best) if inside_polygon(outline, first, count, x, y) else sqrt(best)


def runs(occupied: Bools) -> Runs:
    """(rows, cols, 2) first and last column of the run of alike cells, in its row, to which each cell belongs."""
    rows, cols = occupied.shape
    index = np.broadcast_to(np.arange(cols), (rows, cols))
    change = np.ones((rows, cols + 1), np.bool_)
    change[:, 1:-1] = occupied[:, 1:] != occupied[:, :-1]
    first = np.maximum.accumulate(np.where(change[:, :-1], index, 0), axis=1)
    last = np.minimum.accumulate(np.where(change[:, 1:], index, cols)[:, ::-1], axis=1)[:, ::-1]
    return np.stack([first, last], axis=2).astype(np.int32)


def free_squares(occupied: Bools) -> Squares:
    """(rows, cols) cells to the nearest occupied one, as a chess king walks, at most 255; 0 where it is occupied."""
    from scipy.ndimage import distance_transform_cdt  # slow to import

    if not occupied.any():
        return np.full(occupied.shape, 255, np.uint8)
    walk: Any = distance_transform_cdt(~occupied, metric="chessboard")
    return np.minimum(walk, 255).astype(np.uint8)


@kernel
def _row_gap(occupied: Bools, run: Runs, wanted: bool, row: int, col: int, x: float) -> float:
    """Distance along a row [cells] from x, in or nearest to column `col`, to the nearest cell that is as wanted.

    Beyond the grid everything is free."""
    cols = occupied.shape[1]
    if occupied[row, col] == wanted:
        return max(col - x, x - col - 1.0, 0.0)
    left, right = run[row, col, 0], run[row, col, 1] + 1  # the edges of this run
    gap = inf
    if left > 0 or not wanted:
        gap = x - left
    if right < cols or not wanted:
        gap = min(gap, right - x)
    return max(gap, 0.0)


@kernel
def grid_distance(
    occupied: Bools, run: Runs, west: float, south: float, resolution: float, x: float, y: float
) -> float:
    """Signed distance [m] of (x, y) from the occupied cells, as closed squares: exact, row by row outward.

    run : from `runs`;  inf when no cell is occupied. Costs the distance in cells, whatever the size of the grid.
    """
    rows, cols = occupied.shape
    u, v = (x - west) / resolution, (y - south) / resolution
    col = int(min(max(np.floor(u), 0.0), cols - 1.0))
    row = int(min(max(np.floor(v), 0.0), rows - 1.0))
    within = 0.0 <= u <= cols and 0.0 <= v <= rows
    inside = within and bool(occupied[row, col])
    best = inf
    if inside:  # beyond the grid it is free
        best = min(v, rows - v)
    for k in range(rows):
        above, below = row + k, row - k
        up, down = max(above - v, 0.0), max(v - below - 1.0, 0.0)
        if k == 0:
            up = down = max(up, down)
        if (up >= best or above >= rows) and (down >= best or below < 0):
            break
        if above < rows and up < best:
            best = min(best, hypot(up, _row_gap(occupied, run, not inside, above, col, u)))
        if below >= 0 and down < best:
            best = min(best, hypot(down, _row_gap(occupied, run, not inside, below, col, u)))
    return -best * resolution if inside else best * resolution
