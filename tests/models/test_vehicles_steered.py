"""Cars: circles, steering limits, the four wheels of a turn, crab motion."""

from math import tan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.errors import ConfigError
from outrider.models.vehicles import LEVEL, ROW_P, ROW_SIZE, ROW_V, ROW_W, Drive, Steered, Steering, axle_angle
from outrider.typing import Floats

CAR = Steered(wheel_base=0.8, track=0.6, rear=-0.3)
BOTH = Steered(wheel_base=0.8, track=0.6, rear=-0.4, both_axles=True)
TURNS = slice(ROW_SIZE, ROW_SIZE + 4)


def go(car: Steered, u: Floats, seconds: float = 0.0, ground: Floats = LEVEL) -> Floats:
    commands = np.tile(np.array(u), (round(seconds / car.step_s), 1)) if seconds else u
    out = np.empty((len(commands), ROW_SIZE + len(car.actuators)))
    car.run(car.start(np.zeros(3), 0.0), commands, np.zeros((len(commands), 3)), ground, out)
    return out


@pytest.mark.parametrize("angle", [0.1, 0.35, -0.5])
@pytest.mark.parametrize("v", [0.8, -0.6])
def test_turning_radius_is_wheel_base_over_tangent(angle, v):
    """The rear axle's middle runs on a circle of radius L / tan(delta)."""
    out = go(CAR, np.array([v, 0.0, v * tan(angle) / 0.8]), 25.0)[2000:]
    yaw = 2.0 * np.arctan2(out[:, 5], out[:, 6])
    rear = out[:, :2] - 0.3 * np.column_stack([np.cos(yaw), np.sin(yaw)])
    centre = np.linalg.lstsq(np.c_[2 * rear, np.ones(len(rear))], (rear**2).sum(axis=1))[0][:2]
    np.testing.assert_allclose(np.linalg.norm(rear - centre, axis=1), abs(0.8 / tan(angle)), rtol=1e-6)
    left, right = out[-1, ROW_SIZE + 4 :]
    assert 1 / tan(right) - 1 / tan(left) == pytest.approx(0.6 / 0.8)  # cot outer - cot inner = track / base
    assert axle_angle(np.array([left, 0.0]), np.array([right, 0.0])) == pytest.approx([angle, 0.0])


@pytest.mark.parametrize("car", [CAR, BOTH], ids=["front", "both"])
@settings(max_examples=15)
@given(u=st.tuples(st.floats(-1.0, 1.0), st.floats(-0.3, 0.3), st.floats(-1.0, 1.0)))
def test_no_wheel_slides_sideways(car, u):
    """At every wheel the ground's velocity is the rim speed along the wheel, whatever the command."""
    for row in go(car, np.array(u), 1.5)[::20]:
        yaw = 2.0 * np.arctan2(row[5], row[6])
        c, s = np.cos(yaw), np.sin(yaw)
        ux, uy = c * row[ROW_V] + s * row[ROW_V + 1], c * row[ROW_V + 1] - s * row[ROW_V]
        angles = np.append(row[ROW_SIZE + 4 :], [0.0, 0.0])[:4]
        for i, (x, y) in enumerate((x, y) for x in (car.rear + 0.8, car.rear) for y in (0.3, -0.3)):
            at = np.array([ux - row[ROW_W + 2] * y, uy + row[ROW_W + 2] * x])
            rolled = row[ROW_SIZE + i] * np.array([np.cos(angles[i]), np.sin(angles[i])])
            np.testing.assert_allclose(at, rolled, atol=1e-12)


def test_four_wheel_steering_reaches_any_twist_within_its_limits():
    for u in ([0.5, 0.2, 0.0], [0.5, 0.0, 0.4], [0.5, -0.1, 0.2]):
        row = go(BOTH, np.array(u), 6.0)[-1]
        yaw = 2.0 * np.arctan2(row[5], row[6])
        c, s = np.cos(yaw), np.sin(yaw)
        reached = [c * row[ROW_V] + s * row[ROW_V + 1], c * row[ROW_V + 1] - s * row[ROW_V], row[ROW_W + 2]]
        np.testing.assert_allclose(reached, u, atol=1e-7)


@pytest.mark.parametrize("car", [CAR, BOTH], ids=["front", "both"])
@settings(max_examples=15)
@given(seed=st.integers(0, 999))
def test_limits_of_steering_and_motor_hold(car, seed):
    rng = np.random.default_rng(seed)
    out = go(car, np.repeat(rng.normal(0.0, 3.0, (8, 3)), 60, axis=0))
    wheels = np.vstack([np.zeros(len(car.actuators)), out[:, ROW_SIZE:]])
    for k in (4, 6)[: 1 + car.both_axles]:
        angle = axle_angle(wheels[:, k], wheels[:, k + 1])
        assert 0.1 < np.abs(angle).max() <= car.steering.limit + 1e-9
        assert np.abs(np.diff(angle)).max() <= car.steering.rate * car.step_s + 1e-9
    yaw = np.unwrap(2.0 * np.arctan2(out[:, 5], out[:, 6]))
    forward = np.cos(yaw) * out[:, ROW_V] + np.sin(yaw) * out[:, ROW_V + 1]
    assert np.abs(forward).max() <= car.drive.top_speed + 1e-9
    assert np.abs(np.diff(forward)).max() <= car.drive.acceleration * car.step_s + 1e-9


def test_without_speed_it_neither_turns_nor_steers():
    assert not go(CAR, np.array([0.0, 0.0, 1.0]), 1.0)[:, ROW_SIZE:].any()


def test_a_stopped_car_keeps_its_wheels_and_its_place():
    u = np.vstack([np.tile([0.6, 0.0, 0.3], (400, 1)), np.zeros((1500, 3))])
    out = go(CAR, u)
    assert (out[-1] == out[-300]).all()
    assert out[-1, ROW_SIZE + 4] > 0.2
    assert not out[-1, TURNS].any()
    assert np.linalg.norm(out[-1, ROW_P : ROW_P + 2]) > 0.5


def test_impossible_geometry_is_refused():
    for wrong in ({"steering": Steering(limit=1.2)}, {"track": 3.0}, {"wheel_base": -1.0}):
        with pytest.raises(ConfigError):
            Steered(**wrong)
    for make in (lambda: Steering(rate=0.0), lambda: Drive(gear=0.0), lambda: Steered(steering=Steering(lag_s=1e-3))):
        with pytest.raises(ConfigError):
            make()
