"""Who is near: points sorted into the cells of a hashed grid, and the nearest of them. Nothing is allocated."""

from dataclasses import dataclass, field
from math import floor
from typing import Final, final

import numpy as np

from outrider._kernel import inlined, kernel
from outrider.errors import ConfigError, UsageError
from outrider.typing import Floats, Ints

NOBODY: Final = -1


@inlined
def bucket(i: int, j: int, buckets: int) -> int:
    """Of the cell (i, j); several cells may share one."""
    return ((i * 73856093) ^ (j * 19349663)) % buckets


@kernel
def sort_into_cells(p: Floats, side: float, first: Ints, members: Ints) -> None:
    """first (buckets + 1), members (n) <- the points p (n, 2 or more) by the bucket of their cell, a counting sort."""
    buckets, n = first.size - 1, p.shape[0]
    first[:] = 0
    for k in range(n):
        first[bucket(floor(p[k, 0] / side), floor(p[k, 1] / side), buckets) + 1] += 1
    for b in range(buckets):
        first[b + 1] += first[b]
    for k in range(n - 1, -1, -1):  # every bucket is filled from its end, which becomes its beginning
        b = bucket(floor(p[k, 0] / side), floor(p[k, 1] / side), buckets)
        first[b + 1] -= 1
        members[first[b + 1]] = k
    for b in range(buckets):
        first[b] = first[b + 1]
    first[buckets] = n


@kernel
def nearest(
    p: Floats, side: float, first: Ints, members: Ints, k: int, reach: float, layer: float, ids: Ints, squared: Floats
) -> int:
    """How many points are within `reach` of point k, itself left out; at most ids.size, the nearest first.

    ids (m), squared (m) <- which, and their squared horizontal distances [m^2];  layer : m, points (n, 3) whose height
    differs by it or more are no neighbours, inf for none such. Of equally near ones the lower number is first.
    """
    buckets, most, found = first.size - 1, ids.size, 0
    x, y = p[k, 0], p[k, 1]
    for i in range(floor((x - reach) / side), floor((x + reach) / side) + 1):
        for j in range(floor((y - reach) / side), floor((y + reach) / side) + 1):
            b = bucket(i, j, buckets)
            for m in range(first[b], first[b + 1]):
                o = members[m]
                if o == k or floor(p[o, 0] / side) != i or floor(p[o, 1] / side) != j:
                    continue  # another cell of the same bucket
                if p.shape[1] > 2 and abs(p[o, 2] - p[k, 2]) >= layer:
                    continue
                d = (p[o, 0] - x) * (p[o, 0] - x) + (p[o, 1] - y) * (p[o, 1] - y)
                if d > reach * reach:
                    continue
                at = found
                while at > 0 and (d < squared[at - 1] or (d == squared[at - 1] and o < ids[at - 1])):
                    if at < most:
                        ids[at], squared[at] = ids[at - 1], squared[at - 1]
                    at -= 1
                if at < most:
                    ids[at], squared[at] = o, d
                    found = min(found + 1, most)
    return found


@kernel
def nearest_of_all(
    p: Floats, side: float, first: Ints, members: Ints, reach: float, layer: float, ids: Ints, squared: Floats
) -> None:
    """ids (n, m) <- the `nearest` of every point, then `NOBODY`; first, members, squared (m) : scratch."""
    sort_into_cells(p, side, first, members)
    for k in range(p.shape[0]):
        for q in range(nearest(p, side, first, members, k, reach, layer, ids[k], squared), ids.shape[1]):
            ids[k, q] = NOBODY


@final
@dataclass(frozen=True, slots=True)
class Cells:
    """Room for the grid of n points with cells of `side` [m]: about two buckets a point."""

    n: int
    side: float
    first: Ints = field(init=False, repr=False, compare=False)
    members: Ints = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not (self.n >= 0 and 0.0 < self.side < np.inf):
            raise ConfigError(f"{self.n} points in cells of {self.side} m", where="neighbours")
        object.__setattr__(self, "first", np.zeros(2 * self.n + 2, np.int64))
        object.__setattr__(self, "members", np.zeros(self.n, np.int64))

    def near(self, p: Floats, reach: float, most: int, layer: float = np.inf) -> Ints:
        """(n, most) for each of the points p (n, 2 or 3) the nearest others within `reach`, then `NOBODY`;
        `UsageError` for other shapes, or NaN."""
        if p.ndim != 2 or len(p) != self.n or p.shape[1] < 2 or not np.isfinite(p).all():
            raise UsageError(f"{p.shape} finite numbers", where="neighbours", fix=f"({self.n}, 2 or 3)")
        p = np.ascontiguousarray(p, np.float64)
        out = np.empty((self.n, most), np.int64)
        nearest_of_all(p, self.side, self.first, self.members, reach, layer, out, np.empty(most))
        return out
