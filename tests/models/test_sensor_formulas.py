"""Each sensor against a formula or a small experiment worked out another way, and what it says when it sees nothing."""

from math import atan, atan2, cos, pi, sin, tan

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from outrider.errors import ConfigError
from outrider.models import sensors as s
from outrider.models.kinematics import (
    K_BA,
    K_BB,
    K_BG,
    K_BN,
    K_BR,
    K_F,
    K_P,
    K_R,
    K_S,
    K_SIZE,
    K_V,
    K_W,
    K_WIND,
    T_SIZE,
)
from outrider.models.sensors import Mount, Sensor, SensorModel, evaluate, simulate
from outrider.models.wheels import mecanum_rank
from outrider.typing import Floats

LEVER = (0.4, -0.3, 0.8)
TILTED = Mount.from_rpy(LEVER, 0.3, -0.2, 1.1)
B = Rotation.from_euler("ZYX", [1.1, -0.2, 0.3])
DT = 1e-5


def kinematics(attitude: Rotation | None = None, **parts: object) -> Floats:
    """k with zeros where nothing is said."""
    offsets = {"p": K_P, "v": K_V, "w": K_W, "f": K_F, "bg": K_BG, "ba": K_BA, "s": K_S, "bn": K_BN}
    offsets |= {"wind": K_WIND, "bb": K_BB, "br": K_BR}
    k = np.zeros(K_SIZE)
    k[K_R : K_R + 9] = (attitude or Rotation.identity()).as_matrix().ravel()
    for name, value in parts.items():
        values = np.atleast_1d(np.asarray(value, np.float64))
        k[offsets[name] : offsets[name] + values.size] = values
    return k


def predicted(model: SensorModel, k: Floats, first: int = 0) -> Floats:
    """The fitting record, from the sensor's first column on."""
    z = np.zeros(16)
    m = simulate(int(model.code), k, model.theta(), z)
    width = 4 if model.code == Sensor.ATTITUDE else m + (model.code in (Sensor.POSE, Sensor.RELATIVE_POSE))
    return z[first : first + width]


def innovation(model: SensorModel, k: Floats, *z: float) -> Floats:
    """y (m,)."""
    y = np.zeros(s.MAX_ROWS)
    m = evaluate(int(model.code), k, np.array(z, np.float64), model.theta(), y, np.zeros((s.MAX_ROWS, T_SIZE)))
    return y[:m]


class Flight:
    """A body that flies straight at constant speed while it turns at a constant rate in its own axes."""

    def __init__(self, rng: np.random.Generator, R: Rotation | None = None) -> None:
        self.R, self.w = R or Rotation.random(rng=rng), rng.standard_normal(3)
        self.p, self.v = np.array([3.0, -2.0, 9.0]), rng.standard_normal(3)

    def attitude(self, t: float) -> Rotation:
        return self.R * Rotation.from_rotvec(self.w * t)

    def antenna(self, t: float) -> Floats:
        return self.p + self.v * t + self.attitude(t).apply(LEVER)

    def antenna_velocity(self) -> Floats:
        return (self.antenna(DT) - self.antenna(-DT)) / (2 * DT)

    def k(self, **parts: object) -> Floats:
        return kinematics(self.R, p=self.p, v=self.v, w=self.w, **parts)


@pytest.fixture
def flight(rng: np.random.Generator) -> Flight:
    return Flight(rng)


def test_positions_of_an_antenna(flight: Flight) -> None:
    drift = np.array([1.0, 2.0, 3.0])
    k = flight.k(bn=drift)
    np.testing.assert_allclose(predicted(s.Position(mount=TILTED), k), flight.antenna(0.0))
    np.testing.assert_allclose(predicted(s.GnssPosition(mount=TILTED), k), flight.antenna(0.0) + drift)


def test_velocities_of_an_antenna(flight: Flight) -> None:
    v = flight.antenna_velocity()
    np.testing.assert_allclose(predicted(s.GnssVelocity(mount=TILTED), flight.k()), v, atol=1e-8)
    in_sensor = (flight.R * B).inv().apply(v)
    np.testing.assert_allclose(predicted(s.BodyVelocity(mount=TILTED), flight.k()), in_sensor, atol=1e-8)
    np.testing.assert_allclose(innovation(s.Nonholonomic(mount=TILTED), flight.k()), -in_sensor[1:], atol=1e-8)
    np.testing.assert_allclose(innovation(s.ZeroVelocity(), flight.k()), -flight.v)


def test_airspeed_is_relative_to_the_wind(flight: Flight) -> None:
    forward = (flight.R * B).apply([1.0, 0.0, 0.0])
    wind = np.array([-20.0 * forward[0], -20.0 * forward[1], 0.0])  # from ahead
    expected = forward @ (flight.antenna_velocity() - wind)
    np.testing.assert_allclose(predicted(s.Airspeed(mount=TILTED), flight.k(wind=wind[:2])), [expected], atol=1e-8)
    level = kinematics(v=(12.0, 0.0, 0.0), wind=(4.0, 1.0))
    np.testing.assert_allclose(predicted(s.Airspeed(), level), [8.0])
    assert predicted(s.Airspeed(lowest=9.0), level).size == 0


def test_gyro_in_its_own_axes(flight: Flight) -> None:
    bias = np.array([0.1, 0.2, 0.3])
    k = flight.k(bg=bias)
    np.testing.assert_allclose(predicted(s.Gyro(mount=TILTED), k), B.inv().apply(flight.w + bias))
    np.testing.assert_allclose(predicted(s.ZeroRate(mount=TILTED), k), B.inv().apply(bias))


def test_accelerometer_feels_the_centripetal_force_at_its_place(flight: Flight) -> None:
    """The body origin flies straight, so its specific force is -g alone; the antenna's has its own acceleration."""
    step, up, bias = 1e-4, np.array([0.0, 0.0, 9.8]), np.array([0.1, -0.2, 0.3])
    a = (flight.antenna(step) - 2.0 * flight.antenna(0.0) + flight.antenna(-step)) / step**2
    k = flight.k(f=flight.R.inv().apply(up), ba=bias)
    expected = B.inv().apply(flight.R.inv().apply(a + up) + bias)
    np.testing.assert_allclose(predicted(s.SpecificForce(mount=TILTED), k), expected, atol=1e-5)


def test_twist_shows_the_wheels_scale_in_the_plane_only() -> None:
    k = kinematics(v=(1.1, 0.22, 0.3), w=(0.1, 0.2, 0.3), s=0.1)
    np.testing.assert_allclose(predicted(s.Twist(), k), [1.0, 0.2, 0.3, 0.1, 0.2, 0.3])


def test_differential_drive_on_a_circle() -> None:
    """Turning left on a circle of 2 m about the axle's centre: the wheels' circles have 2 -+ B/2."""
    w, track = 0.5, 0.6
    heading = Rotation.from_euler("z", 0.7)
    k = kinematics(heading, v=heading.apply([2.0 * w, 0.0, 0.0]), w=(0.0, 0.0, w), s=-0.02)
    np.testing.assert_allclose(predicted(s.WheelsDifferential(track=track), k), [1.7 * w / 0.98, 2.3 * w / 0.98])


def test_mecanum_rims_are_those_of_the_textbook() -> None:
    """vx -+ vy -+ (a + b) w for front left, front right, rear left, rear right (rollers in an X from above)."""
    a, b, v_x, v_y, w = 0.4, 0.3, 0.9, 0.35, 0.7
    k = kinematics(v=(v_x, v_y, 0.0), w=(0.0, 0.0, w), s=0.25)
    turn = (a + b) * w
    textbook = np.array([v_x - v_y - turn, v_x + v_y + turn, v_x + v_y - turn, v_x - v_y + turn])
    np.testing.assert_allclose(predicted(s.WheelsMecanum.rectangle(a, b), k), textbook / 1.25)


def test_omni_wheels_without_slant_ignore_sliding() -> None:
    """Roller axis straight ahead: the rim shows only what moves along the wheel."""
    wheels = ((0.2, 0.3, 0.0), *s.WheelsMecanum.rectangle(0.4, 0.3).wheels)
    k = kinematics(v=(0.5, 9.0, 0.0), w=(0.0, 0.0, 2.0))
    np.testing.assert_allclose(predicted(s.WheelsMecanum(wheels=wheels), k)[0], 0.5 - 2.0 * 0.3)


def test_rank_of_wheel_layouts() -> None:
    g = pi / 4
    x_layout = s.WheelsMecanum.rectangle(0.3, 0.3).wheels
    o_layout = tuple((x, y, -angle) for x, y, angle in x_layout)  # mounted the wrong way round on a square base
    parallel = tuple((x, y, g) for x, y, _ in x_layout)
    assert [mecanum_rank(w) for w in (x_layout, o_layout, parallel, x_layout[:3], x_layout[:2], ())] == [
        3,
        2,
        2,
        3,
        2,
        0,
    ]
    for wheels in (o_layout, parallel, x_layout[:2]):
        with pytest.raises(ConfigError, match="cannot tell forward, sideways and turning apart"):
            s.WheelsMecanum(wheels=wheels)


@pytest.mark.parametrize("speed", [2.0, -2.0])
def test_ackermann_turns_about_the_point_on_its_rear_axle(speed: float) -> None:
    base, steering, scale = 1.8, 0.3, 0.1
    radius = base / tan(steering)
    k = kinematics(v=(speed, 0.0, 0.0), w=(0.0, 0.0, speed / radius), s=scale)
    np.testing.assert_allclose(predicted(s.Ackermann(wheel_base=base), k), [speed / (1 + scale), atan(base / radius)])


def test_ackermann_at_rest_does_not_turn() -> None:
    still = kinematics(w=(0.0, 0.0, 0.02))
    np.testing.assert_allclose(innovation(s.Ackermann(wheel_base=1.8), still, 0.0, 0.4), [0.0, -0.02])
    np.testing.assert_allclose(predicted(s.Ackermann(wheel_base=1.8), still), [0.0, 0.0])


def test_barometer_with_offset(flight: Flight) -> None:
    np.testing.assert_allclose(predicted(s.Baro(mount=TILTED), flight.k(bb=1.5)), [flight.antenna(0.0)[2] + 1.5])


DOWNWARD = Rotation.from_euler("ZYX", [2.0, 0.3, -0.2]) * B.inv()  # the mount then looks almost straight down


def test_range_finder_reaches_the_ground(rng: np.random.Generator) -> None:
    flight = Flight(rng, DOWNWARD)
    distance = predicted(s.RangeFinder(mount=TILTED, ground=1.25), flight.k())[0]
    hit = flight.antenna(0.0) - distance * (DOWNWARD * B).apply([0.0, 0.0, 1.0])
    assert distance > 0.0 and hit[2] == pytest.approx(1.25)


def test_flow_is_the_turn_that_would_move_the_ground_alike(rng: np.random.Generator) -> None:
    """Watch the ground point in the middle of the image for a moment, in the sensor's moving axes."""
    flight = Flight(rng, DOWNWARD)
    k, down = flight.k(), np.array([0.0, 0.0, -1.0])
    d = predicted(s.RangeFinder(mount=TILTED), k)[0]
    ground = flight.antenna(0.0) + (DOWNWARD * B).apply(d * down)

    def seen(t: float) -> Floats:
        return (flight.attitude(t) * B).inv().apply(ground - flight.antenna(t))

    rate = (seen(DT) - seen(-DT)) / (2 * DT)
    np.testing.assert_allclose(predicted(s.Flow(mount=TILTED), k), [-rate[1] / d, rate[0] / d], atol=1e-7)


def test_flow_signs_of_a_level_sensor() -> None:
    high = {"p": (0.0, 0.0, 4.0)}
    np.testing.assert_allclose(predicted(s.Flow(), kinematics(v=(2.0, 0.0, 0.0), **high)), [0.0, -0.5])
    np.testing.assert_allclose(predicted(s.Flow(), kinematics(v=(0.0, 2.0, 0.0), **high)), [0.5, 0.0])
    np.testing.assert_allclose(predicted(s.Flow(), kinematics(w=(0.1, 0.2, 0.3), **high)), [0.1, 0.2])


def magnetic(declination: float, inclination: float) -> Floats:
    return np.array([cos(inclination) * sin(declination), cos(inclination) * cos(declination), -sin(inclination)])


def test_compass_needs_neither_level_nor_strength(flight: Flight) -> None:
    declination, inclination = 0.2, 1.15
    model = s.MagHeading(mount=TILTED, declination=declination, inclination=inclination)
    m = 48.0 * (flight.R * B).inv().apply(magnetic(declination, inclination))
    np.testing.assert_allclose(innovation(model, flight.k(), *m), [0.0], atol=1e-12)
    wrong = kinematics(Rotation.from_euler("z", -0.3) * flight.R)
    np.testing.assert_allclose(innovation(model, wrong, *m), [0.3])


def test_compass_of_a_robot_that_faces_magnetic_north() -> None:
    """Declination 10 degrees east: magnetic north is 80 degrees counter-clockwise from east."""
    facing = kinematics(Rotation.from_euler("z", 80.0, degrees=True))
    model = s.MagHeading(declination=np.deg2rad(10.0))
    np.testing.assert_allclose(innovation(model, facing, 0.4, 0.0, -0.9), [0.0], atol=1e-12)


def test_magnetic_vector(flight: Flight) -> None:
    field = magnetic(-0.1, 1.0)
    expected = (flight.R * B).inv().apply(field)
    model = s.MagVector(mount=TILTED, field=(float(7 * field[0]), float(7 * field[1]), float(7 * field[2])))
    np.testing.assert_allclose(predicted(model, flight.k()), expected)
    np.testing.assert_allclose(innovation(model, flight.k(), *(300.0 * expected)), np.zeros(3), atol=1e-14)


def test_heading_of_the_baseline(flight: Flight) -> None:
    x, y, _ = (flight.R * B).apply([1.0, 0.0, 0.0])
    angle = predicted(s.Heading(mount=TILTED, offset=0.5), flight.k())[0] - 0.5 - atan2(y, x)
    assert cos(angle) == pytest.approx(1.0)


@pytest.mark.parametrize(("z", "yaw", "y"), [(3.1, -3.1, 6.2 - 2 * pi), (-3.1, 3.1, 2 * pi - 6.2), (pi, -pi, 0.0)])
def test_headings_are_subtracted_the_short_way(z: float, yaw: float, y: float) -> None:
    k = kinematics(Rotation.from_euler("z", yaw))
    q = Rotation.from_euler("z", z).as_quat()
    np.testing.assert_allclose(innovation(s.Heading(), k, z), [y], atol=1e-12)
    np.testing.assert_allclose(innovation(s.YawOfAttitude(), k, *q), [y], atol=1e-12)
    np.testing.assert_allclose(innovation(s.MagHeading(declination=pi / 2 - z), k, 1.0, 0.0, -1.0), [y], atol=1e-12)


@pytest.mark.parametrize("turn", [0.0, 1e-9, 0.3, 3.0, pi - 1e-6])
@pytest.mark.parametrize("length", [1.0, -1.0, 1.001])
def test_attitude_innovation_is_the_rotation_between(flight: Flight, turn: float, length: float) -> None:
    axis = np.array([0.6, -0.48, 0.64])
    q = length * (flight.R * Rotation.from_rotvec(turn * axis) * B).as_quat()
    np.testing.assert_allclose(innovation(s.Attitude(mount=TILTED), flight.k(), *q), turn * axis, atol=1e-9)
    pose = innovation(s.Pose(mount=TILTED), flight.k(), *(flight.antenna(0.0) + 1.0), *q)
    np.testing.assert_allclose(pose, [1.0, 1.0, 1.0, *(turn * axis)], atol=1e-9)


def test_yaw_of_attitude_ignores_tilt_errors_of_the_sensor() -> None:
    mine, theirs = Rotation.from_euler("ZYX", [1.0, 0.2, -0.1]), Rotation.from_euler("ZYX", [1.2, -0.4, 0.5])
    q = (theirs * B).as_quat()
    np.testing.assert_allclose(innovation(s.YawOfAttitude(mount=TILTED), kinematics(mine), *q), [0.2])


def test_relative_pose_by_transforms(flight: Flight, rng: np.random.Generator) -> None:
    other = Mount(lever_arm=(5.0, 1.0, 2.0), rotation=tuple(Rotation.random(rng=rng).as_matrix().ravel().tolist()))

    def transform(R: Floats, p: object) -> Floats:
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = R, p
        return T

    world_sensor = transform(flight.R.as_matrix(), flight.p) @ transform(B.as_matrix(), LEVER)
    T = np.linalg.inv(world_sensor) @ transform(np.reshape(other.rotation, (3, 3)), other.lever_arm)
    z = predicted(s.RelativePose(mount=TILTED, other=other), flight.k(), first=1)
    np.testing.assert_allclose(z[:3], T[:3, 3])
    np.testing.assert_allclose(Rotation.from_quat(z[3:]).as_matrix(), T[:3, :3], atol=1e-12)


def test_range_and_bearing(flight: Flight) -> None:
    beacon = (10.0, 20.0, 5.0)
    q = (flight.R * B).inv().apply(np.array(beacon) - flight.antenna(0.0))
    k = flight.k(br=0.7)
    distance = float(np.linalg.norm(q)) + 0.7
    np.testing.assert_allclose(predicted(s.Range(mount=TILTED, beacon=beacon), k, first=1), [distance])
    both = predicted(s.RangeBearing(mount=TILTED, beacon=beacon), k, first=1)
    np.testing.assert_allclose(both, [distance, atan2(q[1], q[0])])
    left = innovation(s.RangeBearing(beacon=(0.0, 3.0, 0.0)), kinematics(), 0.0, 3.0, pi / 2)
    np.testing.assert_allclose(left, [0.0, 0.0], atol=1e-15)


NOTHING = (0.0, 0.0, 0.0)
HIGH = kinematics(p=(0.0, 0.0, 5.0))
NOSE_UP = kinematics(Rotation.from_euler("y", -pi / 2))
UPSIDE_DOWN = kinematics(Rotation.from_euler("x", pi), p=(0.0, 0.0, 5.0))


@pytest.mark.parametrize(
    ("model", "k", "z"),
    [
        pytest.param(s.Flow(), kinematics(), (0.0, 0.0), id="flow on the ground"),
        pytest.param(s.Flow(), kinematics(p=(0.0, 0.0, -3.0)), (0.0, 0.0), id="flow below the ground"),
        pytest.param(s.Flow(), UPSIDE_DOWN, (0.0, 0.0), id="flow of the sky"),
        pytest.param(s.Flow(), NOSE_UP, (0.0, 0.0), id="flow of the horizon"),
        pytest.param(s.RangeFinder(), UPSIDE_DOWN, (0.0,), id="range to the sky"),
        pytest.param(s.Range(beacon=NOTHING), kinematics(), (0.0, 1.0), id="range to here"),
        pytest.param(s.RangeBearing(beacon=NOTHING), kinematics(), (0.0, 1.0, 0.0), id="bearing of here"),
        pytest.param(s.RangeBearing(beacon=NOTHING), HIGH, (0.0, 5.0, 0.0), id="bearing of straight below"),
        pytest.param(s.MagHeading(declination=0.0), HIGH, (0.0, 0.0, -1.0), id="field straight down"),
        pytest.param(s.MagHeading(declination=0.0), HIGH, NOTHING, id="no field for a heading"),
        pytest.param(s.MagVector(field=(0.0, 1.0, -1.0)), HIGH, NOTHING, id="no field"),
        pytest.param(s.Heading(), NOSE_UP, (0.0,), id="heading of a nose straight up"),
        pytest.param(s.YawOfAttitude(), NOSE_UP, (0.0, 0.0, 0.0, 1.0), id="yaw of a nose straight up"),
        pytest.param(s.YawOfAttitude(), HIGH, (0.0, -(0.5**0.5), 0.0, 0.5**0.5), id="yaw of their nose straight up"),
        pytest.param(s.YawOfAttitude(), HIGH, (*NOTHING, 0.0), id="yaw of no rotation"),
        pytest.param(s.Attitude(), HIGH, (*NOTHING, 0.0), id="no rotation"),
        pytest.param(s.Attitude(), HIGH, (*NOTHING, float("nan")), id="not a number"),
        pytest.param(s.Pose(), HIGH, (*NOTHING, *NOTHING, 0.0), id="pose without rotation"),
        pytest.param(s.RelativePose(), HIGH, (1.0, *NOTHING, *NOTHING, 0.0), id="relative pose without rotation"),
        pytest.param(s.Airspeed(), kinematics(v=(1.0, 0.0, 0.0)), (9.0,), id="too slow for a pitot tube"),
    ],
)
def test_says_that_it_sees_nothing(model: SensorModel, k: Floats, z: tuple[float, ...]) -> None:
    assert innovation(model, k, *z).size == 0


def test_range_finder_mends_a_height_below_the_ground() -> None:
    np.testing.assert_allclose(innovation(s.RangeFinder(), kinematics(p=(0.0, 0.0, -0.3)), 0.1), [0.4])
