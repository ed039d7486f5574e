"""Square cells over a part of the site: what a map says of each, and what it costs to drive there."""

from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from outrider.errors import DataError
from outrider.typing import Bools, Floats, Ints

OCCUPIED: Final = 65  # percent and more: the usual `occupied_thresh` of map_server
UNKNOWN: Final = 255

FREE: Final = 0
INSCRIBED: Final = 253  # a robot's centre here surely collides, whichever way it faces
LETHAL: Final = 254  # the cell itself is taken


def _require_cells(cells: NDArray[np.uint8], resolution: float, origin: Floats, where: str) -> None:
    if cells.ndim != 2 or cells.dtype != np.uint8 or not cells.size:
        raise DataError(f"cells must be a matrix of uint8, not {cells.dtype} {cells.shape}", where=where)
    if not (0.0 < resolution < np.inf) or origin.shape != (2,) or not np.isfinite(origin).all():
        at = f"resolution {resolution:g} m and origin {origin.tolist()}"
        raise DataError(f"no {where} has {at}", where=where, fix="a positive resolution and two finite coordinates")


def _cell_of(p: Floats, resolution: float, origin: Floats) -> Ints:
    return np.floor((p - origin) / resolution).astype(np.int64)[..., ::-1]


def _centre_of(cell: Ints, resolution: float, origin: Floats) -> Floats:
    return origin + (cell[..., ::-1] + 0.5) * resolution


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """Square cells as nav_msgs/OccupancyGrid has them: 0 free .. 100 occupied, 255 unknown.

    cells : (rows, cols) uint8, row 0 south, column 0 west;  resolution : side of a cell [m];
    origin : (2,) m, site frame, the outer (south-western) corner of cell [0, 0].
    """

    cells: NDArray[np.uint8]
    resolution: float
    origin: Floats

    def __post_init__(self) -> None:
        _require_cells(self.cells, self.resolution, self.origin, "grid")

    @property
    def occupied(self) -> Bools:
        """(rows, cols) whether a cell is known to be taken; unknown cells are not."""
        return (self.cells >= OCCUPIED) & (self.cells != UNKNOWN)

    def cell_of(self, p: Floats) -> Ints:
        """(..., 2) row and column of points (..., 2) [m], also beyond the grid's edges."""
        return _cell_of(p, self.resolution, self.origin)

    def centre_of(self, cell: Ints) -> Floats:
        """(..., 2) m, site frame: the middle of cells (..., 2), row and column."""
        return _centre_of(cell, self.resolution, self.origin)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Costmap:
    """What it costs to have a robot's centre in a cell: 0 free, 1..252 near something, 253 `INSCRIBED`, 254 `LETHAL`,
    255 `UNKNOWN`, as nav2_costmap_2d has them.

    cells : (rows, cols) uint8, row 0 south, column 0 west;  resolution : side of a cell [m];
    origin : (2,) m, site frame, the outer (south-western) corner of cell [0, 0];  ways : (rows, cols) uint8, bit d is
    set where a cell may be left for its neighbour at 45 deg d, counter-clockwise from the east; None: every way.
    """

    cells: NDArray[np.uint8]
    resolution: float
    origin: Floats
    ways: NDArray[np.uint8] | None = None

    def __post_init__(self) -> None:
        _require_cells(self.cells, self.resolution, self.origin, "costmap")
        if self.ways is not None and (self.ways.shape, self.ways.dtype) != (self.cells.shape, self.cells.dtype):
            what = f"ways of {self.ways.dtype} {self.ways.shape} for cells {self.cells.shape}"
            raise DataError(what, where="costmap", fix="a uint8 for every cell")

    def cell_of(self, p: Floats) -> Ints:
        """(..., 2) row and column of points (..., 2) [m], also beyond the map's edges."""
        return _cell_of(p, self.resolution, self.origin)

    def centre_of(self, cell: Ints) -> Floats:
        """(..., 2) m, site frame: the middle of cells (..., 2), row and column."""
        return _centre_of(cell, self.resolution, self.origin)
