"""How much sightings scatter, from the data: deviations of ranges and bearings, and how long an error lasts."""

from collections.abc import Iterable
from typing import Final, NamedTuple

import numpy as np

from outrider.core.attitudes import wrap_all
from outrider.filters.cooperative import TeamEstimate
from outrider.typing import Bools, Floats
from outrider.workflows.team_records import OPEN, TeamLog

LEAST: Final = (0.02, np.radians(0.5))  # m, rad: finer than a camera reads
MOST: Final = (1.0, np.radians(10.0))
FEW: Final = 50  # sightings that tell nothing
SOON: Final = 1.0  # s between two sightings of one landmark whose errors are compared
NORMAL: Final = 1.4826  # median of |N(0, 1)| to its deviation
LASTING: Final = 0.6  # the highest correlation that is believed
FRAME: Final = 0.005  # s, within which two landmarks are seen in one picture


class Noise(NamedTuple):
    """Deviations of sightings [m, rad], as filters use them; measured : whether they come from the data."""

    range_m: float
    bearing: float
    measured: bool


FIRST: Final = Noise(0.15, float(np.radians(1.5)), False)


def noise_of(log: TeamLog, done: TeamEstimate, who: Iterable[int]) -> Noise:
    """Deviations of what landmarks' sightings are off by in a first run, the median of the robots: of bearings sigma,
    of ranges sigma sqrt((1 + rho) / (1 - rho)).

    sigma is by the median, which misread barcodes do not move; of bearings by what two of one picture differ, since
    what the heading is off by is in both. rho is the correlation of consecutive errors of one landmark: white noise of
    the larger deviation tells as much, in the long run, as the noise that lasts (Bayley and Hammersley 1946).
    """
    found = [sd for i in who if (sd := _of_robot(log, done, i)) is not None]
    if not found:
        return FIRST
    middle = np.median(found, axis=0)
    return Noise(float(middle[0]), float(middle[1]), True)


def _of_robot(log: TeamLog, done: TeamEstimate, i: int) -> tuple[float, float] | None:
    """What one robot's ranges and bearings scatter by; None if it saw too little."""
    started = log.seen.t >= done.members[log.mates[i].name].start
    own = (log.seen.robot == i) & (log.seen.what == OPEN) & np.isin(log.seen.subject, list(log.marks)) & started
    rows = np.flatnonzero(own)
    if rows.size < FEW:
        return None
    rows = rows[np.lexsort((log.seen.t[rows], log.seen.subject[rows]))]
    x, t, subject = done.x[log.mates[i].name], log.seen.t[rows], log.seen.subject[rows]
    p = np.column_stack([np.interp(t, done.t, x[:, c]) for c in range(2)])
    heading = np.interp(t, done.t, np.unwrap(x[:, 2]))
    d = np.array([log.marks[k] for k in subject.tolist()]) - p
    miss = log.seen.z[rows] - np.column_stack([np.hypot(*d.T), np.arctan2(d[:, 1], d[:, 0]) - heading])
    miss[:, 1] = wrap_all(miss[:, 1])
    follows = np.concatenate([[False], (np.diff(subject) == 0) & (np.diff(t) < SOON)])
    apart = _within_frames(t, miss[:, 1])
    b = apart if apart.size > FEW else miss[:, 1]
    return _deviation(miss[:, 0], follows, LEAST[0], MOST[0]), _deviation(b, None, LEAST[1], MOST[1])


def _within_frames(t: Floats, bearing: Floats) -> Floats:
    """Differences of the errors of two bearings in one picture, over sqrt(2): what the heading is off by is in both."""
    order = np.argsort(t, kind="stable")
    same = np.diff(t[order]) < FRAME
    return np.asarray(np.diff(bearing[order])[same] / np.sqrt(2.0), np.float64)


def _deviation(e: Floats, follows: Bools | None, least: float, most: float) -> float:
    e = e - np.median(e)
    sigma = max(NORMAL * float(np.median(np.abs(e))), 1e-9)
    k = np.flatnonzero(follows if follows is not None else [])
    k = k[(np.abs(e[k]) < 4.0 * sigma) & (np.abs(e[k - 1]) < 4.0 * sigma)]
    rho = float(np.mean(e[k] * e[k - 1]) / np.mean(0.5 * (e[k] ** 2 + e[k - 1] ** 2))) if k.size > FEW else 0.0
    rho = min(max(rho, 0.0), LASTING)
    return float(np.clip(sigma * np.sqrt((1.0 + rho) / (1.0 - rho)), least, most))
