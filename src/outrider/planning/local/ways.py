"""The different ways around things: clusters that a robot cannot pass between, polylines left and right of them, and
winding numbers by which two ways are told apart.

h_l = (1 / 2 pi) sum_k wrap(arg(z_k+1 - o_l) - arg(z_k - o_l)): two paths with the same ends are in one class if and
only if all h_l differ by less than a half; the differences are whole numbers.
"""

from math import atan2, hypot, inf, pi, sqrt
from typing import Final

import numpy as np

from outrider._kernel import kernel
from outrider.core.angles import wrap
from outrider.data.surroundings import DistanceField
from outrider.typing import Floats, Ints

MOST: Final = 120  # discs by which ways are told apart
DEPTH: Final = 6  # things to go around, one after the other
AISLE: Final = 4.0  # m beside the guide in which the map is looked at
THIN: Final = 0.25  # m between points that stand for the map


@kernel
def join(discs: Floats, gap: float, labels: Ints) -> int:
    """labels (n,) <- the cluster of each disc (n, 5): those with less than `gap` between them; returns how many."""
    n = discs.shape[0]
    for i in range(n):
        labels[i] = i
    for i in range(n):
        for j in range(i):
            dx, dy, reach = discs[i, 0] - discs[j, 0], discs[i, 1] - discs[j, 1], discs[i, 2] + discs[j, 2] + gap
            if labels[i] != labels[j] and dx * dx + dy * dy < reach * reach:
                old, new = max(labels[i], labels[j]), min(labels[i], labels[j])
                for k in range(n):
                    if labels[k] == old:
                        labels[k] = new
    count = 0
    for i in range(n):
        if labels[i] == i:
            for k in range(i, n):
                if labels[k] == i:
                    labels[k] = -count - 1
            count += 1
    for i in range(n):
        labels[i] = -labels[i] - 1
    return count


@kernel
def windings(path: Floats, points: Floats, out: Floats) -> None:
    """out (m,) <- turns that a path (n, >= 2) makes about each of the points (m, >= 2)."""
    for k in range(points.shape[0]):
        x, y = points[k, 0], points[k, 1]
        before, total = atan2(path[0, 1] - y, path[0, 0] - x), 0.0
        for i in range(1, path.shape[0]):
            after = atan2(path[i, 1] - y, path[i, 0] - x)
            total += wrap(after - before)
            before = after
        out[k] = total / (2.0 * pi)


@kernel
def blocked(path: Floats, discs: Floats, reach: float) -> tuple[int, int, float]:
    """The piece of a path (n, 2) that first comes nearer than `reach` to a disc; the disc, and how far along; -1."""
    for i in range(path.shape[0] - 1):
        ex, ey = path[i + 1, 0] - path[i, 0], path[i + 1, 1] - path[i, 1]
        length2 = ex * ex + ey * ey
        first, which = 2.0, -1
        for k in range(discs.shape[0]):
            px, py = discs[k, 0] - path[i, 0], discs[k, 1] - path[i, 1]
            s = min(max((px * ex + py * ey) / length2, 0.0), 1.0) if length2 > 0.0 else 0.0
            dx, dy, far = px - s * ex, py - s * ey, reach + discs[k, 2]
            if s < first and dx * dx + dy * dy < far * far:
                first, which = s, k
        if which >= 0:
            return i, which, first
    return -1, -1, 0.0


def signature(path: Floats, discs: Floats) -> Floats:
    """(m,) windings about each of the discs (m, 5)."""
    out = np.empty(len(discs))
    windings(np.ascontiguousarray(path, np.float64), discs, out)
    return out


def same(a: Floats, b: Floats) -> bool:
    """Whether two signatures, of paths with the same ends, are of one class."""
    return not len(a) or float(np.abs(a - b).max()) < 0.5


def obstacles_near(guide: Floats, discs: Floats, field: DistanceField | None, top: float) -> Floats:
    """(m, 5) discs beside a guide: obstacles where they will be when the robot gets there, and points for the map."""
    out = discs.copy()
    soon = np.minimum(np.hypot(out[:, 0] - guide[0, 0], out[:, 1] - guide[0, 1]) / top, 5.0)
    out[:, :2] += out[:, 3:] * soon[:, None]
    if field is not None:
        out = np.vstack([out, _points_of(field, guide)])
    low, high = guide.min(axis=0) - AISLE, guide.max(axis=0) + AISLE
    out = out[((out[:, :2] >= low) & (out[:, :2] <= high)).all(axis=1)]
    if len(out) > MOST:
        mid = 0.5 * (guide[0] + guide[-1])
        out = out[np.sort(np.argsort(np.hypot(out[:, 0] - mid[0], out[:, 1] - mid[1]), kind="stable")[:MOST])]
    return out


def _points_of(field: DistanceField, guide: Floats) -> Floats:
    """(m, 5) one point for every square of THIN in which cells at the edge of something are taken."""
    low = np.floor((guide.min(axis=0) - AISLE - field.origin) / field.resolution).astype(int)
    high = np.ceil((guide.max(axis=0) + AISLE - field.origin) / field.resolution).astype(int)
    rows, cols = field.distances.shape
    r0, c0, r1, c1 = max(int(low[1]), 0), max(int(low[0]), 0), min(int(high[1]), rows), min(int(high[0]), cols)
    if r0 >= r1 or c0 >= c1:
        return np.empty((0, 5))
    k = max(int(THIN / field.resolution), 1)
    cells = np.empty((((r1 - r0) // k + 2) * ((c1 - c0) // k + 2), 2), np.int64)
    row, col = cells[: first_taken(field.distances, r0, r1, c0, c1, k, cells)].T
    out = np.zeros((len(row), 5))
    out[:, 0] = field.origin[0] + (col + 0.5) * field.resolution
    out[:, 1] = field.origin[1] + (row + 0.5) * field.resolution
    out[:, 2] = 0.5 * field.resolution
    return out


@kernel
def first_taken(field: Floats, r0: int, r1: int, c0: int, c1: int, k: int, out: Ints) -> int:
    """out (m, 2) <- row and column of the first taken cell in each square of k x k cells, as far as inside the box."""
    m = 0
    for top in range(r0 // k * k, r1, k):
        for left in range(c0 // k * k, c1, k):
            found = False
            for r in range(max(top, r0), min(top + k, r1)):
                for c in range(max(left, c0), min(left + k, c1)):
                    if not found and field[r, c] == 0.0:
                        out[m, 0], out[m, 1], found = r, c, True
            m += found
    return m


def ways(guide: Floats, discs: Floats, inscribed: float, gap: float, most: int) -> list[Floats]:
    """Polylines (k, 2) from the first to the last point of the guide, shortest detours first, each of its own class.

    Whatever blocks the way is gone around on the left and on the right.
    """
    labels = np.empty(len(discs), np.int64)
    join(discs, 2.0 * inscribed, labels)
    paths = np.empty((2 ** (DEPTH + 1) - 1, len(guide) + DEPTH, 2))
    paths[0, : len(guide)] = guide
    open_, size, marks = np.empty(len(paths)), np.empty(len(paths), np.int64), np.empty((most, len(discs)))
    size[0] = len(guide)
    found = np.empty(most, np.int64)
    n = search(paths, size, open_, discs, labels, inscribed, inscribed + gap, marks, found)
    return [paths[k, : size[k]] for k in found[:n].tolist()]


@kernel
def search(
    paths: Floats, size: Ints, open_: Floats, discs: Floats, labels: Ints, inscribed: float, reach: float,
    marks: Floats, found: Ints,
) -> int:  # fmt: skip
    """found <- rows of `paths` that are free, shortest first, each of its own class; returns how many.

    paths (n, k, 2), size (n) : row 0 is where the search begins;  open_ (n) : scratch, lengths of those to look at;
    marks (m, discs) : scratch, windings of those found.
    """
    open_[0], made, n = 0.0, 1, 0
    while n < found.size:
        at, shortest = -1, inf
        for k in range(made):
            if open_[k] < shortest:
                at, shortest = k, open_[k]
        if at < 0:
            break
        open_[at] = inf
        path = paths[at, : size[at]]
        piece, which, _ = blocked(path, discs, inscribed)
        if which < 0:
            windings(path, discs, marks[n])
            fresh = True
            for k in range(n):
                apart = 0.0
                for i in range(labels.size):
                    apart = max(apart, abs(marks[k, i] - marks[n, i]))
                fresh = fresh and apart >= 0.5
            if fresh:
                found[n] = at
                n += 1
        elif size[at] < size[0] + DEPTH:
            for side in (1.0, -1.0):
                there, x, y = corner(path, piece, discs, labels, labels[which], side, reach)
                if there:
                    open_[made] = around(path, piece, x, y, paths[made])
                    size[made] = size[at] + 1
                    made += 1
    return n


@kernel
def corner(
    path: Floats, piece: int, discs: Floats, labels: Ints, label: int, side: float, reach: float
) -> tuple[bool, float, float]:
    """Beside the disc of a group that stands out furthest to one side of a piece of a path; whether that is a place of
    its own."""
    ax, ay = path[piece, 0], path[piece, 1]
    ex, ey = path[piece + 1, 0] - ax, path[piece + 1, 1] - ay
    length = sqrt(ex * ex + ey * ey)
    if length < 1e-6:
        return False, 0.0, 0.0
    nx, ny, furthest, x, y = -side * ey / length, side * ex / length, -inf, 0.0, 0.0
    for k in range(labels.size):
        if labels[k] == label:
            out = (discs[k, 0] - ax) * nx + (discs[k, 1] - ay) * ny + discs[k, 2]
            if out > furthest:
                furthest, far = out, discs[k, 2] + reach
                x, y = discs[k, 0] + nx * far, discs[k, 1] + ny * far
    apart = min(hypot(x - ax, y - ay), hypot(x - ax - ex, y - ay - ey))
    return apart > 1e-3, x, y


@kernel
def around(path: Floats, piece: int, x: float, y: float, out: Floats) -> float:
    """out <- the path with a corner after the first point of one of its pieces; its length."""
    length, n = 0.0, path.shape[0]
    for k in range(n + 1):
        if k <= piece:
            out[k, 0], out[k, 1] = path[k, 0], path[k, 1]
        elif k == piece + 1:
            out[k, 0], out[k, 1] = x, y
        else:
            out[k, 0], out[k, 1] = path[k - 1, 0], path[k - 1, 1]
        if k > 0:
            length += hypot(out[k, 0] - out[k - 1, 0], out[k, 1] - out[k - 1, 1])
    return length
