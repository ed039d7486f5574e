"""Exact room between a footprint and what surrounds it, at one pose and along a trajectory."""

from math import ceil, cos, hypot, inf, sin, sqrt
from typing import Final, NamedTuple, final

import numpy as np

from outrider._kernel import kernel
from outrider.core.angles import wrap
from outrider.core.flat import polygon_distance
from outrider.data.footprint import Footprint
from outrider.data.surroundings import Surroundings
from outrider.typing import Floats

STRIDE: Final = 0.05  # m that no point of the body passes unchecked
UNMAPPED: Final = np.empty((0, 0))


class Body(NamedTuple):
    """A footprint as a kernel takes it."""

    outline: Floats  # (n, 2)
    radius: float
    circumscribed: float


class Around(NamedTuple):
    """Surroundings as a kernel takes them; a field of no cells for none."""

    discs: Floats  # (n, 5)
    field: Floats  # (rows, cols)
    west: float
    south: float
    resolution: float
    horizon: float  # s, how long a disc is believed to keep its velocity


def body_of(footprint: Footprint) -> Body:
    """For kernels."""
    return Body(np.ascontiguousarray(footprint.outline, np.float64), footprint.radius, footprint.circumscribed)


def around(s: Surroundings, horizon: float) -> Around:
    """For kernels."""
    discs = np.ascontiguousarray(s.discs, np.float64)
    if s.field is None:
        return Around(discs, UNMAPPED, 0.0, 0.0, 1.0, horizon)
    f = s.field
    return Around(discs, f.distances, float(f.origin[0]), float(f.origin[1]), f.resolution, horizon)


@kernel
def room(b: Body, a: Around, x: float, y: float, heading: float, t: float) -> tuple[float, int, float, float]:
    """Distance [m] from the footprint to the nearest thing at time t, negative if it touches; which, and where.

    Discs are exact. A taken cell counts as the disc around it, 0.2 cells more than it is at the most. Which: the row
    of the disc, -1 for a cell. Beyond the map everything is free. Of
    cells further than STRIDE away the distance is a lower bound.
    """
    c, s = cos(heading), sin(heading)
    best, which, px, py = inf, -1, 0.0, 0.0
    soon = min(t, a.horizon)
    for k in range(a.discs.shape[0]):
        ox, oy = a.discs[k, 0] + a.discs[k, 3] * soon, a.discs[k, 1] + a.discs[k, 4] * soon
        dx, dy = ox - x, oy - y
        if hypot(dx, dy) - b.circumscribed - a.discs[k, 2] >= best:
            continue
        d = polygon_distance(b.outline, 0, b.outline.shape[0], c * dx + s * dy, c * dy - s * dx)
        d -= b.radius + a.discs[k, 2]
        if d < best:
            best, which, px, py = d, k, ox, oy
    rows, cols = a.field.shape
    u, v = int(np.floor((x - a.west) / a.resolution)), int(np.floor((y - a.south) / a.resolution))
    if a.field.size == 0 or u < 0 or v < 0 or u >= cols or v >= rows:
        return best, which, px, py
    half = sqrt(0.5) * a.resolution
    far = a.field[v, u] - 2.0 * half - b.circumscribed  # from anywhere in this cell
    if far >= min(best, STRIDE):
        return min(best, far), which if best <= far else -1, px, py
    span = ceil((b.circumscribed + 2.0 * half + STRIDE) / a.resolution)
    for row in range(max(v - span, 0), min(v + span + 1, rows)):
        for col in range(max(u - span, 0), min(u + span + 1, cols)):
            if a.field[row, col] > 0.0:
                continue
            ox, oy = a.west + (col + 0.5) * a.resolution, a.south + (row + 0.5) * a.resolution
            dx, dy = ox - x, oy - y
            if hypot(dx, dy) - b.circumscribed - half >= best:
                continue
            d = polygon_distance(b.outline, 0, b.outline.shape[0], c * dx + s * dy, c * dy - s * dx) - b.radius - half
            if d < best:
                best, which, px, py = d, -1, ox, oy
    return best, which, px, py


@kernel
def first_conflict(z: Floats, n: int, b: Body, a: Around, spare: float) -> tuple[int, float, float, int, float, float]:
    """Along the poses z (n, 4) x, y, heading, time: where the footprint first has less than `spare` of room.

    Returns the knot before (-1: nowhere), the time, the smallest room up to there, and which obstacle is where. Poses
    between the knots are checked at every STRIDE of the outermost point.
    """
    least = inf
    for i in range(n):
        parts = 1
        if i < n - 1:
            turned = wrap(z[i + 1, 2] - z[i, 2])
            way = hypot(z[i + 1, 0] - z[i, 0], z[i + 1, 1] - z[i, 1]) + b.circumscribed * abs(turned)
            parts = max(ceil(way / STRIDE), 1)
        for k in range(parts):
            f = k / parts
            x, y, h, t = z[i, 0], z[i, 1], z[i, 2], z[i, 3]
            if k > 0:
                x, y = x + f * (z[i + 1, 0] - x), y + f * (z[i + 1, 1] - y)
                h, t = h + f * wrap(z[i + 1, 2] - h), t + f * (z[i + 1, 3] - t)
            d, which, px, py = room(b, a, x, y, h, t)
            least = min(least, d)
            if d < spare:
                return i, t, least, which, px, py
    return -1, z[n - 1, 3], least, -1, 0.0, 0.0


@final
class Clash(NamedTuple):
    """What `first_conflict` returns, by name."""

    knot: int
    time: float
    room: float
    obstacle: int
    x: float
    y: float

    @property
    def free(self) -> bool:
        """Whether nothing is touched."""
        return self.knot < 0


def clash(z: Floats, b: Body, a: Around, spare: float = 0.0) -> Clash:
    """See `first_conflict`."""
    return Clash(*first_conflict(np.ascontiguousarray(z, np.float64), len(z), b, a, spare))


def clash_ahead(z: Floats, b: Body, a: Around, spare: float) -> Clash:
    """The same for a robot that may be too near to something already: that does not count as long as the room grows.

    Otherwise a way out would be as blocked as all others, and who came too near would stay there.
    """
    hit, knot = clash(z, b, a, spare), 0
    before = -inf
    while hit.knot == 0 and knot + 1 < len(z):
        here = clash(z[knot : knot + 1], b, a).room
        if not before < here < spare:
            break
        before, knot = here, knot + 1
        hit = clash(z[knot:], b, a, spare)
    return hit if hit.free else hit._replace(knot=hit.knot + knot)
