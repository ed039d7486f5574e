"""What swarms are to do: swap places on a circle, meet head-on, cross, pass a doorway, follow in column."""

import numpy as np
from numpy.typing import NDArray

from outrider.scenarios.swarm import GOALS, Task
from outrider.typing import Floats

UP = 30.0  # m, height of flight
GROUP = 8  # drones that go through a door one after the other before those of the other side
SLOT_S, CLEAR_S = 4.5, 8.0  # s for each of them, and until the other side may


def _to(start: NDArray[np.floating], goal: NDArray[np.floating], seconds: float) -> Task:
    n = len(start)
    up = np.full((n, 1), UP)
    return Task(start=np.hstack([start, up]).astype(np.float64), kind=np.full(n, GOALS), goals=np.hstack([goal, up]).astype(np.float64)[:, None],
                seconds=seconds)  # fmt: skip


def circle(n: int, apart: float = 5.0) -> Task:
    """Everybody to the opposite place on a circle, through its middle; neighbours on it are `apart` [m]."""
    a = 2.0 * np.pi * np.arange(n) / n
    radius = max(apart * n / (2.0 * np.pi), 12.0)
    p = radius * np.column_stack([np.cos(a), np.sin(a)])
    return _to(p, -p, 120.0 + 4.0 * radius)


def head_on(n: int, apart: float = 5.0) -> Task:
    """Two ranks that fly through each other, everybody exactly towards another: a mirror image."""
    half = n // 2
    y = apart * (np.arange(half) - 0.5 * (half - 1))
    left, right = np.column_stack([np.full(half, -25.0), y]), np.column_stack([np.full(half, 25.0), y])
    return _to(np.vstack([left, right]), np.vstack([right, left]), 180.0)


def crossing(n: int, apart: float = 5.0) -> Task:
    """Two blocks that cross at a right angle, in the same place at the same time."""
    half = n // 2
    side = int(np.ceil(np.sqrt(half)))
    k = np.arange(half)
    block = apart * np.column_stack([k % side, k // side]) - 0.5 * apart * (side - 1)
    far = 20.0 + 0.5 * apart * side
    east, north = np.array([far, 0.0]), np.array([0.0, far])
    return _to(np.vstack([block - east, block - north]), np.vstack([block + east, block + north]), 240.0)


def doorway(n: int, apart: float = 5.0, width: float = 4.0) -> Task:
    """Half from either side through a door in a wall that is wide enough for one.

    Everybody has a slot, by the clock that all have from their receivers, `GROUP` from one side and then from the
    other; who misses it waits for the next round. Who waits keeps to the right of who comes out.
    """
    half = n // 2
    side = int(np.ceil(np.sqrt(half)))
    k = np.arange(half)
    block = np.column_stack([-14.0 - apart * (k % side), -8.0 - apart * (k // side)])
    wait = np.array([-7.0, -4.0])
    block = block[np.argsort(np.hypot(*(block - wait).T), kind="stable")]
    way = [wait, [-3.0, 0.0], [3.0, 0.0], [7.0, -4.0]]
    east = np.stack([block, *(np.tile(p, (half, 1)) for p in way), block[::-1] * [-1.0, 1.0]], axis=1)
    goals: Floats = np.concatenate([east, -east]).astype(
        np.float64
    )  # who is nearest to the door goes farthest behind it
    open_s = GROUP * SLOT_S
    period = 2.0 * (open_s + CLEAR_S)
    begin = 10.0 + float(np.hypot(*(block[-1] - wait))) / 3.0
    turn = begin + period * (k // GROUP)
    slot = turn + SLOT_S * (k % GROUP) - np.hypot(*(block - wait).T) / 3.0 - 3.0
    release = np.zeros((n, goals.shape[1]))
    release[:, 0] = np.concatenate([slot, slot + 0.5 * period])
    release[:, 1] = np.concatenate([turn, turn + 0.5 * period]) + np.tile(SLOT_S * (k % GROUP), 2)
    up = np.full((*goals.shape[:2], 1), UP)
    walls = np.array([[0.0, 0.5 * width, 0.0, 60.0], [0.0, -60.0, 0.0, -0.5 * width]])
    return Task(
        start=np.hstack([goals[:, 0], up[:, 0]]), kind=np.full(n, GOALS), goals=np.concatenate([goals, up], axis=2),
        release=release, walls=walls, seconds=float(turn[-1]) + 5.0 * period, period_s=period, window_s=SLOT_S,
    )  # fmt: skip
