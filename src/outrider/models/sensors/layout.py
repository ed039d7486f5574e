"""What all sensors share: their codes, the layout of theta, how a sensor is fixed to the body."""

from dataclasses import dataclass
from enum import IntEnum
from math import cos, isfinite, sin
from typing import ClassVar, Final, Protocol, Self, final

import numpy as np

from outrider.errors import ConfigError
from outrider.typing import Floats

# theta, the parameters that a kernel sees
LEVER: Final = 0  # [0:3] the sensor's place in the body frame [m]
MOUNT: Final = 3  # [3:12] R_body_sensor, row-major
OWN: Final = 12  # [12:] what the sensor itself needs; each kernel's docstring says what
THETA_SIZE: Final = 64

MAX_ROWS: Final = 8  # the longest innovation: eight wheels

# A rotation that is off by more than this is a typing error, not rounding.
_ORTHONORMAL = 1e-4


class Sensor(IntEnum):
    """Which kernel reads a record. The numbers are stored in results: never change one, only add."""

    GNSS_POSITION = 1
    GNSS_VELOCITY = 2
    GYRO = 3
    SPECIFIC_FORCE = 4
    TWIST = 5
    WHEELS_DIFFERENTIAL = 6
    WHEELS_MECANUM = 7
    ACKERMANN = 8
    NONHOLONOMIC = 9
    ZERO_VELOCITY = 10
    ZERO_RATE = 11
    BARO = 12
    MAG_HEADING = 13
    MAG_VECTOR = 14
    HEADING = 15
    ATTITUDE = 16
    YAW_OF_ATTITUDE = 17
    POSE = 18
    POSITION = 19
    BODY_VELOCITY = 20
    FLOW = 21
    RANGE_FINDER = 22
    RANGE = 23
    RANGE_BEARING = 24
    RELATIVE_POSE = 25
    AIRSPEED = 26
    BEARING = 27
    MAP_POSE = 28
    PRINTED_ODOMETRY = 29
    PRINTED_GNSS_POSITION = 30
    PRINTED_GNSS_VELOCITY_GROUND = 31
    PRINTED_GNSS_VELOCITY_AIR = 32
    PRINTED_GYRO = 33
    PRINTED_ACCELEROMETER = 34


class SensorModel(Protocol):
    """The parameters of one sensor; `outrider.models.sensors.SPECS` tells the rest by its code."""

    code: ClassVar[Sensor]

    def theta(self) -> Floats:
        """(THETA_SIZE,) parameters as the kernels read them."""
        ...

    def sigmas(self) -> Floats:
        """(m,) standard deviation of each row of the innovation, where a record states none."""
        ...


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Mount:
    """Where a sensor sits on the body and which way it looks."""

    lever_arm: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m, forward, left, up of the body origin
    rotation: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)  # R_body_sensor, row-major

    def __post_init__(self) -> None:
        if len(self.lever_arm) != 3 or not all(isfinite(a) for a in self.lever_arm):
            raise ConfigError(f"lever arm {self.lever_arm} is not three finite metres", where="mount")
        if len(self.rotation) != 9 or not all(isfinite(a) for a in self.rotation):
            raise ConfigError(f"rotation {self.rotation} is not a finite 3x3 matrix", where="mount")
        R = np.reshape(np.array(self.rotation, np.float64), (3, 3))
        if np.abs(R @ R.T - np.eye(3)).max() > _ORTHONORMAL or np.linalg.det(R) < 0.0:
            raise ConfigError("rotation is not a right-handed rotation matrix", where="mount", fix="check its rows")

    @classmethod
    def from_matrix(cls, T: Floats) -> Self:
        """From the (4, 4) body-from-sensor transform, as in `EventLog.mounts`."""
        x, y, z = (float(a) for a in T[:3, 3])
        return cls(lever_arm=(x, y, z), rotation=tuple(float(a) for a in T[:3, :3].ravel()))

    @classmethod
    def from_rpy(cls, lever_arm: tuple[float, float, float], roll: float, pitch: float, yaw: float) -> Self:
        """From angles [rad]: R_body_sensor = Rz(yaw) Ry(pitch) Rx(roll)."""
        cr, sr, cp, sp, cy, sy = cos(roll), sin(roll), cos(pitch), sin(pitch), cos(yaw), sin(yaw)
        rows = (
            (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
            (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
            (-sp, cp * sr, cp * cr),
        )
        return cls(lever_arm=lever_arm, rotation=tuple(a for row in rows for a in row))

    def theta(self, *own: float) -> Floats:
        """(THETA_SIZE,) lever arm, rotation, then the sensor's own parameters."""
        theta = np.zeros(THETA_SIZE)
        theta[LEVER:MOUNT], theta[MOUNT:OWN], theta[OWN : OWN + len(own)] = self.lever_arm, self.rotation, own
        return theta


STRAIGHT: Final = Mount()


def require_positive(model: SensorModel, **values: float) -> None:
    """Raise `ConfigError` for the first value that is not a positive number."""
    for name, value in values.items():
        if not (isfinite(value) and value > 0.0):
            raise ConfigError(f"{name} is {value}", where=model.code.name.lower(), fix="it must be positive")


def deviations(model: SensorModel, *values: float) -> Floats:
    """(m,) standard deviations, checked to be positive."""
    for value in values:
        require_positive(model, sigma=value)
    return np.array(values, np.float64)
