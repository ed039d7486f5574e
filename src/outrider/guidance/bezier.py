"""Line-of-sight guidance along a Bezier curve through what the target has left behind.  swarm2023, section 2.2

The paper flies at P(i / n), i = 0 ... n, one after the other: for a follower that is faster than expected they lie
behind it, and it turns back. Here it flies at the end of the curve or at the first point ahead, slower near the end.
"""

from enum import Enum
from typing import Final

import numpy as np

from outrider.core.bezier import BezierPath, through
from outrider.errors import DataError
from outrider.guidance.pursuit import closing_speed
from outrider.typing import Floats

STEPS: Final = 16  # points per curve among which the first ahead is found


class Aim(Enum):
    """Which point of the curve is flown at."""

    END = "the end of the curve, where the target was last"
    AHEAD = "the first point of the curve that lies ahead by the lookahead"


def trail_curve(trail: Floats, *, degree: int | None = None, continuity: int = 1) -> BezierPath:
    """The curve through a trail (m, 3), oldest first; `degree` n : one curve over its last n + 1 points, as the paper.

    Raises DataError for a trail of fewer than two different points: hover until there is one.
    """
    p = np.asarray(trail, np.float64)
    if degree is None:
        return BezierPath(through(p, continuity=continuity))
    if len(p) < 2 or float(np.ptp(p[-degree - 1 :], axis=0).max(initial=0.0)) < 1e-9:
        raise DataError("a trail of one place", fix="hover until the target has moved")
    return BezierPath(p[None, -degree - 1 :])


def aim_point(path: BezierPath, p: Floats, aim: Aim, *, lookahead: float = 2.0) -> Floats:
    """(3,) where to fly from p (3,): never behind, so the command never turns round along the curve."""
    if aim is Aim.END:
        return path.at(path.length)
    return path.at(path.nearest(p) + lookahead)


def fly_along(
    path: BezierPath, p: Floats, speed: float, aim: Aim, *, lookahead: float = 2.0, set_point: float = 0.0,
    gain: float = 0.5, brake: float = 1.0, end_velocity: Floats | None = None,
) -> Floats:  # fmt: skip
    """(3,) m/s towards the point aimed at, at `speed` and no faster than it can slow down to the target's.

    set_point : m of the way before the end at which it goes along with the target;  end_velocity : (3,) m/s, of it
    """
    way = path.nearest(p)
    target, beside = aim_point(path, p, aim, lookahead=lookahead), np.zeros(3)
    if end_velocity is not None:
        beside = np.asarray(end_velocity, np.float64)
    line = target - p
    far = float(np.linalg.norm(line))
    if far < 1e-6:
        return beside
    left = path.length - way + float(np.linalg.norm(path.at(way) - p)) - set_point
    along = max(float(beside @ line) / far, 0.0)
    return line / far * min(max(along + float(closing_speed(left, gain, brake)), 0.0), speed)
