"""The forms that coop2024 prints wrongly stay wrong in the way they are: what they lack is pinned, so is what they do.

The pieces of the clean models that have their own published form are checked here too.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_motion import PARAMETERS, draw, seen
from test_sensors import CASES, WRONG, any_kinematics, differences, read, record

from outrider.models import kinematics as kin
from outrider.models import sensors as s
from outrider.models.motion import LAYOUTS, EulerBody, Motion, kinematic_view
from outrider.models.sensors import SPECS, Sensor
from outrider.models.sensors.as_printed import gyro_row
from outrider.typing import Floats

EULER = LAYOUTS[Motion.EULER]


def posed(yaw: float, pitch: float, roll: float, rates: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Floats:
    """A state of `EulerBody` with this attitude."""
    x = EULER.zeros()
    x[EULER.state("yaw")], x[EULER.state("pitch")], x[EULER.state("roll")] = yaw, pitch, roll
    x[EULER.state("euler_rate")] = rates
    return x


@WRONG
def test_the_law_of_derivatives_catches_every_printed_form(sensor: Sensor, rng: np.random.Generator) -> None:
    k, theta = any_kinematics(rng), CASES[sensor](rng).theta()
    k[kin.K_R : kin.K_R + 9] = Rotation.from_euler("ZYX", [0.4, 0.3, -0.2]).as_matrix().ravel()
    if sensor is Sensor.PRINTED_ODOMETRY:  # its D is that of its own h; what is wrong is h
        model = s.Twist().theta()
        right = read(Sensor.TWIST, k, np.zeros(8), model)[0]
        assert np.abs(right - read(sensor, k, np.zeros(8), theta)[0])[:3].max() > 0.05
        return
    z = record(sensor, k, theta)[1]
    assert np.abs(read(sensor, k, z, theta)[1] - differences(sensor, k, z, theta)).max() > 0.01


@WRONG
def test_printed_rows_have_no_column_of_attitude(sensor: Sensor, rng: np.random.Generator) -> None:
    ground = sensor in (Sensor.PRINTED_ODOMETRY, Sensor.PRINTED_GNSS_VELOCITY_GROUND)
    motion, angles = (Motion.DRIFTING, ("heading",)) if ground else (Motion.EULER, ("yaw", "pitch", "roll"))
    x = draw(motion, rng)[1]
    k, K = seen(motion, x, np.zeros(6))
    theta = CASES[sensor](rng).theta()
    if sensor is Sensor.PRINTED_ACCELEROMETER:
        theta = s.PrintedAccelerometer().theta()
    H = read(sensor, k, np.zeros(8), theta)[1] @ K
    for name in angles:
        np.testing.assert_allclose(H[:, LAYOUTS[motion].error(name)], 0.0, atol=1e-12)


def test_printed_ground_velocity_turns_the_lever_arm_the_wrong_way(rng: np.random.Generator) -> None:
    """Rate times l instead of its perpendicular: their difference is |l| sqrt(2) per unit of rate."""
    k = np.zeros(kin.K_SIZE)
    k[kin.K_R : kin.K_R + 9] = Rotation.from_euler("Z", 0.6).as_matrix().ravel()
    k[kin.K_W + 2] = 1.0
    mount = s.Mount(lever_arm=(0.3, 0.2, 0.0))
    right = read(Sensor.GNSS_VELOCITY, k, np.zeros(8), mount.theta())[0]
    printed = read(Sensor.PRINTED_GNSS_VELOCITY_GROUND, k, np.zeros(8), mount.theta())[0]
    assert np.hypot(*(right - printed)[:2]) == pytest.approx(np.hypot(0.3, 0.2) * np.sqrt(2.0), rel=1e-12)


def test_printed_rate_matrix_is_singular_at_45_degrees() -> None:
    eighth = np.pi / 4
    share = [np.abs(gyro_row(a, a, 1)).max() for a in (eighth - 1e-3, eighth - 1e-6)]
    assert share[0] > 300.0 and share[1] > 300_000.0
    g = np.array([gyro_row(0.0, 0.5, i) for i in range(3)])
    clean = [[0.0, 0.0, 1.0], [np.sin(0.5), np.cos(0.5), 0.0], [np.cos(0.5), -np.sin(0.5), 0.0]]
    assert np.abs(g - clean).max() > 0.1


@pytest.mark.parametrize(("tilt_deg", "off"), [(5.0, 0.015), (20.0, 0.30)])
def test_printed_rate_matrix_is_off_by_what_was_measured(tilt_deg: float, off: float) -> None:
    """1.5 % at 5 degrees of pitch and roll, 30 % at 20: off the clean one, in the largest entry."""
    a = float(np.deg2rad(tilt_deg))
    k, K = np.zeros(kin.K_SIZE), np.zeros((kin.T_SIZE, EULER.error_size))
    kinematic_view(int(Motion.EULER), posed(0.0, a, a), np.zeros(6), EulerBody().theta(), k, K)
    clean = K[kin.T_W : kin.T_W + 3, EULER.error("euler_rate")]
    printed = np.array([gyro_row(a, a, i) for i in range(3)])
    assert np.abs(printed - clean).max() == pytest.approx(off, rel=0.5)


def test_body_rate_is_that_of_the_turning_matrix(rng: np.random.Generator) -> None:
    """g r = (R' dR/dt)^v, coop2024 (16) as it should be, against scipy's rotations."""
    for _ in range(100):
        angles, rates = rng.uniform(-1.0, 1.0, 3), rng.normal(size=3)
        k = seen(Motion.EULER, posed(*angles, rates=tuple(rates)), np.zeros(6))[0]
        h = 1e-5
        ends = [Rotation.from_euler("ZYX", angles + sign * h * rates) for sign in (1.0, -1.0)]
        numeric = (ends[1].inv() * ends[0]).as_rotvec() / (2.0 * h)
        np.testing.assert_allclose(
            k[kin.K_R : kin.K_R + 9].reshape(3, 3), Rotation.from_euler("ZYX", angles).as_matrix(), atol=1e-14
        )
        np.testing.assert_allclose(k[kin.K_W : kin.K_W + 3], numeric, atol=1e-9)


def test_at_rest_an_accelerometer_feels_what_holds_it_up() -> None:
    k = seen(Motion.EULER, posed(1.0, 0.3, -0.2), np.zeros(6))[0]
    up = Rotation.from_euler("ZYX", [1.0, 0.3, -0.2]).as_matrix().T @ [0.0, 0.0, EulerBody().gravity]
    np.testing.assert_allclose(k[kin.K_F : kin.K_F + 3], up, atol=1e-12)
    theta = s.PrintedAccelerometer().theta()
    np.testing.assert_allclose(read(Sensor.PRINTED_ACCELEROMETER, k, np.zeros(8), theta)[0], 0.0, atol=1e-12)


def test_all_printed_forms_are_flagged_and_nothing_else() -> None:
    assert {c.name for c in Sensor if not SPECS[c].exact} == {c.name for c in Sensor if c.name.startswith("PRINTED_")}
    assert set(PARAMETERS) == set(Motion) and draw(Motion.DRIFTING, np.random.default_rng(1))[1].size == 12
