"""A second physics: the same designs in MuJoCo, with contacts (`pip install outrider[physics]`).

Both classes are a `Vehicle`: whatever drives one of ours drives them, through the same engine, sensors and agents.
"""

from outrider.sim.physics.body import library
from outrider.sim.physics.flying import MujocoRotorcraft
from outrider.sim.physics.rolling import MujocoRover

__all__ = ["MujocoRotorcraft", "MujocoRover", "library"]
