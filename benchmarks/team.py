"""A whole team: coop2024's two robots around the airliner, every sensor, 180 s at 100 Hz, watched for collisions."""

from functools import cache

import numpy as np

from benchmarks.table import Row, Side
from outrider.scenarios.build import Cast, build
from outrider.scenarios.files import load_scenario


@cache
def tour() -> Cast:
    """The scenario, its tracks already laid."""
    return build(*load_scenario("airliner-tour"))


def ours(runs):
    """`Cast.run`: slow errors, all records, the monitor's looks, and the hash of the log."""
    for _ in range(runs):
        done = tour().run()
    return np.array([len(done.log)])


def rows():
    """Rows of this module."""
    name = "simulation of two robots with 14 sensors, 180 s at 100 Hz (per run)"
    return [Row(name, Side("simulate, open loop", ours, 3), target=80_000.0)]
