"""One sensor, one piece of truth, one stream."""

from collections.abc import Mapping

from numpy.random import Generator

from outrider.data import Stream
from outrider.sim import Plain, Sensor, Truth
from outrider.sim.monitor import Hull
from outrider.sim.sensors import Setting, make_device
from outrider.sim.world import World

NOWHERE = World(name="nowhere")


def sampled(
    sensor: Sensor | Plain, truth: Truth, rng: Generator, world: World = NOWHERE, others: Mapping[str, Truth] = {}
) -> Stream:
    """What a sensor records along the whole of a truth. Other robots are as large as `Hull` has it."""
    hulls = {name: Hull() for name in others}
    setting = Setting(world=world, robot=truth.robot, start=truth.start, end=int(truth.t[-1]), seed=0, hulls=hulls)
    return make_device(sensor, setting, rng)(truth, others)
