"""The ground: a tilted plane that is slippery here and there."""

from dataclasses import dataclass
from typing import final

import numpy as np

from outrider.typing import Floats


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Patch:
    """A round patch about `centre` (e, n) [m]: shares of the speed that wheels lose to slip, along and across."""

    centre: tuple[float, float]
    radius: float
    longitudinal: float = 0.0
    lateral: float = 0.0


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Ground:
    """z = slope[0] x + slope[1] y (rise per metre, east and north), with slip everywhere and patches with their own.

    A longitudinal slip of 0.1 lets a wheel roll 0.9 m for every metre its rim turns; where patches overlap, or overlap
    with the rest, the later one counts.
    """

    slope: tuple[float, float] = (0.0, 0.0)
    longitudinal: float = 0.0
    lateral: float = 0.0
    patches: tuple[Patch, ...] = ()

    def height(self, p: Floats) -> Floats:
        """(...) m: the ground's height below points (..., 2 or 3)."""
        return p[..., 0] * self.slope[0] + p[..., 1] * self.slope[1]

    def table(self) -> Floats:
        """(1 + patches, 5) for kernels: slope e, slope n, longitudinal slip, lateral slip, number of patches; then for
        each patch its centre x, y, radius, longitudinal, lateral."""
        head = [*self.slope, self.longitudinal, self.lateral, float(len(self.patches))]
        return np.array([head, *([*s.centre, s.radius, s.longitudinal, s.lateral] for s in self.patches)])
