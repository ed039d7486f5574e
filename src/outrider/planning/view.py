"""Where to stand to look at something."""

from typing import Final

import numpy as np

from outrider.data.grid import INSCRIBED, LETHAL, UNKNOWN, Costmap
from outrider.typing import Bools, Floats, Ints

RINGS: Final = 4
BEARINGS: Final = 24
SPREAD: Final = 2.0  # deviations: within 2 sigma of each coordinate's middle it is in 86 cases of 100
ENOUGH: Final = 0.8  # of what the best place sees


def viewpoints(
    costmap: Costmap, target: Floats, *, near: float, far: float, sigma: float = 0.0, calm: int = 128
) -> tuple[Floats, Ints]:
    """(k, 3) east, north [m] and heading [rad] of places from which to look at a target (2,), and (k,) how good each
    is, 0 the best.

    They stand off `near` [m] from wherever the target may be, 2 sigma [m] around where it is said to be, but no further
    than `far`, and face it. 0 sees nearly as much of that disc as the best place does, and costs at most `calm`; 1
    costs more; 2 sees less. What covers the target itself does not hide it: the line of sight counts up to `near` / 2
    before it.
    """
    spread = SPREAD * sigma
    r = np.linspace(min(near + spread, far), far, RINGS)[:, None]
    a = np.linspace(0.0, 2 * np.pi, BEARINGS, endpoint=False)[None]
    p = (target + np.stack([r * np.cos(a), r * np.sin(a)], axis=-1)).reshape(-1, 2)
    cost = _at(costmap, p)
    seen = np.where(cost < INSCRIBED, _share(costmap, p, target, spread, 0.5 * near), 0.0)
    some = seen > 0.0
    places = np.column_stack([p, np.arctan2(target[1] - p[:, 1], target[0] - p[:, 0])])[some]
    grade = np.where(seen[some] < ENOUGH * seen.max(), 2, np.where(cost[some] > calm, 1, 0))
    order = np.argsort(grade, kind="stable")
    return places[order], grade[order]


def _share(costmap: Costmap, p: Floats, target: Floats, spread: float, short: float) -> Floats:
    """(n,) of the places where the target may be, the share that is in sight of p (n, 2)."""
    around = np.linspace(0.0, 2 * np.pi, 8, endpoint=False)
    ring = np.column_stack([np.cos(around), np.sin(around)])
    spots = np.vstack([target, target + 0.5 * spread * ring, target + spread * ring]) if spread > 0.0 else target[None]
    possible = _at(costmap, spots) != LETHAL  # it is not inside of something
    possible[0] = True
    return np.mean([_sees(costmap, p, spot, short) for spot in spots[possible]], axis=0)


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
    part = np.maximum(length - short, 0.0) / np.maximum(length, 1e-9)
    share = np.linspace(0.0, 1.0, steps)[None, :, None] * part[:, None, None]
    return np.asarray((_at(costmap, p[:, None] + share * d[:, None]) != LETHAL).all(axis=1), np.bool_)
