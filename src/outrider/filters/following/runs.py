"""A whole flight by the extended, the unscented or the ensemble Kalman filter: same model, same Q and R, same records.

Everything linear is treated exactly by the first two: process and fixes go through the Kalman filter's own formulas,
which are what sigma points give on them to rounding. Only a direction of flight is not linear: there the extended
filter takes a Jacobian, the unscented 2 n points of the cubature rule, the ensemble its members. A fix is fused before
the direction of the same moment.
"""

from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.random import Generator

from outrider.errors import UsageError
from outrider.filters.following.ensemble import run_ensemble
from outrider.filters.following.gaussian import run_gaussian
from outrider.filters.following.records import Log, Track, workspace
from outrider.filters.smoother import Smoothed, smooth
from outrider.models.motion.following import STILL_AIR, WINDY
from outrider.typing import Floats


@final
@dataclass(frozen=True, slots=True)
class Kind:
    """Which filter. members : of an ensemble, with square_root for its deterministic update; 0 for a Gaussian one."""

    name: str
    unscented: bool = False
    members: int = 0
    square_root: bool = False


EKF: Final = Kind("EKF")
UKF: Final = Kind("UKF", unscented=True)
ENKF: Final = Kind("EnKF", members=900)


def run(kind: Kind, flight: Log, x: Floats, P: Floats, rng: Generator | None = None) -> Track:
    """A filter over a flight from x (n,), P (n, n), n = 6 or 9; an ensemble draws its members from rng."""
    n, events = x.size, flight.step.size
    shapes = ((events, n), (events, n, n), (events, n), (events, n, n), (events,))
    out, scratch = Track(*(np.zeros(s) for s in shapes)), workspace(n, kind.members)
    if not kind.members:
        run_gaussian(flight, x.copy(), P.copy(), kind.unscented, out, scratch)
    elif rng is None:
        raise UsageError(f"{kind.name} needs random numbers", fix="give a generator")
    else:
        run_ensemble(flight, x.copy(), P.copy(), rng, kind.square_root, out, scratch)
    return out


def smoothed(flight: Log, track: Track) -> Smoothed:
    """Rauch-Tung-Striebel: what each moment would have known with all records, from a track of `run`."""
    n = track.x.shape[1]
    F = np.tile(np.eye(n), (flight.step.size, 1, 1))
    for row, c in zip(F, flight.C[flight.step], strict=True):
        for i in range(3):
            row[i, 3 + i], row[3 + i, 3 + i] = c[i, 0], c[i, 1]
            if n == 9:
                row[i, 6 + i], row[3 + i, 6 + i] = c[i, 2], c[i, 3]
    layout = WINDY if n == 9 else STILL_AIR
    return smooth(track.x, track.P, track.xp, track.Pp, F, layout.table)
