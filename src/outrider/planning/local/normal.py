"""The cost of a band and its normal equations: every term where it belongs in a matrix of half-bandwidth 11.

Knots carry the time from now instead of the time step: what depends on when a pose is reached (a moving obstacle)
then still concerns one knot only, and the matrix stays banded.
"""

from math import cos, hypot, sin, sqrt

from outrider._kernel import inlined, kernel
from outrider.core.angles import wrap
from outrider.planning.local.banded import BAND
from outrider.planning.local.problem import DA, KNOT, Q5, RATE, THETA, W3, C, E, G, Problem, V
from outrider.planning.local.terms import (
    acceleration,
    backward,
    duration,
    evenness,
    mapped,
    obstacle,
    passing,
    slip,
    turning,
    turning_radius,
    velocity,
)
from outrider.typing import Floats


@inlined
def motion(z: Floats, i: int, J: Floats) -> None:
    """J (3, 9): the body's mean twist between knots i and i + 1 in the frame of the mean heading, in column 8, after
    its derivatives by both knots."""
    T = z[i + 1, 3] - z[i, 3]
    dx, dy, turned = z[i + 1, 0] - z[i, 0], z[i + 1, 1] - z[i, 1], wrap(z[i + 1, 2] - z[i, 2])
    m = z[i, 2] + 0.5 * turned
    c, s, f = cos(m), sin(m), 1.0 / T
    ux, uy, w = (c * dx + s * dy) * f, (c * dy - s * dx) * f, turned * f
    J[0, 8], J[1, 8], J[2, 8] = ux, uy, w
    J[0, 4], J[0, 5], J[0, 6], J[0, 7] = c * f, s * f, 0.5 * uy, -ux * f
    J[1, 4], J[1, 5], J[1, 6], J[1, 7] = -s * f, c * f, -0.5 * ux, -uy * f
    J[2, 4], J[2, 5], J[2, 6], J[2, 7] = 0.0, 0.0, f, -w * f
    for k in range(3):
        J[k, 0], J[k, 1], J[k, 3] = -J[k, 4], -J[k, 5], -J[k, 7]
        J[k, 2] = J[k, 6] if k < 2 else -J[k, 6]


@inlined
def gather(s: Floats, at: int, rhs: int, n: int, r: float, weight: float) -> float:
    """A += weight g g', c -= weight r g with g, A (from row `at` on) and c in the scratch s; returns weight r^2."""
    for p in range(n):
        a = weight * s[G, p]
        s[rhs, p] -= a * r
        for q in range(n):
            s[at + p, q] += a * s[G, q]
    return weight * r * r


@inlined
def spread(B: Floats, b: Floats, at: int, g: Floats, n: int, r: float, weight: float) -> float:
    """The same for n unknowns from `at` on in the banded system."""
    for p in range(n):
        a = weight * g[p]
        b[at + p] -= a * r
        for q in range(p, n):
            B[at + p, q - p] += a * g[q]
    return weight * r * r


@inlined
def step_terms(p: Problem, J: Floats, s: Floats) -> float:
    """Terms of the twist of a step, in the rows W3 and C of the scratch."""
    v, theta, g, by_top, cost = s[V], s[THETA], s[G], 1.0 / p.top, 0.0
    for k in range(3):
        v[k] = J[k, 8]
        s[C, k] = 0.0
        for m in range(3):
            s[W3 + k, m] = 0.0
    for k in range(p.rows.shape[0]):
        r = velocity(v, p.rows[k], p.share, g)
        if r > 0.0:
            cost += gather(s, W3, C, 3, r, p.dt * p.weights.velocity)
    cost += gather(s, W3, C, 3, turning(v, theta, p.rows[1, 2], g), p.dt * p.weights.turning)
    if not p.holonomic:
        cost += gather(s, W3, C, 3, slip(v, theta, by_top, g), p.dt * p.weights.slip)
        r = backward(v, theta, by_top, g)
        if r > 0.0:
            cost += gather(s, W3, C, 3, r, p.dt * p.weights.backward)
    if p.radius > 0.0:
        theta[0] = p.radius
        r = turning_radius(v, theta, by_top, g)
        if r > 0.0:
            cost += gather(s, W3, C, 3, r, p.dt * p.weights.turning_radius)
    return cost


@inlined
def clock_terms(z: Floats, i: int, p: Problem, s: Floats, B: Floats, b: Floats) -> float:
    """Duration of step i, and whether it is as long as the one before."""
    v, g, at = s[V], s[G], KNOT * i + 3
    v[0], v[1] = z[i, 3], z[i + 1, 3]
    r, weight = duration(v, s[THETA], 1.0, g), p.weights.duration / p.dt
    cost = weight * r * r
    for k in range(2):
        b[at + KNOT * k] -= weight * r * g[k]
        for m in range(k, 2):
            B[at + KNOT * k, KNOT * (m - k)] += weight * g[k] * g[m]
    if i > 0:
        v[0], v[1], v[2] = z[i - 1, 3], z[i, 3], z[i + 1, 3]
        r, weight = evenness(v, s[THETA], 1.0 / p.dt, g), p.dt * p.weights.evenness
        cost += weight * r * r
        for k in range(3):
            b[at + KNOT * (k - 1)] -= weight * r * g[k]
            for m in range(k, 3):
                B[at + KNOT * (k - 1), KNOT * (m - k)] += weight * g[k] * g[m]
    return cost


@inlined
def lever(z: Floats, i: int, discs: Floats, j: int, c: float, s: float, v: Floats) -> None:
    """v <- x, y and time of the middle of disc j at knot i, whose heading has cosine c and sine s."""
    v[0] = z[i, 0] + c * discs[j, 0] - s * discs[j, 1]
    v[1] = z[i, 1] + s * discs[j, 0] + c * discs[j, 1]
    v[2] = z[i, 3]


@inlined
def reach(discs: Floats) -> float:
    """How far the discs that cover the body lie from its origin at most."""
    wide = 0.0
    for j in range(discs.shape[0]):
        wide = max(wide, hypot(discs[j, 0], discs[j, 1]) + discs[j, 2])
    return wide


@inlined
def passing_terms(z: Floats, i: int, wide: float, p: Problem, J: Floats, s: Floats, B: Floats, b: Floats) -> float:
    """The speed of step i, at its end, beside what may set off."""
    v, theta, g, da, cost = s[V], s[THETA], s[G], s[DA], 0.0
    far = p.reaction * hypot(J[0, 8], J[1, 8]) + wide
    c, h = cos(z[i + 1, 2]), sin(z[i + 1, 2])
    for k in range(p.wary.shape[0]):
        if hypot(z[i + 1, 0] - p.wary[k, 0], z[i + 1, 1] - p.wary[k, 1]) >= far + p.wary[k, 2]:
            continue
        theta[0], theta[1], theta[3] = p.wary[k, 0], p.wary[k, 1], p.slowest
        for j in range(p.discs.shape[0]):
            lever(z, i + 1, p.discs, j, c, h, v)
            theta[2], v[2], v[3] = p.wary[k, 2] + p.discs[j, 2], J[0, 8], J[1, 8]
            r = passing(v, theta, 1.0 / p.reaction, g)
            if r > 0.0:
                for m in range(8):
                    da[m] = g[2] * J[0, m] + g[3] * J[1, m]
                da[4] += g[0]
                da[5] += g[1]
                da[6] += g[1] * (v[0] - z[i + 1, 0]) - g[0] * (v[1] - z[i + 1, 1])
                cost += spread(B, b, KNOT * i, da, 8, r, p.dt * p.weights.passing)
    return cost


@inlined
def steps(z: Floats, n: int, p: Problem, u: Floats, s: Floats, B: Floats, b: Floats) -> float:
    """Terms of every step: its duration, its twist, and whom it passes."""
    cost, wide = 0.0, reach(p.discs)
    for i in range(n - 1):
        at, J = KNOT * i, u[i]
        motion(z, i, J)
        cost += clock_terms(z, i, p, s, B, b)
        cost += step_terms(p, J, s)
        cost += passing_terms(z, i, wide, p, J, s, B, b)
        for k in range(8):
            x = s[W3, 0] * J[0, k] + s[W3, 1] * J[1, k] + s[W3, 2] * J[2, k]
            y = s[W3 + 1, 0] * J[0, k] + s[W3 + 1, 1] * J[1, k] + s[W3 + 1, 2] * J[2, k]
            t = s[W3 + 2, 0] * J[0, k] + s[W3 + 2, 1] * J[1, k] + s[W3 + 2, 2] * J[2, k]
            b[at + k] += s[C, 0] * J[0, k] + s[C, 1] * J[1, k] + s[C, 2] * J[2, k]
            for m in range(k, 8):
                B[at + k, m - k] += x * J[0, m] + y * J[1, m] + t * J[2, m]
    return cost


@inlined
def rate_at(z: Floats, n: int, k: int, start: Floats, u: Floats, rate: Floats) -> float:
    """rate (3,) <- the acceleration at knot k, between steps k - 1 and k, or from the twist now, or to rest.

    A step's twist is that of its middle. Returns 2 / (time of both steps).
    """
    f = 2.0 / (z[min(k + 1, n - 1), 3] - z[max(k - 1, 0), 3])
    for q in range(3):
        before = u[k - 1, q, 8] if k > 0 else start[q]
        after = u[k, q, 8] if k < n - 1 else 0.0
        rate[q] = (after - before) * f
    return f


@inlined
def chained(n: int, k: int, f: float, u: Floats, s: Floats) -> int:
    """Row DA (12,) <- row G (3,) times the derivatives of the acceleration at knot k by the knots from k - 1 on.

    Returns by how many unknowns."""
    da = s[DA]
    for m in range(12):
        da[m] = 0.0
    shift, size = (KNOT if k > 0 else 0), KNOT * (3 if 0 < k < n - 1 else 2)
    for q in range(3):
        a = s[G, q] * f
        if a == 0.0:
            continue
        da[3] += 0.5 * a * s[RATE, q]
        da[size - 1] -= 0.5 * a * s[RATE, q]
        for m in range(8):
            if k > 0:
                da[m] -= a * u[k - 1, q, m]
            if k < n - 1:
                da[m + shift] += a * u[k, q, m]
    return size


@inlined
def changes(z: Floats, n: int, p: Problem, u: Floats, s: Floats, B: Floats, b: Floats) -> float:
    """Accelerations beyond their limits."""
    cost = 0.0
    for k in range(n - 1 if p.through else n):
        f = rate_at(z, n, k, p.rates[3], u, s[RATE])
        for axis in range(3):
            r = acceleration(s[RATE], p.rates[axis], p.share, s[G])
            if r > 0.0:
                size = chained(n, k, f, u, s)
                cost += spread(B, b, KNOT * max(k - 1, 0), s[DA], size, r, p.dt * p.weights.acceleration)
    return cost


@kernel
def stiffness(z: Floats, n: int, p: Problem, u: Floats, s: Floats, D: Floats, idle: Floats) -> None:
    """D <- J' W J of all accelerations, those within their limits, too: a step that would tear the band is damped by
    it, one that bends it is not. Follows `assemble` at z, whose twists it uses.
    """
    for j in range(KNOT * n + BAND):
        for k in range(BAND):
            D[j, k] = 0.0
    for k in range(n):
        f = rate_at(z, n, k, p.rates[3], u, s[RATE])
        for axis in range(3):
            for q in range(3):
                s[G, q] = p.rates[axis, q]
            size = chained(n, k, f, u, s)
            spread(D, idle, KNOT * max(k - 1, 0), s[DA], size, 0.0, p.dt * p.weights.acceleration)
    pin(D, n, 0.0)


@inlined
def knot_term(z: Floats, i: int, s: Floats, slope: float, r: float, tau: float, weight: float) -> float:
    """Row G by the place of a disc, and `slope` by the time, as a term of knot i, gathered in Q5 and E.

    The residual is sqrt(tau) r with the time tau that the knot stands for: an integral over time, which knots
    cannot make cheaper by gathering where there is nothing. Unknowns: x, y, heading, time, tau.
    """
    g, v, root = s[G], s[V], sqrt(tau)
    g[2] = g[1] * (v[0] - z[i, 0]) - g[0] * (v[1] - z[i, 1])
    g[0], g[1], g[2], g[3], g[4] = root * g[0], root * g[1], root * g[2], root * slope, 0.5 * r / root
    return gather(s, Q5, E, 5, root * r, weight)


@inlined
def body_terms(z: Floats, i: int, wide: float, tau: float, p: Problem, s: Floats) -> float:
    """Obstacles and the map against the discs that cover the body at knot i, in the rows Q5 and E."""
    v, theta, g = s[V], s[THETA], s[G]
    for k in range(5):
        s[E, k] = 0.0
        for m in range(5):
            s[Q5 + k, m] = 0.0
    c, h, t = cos(z[i, 2]), sin(z[i, 2]), min(z[i, 3], p.horizon)
    by_gap, weight, cost = 1.0 / p.gap, p.weights.obstacle, 0.0
    for k in range(p.obstacles.shape[0]):
        dx = z[i, 0] - p.obstacles[k, 0] - p.obstacles[k, 3] * t
        dy = z[i, 1] - p.obstacles[k, 1] - p.obstacles[k, 4] * t
        far = wide + p.gap + p.obstacles[k, 2]
        if dx * dx + dy * dy >= far * far:
            continue
        for m in range(5):
            theta[m] = p.obstacles[k, m]
        theta[5] = p.horizon
        for j in range(p.discs.shape[0]):
            lever(z, i, p.discs, j, c, h, v)
            theta[2] = p.gap + p.obstacles[k, 2] + p.discs[j, 2]
            r = obstacle(v, theta, by_gap, g)
            if r > 0.0:
                cost += knot_term(z, i, s, g[2], r, tau, weight)
    theta[0], theta[1], theta[2] = p.west, p.south, p.resolution
    for j in range(p.discs.shape[0] if p.field.size else 0):
        lever(z, i, p.discs, j, c, h, v)
        theta[3] = p.gap + 0.5 * p.resolution + p.discs[j, 2]
        r = mapped(v, theta, by_gap, g, p.field)
        if r > 0.0:
            cost += knot_term(z, i, s, 0.0, r, tau, weight)
    return cost


@inlined
def bodies(z: Floats, n: int, p: Problem, s: Floats, B: Floats, b: Floats) -> float:
    """Terms of every pose but the first: obstacles and the map."""
    cost, wide = 0.0, reach(p.discs)
    for i in range(1, n):
        after = min(i + 1, n - 1)
        more = body_terms(z, i, wide, 0.5 * (z[after, 3] - z[i - 1, 3]), p, s)
        if more == 0.0:
            continue
        cost += more
        at, early, late = KNOT * i, KNOT * i - 1, KNOT * after + 3
        for k in range(4):
            b[at + k] += s[E, k]
            B[early, k + 1] -= 0.5 * s[Q5 + k, 4]
            for m in range(k, 4):
                B[at + k, m - k] += s[Q5 + k, m]
        b[early] -= 0.5 * s[E, 4]
        b[late] += 0.5 * s[E, 4]
        tt = 0.25 * s[Q5 + 4, 4]
        B[early, 0] += tt
        B[late, 0] += tt
        B[early, late - early] -= tt
        for k in range(4):
            B[at + k, late - at - k] += (1.0 if late > at + k else 2.0) * 0.5 * s[Q5 + k, 4]
    return cost


@kernel
def assemble(z: Floats, n: int, p: Problem, u: Floats, s: Floats, B: Floats, b: Floats) -> float:
    """The cost of the band z (n, 4), B = J' W J (columns below the diagonal) and b = -J' W r.

    The first knot and the pose of the last are given: their rows and columns are those of the identity.
    """
    for j in range(KNOT * n + BAND):
        b[j] = 0.0
        for k in range(BAND):
            B[j, k] = 0.0
    cost = steps(z, n, p, u, s, B, b)
    cost += changes(z, n, p, u, s, B, b)
    cost += bodies(z, n, p, s, B, b)
    pin(B, n, 1.0)
    for m in range(7):
        b[m if m < 4 else KNOT * n - 8 + m] = 0.0
    return cost


@kernel
def pin(B: Floats, n: int, diagonal: float) -> None:
    """Take the first knot and the pose of the last out of a banded matrix: they are given."""
    for m in range(7):
        j = m if m < 4 else KNOT * n - 8 + m
        for k in range(1, BAND):
            B[j, k] = 0.0
            if j >= k:
                B[j - k, k] = 0.0
        B[j, 0] = diagonal
