"""Agents: what decides for a robot, from its own records and messages alone. The same ones drive simulated and real
vehicles; none of them can see a world or its truth."""

from outrider.team.navigator import Fused, Navigator
from outrider.team.schedule import Schedule
from outrider.team.tour import Tour

__all__ = ["Fused", "Navigator", "Schedule", "Tour"]
