"""Convex solids as signed distances: tapered capsules, boxes, cylinders and tapered swept plates (wings, fins).

A solid is one row of a table (m, COLUMNS): kind; origin of its own frame; R (row-major), from its own frame to the
site's; six sizes; centre and radius of a sphere around it. Rows are made by the functions at the end of this file.

The distance of one solid is exact on both sides of its surface. Of several solids it is the least: exact outside, a
lower bound of the depth inside, with a true sign and a slope of at most 1 everywhere.
"""

from math import hypot, inf, sqrt

import numpy as np
from numpy.typing import ArrayLike

from outrider._kernel import kernel
from outrider.errors import ConfigError
from outrider.typing import Floats

COLUMNS = 24
TAPERED, BOX, CYLINDER, PLATE = 0, 1, 2, 3
_ORIGIN, _FRAME, _SIZES, _CENTRE, _RADIUS = slice(1, 4), slice(4, 13), slice(13, 19), slice(19, 22), 22

_TOUCH = 1e-9  # m: a beam this close has arrived
_STEPS = 100
_SLOPE_STEP = 1e-5  # m: central differences of the distance, good to 1e-10


@kernel
def _tapered(x: float, y: float, z: float, length: float, bottom: float, top: float) -> float:
    """Two balls, `length` apart on the z axis from the origin, and the cone that touches both."""
    r = hypot(x, y)
    b = (bottom - top) / length  # sine of the cone's half angle
    a = sqrt(1.0 - b * b)
    along = a * z - b * r
    if along < 0.0:
        return hypot(r, z) - bottom
    if along > a * length:
        return hypot(r, z - length) - top
    return a * r + b * z - bottom


@kernel
def _box(x: float, y: float, z: float, a: float, b: float, c: float) -> float:
    """Half sides a, b, c about the origin."""
    x, y, z = abs(x) - a, abs(y) - b, abs(z) - c
    u, v, w = max(x, 0.0), max(y, 0.0), max(z, 0.0)
    return sqrt(u * u + v * v + w * w) + min(max(x, y, z), 0.0)


@kernel
def _cylinder(x: float, y: float, z: float, half: float, radius: float) -> float:
    """Along z, of height 2 `half`, about the origin."""
    r, h = hypot(x, y) - radius, abs(z) - half
    return hypot(max(r, 0.0), max(h, 0.0)) + min(max(r, h), 0.0)


@kernel
def _edge(px: float, py: float, pz: float, ex: float, ey: float, ez: float) -> float:
    """Squared distance of p from the segment from the origin to e."""
    ee = ex * ex + ey * ey + ez * ez
    s = min(max((px * ex + py * ey + pz * ez) / ee, 0.0), 1.0) if ee > 0.0 else 0.0
    x, y, z = px - s * ex, py - s * ey, pz - s * ez
    return x * x + y * y + z * z


@kernel
def _plate(
    x: float, y: float, z: float, span: float, root: float, tip: float, back: float, thick: float, thin: float
) -> float:
    """Leading edge from the origin to (-back, span), chords towards -x, half thickness from `thick` to `thin`.

    Inside, the nearest face counts. Outside it is the face on which the foot of the perpendicular lies, else an edge.
    Upper and lower half are alike, so z >= 0 is enough.
    """
    z = abs(z)
    m, n, k = back / span, (back + tip - root) / span, (thin - thick) / span
    lead, trail, skin = 1.0 / sqrt(1.0 + m * m), 1.0 / sqrt(1.0 + n * n), 1.0 / sqrt(1.0 + k * k)
    d_lead, d_trail = (x + m * y) * lead, -(x + root + n * y) * trail
    d_skin, d_root, d_tip = (z - thick - k * y) * skin, -y, y - span
    depth = max(d_lead, d_trail, d_skin, d_root, d_tip)
    if depth <= 0.0:
        return depth
    for face in range(5):
        d = d_lead if face == 0 else d_trail if face == 1 else d_skin if face == 2 else d_root if face == 3 else d_tip
        if d <= 0.0:
            continue
        fx, fy, fz = x, y, z  # the foot on this face's plane
        if face == 0:
            fx, fy = x - d * lead, y - d * m * lead
        elif face == 1:
            fx, fy = x + d * trail, y + d * n * trail
        elif face == 2:
            fy, fz = y + d * k * skin, z - d * skin
        else:
            fy = 0.0 if face == 3 else span
        out = max(-fy, fy - span, 0.0) if face < 3 else 0.0
        out = max(out, fx + m * fy) if face != 0 else out
        out = max(out, -(fx + root + n * fy)) if face != 1 else out
        out = max(out, fz - thick - k * fy) if face != 2 else out
        if out <= 0.0:
            return d
    rise, x_tip = thin - thick, -back - tip
    near = min(_edge(x, y, z - thick, -back, span, rise), _edge(x + root, y, z - thick, x_tip + root, span, rise))
    near = min(near, _edge(x, y, z - thick, -root, 0.0, 0.0))
    near = min(near, _edge(x + back, y - span, z - thin, -tip, 0.0, 0.0))
    near = min(near, _edge(x, y, z, 0.0, 0.0, thick), _edge(x + root, y, z, 0.0, 0.0, thick))
    near = min(near, _edge(x + back, y - span, z, 0.0, 0.0, thin), _edge(x - x_tip, y - span, z, 0.0, 0.0, thin))
    return sqrt(near)


@kernel
def _own(table: Floats, k: int, x: float, y: float, z: float) -> float:
    """Distance from solid k, in its own frame."""
    kind, a, b, c = table[k, 0], table[k, 13], table[k, 14], table[k, 15]
    if kind == TAPERED:
        return _tapered(x, y, z, a, b, c)
    if kind == BOX:
        return _box(x, y, z, a, b, c)
    if kind == CYLINDER:
        return _cylinder(x, y, z, a, b)
    return _plate(x, y, z, a, b, c, table[k, 16], table[k, 17], table[k, 18])


@kernel
def _turned(table: Floats, k: int, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A vector of the site frame in the own frame of solid k: R' v."""
    return (
        table[k, 4] * x + table[k, 7] * y + table[k, 10] * z,
        table[k, 5] * x + table[k, 8] * y + table[k, 11] * z,
        table[k, 6] * x + table[k, 9] * y + table[k, 12] * z,
    )


@kernel
def distance_one(table: Floats, k: int, x: float, y: float, z: float) -> float:
    """Signed distance [m] of the point (x, y, z) from solid k, negative inside."""
    u, v, w = _turned(table, k, x - table[k, 1], y - table[k, 2], z - table[k, 3])
    return _own(table, k, u, v, w)


@kernel
def distance(table: Floats, x: float, y: float, z: float) -> tuple[float, int]:
    """Signed distance [m] of a point from the nearest solid, and its row; (inf, -1) without solids."""
    best, which = inf, -1
    for k in range(table.shape[0]):
        u, v, w = x - table[k, 19], y - table[k, 20], z - table[k, 21]
        if sqrt(u * u + v * v + w * w) - table[k, 22] < best:  # nothing in the sphere is nearer than its surface
            d = distance_one(table, k, x, y, z)
            if d < best:
                best, which = d, k
    return best, which


@kernel
def gradient(table: Floats, x: float, y: float, z: float, out: Floats) -> None:
    """out (3,): direction in which the distance grows, of length 1 wherever one point of one solid is nearest."""
    _, k = distance(table, x, y, z)
    if k < 0:
        out[0] = out[1] = out[2] = 0.0
        return
    h = _SLOPE_STEP
    out[0] = (distance_one(table, k, x + h, y, z) - distance_one(table, k, x - h, y, z)) / (2.0 * h)
    out[1] = (distance_one(table, k, x, y + h, z) - distance_one(table, k, x, y - h, z)) / (2.0 * h)
    out[2] = (distance_one(table, k, x, y, z + h) - distance_one(table, k, x, y, z - h)) / (2.0 * h)


@kernel
def _cast_one(
    table: Floats, k: int, start: float, reach: float, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float
) -> float:
    """Where along a beam solid k begins, looked for between `start` and `reach`; inf if it does not.

    Along a line the distance from a convex solid is a convex function: the chord of two points before the surface,
    drawn on, meets zero before the surface, too. So the march takes those steps, which are never shorter than the
    distance itself, never too long, and soon exact; and once the distance grows the beam has missed.
    """
    x, y, z = _turned(table, k, ox - table[k, 1], oy - table[k, 2], oz - table[k, 3])
    u, v, w = _turned(table, k, dx, dy, dz)
    t = start
    d = _own(table, k, x + t * u, y + t * v, z + t * w)
    step = d
    for _ in range(_STEPS):
        if d <= _TOUCH:
            return t
        if t + step > reach:
            return inf
        t += step
        before = d
        d = _own(table, k, x + t * u, y + t * v, z + t * w)
        if d >= before:
            return inf
        step = max(d, d * step / (before - d))
    return t  # along the surface, to within what a hundred steps tell


@kernel
def cast(table: Floats, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float, reach: float) -> float:
    """Range [m] at which a beam from o along the unit vector d enters a solid; 0 from inside, inf beyond `reach`."""
    best = inf
    for k in range(table.shape[0]):
        mx, my, mz = table[k, 19] - ox, table[k, 20] - oy, table[k, 21] - oz
        b = mx * dx + my * dy + mz * dz
        disc = table[k, 22] * table[k, 22] - (mx * mx + my * my + mz * mz - b * b)
        if disc < 0.0:
            continue
        half = sqrt(disc)  # of the chord through the sphere around it
        if b + half >= 0.0 and b - half <= min(best, reach):
            best = min(best, _cast_one(table, k, max(b - half, 0.0), min(best, reach), ox, oy, oz, dx, dy, dz))
    return best


def _row(kind: int, origin: ArrayLike, R: Floats, sizes: list[float], centre: ArrayLike) -> Floats:
    """One row of the table; `centre` of the sphere around it in the own frame. Impossible sizes: `ConfigError`."""
    row, at = np.zeros(COLUMNS), np.asarray(origin, float)
    row[0], row[_ORIGIN], row[_FRAME] = kind, at, R.ravel()
    row[13 : 13 + len(sizes)] = sizes
    row[_CENTRE] = at + R @ np.asarray(centre, float)
    if not np.isfinite(row).all() or min(sizes[: 3 if kind == PLATE else None]) <= 0.0 or min(sizes[4:], default=0) < 0:
        raise ConfigError(f"a solid of sizes {sizes} at {at.tolist()}", fix="finite coordinates and positive sizes")
    swell = max(row[14], row[15]) if kind == TAPERED else 0.0
    row[_RADIUS] = np.linalg.norm(_corners(row) - row[_CENTRE], axis=1).max() + swell
    return row


def _corners(row: Floats) -> Floats:
    """Points (n, 3), site frame: centres of the two balls, or corners (a cylinder's of the box around it)."""
    s, kind = row[_SIZES], row[0]
    if kind == TAPERED:
        own = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, s[0]]])
    elif kind == PLATE:
        plan = np.array([[0.0, 0.0], [-s[1], 0.0], [-s[3], s[0]], [-s[3] - s[2], s[0]]])
        half = np.array([s[4], s[4], s[5], s[5]])
        own = np.vstack([np.column_stack([plan, half]), np.column_stack([plan, -half])])
    else:
        a, b, c = s[:3] if kind == BOX else (s[1], s[1], s[0])
        own = np.array([[x, y, z] for x in (-a, a) for y in (-b, b) for z in (-c, c)])
    return row[_ORIGIN] + own @ row[_FRAME].reshape(3, 3).T


def _axes(along: Floats) -> Floats:
    """A rotation whose third column points along a vector."""
    z = along / np.linalg.norm(along)
    side = np.cross(np.eye(3)[np.argmin(np.abs(z))], z)
    x = side / np.linalg.norm(side)
    return np.column_stack([x, np.cross(z, x), z])


def tapered(a: ArrayLike, b: ArrayLike, radius_a: float, radius_b: float) -> Floats:
    """Row of the hull of two balls about a and b (3,) [m]; neither ball may lie in the other: `ConfigError`."""
    p, along = np.asarray(a, float), np.asarray(b, float) - np.asarray(a, float)
    length = float(np.linalg.norm(along))
    if not length > abs(radius_a - radius_b):
        raise ConfigError(f"a tapered capsule of length {length:g} m, radii {radius_a:g} and {radius_b:g} m is a ball")
    return _row(TAPERED, p, _axes(along), [length, radius_a, radius_b], [0.0, 0.0, 0.5 * length])


def capsule(a: ArrayLike, b: ArrayLike, radius: float) -> Floats:
    """Row of all points within `radius` of the segment from a to b (3,) [m]."""
    return tapered(a, b, radius, radius)


def box(centre: ArrayLike, size: ArrayLike, R: Floats | None = None) -> Floats:
    """Row of a box: centre (3,), sides (3,) [m] along the columns of R (3, 3), the site's axes by default."""
    half = [0.5 * float(side) for side in np.asarray(size, float)]
    return _row(BOX, centre, np.eye(3) if R is None else R, half, [0.0, 0.0, 0.0])


def cylinder(a: ArrayLike, b: ArrayLike, radius: float) -> Floats:
    """Row of a cylinder with flat ends about a and b (3,) [m]."""
    p, e = np.asarray(a, float), np.asarray(b, float)
    half = 0.5 * float(np.linalg.norm(e - p))
    if half == 0.0:
        raise ConfigError(f"a cylinder at {p.tolist()} has no length")
    return _row(CYLINDER, 0.5 * (p + e), _axes(e - p), [half, radius], [0.0, 0.0, 0.0])


def plate(
    root: ArrayLike,
    forward: ArrayLike,
    outward: ArrayLike,
    *,
    span: float,
    chords: tuple[float, float],
    back: float,
    thickness: tuple[float, float],
) -> Floats:
    """Row of a wing: its leading edge starts at `root` (3,) and ends `span` outward and `back` behind [m].

    forward, outward : (3,) unit, perpendicular;  chords, thickness : at root and tip [m], the chord towards the rear.
    """
    x, y = np.asarray(forward, float), np.asarray(outward, float)
    R = np.column_stack([x, y, np.cross(x, y)])
    if np.abs(R.T @ R - np.eye(3)).max() > 1e-9:
        raise ConfigError("a plate's forward and outward must be perpendicular unit vectors", where=f"root {root}")
    sizes = [span, chords[0], chords[1], back, 0.5 * thickness[0], 0.5 * thickness[1]]
    return _row(PLATE, root, R, sizes, [-0.25 * (chords[0] + chords[1] + 2.0 * back), 0.5 * span, 0.0])


def moved(table: Floats, p: Floats, R: Floats) -> Floats:
    """The same solids (m, COLUMNS) carried by the pose p (3,), R (3, 3) from their frame to the site's."""
    out = table.copy()
    for columns in (_ORIGIN, _CENTRE):
        out[:, columns] = p + table[:, columns] @ R.T
    out[:, _FRAME] = (R @ table[:, _FRAME].reshape(-1, 3, 3)).reshape(-1, 9)
    return out


def extent(table: Floats) -> Floats:
    """(2, 3) m: lowest and highest coordinates of all solids together, exact. NaN without solids."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for row in table:
        corners = _corners(row)
        swell = np.zeros(corners.shape)
        if row[0] == TAPERED:
            swell += row[14:16, None]
        elif row[0] == CYLINDER:  # a disk of radius r across the axis n reaches r sqrt(1 - n_i^2) along i
            axis = row[_FRAME].reshape(3, 3)[:, 2]
            corners = row[_ORIGIN] + np.outer([-row[13], row[13]], axis)
            swell = np.tile(row[14] * np.sqrt(np.maximum(1.0 - axis**2, 0.0)), (2, 1))
        low = np.minimum(low, (corners - swell).min(axis=0))
        high = np.maximum(high, (corners + swell).max(axis=0))
    return np.vstack([low, high]) if table.size else np.full((2, 3), np.nan)
