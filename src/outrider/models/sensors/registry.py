"""All sensors by code: what each reads, what its rows are called, which of them are angles."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, TypeAlias, final

from outrider.data.events import Kind
from outrider.models.sensors import (
    as_printed,
    attitude,
    beacons,
    gnss,
    ground,
    inertial,
    magnetic,
    pose,
    velocity,
    wheels,
)
from outrider.models.sensors.layout import MAX_ROWS, Sensor, SensorModel
from outrider.typing import Floats

Kernel: TypeAlias = Callable[[Floats, Floats, Floats, Floats, Floats], int]


@final
@dataclass(frozen=True, slots=True)
class Spec:
    """What the engine, the simulator and the report need to know of a sensor.

    names : of each row of the innovation (of mecanum wheels, as many as there can be)
    unit : of the rows, or one for each, with spaces between
    kinds : records that it can read; none for a constraint
    columns : of such a record that it reads (a kernel gets the whole record, but of an IMU only these)
    variances : per row, the column of `Stream.var` that states its variance; -1 where none does
    angles : rows that are single angles, wrapped already; the rows of a rotation vector are not among them
    usual : an instance with usual values
    exact : whether its Jacobian is the derivative of what it predicts; not so of what a paper prints wrongly
    """

    kernel: Kernel
    usual: SensorModel
    names: tuple[str, ...]
    unit: str
    kinds: tuple[Kind, ...]
    columns: tuple[int, ...]
    variances: tuple[int, ...]
    angles: tuple[int, ...] = ()
    exact: bool = True

    @property
    def sensor(self) -> Sensor:
        """The sensor's code."""
        return self.usual.code

    @property
    def rows(self) -> int:
        """m, the length of the innovation (of mecanum wheels, the greatest)."""
        return len(self.names)

    @property
    def units(self) -> tuple[str, ...]:
        """The unit of each row."""
        units = tuple(self.unit.split())
        return units if len(units) == self.rows else units * self.rows


_XYZ = ("x", "y", "z")
_ENU = ("east", "north", "up")
_TURNS = ("roll", "pitch", "yaw")
_WHEELS = tuple(f"wheel {i + 1}" for i in range(MAX_ROWS))
_POSE_UNIT = "m m m rad rad rad"
_POSE_AXES = (*_XYZ, *_TURNS)

_1, _2, _3, _6, _8 = ((*range(m),) for m in (1, 2, 3, 6, MAX_ROWS))
_ACCEL = (3, 4, 5)
_NONE_1, _NONE_2, _NONE_3 = ((-1,) * m for m in (1, 2, 3))

_SPECS = (
    Spec(gnss.gnss_position, gnss.GnssPosition(), _ENU, "m", (Kind.GNSS,), _3, _3),
    Spec(gnss.gnss_velocity, gnss.GnssVelocity(), _ENU, "m/s", (Kind.GNSS_VELOCITY,), _3, _3),
    Spec(gnss.position, gnss.Position(), _ENU, "m", (Kind.POSITION, Kind.POSE, Kind.ESTIMATE), _3, _3),
    Spec(inertial.gyro, inertial.Gyro(), _XYZ, "rad/s", (Kind.IMU,), _3, _3),
    Spec(inertial.zero_rate, inertial.ZeroRate(), _XYZ, "rad/s", (Kind.IMU,), _3, _3),
    Spec(inertial.specific_force, inertial.SpecificForce(), _XYZ, "m/s^2", (Kind.IMU,), _ACCEL, _ACCEL),
    Spec(
        wheels.twist,
        wheels.Twist(),
        ("v_x", "v_y", "v_z", "w_x", "w_y", "w_z"),
        "m/s m/s m/s rad/s rad/s rad/s",
        (Kind.TWIST,),
        _6,
        _6,
    ),
    Spec(
        wheels.wheels_differential,
        wheels.WheelsDifferential(track=0.55),
        ("left", "right"),
        "m/s",
        (Kind.WHEELS,),
        _2,
        _2,
    ),
    Spec(wheels.wheels_mecanum, wheels.WheelsMecanum.rectangle(0.3, 0.25), _WHEELS, "m/s", (Kind.WHEELS,), _8, _8),
    # The sigma of a steering angle is not that of the yaw rate it stands for.
    Spec(
        wheels.ackermann,
        wheels.Ackermann(wheel_base=2.0),
        ("speed", "yaw rate"),
        "m/s rad/s",
        (Kind.ACKERMANN,),
        _2,
        (0, -1),
    ),
    Spec(velocity.nonholonomic, velocity.Nonholonomic(), ("left", "up"), "m/s", (), (), _NONE_2),
    Spec(velocity.zero_velocity, velocity.ZeroVelocity(), _ENU, "m/s", (), (), _NONE_3),
    Spec(
        velocity.body_velocity,
        velocity.BodyVelocity(),
        _XYZ,
        "m/s",
        (Kind.BODY_VELOCITY, Kind.TWIST),
        _3,
        _3,
    ),
    Spec(velocity.airspeed, velocity.Airspeed(), ("airspeed",), "m/s", (), _1, _1),
    Spec(ground.baro, ground.Baro(), ("up",), "m", (Kind.BARO,), _1, _1),
    Spec(ground.range_finder, ground.RangeFinder(), ("distance",), "m", (Kind.RANGE_FINDER,), _1, _1),
    Spec(ground.flow, ground.Flow(), ("flow_x", "flow_y"), "rad/s", (Kind.FLOW,), _2, _2),
    # A field in unknown units has no usable variance.
    Spec(
        magnetic.mag_heading,
        magnetic.MagHeading(declination=0.0),
        ("heading",),
        "rad",
        (Kind.MAG,),
        _3,
        _NONE_1,
        angles=_1,
    ),
    Spec(magnetic.mag_vector, magnetic.MagVector(field=(0.0, 0.45, -0.89)), _XYZ, "1", (Kind.MAG,), _3, _NONE_3),
    Spec(attitude.heading, attitude.Heading(), ("heading",), "rad", (Kind.HEADING,), _1, _1, angles=_1),
    Spec(attitude.attitude, attitude.Attitude(), _TURNS, "rad", (Kind.ATTITUDE,), (0, 1, 2, 3), _3),
    Spec(
        attitude.yaw_of_attitude,
        attitude.YawOfAttitude(),
        ("yaw",),
        "rad",
        (Kind.ATTITUDE,),
        (0, 1, 2, 3),
        (2,),
        angles=_1,
    ),
    Spec(pose.pose, pose.Pose(), _POSE_AXES, _POSE_UNIT, (Kind.POSE, Kind.ESTIMATE), (*range(7),), _6),
    Spec(pose.relative_pose, pose.RelativePose(), _POSE_AXES, _POSE_UNIT, (Kind.RELATIVE_POSE,), (*range(1, 8),), _6),
    Spec(
        beacons.beacon_range,
        beacons.Range(beacon=(0.0, 0.0, 0.0)),
        ("range",),
        "m",
        (Kind.RANGE, Kind.RANGE_BEARING),
        (1,),
        (1,),
    ),
    Spec(
        beacons.range_bearing,
        beacons.RangeBearing(beacon=(0.0, 0.0, 0.0)),
        ("range", "bearing"),
        "m rad",
        (Kind.RANGE_BEARING,),
        (1, 2),
        (1, 2),
        angles=(1,),
    ),
    Spec(
        beacons.bearing, beacons.Bearing(beacon=(0.0, 0.0, 0.0)), ("bearing",), "rad", (Kind.RANGE_BEARING,), (2,),
        (2,), angles=_1,
    ),
    Spec(
        pose.map_pose, pose.MapPose(), ("x", "y", "yaw"), "m m rad", (Kind.POSE,), (*range(7),), (0, 1, 5),
        angles=(2,),
    ),
    Spec(
        as_printed.odometry, as_printed.PrintedOdometry(), ("v_x", "v_y", "v_z", "w_x", "w_y", "w_z"),
        "m/s m/s m/s rad/s rad/s rad/s", (Kind.TWIST,), _6, _6, exact=False,
    ),
    Spec(as_printed.gnss_position, as_printed.PrintedGnssPosition(), _ENU, "m", (Kind.GNSS,), _3, _3, exact=False),
    Spec(
        as_printed.gnss_velocity_ground, as_printed.PrintedGnssVelocityGround(), _ENU, "m/s", (Kind.GNSS_VELOCITY,),
        _3, _3, exact=False,
    ),
    Spec(
        as_printed.gnss_velocity_air, as_printed.PrintedGnssVelocityAir(), _ENU, "m/s", (Kind.GNSS_VELOCITY,), _3, _3,
        exact=False,
    ),
    Spec(as_printed.gyro, as_printed.PrintedGyro(), _XYZ, "rad/s", (Kind.IMU,), _3, _3, exact=False),
    Spec(
        as_printed.accelerometer, as_printed.PrintedAccelerometer(), _XYZ, "m/s^2", (Kind.IMU,), _ACCEL, _ACCEL,
        exact=False,
    ),
)  # fmt: skip

SPECS: Final[Mapping[Sensor, Spec]] = MappingProxyType({spec.sensor: spec for spec in _SPECS})


def row_names(model: SensorModel) -> tuple[str, ...]:
    """What the rows of this very sensor are called, as many as its innovation has."""
    return SPECS[model.code].names[: model.sigmas().size]
