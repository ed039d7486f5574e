"""Why a distance cannot be guaranteed: which of what is assumed costs the most of the room.

`keep_apart` gives up where the largest admissible approach is below what the follower can fly away at. Each assumption
is left out in turn; the one without which the follower might approach fastest is the reason.
"""

from dataclasses import replace
from enum import Enum
from math import exp

import numpy as np

from outrider.safety.separation import Separation, largest_approach, lowest
from outrider.typing import Floats


class Lack(Enum):
    """What there was too much of; the value is the sentence a user reads."""

    INSIDE = "both are nearer than the distance already"
    TURN = "the target is beside or ahead and may turn towards it: stay farther away, or allow it less of a turn"
    DELAY = "the target's last fix is too old: fixes more often, or with less delay"
    COVARIANCE = "it is too uncertain where both are: better fixes, or a velocity told with them"
    SPEED = "it flies towards the target too fast to stop in time: a lower speed, or a quicker vehicle"


def lacking(own: Floats, other: Floats, separation: Separation, P: Floats, age_s: float) -> Lack:
    """The reason; own, other : (6,) position and velocity, the other's `age_s` s ago;  P : (6, 6) of their difference.

    See `keep_apart`, of whose `CANNOT_HOLD` it is the explanation.
    """
    tau, theta = separation.other_lag_s, separation.theta()
    lever = tau * (1.0 - exp(-age_s / tau)) if tau > 0.0 else 0.0
    way = other[:3] + lever * other[3:] - own[:3]
    n = way / max(float(np.linalg.norm(way)), 1e-9)
    gap, v, s = float(n @ (other[:3] - own[:3])), float(n @ own[3:]), float(n @ other[3:])
    if min(gap + lever * s, gap + age_s * s) <= separation.distance:  # whether it braked or flew on
        return Lack.INSIDE
    low = float(lowest(s, float(np.linalg.norm(other[3:])), theta))
    straight = float(lowest(s, float(np.linalg.norm(other[3:])), replace(separation, turn=0.0, approach=0.0).theta()))
    pp, pv, vv = (float(n @ P[a : a + 3, b : b + 3] @ n) for a, b in ((0, 0), (0, 3), (3, 3)))
    without = {
        Lack.TURN: (gap, v, s, straight, age_s, pp, pv, vv),
        Lack.DELAY: (gap + s * age_s, v, s, low, 0.0, pp, pv, vv),
        Lack.COVARIANCE: (gap, v, s, low, age_s, 0.0, 0.0, 0.0),
        Lack.SPEED: (gap, min(v, 0.0), s, low, age_s, pp, pv, vv),
    }
    return max(without, key=lambda lack: float(largest_approach(*without[lack], theta)))
