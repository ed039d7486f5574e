"""The extended and the unscented Kalman filter over a flight."""

from math import hypot, inf, nan, sqrt

from outrider._kernel import inlined, kernel
from outrider.core.linalg import cholesky
from outrider.filters.following.records import Log, Track, Work, evidence, keep, sight, tells
from outrider.filters.following.steps import fuse_row, predict, update
from outrider.typing import Floats


@kernel
def run_gaussian(flight: Log, x: Floats, P: Floats, unscented: bool, out: Track, s: Work) -> None:
    """The extended or the unscented filter over all events, from x (n,), P (n, n), which end as the last belief."""
    for k in range(flight.step.size):
        i = flight.step[k]
        predict(x, P, flight.u[k], flight.C[i])
        keep(x, P, out.xp[k], out.Pp[k])
        z, r = flight.z[k], flight.r[k]
        total = 0.0
        if r[0] < inf:
            nis, det = update(x, P, 0, z, r, inf)
            total += evidence(nis, det, 3)
        if tells(flight.kind[k], x, P, flight.slowest):
            if unscented:
                total += sigma_update(x, P, flight.kind[k], float(flight.dt[i]), z, r, s)
            else:
                total += tangent_update(x, P, flight.kind[k], float(flight.dt[i]), z, r, s)
        out.likelihood[k] = total
        keep(x, P, out.x[k], out.P[k])


@inlined
def tangent_update(x: Floats, P: Floats, kind: int, dt: float, z: Floats, r: Floats, s: Work) -> float:
    """A direction, by Jacobians at the mean; returns the logarithm of its likelihood."""
    air = x.size == 9
    vx, vy = x[3] - (x[6] if air else 0.0), x[4] - (x[7] if air else 0.0)
    m, speed, total = sight(kind, vx, vy, dt, z, s.y), hypot(vx, vy), 0.0
    cx, cy = vx / speed, vy / speed
    for k in range(m):
        if kind == 1:
            hx, hy = -cy / speed, cx / speed
        elif k == 0:
            hx, hy = cy * cy / speed, -cx * cy / speed
        elif k == 1:
            hx, hy = -cx * cy / speed, cx * cx / speed
        else:
            hx, hy = cx * dt, cy * dt
        moved_x = x[3] - (x[6] if air else 0.0) - vx
        moved_y = x[4] - (x[7] if air else 0.0) - vy
        nis, S = fuse_row(x, P, hx, hy, air, s.y[k] - hx * moved_x - hy * moved_y, r[3 + k], inf, s.w)
        total += evidence(nis, S, 1)
    return total


@inlined
def sigma_update(x: Floats, P: Floats, kind: int, dt: float, z: Floats, r: Floats, s: Work) -> float:
    """A direction, by the points x +- sqrt(n) (columns of chol P); returns the logarithm of its likelihood.

    y = mean Y,  S = mean (Y - y) (Y - y)' + R,  C = -mean e (Y - y)',  K = C S^-1,  x + K y,  P - K S K'
    """
    n = x.size
    air = n == 9
    vx, vy = x[3] - (x[6] if air else 0.0), x[4] - (x[7] if air else 0.0)
    if not cholesky(P, n, s.L):
        return nan
    reach, share = sqrt(float(n)), 0.5 / n
    m = sight(kind, vx, vy, dt, z, s.y)
    for k in range(n):
        ax = reach * (s.L[3, k] - (s.L[6, k] if air else 0.0))
        ay = reach * (s.L[4, k] - (s.L[7, k] if air else 0.0))
        if ax == 0.0 and ay == 0.0:  # this point sees what the centre sees
            for a in range(m):
                s.Y[2 * k, a] = s.Y[2 * k + 1, a] = s.y[a]
        else:
            sight(kind, vx + ax, vy + ay, dt, z, s.Y[2 * k])
            sight(kind, vx - ax, vy - ay, dt, z, s.Y[2 * k + 1])
    for a in range(m):
        s.y[a] = 0.0
        for k in range(2 * n):
            s.y[a] += share * s.Y[k, a]
        for i in range(n):
            s.C[a, i] = 0.0
        for k in range(n):
            slope = share * reach * (s.Y[2 * k + 1, a] - s.Y[2 * k, a])
            for i in range(k, n):
                s.C[a, i] += slope * s.L[i, k]
    for a in range(m):
        for b in range(a + 1):
            total = r[3 + a] if a == b else 0.0
            for k in range(2 * n):
                total += share * (s.Y[k, a] - s.y[a]) * (s.Y[k, b] - s.y[b])
            s.S[a, b] = s.S[b, a] = total
    return joint(x, P, m, s)


@inlined
def joint(x: Floats, P: Floats, m: int, s: Work) -> float:
    """x, P <- after innovations s.y with covariance s.S, correlated with the state by s.C; one after the other."""
    total = 0.0
    for a in range(m):
        v = s.S[a, a]
        total += evidence(s.y[a] * s.y[a] / v, v, 1)
        for b in range(a + 1, m):
            f = s.S[b, a] / v
            s.y[b] -= f * s.y[a]
            for i in range(x.size):
                s.C[b, i] -= f * s.C[a, i]
            for c in range(a + 1, m):
                s.S[b, c] -= f * s.S[a, c]
        for i in range(x.size):
            x[i] += s.C[a, i] * s.y[a] / v
            for j in range(x.size):
                P[i, j] -= s.C[a, i] * s.C[a, j] / v
    return total
