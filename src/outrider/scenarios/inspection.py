"""coop2024 in open loop: the two robots on their tours around the airliner, everybody's records, and their filters.

The trajectories, the lever arms and all process noise are ours, since the paper gives none. Motion and what can be seen
from where do not depend on the seed: they are worked out once, and a seed costs only its noise.
"""

from dataclasses import dataclass, replace
from functools import cache
from typing import Final, final

import numpy as np

from outrider.core.rotations import quats_conjugate, quats_exp, quats_multiply, quats_to_matrices
from outrider.data import Gaussian
from outrider.filters.cooperative import Member, Shared, Source
from outrider.models import sensors as s
from outrider.models.motion import LAYOUTS, DriftingRover, EulerBody, Motion
from outrider.models.sensors import Mount, SensorModel
from outrider.scenarios.build import build
from outrider.scenarios.files import load_scenario
from outrider.sim.noise import gauss_markov, generator
from outrider.sim.sensors import ObjectPose, Setting, StereoVelocity, make_device
from outrider.sim.truth import Truth, rotate
from outrider.typing import Bools, Floats, Ints

GNSS, GNSS_VELOCITY, GYRO, ACCEL, BARO = 0.7, 0.05, 0.01, 0.015, 0.25  # coop2024, IV; m, m/s, rad/s, m/s^2, m
ODOMETRY, ODOMETRY_RATE, STEREO = 0.4, 0.05, 0.2  # m/s, rad/s, m/s
LIDAR, LIDAR_ANGLE, CAMERA, CAMERA_ANGLE = 0.05, 0.04, 0.15, 0.06  # m, rad
REACH: Final = 5.0  # m, horizontally, between the robots
ANTENNA = {"ugv": (0.3, 0.2, 0.0), "uav": (0.0, 0.0, 0.15)}  # m
START, START_HEADING, START_TILT, START_SPEED = 0.3, np.deg2rad(1.0), np.deg2rad(0.5), 0.1  # first errors
CENTRE: Final = (0.0, 20.0)  # m, the middle of the aircraft
_INF = float("inf")
_PLANE = np.array([1.0, 1.0, _INF])


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Faults:
    """What is wrong beyond white noise; standard deviations of draws that each seed makes anew.

    gnss_bias : m per axis, constant, or Gauss-Markov with gnss_time [s];  common : the same for both robots
    aircraft : m per axis, aircraft_yaw : rad, how far it stands from where the map says
    gravity : whether accelerometers feel it: in the paper they do not
    """

    gnss_bias: float = 0.0
    gnss_time: float = _INF
    common: bool = True
    aircraft: float = 0.0
    aircraft_yaw: float = 0.0
    gyro_bias: float = 0.005  # rad/s
    accel_bias: float = 0.05  # m/s^2
    gravity: bool = True


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Tuning:
    """What the filters know of it. gnss_bias : m, of the states for it, 0: none;  aircraft, aircraft_yaw : m and rad,
    likewise;  consider : these states are considered, not estimated;  printed : the matrices of the paper, but for that
    of its odometry, which takes the robot away: printed_odometry."""

    gnss_bias: float = 0.0
    gnss_time: float = 1e9
    common: bool = False
    aircraft: float = 0.0
    aircraft_yaw: float = 0.0
    consider: bool = False
    gyro_bias: float = 0.005
    accel_bias: float = 0.05
    printed: bool = False
    printed_odometry: bool = False


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Tours:
    """Both motions at 100 Hz and when what can be seen: rows of the truth."""

    ugv: Truth
    uav: Truth
    lidar: Ints
    stereo: dict[str, Ints]
    camera: Ints

    def of(self, robot: str) -> Truth:
        """One robot's motion."""
        return self.ugv if robot == "ugv" else self.uav

    @property
    def t(self) -> Floats:
        """(n,) s."""
        return np.asarray((self.ugv.t - self.ugv.start) * 1e-9, np.float64)


@cache
def tours() -> Tours:
    """The tours of the scenario airliner-tour."""
    cast = build(*load_scenario("airliner-tour", {}))
    ugv, uav = (next(r.track for r in cast.team if r.name == name) for name in ("ugv", "uav"))
    assert ugv is not None and uav is not None
    truths = {"ugv": ugv, "uav": uav}
    near: dict[str, Ints] = {}
    lidar = np.zeros(0, np.int64)
    for name, truth in truths.items():
        setting = Setting(world=cast.world, robot=name, start=truth.start, end=int(truth.t[-1]), seed=0)
        rng = np.random.default_rng(0)
        near[name] = _rows(truth, make_device(StereoVelocity(), setting, rng)(truth, {}).t)
        if name == "ugv":
            lidar = _rows(truth, make_device(ObjectPose(object="airliner"), setting, rng)(truth, {}).t)
    every = np.arange(20, ugv.t.size, 20)
    apart = np.hypot(*(uav.p - ugv.p)[every, :2].T)
    eye = ugv.p[every] + [0.0, 0.0, 0.6]
    seen: Bools = (apart < REACH) & cast.world.sees(eye, uav.p[every] + [0.0, 0.0, 0.2], every * 0.01)
    return Tours(ugv=ugv, uav=uav, lidar=lidar, stereo=near, camera=every[seen].astype(np.int64))


def _rows(truth: Truth, t: Ints) -> Ints:
    rows = np.searchsorted(truth.t, t).astype(np.int64)
    return rows[rows > 0]


def sense(seed: int, faults: Faults, tuning: Tuning) -> list[Source]:
    """Everybody's records of one seed, as the filters of that tuning read them. The noise depends on the seed only."""
    way = tours()
    shift = generator(seed, "aircraft", "place").standard_normal(3) * np.array(
        [faults.aircraft] * 2 + [faults.aircraft_yaw]
    )
    sources: list[Source] = []
    for robot in ("ugv", "uav"):
        sources += _own(seed, robot, way, faults, tuning)
    c, sn = np.cos(shift[2]), np.sin(shift[2])
    k = way.lidar
    away = way.ugv.p[k, :2] - CENTRE - shift[:2]
    seen = np.column_stack([c * away[:, 0] + sn * away[:, 1], c * away[:, 1] - sn * away[:, 0]]) + CENTRE
    draws = generator(seed, "ugv", "lidar").standard_normal((k.size, 3)) * [LIDAR, LIDAR, LIDAR_ANGLE]
    turn = np.zeros((k.size, 3))
    turn[:, 2] = draws[:, 2] - shift[2]
    z = np.column_stack([seen + draws[:, :2], way.ugv.p[k, 2], quats_multiply(way.ugv.q[k], quats_exp(turn))])
    lidar = s.MapPose(centre=CENTRE, sigma_position=LIDAR, sigma_heading=LIDAR_ANGLE)
    sources.append(Source(robot="ugv", sensor=lidar, t=way.t[k], z=z, navigation=False))
    return [*sources, _camera(seed, way, "ugv", "uav"), _camera(seed, way, "uav", "ugv")]


def _own(seed: int, robot: str, way: Tours, faults: Faults, tuning: Tuning) -> list[Source]:
    """Inertial, wheels or barometer, GNSS and stereo."""
    truth, flies, printed = way.of(robot), robot == "uav", tuning.printed
    every, tenth, stereo = np.arange(1, truth.t.size), np.arange(10, truth.t.size, 10), way.stereo[robot]
    lever = np.array(ANTENNA[robot])
    mount = Mount(lever_arm=ANTENNA[robot])

    def noise(name: str, n: int, columns: int, sigma: float) -> Floats:
        return generator(seed, robot, name).standard_normal((n, columns)) * sigma

    def add(sensor: SensorModel, rows: Ints, z: Floats, sigmas: Floats | None = None, navigation: bool = True) -> None:
        out.append(Source(robot=robot, sensor=sensor, t=way.t[rows], z=z, sigmas=sigmas, navigation=navigation))

    out: list[Source] = []
    constant = generator(seed, robot, "biases").standard_normal((2, 3))
    gyro = truth.w[every] + constant[0] * faults.gyro_bias + noise("gyro", every.size, 3, GYRO)
    only_z = np.array([_INF, _INF, GYRO])
    add(s.PrintedGyro(sigma=GYRO) if printed and flies else s.Gyro(sigma=GYRO), every, gyro, None if flies else only_z)
    if flies:
        felt = truth.f[every] + constant[1] * faults.accel_bias + noise("accel", every.size, 3, ACCEL)
        if not faults.gravity:
            down = np.tile([0.0, 0.0, truth.gravity], (every.size, 1))
            felt -= rotate(quats_conjugate(truth.q[every]), down)
        accel = s.PrintedAccelerometer(sigma=ACCEL, gravity=truth.gravity) if printed else s.SpecificForce(sigma=ACCEL)
        add(accel, every, felt)
        add(s.Baro(sigma=BARO), every, truth.p[every, 2:3] + noise("baro", every.size, 1, BARO))
    else:
        draws = noise("wheels", every.size, 3, 1.0) * [ODOMETRY, ODOMETRY, ODOMETRY_RATE]
        own = rotate(quats_conjugate(truth.q[every]), truth.v[every])
        z = np.zeros((every.size, 6))
        z[:, :2], z[:, 5] = own[:, :2] + draws[:, :2], truth.w[every, 2] + draws[:, 2]
        sigmas = np.array([ODOMETRY, ODOMETRY, _INF, _INF, _INF, ODOMETRY_RATE])
        add(s.PrintedOdometry() if tuning.printed_odometry else s.Twist(), every, z, sigmas)
    dims = np.ones(3) if flies else _PLANE
    arm = rotate(truth.q[tenth], np.tile(lever, (tenth.size, 1)))
    slow = _slow(seed, robot, truth.t.size, faults)[tenth]
    position = truth.p[tenth] + arm + slow + noise("gnss", tenth.size, 3, GNSS)
    swing = rotate(truth.q[tenth], np.cross(truth.w[tenth], lever))
    velocity = truth.v[tenth] + swing + noise("gnss velocity", tenth.size, 3, GNSS_VELOCITY)
    pos_model = s.PrintedGnssPosition(mount=mount) if printed else s.GnssPosition(mount=mount)
    air = s.PrintedGnssVelocityAir(mount=mount) if flies else s.PrintedGnssVelocityGround(mount=mount)
    add(pos_model, tenth, position, GNSS * dims)
    add(air if printed else s.GnssVelocity(mount=mount), tenth, velocity, GNSS_VELOCITY * dims)
    seen = truth.v[stereo] + noise("stereo", stereo.size, 3, STEREO)
    add(s.GnssVelocity(), stereo, seen, STEREO * dims, navigation=False)
    return out


def _slow(seed: int, robot: str, n: int, faults: Faults) -> Floats:
    """(n, 3) what a receiver is off by for minutes."""
    rng = generator(seed, "both" if faults.common else robot, "gnss bias")
    if np.isfinite(faults.gnss_time):
        return gauss_markov(rng, n, 3, 0.01, faults.gnss_bias, faults.gnss_time)
    return np.tile(rng.standard_normal(3) * faults.gnss_bias, (n, 1))


def _camera(seed: int, way: Tours, robot: str, partner: str) -> Source:
    """What one robot's camera sees of the other; of its attitude only the turn about its vertical."""
    own, other, k = way.of(robot), way.of(partner), way.camera
    back, draws = quats_conjugate(own.q[k]), generator(seed, robot, "camera").standard_normal((k.size, 4))
    turn = np.zeros((k.size, 3))
    turn[:, 2] = draws[:, 3] * CAMERA_ANGLE
    p = rotate(back, other.p[k] - own.p[k]) + draws[:, :3] * CAMERA
    q = quats_multiply(quats_multiply(back, other.q[k]), quats_exp(turn))
    z = np.column_stack([np.zeros(k.size), p, q])
    sigmas = np.array([CAMERA] * 3 + [_INF, _INF, CAMERA_ANGLE])
    return Source(
        robot=robot, partner=partner, sensor=s.RelativePose(), t=way.t[k], z=z, sigmas=sigmas, navigation=False
    )


def crew(seed: int, tuning: Tuning) -> tuple[Member, Member]:
    """Both filters with what they believe at the start."""
    # the paper gives no process noise: its preset keeps that of papers.md, the correct models have what this tour needs
    ground = DriftingRover(gnss_bias=tuning.gnss_bias, gnss_time=tuning.gnss_time)
    if not tuning.printed:
        ground = replace(ground, acceleration=0.1, yaw_acceleration=0.25)
    air = EulerBody(gnss_bias=tuning.gnss_bias, gnss_time=tuning.gnss_time, gravity=tours().uav.gravity)
    considered = ("gnss_bias", "map_error") if tuning.consider else ()
    slow = {"gnss_bias": tuning.gnss_bias}
    first = {"position": START, "velocity": START_SPEED, "gyro_bias": tuning.gyro_bias, **slow}
    on_ground = {"heading": START_HEADING, "yaw_rate": 0.1, **first}
    in_air = {
        "yaw": START_HEADING, "pitch": START_TILT, "roll": START_TILT, "acceleration": air.acceleration,
        "euler_rate": air.rate, "accel_bias": tuning.accel_bias, **first,
    }  # fmt: skip
    ugv = _belief(seed, "ugv", Motion.DRIFTING, on_ground)
    rows = LAYOUTS[Motion.DRIFTING].error("map_error")
    ugv.P[rows, rows] = np.diag([tuning.aircraft**2, tuning.aircraft**2, tuning.aircraft_yaw**2])
    return (
        Member(name="ugv", motion=Motion.DRIFTING, model=ground, belief=ugv, consider=considered),
        Member(name="uav", motion=Motion.EULER, model=air, belief=_belief(seed, "uav", Motion.EULER, in_air),
               consider=considered[:1]),
    )  # fmt: skip


def common(tuning: Tuning) -> list[Shared]:
    """What both believe to have in common: the error of their receivers, if it is one."""
    if not tuning.common or tuning.gnss_bias == 0.0:
        return []
    C = np.eye(2, 3) * tuning.gnss_bias**2
    return [Shared(one="ugv", one_block="gnss_bias", two="uav", two_block="gnss_bias", covariance=C)]


def _belief(seed: int, robot: str, motion: Motion, spread: dict[str, float]) -> Gaussian:
    """Truth at the start, wrong by what place, heading and tilt may be wrong by."""
    truth, layout = tours().of(robot), LAYOUTS[motion]
    x, sd = layout.zeros(), np.zeros(layout.error_size)
    for name, value in spread.items():
        sd[layout.error(name)] = value
    R = quats_to_matrices(truth.q[:1])[0]
    x[layout.state("position")] = truth.p[0, : 2 if motion is Motion.DRIFTING else 3]
    x[layout.state("heading" if motion is Motion.DRIFTING else "yaw")] = np.arctan2(R[1, 0], R[0, 0])
    wrong = generator(seed, robot, "start").standard_normal(layout.error_size) * sd
    for name in ("position", "heading", "yaw", "pitch", "roll"):
        if name in layout:
            x[layout.state(name)] += wrong[layout.error(name)]
    return Gaussian(x, np.diag(sd**2), layout)
