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
from outrider.models.vehicles.multirotor import AIR_INPUTS, Multirotor
from outrider.models.vehicles.rolling import WHEEL_INPUTS, Drive
from outrider.models.vehicles.steered import Steered, Steering, axle_angle
from outrider.models.vehicles.wheeled import Differential, Mecanum

__all__ = [
    "AIR_INPUTS", "LEVEL", "ROW_F", "ROW_P", "ROW_Q", "ROW_SIZE", "ROW_V", "ROW_W", "WHEEL_INPUTS",
    "Differential", "Drive", "Mecanum", "Multirotor", "Steered", "Steering", "Vehicle", "axle_angle", "first_row",
]  # fmt: skip
