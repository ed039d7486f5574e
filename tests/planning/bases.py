"""Three bases, and a problem about each, for tests of local planning."""

from dataclasses import replace

import numpy as np

from outrider.data.driving import DriveLimits, LocalOutcome, Situation, Steering
from outrider.data.footprint import Footprint
from outrider.data.surroundings import DistanceField, Surroundings
from outrider.models.wheels import WheelKinematics
from outrider.planning.local.teb import Teb, TebSettings
from outrider.safety.clearance import around, body_of, clash
from outrider.safety.stopping import moved

DIFFERENTIAL = DriveLimits(
    steering=Steering.DIFFERENTIAL, forward=0.8, backward=0.3, turn=1.2, acceleration=0.6, turn_acceleration=1.5
)
MECANUM = DriveLimits(
    steering=Steering.HOLONOMIC, forward=0.8, backward=0.8, sideways=0.8, turn=1.5, acceleration=0.5,
    turn_acceleration=1.0, rims=WheelKinematics.rectangle(0.4, 0.3).inverse, rim_speed=0.8,
)  # fmt: skip
CAR = DriveLimits(
    steering=Steering.CAR, forward=1.0, backward=0.5, turn=1.0, acceleration=0.5, turn_acceleration=1.0, min_radius=1.0
)
BASES = {"differential": DIFFERENTIAL, "mecanum": MECANUM, "car": CAR}
BOX = Footprint.rectangle(0.6, 0.45)


def teb(limits: DriveLimits, **settings) -> Teb:
    return Teb(limits=limits, footprint=BOX, settings=TebSettings(**({"gap": 0.2} | settings)))


def situation(goal, **more) -> Situation:
    pose = np.array(more.pop("pose", (0.0, 0.0, 0.0)))
    return Situation(time=0.0, pose=pose, goal=np.array(goal, float), **more)


def scattered(seed: int, count: int) -> np.ndarray:
    """(count, 5) discs between x = 0.9 and 7.1, a forest to drive through."""
    rng, discs = np.random.default_rng(seed), np.zeros((count, 5))
    discs[:, 0], discs[:, 1] = rng.uniform(0.9, 7.1, count), rng.uniform(-4.0, 4.0, count)
    discs[:, 2] = rng.uniform(0.05, 0.25, count)
    return discs


def drive(planner, now: Situation, seconds: float, jitter: float = 0.0, seed: int = 0):
    """Answers and poses of a robot that does exactly as told, and the least room that it ever had."""
    rng, body, period = np.random.default_rng(seed), body_of(planner.footprint), planner.settings.period
    true, plans, poses, least = now.surroundings.discs.copy(), [], [now.pose], np.inf
    last = None
    while now.time < seconds:
        last = planner.plan(now, last)
        plans.append(last)
        if last.outcome is LocalOutcome.ARRIVED:
            break
        t = np.linspace(0.0, period, 5)[1:]
        way = moved(now.pose, last.twist, t)
        for k, pose in enumerate(way):
            there = true.copy()
            there[:, :2] += there[:, 3:] * t[k]
            world = around(Surroundings(discs=there, field=now.surroundings.field), 1.0)
            least = min(least, clash(np.array([[*pose, 0.0]]), body, world).room)
        true[:, :2] += true[:, 3:] * period
        seen = true.copy()
        seen[:, :2] += jitter * rng.standard_normal((len(seen), 2))
        around_now = replace(now.surroundings, discs=seen)
        now = replace(now, time=now.time + period, pose=way[-1], twist=last.twist, surroundings=around_now)
        poses.append(way[-1])
    return plans, np.array(poses), least


def walls(*boxes, side: float = 12.0, resolution: float = 0.05) -> DistanceField:
    """A map around the origin with boxes (west, south, east, north) in it."""
    from outrider.data.grid import LETHAL, Costmap

    cells = np.zeros((int(side / resolution),) * 2, np.uint8)
    origin = np.array([-0.5 * side, -0.5 * side])
    for west, south, east, north in boxes:
        r = ((np.array([west, south, east, north]) - origin[[0, 1, 0, 1]]) / resolution).round().astype(int)
        cells[r[1] : r[3], r[0] : r[2]] = LETHAL
    return DistanceField.of(Costmap(cells=cells, resolution=resolution, origin=origin))
