"""Worlds to run in: functions that return one."""

from outrider.sim.places.airliner import LEGS, airliner, parked_airliner
from outrider.sim.places.field import open_field

__all__ = ["LEGS", "airliner", "open_field", "parked_airliner"]
