"""Memory of a search, kept from one plan to the next."""

from dataclasses import dataclass, field
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from outrider.data.grid import INSCRIBED, UNKNOWN
from outrider.planning.jumps import REACH
from outrider.planning.search import AT, BLOCKED, BY_COL, BY_ROW, NORTH, SOUTH, STATES
from outrider.typing import Ints

EVERY_WAY: Final = np.full(1, 255, np.uint8)
_CAPACITY: Final = 16 * REACH  # of a bucket at first; it doubles


def _nothing(kind: type = np.int64) -> Ints:
    return np.zeros(0, kind)


@final
@dataclass(slots=True, eq=False)
class Workspace:
    """Arrays over the cells of one size of map with a blocked border, and a queue; what a search has touched is cleared
    by the next.

    cells : (rows + 2, cols + 2);  labels, ways, parents : (cells,) see `search` and `jumps`;  queue, counts, state,
    around, found, allowed, every : see `search`.
    """

    cells: NDArray[np.uint8] = field(default_factory=lambda: np.zeros((0, 0), np.uint8))
    labels: Ints = field(default_factory=_nothing)
    ways: NDArray[np.uint8] = field(default_factory=lambda: np.zeros(0, np.uint8))
    parents: Ints = field(default_factory=_nothing)
    queue: Ints = field(default_factory=_nothing)
    counts: Ints = field(default_factory=_nothing)
    around: Ints = field(default_factory=_nothing)
    state: Ints = field(default_factory=lambda: np.zeros(STATES, np.int64))
    found: Ints = field(default_factory=lambda: np.zeros(16, np.int64))
    allowed: NDArray[np.uint8] = field(default_factory=lambda: EVERY_WAY)
    every: int = 0

    @property
    def width(self) -> int:
        """Cells from one row to the next."""
        return self.cells.shape[1]

    @property
    def bytes(self) -> int:
        """Of memory held, most of it untouched unless a search went everywhere."""
        return sum(a.nbytes for a in (self.cells, self.labels, self.ways, self.parents, self.queue))

    def load(self, cells: NDArray[np.uint8], ways: NDArray[np.uint8] | None = None) -> None:
        """Take over a map (rows, cols) and the ways in which its cells may be left, and forget the last search."""
        self._fit(cells.shape, INSCRIBED)
        self.cells[1:-1, 1:-1] = cells
        self.every = 0 if ways is None else -1
        self.allowed = EVERY_WAY if ways is None else np.pad(ways, 1, constant_values=255).ravel()

    def load_plain(self, cells: NDArray[np.uint8], *, keep_unknown: bool) -> None:
        """The same, with 1 for taken cells and 0 for all others."""
        self._fit(cells.shape, 1)
        if self.ways.size != self.labels.size:
            self.ways, self.parents = np.zeros(self.labels.size, np.uint8), np.empty(self.labels.size, np.int64)
        taken = self.cells.view(np.bool_)[1:-1, 1:-1]
        np.greater_equal(cells, INSCRIBED, out=taken)
        if keep_unknown:
            np.logical_and(taken, cells != UNKNOWN, out=taken)

    def _fit(self, shape: tuple[int, ...], border: int) -> None:
        rows, width = shape[0] + 2, shape[1] + 2
        if self.cells.shape != (rows, width):
            self.cells, self.labels = np.empty((rows, width), np.uint8), np.zeros(rows * width, np.int64)
            self.around = np.concatenate([BY_ROW * width + BY_COL, BY_ROW, BY_COL])
        elif self.state[NORTH]:
            south, north = int(self.state[SOUTH]) - 2 * REACH, int(self.state[NORTH]) + 2 * REACH + 1
            self.labels[max(south, 0) * width : north * width] = 0
        self.cells[0], self.cells[-1], self.cells[:, 0], self.cells[:, -1] = border, border, border, border

    def begin(self, row: int, least: int, longest: int, shift: int) -> None:
        """An empty queue for f from `least` on, of which one step adds no more than `longest`."""
        buckets = 1 << ((longest >> shift) + 2).bit_length()
        if self.counts.size != buckets:
            self.counts, self.queue = np.zeros(buckets, np.int64), np.empty(buckets * _CAPACITY, np.int64)
        self.counts[:] = 0
        self.state[:] = 0
        self.state[AT], self.state[SOUTH], self.state[NORTH] = (least - BLOCKED) >> shift, row, row

    def push(self, row: int, col: int, d: int, f: int, shift: int) -> None:
        """Queue a cell reached in direction d."""
        bucket = ((f - BLOCKED) >> shift) & (self.counts.size - 1)
        self.queue[bucket * (self.queue.size // self.counts.size) + self.counts[bucket]] = row << 32 | col << 3 | d
        self.counts[bucket] += 1

    def grow(self) -> None:
        """Room for twice as many in every bucket."""
        old = self.queue.reshape(self.counts.size, -1)
        new = np.empty((self.counts.size, 2 * old.shape[1]), np.int64)
        new[:, : old.shape[1]] = old
        self.queue = new.ravel()
