"""Covariance intersection between two robots: safe whatever their correlation, at a price in accuracy.

Each robot divides its covariance into a part that may be correlated with others, P_d, and one that is its own, P_s. Of
a relative measurement robot i takes, for some weight w in (0, 1),

    P_i^w = P_d,i / w + P_s,i,   P_j^w = P_d,j / (1 - w) + P_s,j,   then an update as if both were independent,

with the w of 19 that leaves the least determinant of its pose, and nothing where none helps. The noise of the
measurement is nobody's and stays as it is. `CI` (Julier and Uhlmann 1997) has no P_s. `SPLIT_CI` (Julier and Uhlmann
2001; Li and Nashashibi 2013) counts as own what has come in since the last exchange, P_d = Psi P_0 Psi': after an
exchange everything is dependent, since variants that keep a part independent are not safe for robots that talk both
ways.
"""

import numpy as np

from outrider.data import Verdict
from outrider.filters.cooperative.meeting import Outcome, Sighting, judged
from outrider.filters.cooperative.robot import Filter, pose_rows
from outrider.typing import Floats

WEIGHTS: Floats = np.arange(1, 20) / 20.0


def intersect(i: Filter, j: Filter, s: Sighting, *, split: bool) -> Outcome:
    """Fuse a relative record both ways, each from the other's estimate before it."""
    if s.y.size == 0:
        return Outcome(Verdict.NOT_OBSERVING, float("nan"), 0)
    dependent = [r.belief.carried @ r.before @ r.belief.carried.T if split else r.belief.P for r in (i, j)]
    found = [
        _toward(i, s.H_i, dependent[0], j, s.H_j, dependent[1], s),
        _toward(j, s.H_j, dependent[1], i, s.H_i, dependent[0], s),
    ]
    for robot, (_, gain) in zip((i, j), found, strict=True):
        if gain is not None:
            robot.correct(*gain)
    if split and any(gain is not None for _, gain in found):
        for robot in (i, j):
            robot.before[...] = robot.belief.P
            robot.mixed = True
            robot.forget()
    return found[0][0] if found[0][1] is not None else found[1][0]


def _toward(
    own: Filter, H: Floats, P_d: Floats, other: Filter, H_o: Floats, O_d: Floats, s: Sighting
) -> tuple[Outcome, tuple[Floats, Floats] | None]:
    """Correction and covariance of one robot at the best weight; None if no weight helps."""
    P, w = own.belief.P, WEIGHTS[:, None, None]
    rows = pose_rows(own.members[0])
    HPH = H @ P @ H.T + (1.0 / w - 1.0) * (H @ P_d @ H.T)
    S = HPH + H_o @ other.belief.P @ H_o.T + (1.0 / (1.0 - w) - 1.0) * (H_o @ O_d @ H_o.T) + np.diag(s.r)
    PH = P @ H.T + (1.0 / w - 1.0) * (P_d @ H.T)
    pose = P[np.ix_(rows, rows)] + (1.0 / w - 1.0) * P_d[np.ix_(rows, rows)]
    U = PH[:, rows]
    after = pose - U @ np.linalg.solve(S, np.swapaxes(U, 1, 2))
    size, before = np.linalg.slogdet(after)[1], np.linalg.slogdet(P[np.ix_(rows, rows)])[1]
    best = int(np.argmin(size))
    outcome = judged(S[best], s.y, own.group.gate)
    if outcome.verdict is not Verdict.USED or not size[best] < before:
        return outcome, None
    inflated = P + (1.0 / WEIGHTS[best] - 1.0) * P_d
    K = np.linalg.solve(S[best], PH[best].T).T
    return outcome, (K @ s.y, inflated - K @ PH[best].T)
