"""An open field."""

import numpy as np

from outrider.sim.world import Fence, Ground, Wind, World


def open_field(side: float = 400.0, *, ceiling: float = 120.0, wind: Wind = Wind(), ground: Ground = Ground()) -> World:
    """Nothing stands on it; a fence around a square of `side` [m] about the origin, with a ceiling [m]."""
    corners = 0.5 * side * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    return World(name="open field", wind=wind, ground=ground, fence=Fence(polygon=corners, ceiling=ceiling))
