"""D* Lite: a search from the goal that is repaired where the map has changed, instead of done again."""

from dataclasses import dataclass, field
from time import perf_counter
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from outrider._kernel import inlined, kernel
from outrider.data.grid import INSCRIBED, Costmap
from outrider.data.routes import Path, PathOutcome
from outrider.planning.astar import measure, through
from outrider.planning.ends import find_ends, nearest_reachable
from outrider.planning.search import (
    BLOCKED,
    BY_COL,
    BY_ROW,
    ENDED,
    FULL,
    PAUSED,
    SLANT,
    UNIT,
    estimate,
    trace,
)
from outrider.planning.traversal import Traversal
from outrider.planning.workspace import EVERY_WAY
from outrider.typing import Floats, Ints

_SLICE: Final = 10_000  # cells expanded between two looks at the clock
_ROOM: Final = 1 << 12  # of the heap at first


@inlined
def _step(cells: NDArray[np.uint8], straights: Ints, diagonals: Ints, around: Ints, forbid: int, c: int, d: int) -> int:
    """Cost of a step from c in direction d, `BLOCKED` or more if there is none."""
    n = c + int(around[d])
    if d & 1 == 0:
        return min(int(straights[cells[c]]) + int(straights[cells[n]]), BLOCKED)
    sides = straights[cells[c + around[d + 1]]] | straights[cells[c + around[d + 7]]]
    return min(int(diagonals[cells[c]]) + int(diagonals[cells[n]]), BLOCKED) | (int(sides) & forbid)


@inlined
def _push(heap: Ints, size: int, f: int, g: int, c: int) -> int:
    """Sift (f, g, c) into a binary heap of rows of three; the new size."""
    i = size
    while i > 0:
        up = (i - 1) >> 1
        if heap[3 * up] < f or (heap[3 * up] == f and heap[3 * up + 1] <= g):
            break
        heap[3 * i], heap[3 * i + 1], heap[3 * i + 2] = heap[3 * up], heap[3 * up + 1], heap[3 * up + 2]
        i = up
    heap[3 * i], heap[3 * i + 1], heap[3 * i + 2] = f, g, c
    return size + 1


@inlined
def _drop(heap: Ints, size: int) -> int:
    """Take the least row off a heap; the new size."""
    size -= 1
    f, g, c, i = heap[3 * size], heap[3 * size + 1], heap[3 * size + 2], 0
    while 2 * i + 1 < size:
        k = 2 * i + 1
        if k + 1 < size and (
            heap[3 * k + 3] < heap[3 * k] or (heap[3 * k + 3] == heap[3 * k] and heap[3 * k + 4] < heap[3 * k + 1])
        ):
            k += 1
        if f < heap[3 * k] or (f == heap[3 * k] and g <= heap[3 * k + 1]):
            break
        heap[3 * i], heap[3 * i + 1], heap[3 * i + 2] = heap[3 * k], heap[3 * k + 1], heap[3 * k + 2]
        i = k
    heap[3 * i], heap[3 * i + 1], heap[3 * i + 2] = f, g, c
    return size


@kernel
def repair(
    cells: NDArray[np.uint8],
    width: int,
    straights: Ints,
    diagonals: Ints,
    around: Ints,
    forbid: int,
    labels: Ints,
    ahead: Ints,
    heap: Ints,
    state: Ints,
    changed: Ints,
    start: int,
    goal: int,
    limit: int,
) -> int:
    """Look again at the `changed` cells, then expand up to `limit` cells; ENDED when the start's label is right.

    labels, ahead : (n,) g and rhs of D* Lite, less 2^62 as in `search`, 0 for infinite;  heap : rows (f, g, cell), with
    room for the changed ones;  state : (3,) size of the heap, k_m, cells expanded;  the others : see `search`.
    S. Koenig, M. Likhachev, "D* Lite", AAAI 2002, figure 4.
    """
    size, moved, expanded, end = int(state[0]), int(state[1]), int(state[2]), int(state[2]) + limit
    row, col, room, k, outcome = start // width, start % width, heap.size // 3 - 10, 0, PAUSED
    while expanded < end:
        first, last, c = 8, 9, 0
        if k < changed.size:
            c, k = int(changed[k]), k + 1
        else:
            own = min(int(labels[start]), int(ahead[start]))
            if size == 0 or (
                labels[start] == ahead[start] and (heap[0] > own + moved or (heap[0] == own + moved and heap[1] >= own))
            ):
                outcome = ENDED
                break
            if size > room:
                outcome = FULL
                break
            f, g, c = int(heap[0]), int(heap[1]), int(heap[2])
            size = _drop(heap, size)
            best = min(int(labels[c]), int(ahead[c]))
            if labels[c] == ahead[c]:
                continue
            now = best + moved + estimate(c // width - row, c % width - col, UNIT, SLANT - UNIT)
            if f < now or (f == now and g < best):
                size = _push(heap, size, now, best, c)
                continue
            expanded += 1
            first = 0
            if labels[c] > ahead[c]:
                labels[c], last = ahead[c], 8
            else:
                labels[c] = 0
        for d in range(first, last):
            # a neighbour, or the cell itself: its best step from now on, and whether that is news
            n = c + int(around[d]) if d < 8 else c
            if n != goal:
                best = 0
                if straights[cells[n]] < BLOCKED:
                    for e in range(8):
                        step = _step(cells, straights, diagonals, around, forbid, n, e)
                        best = min(best, int(labels[n + around[e]]) + step)
                ahead[n] = best
            if labels[n] != ahead[n]:
                best = min(int(labels[n]), int(ahead[n]))
                h = estimate(n // width - row, n % width - col, UNIT, SLANT - UNIT)
                size = _push(heap, size, best + moved + h, best, n)
    state[0], state[2] = size, expanded
    return outcome


@final
@dataclass(slots=True, kw_only=True)
class DStarLite:
    """D* Lite: as long as the goal stays, a plan repairs the one before. The cost is that of `AStar`.

    traversal : see `Traversal`. A planner is for one thread, and remembers one goal.
    """

    traversal: Traversal = field(default_factory=Traversal)
    _cells: NDArray[np.uint8] = field(default_factory=lambda: np.zeros((0, 0), np.uint8), init=False)
    _labels: Ints = field(default_factory=lambda: np.zeros(0, np.int64), init=False)
    _ahead: Ints = field(default_factory=lambda: np.zeros(0, np.int64), init=False)
    _heap: Ints = field(default_factory=lambda: np.zeros(_ROOM, np.int64), init=False)
    _state: Ints = field(default_factory=lambda: np.zeros(3, np.int64), init=False)
    _goal: tuple[int, int] = field(default=(-1, -1), init=False)
    _start: tuple[int, int] = field(default=(-1, -1), init=False)

    @property
    def bytes(self) -> int:
        """Of memory held."""
        return sum(a.nbytes for a in (self._cells, self._labels, self._ahead, self._heap))

    def plan(self, costmap: Costmap, start: Floats, goal: Floats, *, budget_s: float = np.inf) -> Path:
        """See `GlobalPlanner`. Out of time, the next plan goes on where this one has stopped."""
        begun = perf_counter()
        ends = find_ends(costmap, self.traversal, start, goal, budget_s)
        if ends.outcome is not None:
            suggestion = ends.suggest(costmap, self.traversal)
            return Path(outcome=ends.outcome, suggestion=suggestion, seconds=perf_counter() - begun)
        changed = self._take(costmap, ends.start, ends.goal)
        self._state[2] = 0
        ended = self._repair(changed, begun + budget_s)
        c, expanded = self._at(ends.start), int(self._state[2])
        if not ended or self._labels[c] == 0:
            outcome = PathOutcome.NO_WAY if ended else PathOutcome.OUT_OF_TIME
            suggestion = nearest_reachable(costmap, self.traversal, ends.start, ends.goal) if ended else None
            return Path(outcome=outcome, suggestion=suggestion, expanded=expanded, seconds=perf_counter() - begun)
        points = through(costmap, self._trace(c), start, goal)
        length, cost = measure(costmap, self.traversal, points)
        seconds, found = perf_counter() - begun, PathOutcome.FOUND
        return Path(outcome=found, points=points, length=length, cost=cost, expanded=expanded, seconds=seconds)

    def _at(self, cell: tuple[int, int]) -> int:
        return (cell[0] + 1) * self._cells.shape[1] + cell[1] + 1

    def _take(self, costmap: Costmap, start: tuple[int, int], goal: tuple[int, int]) -> Ints:
        """Take over a map; the cells whose best step may be another one now."""
        cells = np.pad(costmap.cells, 1, constant_values=INSCRIBED)
        old, self._cells = self._cells, cells
        if old.shape != cells.shape or goal != self._goal:
            self._labels, self._ahead = np.zeros(cells.size, np.int64), np.zeros(cells.size, np.int64)
            self._state[:], self._goal, self._start = 0, goal, start
            self._ahead[self._at(goal)] = -BLOCKED
            return np.array([self._at(goal)])
        gap = start[0] - self._start[0], start[1] - self._start[1]
        self._state[1] += estimate(*gap, UNIT, SLANT - UNIT)
        self._start = start
        changed = np.flatnonzero(old.ravel() != cells.ravel())
        near = np.unique(changed[:, None] + np.append(BY_ROW[:8] * cells.shape[1] + BY_COL[:8], 0))
        row, col = np.divmod(near, cells.shape[1])
        return near[(row > 0) & (row < cells.shape[0] - 1) & (col > 0) & (col < cells.shape[1] - 1)]

    def _repair(self, changed: Ints, until: float) -> bool:
        width, cells = self._cells.shape[1], self._cells.ravel()
        around, (straights, diagonals) = self._around(), self.traversal.halves()
        forbid, ended = self._forbid(), PAUSED
        start, goal = self._at(self._start), self._at(self._goal)
        while ended != ENDED:
            if ended == FULL or 3 * (int(self._state[0]) + changed.size + 10) > self._heap.size:
                self._heap = np.append(self._heap, np.zeros(self._heap.size + 3 * changed.size, np.int64))
            ended = repair(
                cells, width, straights, diagonals, around, forbid, self._labels, self._ahead, self._heap,
                self._state, changed, start, goal, _SLICE,
            )  # fmt: skip
            changed = changed[:0]
            if ended != ENDED and perf_counter() > until:
                return False
        return True

    def _around(self) -> Ints:
        return np.concatenate([BY_ROW * self._cells.shape[1] + BY_COL, BY_ROW, BY_COL])

    def _forbid(self) -> int:
        return 0 if self.traversal.corner_cutting else BLOCKED

    def _trace(self, start: int) -> Ints:
        """(n, 2) rows and columns, downhill from the start."""
        width, cells, out, n = self._cells.shape[1], self._cells.ravel(), np.empty(self._cells.size, np.int64), -1
        straights, diagonals = self.traversal.halves()
        n = trace(
            cells, width, straights, diagonals, self._around(), self._labels, start, self._forbid(), EVERY_WAY, 0, out
        )
        return np.stack(np.divmod(out[:n], width), axis=1) - 1
