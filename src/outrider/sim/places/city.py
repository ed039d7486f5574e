"""A crossing of two streets with the buildings around it."""

import numpy as np

from outrider.core.solids import box
from outrider.sim.world import Fence, Mover, Solids, Wall, Wind, World
from outrider.typing import Floats

# Plan (corners, x and y in m) and height of every building. Streets run along both axes, pavements end at 9 m.
_BUILDINGS: dict[str, tuple[list[tuple[float, float]], float]] = {
    "bank": ([(9, 9), (33, 9), (33, 31), (9, 31)], 24.0),
    "arcade": ([(36, 9), (62, 9), (62, 25), (36, 25)], 12.0),
    "tower": ([(12, 36), (30, 36), (36, 46), (30, 58), (12, 58)], 40.0),
    "court": ([(-9, 9), (-9, 60), (-20, 60), (-20, 21), (-44, 21), (-44, 60), (-55, 60), (-55, 9)], 18.0),
    "school": ([(-9, -9), (-40, -9), (-40, -22), (-22, -22), (-22, -40), (-9, -40)], 10.0),
    "gym": ([(-47, -9), (-62, -9), (-62, -36), (-47, -36)], 8.0),
    "market": ([(9, -9), (9, -52), (26, -52), (26, -9)], 7.0),
    "flats": ([(32, -9), (60, -9), (60, -21), (32, -21)], 21.0),
}
_CARS = ((-40.0, 5.5), (-33.0, 5.5), (-20.0, -5.5), (16.0, 5.5), (23.0, 5.5), (44.0, -5.5))  # parked along the x axis


def city_block(*, wind: Wind = Wind()) -> World:
    """Buildings 7 to 40 m high, parked cars, a pedestrian who crosses the street, and a car that drives through it.

    The crossing is the origin. A moving car is the upright cylinder around it.
    """
    parked = [(f"parked car {k}", _car(x, y)) for k, (x, y) in enumerate(_CARS, start=1)]
    walk = [(-30.0, 7.5), (-12.0, 7.5), (-12.0, -7.5), (40.0, -7.5)]
    movers = (
        Mover.along("pedestrian", walk, 1.3),
        Mover.along("car", [(-64.0, -2.2), (64.0, -2.2)], 8.0, start_s=10.0, radius=2.3, height=1.5),
    )
    square = 66.0 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    return World(
        name="city block",
        walls=tuple(Wall(name=n, outline=np.array(plan, float), high=h) for n, (plan, h) in _BUILDINGS.items()),
        solids=Solids.of(*parked),
        movers=movers,
        wind=wind,
        fence=Fence(polygon=square, ceiling=60.0),
    )


def _car(x: float, y: float) -> Floats:
    return box((x, y, 0.75), (4.4, 1.8, 1.5))
