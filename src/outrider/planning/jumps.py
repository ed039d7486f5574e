"""Jump point search: A* over free and taken cells that looks along rows and diagonals instead of queueing cells."""

import numpy as np
from numpy.typing import NDArray

from outrider._kernel import inlined, kernel
from outrider.planning.search import (
    AT,
    BEST,
    ENDED,
    EXPANDED,
    FULL,
    NORTH,
    PAUSED,
    SLANT,
    SOUTH,
    UNIT,
    estimate,
    fullest,
    next_bucket,
)
from outrider.typing import Ints

REACH = 64  # cells: how far one look goes


@inlined
def _look(cells: NDArray[np.uint8], n: int, ahead: int, aside: int, peek: int, goal: int) -> int:
    """Steps until a cell where a way may turn: past the corner of something taken, the goal, or too far; 0 if none."""
    left, right = cells[n + peek + aside], cells[n + peek - aside]
    for k in range(1, REACH + 1):
        n += ahead
        if cells[n]:
            return 0
        past_left, past_right = left, right
        left, right = cells[n + peek + aside], cells[n + peek - aside]
        if past_left > left or past_right > right or n == goal:
            return k
    return REACH


@inlined
def _queue(
    labels: Ints,
    ways: NDArray[np.uint8],
    parents: Ints,
    queue: Ints,
    counts: Ints,
    parent: int,
    width: int,
    goal_row: int,
    goal_col: int,
    shift: int,
    most: int,
    row: int,
    col: int,
    d: int,
    label: int,
) -> int:
    """Take a way to a cell, if it is cheaper or arrives as no equal one does."""
    m, bit = row * width + col, 1 << (d & 7)
    if label > labels[m] or (label == labels[m] and ways[m] & bit):
        return most
    ways[m] = bit if label < labels[m] else ways[m] | bit
    labels[m], parents[m] = label, parent
    bucket = ((label + estimate(row - goal_row, col - goal_col, UNIT, SLANT - UNIT)) >> shift) & (counts.size - 1)
    count = int(counts[bucket]) + 1
    queue[bucket * (queue.size // counts.size) + count - 1] = row << 32 | col << 3 | (d & 7)
    counts[bucket] = count
    return max(most, count)


@kernel
def jump_search(
    cells: NDArray[np.uint8],
    width: int,
    around: Ints,
    labels: Ints,
    ways: NDArray[np.uint8],
    parents: Ints,
    queue: Ints,
    counts: Ints,
    state: Ints,
    goal_row: int,
    goal_col: int,
    shift: int,
    cutting: int,
    limit: int,
) -> int:
    """Expand up to `limit` jump points; as `search`, for cells that are free (0) or taken (1).

    cutting : 1 if diagonal steps may cut corners, else 0;  ways : (n,) bits of the directions in which a cell was
    reached at its label: ways of equal cost that arrive differently go on differently;  parents : (n,) of cells that
    have a label, by a diagonal and then a straight piece.

    D. Harabor, A. Grastien, "Online graph pruning for pathfinding on grid maps", AAAI 2011; "Improving jump point
    search", ICAPS 2014 (what a diagonal finds to its sides is queued at once).
    """
    at, expanded, best = int(state[AT]), int(state[EXPANDED]), int(state[BEST])
    south, north = int(state[SOUTH]), int(state[NORTH])
    capacity, mask, goal = queue.size // counts.size, counts.size - 1, goal_row * width + goal_col
    most, end, outcome = capacity, expanded + limit, PAUSED
    while expanded < end:
        count = int(counts[at & mask])
        if count == 0:
            at = next_bucket(counts, at)
            if counts[at & mask] == 0 or (best >> shift) < at:
                outcome = ENDED
                break
            continue
        if most + 8 * REACH > capacity:
            most = fullest(counts)
            if most + 8 * REACH > capacity:
                outcome = FULL
                break
        counts[at & mask] = count - 1
        item = int(queue[(at & mask) * capacity + count - 1])
        row, col, d = item >> 32, (item >> 3) & 0x1FFFFFFF, item & 7
        c = row * width + col
        label = int(labels[c])
        if not (ways[c] >> d) & 1:
            continue  # reached more cheaply since
        if best < 0 and label + estimate(row - goal_row, col - goal_col, UNIT, SLANT - UNIT) >= best:
            continue
        if c == goal:
            best = label
            continue
        expanded += 1
        south, north = min(south, row), max(north, row)
        # which ways are not as short without this cell: on, to the sides of a diagonal, and around corners
        first, pieces = d, 1
        if d & 1:
            first, pieces = d + 7, 3
            if cutting and cells[c + around[d + 5]] > cells[c + around[d + 6]]:
                first, pieces = d + 6, 4
            if cutting and cells[c + around[d + 3]] > cells[c + around[d + 2]]:
                pieces += 1
        elif cutting:
            if cells[c + around[d + 6]] > cells[c + around[d + 7]]:
                first, pieces = d + 7, 2
            if cells[c + around[d + 2]] > cells[c + around[d + 1]]:
                pieces += 1
        else:
            if cells[c + around[d + 5]] > cells[c + around[d + 6]]:
                first, pieces = d + 6, 3
            if cells[c + around[d + 3]] > cells[c + around[d + 2]]:
                pieces += 2
        for turn in range(first, first + pieces):
            e = turn & 7
            if e & 1 == 0:
                k = _look(cells, c, around[e], around[e + 2], around[e] * cutting, goal)
                if k:
                    most = _queue(
                        labels, ways, parents, queue, counts, c, width, goal_row, goal_col, shift, most,
                        row + k * around[e + 24], col + k * around[e + 48], e, label + k * UNIT,
                    )  # fmt: skip
                continue
            n, r, s, reached = c, row, col, label
            for run in range(1, REACH + 1):
                if cells[n + around[e]] or (not cutting and (cells[n + around[e + 1]] or cells[n + around[e + 7]])):
                    break
                n, reached = n + int(around[e]), reached + SLANT
                r, s = r + int(around[e + 24]), s + int(around[e + 48])
                for f in range(e + 1, e + 8, 6):
                    k = _look(cells, n, around[f], around[f + 2], around[f] * cutting, goal)
                    if k:
                        most = _queue(
                            labels, ways, parents, queue, counts, c, width, goal_row, goal_col, shift, most,
                            r + k * around[f + 24], s + k * around[f + 48], f, reached + k * UNIT,
                        )  # fmt: skip
                corner = cutting and (
                    cells[n + around[e + 3]] > cells[n + around[e + 2]]
                    or cells[n + around[e + 5]] > cells[n + around[e + 6]]
                )
                if corner or n == goal or run == REACH:
                    most = _queue(
                        labels, ways, parents, queue, counts, c, width, goal_row, goal_col, shift, most,
                        r, s, e, reached,
                    )  # fmt: skip
                    break
    state[AT], state[EXPANDED], state[SOUTH], state[NORTH], state[BEST] = at, expanded, south, north, best
    return outcome


@kernel
def chain(parents: Ints, goal: int, start: int, out: Ints) -> int:
    """Jump points of the way to the goal, goal first; their number, or -1 if `out` is too short."""
    c, k = goal, 0
    while k < out.size:
        out[k] = c
        k += 1
        if c == start:
            return k
        c = int(parents[c])
    return -1
