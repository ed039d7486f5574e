"""A site as somebody drew it: shapes in metres, where robots may and may not go, and where it lies on the Earth."""

from dataclasses import dataclass, field
from enum import Enum
from math import inf, isfinite
from typing import TypeAlias, final

import numpy as np

from outrider.data.routes import RouteGraph
from outrider.data.trajectory import Datum
from outrider.errors import DataError
from outrider.typing import Bools, Floats

Holes: TypeAlias = tuple[Floats, ...]
"""Outlines (k, 2) m of what is left out."""


class ShapeKind(Enum):
    """What a drawn shape is; its value is the word for it in files."""

    ROAD = "road"
    BUILDING = "building"
    OBSTACLE = "obstacle"
    GATE = "gate"
    KEEP_OUT = "keep_out"
    SPEED = "speed"
    ONE_WAY = "one_way"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Shape:
    """A polygon, a line with a width, or a disc.

    points : (n, 2) m, site frame: the corners of an area, of which the last is not the first again; the vertices of a
    line; or the middle of a disc (n = 1);  area : whether they enclose one;  width : m, of a line or the diameter of a
    disc;  holes : of an area;  name : for the messages;  speed : m/s allowed;  heading : rad, which way one goes in a
    one-way zone;  open : whether a gate is.

    Raises DataError, with the name and the place in metres, for shapes that cross themselves and for whatever is not
    finite, not positive or too little.
    """

    kind: ShapeKind
    points: Floats
    area: bool = False
    width: float = 0.0
    holes: Holes = ()
    name: str = ""
    speed: float = inf
    heading: float = 0.0
    open: bool = False

    def __post_init__(self) -> None:
        where, p = self.title, self.points
        if p.ndim != 2 or p.shape[1:] != (2,) or not len(p):
            raise DataError(f"has points of shape {p.shape}", where=where, fix="rows of x, y [m]")
        for ring in (p, *self.holes):
            if not np.isfinite(ring).all():
                row = int(np.flatnonzero(~np.isfinite(ring).all(axis=1))[0])
                raise DataError(f"point {row + 1} is not finite", where=where)
        if self.area:
            _require_simple(p, where)
            for hole in self.holes:
                _require_simple(hole, f"a hole of {where}")
        elif not (isfinite(self.width) and self.width > 0.0):
            raise DataError(f"is {self.width:g} m wide", where=where, fix="a width of more than zero")
        if not self.speed > 0.0:
            raise DataError(f"allows {self.speed:g} m/s", where=where, fix="more than zero; or make it a keep_out zone")
        if self.kind is ShapeKind.SPEED and self.speed == inf:
            raise DataError("is a speed zone that says no speed", where=where, fix="speed: metres per second")
        if not isfinite(self.heading):
            raise DataError("has a heading that is not finite", where=where)

    @property
    def title(self) -> str:
        """What messages call it."""
        kind = self.kind.value.replace("_", "-")
        return f"{kind} '{self.name}'" if self.name else kind


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Dock:
    """A place to stop at exactly: x, y [m] and heading [rad], site frame."""

    name: str
    pose: Floats


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Anchor:
    """Where the origin of a site's frame is, and how its x axis runs: `heading` [rad], counter-clockwise from east."""

    datum: Datum
    heading: float = 0.0


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Site:
    """What was drawn, in metres of the site frame; `anchor` ties it to the Earth, if anything does."""

    name: str = "site"
    shapes: tuple[Shape, ...] = ()
    routes: RouteGraph | None = None
    docks: tuple[Dock, ...] = ()
    anchor: Anchor | None = None
    notes: tuple[str, ...] = field(default=(), compare=False)

    def of(self, *kinds: ShapeKind) -> tuple[Shape, ...]:
        """The shapes of some kinds."""
        return tuple(s for s in self.shapes if s.kind in kinds)

    @property
    def extent(self) -> tuple[Floats, Floats]:
        """(2,) m each: the south-western and north-eastern corner of everything drawn; DataError if nothing is."""
        boxes = [(s.points.min(axis=0) - 0.5 * s.width, s.points.max(axis=0) + 0.5 * s.width) for s in self.shapes]
        places = [d.pose[:2] for d in self.docks] + ([] if self.routes is None else list(self.routes.nodes))
        boxes += [(p, p) for p in places]
        if not boxes:
            raise DataError("nothing is drawn", where=self.name, fix="roads, buildings, obstacles: at least one")
        return np.min([low for low, _ in boxes], axis=0), np.max([high for _, high in boxes], axis=0)


def _require_simple(ring: Floats, where: str) -> None:
    """An outline of three corners or more that covers something and does not cross or touch itself."""
    n = len(ring)
    if n < 3:
        raise DataError(f"has {n} corners", where=where, fix="an area needs three, a line needs a width")
    a, b = ring, np.roll(ring, -1, axis=0)
    if (twice := np.flatnonzero((a == b).all(axis=1))).size:
        x, y = ring[twice[0]]
        raise DataError(f"has one corner twice in a row, at ({x:g}, {y:g}) m", where=where)
    d = b - a
    for i in range(n - 1):
        others = np.arange(i + 1, n)
        others = others[others != (n - 1 if i == 0 else -1)][1:] if n > 3 else others[:0]
        c, e = a[others], d[others]
        side_c, side_d = _cross(d[i], c - a[i]), _cross(d[i], b[others] - a[i])
        side_a, side_b = _cross(e, a[i] - c), _cross(e, b[i] - c)
        crossed = (
            (side_c * side_d <= 0.0) & (side_a * side_b <= 0.0) & ((side_c != side_d) | _overlap(a[i], b[i], c, e))
        )
        if crossed.any():
            j = int(np.flatnonzero(crossed)[0])
            turn = side_c[j] - side_d[j]
            x, y = c[j] + (side_c[j] / turn if turn else 0.0) * e[j]
            k = int(others[j])
            what = f"crosses itself at ({x:.2f}, {y:.2f}) m: edge {i + 1} meets edge {k + 1}"
            raise DataError(what, where=where, fix="mend the order of its corners, or draw two shapes")
    if n == 3 and _cross(d[0], d[1]) == 0.0:
        raise DataError("covers nothing: its corners are in one line", where=where)


def _cross(u: Floats, v: Floats) -> Floats:
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


def _overlap(a: Floats, b: Floats, c: Floats, e: Floats) -> Bools:
    """Of segments in one line: whether they share a point."""
    low, high = np.minimum(a, b), np.maximum(a, b)
    return np.all((np.minimum(c, c + e) <= high) & (np.maximum(c, c + e) >= low), axis=1)
