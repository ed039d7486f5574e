"""Cheapest ways over large maps, beside scikit-image's search under its own rule of steps (corners may be cut)."""

from functools import cache

import numpy as np

from benchmarks.table import Row, Side
from outrider.data.grid import INSCRIBED, LETHAL, Costmap
from outrider.planning.astar import AStar
from outrider.planning.traversal import Traversal

CELLS, CORRIDOR, WEIGHT = 4000, 10, 9.0
PLANNER = AStar(traversal=Traversal(weight=WEIGHT, corner_cutting=True))  # its memory is used again


def open_field(_rng):
    return np.zeros((CELLS, CELLS), np.uint8)


def clutter(rng):
    """A cell in five is taken."""
    return np.where(rng.random((CELLS, CELLS)) < 0.2, np.uint8(LETHAL), np.uint8(0))


def maze(rng):
    """Corridors of ten cells, a wall of one; a tree of ways, and a wall in twenty opened besides."""
    n = CELLS // CORRIDOR
    by_east, by_north = rng.random((n, n)) < 0.05, rng.random((n, n)) < 0.05
    seen, trail = np.zeros((n, n), bool), [(0, 0)]
    seen[0, 0] = True
    while trail:
        r, c = trail[-1]
        ways = [(r + 1, c), (r - 1, c), (r, c + 1), (r, c - 1)]
        ways = [(a, b) for a, b in ways if 0 <= a < n and 0 <= b < n and not seen[a, b]]
        if not ways:
            trail.pop()
            continue
        a, b = ways[rng.integers(len(ways))]
        seen[a, b] = True
        (by_north if a != r else by_east)[min(a, r), min(b, c)] = True
        trail.append((a, b))
    cells = np.zeros((CELLS, CELLS), np.uint8)
    for r, c in np.argwhere(~by_east):
        cells[r * CORRIDOR : (r + 1) * CORRIDOR, (c + 1) * CORRIDOR - 1] = LETHAL
    for r, c in np.argwhere(~by_north):
        cells[(r + 1) * CORRIDOR - 1, c * CORRIDOR : (c + 1) * CORRIDOR] = LETHAL
    cells[CORRIDOR - 1 :: CORRIDOR, CORRIDOR - 1 :: CORRIDOR] = LETHAL
    return cells


def terrain(rng):
    """Smooth, one to ten times as dear as free ground; a cell in twenty is taken."""
    from scipy.ndimage import zoom

    height = zoom(rng.random((CELLS // 100 + 4, CELLS // 100 + 4)), 100, order=3)[:CELLS, :CELLS]
    height = (height - height.min()) / (height.max() - height.min())
    return np.where(rng.random((CELLS, CELLS)) < 0.05, LETHAL, np.rint(252 * height)).astype(np.uint8)


@cache
def problem(make):
    """The map and both ends: opposite corners, for the open field the middle of the far side (many ways tie)."""
    cells = make(np.random.default_rng(5))
    start, goal = np.array([0, 0]), np.array([CELLS - 2, CELLS // 2 if make is open_field else CELLS - 2])
    cells[tuple(start)] = cells[tuple(goal)] = 0
    return Costmap(cells=cells, resolution=1.0, origin=np.zeros(2)), start, goal


def ours(make):
    def run(plans):
        grid, start, goal = problem(make)
        for _ in range(min(plans, 3)):  # they are all alike
            path = PLANNER.plan(grid, start[::-1] + 0.5, goal[::-1] + 0.5)
        return np.array([path.cost])

    return run


def scikit_image(make):
    def run(_plans):
        from skimage.graph import MCP_Geometric

        grid, start, goal = problem(make)
        w = np.where(grid.cells < INSCRIBED, 1.0 + WEIGHT * grid.cells / 252.0, -1.0)
        search = MCP_Geometric(w)
        costs, _ = search.find_costs([tuple(start)], [tuple(goal)])
        search.traceback(tuple(goal))
        return costs[tuple(goal)][None]

    return run


def rows():
    """Rows of this module."""
    cases = [
        ("maze", maze, 7e5),
        ("a cell in five taken", clutter, 2e5),
        ("open field", open_field, 1e5),
        ("weighted terrain", terrain, 1.3e6),
    ]
    return [
        Row(
            f"cheapest way, {CELLS} x {CELLS} cells, {name}",
            Side("AStar.plan, exact, the path returned", ours(make), 1),
            [Side("scikit-image MCP_Geometric, find_costs and traceback", scikit_image(make), 1)],
            target=target,
            tolerance=1e-6,
        )
        for name, make, target in cases
    ]
