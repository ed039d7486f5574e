"""Vehicles: what a command makes of a body, with the limits, lags and delays of real actuators.

`Vehicle` is the interface: a frozen dataclass of parameters, one compiled `run` over any number of steps.
"""

from outrider.models.vehicles.base import (
    LEVEL,
    ROW_F,
    ROW_P,
    ROW_Q,
    ROW_SIZE,
    ROW_V,
    ROW_W,
    Vehicle,
    first_row,
)
from outrider.models.vehicles.gimbal import Gimbal, point, stabilize
from outrider.models.vehicles.multirotor import AIR_INPUTS, CLIMB, Multirotor
from outrider.models.vehicles.pad import Berth, Docking, Pad, carried
from outrider.models.vehicles.rolling import WHEEL_INPUTS, Drive
from outrider.models.vehicles.rotorcraft import Rotor, Rotorcraft, ring
from outrider.models.vehicles.steered import Steered, Steering, axle_angle
from outrider.models.vehicles.wheeled import Differential, Mecanum

__all__ = [
    "AIR_INPUTS", "CLIMB", "LEVEL", "ROW_F", "ROW_P", "ROW_Q", "ROW_SIZE", "ROW_V", "ROW_W", "WHEEL_INPUTS", "Berth",
    "Differential", "Docking", "Drive", "Gimbal", "Mecanum", "Multirotor", "Pad", "Rotor", "Rotorcraft",
    "Steered", "Steering", "Vehicle", "axle_angle", "carried", "first_row", "point", "ring", "stabilize",
]  # fmt: skip
