"""A world as arrays, and its three questions, compiled: how near, who sees whom, what a lidar measures."""

from math import cos, hypot, inf, sin, sqrt
from typing import NamedTuple

import numpy as np

from outrider._kernel import kernel
from outrider.core.flat import Runs, Squares, free_squares, grid_distance, polygon_distance, runs, upright
from outrider.core.rays import cast_column, cast_grid, cast_ground, cast_prism
from outrider.core.rotations import rotate
from outrider.core.solids import cast, distance
from outrider.data import Grid
from outrider.sim.world.parts import Mover, Solids, Wall
from outrider.typing import Bools, Floats, Ints


class Scene(NamedTuple):
    """Things are numbered: solids, walls, movers, the grid.

    solids (m, 24);  outlines (k, 2) of all walls;  walls (w, 7): first vertex, vertices, low, high, a circle around it;
    movers (c, 4): first row, rows, radius, height;  scripts (r, 4): t, x, y, z;  occupied (rows, cols), with its runs
    and free squares of `core.flat`;  grid (4,): west, south, resolution, top;  slope (2,).
    """

    solids: Floats
    outlines: Floats
    walls: Floats
    movers: Floats
    scripts: Floats
    occupied: Bools
    run: Runs
    free: Squares
    grid: Floats
    slope: Floats


def scene(
    solids: Solids, walls: tuple[Wall, ...], movers: tuple[Mover, ...], grid: Grid | None, top: float, slope: Floats
) -> Scene:
    """The arrays of a valid world."""
    occupied = np.zeros((0, 0), np.bool_) if grid is None else np.ascontiguousarray(grid.occupied)
    place = [0.0, 0.0, 1.0] if grid is None else [*grid.origin, grid.resolution]
    return Scene(
        solids=np.ascontiguousarray(solids.table),
        outlines=np.vstack([np.zeros((0, 2)), *(wall.outline for wall in walls)]),
        walls=_walls(walls),
        movers=_movers(movers),
        scripts=np.vstack([np.zeros((0, 4)), *(np.column_stack([m.t_s, m.p]) for m in movers)]),
        occupied=occupied,
        run=runs(occupied),
        free=free_squares(occupied),
        grid=np.array([*place, top]),
        slope=slope,
    )


def _walls(walls: tuple[Wall, ...]) -> Floats:
    rows, first = np.zeros((len(walls), 7)), 0
    for row, wall in zip(rows, walls, strict=True):
        middle = 0.5 * (wall.outline.min(axis=0) + wall.outline.max(axis=0))
        around = np.linalg.norm(wall.outline - middle, axis=1).max()
        row[:] = [first, len(wall.outline), wall.low, wall.high, *middle, around]
        first += len(wall.outline)
    return rows


def _movers(movers: tuple[Mover, ...]) -> Floats:
    first = np.cumsum([0, *(m.t_s.size for m in movers)])
    rows = [[first[i], m.t_s.size, m.radius, m.height] for i, m in enumerate(movers)]
    return np.array(rows, dtype=np.float64).reshape(-1, 4)


@kernel
def mover_at(s: Scene, k: int, t: float) -> tuple[float, float, float]:
    """Foot of mover k at time t [s]: straight between the stamps of its script, held at both ends."""
    low, high = int(s.movers[k, 0]), int(s.movers[k, 0] + s.movers[k, 1]) - 1
    if t <= s.scripts[low, 0]:
        return s.scripts[low, 1], s.scripts[low, 2], s.scripts[low, 3]
    if t >= s.scripts[high, 0]:
        return s.scripts[high, 1], s.scripts[high, 2], s.scripts[high, 3]
    while high - low > 1:
        middle = (low + high) // 2
        if s.scripts[middle, 0] <= t:
            low = middle
        else:
            high = middle
    u = (t - s.scripts[low, 0]) / (s.scripts[high, 0] - s.scripts[low, 0])
    v = 1.0 - u
    return (
        v * s.scripts[low, 1] + u * s.scripts[high, 1],
        v * s.scripts[low, 2] + u * s.scripts[high, 2],
        v * s.scripts[low, 3] + u * s.scripts[high, 3],
    )


@kernel
def _clearance(s: Scene, x: float, y: float, z: float, t: float) -> tuple[float, int]:
    """Signed distance from the nearest thing, and its number; (inf, -1) in an empty world."""
    best, which = distance(s.solids, x, y, z)
    number = s.solids.shape[0]
    for k in range(s.walls.shape[0]):
        if hypot(x - s.walls[k, 4], y - s.walls[k, 5]) - s.walls[k, 6] < best:
            flat = polygon_distance(s.outlines, int(s.walls[k, 0]), int(s.walls[k, 1]), x, y)
            d = upright(flat, s.walls[k, 2], s.walls[k, 3], z)
            if d < best:
                best, which = d, number + k
    number += s.walls.shape[0]
    for k in range(s.movers.shape[0]):
        a, b, c = mover_at(s, k, t)
        d = upright(hypot(x - a, y - b) - s.movers[k, 2], c, c + s.movers[k, 3], z)
        if d < best:
            best, which = d, number + k
    number += s.movers.shape[0]
    if s.occupied.size > 0:
        flat = grid_distance(s.occupied, s.run, s.grid[0], s.grid[1], s.grid[2], x, y)
        d = upright(flat, -inf, s.grid[3], z)
        if d < best:
            best, which = d, number
    return best, which


@kernel
def clearances(s: Scene, p: Floats, t: Floats, out: Floats, which: Ints) -> None:
    """out, which (n,) for points p (n, 3) at times t (n,)."""
    for i in range(p.shape[0]):
        out[i], which[i] = _clearance(s, p[i, 0], p[i, 1], p[i, 2], t[i])


@kernel
def _beam(s: Scene, t: float, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float, reach: float) -> float:
    """Range to the nearest thing; inf beyond `reach`."""
    best = cast(s.solids, ox, oy, oz, dx, dy, dz, reach)
    for k in range(s.walls.shape[0]):
        mx, my = s.walls[k, 4] - ox, s.walls[k, 5] - oy
        if abs(mx * dy - my * dx) <= s.walls[k, 6]:  # passes through the circle around it, seen from above
            first, count = int(s.walls[k, 0]), int(s.walls[k, 1])
            limit = min(best, reach)
            low, high = s.walls[k, 2], s.walls[k, 3]
            best = min(best, cast_prism(s.outlines, first, count, low, high, ox, oy, oz, dx, dy, dz, limit))
    for k in range(s.movers.shape[0]):
        a, b, c = mover_at(s, k, t)
        top, limit = c + s.movers[k, 3], min(best, reach)
        best = min(best, cast_column(a, b, s.movers[k, 2], c, top, ox, oy, oz, dx, dy, dz, limit))
    if s.occupied.size > 0:
        g, limit = s.grid, min(best, reach)
        best = min(best, cast_grid(s.free, g[0], g[1], g[2], g[3], ox, oy, oz, dx, dy, dz, limit))
    return best


@kernel
def sights(s: Scene, a: Floats, b: Floats, t: Floats, out: Bools) -> None:
    """out (n,): nothing between a (n, 3) and b (n, 3). The beam always starts at the lesser of the two points, so that
    a sees b exactly when b sees a."""
    for i in range(a.shape[0]):
        swap = False
        for j in range(3):
            if a[i, j] != b[i, j]:
                swap = b[i, j] < a[i, j]
                break
        ox, oy, oz = (b[i, 0], b[i, 1], b[i, 2]) if swap else (a[i, 0], a[i, 1], a[i, 2])
        ex, ey, ez = (a[i, 0], a[i, 1], a[i, 2]) if swap else (b[i, 0], b[i, 1], b[i, 2])
        x, y, z = ex - ox, ey - oy, ez - oz
        length = sqrt(x * x + y * y + z * z)
        if length > 0.0:
            out[i] = _beam(s, t[i], ox, oy, oz, x / length, y / length, z / length, length) == inf
        else:
            out[i] = _clearance(s, ox, oy, oz, t[i])[0] > 0.0


@kernel
def scans(s: Scene, o: Floats, q: Floats, angles: Floats, reach: float, t: Floats, v: Floats, out: Floats) -> None:
    """out (n, k): ranges of beams at `angles` (k,) in the x-y plane of a sensor at o (n, 3), q (n, 4); v (3,) scratch.

    The ground counts, for a sensor that tilts."""
    for i in range(o.shape[0]):
        ox, oy, oz = o[i, 0], o[i, 1], o[i, 2]
        for j in range(angles.size):
            v[0], v[1], v[2] = cos(angles[j]), sin(angles[j]), 0.0
            rotate(q[i], v, v)
            best = _beam(s, t[i], ox, oy, oz, v[0], v[1], v[2], reach)
            out[i, j] = min(best, cast_ground(s.slope[0], s.slope[1], ox, oy, oz, v[0], v[1], v[2], reach))


@kernel
def scan_column(
    o: Floats,
    q: Floats,
    angles: Floats,
    reach: float,
    feet: Floats,
    radius: float,
    height: float,
    v: Floats,
    out: Floats,
) -> None:
    """Shorten out (n, k) where an upright cylinder, its foot at feet (n, 3), is nearer; the rest as in `scans`."""
    for i in range(o.shape[0]):
        x, y, z = feet[i, 0], feet[i, 1], feet[i, 2]
        if hypot(x - o[i, 0], y - o[i, 1]) - radius > reach:
            continue
        for j in range(angles.size):
            v[0], v[1], v[2] = cos(angles[j]), sin(angles[j]), 0.0
            rotate(q[i], v, v)
            limit = min(out[i, j], reach)
            near = cast_column(x, y, radius, z, z + height, o[i, 0], o[i, 1], o[i, 2], v[0], v[1], v[2], limit)
            out[i, j] = min(out[i, j], near)
