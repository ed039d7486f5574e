"""A mecanum robot among people who look at nothing; what tests and evidence of driving share."""

from dataclasses import dataclass
from math import pi
from typing import final

import numpy as np

from outrider.data.driving import DriveLimits, Steering
from outrider.data.footprint import Footprint
from outrider.data.grid import Grid
from outrider.mapping.inflation import Inflation
from outrider.models.vehicles import Mecanum
from outrider.models.wheels import WheelKinematics, mecanum_rectangle
from outrider.planning.astar import AStar
from outrider.planning.local.teb import Teb
from outrider.planning.refine import Refined
from outrider.safety.stage import Reason
from outrider.scenarios.navigation import navigator
from outrider.sim.engine import simulate
from outrider.sim.places.crowd import crowd
from outrider.sim.sensors import BodyTwist, GnssReceiver, Imu, Lidar
from outrider.sim.team import Robot
from outrider.sim.truth import EPOCH
from outrider.sim.world import Mover, World
from outrider.team.driver import Driver
from outrider.team.errand import Errand, Visit
from outrider.team.ground import Ground
from outrider.team.reaction import Reaction

WHEELS = mecanum_rectangle(0.25, 0.2)
BODY = Footprint.circle(0.45)
START, GOAL, HALF = (0.0, 0.0, 0.0, pi / 2), (0.0, 18.0), 8.0
SENSORS = (
    Imu(rate_hz=25),
    BodyTwist(name="wheels", rolling=False),
    GnssReceiver(lever=(0.1, 0.0, 0.7), latency_s=0.1),
    Lidar(beams=360, max_range=15.0),
)
LIMITS = DriveLimits(
    steering=Steering.HOLONOMIC, forward=1.0, backward=0.5, sideways=0.7, turn=1.0, acceleration=0.8,
    deceleration=1.5,
    turn_acceleration=1.5, rims=WheelKinematics(WHEELS).inverse, rim_speed=1.5,
)  # fmt: skip
STILL = 0.02  # m/s, slower than this a robot stands
FREE_OF = 1.5  # times the time without people that a run may take


def street(movers: tuple[Mover, ...] = ()) -> World:
    """A road 16 m wide that runs north, walls on both sides."""
    side, length = 0.1, 24.0
    cells = np.zeros((round((length + 2.0) / side), round(2.0 * (HALF + 1.0) / side)), np.uint8)
    edge = round(1.0 / side)
    cells[:, :edge] = cells[:, -edge:] = 100
    cells[:edge] = cells[-edge:] = 100
    origin = np.array([-HALF - 1.0, -4.0])
    return World(name="street", grid=Grid(cells=cells, resolution=side, origin=origin), grid_height=1.2, movers=movers)


def body(world: World) -> Ground:
    assert world.grid is not None
    driver = Driver(
        ground=world.grid, footprint=BODY, planner=Refined(planner=AStar()), local=Teb(limits=LIMITS, footprint=BODY),
        inflation=Inflation(inscribed=BODY.inscribed, radius=1.2, factor=2.5),
    )  # fmt: skip
    own = navigator(SENSORS, START, EPOCH, world, flies=False)
    return Ground(navigator=own, driver=driver, reaction=Reaction(seconds=0.15))


@final
@dataclass(frozen=True)
class Trial:
    """How one run ended. contact : with whom, "" for nobody;  speed : m/s, of the robot then."""

    arrived: bool
    seconds: float
    contact: str
    speed: float
    room: float
    interventions: dict[Reason, tuple[int, int]]


def drive(movers: tuple[Mover, ...], seed: int, seconds: float = 90.0) -> Trial:
    world = street(movers)
    errand = Errand(body=body(world), goals=np.array([[*GOAL, np.nan]]), hold_s=0.1)
    vehicle = Mecanum(wheels=WHEELS, radius=0.45, height=0.6, latency_s=0.05)
    robot = Robot(vehicle=vehicle, agent=errand, sensors=SENSORS, start=START)
    run = simulate(world, [robot], seconds, seed)
    truth = run.truth["robot"]
    speed = float(np.hypot(*truth.v[-1, :2]))
    return Trial(
        arrived=errand.outcomes[0].visit is Visit.ARRIVED,
        seconds=(run.ended - EPOCH) * 1e-9,
        contact="" if run.hit is None else run.hit.what,
        speed=speed,
        room=run.monitor.clearances["robot"].distance,
        interventions=errand.body.interventions,
    )


def people(seed: int, count: int = 4) -> tuple[Mover, ...]:
    rng = np.random.default_rng(seed)
    return crowd(rng, [START[:2], GOAL], 0.9, count, side=6.0)
