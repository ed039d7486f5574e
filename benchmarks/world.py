"""Beams: a lidar scan through an occupancy grid, beside drawing every beam as a line of pixels."""

from functools import cache

import numpy as np

from benchmarks.table import Row, Side
from outrider.data import Grid
from outrider.sim.world import World

BEAMS, CELLS, SIDE, REACH = 360, 1000, 0.05, 30.0
HERE = np.array([25.013, 24.987, 0.5])
ANGLES = np.linspace(-np.pi, np.pi, BEAMS, endpoint=False) + 0.001


@cache
def yard():
    """1000 x 1000 cells of 5 cm, 1 % of them taken by blobs of 8 x 8, none around the robot."""
    rng, cells = np.random.default_rng(4), np.zeros((CELLS, CELLS), np.uint8)
    for row, col in rng.integers(0, CELLS - 8, (CELLS * CELLS // 100 // 64, 2)):
        cells[row : row + 8, col : col + 8] = 100
    cells[480:520, 480:520] = 0
    return World(name="yard", grid=Grid(cells=cells, resolution=SIDE, origin=np.zeros(2)))


def ours(scans):
    """`World.scan`, as a sensor calls it: exact to the boundary of the cell."""
    world, level = yard(), np.array([0.0, 0.0, 0.0, 1.0])
    for _ in range(scans):
        ranges = world.scan(HERE, level, ANGLES, REACH)
    return np.minimum(ranges, REACH)


def lines(scans):
    """skimage.draw.line per beam and the first pixel that is taken: exact to a cell, where it does not slip past."""
    from skimage.draw import line

    occupied = yard().grid.occupied
    row, col = yard().grid.cell_of(HERE[:2])
    ranges = np.empty(BEAMS)
    for _ in range(scans):
        ends = np.rint(np.column_stack([row + REACH / SIDE * np.sin(ANGLES), col + REACH / SIDE * np.cos(ANGLES)]))
        for k, (r_end, c_end) in enumerate(ends.astype(int)):
            r, c = line(row, col, r_end, c_end)
            inside = (r >= 0) & (r < CELLS) & (c >= 0) & (c < CELLS)
            r, c = r[inside], c[inside]
            hit = occupied[r, c]
            first = int(np.argmax(hit))
            ranges[k] = SIDE * np.hypot(r[first] - row, c[first] - col) if hit[first] else REACH
    return ranges


def rows():
    """Rows of this module."""
    return [
        Row(
            "lidar scan, 360 beams, 30 m, in a grid of 1000 x 1000 cells of 5 cm",
            Side("World.scan, exact traversal", ours, 200),
            [Side("scikit-image draw.line per beam, to a cell", lines, 5)],
            target=200.0,
            tolerance=None,
        ),
    ]
