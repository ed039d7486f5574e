"""Flying after a target by the line of sight or along Bezier curves of its trail: how far off its path.

Fixes and commands once a second; the follower answers with a lag and drifts with the wind. What counts is the distance
of the follower to the path of the target, once it has settled.  swarm2023, fig. 2
"""

from dataclasses import dataclass
from enum import Enum
from math import exp
from time import perf_counter
from typing import Final, final

import numpy as np

from outrider.guidance.bezier import Aim as Point
from outrider.guidance.bezier import aim_point, trail_curve
from outrider.guidance.los import line_of_sight
from outrider.team.trail import Aim as Curve
from outrider.team.trail import Trail
from outrider.typing import Floats

STEP: Final = 0.1  # s
SETTLED: Final = 10.0  # s, from which on errors count
KEPT: Final = 10  # fixes of a trail


class Way(Enum):
    """The flight of the target; the value is what the figure says."""

    RANDOM = "random path"
    TURN = "90-degree turn"
    WIND = "straight with wind across"


class Guide(Enum):
    """What is flown at."""

    LOS = "the target, by the line of sight"
    CURVE_2 = "points of one curve of degree 2, as printed"
    CURVE_3 = "points of one curve of degree 3, as printed"
    PIECES = "2 m ahead on smooth pieces through the trail"


@final
@dataclass(frozen=True, slots=True)
class Flown:
    """target, own : (n, 3) m;  off : (m,) m from the path, after `SETTLED`;  micros : us a command, Python, median."""

    target: Floats
    own: Floats
    off: Floats
    micros: float

    @property
    def rmse(self) -> float:
        """[m]"""
        return float(np.sqrt(np.mean(self.off**2)))


def target_path(way: Way, seed: int, *, speed: float, seconds: float) -> Floats:
    """(n, 3) m every `STEP`: straight legs, round the corners with a lag of a second."""
    n, rng = round(seconds / STEP), np.random.default_rng([seed, 0])
    course = np.full(n, np.pi / 2)
    if way is Way.TURN:
        course[n // 2 :] += np.pi / 2
    if way is Way.RANDOM:
        legs = np.cumsum(rng.uniform(-np.pi / 3, np.pi / 3, size=n // 60 + 1))
        course += legs[np.arange(n) // 60]  # a new course every six seconds
    told = speed * np.column_stack([np.cos(course), np.sin(course), np.zeros(n)])
    v, out = told[0].copy(), np.zeros((n, 3))
    for k in range(1, n):
        v += (told[k] - v) * (1.0 - exp(-STEP))
        out[k] = out[k - 1] + STEP * v
    return out + np.array([0.0, 0.0, 7.0])


def fly_trail(
    way: Way, guide: Guide, seed: int, *, speed: float = 2.0, lag_s: float = 1.0, sigma: float = 0.15,
    wind: float = 0.8, behind: float = 8.0, seconds: float = 60.0,
) -> Flown:  # fmt: skip
    """One flight at the target's speed; fixes of sigma [m] each axis; `wind` [m/s] to the east if there is any."""
    q = target_path(way, seed, speed=speed, seconds=seconds)
    rng = np.random.default_rng([seed, 1])
    drift = np.array([wind if way is Way.WIND else 0.0, 0.0, 0.0])
    curve = Trail(degree=2 if guide is Guide.CURVE_2 else 3, aim_at=Curve.POINTS)
    trail, u, v, spent = list[Floats](), np.zeros(3), np.zeros(3), list[float]()
    p = q[0] + np.array([0.0, -behind, 0.0])
    own = np.empty_like(q)
    every = round(1.0 / STEP)
    for k in range(len(q)):
        own[k] = p
        if k % every == 0:
            seen, at = q[k] + rng.normal(0.0, sigma, 3), p + rng.normal(0.0, sigma, 3)
            trail = [*trail[1 - KEPT :], seen]
            begun = perf_counter()
            u = _command(guide, curve, trail, k * STEP, at, speed)
            spent.append(perf_counter() - begun)
        v += (u + drift - v) * (1.0 - exp(-STEP / lag_s))
        p = p + STEP * v
    off = np.array([_beside(q, x) for x in own[round(SETTLED / STEP) :]])
    return Flown(q, own, off, 1e6 * float(np.median(spent)))


def _command(guide: Guide, curve: Trail, trail: list[Floats], t_s: float, p: Floats, speed: float) -> Floats:
    """(3,) m/s"""
    goal, u = trail[-1], np.empty(3)
    if guide is Guide.PIECES and len(trail) > 1:
        goal = aim_point(trail_curve(np.array(trail)), p, Point.AHEAD)
    elif guide is not Guide.LOS:
        curve.see(t_s, trail[-1])
        found = curve.aim(p)
        goal = trail[-1] if found is None else found
    line_of_sight(p, goal, speed, u)
    return u


def _beside(path: Floats, p: Floats) -> float:
    """Distance [m] of p to the polyline, on the level."""
    a, d = path[:-1, :2], np.diff(path[:, :2], axis=0)
    share = np.clip(((p[:2] - a) * d).sum(axis=1) / np.maximum((d * d).sum(axis=1), 1e-12), 0.0, 1.0)
    return float(np.linalg.norm(a + share[:, None] * d - p[:2], axis=1).min())
