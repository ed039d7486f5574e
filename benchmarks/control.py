"""The whole control cycle of a ground robot among people, on one core: what arrived since the last one (a scan of 360
beams, GNSS, wheels, IMU) in, wheel speeds out. Fusion, costmap, tracks, check of the path, elastic band with the ways
around things, giving way, safety stage and inverse kinematics.

`python -m benchmarks.control` prints the quantiles of single cycles, which a mean hides.
"""

import gc
from functools import cache
from math import pi
from time import process_time

import numpy as np

from benchmarks.table import Row, Side
from outrider.data.agents import Action
from outrider.data.driving import DriveLimits, Steering
from outrider.data.footprint import Footprint
from outrider.data.grid import Grid
from outrider.mapping.inflation import Inflation
from outrider.models.vehicles import Mecanum
from outrider.models.wheels import WheelKinematics, mecanum_rectangle
from outrider.planning.astar import AStar
from outrider.planning.local.teb import Teb
from outrider.planning.refine import Refined
from outrider.scenarios.navigation import navigator
from outrider.sim.engine import simulate
from outrider.sim.places.crowd import crowd
from outrider.sim.sensors import BodyTwist, GnssReceiver, Imu, Lidar
from outrider.sim.team import Robot
from outrider.sim.truth import EPOCH
from outrider.sim.world import World
from outrider.team.driver import Driver
from outrider.team.ground import Ground
from outrider.team.reaction import Reaction

WHEELS = WheelKinematics(mecanum_rectangle(0.25, 0.2))
START, GOAL = (0.0, 0.0, 0.0, pi / 2), np.array([0.0, 18.0, np.nan])
SENSORS = (
    Imu(rate_hz=25),
    BodyTwist(name="wheels", rolling=False),
    GnssReceiver(lever=(0.1, 0.0, 0.7), latency_s=0.1),
    Lidar(beams=360, max_range=15.0),
)
TARGET = 10_000.0  # us, of the slowest in a hundred


def yard() -> World:
    """16 m wide, walls around it, four people."""
    cells = np.zeros((260, 180), np.uint8)
    cells[:, :10] = cells[:, -10:] = cells[:10] = cells[-10:] = 100
    grid = Grid(cells=cells, resolution=0.1, origin=np.array([-9.0, -4.0]))
    people = crowd(np.random.default_rng(4), [START[:2], GOAL[:2]], 0.9, 4, side=6.0)
    return World(name="yard", grid=grid, grid_height=1.2, movers=people)


def robot() -> Ground:
    """A mecanum base with everything on."""
    body = Footprint.circle(0.45)
    limits = DriveLimits(
        steering=Steering.HOLONOMIC, forward=1.0, backward=0.5, sideways=0.7, turn=1.0, acceleration=0.8,
        deceleration=1.5, turn_acceleration=1.5, rims=WHEELS.inverse, rim_speed=1.5,
    )  # fmt: skip
    world = yard()
    driver = Driver(
        ground=world.grid, footprint=body, planner=Refined(planner=AStar()), local=Teb(limits=limits, footprint=body),
        inflation=Inflation(inscribed=body.inscribed, radius=1.2, factor=2.5),
    )  # fmt: skip
    driver.go(GOAL)
    own = navigator(SENSORS, START, EPOCH, world, flies=False)
    return Ground(navigator=own, driver=driver, reaction=Reaction(seconds=0.15))


class Kept:
    """An agent that keeps what reached it."""

    period_s = 0.1

    def __init__(self):
        self.body, self.inputs = robot(), []

    def act(self, t, records, inbox):
        self.inputs.append((t, records))
        return Action(command=self.body.drive(t, records, inbox)[1].twist)


@cache
def drive():
    """What reached a robot in every cycle of a drive of 20 s."""
    agent = Kept()
    vehicle = Mecanum(wheels=mecanum_rectangle(0.25, 0.2), radius=0.45, height=0.6, latency_s=0.05)
    simulate(yard(), [Robot(vehicle=vehicle, agent=agent, sensors=SENSORS, start=START)], 20.0, 1)
    return agent.inputs


def cycles(events):
    """So many cycles of the drive, from its start again when it is over; CPU seconds of each."""
    inputs, body, out = drive(), robot(), np.empty(events)
    for k in range(events):
        if k % len(inputs) == 0:
            body = robot()
        t, records = inputs[k % len(inputs)]
        began = process_time()
        _, answer = body.drive(t, records, [])
        WHEELS.inverse @ answer.twist
        out[k] = process_time() - began
    return out


def rows():
    """Rows of this module."""
    name = "full control cycle: scan of 360 beams, GNSS, wheels, IMU in, wheel speeds out, among four people"
    return [Row(name, Side("Ground.drive", cycles, len(drive())), target=TARGET)]


def main():
    """Quantiles over three drives."""
    cycles(len(drive()))
    gc.freeze()  # as a robot's program does once it is loaded: a full collection takes 0.1 s
    us = 1e6 * np.concatenate([cycles(len(drive())) for _ in range(3)])
    shares = {"median": 0.5, "p95": 0.95, "p99": 0.99, "worst": 1.0}
    told = ", ".join(f"{name} {np.quantile(us, share) / 1e3:.2f} ms" for name, share in shares.items())
    print(f"full control cycle, {us.size} cycles: {told}; target p99 {TARGET / 1e3:g} ms")


if __name__ == "__main__":
    main()
