"""A timed path of poses, with velocity and covariance where they are known."""

from dataclasses import dataclass, field
from math import dist
from typing import Final, final

import numpy as np

from outrider.errors import DataError
from outrider.typing import Bools, Floats, Ints

STEPS: Final = (0.1, 1.0)  # m: motion below the first is noise whatever the source says, above the second it is none
LOST: Final = 1000.0  # m: a standard deviation beyond which a position is none


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
    (x y z, rotation vector in the body frame), or (0, 6, 6);  valid : (n,) whether the source stands by its position;
    dropped : rows of its file that no pose could be read from.
    """

    t: Ints
    p: Floats
    q: Floats
    v: Floats = field(default_factory=lambda: _empty(3))
    P: Floats = field(default_factory=lambda: np.zeros((0, 6, 6)))
    valid: Bools = field(default_factory=lambda: np.zeros(0, np.bool_))
    datum: Datum | None = None
    name: str = ""
    dropped: int = 0

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
        """Distance travelled [m], to which noise does not add up.

        A place counts once it is further from the last that counted than the standard deviation of its position, within
        `STEPS` (the least of them where none is known). Where that deviation is above `LOST` nobody knows the place.
        """
        sd = np.sqrt(np.maximum(np.trace(self.P[:, :3, :3], axis1=1, axis2=2), 0.0)) if len(self.P) else STEPS[0]
        known = np.isfinite(self.p).all(axis=1) & (sd <= LOST)
        places, steps = self.p[known].tolist(), np.broadcast_to(np.clip(sd, *STEPS), known.shape)[known].tolist()
        total, last = 0.0, places[0] if places else []
        for place, step in zip(places, steps, strict=True):
            away = dist(place, last)
            if away > step:
                total, last = total + away, place
        return total
