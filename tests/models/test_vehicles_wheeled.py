"""Wheels: the geometry between rim speeds and motion, limits, slip, circles."""

from math import pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.errors import ConfigError
from outrider.models.sensors import WheelsMecanum
from outrider.models.vehicles import LEVEL, ROW_F, ROW_P, ROW_SIZE, ROW_V, ROW_W, Differential, Drive, Mecanum
from outrider.models.wheels import WheelKinematics, mecanum_rectangle, rpm
from outrider.typing import Floats

D = pi / 4
PATTERNS = {
    "x": mecanum_rectangle(0.45, 0.25),
    "o": tuple((x, y, -g) for x, y, g in mecanum_rectangle(0.45, 0.25)[:2] + mecanum_rectangle(0.2, 0.35)[2:]),
    "eight, mirrored": tuple(
        (x, y, g * np.sign(x * y)) for x in (0.45, 0.15, -0.15, -0.45) for y in (0.25, -0.25) for g in (-D,)
    ),
    "eight, alternating": tuple(
        (x, s * 0.25, -s * D * (-1) ** i) for i, x in enumerate((0.45, 0.15, -0.15, -0.45)) for s in (1, -1)
    ),
    "three omni": tuple((0.3 * np.cos(a), 0.3 * np.sin(a), g) for a, g in ((0.0, 1.2), (2.1, -0.5), (4.2, 0.4))),
}
patterns = pytest.mark.parametrize("wheels", PATTERNS.values(), ids=PATTERNS)
twists = st.tuples(*[st.floats(-3.0, 3.0)] * 3).map(np.array)


@patterns
@given(twist=twists)
def test_forward_undoes_inverse(wheels, twist):
    k = WheelKinematics(wheels)
    np.testing.assert_allclose(k.twist(k.rims(twist)), twist, atol=1e-12)
    np.testing.assert_allclose(k.slip(k.rims(twist)), 0.0, atol=1e-12)


@patterns
def test_rims_that_no_twist_explains_are_slip(wheels):
    k = WheelKinematics(wheels)
    rims = np.random.default_rng(0).normal(size=len(wheels))
    np.testing.assert_allclose(k.twist(k.slip(rims)), 0.0, atol=1e-12)
    if len(wheels) > 3:
        assert np.abs(k.slip(rims)).max() > 0.01


def test_signs_of_pure_motions_on_four_wheels():
    """Front left, front right, rear left, rear right; forward, left, counter-clockwise."""
    a, b = 0.45, 0.25
    rims = WheelKinematics.rectangle(a, b).rims(np.eye(3))
    np.testing.assert_allclose(rims[0], [1, 1, 1, 1], atol=1e-12)
    np.testing.assert_allclose(rims[1], [-1, 1, 1, -1], atol=1e-12)
    np.testing.assert_allclose(rims[2], np.array([-1, 1, -1, 1]) * (a + b), atol=1e-12)


def test_octahedron_of_speeds():
    """max |V| = |u_x| + |u_y| + (a + b) |w|: the sideways and turning shares add to the forward one."""
    k, rng = WheelKinematics.rectangle(0.45, 0.25), np.random.default_rng(1)
    u = rng.normal(size=(500, 3))
    np.testing.assert_allclose(np.abs(k.rims(u)).max(axis=1), np.abs(u) @ [1.0, 1.0, 0.7], rtol=1e-12)


def test_layouts_without_full_rank_are_refused_everywhere():
    parallel = tuple((x, y, D) for x, y, _ in PATTERNS["x"])
    for wheels in (parallel, PATTERNS["x"][:2], ()):
        for make in (WheelKinematics, lambda w: Mecanum(wheels=w), lambda w: WheelsMecanum(wheels=w)):
            with pytest.raises(ConfigError, match="apart"):
                make(wheels)
    with pytest.raises(ConfigError, match="cannot drive"):
        WheelKinematics(((0.0, 0.0, pi / 2), *PATTERNS["x"]))


def test_motor_speed():
    assert rpm(np.array(pi), radius=0.5, gear=20.0) == pytest.approx(20.0 * 60.0)
    drive = Drive(wheel_radius=0.1, gear=20.0, max_rpm=4000.0)
    assert rpm(np.array(drive.top_speed), 0.1, 20.0) == pytest.approx(4000.0)


def go(
    vehicle: Mecanum | Differential, u: tuple[float, float, float], seconds: float, ground: Floats = LEVEL
) -> Floats:
    n = round(seconds / vehicle.step_s)
    out = np.empty((n, ROW_SIZE + len(vehicle.actuators)))
    vehicle.run(vehicle.start(np.zeros(3), 0.0), np.tile(np.array(u), (n, 1)), np.zeros((n, 3)), ground, out)
    return out


@patterns
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_pure_commands_move_purely(wheels, axis, sign):
    u = [0.0, 0.0, 0.0]
    u[axis] = 0.4 * sign
    out = go(Mecanum(wheels=wheels), tuple(u), 3.0)
    reached = np.array([out[-1, ROW_V], out[-1, ROW_V + 1], out[-1, ROW_W + 2]])
    np.testing.assert_allclose(reached, u, atol=1e-9)


def test_the_answer_is_first_order_in_the_lag():
    drive = Drive(lag_s=0.2, acceleration=100.0)
    out = go(Mecanum(drive=drive), (0.5, 0.0, 0.0), 1.0)
    t = 0.005 * (np.arange(1, 201) - 0.5)  # a jump of the command takes a step to act
    np.testing.assert_allclose(out[:, ROW_V], 0.5 * (1.0 - np.exp(-t / 0.2)), atol=5e-5)
    np.testing.assert_allclose(out[:, ROW_P], 0.5 * (t - 0.2 * (1.0 - np.exp(-t / 0.2))), atol=5e-5)
    np.testing.assert_allclose(out[:, ROW_F], 0.5 / 0.2 * np.exp(-t / 0.2), atol=5e-4)


@settings(max_examples=40)
@given(u=st.tuples(*[st.floats(-20.0, 20.0)] * 3), which=st.sampled_from(["x", "eight, alternating", "differential"]))
def test_motors_are_never_asked_for_more_than_they_give(u, which):
    drive = Drive(max_rpm=3000.0, acceleration=1.5)
    vehicle = Differential(drive=drive) if which == "differential" else Mecanum(wheels=PATTERNS[which], drive=drive)
    out = go(vehicle, u, 3.0)
    rims = np.vstack([np.zeros(len(vehicle.actuators)), out[:, ROW_SIZE:]])
    assert np.abs(rpm(rims, drive.wheel_radius, drive.gear)).max() <= 3000.0 * (1 + 1e-12)
    assert np.abs(np.diff(rims, axis=0)).max() <= 1.5 * vehicle.step_s * (1 + 1e-9)
    if isinstance(vehicle, Mecanum):
        np.testing.assert_allclose(vehicle.kinematics.slip(rims), 0.0, atol=1e-12)  # wheels never fight


def test_too_fast_a_command_keeps_its_direction():
    out = go(Mecanum(), (8.0, 4.0, 0.0), 5.0)
    assert out[-1, ROW_V + 1] / out[-1, ROW_V] == pytest.approx(0.5)
    assert np.abs(out[-1, ROW_SIZE:]).max() == pytest.approx(Drive().top_speed)


@pytest.mark.parametrize("axle", [0.0, 0.3])
def test_a_differential_base_turns_about_a_point_on_its_axle(axle):
    vehicle = Differential(axle=axle)
    out = go(vehicle, (0.8, 0.0, 0.5), 30.0)
    late = out[2000:, ROW_P : ROW_P + 2]
    centre = np.linalg.lstsq(np.c_[2 * late, np.ones(len(late))], (late**2).sum(axis=1))[0][:2]
    assert np.linalg.norm(late[0] - centre) == pytest.approx(np.hypot(0.8 / 0.5, axle), rel=1e-6)
    left, right = out[-1, ROW_SIZE:]
    assert (right - left) / vehicle.track == pytest.approx(0.5)


def test_a_differential_base_does_not_slide_sideways():
    np.testing.assert_array_equal(go(Differential(), (0.5, 0.3, 0.0), 2.0), go(Differential(), (0.5, 0.0, 0.0), 2.0))


@settings(max_examples=10)
@given(a=st.floats(0.0, 0.9), b=st.floats(0.0, 0.9))
def test_slip_slows_by_what_is_stated(a, b):
    ground = np.array([[0.0] * 5, [0.0, 0.0, 100.0, a, b]])
    u = (0.6, 0.3, 0.4)
    out = go(Mecanum(), u, 4.0, ground)[-1]
    c, s = np.cos(2 * np.arctan2(out[5], out[6])), np.sin(2 * np.arctan2(out[5], out[6]))
    body = [c * out[ROW_V] + s * out[ROW_V + 1], c * out[ROW_V + 1] - s * out[ROW_V], out[ROW_W + 2]]
    np.testing.assert_allclose(body, [(1 - a) * 0.6, (1 - b) * 0.3, (1 - a) * 0.4], atol=1e-6)
    np.testing.assert_allclose(Mecanum().kinematics.twist(out[ROW_SIZE:]), u, atol=1e-6)  # encoders do not see it
    out = go(Differential(), u, 4.0, ground)[-1]
    assert np.hypot(out[ROW_V], out[ROW_V + 1]) == pytest.approx((1 - a) * 0.6, abs=1e-6)
    assert out[ROW_W + 2] == pytest.approx((1 - a) * (1 - b) * 0.4, abs=1e-6)


def test_slip_ends_where_the_patch_ends_and_later_patches_count():
    ground = np.array([[0.0, 0.0, 0.2, 0.0, 2.0], [2.0, 0.0, 1.0, 0.5, 0.0], [2.0, 0.0, 0.3, 0.0, 0.0]])
    out = go(Differential(grip_s=0.02), (1.0, 0.0, 0.0), 8.0, ground)

    def speed_at(x: float) -> float:
        return float(np.interp(x, out[:, ROW_P], out[:, ROW_V]))

    assert speed_at(1.6) == pytest.approx(0.5, abs=1e-3)
    assert speed_at(2.25) == pytest.approx(1.0, abs=1e-3)
    assert speed_at(3.6) == pytest.approx(0.8, abs=1e-3)
    assert np.isfinite(out).all()
    assert np.abs(np.diff(out[:, ROW_V])).max() < 0.5 * 0.005 / 0.02 + 0.02  # no velocity jumps at an edge
