"""A* over a costmap: the cheapest way, exactly, or the reason why there is none."""

from collections.abc import Callable
from dataclasses import dataclass, field
from time import perf_counter
from typing import Final, final

import numpy as np

from outrider.data.grid import INSCRIBED, UNKNOWN, Costmap
from outrider.data.routes import Path, PathOutcome
from outrider.planning.ends import Ends, find_ends, nearest_cell, nearest_reachable
from outrider.planning.jumps import REACH, chain, jump_search
from outrider.planning.search import BEST, BLOCKED, ENDED, EXPANDED, FULL, SLANT, UNIT, estimate, search, trace
from outrider.planning.traversal import Traversal
from outrider.planning.workspace import Workspace
from outrider.typing import Floats, Ints

_SHIFT: Final = 29  # a bucket is 2^29 wide, 0.6 of a step over free ground
_SLICE: Final = 20_000  # cells expanded between two looks at the clock
_BLOCK: Final = 64  # rows looked at together
_CLUTTER: Final = 0.1  # edges of taken things per cell from which on there are too many corners to jump between


@final
@dataclass(slots=True, kw_only=True)
class AStar:
    """A* search with the octile distance as its estimate; exact: no way in the grid is cheaper.

    Where all cells are free or taken, and not too cluttered, it looks along rows and diagonals instead of queueing
    cells (`jumps`): the same cost in a fraction of the time.

    traversal : see `Traversal`;  heuristic : off, it is Dijkstra's search;  jumps : never, always where the costs allow
    it, or (None) where it pays;  workspace : memory, used again by the next plan, so one planner is for one thread.
    """

    traversal: Traversal = field(default_factory=Traversal)
    heuristic: bool = True
    jumps: bool | None = None
    workspace: Workspace = field(default_factory=Workspace)

    def plan(self, costmap: Costmap, start: Floats, goal: Floats, *, budget_s: float = np.inf) -> Path:
        """See `GlobalPlanner`. The way leads through the middles of cells; length and cost are those of its points.

        Out of time, the suggestion is the place nearest to the goal that the search had come to.
        UsageError : a position that is not finite, or a budget that is no time.
        """
        begun = perf_counter()
        ends = find_ends(costmap, self.traversal, start, goal, budget_s)
        if ends.outcome is not None:
            suggestion = ends.suggest(costmap, self.traversal)
            return Path(outcome=ends.outcome, suggestion=suggestion, seconds=perf_counter() - begun)
        jumps = self._jumps(costmap)
        outcome = (self._jump if jumps else self._search)(costmap, ends, begun + budget_s)
        expanded = int(self.workspace.state[EXPANDED])
        if outcome is not PathOutcome.FOUND:
            suggestion = self._suggest(outcome, costmap, ends)
            return Path(outcome=outcome, suggestion=suggestion, expanded=expanded, seconds=perf_counter() - begun)
        cells = self._chain(ends) if jumps else self._trace(ends)
        points = through(costmap, cells, start, goal)
        length, cost = measure(costmap, self.traversal, points)
        seconds = perf_counter() - begun
        return Path(outcome=outcome, points=points, length=length, cost=cost, expanded=expanded, seconds=seconds)

    def _jumps(self, costmap: Costmap) -> bool:
        if self.jumps is False or not self.heuristic or costmap.ways is not None or not _plain(costmap, self.traversal):
            return False
        taken = costmap.cells[::16] >= INSCRIBED
        edges = int(np.count_nonzero(taken[:, 1:] != taken[:, :-1]))
        return self.jumps is True or edges < _CLUTTER * taken.size

    def _suggest(self, outcome: PathOutcome, costmap: Costmap, ends: Ends) -> Floats | None:
        if outcome is PathOutcome.NO_WAY:
            return nearest_reachable(costmap, self.traversal, ends.start, ends.goal)
        reached = self.workspace.labels.reshape(self.workspace.cells.shape)[1:-1, 1:-1] < 0
        cell = nearest_cell(reached, ends.goal)
        return None if cell is None else costmap.centre_of(cell)

    def _search(self, costmap: Costmap, ends: Ends, until: float) -> PathOutcome:
        """Over every cell, whatever it costs."""
        space, (straights, diagonals) = self.workspace, self.traversal.halves()
        space.load(costmap.cells, costmap.ways)
        straight, slant = (UNIT, SLANT - UNIT) if self.heuristic else (0, 0)
        (row, col), (goal_row, goal_col) = ((r + 1, c + 1) for r, c in (ends.start, ends.goal))
        dearest = int(diagonals[diagonals < BLOCKED].max())
        h = int(estimate(row - goal_row, col - goal_col, straight, slant))
        space.begin(row, h, 2 * dearest + SLANT, _SHIFT)
        forbid = 0 if self.traversal.corner_cutting else BLOCKED
        cells, c = space.cells.ravel(), row * space.width + col

        def advance(limit: int) -> int:
            return search(
                cells, space.width, straights, diagonals, space.around, space.labels, space.queue, space.counts,
                space.state, space.found, goal_row, goal_col, straight, slant, _SHIFT, forbid, space.allowed,
                space.every, limit,
            )  # fmt: skip

        for d in (0, 4):  # an expansion looks half round
            space.labels[c] = 1 - BLOCKED
            space.push(row, col, d, h, _SHIFT)
            advance(1)
        return self._drive(advance, until)

    def _jump(self, costmap: Costmap, ends: Ends, until: float) -> PathOutcome:
        """Over cells that are free or taken."""
        space = self.workspace
        space.load_plain(costmap.cells, keep_unknown=self.traversal.unknown is not None)
        (row, col), (goal_row, goal_col) = ((r + 1, c + 1) for r, c in (ends.start, ends.goal))
        h = int(estimate(row - goal_row, col - goal_col, UNIT, SLANT - UNIT))
        space.begin(row, h, 2 * REACH * (SLANT + UNIT), _SHIFT)
        cells, c, cutting = space.cells.ravel(), row * space.width + col, int(self.traversal.corner_cutting)
        space.labels[c], space.ways[c] = -BLOCKED, 255
        for d in range(8):
            space.push(row, col, d, h, _SHIFT)

        def advance(limit: int) -> int:
            return jump_search(
                cells, space.width, space.around, space.labels, space.ways, space.parents, space.queue, space.counts,
                space.state, goal_row, goal_col, _SHIFT, cutting, limit,
            )  # fmt: skip

        return self._drive(advance, until)

    def _drive(self, advance: Callable[[int], int], until: float) -> PathOutcome:
        """Search in slices until there is an outcome."""
        while (ended := advance(_SLICE)) != ENDED:
            if ended == FULL:
                self.workspace.grow()
            if perf_counter() > until:
                return PathOutcome.OUT_OF_TIME
        return PathOutcome.FOUND if self.workspace.state[BEST] < 0 else PathOutcome.NO_WAY

    def _trace(self, ends: Ends) -> Ints:
        """(n, 2) rows and columns of the way that `_search` has found."""
        space, (straights, diagonals) = self.workspace, self.traversal.halves()
        goal = (ends.goal[0] + 1) * space.width + ends.goal[1] + 1
        forbid = 0 if self.traversal.corner_cutting else BLOCKED
        cells, out, n = space.cells.ravel(), np.empty(4 * sum(space.cells.shape), np.int64), -1
        while n < 0:
            n = trace(
                cells, space.width, straights, diagonals, space.around, space.labels, goal, forbid, space.allowed,
                space.every, out,
            )  # fmt: skip
            out = out[:n] if n >= 0 else np.empty(4 * out.size, np.int64)
        return np.stack(np.divmod(out[::-1], space.width), axis=1) - 1

    def _chain(self, ends: Ends) -> Ints:
        """(n, 2) rows and columns of the way that `_jump` has found: a diagonal and a straight piece per jump."""
        space = self.workspace
        start, goal = ((row + 1) * space.width + col + 1 for row, col in (ends.start, ends.goal))
        out, n = np.empty(4 * sum(space.cells.shape), np.int64), -1
        while n < 0:
            n = chain(space.parents, goal, start, out)
            out = out[:n] if n >= 0 else np.empty(4 * out.size, np.int64)
        knots = np.stack(np.divmod(out[::-1], space.width), axis=1) - 1
        gap = np.diff(knots, axis=0)
        longer, shorter = np.abs(gap).max(axis=1), np.abs(gap).min(axis=1)
        first = np.cumsum(longer) - longer
        step = np.arange(longer.sum()) - np.repeat(first, longer) + 1
        most = np.where(np.abs(gap) == longer[:, None], longer[:, None], shorter[:, None])
        inside = np.sign(gap).repeat(longer, axis=0) * np.minimum(step[:, None], most.repeat(longer, axis=0))
        return np.concatenate([knots[:1], knots[:-1].repeat(longer, axis=0) + inside])


def _plain(costmap: Costmap, traversal: Traversal) -> bool:
    """Whether all cells that may be crossed cost the same as free ones."""
    if traversal.weight == 0.0:
        return True
    if traversal.unknown and (costmap.cells == UNKNOWN).any():
        return False
    blocks = range(0, len(costmap.cells), _BLOCK)
    return not any((costmap.cells[i : i + _BLOCK] - np.uint8(1) < INSCRIBED - 1).any() for i in blocks)


def through(costmap: Costmap, cells: Ints, start: Floats, goal: Floats) -> Floats:
    """(n, 2) m: the start, the middles of the cells, the goal; no place twice."""
    middles = costmap.centre_of(cells)
    near = 1e-9 * costmap.resolution
    first = [] if np.hypot(*(middles[0] - start)) <= near else [start]
    last = [] if np.hypot(*(middles[-1] - goal)) <= near else [goal]
    return np.vstack([*first, middles, *last])


def measure(costmap: Costmap, traversal: Traversal, points: Floats) -> tuple[float, float]:
    """Length [m] and cost of a way from cell to neighbouring cell, whose points lie in those cells."""
    row, col = costmap.cell_of(points).T
    w, length = traversal.weights[costmap.cells[row, col]], np.hypot(*np.diff(points, axis=0).T)
    return float(length.sum()), float((length * (w[1:] + w[:-1])).sum() / 2)
