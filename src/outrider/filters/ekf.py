"""Extended Kalman filter on the error state: kernels for the loops, pure functions (belief in, belief out) above them.

The error of a belief lives in the tangent space at its mean, x_true = x [+] e with e ~ N(0, P). Innovations are
y = z [-] h(x) and h_D_x is the Jacobian of h by e. Kernels take independent measurement noises r (m,); the public
functions take any R and whiten it. A *consider* state (Schmidt 1966) keeps its value and its variance, and its
correlations go on being updated: its rows of the gain are zero.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np

from outrider._kernel import inlined, kernel
from outrider.core.linalg import (
    cholesky,
    mirror,
    sandwich,
    solve_lower,
    solve_lower_rows,
)
from outrider.core.manifold import local, retract
from outrider.core.rotations import right_jacobian, right_jacobian_inverse
from outrider.data.belief import Gaussian, StateLayout
from outrider.errors import DataError
from outrider.typing import Floats, Ints

# ------------------------------------------------------------------------------------------------ kernels


class Work(NamedTuple):
    """Scratch of one filter, reused by every step. m is the largest number of measurements in one update.

    Rows are padded with zeros to whole vector registers (8 numbers), which halves the time.
    """

    s: Floats  # (m,)  predicted variance of each measurement, its noise included
    M: Floats  # (n, n)  P, after `innovate` that after the update
    c: Floats  # (n,)  h M, of one measurement
    K: Floats  # (n,)  its gain
    G: Floats  # (n,)  h M' - r K, M' = M - c' K
    dx: Floats  # (n,)  the correction
    on: Ints  # (n + 1,)  where h is not zero, and how often
    W: Floats  # (n, n)  F P, not padded, as what follows
    seen: Floats  # (n, n)  1 where the last F was not zero
    at: Ints  # (n, n + 1)  the same, as lists
    d: Floats  # (n,)  diagonal of F
    J: Floats  # (3, 3)


def workspace(n: int, m: int) -> Work:
    """Scratch for n error states and at most m measurements."""
    width = -(-n // 8) * 8
    return Work(
        s=np.zeros(m),
        M=np.zeros((n, width)),
        c=np.zeros(width),
        K=np.zeros(width),
        G=np.zeros(width),
        dx=np.zeros(width),
        on=np.zeros(n + 1, np.int64),
        W=np.zeros((n, n)),
        seen=np.zeros((n, n)),
        at=np.zeros((n, n + 1), np.int64),
        d=np.zeros(n),
        J=np.zeros((3, 3)),
    )


@kernel
def innovate(P: Floats, H: Floats, r: Floats, y: Floats, m: int, w: Work) -> float:
    """The first half of an update: everything but its acceptance. Returns the NIS y' S^-1 y to gate on.

    Independent measurements are fused one after the other, which is the joint update without its matrix inverse
    (Bierman 1977, ch. V): w.M and w.dx become covariance and correction, and the squares of what each measurement says
    beyond those before it add up to the joint NIS; NaN when S = H P H' + diag(r) is not positive definite or y not
    finite.
    """
    n = P.shape[0]
    for i in range(n):
        for j in range(n):
            w.M[i, j] = P[i, j]
    for j in range(w.dx.size):
        w.dx[j] = 0.0
    for k in range(m):
        w.s[k] = np.nan
    nis = 0.0
    for k in range(m):
        entries(H, k, w.on)
        w.s[k] = r[k] + variance(P, H, k, w.on)
        e, s = y[k], r[k]
        combine(w.M, H, k, w.on, w.c)
        for l in range(w.on[n]):
            i = w.on[l]
            s += H[k, i] * w.c[i]
            e -= H[k, i] * w.dx[i]
        if not 0.0 < s < np.inf or not abs(e) < np.inf:
            return np.nan
        share = 1.0 / s
        nis += e * e * share
        for j in range(w.dx.size):
            w.K[j] = w.c[j] * share
            w.dx[j] += w.K[j] * e
        joseph(H, r[k], k, w)
    return nis


@inlined
def entries(H: Floats, k: int, on: Ints) -> None:
    """on <- the columns where row k of H is not zero; in its last place how many."""
    count = 0
    for i in range(H.shape[1]):
        on[count] = i
        count += 1 if H[k, i] != 0.0 else 0
    on[H.shape[1]] = count


@inlined
def variance(P: Floats, H: Floats, k: int, on: Ints) -> float:
    """h P h' of row k of H, whose non-zeros are known."""
    total = 0.0
    for a in range(on[H.shape[1]]):
        for b in range(on[H.shape[1]]):
            total += H[k, on[a]] * H[k, on[b]] * P[on[a], on[b]]
    return total


@inlined
def combine(M: Floats, H: Floats, k: int, on: Ints, c: Floats) -> None:
    """c <- h M with h row k of H, whose non-zeros are known."""
    for j in range(c.size):
        c[j] = 0.0
    for l in range(on[H.shape[1]]):
        i = on[l]
        h = H[k, i]
        for j in range(c.size):
            c[j] += h * M[i, j]


@inlined
def joseph(H: Floats, r: float, k: int, w: Work) -> None:
    """w.M <- (I - K' h) M (I - K' h)' + r K' K for any gain K of measurement h, row k of H, and c = h M.

    In two steps, M' = M - c' K and M' - K' (h M' - r K), that must see the same rounded M': what the first loses of a
    small variance by cancellation the second puts right.
    """
    n, width = np.uint64(w.M.shape[0]), np.uint64(w.M.shape[1])
    for j in range(width):
        w.G[j] = -r * w.K[j]
    for l in range(w.on[n]):
        i = w.on[l]
        h, a = H[k, i], w.c[i]
        for j in range(width):
            w.G[j] += h * (w.M[i, j] - a * w.K[j])
    for i in range(n):
        a, b = w.c[i], w.K[i]
        for j in range(width):
            w.M[i, j] = (w.M[i, j] - a * w.K[j]) - b * w.G[j]


@kernel
def transport(P: Floats, dx: Floats, table: Ints, back: bool, J: Floats) -> None:
    """P <- J P J', the covariance carried from the tangent space at x to that at x [+] dx (or back from there).

    Exp(dx + e) = Exp(dx) Exp(Jr(dx) e): only rotations notice.  J (3, 3) is scratch.
    """
    n = P.shape[0]
    for b in range(table.shape[0]):
        if table[b, 0] != 2:
            continue
        s = table[b, 2]
        if back:
            right_jacobian_inverse(dx[s : s + 3], J)
        else:
            right_jacobian(dx[s : s + 3], J)
        for j in range(n):
            p, q, r = P[s, j], P[s + 1, j], P[s + 2, j]
            for i in range(3):
                P[s + i, j] = J[i, 0] * p + J[i, 1] * q + J[i, 2] * r
        for i in range(3):
            p, q, r = P[s + i, s], P[s + i, s + 1], P[s + i, s + 2]
            for j in range(i + 1):
                P[s + i, s + j] = J[j, 0] * p + J[j, 1] * q + J[j, 2] * r
        for i in range(3):
            for j in range(n):
                if j < s + i or j >= s + 3:
                    P[j, s + i] = P[s + i, j]


@inlined
def correct(x: Floats, P: Floats, keep: Floats, table: Ints, w: Work) -> None:
    """Second half of an update, after `innovate` and its gate. The correction is in w.dx.

    States with keep 0 are considered, with 1 estimated. A gain without the rows of considered states gives the same
    covariance as the whole gain, except among the considered states themselves: there nothing changes.
    """
    n = P.shape[0]
    for i in range(n):
        if keep[i] == 0.0:
            w.dx[i] = 0.0
            for j in range(n):
                if keep[j] == 0.0:
                    w.M[i, j] = P[i, j]
    mirror(w.M, P)
    transport(P, w.dx, table, False, w.J)
    retract(x, w.dx, table)


@inlined
def propagate(P: Floats, F: Floats, Q: Floats, w: Work) -> None:
    """P <- F P F' + Q."""
    sandwich(P, F, Q, w.W, w.seen, w.at, w.d)


# ------------------------------------------------------------------------------------------------ pure steps


@final
@dataclass(frozen=True, slots=True)
class Updated:
    """A belief after a measurement, with what the gate needs: S (m, m) and nis = y' S^-1 y."""

    belief: Gaussian
    S: Floats
    nis: float
    repaired: int = 0  # eigenvalues of the prior covariance that had to be raised first (unscented filter)


def predict(belief: Gaussian, x_new: Floats, F: Floats, Q: Floats) -> Gaussian:
    """The belief one process step later: P = F P F' + Q.

    Parameters
    ----------
    x_new : (layout.size,) f(x), the mean after the step
    F, Q : (n, n) Jacobian of the step by the error state, and the noise it adds to the error state
    """
    P = belief.P.copy()
    propagate(P, np.ascontiguousarray(F, float), np.ascontiguousarray(Q, float), workspace(P.shape[0], 1))
    return Gaussian(np.array(x_new, float), P, belief.layout)


def update(belief: Gaussian, y: Floats, H: Floats, R: Floats, *, consider: tuple[str, ...] = ()) -> Updated:
    """Fuse one measurement in Joseph form, which holds for any gain.

    Parameters
    ----------
    y : (m,) innovation z [-] h(x)
    H : (m, n) Jacobian of h by the error state
    R : (m, m) noise covariance of z, or (m,) variances
    consider : names of state blocks that the measurement depends on and must not change

    Raises
    ------
    DataError   S or R is not positive definite
    """
    x, P = belief.x.copy(), belief.P.copy()
    white_y, white_H, r = whitened(y, H, R)
    m = r.size
    w = workspace(P.shape[0], m)
    nis = innovate(P, white_H, r, white_y, m, w)
    if not np.isfinite(nis):
        raise DataError("the innovation covariance is not positive definite", fix="check P and R for negative or NaN")
    S = H @ belief.P @ np.transpose(H) + (np.diag(R) if np.ndim(R) == 1 else R)
    correct(x, P, kept(belief.layout, consider), belief.layout.table, w)
    return Updated(Gaussian(x, P, belief.layout), S, nis)


def iterate(
    belief: Gaussian,
    model: Callable[[Floats], tuple[Floats, Floats]],
    R: Floats,
    *,
    consider: tuple[str, ...] = (),
    steps: int = 20,
    tolerance: float = 1e-9,
) -> Updated:
    """Iterated update: Gauss-Newton to the most probable state, then one covariance update there (Bell, Cathey 1993).

    Parameters
    ----------
    model : x -> (y, H), the innovation z [-] h(x) and the Jacobian of h at x, both (re-)evaluated at each iterate
    tolerance : stop when no error component moves by more than this many of its standard deviations
    """
    layout, P = belief.layout, belief.P
    e = np.zeros(P.shape[0])
    scale = tolerance * np.sqrt(np.maximum(np.diag(P), 1e-300))
    first = step = update(belief, *model(belief.x), R, consider=consider)
    for _ in range(steps):
        moved, e = e, np.zeros(e.size)
        local(step.belief.x, belief.x, layout.table, e)
        if np.all(np.abs(e - moved) <= scale):
            break
        y, H = model(step.belief.x)
        H_hat = H @ tangent_map(e, layout)  # by the error at the prior mean
        step = update(belief, y + H_hat @ e, H_hat, R, consider=consider)
    return Updated(step.belief, first.S, first.nis)


def tangent_map(e: Floats, layout: StateLayout) -> Floats:
    """J (n, n) with x [+] (e + d) = (x [+] e) [+] J d to first order."""
    J = np.eye(layout.error_size)
    for block in layout:
        if block.manifold.name == "ROTATION":
            right_jacobian(e[block.error], J3 := np.zeros((3, 3)))
            J[block.error, block.error] = J3
    return J


def kept(layout: StateLayout, consider: tuple[str, ...]) -> Floats:
    """(n,) 1 for states that updates may change, 0 for those only considered."""
    keep = np.ones(layout.error_size)
    for name in consider:
        keep[layout.error(name)] = 0.0
    return keep


def whitened(y: Floats, H: Floats, R: Floats) -> tuple[Floats, Floats, Floats]:
    """(y, H, r) with independent noises of variances r. A diagonal R is left as it is, zeros allowed."""
    white_y, white_H, noise = np.array(y, float), np.array(H, float, order="C"), np.array(R, float)
    variances = noise if noise.ndim == 1 else np.diag(noise).copy()
    root = np.eye(variances.size)
    if noise.ndim == 1 or not np.any(noise - np.diag(variances)):
        return white_y, white_H, variances
    if not cholesky(noise, white_y.size, root):
        raise DataError("the measurement covariance is not positive definite", fix="give variances, or a valid R")
    solve_lower(root, white_y.size, white_y)
    solve_lower_rows(root, white_y.size, white_H)
    return white_y, white_H, np.ones(white_y.size)
