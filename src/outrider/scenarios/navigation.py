"""A navigator for a robot, from the sensors it carries and where it was put down."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final, cast

import numpy as np

from outrider.core.attitudes import quats_to_matrices, rpy_to_quats
from outrider.data import Fix, Gaussian
from outrider.errors import ConfigError
from outrider.filters.channels import Channel
from outrider.filters.engine import Filter
from outrider.models.motion import LAYOUTS, Motion, PlanarRobot, StrapdownIns
from outrider.models.sensors import (
    Baro,
    BodyVelocity,
    GnssPosition,
    GnssVelocity,
    Gyro,
    Heading,
    Mount,
    Pose,
    Sensor,
    SensorModel,
    Twist,
)
from outrider.models.vehicles import Differential, Mecanum, Vehicle
from outrider.sim import sensors
from outrider.sim.world import World
from outrider.team import Navigator
from outrider.team.odometry import Odometry
from outrider.typing import Floats

Put = tuple[float, float, float, float]  # east, north, up [m], heading [rad]

# Sensor of the simulator -> its model, and the rows that a robot on the ground and one in the air use.
USES: Final[dict[type[Any], tuple[type[Any], str, str]]] = {
    sensors.Gnss: (GnssPosition, "110", "111"),
    sensors.GnssReceiver: (GnssPosition, "110", "111"),
    sensors.GnssVelocity: (GnssVelocity, "110", "111"),
    sensors.Imu: (Gyro, "001", ""),
    sensors.BodyTwist: (Twist, "110001", "111000"),
    sensors.StereoVelocity: (BodyVelocity, "110", "111"),
    sensors.ObjectPose: (Pose, "110001", "111111"),
    sensors.Heading: (Heading, "1", "1"),
    sensors.Baro: (Baro, "", "1"),
}
PRECISE: Final = frozenset({Fix.FIXED.value})
WHEEL_FLOOR: Final = (0.02, 0.03, 0.1, 0.1, 0.1, 0.001)  # m/s, rad/s: no wheel is believed below
RECKONED: Final = {"heading_walk": 0.003, "position_walk": 0.03}  # rad and m per sqrt(m), of wheels on firm ground
START: Final = {  # standard deviations of what the start does not tell
    "position": 0.3,
    "heading": 0.05,
    "attitude": 0.05,
    "velocity": 0.1,
    "yaw_rate": 0.1,
    "wind": 1e-3,
    "range_bias": 1e-3,
}


def navigator(
    carried: Sequence[object],
    put: Put,
    start: int,
    world: World,
    *,
    flies: bool,
    robot: str = "robot",
    base: Vehicle | None = None,
) -> Navigator:
    """An online filter over what the robot carries: planar on the ground, strapdown in the air.

    Its prior is the place where the robot was put down, `put`, to 0.3 m and 3 degrees. base : the vehicle, by whose
    wheels encoders are read where nothing reckons a twist. Raises ConfigError without a source of position, or without
    an IMU in the air.
    """
    motion = Motion.STRAPDOWN if flies else Motion.PLANAR
    channels = channels_of(carried, motion, base)
    if not any(c.reset[1] for c in channels):
        raise ConfigError("cannot tell where it is", fix="give it a gnss, gnss_receiver or object_pose")
    if flies and not any(c.sensor is None for c in channels):
        raise ConfigError("cannot navigate in the air without an IMU", fix="give it an imu")
    f, prior = filter_of(channels, carried, motion, put, world, base)
    return Navigator(f, prior, start, world.datum, robot, odometry_of(carried, base))


def filter_of(
    channels: tuple[Channel, ...],
    carried: Sequence[object],
    motion: Motion,
    put: Put,
    world: World,
    base: Vehicle | None = None,
) -> tuple[Filter, Gaussian]:
    """The filter over some channels, and its prior."""
    slow = max((_slow_error(s) for s in carried), default=0.0)
    flies = motion is Motion.STRAPDOWN
    model = StrapdownIns(gnss_bias=slow, gnss_bias_up=1.5 * slow, gravity=world.gravity) if flies else None
    theta = model.theta() if model is not None else PlanarRobot(gnss_bias=slow, **_rolls(base)).theta()
    coasting = replace(model, gyro_noise=0.3, accel_noise=2.0).theta() if model is not None else theta
    return Filter(motion=motion, theta=theta, coasting=coasting, channels=channels), _prior(motion, put, slow)


def channels_of(carried: Sequence[object], motion: Motion, base: Vehicle | None = None) -> tuple[Channel, ...]:
    """How each sensor's stream becomes measurements; those of no use have none."""
    wheels = odometry_of(carried, base) if motion is Motion.PLANAR else None
    out: list[Channel] = []
    for sensor in cast("Sequence[Any]", carried):
        made = _channel(sensor, motion)
        bare = _bare(sensor)
        if made is not None and len(_solutions(bare)) > 1:
            # a fixed solution has no error that stays for minutes: it is what tells the others' error
            precise = replace(made, name=f"{made.name} (fixed)", sensor=Sensor.POSITION, fixes=frozenset(PRECISE))
            out += [replace(made, fixes=frozenset(f.value for f in Fix) - PRECISE), precise]
        elif made is not None:
            out.append(made)
        elif wheels is not None and sensor.name == wheels.name:
            out.append(_rolling(wheels.name))
    return tuple(out)


def mount_matrix(sensor: object) -> Floats:
    """(4, 4) body from sensor, by its `lever` and `mount`."""
    T = np.eye(4)
    T[:3, 3] = getattr(sensor, "lever", (0.0, 0.0, 0.0))
    T[:3, :3] = quats_to_matrices(np.array([getattr(sensor, "mount", (0.0, 0.0, 0.0, 1.0))]))[0]
    return T


def _channel(sensor: Any, motion: Motion) -> Channel | None:
    """How a sensor's stream becomes measurements; None if it is of no use."""
    bare = _bare(sensor)
    model_of, ground, air = USES.get(type(bare), (None, "", ""))
    rows = ground if motion is Motion.PLANAR else air
    drives = model_of is Gyro and motion is Motion.STRAPDOWN
    if model_of is None or not (rows or drives):
        return None
    mount = Mount.from_matrix(mount_matrix(bare))
    model: SensorModel = model_of(mount=mount)
    theta, turn = model.theta(), np.eye(3).ravel()
    if model_of is Gyro:  # records of an IMU are turned into body axes first
        theta, turn = Mount(lever_arm=mount.lever_arm).theta(), np.array(mount.rotation)
    width = 6 if drives else model.sigmas().size
    absolute = model_of in (GnssPosition, Pose)
    return Channel(
        name=sensor.name, stream=sensor.name, sensor=None if drives else model.code, theta=theta, mount=turn,
        sigma=np.ones(width) if drives else model.sigmas(), floor=np.zeros(width),
        rows=np.array([c == "1" for c in (rows if not drives else "111111")]),
        reset=(LAYOUTS[motion].error("position").start, 2 if motion is Motion.PLANAR else 3) if absolute else (0, 0),
    )  # fmt: skip


def odometry_of(carried: Sequence[object], base: Vehicle | None) -> Odometry | None:
    """How the encoders of a base tell its motion; None where something else does, or nothing."""
    encoders = [s for s in map(_bare, carried) if isinstance(s, sensors.WheelEncoders)]
    if not encoders or any(isinstance(_bare(s), sensors.BodyTwist) for s in carried):
        return None
    n, name = encoders[0].wheels, encoders[0].name
    if isinstance(base, Mecanum) and n == len(base.wheels):
        return Odometry(name=name, inverse=base.kinematics.inverse)
    if isinstance(base, Differential) and n >= 2:
        return Odometry(name=name, inverse=base.inverse)
    return None


def _rolling(name: str) -> Channel:
    """Speeds and, at rest, the yaw rate as `Odometry` makes them of rim speeds."""
    return Channel(
        name=name, stream=name, sensor=Sensor.TWIST, theta=Mount().theta(), sigma=Twist().sigmas(),
        floor=np.array(WHEEL_FLOOR), rows=np.array([c == "1" for c in "110001"]),
    )  # fmt: skip


def _bare(sensor: Any) -> Any:
    """A sensor without what is wrong with it."""
    while hasattr(sensor, "sensor"):
        sensor = sensor.sensor
    return sensor


def _solutions(sensor: Any) -> set[Fix]:
    """The solution types that a receiver may have."""
    if not isinstance(sensor, sensors.GnssReceiver):
        return set()
    return {*sensor.dwell_s, *(s.fix for s in sensor.spells if s.fix is not None)} - {Fix.NONE}


def _slow_error(sensor: Any) -> float:
    """The part of a receiver's error that stays for minutes [m], at the worst of its solution types."""
    bare = _bare(sensor)
    return max((bare.qualities[fix].slow for fix in _solutions(bare)), default=0.0)


def _rolls(base: Vehicle | None) -> dict[str, float]:
    """How surely a base with a gyro is reckoned; one on mecanum wheels goes sideways as it is told."""
    if isinstance(base, Mecanum):
        return {**RECKONED, "lateral": 0.5, "lateral_time": 2.0}
    return dict(RECKONED) if isinstance(base, Differential) else {}


def _prior(motion: Motion, put: Put, slow: float) -> Gaussian:
    layout = LAYOUTS[motion]
    x, sd = layout.zeros(), np.full(layout.error_size, 1e-3)
    width = 2 if motion is Motion.PLANAR else 3
    x[layout.state("position")] = put[:width]
    if motion is Motion.PLANAR:
        x[layout.state("heading")] = put[3]
        own = PlanarRobot()
        spread = {"gyro_bias": own.initial_gyro_bias, "wheel_scale": own.initial_scale}
    else:
        x[layout.state("attitude")] = rpy_to_quats(np.array([[0.0, 0.0, put[3]]]))[0]
        ins = StrapdownIns()
        spread = {"gyro_bias": ins.initial_gyro_bias, "accel_bias": ins.initial_accel_bias, "baro_bias": 1000.0}
    for name, value in {**START, **spread, "gnss_bias": max(slow, 1e-3)}.items():
        if name in layout:
            sd[layout.error(name)] = value
    return Gaussian(x, np.diag(sd**2), layout)
