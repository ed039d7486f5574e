"""Discs that hold a footprint: what the optimisation keeps clear; the exact outline is checked afterwards."""

from typing import Final

import numpy as np

from outrider.data.footprint import Footprint
from outrider.typing import Floats

MOST: Final = 4
EXCESS: Final = 1.15  # of the half width, good enough


def cover(footprint: Footprint) -> Floats:
    """(k, 3) x, y, radius, body frame: equal discs along the longer side of the outline's box, k <= 4."""
    low, high = footprint.outline.min(axis=0), footprint.outline.max(axis=0)
    middle, size = 0.5 * (low + high), high - low
    along = 0 if size[0] >= size[1] else 1
    length, half = float(size[along]), 0.5 * float(size[1 - along])
    if length == 0.0:
        return np.array([[*middle, footprint.radius]])
    radii = [float(np.hypot(0.5 * length / k, half)) + footprint.radius for k in range(1, MOST + 1)]
    k = next((i + 1 for i, r in enumerate(radii) if r <= EXCESS * (half + footprint.radius)), MOST)
    discs = np.empty((k, 3))
    discs[:, :2], discs[:, 2] = middle, radii[k - 1]
    discs[:, along] += length * ((np.arange(k) + 0.5) / k - 0.5)
    return discs
