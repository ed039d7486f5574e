"""What a beam meets first: occupied cells, upright prisms and columns, the ground.

A beam starts at o and runs along the unit vector d (site frame); answers are ranges [m]: 0 from inside, inf for nothing
within `reach`. Upright things are solved in the plane, over the piece of the beam that is between their heights.
"""

from math import floor, inf, sqrt

from outrider._kernel import kernel
from outrider.core.flat import Squares, inside_polygon
from outrider.typing import Floats

_JUMP = 3  # cells: a shorter way is walked


@kernel
def _between(low: float, high: float, o: float, d: float, start: float, end: float) -> tuple[float, float]:
    """The piece of [start, end] in which o + t d lies between low and high; empty: start > end."""
    if d == 0.0:
        return (start, end) if low <= o <= high else (1.0, 0.0)
    a, b = (low - o) / d, (high - o) / d
    if a > b:
        a, b = b, a
    return max(start, a), min(end, b)


@kernel
def cast_grid(
    free: Squares,
    west: float,
    south: float,
    resolution: float,
    top: float,
    ox: float,
    oy: float,
    oz: float,
    dx: float,
    dy: float,
    dz: float,
    reach: float,
) -> float:
    """Range to the first occupied cell, a square that fills everything below `top`, at its very boundary.

    free : (rows, cols) of `flat.free_squares`, 0 where a cell is occupied.

    Every cell that the beam touches is passed, in order: from one to the next across whichever boundary comes first.
    Through a corner it goes by way of a neighbour, so no beam slips between two cells that meet there. Where a whole
    square around a cell is free, all boundaries up to the square's own are crossed at once.
    J. Amanatides, A. Woo, "A fast voxel traversal algorithm for ray tracing", Eurographics 1987.
    """
    rows, cols = free.shape
    east, north = west + cols * resolution, south + rows * resolution
    start, end = _between(-inf, top, oz, dz, 0.0, reach)
    start, end = _between(west, east, ox, dx, start, end)
    start, end = _between(south, north, oy, dy, start, end)
    if not start <= end:
        return inf
    col = min(max(floor((ox + start * dx - west) / resolution), 0), cols - 1)
    row = min(max(floor((oy + start * dy - south) / resolution), 0), rows - 1)
    # where the next column and the next row begin, and how far apart such boundaries are
    t_col, every_col, by_col, t_row, every_row, by_row = inf, inf, 1, inf, inf, 1
    if dx != 0.0:
        by_col = 1 if dx > 0.0 else -1
        t_col, every_col = (west + (col + (dx > 0.0)) * resolution - ox) / dx, resolution / abs(dx)
    if dy != 0.0:
        by_row = 1 if dy > 0.0 else -1
        t_row, every_row = (south + (row + (dy > 0.0)) * resolution - oy) / dy, resolution / abs(dy)
    per_col, per_row = abs(dx) / resolution, abs(dy) / resolution
    t = start
    while t <= end:
        n = int(free[row, col])
        if n == 0:
            return max(t, start)
        if n < _JUMP:
            if t_col < t_row:
                t, t_col, col = t_col, t_col + every_col, col + by_col
            else:
                t, t_row, row = t_row, t_row + every_row, row + by_row
        else:
            out_col, out_row = t_col + (n - 1) * every_col, t_row + (n - 1) * every_row
            t = min(out_col, out_row)
            if t_col <= t:
                n = int((t - t_col) * per_col) + 1
                t_col, col = t_col + n * every_col, col + n * by_col
            if t_row <= t:
                n = int((t - t_row) * per_row) + 1
                t_row, row = t_row + n * every_row, row + n * by_row
        if col < 0 or col >= cols or row < 0 or row >= rows:
            return inf
    return inf


@kernel
def cast_prism(
    outline: Floats,
    first: int,
    count: int,
    low: float,
    high: float,
    ox: float,
    oy: float,
    oz: float,
    dx: float,
    dy: float,
    dz: float,
    reach: float,
) -> float:
    """Range to an upright prism over a polygon (see `flat`), through a side, its roof or its floor.

    Which side of the beam a vertex lies on is decided once for both of its edges: nothing slips through a corner.
    """
    start, best = _between(low, high, oz, dz, 0.0, reach)
    if not start <= best:
        return inf
    if inside_polygon(outline, first, count, ox + start * dx, oy + start * dy):
        return start
    hit, scale = inf, dx * dx + dy * dy
    bx, by = outline[first + count - 1, 0] - ox, outline[first + count - 1, 1] - oy
    b_side = bx * dy - by * dx
    for i in range(first, first + count):
        ax, ay = outline[i, 0] - ox, outline[i, 1] - oy
        a_side = ax * dy - ay * dx
        if (a_side > 0.0) != (b_side > 0.0):
            s = a_side / (a_side - b_side)
            t = ((ax + s * (bx - ax)) * dx + (ay + s * (by - ay)) * dy) / scale
            if start <= t <= best:
                hit = best = t
        bx, by, b_side = ax, ay, a_side
    return hit


@kernel
def cast_column(
    x: float,
    y: float,
    radius: float,
    low: float,
    high: float,
    ox: float,
    oy: float,
    oz: float,
    dx: float,
    dy: float,
    dz: float,
    reach: float,
) -> float:
    """Range to an upright cylinder about (x, y)."""
    start, end = _between(low, high, oz, dz, 0.0, reach)
    if not start <= end:
        return inf
    mx, my = ox + start * dx - x, oy + start * dy - y
    outside = mx * mx + my * my - radius * radius
    if outside <= 0.0:
        return start
    a, b = dx * dx + dy * dy, mx * dx + my * dy
    disc = b * b - a * outside
    if b >= 0.0 or disc < 0.0:
        return inf
    t = start + outside / (sqrt(disc) - b)  # the nearer root, without cancellation
    return t if t <= end else inf


@kernel
def cast_ground(
    slope_e: float, slope_n: float, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float, reach: float
) -> float:
    """Range to the plane z = slope_e x + slope_n y from above; from below there is no ground to meet."""
    height, sinking = oz - slope_e * ox - slope_n * oy, slope_e * dx + slope_n * dy - dz
    if height < 0.0 or sinking <= 0.0:
        return inf
    t = height / sinking
    return t if t <= reach else inf
