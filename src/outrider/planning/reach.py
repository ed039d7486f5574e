"""What it costs to go from one place to many."""

from dataclasses import dataclass, field
from typing import Final, Protocol, final

import numpy as np

from outrider.data.grid import Costmap
from outrider.planning.ends import find_ends, nearest_cell, passable
from outrider.planning.search import BLOCKED, ENDED, FULL, SLANT, UNIT, search
from outrider.planning.traversal import Traversal
from outrider.planning.workspace import Workspace
from outrider.typing import Floats

_SHIFT: Final = 29  # see `astar`
_SLICE: Final = 1 << 20
_AMISS: Final = 1.0  # m: a robot stands where it stands, whatever its estimate and the map say


class Reaches(Protocol):
    """Says what ways cost."""

    def costs(self, costmap: Costmap, start: Floats, places: Floats) -> Floats:
        """(k,) metres of free ground to each of places (k, 2), inf where no way leads."""
        ...


@final
@dataclass(slots=True, kw_only=True)
class Reach:
    """Dijkstra's search from the start over the whole map: the costs of `AStar`, to every place at once.

    A start that is taken is moved to the nearest cell that is not, up to 1 m away.
    """

    traversal: Traversal = field(default_factory=Traversal)
    workspace: Workspace = field(default_factory=Workspace)

    def costs(self, costmap: Costmap, start: Floats, places: Floats) -> Floats:
        """See `Reaches`."""
        out = np.full(len(places), np.inf)
        cell = np.asarray(find_ends(costmap, self.traversal, start, start, np.inf).start)
        open_cells = passable(costmap, self.traversal)
        near = nearest_cell(open_cells, (int(cell[0]), int(cell[1])))
        if near is None or float(np.hypot(*(near - cell))) * costmap.resolution > _AMISS:
            return out
        labels = self._flood(costmap, int(near[0]) + 1, int(near[1]) + 1)
        goal = costmap.cell_of(places)
        inside = ((goal >= 0) & (goal < costmap.cells.shape)).all(axis=1)
        row, col = (goal[inside] + 1).T
        label = labels[row * self.workspace.width + col]
        # a label that was never written is zero
        out[inside] = np.where(label < 0, ((label & ~1) + BLOCKED) * (costmap.resolution / UNIT), np.inf)
        return out

    def _flood(self, costmap: Costmap, row: int, col: int) -> "np.ndarray[tuple[int], np.dtype[np.int64]]":
        """Labels of all cells, see `search`."""
        space, (straights, diagonals) = self.workspace, self.traversal.halves()
        space.load(costmap.cells, costmap.ways)
        space.begin(row, 0, 2 * int(diagonals[diagonals < BLOCKED].max()) + SLANT, _SHIFT)
        forbid = 0 if self.traversal.corner_cutting else BLOCKED
        for first in (0, 4):  # an expansion looks half round
            space.labels[row * space.width + col] = 1 - BLOCKED
            space.push(row, col, first, 0, _SHIFT)
            limit, ended = 1 if first == 0 else _SLICE, FULL
            while ended != ENDED:
                ended = search(
                    space.cells.ravel(), space.width, straights, diagonals, space.around, space.labels, space.queue,
                    space.counts, space.state, space.found, -9, -9, 0, 0, _SHIFT, forbid, space.allowed,
                    space.every, limit,
                )  # fmt: skip
                if ended == FULL:
                    space.grow()
                elif first == 0:
                    break
        return space.labels
