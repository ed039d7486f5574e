"""Random ways through a building, driven: a robot in the simulator, on its own estimate, from a place to a goal."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt, label

from outrider.data.grid import UNKNOWN, Grid
from outrider.models.vehicles import Differential
from outrider.scenarios.driving import DrivePart, ground_robot
from outrider.sim.engine import simulate
from outrider.sim.sensors import BodyTwist, Gnss, Imu, Lidar
from outrider.sim.team import Robot
from outrider.sim.world import World
from outrider.team.errand import Errand, Visit
from outrider.typing import Bools, Floats, Ints

BASE = Differential(track=0.3, radius=0.22, height=0.4, latency_s=0.05)
DRIVE = DrivePart(
    forward=1.0, backward=0.3, turn=1.5, acceleration=0.8, turn_acceleration=2.5,
    driver={"window": 8.0, "patience_s": 10.0}, local={"type": "teb", "reach": 4.0},
)  # fmt: skip
SENSORS = (
    Imu(rate_hz=25),
    BodyTwist(name="wheels"),
    Gnss(name="total station", rate_hz=5, sigma=0.01, sigma_up=0.01),  # follows a prism on the robot
    Lidar(rate_hz=5, beams=180, max_range=8.0),
)
TO_SPARE = 0.1  # m beyond the robot's radius at the start and at the goal


@dataclass(frozen=True, slots=True)
class Drive:
    """How a drive ended: what the robot says; s; m of the truth to the goal, and of room to the nearest thing at the
    closest; m driven, and of the plan."""

    visit: Visit
    reason: str
    seconds: float
    error: float
    room: float
    driven: float


def standing(grid: Grid) -> Bools:
    """(rows, cols) where the robot stands with room to spare, on known ground."""
    taken = grid.occupied | (grid.cells == UNKNOWN)
    return distance_transform_edt(~taken) * grid.resolution > BASE.radius + TO_SPARE + grid.resolution


def rooms(grid: Grid) -> Ints:
    """(rows, cols) which part of the map a place is in, as far as the robot fits through; 0: it does not."""
    taken = grid.occupied | (grid.cells == UNKNOWN)
    return np.asarray(label(distance_transform_edt(~taken) * grid.resolution > BASE.radius + grid.resolution)[0])


def pairs(grid: Grid, n: int, seed: int) -> tuple[Floats, Bools]:
    """(n, 2, 2) m starts and goals drawn at random, and (n,) whether a way joins them."""
    cells = np.argwhere(standing(grid))
    chosen = np.random.default_rng(seed).choice(cells, (n, 2))
    part = rooms(grid)[chosen[..., 0], chosen[..., 1]]
    return grid.centre_of(chosen), part[:, 0] == part[:, 1]


def drive(grid: Grid, start: Floats, goal: Floats, seed: int, limit_s: float = 240.0) -> Drive:
    """From start to goal (2,), the heading at the start at random."""
    world = World(name="building", grid=grid, grid_height=1.5)
    heading = float(np.random.default_rng(seed).uniform(-np.pi, np.pi))
    put = (float(start[0]), float(start[1]), 0.0, heading)
    goals = np.array([[*goal, np.nan]])
    body = ground_robot(DRIVE, BASE, SENSORS, put, world, robot="robot", period_s=0.1, goals=goals)
    agent = Errand(body=body, goals=goals)
    run = simulate(world, [Robot(vehicle=BASE, agent=agent, sensors=SENSORS, start=put)], limit_s, seed)
    p, told = run.truth["robot"].p[:, :2], agent.outcomes[0]
    return Drive(
        visit=told.visit,
        reason=told.reason,
        seconds=(int(run.truth["robot"].t[-1]) - int(run.truth["robot"].t[0])) * 1e-9,
        error=float(np.hypot(*(p[-1] - goal))),
        room=float(run.monitor.clearances["robot"].distance),
        driven=float(np.hypot(*np.diff(p, axis=0).T).sum()),
    )
