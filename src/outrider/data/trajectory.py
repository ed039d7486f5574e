"""A timed path of poses, with velocity and covariance where they are known."""

from dataclasses import dataclass, field
from typing import final

import numpy as np

from outrider.errors import DataError
from outrider.typing import Bools, Floats, Ints


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Datum:
    """The one explicit origin of a site's east-north-up frame. lat, lon [rad]; alt [m] above the WGS84 ellipsoid unless
    `altitude` says otherwise (the reference then carries over to every height in the site frame)."""

    lat: float
    lon: float
    alt: float
    altitude: str = "ELLIPSOID"


def _empty(columns: int) -> Floats:
    return np.zeros((0, columns))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Trajectory:
    """Poses of one body over time.

    t : (n,) int64 ns, strictly increasing;  p : (n, 3) m, site frame (ENU);  q : (n, 4) x y z w, R_site_body, rows of
    NaN where the heading is unknown;  v : (n, 3) m/s, site frame, or (0, 3);  P : (n, 6, 6) covariance of
    (x y z, rotation vector in the body frame), or (0, 6, 6);  valid : (n,) whether the source stands by its position.
    """

    t: Ints
    p: Floats
    q: Floats
    v: Floats = field(default_factory=lambda: _empty(3))
    P: Floats = field(default_factory=lambda: np.zeros((0, 6, 6)))
    valid: Bools = field(default_factory=lambda: np.zeros(0, np.bool_))
    datum: Datum | None = None
    name: str = ""

    def __post_init__(self) -> None:
        n = self.t.size
        if self.p.shape != (n, 3) or self.q.shape != (n, 4):
            raise DataError(f"trajectory of {n} stamps with p {self.p.shape} and q {self.q.shape}", where=self.name)
        if n > 1 and not bool(np.all(np.diff(self.t) > 0)):
            raise DataError("stamps do not increase", where=self.name, fix="sort the rows and drop repeated stamps")

    def __len__(self) -> int:
        return int(self.t.size)

    @property
    def yaw(self) -> Floats:
        """(n,) heading [rad], counter-clockwise from east."""
        x, y, z, w = self.q.T
        return np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))

    @property
    def length(self) -> float:
        """Path length [m]."""
        return float(np.linalg.norm(np.diff(self.p, axis=0), axis=1).sum())
