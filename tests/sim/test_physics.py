"""Ours against a physics that we did not write: the same commands, the same motion."""

import numpy as np
import pytest

from outrider.core.rotations import quats_to_matrices, quats_to_rpy
from outrider.models.vehicles import LEVEL, ROW_SIZE, Differential, Mecanum, Rotorcraft, Vehicle
from outrider.sim.engine import simulate
from outrider.sim.team import Robot
from outrider.sim.world import World
from outrider.team import Schedule
from outrider.typing import Floats

pytest.importorskip("mujoco", reason="the extra `physics` is not installed")
from outrider.sim.physics import MujocoRotorcraft, MujocoRover

pytestmark = pytest.mark.compiled  # a contact simulation takes thousands of steps


def driven(vehicle: Vehicle, plan: list[tuple[float, tuple[float, ...]]], p: tuple[float, float, float]) -> Floats:
    """Rows of a vehicle under (seconds, command) one after the other."""
    u = np.vstack([np.tile(command, (round(seconds / vehicle.step_s), 1)) for seconds, command in plan])
    rows = np.zeros((len(u), ROW_SIZE + len(vehicle.actuators)))
    vehicle.run(vehicle.start(np.array(p), 0.3), u.astype(np.float64), np.zeros((len(u), 3)), LEVEL, rows)
    return rows


def gap(ours: Floats, theirs: Floats) -> tuple[float, float, float]:
    """Distance at the end [m], way [m], and difference in heading at the end [degrees]."""
    way = np.linalg.norm(np.diff(ours[:, :3], axis=0), axis=1).sum()
    turn = quats_to_rpy(ours[-1:, 3:7])[0, 2] - quats_to_rpy(theirs[-1:, 3:7])[0, 2]
    off = float(np.linalg.norm(ours[-1, :3] - theirs[-1, :3]))
    return off, float(way), abs(float(np.rad2deg((turn + np.pi) % (2 * np.pi) - np.pi)))


def agree(ours: Floats, theirs: Floats) -> None:
    """Within 5 % of the way and 3 degrees at the end."""
    off, way, turn = gap(ours, theirs)
    assert off <= max(0.05 * way, 0.01) and turn <= 3.0


GROUND = [
    [(4.0, (1.0, 0.0, 0.0))],
    [(4.0, (0.8, 0.0, 0.3))],
    [(4.0, (0.0, 0.0, 0.5))],
    [(2.0, (0.7, 0.0, 0.0)), (3.0, (-0.4, 0.0, 0.3))],
]
ASIDE = [[(4.0, (0.0, 0.6, 0.0))], [(3.0, (0.5, 0.4, 0.2))]]


@pytest.mark.parametrize("plan", GROUND, ids=str)
def test_a_differential_robot_on_contacts(plan) -> None:
    agree(driven(Differential(), plan, (0, 0, 0)), driven(MujocoRover(design=Differential()), plan, (0, 0, 0)))


@pytest.mark.parametrize("plan", GROUND[:2] + ASIDE, ids=str)
def test_a_mecanum_robot_on_rollers(plan) -> None:
    agree(driven(Mecanum(), plan, (0, 0, 0)), driven(MujocoRover(design=Mecanum()), plan, (0, 0, 0)))


@pytest.mark.parametrize("first", [(2.0, 0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.3), (1.0, 1.0, -0.3, 0.0)], ids=str)
def test_a_rotorcraft(first) -> None:
    plan = [(3.0, first), (3.0, (0.0, 1.0, 0.0, 0.0))]
    agree(driven(Rotorcraft(), plan, (0, 0, 9)), driven(MujocoRotorcraft(), plan, (0, 0, 9)))


def test_a_hexarotor_falls_with_its_rotors_off() -> None:
    design = Rotorcraft.hexarotor()
    free = MujocoRotorcraft(design=Rotorcraft(rotors=design.rotors, mass=3.0, inertia=design.inertia, direct=True))
    rows = driven(free, [(1.0, (0.0,) * 6)], (0.0, 0.0, 50.0))
    assert rows[-1, 2] < 50.0 - 3.5 and abs(rows[-1, 13:16]).max() < 2.0


def test_many_steps_and_single_steps_are_the_same() -> None:
    for vehicle in (MujocoRover(), MujocoRotorcraft()):
        u = np.tile([0.5] * len(vehicle.inputs), (50, 1))
        whole, single = (np.zeros((50, ROW_SIZE + len(vehicle.actuators))) for _ in range(2))
        x = vehicle.start(np.array([0.0, 0.0, 3.0]), 0.0)
        y = x.copy()
        vehicle.run(x, u, np.zeros((50, 3)), LEVEL, whole)
        for k in range(50):
            vehicle.run(y, u[k : k + 1], np.zeros((1, 3)), LEVEL, single[k : k + 1])
        np.testing.assert_allclose(single, whole, atol=1e-9)


def test_the_engine_drives_it_like_any_other() -> None:
    plan = Schedule(t_s=np.array([0.0, 2.0]), u=np.array([[0.8, 0.0, 0.0], [0.0, 0.0, 0.0]]))
    done = simulate(World(name="field"), [Robot(vehicle=MujocoRover(), agent=plan)], 3.0, 1)
    truth = done.truth["robot"]
    assert 1.3 < truth.p[-1, 0] < 1.7 and np.abs(quats_to_matrices(truth.q)[:, 2, 2] - 1.0).max() < 1e-3
