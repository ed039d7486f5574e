"""Where to stand to look at something."""

from typing import Final

import numpy as np

from outrider.data.grid import INSCRIBED, LETHAL, UNKNOWN, Costmap
from outrider.typing import Bools, Floats

RINGS: Final = 4
BEARINGS: Final = 24


def viewpoints(costmap: Costmap, target: Floats, *, near: float, far: float, calm: int = 128) -> Floats:
    """(k, 3) east, north [m] and heading [rad]: places between `near` and `far` from a target (2,) with nothing taken
    between, facing it; first those that cost at most `calm`, near ones first.

    What covers the target itself does not hide it: the line of sight counts up to `near` / 2 before it.
    """
    r = np.linspace(near, far, RINGS)[:, None]
    a = np.linspace(0.0, 2 * np.pi, BEARINGS, endpoint=False)[None]
    p = (target + np.stack([r * np.cos(a), r * np.sin(a)], axis=-1)).reshape(-1, 2)
    cost = _at(costmap, p)
    seen = (cost < INSCRIBED) & _sees(costmap, p, target, 0.5 * near)
    places = np.column_stack([p, np.arctan2(target[1] - p[:, 1], target[0] - p[:, 0])])[seen]
    return places[np.argsort(cost[seen] > calm, kind="stable")]


def _at(costmap: Costmap, p: Floats) -> Floats:
    """(...,) cost at points (..., 2); unknown outside."""
    cell = costmap.cell_of(p)
    rows, cols = costmap.cells.shape
    inside = (cell >= 0).all(axis=-1) & (cell[..., 0] < rows) & (cell[..., 1] < cols)
    row, col = np.where(inside, cell[..., 0], 0), np.where(inside, cell[..., 1], 0)
    return np.where(inside, costmap.cells[row, col], UNKNOWN).astype(np.float64)


def _sees(costmap: Costmap, p: Floats, target: Floats, short: float) -> Bools:
    """(k,) whether no taken cell lies between p (k, 2) and the target, `short` [m] before it not counted."""
    d = target - p
    length = np.hypot(d[:, 0], d[:, 1])
    steps = max(int(np.ceil(2.0 * float(length.max(initial=0.0)) / costmap.resolution)), 2)
    share = np.linspace(0.0, 1.0, steps)[None, :, None] * ((length - short) / length)[:, None, None]
    return (_at(costmap, p[:, None] + share * d[:, None]) != LETHAL).all(axis=1)
