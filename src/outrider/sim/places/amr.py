"""The three sites of amr2025, drawn from what its text says; its maps are not published.

x is east and y north, in metres, as in the paper's table of targets; robots start at the origin. Targets are the
paper's (table 2) and so, roughly, are the lengths of the shortest tours: 90 m, 46 m and 200 m (table 4).
"""

from collections.abc import Sequence
from typing import Final

import numpy as np

from outrider.data import Grid
from outrider.sim.world import Wall, World
from outrider.typing import Bools, Floats

RESOLUTION: Final = 0.1  # m
PASSAGE_TARGETS: Final = ((-3.0, -7.0), (-3.0, -14.0))
BEND_TARGETS: Final = ((15.29, 17.01), (0.10, 18.28))
LOOP_TARGETS: Final = ((15.0, 85.0), (4.0, 80.0), (0.0, 0.0))

Rectangle = tuple[float, float, float, float]  # west, south, east, north [m]


def amr_passage() -> World:
    """A bicycle parking area: aisles 2 m wide between rows of bicycles, open at alternate ends."""
    west, east, aisle, rack = -12.0, 10.0, 2.0, 1.5
    road: list[Rectangle] = [(west, -15.0, east, 1.0)]
    racks: list[Rectangle] = []
    for k in range(4):
        top = -0.5 * aisle - k * (aisle + rack)
        ends = (west, east - aisle) if k % 2 == 0 else (west + aisle, east)
        racks.append((ends[0], top - rack, ends[1], top))
    return World(name="amr passage", grid=_grid(road, racks), grid_height=1.2)


def amr_bend() -> World:
    """A road 6 m wide that turns from north to east, its inner kerb rounded."""
    half, turn, radius = 3.0, 17.5, 4.0
    east, south = half + radius, turn - half - radius  # the middle of the rounding
    road = [(-half, -5.0, half, turn + half), (-half, turn - half, 21.0, turn + half), (half, south, east, turn - half)]
    return World(name="amr bend", grid=_grid(road, kerb=(east, south, radius)), grid_height=1.0)


def amr_loop() -> World:
    """A road 100 m long around a planted island, 200 m there and back, with two obstacles that are on no map."""
    grid = _grid([(-5.0, -6.0, 20.0, 96.0)], [(7.0, 4.0, 11.0, 89.0)])
    posts = (("obstacle 1", (14.5, 45.0)), ("obstacle 2", (2.5, 40.0)))
    walls = tuple(Wall(name=name, outline=_square(centre, 0.8), high=1.2) for name, centre in posts)
    return World(name="amr loop", grid=grid, grid_height=1.0, walls=walls)


def _square(centre: tuple[float, float], side: float) -> Floats:
    return np.array(centre) + 0.5 * side * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def _grid(
    free: Sequence[Rectangle], taken: Sequence[Rectangle] = (), kerb: tuple[float, float, float] | None = None
) -> Grid:
    """Occupied but for the free rectangles, less the taken ones and the disc `kerb` (x, y, radius); a metre around."""
    box = np.array(free)
    origin = box[:, :2].min(axis=0) - 1.0
    cols, rows = np.rint((box[:, 2:].max(axis=0) + 1.0 - origin) / RESOLUTION).astype(int)
    p = origin + (np.stack(np.meshgrid(np.arange(cols), np.arange(rows)), axis=2) + 0.5) * RESOLUTION

    def within(rectangles: Sequence[Rectangle]) -> Bools:
        inside = np.zeros((rows, cols), np.bool_)
        for west, south, east, north in rectangles:
            inside |= ((p >= [west, south]) & (p <= [east, north])).all(axis=2)
        return inside

    road = within(free) & ~within(taken)
    if kerb is not None:
        road &= np.hypot(p[..., 0] - kerb[0], p[..., 1] - kerb[1]) > kerb[2]
    return Grid(cells=np.where(road, 0, 100).astype(np.uint8), resolution=RESOLUTION, origin=origin)
