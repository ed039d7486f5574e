"""What a lidar that turns in the plane has seen."""

from dataclasses import dataclass
from typing import final

import numpy as np

from outrider.errors import DataError
from outrider.typing import Bools, Floats


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Scan:
    """One turn of a 2-D lidar.

    pose : (3,) east, north [m] and heading [rad] of the sensor, site frame, in the middle of the turn;
    bearings : (n,) rad from the sensor's forward, counter-clockwise;  ranges : (n,) m, inf where nothing returned;
    reach : m, how far it sees: what is no nearer has not returned;  blind : m, what is nearer tells nothing;
    age : s since then.  A range that is NaN, or -inf, tells nothing either.

    Raises DataError for a pose or a bearing that is not finite, and for arrays that do not fit.
    """

    pose: Floats
    bearings: Floats
    ranges: Floats
    reach: float
    blind: float = 0.0
    age: float = 0.0

    def __post_init__(self) -> None:
        if self.pose.shape != (3,) or self.bearings.ndim != 1 or self.ranges.shape != self.bearings.shape:
            shapes = f"pose {self.pose.shape}, bearings {self.bearings.shape}, ranges {self.ranges.shape}"
            raise DataError(shapes, where="scan", fix="(3,), and as many ranges as bearings")
        if not (np.isfinite(self.pose).all() and np.isfinite(self.bearings).all()):
            raise DataError("the sensor's pose or a bearing is not finite", where="scan", fix="where is the robot?")
        if not 0.0 <= self.blind < self.reach < np.inf:
            raise DataError(f"sees from {self.blind:g} to {self.reach:g} m", where="scan", fix="0 <= blind < reach")

    @property
    def usable(self) -> Bools:
        """(n,) whether a beam tells something: that it hit, or that nothing returned."""
        return self.ranges >= self.blind

    def hits(self, reach: float = np.inf) -> Floats:
        """(m, 2) m, site frame: where beams ended, up to `reach` [m]."""
        hit = self.usable & (self.ranges < self.reach) & (self.ranges <= reach)
        angle = self.pose[2] + self.bearings[hit]
        return self.pose[:2] + self.ranges[hit, None] * np.column_stack([np.cos(angle), np.sin(angle)])
