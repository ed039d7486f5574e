"""Small maps as text, and random ones."""

from itertools import pairwise

import numpy as np
from hypothesis import strategies as st

from outrider.data.grid import FREE, LETHAL, Costmap
from outrider.planning.traversal import Traversal


def costmap(cells: np.ndarray, resolution: float = 1.0) -> Costmap:
    return Costmap(cells=cells, resolution=resolution, origin=np.zeros(2))


def drawn(text: str) -> tuple[Costmap, np.ndarray, np.ndarray]:
    """A map with S and G in it, north up, # taken; the middles of S and G."""
    rows = [line.strip() for line in text.strip().splitlines()][::-1]
    cells = np.array([[LETHAL if c == "#" else FREE for c in row] for row in rows], np.uint8)
    ends = [next((x + 0.5, y + 0.5) for y, row in enumerate(rows) for x, c in enumerate(row) if c == k) for k in "SG"]
    return costmap(cells), np.array(ends[0]), np.array(ends[1])


def middle(cell: np.ndarray) -> np.ndarray:
    return np.asarray(cell)[::-1] + 0.5


@st.composite
def problems(draw: st.DrawFn, side: int = 16) -> tuple[Costmap, np.ndarray, np.ndarray]:
    """A random map, a third of them of graded cost, with both ends on free cells."""
    seed = draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    shape = draw(st.tuples(st.integers(2, side), st.integers(2, side)))
    cells = rng.integers(0, 253, shape).astype(np.uint8) if seed % 3 == 0 else np.zeros(shape, np.uint8)
    cells[rng.random(shape) < draw(st.sampled_from([0.0, 0.1, 0.25, 0.4]))] = LETHAL
    start, goal = rng.integers(0, shape), rng.integers(0, shape)
    cells[tuple(start)] = cells[tuple(goal)] = 0
    return costmap(cells), middle(start), middle(goal)


def is_legal(grid: Costmap, points: np.ndarray, traversal: Traversal) -> bool:
    """Every step goes to one of eight neighbours, never into a taken cell nor, unless allowed, past a corner of one."""
    free = np.isfinite(traversal.weights)[grid.cells]
    cells = grid.cell_of(points)
    for (r, c), (s, d) in pairwise(cells):
        if max(abs(s - r), abs(d - c)) != 1 or not free[s, d]:
            return False
        if not traversal.corner_cutting and not (free[r, d] and free[s, c]):
            return False
    return bool(free[tuple(cells[0])])
