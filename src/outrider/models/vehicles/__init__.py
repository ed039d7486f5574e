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
from outrider.models.vehicles.rolling import Drive
from outrider.models.vehicles.wheeled import WHEEL_INPUTS, Differential, Mecanum

__all__ = [
    "AIR_INPUTS", "LEVEL", "ROW_F", "ROW_P", "ROW_Q", "ROW_SIZE", "ROW_V", "ROW_W", "WHEEL_INPUTS",
    "Differential", "Drive", "Mecanum", "Multirotor", "Vehicle", "first_row",
]  # fmt: skip
