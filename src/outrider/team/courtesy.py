"""Who stops for whom where two robots meet: what both say of themselves is enough to agree on it."""

from collections.abc import Iterable
from typing import Final

import numpy as np

from outrider.team.words import Status
from outrider.typing import Floats

NEAR: Final = 0.8  # m between two robots that are on the move
REACTION_S: Final = 0.6  # s until what one decides is seen in what the other hears
APART: Final = 1.2  # m at which robots that go straight on may pass each other
CLOSING: Final = 0.05  # m/s
MOVES: Final = 0.15  # m/s
STALE_S: Final = 3.0  # s


def rank(name: str, order: int) -> tuple[bool, str]:
    """Whoever follows an order comes first, then names in their order."""
    return order < 0, name


def gives_way(
    t: int, p: Floats, v: Floats, own: tuple[bool, str], others: Iterable[Status], *, wide: float, braking: float
) -> str:
    """The robot for which this one stops, "" for none.

    It stops for one that ranks before it, is ahead, comes nearer, and is nearer than both need to stop:

        gap < NEAR + closing REACTION_S + (|v|^2 + |v_other|^2) / (2 braking)

    unless both would pass APART from each other. p, v : (2,) m, m/s, site frame;  wide : m between the middles of two
    that touch;  braking : m/s^2.
    """
    speed = float(np.hypot(*v))
    for s in others:
        ago = (t - s.t) * 1e-9
        theirs = float(np.hypot(*s.velocity))
        if ago > STALE_S or theirs < MOVES or rank(s.robot, s.order) >= own:
            continue
        d, w = s.pose[:2] + s.velocity * ago - p, s.velocity - v
        far = float(np.hypot(*d))
        closing = -float(d @ w) / max(far, 1e-6)
        aside = abs(float(d[0] * w[1] - d[1] * w[0])) / max(float(np.hypot(*w)), 1e-6)
        stop = NEAR + closing * REACTION_S + (speed**2 + theirs**2) / (2.0 * braking)
        if closing > CLOSING and float(d @ v) >= 0.0 and aside - wide < APART and far - wide < stop:
            return s.robot
    return ""
