"""The different ways around things: clusters that a robot cannot pass between, polylines left and right of them, and
winding numbers by which two ways are told apart.

h_l = (1 / 2 pi) sum_k wrap(arg(z_k+1 - o_l) - arg(z_k - o_l)): two paths with the same ends are in one class if and
only if all h_l differ by less than a half; the differences are whole numbers.
"""

from math import atan2, pi
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
    r0, c0 = max(int(low[1]), 0), max(int(low[0]), 0)
    part = field.distances[r0 : min(int(high[1]), rows), c0 : min(int(high[0]), cols)]
    if part.size == 0:
        return np.empty((0, 5))
    row, col = np.nonzero(part == 0.0)
    k = max(int(THIN / field.resolution), 1)
    _, one = np.unique(np.stack([(row + r0) // k, (col + c0) // k]), axis=1, return_index=True)
    out = np.zeros((len(one), 5))
    out[:, 0] = field.origin[0] + (col[one] + c0 + 0.5) * field.resolution
    out[:, 1] = field.origin[1] + (row[one] + r0 + 0.5) * field.resolution
    out[:, 2] = 0.5 * field.resolution
    return out


def ways(guide: Floats, discs: Floats, inscribed: float, gap: float, most: int) -> list[Floats]:
    """Polylines (k, 2) from the first to the last point of the guide, shortest detours first, each of its own class.

    Whatever blocks the way is gone around on the left and on the right.
    """
    labels = np.empty(len(discs), np.int64)
    join(discs, 2.0 * inscribed, labels)
    open_, out, signatures = [(0.0, guide, 0)], list[Floats](), list[Floats]()
    while open_ and len(out) < most:
        open_.sort(key=lambda way: way[0])
        _, path, depth = open_.pop(0)
        piece, which, _ = blocked(path, discs, inscribed)
        if which >= 0 and depth < DEPTH:
            group = discs[labels == labels[which]]
            for side in (1.0, -1.0):
                corner = _corner(path[piece], path[piece + 1], group, side, inscribed + gap)
                if corner is not None:
                    around = np.insert(path, piece + 1, corner, axis=0)
                    open_.append((float(np.hypot(*np.diff(around, axis=0).T).sum()), around, depth + 1))
        elif which < 0:
            mark = signature(path, discs)
            if not any(same(mark, other) for other in signatures):
                out.append(path)
                signatures.append(mark)
    return out


def _corner(a: Floats, b: Floats, group: Floats, side: float, reach: float) -> Floats | None:
    """(2,) beside the disc of a group that stands out furthest to one side of the line from a to b."""
    e = b - a
    length = float(np.hypot(*e))
    if length < 1e-6:
        return None
    n = side * np.array([-e[1], e[0]]) / length
    out = (group[:, :2] - a) @ n + group[:, 2]
    k = int(np.argmax(out))
    corner = group[k, :2] + n * (group[k, 2] + reach)
    return corner if np.hypot(*(corner - a)) > 1e-3 and np.hypot(*(corner - b)) > 1e-3 else None
