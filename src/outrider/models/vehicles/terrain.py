"""The ground under vehicles: an inclined plane with slippery patches, as one table for kernels.

`ground` (1 + m, 5), row 0:   slope dz/de, dz/dn of the plane z = slope . (e, n); longitudinal and lateral slip where
                              no patch is (0 grips, 1 spins freely); number m of patches;
rows 1 to m:                  a patch: east, north, radius [m], longitudinal and lateral slip.
Where patches overlap the last one counts.
"""

from math import sqrt

from outrider._kernel import kernel
from outrider.typing import Floats


@kernel
def height_at(ground: Floats, e: float, n: float) -> float:
    """z of the ground [m]."""
    return ground[0, 0] * e + ground[0, 1] * n


@kernel
def slip_at(ground: Floats, e: float, n: float) -> tuple[float, float]:
    """Longitudinal and lateral slip of the ground there."""
    for row in range(ground.shape[0] - 1, 0, -1):
        de, dn, r = e - ground[row, 0], n - ground[row, 1], ground[row, 2]
        if de * de + dn * dn <= r * r:
            return ground[row, 3], ground[row, 4]
    return ground[0, 2], ground[0, 3]


@kernel
def plane_quat(ground: Floats) -> tuple[float, float, float]:
    """(x, y, w) of the shortest rotation that tilts the vertical into the normal of the ground; its z is zero."""
    a, b = ground[0, 0], ground[0, 1]
    norm = sqrt(1.0 + a * a + b * b)  # normal = (-a, -b, 1) / norm
    scale = 1.0 / sqrt(2.0 * norm * (norm + 1.0))
    return b * scale, -a * scale, (norm + 1.0) * scale
