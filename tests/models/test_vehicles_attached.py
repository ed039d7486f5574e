"""Gimbals on a body, a drone on a pad."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.core.rotations import quats_log, quats_multiply, quats_to_matrices, rpy_to_quats
from outrider.errors import ConfigError
from outrider.models.vehicles import LEVEL, ROW_F, ROW_Q, ROW_SIZE, ROW_V, ROW_W, Mecanum, Multirotor, first_row
from outrider.models.vehicles.gimbal import Gimbal, point, stabilize
from outrider.models.vehicles.pad import Berth, Docking, Pad, carried
from outrider.typing import Floats

angle = st.floats(-0.6, 0.6)
AHEAD = np.array([1.0, 0.0, 0.0])


def slew(gimbal: Gimbal, u: Floats, x: Floats | None = None) -> Floats:
    out = np.empty((len(u), 3))
    gimbal.run(gimbal.start() if x is None else x, np.ascontiguousarray(u), out)
    return out


@given(yaw=st.floats(-3.0, 3.0), down=st.floats(-1.2, 1.5))
def test_point_looks_along_the_direction(yaw, down):
    direction = np.array([np.cos(yaw) * np.cos(down), np.sin(yaw) * np.cos(down), -np.sin(down)])
    angles = point(direction)
    np.testing.assert_allclose(angles, [yaw, 0.0, down], atol=1e-12)
    np.testing.assert_allclose(Gimbal().camera(angles) @ AHEAD, direction, atol=1e-12)


@given(roll=angle, pitch=angle, yaw=st.floats(-3.0, 3.0), heading=st.floats(-3.0, 3.0), down=st.floats(-0.3, 1.3))
def test_three_axes_hold_the_horizon(roll, pitch, yaw, heading, down):
    q = rpy_to_quats([roll, pitch, yaw])
    R = quats_to_matrices(q) @ Gimbal().camera(stabilize(q, heading, down))
    level = quats_to_matrices(rpy_to_quats([0.0, down, heading]))
    np.testing.assert_allclose(R, level, atol=1e-12)
    assert abs(R[2, 1]) < 1e-12  # the camera's y axis lies in the horizon


def test_looking_straight_down():
    np.testing.assert_allclose(point(np.array([0.0, 0.0, -1.0])), [0.0, 0.0, np.pi / 2])
    np.testing.assert_allclose(Gimbal().camera(np.array([0.0, 0.0, np.pi / 2])) @ AHEAD, [0.0, 0.0, -1.0], atol=1e-15)


def test_the_chain_of_frames_is_yaw_roll_pitch_mount():
    turn = quats_to_matrices(rpy_to_quats([0.1, 0.2, 0.3]))
    gimbal, a = Gimbal(mount=tuple(turn.ravel())), np.array([0.4, -0.3, 0.7])
    chain = [quats_to_matrices(rpy_to_quats(e)) for e in ([0, 0, 0.4], [-0.3, 0, 0], [0, 0.7, 0])]
    np.testing.assert_allclose(gimbal.camera(a), chain[0] @ chain[1] @ chain[2] @ turn, atol=1e-12)
    assert gimbal.camera(np.zeros((5, 3))).shape == (5, 3, 3)


@settings(max_examples=20)
@given(seed=st.integers(0, 999), cut=st.integers(1, 99))
def test_rate_and_range_hold_and_pieces_are_the_whole(seed, cut):
    gimbal = Gimbal.two_axes()
    u = np.repeat(np.random.default_rng(seed).normal(0.0, 2.0, (5, 3)), 20, axis=0)
    out = slew(gimbal, u)
    assert np.abs(np.diff(np.vstack([np.zeros(3), out]), axis=0)).max() <= gimbal.rate * gimbal.step_s * (1 + 1e-9)
    assert (out <= [gimbal.yaw[1], 0.0, gimbal.pitch[1]]).all()
    assert (out >= [gimbal.yaw[0], 0.0, gimbal.pitch[0]]).all()
    x = gimbal.start()
    assert np.vstack([slew(gimbal, u[:cut], x), slew(gimbal, u[cut:], x)]).tobytes() == out.tobytes()


def test_a_gimbal_arrives():
    np.testing.assert_allclose(slew(Gimbal(), np.tile([1.0, 0.2, 0.5], (600, 1)))[-1], [1.0, 0.2, 0.5], atol=1e-6)


def test_impossible_gimbals_are_refused():
    for wrong in ({"pitch": (0.2, 1.0)}, {"rate": 0.0}, {"mount": (1.0,) * 9}, {"lag_s": 0.001}):
        with pytest.raises(ConfigError):
            Gimbal(**wrong)


def turning_base(n: int = 800, step: float = 0.005) -> Floats:
    """Rows of a carrier that curves and sways, its first row at rest."""
    base = Mecanum(step_s=step)
    t = np.linspace(0.0, 4.0, n)
    u = np.column_stack([np.sin(t), 0.5 * np.sin(2 * t), 0.6 * np.sin(1.5 * t)])
    x, out = base.start(np.array([2.0, 1.0, 0.0]), 0.5), np.empty((n, ROW_SIZE + 4))
    first = first_row(base, x)
    base.run(x, u, np.zeros((n, 3)), LEVEL, out)
    return np.vstack([first, out])


def test_a_docked_drone_moves_and_feels_as_its_place_on_the_carrier():
    rows, berth = turning_base(), Berth(p=np.array([0.4, -0.3, 0.6]), q=rpy_to_quats([0.0, 0.0, 0.8]))
    drone = carried(rows, berth, 0.005, actuators=4)
    assert drone.shape == (800, ROW_SIZE + 4)
    v, a = np.gradient(drone[:, :3], 0.005, axis=0), np.gradient(drone[:, ROW_V : ROW_V + 3], 0.005, axis=0)
    np.testing.assert_allclose(drone[5:-5, ROW_V : ROW_V + 3], v[5:-5], atol=2e-4)
    R = quats_to_matrices(drone[:, ROW_Q : ROW_Q + 4])
    f = np.einsum("nji,nj->ni", R, a + np.array([0.0, 0.0, 9.80665]))
    np.testing.assert_allclose(drone[5:-5, ROW_F : ROW_F + 3], f[5:-5], atol=0.02)  # half a step late
    turned = (
        quats_log(quats_multiply(drone[:-1, ROW_Q : ROW_Q + 4] * [-1, -1, -1, 1], drone[1:, ROW_Q : ROW_Q + 4])) / 0.005
    )
    np.testing.assert_allclose(0.5 * (drone[1:, ROW_W : ROW_W + 3] + drone[:-1, ROW_W : ROW_W + 3]), turned, atol=1e-3)


def test_carried_in_pieces_is_the_whole():
    rows, berth = turning_base(), Pad().middle()
    whole = carried(rows, berth, 0.005)
    assert (
        np.vstack([carried(rows[:301], berth, 0.005), carried(rows[300:], berth, 0.005)]).tobytes() == whole.tobytes()
    )


def row(
    p: tuple[float, float, float],
    v: tuple[float, float, float] = (0.0, 0.0, 0.0),
    rpy: tuple[float, ...] = (0.0, 0.0, 0.0),
) -> Floats:
    out = np.zeros(ROW_SIZE)
    out[:3], out[ROW_V : ROW_V + 3], out[ROW_Q : ROW_Q + 4] = p, v, rpy_to_quats(list(rpy))
    return out


@pytest.mark.parametrize(
    ("p", "v", "rpy", "expected"),
    [
        ((0.1, 0.1, 0.59), (1.0, 0.0, -0.3), (0.0, 0.1, 2.0), Docking.DOCKED),
        ((0.1, 0.1, 0.61), (1.0, 0.0, -0.3), (0.0, 0.0, 0.0), Docking.AIRBORNE),  # not yet down
        ((0.1, 0.1, 0.59), (0.0, 0.0, -0.3), (0.0, 0.0, 0.0), Docking.TOO_HARD),  # the carrier moves
        ((0.1, 0.1, 0.59), (1.0, 0.0, -1.3), (0.0, 0.0, 0.0), Docking.TOO_HARD),
        ((0.1, 0.1, 0.59), (1.0, 0.0, -0.3), (0.5, 0.0, 0.0), Docking.TOO_TILTED),
        ((0.3, 0.1, 0.59), (1.0, 0.0, -0.3), (0.0, 0.0, 0.0), Docking.OFF_CENTRE),
        ((0.9, 0.1, 0.59), (1.0, 0.0, -0.3), (0.0, 0.0, 0.0), Docking.AIRBORNE),  # beside the carrier
    ],
)
def test_landings(p, v, rpy, expected):
    carrier, before = row((5.0, 0.0, 0.0), (1.0, 0.0, 0.0)), np.array([0.1, 0.1, 0.605])
    drone = row((5.0 + p[0], p[1], p[2]), v, rpy)
    status = Pad().after_flight(Docking.AIRBORNE, before, carrier, drone)
    assert status is expected
    assert status.crashed == (expected not in (Docking.DOCKED, Docking.AIRBORNE))
    assert Pad().after_flight(Docking.DOCKED, before, carrier, drone) is Docking.DOCKED


def test_take_off_landing_and_relaunch_from_a_moving_carrier():
    """The drone follows a base at 0.6 m/s, lands, rides, leaves again: every tick a pure transition."""
    base, drone, pad, ticks = Mecanum(), Multirotor(), Pad(), 700
    bx, u = base.start(np.zeros(3), 0.0), np.tile([0.6, 0.0, 0.0], (10, 1))
    brow, dx, drow = first_row(base, bx), np.zeros(0), np.zeros(0)
    status, berth, seen = Docking.DOCKED, pad.middle(), []
    drow = carried(np.vstack([brow, brow]), berth, 0.005)[-1]
    for tick in range(ticks):
        climb = 1.0 if tick in range(20, 60) or tick >= 600 else -0.4 if tick >= 60 else 0.0
        was, before = status, pad.berth(brow, drow).p
        bout = np.empty((10, ROW_SIZE + 4))
        base.run(bx, u, np.zeros((10, 3)), LEVEL, bout)
        status = pad.after_takeoff(status, climb)
        if status is Docking.AIRBORNE:
            if was is Docking.DOCKED:
                dx = drone.launch(drow[:3], drow[ROW_Q : ROW_Q + 4], drow[ROW_V : ROW_V + 3])
            over = pad.berth(brow, drow).p
            command = np.array([0.6 - 0.8 * over[0], -0.8 * over[1], climb, 0.0])
            dout = np.empty((10, ROW_SIZE))
            drone.run(dx, np.tile(command, (10, 1)), np.zeros((10, 3)), LEVEL, dout)
            drow = dout[-1]
            status = pad.after_flight(status, before, bout[-1], drow)
            if status is Docking.DOCKED:
                berth = pad.settled(pad.berth(bout[-1], drow))
        else:
            drow = carried(np.vstack([brow, bout]), berth, 0.005)[-1]
        brow = bout[-1]
        seen.append(status)
    changes = [a for a, b in zip(seen, [None, *seen], strict=False) if a is not b]
    assert changes == [Docking.DOCKED, Docking.AIRBORNE, Docking.DOCKED, Docking.AIRBORNE]
    assert drow[2] > 3.0
    assert brow[0] > 15.0
