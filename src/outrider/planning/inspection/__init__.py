"""Inspection of a thing of known shape: what of its surface there is to see, from where, in what order, and how to get
there: points on the surface, places for a body, a tour within a length, a smooth path, pictures along it."""

from outrider.planning.inspection.pictures import Camera, Picturing, picture, seen
from outrider.planning.inspection.places import Body, Places, open_above
from outrider.planning.inspection.plan import Half, InspectionPlan, Task, halves, inspect
from outrider.planning.inspection.surface import Surface, surface
from outrider.planning.inspection.timing import Pace, TimedPath

__all__ = [
    "Body", "Camera", "Half", "InspectionPlan", "Pace", "Picturing", "Places", "Surface", "Task", "TimedPath",
    "halves", "inspect", "open_above", "picture", "seen", "surface",
]  # fmt: skip
