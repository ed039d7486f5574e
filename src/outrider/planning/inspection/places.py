"""Where a body may be among solids, and the ways between such places."""

from dataclasses import dataclass
from math import inf, sqrt
from typing import Final, final

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import KDTree

from outrider._kernel import kernel
from outrider.core.solids import distance
from outrider.errors import ConfigError
from outrider.typing import Bools, Floats, Ints

FINE: Final = 0.01  # m of room beyond the margin below which a way counts as blocked


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Body:
    """An upright cylinder with its origin at its foot, and the room that it keeps around itself [m]."""

    radius: float
    height: float
    margin: float = 0.3

    def __post_init__(self) -> None:
        if not (self.radius > 0.0 and self.height >= 0.0 and self.margin >= 0.0):
            raise ConfigError("a body of no size", where="body", fix="radius > 0, height >= 0, margin >= 0 m")

    @property
    def balls(self) -> tuple[Floats, float]:
        """Heights (k,) of balls of one radius whose hull holds the cylinder, no more than 2 cm wider than need be."""
        gap = 2.0 * sqrt((self.radius + 0.02) ** 2 - self.radius**2)
        n = max(int(np.ceil(self.height / gap)), 1)
        step = self.height / n
        return np.arange(n, dtype=np.float64) * step + 0.5 * step, float(np.hypot(self.radius, 0.5 * step))


@kernel
def room(table: Floats, heights: Floats, radius: float, x: float, y: float, z: float) -> float:
    """How far balls at `heights` above (x, y, z) are from the solids [m]."""
    best = inf
    for k in range(heights.size):
        d, _ = distance(table, x, y, z + heights[k])
        best = min(best, d - radius)
    return best


@kernel
def rooms(table: Floats, heights: Floats, radius: float, p: Floats, out: Floats) -> None:
    """out (n,) for p (n, 3)."""
    for i in range(p.shape[0]):
        out[i] = room(table, heights, radius, p[i, 0], p[i, 1], p[i, 2])


@kernel
def passable(
    table: Floats, heights: Floats, radius: float, margin: float, a: Floats, b: Floats, ok: Bools, fine: float
) -> None:
    """ok (n,): whether the body keeps its margin all along the segments from a (n, 3) to b (n, 3).

    The distance grows by one at most per metre, so steps as long as what is left over miss nothing; below `fine` [m]
    left over the segment counts as blocked.
    """
    for i in range(a.shape[0]):
        x, y, z = b[i, 0] - a[i, 0], b[i, 1] - a[i, 1], b[i, 2] - a[i, 2]
        length = sqrt(x * x + y * y + z * z)
        s = 0.0
        ok[i] = True
        while ok[i]:
            u = s / length if length > 0.0 else 0.0
            left = room(table, heights, radius, a[i, 0] + u * x, a[i, 1] + u * y, a[i, 2] + u * z) - margin
            ok[i] = left > fine
            if s >= length:
                break
            s = min(s + left, length)


@final
class Places:
    """Places (n, 3) for a body, which way leads from one to the other, and how long it is.

    Raises ConfigError where the first of the places, the start, has no room or no way to any other.
    """

    def __init__(self, table: Floats, body: Body, p: Floats, reach: float) -> None:
        """reach : m, of one leg;  p : those without room, or cut off from the first, are left out."""
        self._table, self._body = table, body
        self._heights, self._radius = body.balls
        free = self.clearance(p) > body.margin + 2.0 * FINE
        if not len(p) or not free[0]:
            what = f"the start has {float(self.clearance(p[:1])[0]):.2f} m of room" if len(p) else "there is no start"
            raise ConfigError(what, where="inspection", fix=f"it needs {body.margin:g} m: start elsewhere")
        self.p = np.ascontiguousarray(p[free])
        pairs = KDTree(self.p).query_pairs(reach, output_type="ndarray")
        pairs = pairs[self.passable(self.p[pairs[:, 0]], self.p[pairs[:, 1]])]
        length = np.linalg.norm(self.p[pairs[:, 0]] - self.p[pairs[:, 1]], axis=1)
        graph = csr_array((length, (pairs[:, 0], pairs[:, 1])), shape=(len(self.p),) * 2)
        self.way, before = dijkstra(graph, directed=False, return_predecessors=True)
        self._before: Ints = np.asarray(before, np.int64)
        joined = np.isfinite(self.way[0])
        if joined.sum() < 2:
            raise ConfigError("no way leads from the start", where="inspection", fix="less margin, or another start")
        self.open: Ints = np.flatnonzero(joined).astype(np.int64)

    def clearance(self, p: Floats) -> Floats:
        """(n,) m from the body at p (n, 3) to the solids."""
        out = np.zeros(len(p))
        rooms(self._table, self._heights, self._radius, np.ascontiguousarray(p), out)
        return out

    def passable(self, a: Floats, b: Floats) -> Bools:
        """(n,) whether the body keeps its margin on the straight way from a (n, 3) to b (n, 3)."""
        ok = np.zeros(len(a), np.bool_)
        ends = np.ascontiguousarray(a), np.ascontiguousarray(b)
        passable(self._table, self._heights, self._radius, self._body.margin, *ends, ok, FINE)
        return ok

    def route(self, tour: Ints) -> Ints:
        """The places on the shortest way through a tour of places."""
        out = [int(tour[0])]
        for a, b in zip(tour[:-1].tolist(), tour[1:].tolist(), strict=True):
            leg = [b]
            while leg[-1] != a:
                leg.append(int(self._before[a, leg[-1]]))
            out += leg[-2::-1]
        return np.array(out, np.int64)


def open_above(table: Floats, body: Body, p: Floats, high: float) -> Bools:
    """(n,) whether a body keeps its margin straight up from p (n, 3) to the height `high` [m]."""
    ok, (heights, radius) = np.zeros(len(p), np.bool_), body.balls
    top = np.column_stack([p[:, :2], np.full(len(p), high)])
    passable(table, heights, radius, body.margin, np.ascontiguousarray(p), np.ascontiguousarray(top), ok, FINE)
    return ok
