"""Worlds to run in: functions that return one."""

from outrider.sim.places.airliner import LEGS, airliner, parked_airliner
from outrider.sim.places.amr import BEND_TARGETS, LOOP_TARGETS, PASSAGE_TARGETS, amr_bend, amr_loop, amr_passage
from outrider.sim.places.city import city_block
from outrider.sim.places.field import open_field

__all__ = [
    "BEND_TARGETS", "LEGS", "LOOP_TARGETS", "PASSAGE_TARGETS", "airliner", "amr_bend", "amr_loop", "amr_passage",
    "city_block", "open_field", "parked_airliner",
]  # fmt: skip
