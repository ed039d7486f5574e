"""Multirotors: response, limits, wind, tilt, standing on the ground."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.core.rotations import quats_to_matrices
from outrider.errors import ConfigError
from outrider.models.motion import follower
from outrider.models.vehicles import LEVEL, ROW_F, ROW_P, ROW_Q, ROW_V, ROW_W, Multirotor
from outrider.typing import Floats

UP = np.array([0.0, 0.0, 1.0])


def fly(
    drone: Multirotor,
    u: Floats,
    start: tuple[float, float, float] = (0.0, 0.0, 50.0),
    wind: Floats | None = None,
    ground: Floats = LEVEL,
) -> Floats:
    air = np.zeros((len(u), 3)) if wind is None else np.tile(wind, (len(u), 1))
    out = np.empty((len(u), 16))
    drone.run(drone.start(np.array(start), 0.3), u, air, ground, out)
    return out


def held(u: tuple[float, ...], seconds: float) -> Floats:
    return np.tile(np.array(u), (round(seconds / 0.005), 1))


@pytest.mark.parametrize("tau", [0.3, 1.0])
def test_velocity_answers_in_first_order_like_the_estimators_model(tau):
    """But for half a step, since a jump of the command takes a step to act."""
    out = fly(Multirotor(tau_s=tau), held((1.0, -0.5, 0.4, 0.0), 3.0))
    t = 0.005 * (np.arange(1, len(out) + 1)[:, None] - 0.5)
    x, F, Q = np.zeros(6), np.zeros((6, 6)), np.zeros((6, 6))
    u, rows = np.array([1.0, -0.5, 0.4]), np.empty((len(t), 6))
    for k in range(len(t)):
        follower.propagate(x, 0.005 if k else 0.0025, u, np.array([tau, 0.0]), F, Q)
        rows[k] = x
    np.testing.assert_allclose(out[:, ROW_V : ROW_V + 3], rows[:, 3:], atol=5e-5)
    np.testing.assert_allclose(out[:, :3] - [0, 0, 50.0], rows[:, :3], atol=5e-5)
    np.testing.assert_allclose(rows[:, 3:], u * (1.0 - np.exp(-t / tau)), atol=1e-12)


@settings(max_examples=30)
@given(u=st.tuples(*[st.floats(-40.0, 40.0)] * 3, st.floats(-9.0, 9.0)), turn=st.booleans())
def test_limits_hold(u, turn):
    drone = Multirotor(sink=1.0)
    commands = np.vstack([held(u, 2.0), held(tuple(-a for a in u), 2.0)]) if turn else held(u, 3.0)
    out = fly(drone, commands, (0.0, 0.0, 500.0))
    v = np.vstack([np.zeros(3), out[:, ROW_V : ROW_V + 3]])
    a = np.diff(v, axis=0) / drone.step_s
    assert np.hypot(v[:, 0], v[:, 1]).max() <= drone.speed + 1e-9
    assert v[:, 2].max() <= drone.climb + 1e-9
    assert v[:, 2].min() >= -drone.sink - 1e-9
    assert np.hypot(a[:, 0], a[:, 1]).max() <= drone.acceleration + 1e-9
    assert np.abs(a[:, 2]).max() <= drone.vertical_acceleration + 1e-9
    assert np.abs(out[:, ROW_W + 2]).max() <= drone.yaw_rate + 1e-9
    assert np.linalg.norm(out[:, ROW_W : ROW_W + 2], axis=1).max() <= drone.tilt_rate + drone.yaw_rate + 1e-9


def test_body_z_follows_the_thrust():
    """In a long steady acceleration the accelerometer feels nothing sideways but the drag."""
    drone = Multirotor(speed=60.0, acceleration=3.0, drag=0.0)
    out = fly(drone, held((60.0, 0.0, 0.0, 0.0), 4.0))
    np.testing.assert_allclose(out[-1, ROW_F : ROW_F + 2], 0.0, atol=1e-6)
    assert out[-1, ROW_F + 2] == pytest.approx(np.hypot(3.0, drone.gravity))
    R = quats_to_matrices(out[-1, ROW_Q : ROW_Q + 4])
    np.testing.assert_allclose(R @ UP, np.array([3.0, 0.0, drone.gravity]) / np.hypot(3.0, drone.gravity), atol=1e-6)


def test_wind_pushes_and_leans_against_itself():
    drone = Multirotor(tau_s=0.5, drag=0.1)
    out = fly(drone, held((0.0, 0.0, 0.0, 0.0), 20.0), wind=np.array([8.0, 0.0, 0.0]))[-1]
    assert out[ROW_V] == pytest.approx(0.5 * 0.1 * 8.0)
    lean = quats_to_matrices(out[ROW_Q : ROW_Q + 4]) @ UP
    assert lean[0] == pytest.approx(-0.1 * (8.0 - 0.4) / drone.gravity, rel=1e-2)  # into the wind
    out = fly(drone, held((3.0, 0.0, 0.0, 0.0), 20.0))[-1]
    assert out[ROW_V] == pytest.approx(3.0)  # still air costs tilt, not speed
    assert (quats_to_matrices(out[ROW_Q : ROW_Q + 4]) @ UP)[0] == pytest.approx(0.3 / drone.gravity, rel=1e-2)


def test_yaw_rate_is_about_the_vertical():
    out = fly(Multirotor(), held((0.0, 0.0, 0.0, 0.5), 4.0))
    assert out[-1, ROW_W + 2] == pytest.approx(0.5, abs=1e-6)
    yaw = 2 * np.arctan2(out[-1, ROW_Q + 2], out[-1, ROW_Q + 3])
    assert yaw == pytest.approx(0.3 + 0.5 * (4.0 - 0.2), abs=2e-3)


@pytest.mark.parametrize("slope", [(0.0, 0.0), (0.1, -0.05)])
def test_it_takes_off_lands_and_takes_off_again(slope):
    ground = np.array([[*slope, 0.0, 0.0, 0.0]])
    up, down, stay = held((0.3, 0.0, 1.0, 0.0), 5.0), held((0.2, 0.1, -0.8, 0.2), 12.0), held((0.0,) * 4, 1.0)
    out = fly(Multirotor(), np.vstack([stay, up, down, up]), (4.0, 1.0, 0.0), ground=ground)
    above = out[:, 2] - out[:, :2] @ slope
    n = len(stay)
    assert (out[:n] == out[0]).all()
    landed = n + len(up) + len(down) - 1
    assert above[n + len(up) - 1] > 3.0
    assert abs(above[landed]) < 1e-12
    assert not out[landed, ROW_V:ROW_F].any()
    assert (out[landed] == out[landed - 100]).all()
    np.testing.assert_allclose(np.linalg.norm(out[landed, ROW_F:]), Multirotor().gravity, rtol=1e-12)
    assert above.min() > -0.05
    assert np.abs(out[:, ROW_F:]).max() < 100.0
    assert above[-1] > 3.0


def test_wind_does_not_move_what_stands():
    out = fly(Multirotor(), held((0.0, 0.0, -1.0, 0.5), 2.0), (0.0, 0.0, 0.0), wind=np.array([15.0, 3.0, 0.0]))
    assert (out == out[0]).all()
    assert not out[0, ROW_P : ROW_P + 3].any()


def test_launch_leaves_with_what_the_carrier_had():
    drone, out = Multirotor(drag=0.0), np.empty((1, 16))
    q = np.array([0.0, 0.0, np.sin(0.2), np.cos(0.2)])
    x = drone.launch(np.array([1.0, 2.0, 0.0]), q, np.array([2.0, 0.0, 0.0]))
    drone.run(x, np.array([[2.0, 0.0, 1.0, 0.0]]), np.zeros((1, 3)), LEVEL, out)
    np.testing.assert_allclose(out[0, :2], [1.0 + 2.0 * drone.step_s, 2.0])
    assert out[0, 2] > 0.0


def test_thrust_must_stay_upright():
    with pytest.raises(ConfigError, match="thrust"):
        Multirotor(vertical_acceleration=9.9)
