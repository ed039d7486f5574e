"""A mecanum robot drives to a target of amr2025 on its own estimate, past what is on its map and what is not."""

from collections.abc import Sequence
from dataclasses import replace
from math import pi

import numpy as np
import pytest

from outrider.data import Stream
from outrider.data.agents import Action, Message
from outrider.data.driving import DriveLimits, Steering
from outrider.data.footprint import Footprint
from outrider.mapping.inflation import Inflation
from outrider.models.vehicles import Mecanum
from outrider.models.wheels import WheelKinematics, mecanum_rectangle
from outrider.planning.astar import AStar
from outrider.planning.local.teb import Teb
from outrider.planning.refine import Refined
from outrider.scenarios.navigation import navigator
from outrider.sim.engine import Ending, Simulation, simulate
from outrider.sim.places import BEND_TARGETS, amr_bend
from outrider.sim.sensors import BodyTwist, GnssReceiver, Imu, Lidar
from outrider.sim.team import Robot
from outrider.sim.truth import EPOCH
from outrider.sim.world import Wall, World
from outrider.team.driver import Drive, Driver
from outrider.team.ground import Ground
from outrider.typing import Floats

pytestmark = pytest.mark.compiled  # half a minute of driving
WHEELS = mecanum_rectangle(0.25, 0.2)
BODY = Footprint.rectangle(0.7, 0.55)
START = (0.0, 0.0, 0.0, pi / 2)
SENSORS = (
    Imu(rate_hz=25),
    BodyTwist(name="wheels", rolling=False),
    GnssReceiver(lever=(0.1, 0.0, 0.7), latency_s=0.1),
    Lidar(beams=180, max_range=12.0),
)


class Errand:
    """Goes to one place, and says how that ended."""

    period_s = 0.1

    def __init__(self, body: Ground, goal: Floats) -> None:
        self.body, self.goal = body, goal

    def act(self, t: int, records: Sequence[Stream], inbox: Sequence[Message]) -> Action:
        self.body.driver.go(self.goal)
        _, answer = self.body.drive(t, records, inbox)
        done = answer.state in (Drive.ARRIVED, Drive.UNREACHABLE)
        return Action(command=answer.twist, done=done, note=answer.state.name if done else "")


def driven(world: World, goal: tuple[float, float], seed: int = 1) -> Simulation:
    assert world.grid is not None
    limits = DriveLimits(
        steering=Steering.HOLONOMIC, forward=1.0, backward=0.4, sideways=0.5, turn=1.0, acceleration=0.6,
        turn_acceleration=1.2, rims=WheelKinematics(WHEELS).inverse, rim_speed=1.3,
    )  # fmt: skip
    driver = Driver(
        ground=world.grid, footprint=BODY, planner=Refined(planner=AStar()),
        local=Teb(limits=limits, footprint=BODY),
        inflation=Inflation(inscribed=BODY.inscribed, radius=1.2, factor=2.5),
    )  # fmt: skip
    body = Ground(navigator=navigator(SENSORS, START, EPOCH, world, flies=False), driver=driver)
    vehicle = Mecanum(wheels=WHEELS, radius=0.45, height=0.6, latency_s=0.05)
    robot = Robot(vehicle=vehicle, agent=Errand(body, np.array([*goal, np.nan])), sensors=SENSORS, start=START)
    return simulate(world, [robot], 120.0, seed)


def test_it_arrives_within_centimetres() -> None:
    run = driven(amr_bend(), BEND_TARGETS[0])
    end = run.truth["robot"].p[-1, :2]
    assert run.ending is Ending.GOAL and [n.text for n in run.notes] == ["ARRIVED"]
    assert np.hypot(*(end - BEND_TARGETS[0])) < 0.10
    way = np.hypot(*np.diff(run.truth["robot"].p[:, :2], axis=0).T).sum()
    assert 25.0 < way < 31.0  # the corner is 32.3 m from end to end, and may be cut
    assert run.monitor.clearances["robot"].distance > 0.05


def test_it_goes_round_what_is_on_no_map() -> None:
    crate = Wall(name="crate", outline=np.array([[-0.8, 7.0], [0.8, 7.0], [0.8, 8.0], [-0.8, 8.0]]), high=1.2)
    run = driven(replace(amr_bend(), walls=(crate,)), (0.0, 13.0))
    assert [n.text for n in run.notes] == ["ARRIVED"]
    assert np.hypot(*(run.truth["robot"].p[-1, :2] - [0.0, 13.0])) < 0.10
    assert np.abs(run.truth["robot"].p[:, 0]).max() > 1.2  # aside of it


def test_a_goal_in_a_wall_has_a_reason() -> None:
    run = driven(amr_bend(), (3.5, 5.0))
    assert [n.text for n in run.notes] == ["UNREACHABLE"] and run.ending is Ending.GOAL
    assert np.hypot(*run.truth["robot"].p[-1, :2]) < 0.3  # it stays where it is
