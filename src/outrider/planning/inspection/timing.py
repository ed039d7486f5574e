"""From corners to a smooth path, and when to be where on it."""

from dataclasses import dataclass
from typing import Final, final

import numpy as np

from outrider._kernel import kernel
from outrider.errors import ConfigError
from outrider.planning.inspection.places import Body, room
from outrider.typing import Floats

SPACING: Final = 0.25  # m between points of a path
ROUNDS: Final = 60  # of smoothing


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Pace:
    """speed : m/s;  aside : m/s^2 in bends;  along : m/s^2 of speeding up and slowing down."""

    speed: float = 0.8
    aside: float = 0.3
    along: float = 0.4

    def __post_init__(self) -> None:
        if not min(self.speed, self.aside, self.along) > 0.0:
            raise ConfigError("a pace of nothing", where="pace", fix="speed, aside and along above zero")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class TimedPath:
    """When to be where. t : (n,) s from 0, increasing;  p : (n, 3) m;  v : (n, 3) m/s."""

    t: Floats
    p: Floats
    v: Floats

    @property
    def duration(self) -> float:
        """s."""
        return float(self.t[-1])

    @property
    def length(self) -> float:
        """m."""
        return float(np.linalg.norm(np.diff(self.p, axis=0), axis=1).sum())

    def slower(self, times: float) -> "TimedPath":
        """The same path in so many times the time."""
        return TimedPath(t=self.t * times, p=self.p, v=self.v / times)

    def at(self, t: Floats) -> tuple[Floats, Floats]:
        """Place and velocity (k, 3) at times (k,), held at both ends."""
        if t.size == 1:
            return self._at_one(float(t[0]))
        p, v = (np.column_stack([np.interp(t, self.t, column[:, c]) for c in range(3)]) for column in (self.p, self.v))
        return p, v

    def _at_one(self, t: float) -> tuple[Floats, Floats]:
        """The same of one time, as one who follows the path asks for."""
        i = int(self.t.searchsorted(t, "right")) - 1
        if not 0 <= i < self.t.size - 1:
            i = 0 if i < 0 else self.t.size - 1
            return self.p[i : i + 1].copy(), self.v[i : i + 1].copy()
        here, there = float(self.t[i]), float(self.t[i + 1])
        left, right = slice(i, i + 1), slice(i + 1, i + 2)
        p, v = ((x[right] - x[left]) / (there - here) * (t - here) + x[left] for x in (self.p, self.v))
        return p, v


@kernel
def relax(table: Floats, heights: Floats, radius: float, least: float, p: Floats, rounds: int) -> None:
    """Pull every inner point of p (n, 3) towards its neighbours' middle, as long as it keeps `least` [m] of room."""
    for _ in range(rounds):
        for i in range(1, p.shape[0] - 1):
            x = 0.5 * p[i, 0] + 0.25 * (p[i - 1, 0] + p[i + 1, 0])
            y = 0.5 * p[i, 1] + 0.25 * (p[i - 1, 1] + p[i + 1, 1])
            z = 0.5 * p[i, 2] + 0.25 * (p[i - 1, 2] + p[i + 1, 2])
            if room(table, heights, radius, x, y, z) >= least:
                p[i, 0], p[i, 1], p[i, 2] = x, y, z


def timed(table: Floats, body: Body, corners: Floats, pace: Pace) -> TimedPath:
    """Along the corners (n, 3), which keep the body's margin, rounded where there is room; from rest to rest."""
    heights, radius = body.balls
    p = resampled(corners, SPACING)
    # between two points that have room by at least half their distance more, all have
    relax(table, heights, radius, body.margin + 0.5 * SPACING, p, ROUNDS)
    p = resampled(p, SPACING)
    step = np.linalg.norm(np.diff(p, axis=0), axis=1)
    along = np.gradient(p, axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    bend = np.linalg.norm(np.gradient(along, axis=0), axis=1) / SPACING
    speed = np.minimum(pace.speed, np.sqrt(pace.aside / np.maximum(bend, 1e-9)))
    speed[[0, -1]] = 0.0
    for i in range(1, len(p)):
        speed[i] = min(speed[i], np.sqrt(speed[i - 1] ** 2 + 2.0 * pace.along * step[i - 1]))
    for i in range(len(p) - 2, -1, -1):
        speed[i] = min(speed[i], np.sqrt(speed[i + 1] ** 2 + 2.0 * pace.along * step[i]))
    t = np.concatenate([[0.0], np.cumsum(2.0 * step / np.maximum(speed[1:] + speed[:-1], 1e-3))])
    return TimedPath(t=t, p=p, v=along * speed[:, None])


def resampled(p: Floats, spacing: float) -> Floats:
    """(m, 3) points along a polyline (n, 3), about `spacing` [m] apart, first and last kept."""
    step = np.linalg.norm(np.diff(p, axis=0), axis=1)
    kept = np.concatenate([[True], step > 1e-9])
    p, s = p[kept], np.concatenate([[0.0], np.cumsum(step[step > 1e-9])])
    at = np.linspace(0.0, s[-1], max(round(float(s[-1]) / spacing), 1) + 1)
    return np.ascontiguousarray(np.column_stack([np.interp(at, s, p[:, c]) for c in range(3)]))
