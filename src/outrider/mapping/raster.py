"""Polygons as cells: rings filled by the middles of cells, outlines traced through every cell that they cross."""

from math import ceil, floor, hypot
from typing import Any

import numpy as np
from numpy.typing import NDArray

from outrider._kernel import kernel
from outrider.data.grid import Grid
from outrider.mapping.obstacles import trace
from outrider.typing import Floats, Ints


def covered(rings: Floats, starts: Ints, shape: tuple[int, int], *, whole: bool) -> NDArray[np.bool_]:
    """(rows, cols) the cells that rings cover: every one that they reach into, or only those that are covered `whole`.

    rings : (n, 2) in cells from the outer corner of cell [0, 0], column first;  starts : (k + 1,) where each ring
    begins and the last one ends. A place within an odd number of rings is covered.
    """
    inside, edge = np.zeros(shape, np.uint8), np.zeros(shape, np.uint8)
    fill(inside, rings, starts)
    np.bitwise_xor.accumulate(inside, axis=1, out=inside)
    outline(edge, rings, starts)
    return (inside == 1) & (edge == 0) if whole else (inside == 1) | (edge == 1)


@kernel
def fill(cells: Any, rings: Floats, starts: Ints) -> None:
    """Toggle, in every row, the first cell whose middle is beyond each edge: the running XOR of a row fills it."""
    rows, cols = cells.shape
    for k in range(starts.size - 1):
        u, v = rings[starts[k + 1] - 1, 0], rings[starts[k + 1] - 1, 1]
        for i in range(starts[k], starts[k + 1]):
            a, b, x, y = u, v, rings[i, 0], rings[i, 1]
            u, v = x, y
            if b > y:
                a, b, x, y = x, y, a, b
            for row in range(max(ceil(b - 0.5), 0), min(ceil(y - 0.5), rows)):
                col = ceil(a + (row + 0.5 - b) * (x - a) / (y - b) - 0.5)
                if col < cols:
                    cells[row, max(col, 0)] ^= np.uint8(1)


@kernel
def outline(cells: Any, rings: Floats, starts: Ints) -> None:
    """Set every cell that an edge of a ring goes through."""
    rows, cols = cells.shape
    for k in range(starts.size - 1):
        u, v = rings[starts[k + 1] - 1, 0], rings[starts[k + 1] - 1, 1]
        for i in range(starts[k], starts[k + 1]):
            x, y = rings[i, 0], rings[i, 1]
            length = hypot(x - u, y - v)
            if length > 0.0:
                trace(cells, u, v, (x - u) / length, (y - v) / length, length, 1, True)
            elif 0.0 <= u < cols and 0.0 <= v < rows:
                cells[floor(v), floor(u)] = 1
            u, v = x, y


def crossed(start: Floats, end: Floats, grid: Grid) -> tuple[Ints, Ints]:
    """Rows and columns of the cells that the way between two points (2,) m goes through, from its start on."""
    touched = np.zeros(grid.cells.shape, np.uint8)
    ends = np.ascontiguousarray((np.stack([start, end]) - grid.origin) / grid.resolution)
    outline(touched, ends, np.array([0, 2]))
    rows, cols = np.nonzero(touched)
    along = (np.column_stack([cols, rows]) - ends[0]) @ (ends[1] - ends[0])
    order = np.argsort(along, kind="stable")
    return rows[order], cols[order]
