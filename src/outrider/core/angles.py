"""The one place where angles are folded: subtract two headings, then `wrap` the difference.

This is SO(2): a rotation of the plane is its angle, composition is a sum, Log is `wrap`, and every Jacobian is 1.
"""

from math import ceil, cos, pi, sin

import numpy as np

from outrider._kernel import kernel
from outrider.core.attitudes import TURN
from outrider.core.attitudes import wrap_all as wrap_all
from outrider.typing import Floats


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
    b = a - TURN * ceil((a - pi) / TURN)
    if b <= -pi:  # the division rounded the wrong way
        b += TURN
    elif b > pi:
        b -= TURN
    return b


@kernel
def turn(a: float, v: Floats, out: Floats) -> None:
    """out (2,) = R(a) v, counter-clockwise; out may be v."""
    c, s = cos(a), sin(a)
    out[0], out[1] = c * v[0] - s * v[1], s * v[0] + c * v[1]
