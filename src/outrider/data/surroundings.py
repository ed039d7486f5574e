"""What a robot must keep clear of, as a local planner sees it."""

from dataclasses import dataclass, field
from typing import Final, Self, final

import numpy as np

from outrider.core.distances import distances
from outrider.data.grid import LETHAL, UNKNOWN, Costmap
from outrider.errors import DataError
from outrider.typing import Floats

NOTHING: Final = np.empty((0, 5))
FAR: Final = 1e6  # m


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class DistanceField:
    """How far it is to the nearest taken cell.

    distances : (rows, cols) m between the centres of cells, 0 in a taken one; row 0 south;  resolution : m;
    origin : (2,) m, site frame, outer corner of cell [0, 0].
    """

    distances: Floats
    resolution: float
    origin: Floats

    @classmethod
    def of(cls, costmap: Costmap, *, unknown_is_free: bool = False) -> Self:
        """Exact Euclidean distances to lethal cells, and to unknown ones unless they are declared free."""
        taken = costmap.cells == LETHAL
        if not unknown_is_free:
            taken |= costmap.cells == UNKNOWN
        d = np.minimum(distances(taken, costmap.resolution), FAR)
        return cls(distances=d, resolution=costmap.resolution, origin=costmap.origin)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Surroundings:
    """discs : (n, 5) x, y, radius [m], v_x, v_y [m/s], site frame: points and round things, still or moving;
    wary : (m, 5) the same of what stands and may set off: it is passed slowly or at a distance, and is no obstacle by
    itself;  field : what is mapped.  Raises DataError for discs that are not finite or of negative radius.
    """

    discs: Floats = field(default_factory=lambda: NOTHING)
    wary: Floats = field(default_factory=lambda: NOTHING)
    field: DistanceField | None = None

    def __post_init__(self) -> None:
        for discs in (self.discs, self.wary):
            if discs.ndim != 2 or discs.shape[1:] != (5,):
                fix = "rows of x, y, radius, v_x, v_y"
                raise DataError(f"discs of shape {discs.shape}", where="surroundings", fix=fix)
            bad = ~np.isfinite(discs).all(axis=1) | (discs[:, 2] < 0.0)
            if bad.any():
                at = int(np.flatnonzero(bad)[0])
                raise DataError(f"disc {at} is {discs[at].tolist()}", where="surroundings", fix="drop the point")

    @classmethod
    def points(cls, p: Floats, radius: float = 0.0, v: Floats | None = None) -> Self:
        """Points (n, 2) m of one radius, moving at v (n, 2) m/s."""
        discs = np.zeros((len(p), 5))
        discs[:, :2], discs[:, 2] = p, radius
        if v is not None:
            discs[:, 3:] = v
        return cls(discs=discs)


OPEN: Final = Surroundings()
