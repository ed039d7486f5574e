"""The one place where angles are folded: subtract two headings, then `wrap` the difference.

This is SO(2): a rotation of the plane is its angle, composition is a sum, Log is `wrap`, and every Jacobian is 1.
"""

from math import ceil, cos, pi, sin

import numpy as np
from numpy.typing import ArrayLike

from outrider._kernel import kernel
from outrider.typing import Floats

_TURN = 2.0 * pi


@kernel
def wrap(a: float) -> float:
    """Angle [rad] folded into (-pi, pi]; one that is inside already comes back bit for bit.

    >>> wrap(0.3), wrap(3 * pi) == pi, wrap(-pi) == pi
    (0.3, True, True)
    """
    if -pi < a <= pi:
        return a
    if not np.isfinite(a):
        return np.nan
    b = a - _TURN * ceil((a - pi) / _TURN)
    if b <= -pi:  # the division rounded the wrong way
        b += _TURN
    elif b > pi:
        b -= _TURN
    return b


@kernel
def turn(a: float, v: Floats, out: Floats) -> None:
    """out (2,) = R(a) v, counter-clockwise; out may be v."""
    c, s = cos(a), sin(a)
    out[0], out[1] = c * v[0] - s * v[1], s * v[0] + c * v[1]


def wrap_all(a: ArrayLike) -> Floats:
    """Angles [rad] of any shape folded into (-pi, pi]; NaN stays NaN and infinity becomes it.

    >>> wrap_all([0.3, -pi, 2 * pi]).tolist()
    [0.3, 3.141592653589793, 0.0]
    """
    angles = np.asarray(a, dtype=np.float64)
    angles = np.where(np.isfinite(angles), angles, np.nan)
    folded = angles - _TURN * np.ceil((angles - pi) / _TURN)
    folded = np.where(folded <= -pi, folded + _TURN, folded)
    return np.where(folded > pi, folded - _TURN, folded)
