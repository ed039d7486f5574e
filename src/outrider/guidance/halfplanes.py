"""Reciprocal avoidance: half-planes of velocities that keep a robot clear of others, and the wanted velocity's nearest.

Two kinds of lines, in the order of their rank. *Braking* lines are the safety filter: a robot that keeps them can stop
before it has used up its share of the room between itself and another that brakes as hard as it can. *Reciprocal*
lines (van den Berg, Guy, Lin, Manocha, "Reciprocal n-body collision avoidance", 2011) make two robots part long before
that, each by half. Where no velocity keeps all, reciprocal lines give way first, all by the same least amount, and
braking lines only among themselves.

Robots that see each other the same way but from opposite sides are told apart by one rule, *keep right*: unless one
passes clearly on the left, both pass on the right.
"""

from math import hypot, inf, sqrt
from typing import Final

from outrider._kernel import inlined, kernel
from outrider.typing import Floats

KEPT, PARTED, BROKEN = range(3)  # every line is kept; reciprocal lines had to give way; braking lines, too
HALVINGS: Final = 24
EPS: Final = 1e-9

Line = tuple[float, float, float]
"""a_x, a_y, b of the half-plane a . v <= b, |a| = 1."""


@inlined
def reciprocal(px: float, py: float, vx: float, vy: float, ox: float, oy: float, R: float, horizon: float,
               left: float, share: float) -> Line:  # fmt: skip
    """The half-plane of own velocities that avoid coming within R of another in less than `horizon` seconds.

    p = where the other is from here, v = own, o = the other's velocity. The relative velocity w = v - o must leave the
    cone of velocities that touch the disc of radius R about p, cut off by the disc p / horizon, R / horizon; this robot
    does `share` of the change.  left : sine of the angle from p to w above which both pass on the left.
    """
    D = hypot(px, py)
    if D < EPS:
        return 1.0, 0.0, 0.0
    wx, wy = vx - ox, vy - oy
    T = horizon if D > R else 0.5
    cx, cy = wx - px / T, wy - py / T
    along = cx * px + cy * py
    c = hypot(cx, cy)
    if D <= R or (along < 0.0 and along * along > R * R * c * c):  # the disc is nearer than the legs of the cone
        nx, ny = (cx / c, cy / c) if c > EPS else (-px / D, -py / D)
        outside = c - R / T
    else:
        sine, cosine = R / D, sqrt(1.0 - R * R / (D * D))
        turn = 1.0 if px * wy - py * wx > left * D * hypot(wx, wy) else -1.0
        dx = (px * cosine - turn * py * sine) / D  # the leg
        dy = (turn * px * sine + py * cosine) / D
        nx, ny = -turn * dy, turn * dx  # out of the cone
        outside = wx * nx + wy * ny
    return -nx, -ny, share * outside - (nx * vx + ny * vy)


@inlined
def way_to_rest(v: float, react: float, brake: float) -> float:
    """v t_r + v^2 / 2 b for v > 0, else 0 [m]."""
    return v * react + 0.5 * v * v / brake if v > 0.0 else 0.0


@inlined
def braking(px: float, py: float, vx: float, vy: float, ox: float, oy: float, keep: float, react: float, brake: float,
            hardest: float, share: float, retreat: float) -> Line:  # fmt: skip
    """The half-plane of own velocities from which both come to rest no nearer than `keep`.

    slack = D - keep - s(v . n) - s(-o . n) + (o . n)^2 / 2 b_max, n towards the other, s(v) = v t_r + v^2 / 2 b: the
    last term only for another that goes away, which brakes as hard as it can. A robot may use `share` of the slack.
    Standing is always allowed; nearer than `keep`, going away at `retreat` [1/s] times what is missing is asked for.
    """
    D = hypot(px, py)
    if D < EPS:
        return 1.0, 0.0, 0.0
    nx, ny = px / D, py / D
    own, other = vx * nx + vy * ny, ox * nx + oy * ny
    s = way_to_rest(own, react, brake)
    slack = D - keep - s - way_to_rest(-other, react, brake)
    if other > 0.0:
        slack += 0.5 * other * other / hardest
    room = s + (share * slack if slack > 0.0 else slack)
    if keep > D:
        return nx, ny, retreat * (D - keep)
    if room <= 0.0:
        return nx, ny, 0.0
    return nx, ny, brake * (sqrt(react * react + 2.0 * room / brake) - react)


@inlined
def clipped(x: float, y: float, cx: float, cy: float, r: float) -> tuple[float, float]:
    """The point of the disc (c, r) that is nearest to (x, y)."""
    dx, dy = x - cx, y - cy
    d = hypot(dx, dy)
    return (x, y) if d <= r else (cx + dx * r / d, cy + dy * r / d)


@inlined
def in_both(x: float, y: float, vx: float, vy: float, reach: float, speed: float) -> tuple[float, float]:
    """The point nearest to (x, y) of the discs (v, reach) and (0, speed), which meet."""
    ax, ay = clipped(x, y, 0.0, 0.0, speed)
    if hypot(ax - vx, ay - vy) <= reach * (1.0 + EPS):
        return ax, ay
    bx, by = clipped(x, y, vx, vy, reach)
    if hypot(bx, by) <= speed * (1.0 + EPS):
        return bx, by
    d = hypot(vx, vy)  # one of the two corners
    m = 0.5 * (d * d + speed * speed - reach * reach) / d
    h = sqrt(max(speed * speed - m * m, 0.0))
    ex, ey = vx / d, vy / d
    h = h if ex * y - ey * x > 0.0 else -h
    return m * ex - h * ey, m * ey + h * ex


@inlined
def chord(lo: float, hi: float, fx: float, fy: float, dx: float, dy: float, r: float) -> tuple[float, float]:
    """The part of [lo, hi] in which f + t d is in the disc of radius r about 0; empty as (1, 0)."""
    m = fx * dx + fy * dy
    q = m * m - (fx * fx + fy * fy) + r * r
    if q < 0.0:
        return 1.0, 0.0
    h = sqrt(q)
    return max(lo, -m - h), min(hi, -m + h)


@kernel
def nearest_velocity(
    lines: Floats, n: int, firm: int, ease: float, want: tuple[float, float], v: tuple[float, float], reach: float,
    speed: float,
) -> tuple[float, float, int]:  # fmt: skip
    """(x, y, 1), the velocity nearest to `want` that keeps the first n lines, or (_, _, 0) if there is none.

    lines (m, 3) : a . x <= b, from the `firm`th on a . x <= b + ease;  |x - v| <= reach, |x| <= max(speed, |v|).

    One line after the other: where the nearest velocity so far breaks one, the next is on that line, within all that
    came before (R. Seidel, "Small-dimensional linear programming", 1991, with a quadratic cost).
    """
    speed = max(speed, hypot(v[0], v[1]))
    x, y = in_both(want[0], want[1], v[0], v[1], reach, speed)
    for k in range(n):
        ax, ay = lines[k, 0], lines[k, 1]
        b = lines[k, 2] + (ease if k >= firm else 0.0)
        if ax * x + ay * y <= b + EPS:
            continue
        fx, fy, dx, dy = ax * b, ay * b, -ay, ax
        lo, hi = chord(-inf, inf, fx, fy, dx, dy, speed * (1.0 + EPS))
        lo, hi = chord(lo, hi, fx - v[0], fy - v[1], dx, dy, reach * (1.0 + EPS))
        for i in range(k):
            across = lines[i, 0] * dx + lines[i, 1] * dy
            left = lines[i, 2] + (ease if i >= firm else 0.0) - lines[i, 0] * fx - lines[i, 1] * fy
            if across > EPS:
                hi = min(hi, left / across)
            elif across < -EPS:
                lo = max(lo, left / across)
            elif left < -EPS:
                return x, y, 0
        if lo > hi + EPS:
            return x, y, 0
        t = min(max(want[0] * dx + want[1] * dy, lo), max(lo, hi))
        x, y = fx + t * dx, fy + t * dy
    return x, y, 1


@kernel
def chosen(
    lines: Floats, firm: int, n: int, want: tuple[float, float], v: tuple[float, float], reach: float, speed: float
) -> tuple[float, float, int]:
    """The velocity nearest to `want` by rank, and which rank had to give way: the first `firm` lines stand over the
    others up to n. What gives way does so by the least amount that leaves a velocity, the same for every line."""
    x, y, good = nearest_velocity(lines, n, firm, 0.0, want, v, reach, speed)
    if good:
        return x, y, KEPT
    x, y, good = nearest_velocity(lines, firm, firm, 0.0, want, v, reach, speed)
    first, count = (firm, n) if good else (0, firm)
    low, high = 0.0, 0.0
    for k in range(first, count):  # standing at v keeps every line that is eased by this
        high = max(high, lines[k, 0] * v[0] + lines[k, 1] * v[1] - lines[k, 2])
    high = 2.0 * high + 2.0 * reach + 1.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        tx, ty, eased = nearest_velocity(lines, count, first, middle, want, v, reach, speed)
        if eased:
            high, x, y = middle, tx, ty
        else:
            low = middle
    return x, y, PARTED if good else BROKEN
