"""How far ahead a local planner looks along a path from a global one."""

from dataclasses import replace
from math import hypot, inf
from typing import Final

import numpy as np

from outrider._kernel import kernel
from outrider.data.driving import Situation
from outrider.typing import Floats

SOON: Final = 1.0  # m of path that tell its direction


@kernel
def nearest_piece(path: Floats, x: float, y: float) -> int:
    """Index of the piece of a path (n, 2) that passes (x, y) most closely; a later one among equals."""
    nearest, best = 0, inf
    for k in range(path.shape[0] - 1):
        ex, ey = path[k + 1, 0] - path[k, 0], path[k + 1, 1] - path[k, 1]
        px, py = x - path[k, 0], y - path[k, 1]
        length2 = ex * ex + ey * ey
        s = min(max((px * ex + py * ey) / length2, 0.0), 1.0) if length2 > 0.0 else 0.0
        d = hypot(px - s * ex, py - s * ey)
        if d <= best:
            nearest, best = k, d
    return nearest


def remaining(path: Floats, p: Floats) -> Floats:
    """(m, 2) what is left of a path (n, 2) from the place on it that is nearest to p (2,)."""
    if len(path) < 2:
        return path
    k = nearest_piece(np.ascontiguousarray(path, np.float64), float(p[0]), float(p[1]))
    e = path[k + 1] - path[k]
    length2 = float(e @ e)
    s = float(np.clip((p - path[k]) @ e / length2, 0.0, 1.0)) if length2 > 0.0 else 0.0
    return np.vstack([path[k] + s * e, path[k + 1 :]])


def cut(path: Floats, reach: float) -> tuple[Floats, bool]:
    """(m, 2) the first `reach` metres of a path, and whether something was cut off."""
    gaps = np.hypot(*np.diff(path, axis=0).T)
    s = np.concatenate([[0.0], np.cumsum(gaps)])
    if s[-1] <= reach:
        return path, False
    k = int(np.searchsorted(s, reach, side="right"))
    share = (reach - s[k - 1]) / gaps[k - 1]
    return np.vstack([path[:k], path[k - 1] + share * (path[k] - path[k - 1])]), True


def near(now: Situation, reach: float) -> Situation:
    """The situation with the path from here on, and with a goal within reach: a place on the path, faced along it."""
    path = remaining(now.path, now.pose[:2]) if len(now.path) > 1 else np.vstack([now.pose[:2], now.goal[:2]])
    path, goes_on = cut(np.vstack([now.pose[:2], path[1:]]), reach)
    if not goes_on:
        return replace(now, path=path)
    tail = cut(path[::-1], SOON)[0]
    ahead = tail[0] - tail[-1]
    goal = np.array([*path[-1], np.arctan2(ahead[1], ahead[0])])
    return replace(now, path=path, goal=goal, through=True)
