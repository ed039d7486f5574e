"""The whole of it: from the solids of a thing to a timed path with pictures for one robot, or for several."""

from dataclasses import dataclass
from enum import Enum
from typing import Final, final

import numpy as np
from numpy.random import default_rng

from outrider.errors import ConfigError
from outrider.planning.inspection.pictures import Camera, Picturing, picture, seen
from outrider.planning.inspection.places import Body, Places
from outrider.planning.inspection.surface import Surface, surface
from outrider.planning.inspection.timing import Pace, TimedPath, timed
from outrider.planning.inspection.tours import choose_tour
from outrider.typing import Bools, Floats

AROUND: Final = 4.0  # m beside a thing in which a robot on the ground looks for places
LOWEST: Final = 0.02  # m: what is below stands on the ground
REACH: Final = 2.5  # spacings that one leg may be long
ENOUGH: Final = 0.98  # of what can be seen
SLOWER: Final = 1.3
FITS: Final = 5  # tries to fill the time
TIMES: Final = 3  # from how many places the tour shows a point, since a camera looks one way at a time


class Half(Enum):
    """Which part of a surface is whose."""

    LOWER = "what looks down, and what is beside it"
    UPPER = "what looks up"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """Who inspects. start : (3,) m;  flies : whether it leaves the ground;  standoff : m, from the surface, of one that
    flies;  spacing : m between places;  duration_s : for the path;  lowest, highest : m, of one that flies."""

    body: Body
    camera: Camera
    pace: Pace
    start: tuple[float, float, float]
    flies: bool
    duration_s: float
    standoff: float = 2.5
    spacing: float = 1.2
    lowest: float = 1.0
    highest: float = 30.0


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class InspectionPlan:
    """path, pictures : what to do;  on : the points to be seen;  reachable : (points,) that could be seen from some
    place;  clearance : m, the least on the path, of the body."""

    task: Task
    path: TimedPath
    pictures: Picturing
    on: Surface
    reachable: Bools
    clearance: float

    @property
    def coverage(self) -> float:
        """Share of the surface that the pictures show."""
        return float(self.pictures.seen.mean())


def halves(table: Floats, density: float, seed: int = 0) -> dict[Half, Surface]:
    """The surface of solids above the ground, in the part that looks down and the one that looks up."""
    whole = surface(table, density, default_rng(seed))
    whole = whole.select(whole.p[:, 2] > LOWEST)
    down = whole.normal[:, 2] < 0.0
    return {Half.LOWER: whole.select(down), Half.UPPER: whole.select(~down)}


def inspect(table: Floats, on: Surface, task: Task) -> InspectionPlan:
    """Plan how one robot sees as much of a surface as it can in its time.

    Raises ConfigError where the start has no room, no way leads from it, or nothing can be seen.
    """
    # where it could be, and what it would see from there
    places = Places(table, task.body, _candidates(table, on, task), REACH * task.spacing)
    shown = np.zeros((len(places.p), len(on)), np.bool_)
    shown[places.open] = seen(table, task.camera, places.p[places.open], None, on)
    if not shown.any():
        fix = "more reach of the camera, or less standoff"
        raise ConfigError("nothing can be seen from any place", where="inspection", fix=fix)
    # places in order, and a path through them, no longer than there is time
    path = _within_time(table, places, shown, task)
    # where to look on the way; more slowly, as long as that shows more and there is time
    reachable: Bools = np.asarray(shown.any(axis=0), np.bool_)
    while True:
        t = np.arange(0.0, path.duration, task.camera.every_s)
        pictures = picture(table, task.camera, t, path.at(t)[0], on)
        enough = pictures.seen.sum() >= ENOUGH * reachable.sum()
        if enough or path.duration * SLOWER > task.duration_s:
            break
        path = path.slower(SLOWER)
    return InspectionPlan(
        task=task, path=path, pictures=pictures, on=on, reachable=reachable,
        clearance=float(places.clearance(path.p).min()),
    )  # fmt: skip


def _within_time(table: Floats, places: Places, shown: Bools, task: Task) -> TimedPath:
    """The path of the longest tour that ends in time; rounding makes ways shorter and bends make them slower."""
    length, best = task.pace.speed * task.duration_s, None
    for _ in range(FITS):
        tour = choose_tour(places, shown, length, times=TIMES)
        path = timed(table, task.body, places.p[places.route(tour)], task.pace)
        if path.duration <= task.duration_s and (best is None or path.duration > best.duration):
            best = path
        length *= 0.99 * task.duration_s / path.duration
    if best is None:
        what = f"{task.duration_s:g} s are too short for any tour"
        raise ConfigError(what, where="inspection", fix="give it more time, or a quicker pace")
    return best


def _candidates(table: Floats, on: Surface, task: Task) -> Floats:
    """(n, 3) the start, then places: a grid on the ground, or points off the surface."""
    start = np.array([task.start])
    if task.flies:
        slanting = on.normal + np.array([0.0, 0.0, 1.0])  # round the edges of what looks up there is a way, too
        slanting /= np.maximum(np.linalg.norm(slanting, axis=1, keepdims=True), 1e-6)
        off = np.vstack([on.p + task.standoff * d for d in (on.normal, slanting)])
        off = off[(off[:, 2] >= task.lowest) & (off[:, 2] <= task.highest)]
        off = _thinned(np.vstack([_above(start, off), off]), task.spacing)
    else:
        low, high = on.p[:, :2].min(axis=0) - AROUND, on.p[:, :2].max(axis=0) + AROUND
        low, high = np.minimum(low, start[0, :2]), np.maximum(high, start[0, :2])
        east, north = (np.arange(a, b + task.spacing, task.spacing) for a, b in zip(low, high, strict=True))
        grid = np.stack(np.meshgrid(east, north), axis=-1).reshape(-1, 2)
        off = np.column_stack([grid, np.full(len(grid), start[0, 2])])
    return np.vstack([start, off])


def _above(start: Floats, off: Floats) -> Floats:
    """(k, 3) a straight climb from the start, and on to the nearest of the places."""
    near = off[np.linalg.norm(off - start, axis=1).argmin()]
    high = np.array([start[0, 0], start[0, 1], max(near[2], start[0, 2])])
    steps = np.linspace(0.0, 1.0, 8)[1:, None]
    return np.vstack([start + steps * (high - start), high + steps * (near - high)])


def _thinned(p: Floats, spacing: float) -> Floats:
    """One point, the first, of each cube of `spacing` [m]."""
    _, first = np.unique(np.floor(p / spacing).astype(np.int64), axis=0, return_index=True)
    return p[np.sort(first)]
