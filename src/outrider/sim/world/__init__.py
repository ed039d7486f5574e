"""The world: what stands and moves in it, its ground and its wind, and what can be asked about it."""

from outrider.sim.world.ground import Ground, Patch
from outrider.sim.world.parts import Body, Fence, Mover, Solids, Wall
from outrider.sim.world.wind import Wind
from outrider.sim.world.world import World

__all__ = ["Body", "Fence", "Ground", "Mover", "Patch", "Solids", "Wall", "Wind", "World"]
