"""What swarms are to do: swap places on a circle, meet head-on, cross, pass a doorway, follow in column."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from outrider.scenarios.swarm import ASIDE, DT, GOALS, LEADER, MEMBER, Task
from outrider.sim.noise import generator
from outrider.typing import Floats

UP = 30.0  # m, height of flight
GROUP = 8  # drones that go through a door one after the other before those of the other side
SLOT_S, CLEAR_S = 4.5, 8.0  # s for each of them, and until the other side may


def _to(start: NDArray[np.floating], goal: NDArray[np.floating], seconds: float) -> Task:
    n = len(start)
    up = np.full((n, 1), UP)
    first, last = np.hstack([start, up]).astype(np.float64), np.hstack([goal, up]).astype(np.float64)
    return Task(start=first, kind=np.full(n, GOALS), goals=last[:, None], seconds=seconds)


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


LOOP = ((0, 0), (220, 0), (220, 50), (60, 50), (60, 100), (220, 100), (220, 150), (0, 150))  # m, bends to both sides
BEND_M = 10.0  # radius of a bend
APART_M = 8.5  # between drones of a column at the start


def column(n: int, seconds: float, seed: int, *, silent: tuple[tuple[int, float, float], ...] = ()) -> Task:
    """Behind a leader n - 1 followers on a trail with bends; it changes its speed, and stops dead, as `seed` says.

    silent : (drone, from s, to s) without a radio.
    """
    start = np.column_stack([-APART_M * np.arange(n), np.zeros(n), np.full(n, UP)]).astype(np.float64)
    back = np.arange(-np.ceil(APART_M * n) - 20.0, 0.5)
    begin = np.column_stack([back, np.zeros(len(back))])
    once = rounded(np.array(LOOP, np.float64), BEND_M)
    path = np.vstack([[[0.0, 0.0]], *[once] * (1 + int(SPEED * seconds / 1000.0))])
    dead = np.full((n, max(len(silent), 1), 2), np.inf)
    for k, (drone, since, until) in enumerate(silent):
        dead[drone, k] = since, until
    kind = np.full(n, MEMBER)
    kind[0] = LEADER
    return Task(
        start=start, kind=kind, seconds=seconds, silent=dead, path=path, pace=_paces(seconds, seed), trail=begin
    )


def crossed(n: int, seconds: float, seed: int, *, strangers: int = 5) -> Task:
    """A column through which strangers fly, from either side, one every 6 s; n drones in all."""
    base, k = column(n - strangers, seconds, seed), np.arange(strangers)
    start = np.column_stack([20.0 + 30.0 * k, np.where(k % 2, 40.0, -40.0), np.full(strangers, UP)])
    first = np.vstack([base.start, start])
    goals = np.stack([first, np.vstack([base.start, start * [1.0, -1.0, 1.0]])], axis=1)
    release = np.zeros((n, 2))
    release[-strangers:, 0] = 50.0 + 6.0 * k
    return replace(
        base, start=first, kind=np.concatenate([base.kind, np.full(strangers, GOALS)]), goals=goals, release=release,
        silent=np.full((n, 1, 2), np.inf),
    )  # fmt: skip


FORK_M, LANE_M, BRANCH_M = 60.0, 20.0, 130.0  # where the second part turns off, how far aside it flies, and how far on


def convoy(n: int, seconds: float, seed: int) -> Task:
    """A column behind a leader: one that waits above the trail joins as the last, two leave to the left, the rear half
    splits off to the right, flies a lane of its own, and merges behind the front half again; n drones in all.

    The last is the one that joins, n // 2 leads the second part, numbers 2 and n // 2 + 2 leave.
    """
    base, second = column(n - 1, seconds, seed), n // 2
    waits = np.array([[20.0, 3.0, UP + 6.0]])
    start = np.vstack([base.start, waits])
    aside = np.array([2, second + 2])
    goals, leaves = start[:, None].copy(), np.full(n, np.inf)
    goals[aside, 0] = [[70.0, 30.0, UP + 6.0], [50.0, 30.0, UP + 6.0]]  # over the heads of the others
    leaves[aside] = 35.0, 38.0
    x = np.arange(0.0, BRANCH_M + 0.5)
    bend = 0.25 * BRANCH_M
    y = -0.5 * LANE_M * (1.0 - np.cos(np.pi * np.clip(np.minimum(x, BRANCH_M - x) / bend, 0.0, 1.0)))
    return replace(
        base, start=start, kind=np.append(base.kind, ASIDE), goals=goals, leaves=leaves, second=second,
        silent=np.full((n, 1, 2), np.inf), branch=np.column_stack([FORK_M + x, y]),
    )  # fmt: skip


SPEED = 3.0  # m/s, of the leader at its most


def _paces(seconds: float, seed: int) -> Floats:
    """What the leader is told: steps between speeds, each for 15 to 60 s, and to stop dead for 10 to 25 s."""
    rng, out, now = generator(seed, "leader", "speed"), np.zeros(round(seconds / DT)), 20
    while now < len(out):
        stops = rng.random() < 0.25
        lasts = round(float(rng.uniform(10.0, 25.0) if stops else rng.uniform(15.0, 60.0)) / DT)
        out[now : now + lasts] = 0.0 if stops else rng.choice([SPEED, SPEED, 2.0, 1.2])
        now += lasts
    return out


def rounded(corners: Floats, radius: float, step: float = 1.0) -> Floats:
    """(m, 2) points of a closed way, `step` [m] apart or less, with arcs instead of corners; from after the first."""
    legs = np.roll(corners, -1, axis=0) - corners
    length = np.hypot(*legs.T)
    e = legs / length[:, None]
    out: list[Floats] = []
    for k in range(len(corners)):
        a, b = e[k - 1], e[k]
        turn = float(np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b))
        cut = radius * abs(np.tan(0.5 * turn))
        side = np.array([-a[1], a[0]]) * np.sign(turn)
        centre = corners[k] - cut * a + radius * side
        angle = np.linspace(0.0, turn, max(int(radius * abs(turn) / step), 1) + 1)[:, None]
        r = -radius * side
        arc = centre + np.cos(angle) * r + np.sin(angle) * np.array([-r[1], r[0]])
        c, d = e[(k + 1) % len(e)], e[k]
        after = radius * abs(np.tan(0.5 * np.arctan2(d[0] * c[1] - d[1] * c[0], d @ c)))
        straight = length[k] - cut - after
        out += [arc, arc[-1] + b * np.arange(step, straight - 0.5 * step, step)[:, None]]
    return np.vstack([*out[1:], out[0]])
