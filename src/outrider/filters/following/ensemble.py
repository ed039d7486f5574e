"""The ensemble Kalman filter over a flight, its members side by side in memory: rows are states, columns members."""

from math import inf, sqrt

from numpy.random import Generator

from outrider._kernel import kernel
from outrider.filters.following.records import Log, Track, Work, evidence, keep, sight, tells
from outrider.typing import Floats


@kernel
def run_ensemble(flight: Log, x: Floats, P: Floats, rng: Generator, square_root: bool, out: Track, s: Work) -> None:
    """The ensemble filter over all events, its members in s.X drawn from x, P (n, n).

    Measurements are fused one after the other. Stochastic: each member sees its own noise. `square_root` draws none
    there: e <- e - K Y / (1 + sqrt(r / s)), the serial root of Whitaker and Hamill (2002). An update is a regression on
    N members and by chance too good: variances grow by 1 + 2 d / N, d = 1 - r / s. All noise drawn has mean zero.
    """
    n = x.size
    scatter(rng, P, s)
    for j in range(n):
        for i in range(s.X.shape[1]):
            s.X[j, i] = x[j] + s.E[j, i]
    for k in range(flight.step.size):
        i = flight.step[k]
        drive(s.X, flight.u[k], flight.C[i])
        disturb(rng, flight.C[i], s)
        moments(s.X, x, P)
        keep(x, P, out.xp[k], out.Pp[k])
        z, r, total = flight.z[k], flight.r[k], 0.0
        if r[0] < inf:
            for row in range(3):
                total += assimilate(rng, 0, row, 0.0, square_root, x, z, r[row], s)
            for j in range(3, 5):  # all that `tells` looks at
                P[j, j] = variance(s.X[j], x[j])
        if tells(flight.kind[k], x, P, flight.slowest):
            for row in range(flight.kind[k]):
                total += assimilate(rng, flight.kind[k], row, float(flight.dt[i]), square_root, x, z, r[3 + row], s)
        moments(s.X, x, P)
        out.likelihood[k] = total
        keep(x, P, out.x[k], out.P[k])


@kernel
def drive(X: Floats, u: Floats, c: Floats) -> None:
    """Every member one step later, without noise.  X (n, N)."""
    for i in range(3):
        p, v = X[i], X[3 + i]
        for m in range(p.size):
            pull = u[i] + (X[6 + i, m] if X.shape[0] == 9 else 0.0)
            p[m] += c[i, 0] * v[m] + c[i, 2] * pull
            v[m] = c[i, 1] * v[m] + c[i, 3] * pull


@kernel
def draw(rng: Generator, e: Floats) -> None:
    """e (N,) <- standard normals, their mean taken off."""
    total = 0.0
    for m in range(e.size):
        e[m] = rng.standard_normal()
        total += e[m]
    total /= e.size
    for m in range(e.size):
        e[m] -= total


@kernel
def scatter(rng: Generator, P: Floats, s: Work) -> None:
    """E (n, N) <- normals of covariance P (n, n); a state without variance gets zeros."""
    n = P.shape[0]
    for j in range(n):
        draw(rng, s.E[j])
        for i in range(j, n):
            v = P[i, j]
            for k in range(j):
                v -= s.L[i, k] * s.L[j, k]
            s.L[i, j] = sqrt(max(v, 0.0)) if i == j else (v / s.L[j, j] if s.L[j, j] > 0.0 else 0.0)
    for j in range(n - 1, -1, -1):
        for m in range(s.E.shape[1]):
            s.E[j, m] *= s.L[j, j]
        for k in range(j):
            for m in range(s.E.shape[1]):
                s.E[j, m] += s.L[j, k] * s.E[k, m]


@kernel
def disturb(rng: Generator, c: Floats, s: Work) -> None:
    """Add a step's noise to every member (no TURN)."""
    windy = s.X.shape[0] == 9
    for i in range(3):
        a = sqrt(c[i, 4])
        b = c[i, 5] / a if a > 0.0 else 0.0
        d = sqrt(max(c[i, 6] - b * b, 0.0))
        p, q = s.E[0], s.E[1]
        draw(rng, p)
        draw(rng, q)
        for m in range(p.size):
            s.X[i, m] += a * p[m]
            s.X[3 + i, m] += b * p[m] + d * q[m]
        if windy:
            e = c[i, 7] / a if a > 0.0 else 0.0
            f = (c[i, 8] - b * e) / d if d > 0.0 else 0.0
            g = sqrt(max(c[i, 9] - e * e - f * f, 0.0))
            draw(rng, s.E[2])
            for m in range(p.size):
                s.X[6 + i, m] += e * p[m] + f * q[m] + g * s.E[2, m]


@kernel
def dot(a: Floats, b: Floats) -> float:
    """sum a b, in four sums that do not wait for one another."""
    n = a.size - a.size % 4
    p = q = r = s = 0.0
    for m in range(0, n, 4):
        p += a[m] * b[m]
        q += a[m + 1] * b[m + 1]
        r += a[m + 2] * b[m + 2]
        s += a[m + 3] * b[m + 3]
    for m in range(n, a.size):
        p += a[m] * b[m]
    return (p + q) + (r + s)


@kernel
def variance(a: Floats, mean: float) -> float:
    """Sample variance of a row of members."""
    total = 0.0
    for m in range(a.size):
        total += (a[m] - mean) * (a[m] - mean)
    return total / (a.size - 1)


@kernel
def moments(X: Floats, x: Floats, P: Floats) -> None:
    """x, P <- mean and sample covariance of the members X (n, N); their rows become exactly centred about x."""
    n, members = X.shape
    for j in range(n):
        total = 0.0
        for m in range(members):
            total += X[j, m]
        x[j] = total / members
        for m in range(members):
            X[j, m] -= x[j]
        for l in range(j + 1):
            P[j, l] = dot(X[j], X[l]) / (members - 1)
            P[l, j] = P[j, l]
    for j in range(n):
        for m in range(members):
            X[j, m] += x[j]


@kernel
def assimilate(
    rng: Generator, kind: int, row: int, dt: float, square_root: bool, x: Floats, z: Floats, r: float, s: Work
) -> float:
    """Fuse one number, of a fix (kind 0) or of a direction; x (n,) is their mean before and after."""
    n, members = s.X.shape
    Y, y = s.E[0], 0.0
    for m in range(members):
        if kind == 0:
            Y[m] = z[row] - s.X[row, m]
        else:
            ax, ay = (s.X[6, m], s.X[7, m]) if n == 9 else (0.0, 0.0)
            sight(kind, s.X[3, m] - ax, s.X[4, m] - ay, dt, z, s.y)
            Y[m] = s.y[row]
        y += Y[m]
    y /= members
    for m in range(members):
        Y[m] -= y
    v = r + dot(Y, Y) / (members - 1)
    for j in range(n):
        s.w[j] = -dot(s.X[j], Y) / ((members - 1) * v)
    if square_root:
        share = 1.0 / (1.0 + sqrt(r / v))
        for m in range(members):
            Y[m] *= share
    else:
        draw(rng, s.E[1])
        noise = sqrt(r)
        for m in range(members):
            Y[m] += noise * s.E[1, m]
    wide = sqrt(1.0 + 2.0 * (1.0 - r / v) / members)
    for j in range(n):
        old, gain = x[j], s.w[j]
        x[j] += gain * y
        for m in range(members):
            s.X[j, m] = x[j] + wide * (s.X[j, m] - old + gain * Y[m])
    return evidence(y * y / v, v, 1)
