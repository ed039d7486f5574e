"""Best-first search over the cells of a costmap: exact, with buckets for a queue, in memory that is used again.

Costs are integers, so a sum of them is exact in whatever order: a step over free ground costs `UNIT` straight and
`SLANT` diagonally, a fraction out of the series that closes in on sqrt 2, right to 17 digits.

A *label* is what it costs to come to a cell, plus 1 while the cell waits to be expanded, less 2^62: memory full of
zeros is a map on which nothing has been reached, and a step into a blocked cell never leads below zero.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from outrider._kernel import inlined, kernel
from outrider.typing import Ints

UNIT: Final = 4 * 225058681
SLANT: Final = 4 * 318281039
BLOCKED: Final = 1 << 62
ENDED, PAUSED, FULL = 0, 1, 2  # why a search came back
AT, EXPANDED, SOUTH, NORTH, BEST, STATES = range(6)  # what it keeps between calls

# Directions go round counter-clockwise from east, even ones are straight; three turns, so that d - 3 is d + 5.
BY_ROW: Final = np.array([0, 1, 1, 1, 0, -1, -1, -1] * 3)
BY_COL: Final = np.array([1, 1, 0, -1, -1, -1, 0, 1] * 3)


@inlined
def next_bucket(counts: Ints, at: int) -> int:
    """The first bucket from `at` on that holds anything; `at` plus their number if none does."""
    mask, last = counts.size - 1, at + counts.size
    while at < last and counts[at & mask] == 0:
        at += 1
    return at


@inlined
def fullest(counts: Ints) -> int:
    """How much the fullest bucket holds."""
    most = 0
    for b in range(counts.size):
        most = max(most, int(counts[b]))
    return most


@inlined
def estimate(rows: int, cols: int, straight: int, slant: int) -> int:
    """Least cost of so many rows and columns: `straight` per cell of the longer side, `slant` of the shorter."""
    rows, cols = abs(rows), abs(cols)
    return straight * max(rows, cols) + slant * min(rows, cols)


@inlined
def _note(found: Ints, k: int, labels: Ints, n: int, d: int, label: int) -> int:
    """Write down a way to cell n in direction d: it counts, if it is cheaper than what is known."""
    found[k], found[k + 8] = d, label
    return k + int(label < labels[n])


@kernel
def search(
    cells: NDArray[np.uint8],
    width: int,
    straights: Ints,
    diagonals: Ints,
    around: Ints,
    labels: Ints,
    queue: Ints,
    counts: Ints,
    state: Ints,
    found: Ints,
    goal_row: int,
    goal_col: int,
    straight: int,
    slant: int,
    shift: int,
    forbid: int,
    allowed: NDArray[np.uint8],
    every: int,
    limit: int,
) -> int:
    """A*: expand up to `limit` cells; ENDED when there is no cheaper way to the goal left to find.

    cells : (n,) with a blocked border, `width` to a row;  straights, diagonals : (256,) of half a step in a cell of
    each cost, `BLOCKED` where it is blocked;  around : (72,) what each direction adds to a cell, its row, its column;
    labels : (n,);  queue : (buckets * capacity,), buckets a power of 2;  counts : (buckets,);  state : (STATES,);
    found : (16,) scratch;  straight, slant : of the estimate, 0 for Dijkstra's search;  shift : log2 of the width of a
    bucket;  forbid : `BLOCKED` if diagonal steps may not cut corners, else 0;  allowed : (n,) or (1,) bits of the
    directions in which cell c & `every` may be left.

    f = g + h never falls along a path, so buckets are emptied in order. Within one, last in is first out: a cell that
    was expanded too early is expanded again. Whoever comes from p need not look at neighbours of p on the far side:
    they are cheaper from p itself. P. Hart, N. Nilsson, B. Raphael 1968; buckets: R. Dial 1969.
    """
    at, expanded, best = int(state[AT]), int(state[EXPANDED]), int(state[BEST])
    south, north = int(state[SOUTH]), int(state[NORTH])
    capacity, mask = queue.size // counts.size, counts.size - 1
    most, end, outcome = capacity, expanded + limit, PAUSED
    while expanded < end:
        count = int(counts[at & mask])
        if count == 0:
            at = next_bucket(counts, at)
            if counts[at & mask] == 0 or (best >> shift) < at:
                outcome = ENDED
                break
            continue
        if most + 5 > capacity:
            most = fullest(counts)
            if most + 5 > capacity:
                outcome = FULL
                break
        counts[at & mask] = count - 1
        item = int(queue[(at & mask) * capacity + count - 1])
        row, col, d = item >> 32, (item >> 3) & 0x1FFFFFFF, item & 7
        c = row * width + col
        label = int(labels[c])
        if label & 1 == 0:
            continue  # expanded since
        label -= 1
        if best < 0 and label + estimate(row - goal_row, col - goal_col, straight, slant) >= best:
            continue
        if row == goal_row and col == goal_col:
            best = label
            continue
        labels[c] = label
        expanded += 1
        south, north = min(south, row), max(north, row)
        own, diagonal = label + 1 + int(straights[cells[c]]), label + 1 + int(diagonals[cells[c]])
        ahead, left, right = c + int(around[d]), c + int(around[d + 1]), c + int(around[d + 7])
        far_left, far_right = c + int(around[d + 2]), c + int(around[d + 6])
        k = 0
        if d & 1:
            a, s, r = int(diagonals[cells[ahead]]), int(straights[cells[left]]), int(straights[cells[right]])
            k = _note(found, k, labels, left, d + 1, own + s)
            k = _note(found, k, labels, right, d + 7, own + r)
            k = _note(found, k, labels, ahead, d, diagonal + (a | ((s | r) & forbid)))
            s |= int(straights[cells[c + around[d + 3]]])
            r |= int(straights[cells[c + around[d + 5]]])
            k = _note(found, k, labels, far_left, d + 2, diagonal + (int(diagonals[cells[far_left]]) | (s & forbid)))
            k = _note(found, k, labels, far_right, d + 6, diagonal + (int(diagonals[cells[far_right]]) | (r & forbid)))
        else:
            a, s, r = int(straights[cells[ahead]]), int(straights[cells[far_left]]), int(straights[cells[far_right]])
            k = _note(found, k, labels, ahead, d, own + a)
            k = _note(found, k, labels, far_left, d + 2, own + s)
            k = _note(found, k, labels, far_right, d + 6, own + r)
            k = _note(found, k, labels, left, d + 1, diagonal + (int(diagonals[cells[left]]) | ((a | s) & forbid)))
            k = _note(found, k, labels, right, d + 7, diagonal + (int(diagonals[cells[right]]) | ((a | r) & forbid)))
        if every != 0:  # what is cheaper from where this came from may not be allowed from there
            for turn in range(3, 6, 2):
                n, s = c + int(around[d + turn]), int(straights[cells[c + around[d + turn + 1]]])
                if (d + turn) & 1:
                    s |= int(straights[cells[c + around[d + turn + 7]]])
                    k = _note(found, k, labels, n, d + turn, diagonal + (int(diagonals[cells[n]]) | (s & forbid)))
                else:
                    k = _note(found, k, labels, n, d + turn, own + int(straights[cells[n]]))
        ways = int(allowed[c & every])
        for i in range(k):
            d, label = int(found[i]), int(found[i + 8])
            if ways >> (d & 7) & 1 == 0:
                continue
            r, s = row + int(around[d + 24]), col + int(around[d + 48])
            labels[r * width + s] = label
            bucket = ((label + estimate(r - goal_row, s - goal_col, straight, slant)) >> shift) & mask
            count = int(counts[bucket])
            queue[bucket * capacity + count] = r << 32 | s << 3 | (d & 7)
            counts[bucket] = count + 1
            most = max(most, count + 1)
    state[AT], state[EXPANDED], state[SOUTH], state[NORTH], state[BEST] = at, expanded, south, north, best
    return outcome


@kernel
def trace(
    cells: NDArray[np.uint8],
    width: int,
    straights: Ints,
    diagonals: Ints,
    around: Ints,
    labels: Ints,
    goal: int,
    forbid: int,
    allowed: NDArray[np.uint8],
    every: int,
    out: Ints,
) -> int:
    """Cells of a cheapest way, goal first; their number, or -1 if `out` is too short. Turns are put off."""
    c, d, k = goal, 0, 0
    while True:
        if k == out.size:
            return -1
        out[k] = c
        k += 1
        label = int(labels[c]) & ~1
        if label == -BLOCKED:
            return k
        for turn in range(8):
            n, diagonal = c + int(around[d + turn]), (d + turn) & 1
            table = diagonals if diagonal else straights
            step = int(table[cells[c]]) + int(table[cells[n]])
            if diagonal and forbid & (
                straights[cells[c + around[d + turn + 1]]] | straights[cells[c + around[d + turn + 7]]]
            ):
                continue
            if allowed[n & every] >> ((d + turn + 4) & 7) & 1 == 0:
                continue
            if step < BLOCKED and (labels[n] & ~1) + step <= label:
                c, d = n, (d + turn) & 7
                break
        else:
            return -2
