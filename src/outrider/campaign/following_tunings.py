"""Q and R of swarm2023's three filters as printed, signs of exponents repaired, and what stands for them here.

Printed R has seven entries for six measurements [g(3), h(2), d]: entries 1 to 5 and 7 are taken. "x 10^n" lost its sign
in the full-signal case (an R of 0.1 is the only one that fits the printed RMSE), and Q of 10^10 in the blocked one.
"""

from dataclasses import dataclass
from typing import Final, final

import numpy as np

from outrider.models.motion.following import Variant
from outrider.typing import Floats


@final
@dataclass(frozen=True, slots=True)
class Printed:
    """One filter's noise variances: q (6,) a step, r (6,) of fix, direction and distance."""

    q: Floats
    r: Floats


def printed(scale: float, r: tuple[float, ...], q_scale: float, q: tuple[float, ...]) -> Printed:
    """Variances from the seven numbers of R and the six of Q as the paper writes them, each with its factor."""
    return Printed(q_scale * np.array(q), scale * np.array(r)[[0, 1, 2, 3, 4, 6]])


_EVEN: Final = printed(0.1, (5.0, 5.0, 5.0, 5.0, 5.0, 5.0, 10.0), 0.1, (5.0,) * 6)
_BLOCKED: Final = (1e-10, 1e-10, 1.0, 1.0, 1.0, 1.0)
FULL: Final = {
    "EKF": printed(0.1, (1.0, 1.0, 1.0, 5.0, 5.0, 1.0, 10.0), 1.0, (5.0, 5.0, 1.0, 1.0, 1.0, 1.0)),
    "UKF": _EVEN,
    "EnKF": _EVEN,
}
"""Section 4.1.1."""
BLOCKED: Final = {
    "EKF": printed(1e3, (6.0, 0.1, 0.01, 1.0, 0.1, 0.001, 0.1), 1.0, _BLOCKED),
    "UKF": printed(1e2, (50.0, 0.2, 0.01, 50.0, 0.2, 0.01, 0.07), 1.0, _BLOCKED),
    "EnKF": printed(1e2, (10.0, 0.2, 0.01, 30.0, 10.0, 0.01, 0.05), 1.0, _BLOCKED),
}
"""Section 4.1.2, while there is no signal and the last fix is held."""
VARIANTS: Final = {v.name.lower(): v for v in Variant}
