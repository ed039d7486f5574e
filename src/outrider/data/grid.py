"""An occupancy grid over a part of the site."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from outrider.errors import DataError
from outrider.typing import Bools, Floats, Ints

OCCUPIED = 65  # percent and more: the usual `occupied_thresh` of map_server
UNKNOWN = 255


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
        if self.cells.ndim != 2 or self.cells.dtype != np.uint8 or not self.cells.size:
            found = f"{self.cells.dtype} {self.cells.shape}"
            raise DataError(f"cells must be a matrix of uint8, not {found}", where="grid")
        if not (0.0 < self.resolution < np.inf) or self.origin.shape != (2,) or not np.isfinite(self.origin).all():
            at = f"resolution {self.resolution:g} m and origin {self.origin.tolist()}"
            raise DataError(f"no grid has {at}", where="grid", fix="a positive resolution and two finite coordinates")

    @property
    def occupied(self) -> Bools:
        """(rows, cols) whether a cell is known to be taken; unknown cells are not."""
        return (self.cells >= OCCUPIED) & (self.cells != UNKNOWN)

    def cell_of(self, p: Floats) -> Ints:
        """(..., 2) row and column of points (..., 2) [m], also beyond the grid's edges."""
        return np.floor((p - self.origin) / self.resolution).astype(np.int64)[..., ::-1]

    def centre_of(self, cell: Ints) -> Floats:
        """(..., 2) m, site frame: the middle of cells (..., 2), row and column."""
        return self.origin + (cell[..., ::-1] + 0.5) * self.resolution
