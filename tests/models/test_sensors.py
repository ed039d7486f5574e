"""Laws that every sensor obeys, whatever it measures. A new sensor joins by its entry in `SPECS` and in `CASES`."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from outrider.data.events import Kind
from outrider.errors import ConfigError
from outrider.models import sensors as s
from outrider.models.kinematics import K_R, K_S, K_SIZE, T_S, T_SIZE, T_TH
from outrider.models.sensors import MAX_ROWS, SPECS, THETA_SIZE, Mount, Sensor, SensorModel, evaluate, simulate
from outrider.typing import Floats

DRAWS = 12
STEP = 1e-6


def numbers(rng: np.random.Generator, scale: float = 1.0) -> tuple[float, float, float]:
    """Three ordinary numbers."""
    x, y, z = (scale * rng.standard_normal(3)).tolist()
    return x, y, z


def any_mount(rng: np.random.Generator) -> Mount:
    """A lever arm of about a metre, a rotation without preference."""
    return Mount(lever_arm=numbers(rng), rotation=tuple(Rotation.random(rng=rng).as_matrix().ravel().tolist()))


def any_wheels(rng: np.random.Generator) -> s.WheelsMecanum:
    """The usual four wheels and a fifth one somewhere."""
    usual = s.WheelsMecanum.rectangle(0.4, 0.3).wheels
    return s.WheelsMecanum(mount=any_mount(rng), wheels=(*usual, numbers(rng, 0.3)))


CASES: dict[Sensor, Callable[[np.random.Generator], SensorModel]] = {
    Sensor.GNSS_POSITION: lambda rng: s.GnssPosition(mount=any_mount(rng)),
    Sensor.GNSS_VELOCITY: lambda rng: s.GnssVelocity(mount=any_mount(rng)),
    Sensor.GYRO: lambda rng: s.Gyro(mount=any_mount(rng)),
    Sensor.SPECIFIC_FORCE: lambda rng: s.SpecificForce(mount=any_mount(rng)),
    Sensor.TWIST: lambda rng: s.Twist(mount=any_mount(rng)),
    Sensor.WHEELS_DIFFERENTIAL: lambda rng: s.WheelsDifferential(mount=any_mount(rng), track=0.6),
    Sensor.WHEELS_MECANUM: any_wheels,
    Sensor.ACKERMANN: lambda rng: s.Ackermann(mount=any_mount(rng), wheel_base=1.8),
    Sensor.NONHOLONOMIC: lambda rng: s.Nonholonomic(mount=any_mount(rng)),
    Sensor.ZERO_VELOCITY: lambda rng: s.ZeroVelocity(),
    Sensor.ZERO_RATE: lambda rng: s.ZeroRate(mount=any_mount(rng)),
    Sensor.BARO: lambda rng: s.Baro(mount=any_mount(rng)),
    Sensor.MAG_HEADING: lambda rng: s.MagHeading(mount=any_mount(rng), declination=0.3, inclination=1.0),
    Sensor.MAG_VECTOR: lambda rng: s.MagVector(mount=any_mount(rng), field=numbers(rng)),
    Sensor.HEADING: lambda rng: s.Heading(mount=any_mount(rng), offset=2.0),
    Sensor.ATTITUDE: lambda rng: s.Attitude(mount=any_mount(rng)),
    Sensor.YAW_OF_ATTITUDE: lambda rng: s.YawOfAttitude(mount=any_mount(rng)),
    Sensor.POSE: lambda rng: s.Pose(mount=any_mount(rng)),
    Sensor.POSITION: lambda rng: s.Position(mount=any_mount(rng)),
    Sensor.BODY_VELOCITY: lambda rng: s.BodyVelocity(mount=any_mount(rng)),
    Sensor.FLOW: lambda rng: s.Flow(mount=any_mount(rng), ground=-9.0),
    Sensor.RANGE_FINDER: lambda rng: s.RangeFinder(mount=any_mount(rng), ground=-9.0),
    Sensor.RANGE: lambda rng: s.Range(mount=any_mount(rng), beacon=numbers(rng, 10.0)),
    Sensor.RANGE_BEARING: lambda rng: s.RangeBearing(mount=any_mount(rng), beacon=numbers(rng, 10.0)),
    Sensor.RELATIVE_POSE: lambda rng: s.RelativePose(mount=any_mount(rng), other=any_mount(rng)),
    Sensor.AIRSPEED: lambda rng: s.Airspeed(mount=any_mount(rng), lowest=0.5),
    Sensor.BEARING: lambda rng: s.Bearing(mount=any_mount(rng), beacon=numbers(rng, 10.0)),
    Sensor.MAP_POSE: lambda rng: s.MapPose(mount=any_mount(rng), centre=numbers(rng, 10.0)[:2]),
    Sensor.PRINTED_ODOMETRY: lambda rng: s.PrintedOdometry(),
    Sensor.PRINTED_GNSS_POSITION: lambda rng: s.PrintedGnssPosition(mount=any_mount(rng)),
    Sensor.PRINTED_GNSS_VELOCITY_GROUND: lambda rng: s.PrintedGnssVelocityGround(mount=any_mount(rng)),
    Sensor.PRINTED_GNSS_VELOCITY_AIR: lambda rng: s.PrintedGnssVelocityAir(mount=any_mount(rng)),
    Sensor.PRINTED_GYRO: lambda rng: s.PrintedGyro(),
    Sensor.PRINTED_ACCELEROMETER: lambda rng: s.PrintedAccelerometer(gravity=9.81),
}

CONSTRAINTS = (Sensor.NONHOLONOMIC, Sensor.ZERO_VELOCITY)
EVERY = pytest.mark.parametrize("sensor", list(Sensor), ids=lambda sensor: sensor.name)
EXACT = pytest.mark.parametrize("sensor", [c for c in Sensor if SPECS[c].exact], ids=lambda sensor: sensor.name)
WRONG = pytest.mark.parametrize("sensor", [c for c in Sensor if not SPECS[c].exact], ids=lambda sensor: sensor.name)
RECORDED = pytest.mark.parametrize("sensor", sorted({*Sensor} - {*CONSTRAINTS}), ids=lambda sensor: sensor.name)


def any_kinematics(rng: np.random.Generator) -> Floats:
    """Nothing is zero; every third attitude is half a turn from north-up, every third lies on its side."""
    k = rng.standard_normal(K_SIZE)
    axis = rng.standard_normal(3)
    half_turn = Rotation.from_rotvec((np.pi - 1e-7) * axis / np.linalg.norm(axis))
    tilted = Rotation.from_euler("ZYX", [rng.uniform(-np.pi, np.pi), rng.uniform(-1.5, 1.5), rng.uniform(1.0, 2.0)])
    R = (Rotation.random(rng=rng), half_turn, tilted)[rng.integers(3)]
    k[K_R : K_R + 9] = R.as_matrix().ravel()
    k[K_S] = rng.uniform(-0.2, 0.2)
    return k


def moved(k: Floats, d: Floats) -> Floats:
    """k [+] d: the attitude turns by Exp on the body side, all else adds."""
    R = k[K_R : K_R + 9].reshape(3, 3) @ Rotation.from_rotvec(d[T_TH : T_TH + 3]).as_matrix()
    rest = np.delete(d, np.s_[T_TH : T_TH + 3])
    return np.concatenate([k[:3] + rest[:3], R.ravel(), k[K_R + 9 :] + rest[3:]])


def read(sensor: Sensor, k: Floats, z: Floats, theta: Floats) -> tuple[Floats, Floats]:
    """y (m,) and D (m, T_SIZE)."""
    y, D = np.full(MAX_ROWS, np.nan), np.full((MAX_ROWS, T_SIZE), np.nan)
    m = evaluate(int(sensor), k, z, theta, y, D)
    return y[:m], D[:m]


def record(sensor: Sensor, k: Floats, theta: Floats) -> tuple[int, Floats]:
    """The fitting record, with 7.0 in columns that are not the sensor's."""
    z = np.full(16, 7.0)
    return simulate(int(sensor), k, theta, z), z


def observed(sensor: Sensor, rng: np.random.Generator, spread: float) -> tuple[Floats, Floats, Floats, Floats]:
    """(k, z, theta, d) such that z fits k [+] d exactly and the sensor sees something at both."""
    for _ in range(200):
        theta, k, d = CASES[sensor](rng).theta(), any_kinematics(rng), spread * rng.standard_normal(T_SIZE)
        m, z = record(sensor, moved(k, d), theta)
        if m and read(sensor, k, z, theta)[0].size and not_awkward(sensor, k, theta):
            return k, z, theta, d
    raise AssertionError(f"{sensor.name} never sees anything")


def not_awkward(sensor: Sensor, k: Floats, theta: Floats) -> bool:
    """Away from poles, where derivatives grow without bound and differences say nothing."""
    D = read(sensor, k, record(sensor, k, theta)[1], theta)[1]
    return bool(np.abs(D).max(initial=0.0) < 50.0)


def differences(sensor: Sensor, k: Floats, z: Floats, theta: Floats) -> Floats:
    """-dy/dk by central differences: what D should be."""
    columns = []
    for d in STEP * np.eye(T_SIZE):
        ahead, behind = read(sensor, moved(k, d), z, theta)[0], read(sensor, moved(k, -d), z, theta)[0]
        columns.append((behind - ahead) / (2.0 * STEP))
    return np.array(columns).T


@EXACT
def test_jacobian_is_the_derivative_of_the_innovation(sensor: Sensor, rng: np.random.Generator) -> None:
    for _ in range(DRAWS):
        k, z, theta, _ = observed(sensor, rng, 0.05)
        D = read(sensor, k, z, theta)[1]
        np.testing.assert_allclose(D, differences(sensor, k, z, theta), rtol=1e-6, atol=1e-6)


@EXACT
def test_innovation_is_the_jacobian_times_the_true_error(sensor: Sensor, rng: np.random.Generator) -> None:
    for _ in range(DRAWS):
        k, z, theta, d = observed(sensor, rng, 1e-5)
        y, D = read(sensor, k, z, theta)
        if sensor in CONSTRAINTS:  # they need not hold at the truth
            y = y - read(sensor, moved(k, d), z, theta)[0]
        np.testing.assert_allclose(y, D @ d, atol=1e-6)


@RECORDED
def test_simulated_record_leaves_no_innovation(sensor: Sensor, rng: np.random.Generator) -> None:
    for _ in range(DRAWS):
        k, z, theta, _ = observed(sensor, rng, 0.0)
        np.testing.assert_allclose(read(sensor, k, z, theta)[0], 0.0, atol=1e-9)


@EVERY
def test_simulation_writes_its_own_columns_only(sensor: Sensor, rng: np.random.Generator) -> None:
    _, z, _, _ = observed(sensor, rng, 0.0)
    columns = SPECS[sensor].columns[:5] if sensor == Sensor.WHEELS_MECANUM else SPECS[sensor].columns
    if Kind.IMU in SPECS[sensor].kinds:  # an IMU record comes in halves
        columns = (0, 1, 2)
    assert {i for i in range(16) if z[i] != 7.0} == set(columns)


@EVERY
def test_rows_are_overwritten_and_no_others(sensor: Sensor, rng: np.random.Generator) -> None:
    k, z, theta, _ = observed(sensor, rng, 0.01)
    y, D = np.full(MAX_ROWS + 1, np.nan), np.full((MAX_ROWS + 1, T_SIZE), np.nan)
    m = evaluate(int(sensor), k, z, theta, y, D)
    assert m == CASES[sensor](rng).sigmas().size
    assert np.isfinite(y[:m]).all() and np.isfinite(D[:m]).all()
    assert np.isnan(y[m:]).all() and np.isnan(D[m:]).all()


@EVERY
def test_exactly_m_rows_are_enough(sensor: Sensor, rng: np.random.Generator) -> None:
    k, z, theta, _ = observed(sensor, rng, 0.01)
    y, D = read(sensor, k, z, theta)
    y_tight, D_tight = np.empty(y.size), np.empty((y.size, T_SIZE))
    assert SPECS[sensor].kernel(k, z, theta, y_tight, D_tight) == y.size
    np.testing.assert_array_equal(y_tight, y)
    np.testing.assert_array_equal(D_tight, D)


@EVERY
def test_inputs_are_left_alone(sensor: Sensor, rng: np.random.Generator) -> None:
    k, z, theta, _ = observed(sensor, rng, 0.01)
    before = k.copy(), z.copy(), theta.copy()
    read(sensor, k, z, theta)
    for now, then in zip((k, z, theta), before, strict=True):
        np.testing.assert_array_equal(now, then)


@EVERY
def test_registry_is_coherent(sensor: Sensor, rng: np.random.Generator) -> None:
    spec, model = SPECS[sensor], CASES[sensor](rng)
    assert spec.sensor is sensor and model.code is sensor and type(model) is type(spec.usual)
    assert model.theta().shape == (THETA_SIZE,) and (model.sigmas() > 0.0).all()
    assert len(spec.names) == len(set(spec.names)) == len(spec.units) == len(spec.variances) == spec.rows <= MAX_ROWS
    assert len(s.row_names(model)) == model.sigmas().size <= spec.rows
    for kind in spec.kinds:
        if kind is not Kind.WHEELS:
            assert max(spec.columns) < len(kind.columns)
    assert all(spec.units[i] == "rad" for i in spec.angles)


@EVERY
def test_wrapped_rows_stay_within_half_a_turn(sensor: Sensor, rng: np.random.Generator) -> None:
    angles = list(SPECS[sensor].angles)
    for _ in range(DRAWS if angles else 0):
        theta, k = CASES[sensor](rng).theta(), any_kinematics(rng)
        _, z = record(sensor, any_kinematics(rng), theta)
        y, _ = read(sensor, k, z, theta)
        assert y.size == 0 or (np.abs(y[angles]) <= np.pi).all()


def test_the_derivative_law_notices_a_wrong_entry(rng: np.random.Generator) -> None:
    k, z, theta, _ = observed(Sensor.WHEELS_DIFFERENTIAL, rng, 0.05)
    D = read(Sensor.WHEELS_DIFFERENTIAL, k, z, theta)[1].copy()
    D[0, T_S] *= 1.001
    assert not np.allclose(D, differences(Sensor.WHEELS_DIFFERENTIAL, k, z, theta), rtol=1e-6, atol=1e-6)


def test_every_sensor_is_registered_once_and_codes_are_stable() -> None:
    assert set(SPECS) == set(Sensor) == set(CASES)
    assert (Sensor.GNSS_POSITION, Sensor.GYRO, Sensor.BARO, Sensor.RANGE, Sensor.AIRSPEED) == (1, 3, 12, 23, 26)


def test_an_unknown_code_sees_nothing() -> None:
    assert evaluate(999, np.zeros(K_SIZE), np.zeros(8), np.zeros(THETA_SIZE), np.zeros(8), np.zeros((8, T_SIZE))) == 0


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Mount(lever_arm=(0.0, 0.0, float("nan"))), "lever arm"),
        (lambda: Mount(rotation=(1.0, 0.0, 0.0)), "3x3"),
        (lambda: Mount(rotation=(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0)), "right-handed"),
        (lambda: Mount(rotation=(1.0, 0.1, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)), "right-handed"),
        (lambda: s.WheelsDifferential(track=0.0), "track is 0.0"),
        (lambda: s.Ackermann(wheel_base=-1.0), "wheel_base"),
        (lambda: s.Gyro(sigma=0.0).sigmas(), "sigma is 0.0"),
        (lambda: s.MagVector(field=(0.0, 0.0, 0.0)), "direction"),
        (lambda: s.WheelsMecanum(wheels=()), "tell forward, sideways and turning apart"),
        (lambda: s.WheelsMecanum(wheels=((0.0, 0.0, 1.6),)), "cannot drive"),
        (lambda: s.WheelsMecanum(wheels=s.WheelsMecanum.rectangle(0.3, 0.2).wheels * 3), "at most 8"),
    ],
)
def test_impossible_parameters_are_refused(make: Callable[[], object], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        make()


def test_mount_from_angles_and_from_a_transform_agree() -> None:
    by_angles = Mount.from_rpy((1.0, 2.0, 3.0), 0.3, -0.4, 2.0)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.from_euler("ZYX", [2.0, -0.4, 0.3]).as_matrix(), (1.0, 2.0, 3.0)
    np.testing.assert_allclose(by_angles.theta(), Mount.from_matrix(T).theta(), atol=1e-15)
