"""What sensors see of a robot: each written once, against the kinematic view that every process model fills.

`evaluate` compares a record with the prediction and gives the Jacobian; `simulate` makes the record that fits exactly.
Both choose by the code of the sensor. A sensor's dataclass holds its parameters in words, `SPECS` what is common to
all of its kind.
"""

from outrider.models.sensors.as_printed import (
    PrintedAccelerometer,
    PrintedGnssPosition,
    PrintedGnssVelocityAir,
    PrintedGnssVelocityGround,
    PrintedGyro,
    PrintedOdometry,
)
from outrider.models.sensors.attitude import Attitude, Heading, YawOfAttitude
from outrider.models.sensors.beacons import Bearing, Range, RangeBearing
from outrider.models.sensors.dispatch import evaluate, simulate
from outrider.models.sensors.gnss import GnssPosition, GnssVelocity, Position
from outrider.models.sensors.ground import Baro, Flow, RangeFinder
from outrider.models.sensors.inertial import Gyro, SpecificForce, ZeroRate
from outrider.models.sensors.layout import LEVER, MAX_ROWS, MOUNT, OWN, STRAIGHT, THETA_SIZE, Mount, Sensor, SensorModel
from outrider.models.sensors.magnetic import MagHeading, MagVector
from outrider.models.sensors.pose import MapPose, Pose, RelativePose
from outrider.models.sensors.registry import SPECS, Spec, row_names
from outrider.models.sensors.velocity import Airspeed, BodyVelocity, Nonholonomic, ZeroVelocity
from outrider.models.sensors.wheels import (
    Ackermann,
    Twist,
    WheelsDifferential,
    WheelsMecanum,
)

__all__ = [
    "LEVER",
    "MAX_ROWS",
    "MOUNT",
    "OWN",
    "SPECS",
    "STRAIGHT",
    "THETA_SIZE",
    "Ackermann",
    "Airspeed",
    "Attitude",
    "Baro",
    "Bearing",
    "BodyVelocity",
    "Flow",
    "GnssPosition",
    "GnssVelocity",
    "Gyro",
    "Heading",
    "MagHeading",
    "MagVector",
    "MapPose",
    "Mount",
    "Nonholonomic",
    "Pose",
    "Position",
    "PrintedAccelerometer",
    "PrintedGnssPosition",
    "PrintedGnssVelocityAir",
    "PrintedGnssVelocityGround",
    "PrintedGyro",
    "PrintedOdometry",
    "Range",
    "RangeBearing",
    "RangeFinder",
    "RelativePose",
    "Sensor",
    "SensorModel",
    "Spec",
    "SpecificForce",
    "Twist",
    "WheelsDifferential",
    "WheelsMecanum",
    "YawOfAttitude",
    "ZeroRate",
    "ZeroVelocity",
    "evaluate",
    "row_names",
    "simulate",
]
