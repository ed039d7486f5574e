"""Kalman steps of a follower: compiled for its 6 states (position, velocity) or 9 (and wind), for one or many rows.

x (6,) or (9,) and P (6, 6) or (9, 9) in the order of `STILL_AIR` or `WINDY`, metres and seconds, world ENU; a step c
(3, STEP) comes from `outrider.models.motion.following`. Everything happens in place. `*_rows` do the same for N robots
in one call, X (N, 6 or 9) and P (N, n, n): axes couple only where a course was measured, so a step is a few dozen
multiplications, and a thousand robots are one call.
"""

from math import atan2, hypot, inf, nan

from outrider._kernel import kernel
from outrider.core.angles import wrap
from outrider.typing import Floats


@kernel
def predict(x: Floats, P: Floats, u: Floats, c: Floats) -> None:
    """x, P <- one step later.  x (n,), P (n, n) symmetric, u (3,) commanded velocity, c (3, STEP).

    Where c says that acceleration is stronger across the course, Q_xy = q (I + TURN l l') with l the horizontal unit
    vector across the velocity, or the whole plane below 0.3 m/s.
    """
    n = x.size
    windy = n == 9
    vx, vy = x[3], x[4]
    for i in range(3):
        pull = u[i] + (x[6 + i] if windy else 0.0)
        x[i] += c[i, 0] * x[3 + i] + c[i, 2] * pull
        x[3 + i] = c[i, 1] * x[3 + i] + c[i, 3] * pull
    for i in range(3):  # rows of F P
        a, b, d, g = c[i, 0], c[i, 1], c[i, 2], c[i, 3]
        for j in range(n):
            v = P[3 + i, j]
            P[i, j] += a * v
            P[3 + i, j] = b * v
        if windy:
            for j in range(n):
                P[i, j] += d * P[6 + i, j]
                P[3 + i, j] += g * P[6 + i, j]
    for i in range(3):  # columns of (F P) F'
        a, b, d, g = c[i, 0], c[i, 1], c[i, 2], c[i, 3]
        for j in range(n):
            v = P[j, 3 + i]
            P[j, i] += a * v
            P[j, 3 + i] = b * v
        if windy:
            for j in range(n):
                P[j, i] += d * P[j, 6 + i]
                P[j, 3 + i] += g * P[j, 6 + i]
    for i in range(3):
        P[i, i] += c[i, 4]
        P[i, 3 + i] += c[i, 5]
        P[3 + i, 3 + i] += c[i, 6]
        if windy:
            P[i, 6 + i] += c[i, 7]
            P[3 + i, 6 + i] += c[i, 8]
            P[6 + i, 6 + i] += c[i, 9]
    if c[0, 10] > 0.0:
        speed = hypot(vx, vy)
        lx, ly = (-vy / speed, vx / speed) if speed > 0.3 else (1.0, 1.0)
        cross = lx * ly if speed > 0.3 else 0.0
        for k in range(3):
            i, j = (0, 0) if k == 0 else ((0, 3) if k == 1 else (3, 3))
            q = c[0, 4 + k] * c[0, 10]
            P[i, j] += q * lx * lx
            P[i + 1, j + 1] += q * ly * ly
            P[i, j + 1] += q * cross
            if i != j:
                P[i + 1, j] += q * cross
    for i in range(n):
        for j in range(i):
            P[i, j] = P[j, i]


@kernel
def update(x: Floats, P: Floats, at: int, z: Floats, r: Floats, gate: float) -> tuple[float, float]:
    """Fuse z (3,), position (at 0) or velocity (at 3), of independent variances r (3,); inf where not measured.

    Returns (NIS, det S) of the joint measurement; nothing changes where NIS is above the gate or NaN. Components are
    fused one after the other; the row of the measured state is scaled by r / s instead of subtracted, so the smallest
    r loses no digits.
    """
    e0, e1, e2 = z[0] - x[at], z[1] - x[at + 1], z[2] - x[at + 2]
    s0, s1, s2 = P[at, at] + r[0], P[at + 1, at + 1] + r[1], P[at + 2, at + 2] + r[2]
    if not (s0 > 0.0 and s1 > 0.0 and s2 > 0.0):
        return nan, nan
    a, b = P[at + 1, at] / s0, P[at + 2, at] / s0  # L D L' of S
    s1 -= a * P[at + 1, at]
    off = P[at + 2, at + 1] - b * P[at + 1, at]
    g = off / s1
    s2 -= b * P[at + 2, at] + g * off
    e1 -= a * e0
    e2 -= b * e0 + g * e1
    nis = e0 * e0 / s0 + e1 * e1 / s1 + e2 * e2 / s2
    if not (s1 > 0.0 and s2 > 0.0 and nis < inf):
        return nan, nan
    det = (s0 if r[0] < inf else 1.0) * (s1 if r[1] < inf else 1.0) * (s2 if r[2] < inf else 1.0)
    if nis <= gate:
        for k in range(3):
            if r[k] < inf:
                fuse_entry(x, P, at + k, z[k], r[k])
    return nis, det


@kernel
def fuse_entry(x: Floats, P: Floats, k: int, z: float, r: float) -> None:
    """Fuse a measurement z of state k with variance r: P <- P - P_k P_k' / s."""
    n = x.size
    share = 1.0 / (P[k, k] + r)
    e = (z - x[k]) * share
    for i in range(n):
        x[i] += e * P[k, i]
    for i in range(n):
        if i != k:
            a = P[i, k]
            for j in range(i, n):
                if j != k:
                    P[i, j] -= a * P[k, j] * share
                    P[j, i] = P[i, j]
    for j in range(n):
        P[k, j] *= r * share
        P[j, k] = P[k, j]


@kernel
def update_course(
    x: Floats, P: Floats, angle: float, r: float, through_air: bool, slowest: float, gate: float, w: Floats
) -> tuple[float, float]:
    """Fuse a direction of flight [rad, from east], variance r: of the velocity over ground, or through the air v - w.

    A magnetometer tells the heading of the nose. It is a direction of flight only of a craft that points where it
    flies, and then *through the air*; over ground there is the wind. Below `slowest` [m/s], or two standard deviations
    of the speed, a direction says nothing: NaN, and nothing changes. Returns (NIS, its variance); w (n,) is scratch.
    """
    n = x.size
    air = through_air and n == 9
    vx, vy = x[3] - (x[6] if air else 0.0), x[4] - (x[7] if air else 0.0)
    square = vx * vx + vy * vy
    if not (square > slowest * slowest and square > 4.0 * (P[3, 3] + P[4, 4])):
        return nan, nan
    return fuse_row(x, P, -vy / square, vx / square, air, wrap(angle - atan2(vy, vx)), r, gate, w)


@kernel
def fuse_row(
    x: Floats, P: Floats, hx: float, hy: float, air: bool, e: float, r: float, gate: float, w: Floats
) -> tuple[float, float]:
    """Fuse an innovation e of variance r whose Jacobian is (hx, hy) by the horizontal velocity (less wind, if air)."""
    n = x.size
    for i in range(n):
        w[i] = hx * P[i, 3] + hy * P[i, 4]
        if air:
            w[i] -= hx * P[i, 6] + hy * P[i, 7]
    s = r + hx * w[3] + hy * w[4]
    if air:
        s -= hx * w[6] + hy * w[7]
    if not (s > 0.0 and e * e < inf):
        return nan, nan
    share = 1.0 / s
    if e * e * share <= gate:
        for i in range(n):
            x[i] += w[i] * e * share
            for j in range(i, n):
                P[i, j] -= w[i] * w[j] * share
                P[j, i] = P[i, j]
    return e * e * share, s


# ------------------------------------------------------------------------------------------------ many robots


@kernel
def predict_rows(X: Floats, P: Floats, U: Floats, c: Floats) -> None:
    """Every row one step later.  X (N, n), P (N, n, n), U (N, 3), one step c (3, STEP) for all."""
    for k in range(X.shape[0]):
        predict(X[k], P[k], U[k], c)


@kernel
def update_rows(X: Floats, P: Floats, at: int, Z: Floats, R: Floats, gate: float, nis: Floats) -> int:
    """Fuse a position (at 0) or velocity (at 3) into every row; returns how many were fused.

    X (N, n), P (N, n, n), Z (N, 3), R (N, 3) variances, inf where not measured; nis (N,) is written, NaN in rows whose
    first number is NaN: nothing was received there.
    """
    fused = 0
    for k in range(X.shape[0]):
        nis[k] = nan
        if Z[k, 0] == Z[k, 0]:
            nis[k], _ = update(X[k], P[k], at, Z[k], R[k], gate)
            fused += 1 if nis[k] <= gate else 0
    return fused


@kernel
def forecast_rows(X: Floats, U: Floats, c: Floats, out: Floats) -> None:
    """out (N, n) <- means of every row one step later, without covariances: what is now, from fixes that are late."""
    for k in range(X.shape[0]):
        for i in range(3):
            pull = U[k, i] + (X[k, 6 + i] if X.shape[1] == 9 else 0.0)
            out[k, i] = X[k, i] + c[i, 0] * X[k, 3 + i] + c[i, 2] * pull
            out[k, 3 + i] = c[i, 1] * X[k, 3 + i] + c[i, 3] * pull
            if X.shape[1] == 9:
                out[k, 6 + i] = X[k, 6 + i]
