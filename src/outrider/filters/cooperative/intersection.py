"""Covariance intersection between two robots: safe whatever their correlation, at a price in accuracy.

Each robot divides its covariance into a part that may be correlated with others, P_d, and one that is its own, P_s. Of
a relative measurement robot i takes, for some weight w in (0, 1),

    P_i^w = P_d,i / w + P_s,i,   P_j^w = P_d,j / (1 - w) + P_s,j,   then an update as if both were independent,

with the w of 19 that leaves the least determinant of its pose, and nothing where none helps. `ci` (Julier and Uhlmann
1997) has no P_s and divides the noise of the measurement too. `split` (Julier and Uhlmann 2001; Li and Nashashibi 2013)
counts as own what has come in since the last exchange, P_d = Psi P_0 Psi': after an exchange everything is dependent,
since variants that keep a part independent are not safe for two robots that talk both ways.
"""

from math import log

import numpy as np

from outrider._kernel import kernel
from outrider.core.linalg import cholesky, solve_lower
from outrider.core.manifold import retract
from outrider.filters.cooperative.meeting import keep_copy, pair, product, relate
from outrider.filters.cooperative.tables import (
    DIVERGED,
    GATED,
    I_N,
    I_POSE,
    I_POSES,
    NOT_OBSERVING,
    USED,
    Beliefs,
    Scratch,
    Tables,
    blocks,
    errors,
    identity,
    shaped,
    sized,
    square,
    state,
)
from outrider.filters.ekf import innovate, transport
from outrider.typing import Floats, Ints

WEIGHTS = 20  # w = 1/20 ... 19/20
_A_D, _A, _B_D, _B, _S, _L, _V_D, _V, _U_D, _U, _X, _W = range(12)  # of Scratch.pick


@kernel
def intersect(t: Tables, b: Beliefs, ws: Scratch, src: int, z: Floats, r: Floats, split: bool, out: Floats) -> None:
    """Fuse a relative record by covariance intersection, both ways.  out <- verdict, NIS, degrees of freedom."""
    i, j = min(t.member[src], t.partner[src]), max(t.member[src], t.partner[src])
    n_i, n_j = t.index[i, I_N], t.index[j, I_N]
    m = relate(t, b, ws, src, z, r)
    out[0], out[2] = NOT_OBSERVING, m
    if m == 0:
        return
    C = pair(t, b, ws, i, j, square(t, b.P, i), False)
    share(t, b, ws, i, split, shaped(ws.square[1], n_i, n_i))
    share(t, b, ws, j, split, shaped(ws.square[2], n_j, n_j))
    gained_i = toward(t, ws, i, 0, n_i, m, src, C, split, out)
    gained_j = toward(t, ws, j, n_i, n_i, m, src, C, split, out)
    if gained_i:
        adopt(t, b, ws, i, ws.vector[0], shaped(ws.square[3], n_i, n_i))
    if gained_j:
        adopt(t, b, ws, j, ws.vector[1], shaped(ws.square[4], n_j, n_j))
    if split and (gained_i or gained_j):
        for side in range(2):
            who = i if side == 0 else j
            keep_copy(square(t, b.P, who), square(t, b.before, who))
            identity(square(t, b.carried, who))


@kernel
def share(t: Tables, b: Beliefs, ws: Scratch, i: int, split: bool, out: Floats) -> None:
    """out <- P_d, the part of member i's covariance that may be correlated."""
    n = t.index[i, I_N]
    if not split:
        keep_copy(square(t, b.P, i), out)
        return
    Psi, W = square(t, b.carried, i), shaped(ws.square[0], n, n)
    product(Psi, square(t, b.before, i), W)
    for r in range(n):
        for c in range(n):
            out[r, c] = 0.0
            for k in range(n):
                out[r, c] += W[r, k] * Psi[c, k]


@kernel
def toward(
    t: Tables, ws: Scratch, who: int, first: int, n_i: int, m: int, src: int, C: Floats, split: bool, out: Floats
) -> bool:
    """Correction and covariance of member `who`, whose errors begin at `first` in C; whether there is a gain."""
    n, own = C.shape[0], t.index[who, I_N]
    H, Pd_i, Pd_j = shaped(ws.H, ws.y.size, n), shaped(ws.square[1], n_i, n_i), shaped(ws.square[2], n - n_i, n - n_i)
    poses = t.pose[t.index[who, I_POSE] : t.index[who, I_POSE] + t.index[who, I_POSES]]
    Pd, other, beyond = (Pd_i, Pd_j, n_i) if first == 0 else (Pd_j, Pd_i, 0)
    weight = best_weight(ws, m, H, C, Pd, first, other, beyond, poses, split)
    if not weight > 0.0:
        return False
    inflated, w_i = shaped(ws.C[1], n, n), weight if first == 0 else 1.0 - weight
    keep_copy(C, inflated)
    for r in range(n):
        for c in range(n):
            if r < n_i and c < n_i:
                inflated[r, c] += (1.0 / w_i - 1.0) * Pd_i[r, c]
            elif r >= n_i and c >= n_i:
                inflated[r, c] += (1.0 / (1.0 - w_i) - 1.0) * Pd_j[r - n_i, c - n_i]
    w = sized(t, ws, n, (n + 7) // 8 * 8)
    noise = 1.0 if split else 1.0 / (1.0 - weight)
    for k in range(m):
        ws.r[k] *= noise
    nis = innovate(inflated, H, ws.r, ws.y, m, w)
    for k in range(m):
        ws.r[k] /= noise
    out[1] = nis
    if not nis <= t.gate[src, m]:
        out[0] = GATED if np.isfinite(nis) else DIVERGED
        return False
    out[0] = USED
    slot = 0 if first == 0 else 1
    P, dx = shaped(ws.square[3 + slot], own, own), ws.vector[slot]
    for r in range(own):
        dx[r] = w.dx[first + r]
        for c in range(own):
            P[r, c] = 0.5 * (w.M[first + r, first + c] + w.M[first + c, first + r])
    return True


@kernel
def adopt(t: Tables, b: Beliefs, ws: Scratch, i: int, dx: Floats, P_new: Floats) -> None:
    """Member i takes a correction; considered states keep value and variance."""
    P, keep = square(t, b.P, i), errors(t, t.keep, i)
    for r in range(P.shape[0]):
        dx[r] *= keep[r]
        for c in range(P.shape[0]):
            if keep[r] != 0.0 or keep[c] != 0.0:
                P[r, c] = P_new[r, c]
    retract(state(t, b, i), dx, blocks(t, i))
    transport(P, dx, blocks(t, i), False, ws.w.J)


@kernel
def quadratic(H: Floats, m: int, first: int, P: Floats, at: int, n: int, out: Floats) -> None:
    """out (m, m) <- H_b P H_b', the block b of n columns of H beginning at `first`; of P at `at`."""
    for k in range(m):
        for l in range(m):
            out[k, l] = 0.0
    for r in range(n):
        for c in range(n):
            p = P[at + r, at + c]
            if p != 0.0:
                for k in range(m):
                    h = H[k, first + r] * p
                    if h != 0.0:
                        for l in range(m):
                            out[k, l] += h * H[l, first + c]


@kernel
def pose_part(H: Floats, m: int, first: int, P: Floats, at: int, n: int, poses: Ints, V: Floats, U: Floats) -> None:
    """V <- P of the pose rows, U (poses, m) <- P H_b' of them."""
    for r in range(poses.size):
        for c in range(poses.size):
            V[r, c] = P[at + poses[r], at + poses[c]]
        for k in range(m):
            U[r, k] = 0.0
            for c in range(n):
                U[r, k] += P[at + poses[r], at + c] * H[k, first + c]


@kernel
def best_weight(
    ws: Scratch,
    m: int,
    H: Floats,
    C: Floats,
    Pd: Floats,
    first: int,
    other: Floats,
    beyond: int,
    poses: Ints,
    split: bool,
) -> float:
    """The weight of one's own estimate whose update leaves the least determinant of the pose; 0: none helps."""
    n, rest, a = Pd.shape[0], other.shape[0], ws.pick
    quadratic(H, m, first, Pd, 0, n, a[_A_D])
    quadratic(H, m, first, C, first, n, a[_A])
    quadratic(H, m, beyond, other, 0, rest, a[_B_D])
    quadratic(H, m, beyond, C, beyond, rest, a[_B])
    pose_part(H, m, first, Pd, 0, n, poses, a[_V_D], a[_U_D])
    pose_part(H, m, first, C, first, n, poses, a[_V], a[_U])
    best, chosen = log_determinant(a[_V], poses.size, a[_W]), 0.0
    for step in range(1, WEIGHTS):
        w = step / WEIGHTS
        f, g, noise = 1.0 / w - 1.0, w / (1.0 - w), 1.0 if split else 1.0 / (1.0 - w)
        for k in range(m):
            for l in range(m):
                a[_S, k, l] = a[_A, k, l] + f * a[_A_D, k, l] + a[_B, k, l] + g * a[_B_D, k, l]
            a[_S, k, k] += noise * ws.r[k]
        if not cholesky(a[_S], m, a[_L]):
            continue
        for p in range(poses.size):
            for k in range(m):
                a[_X, p, k] = a[_U, p, k] + f * a[_U_D, p, k]
            solve_lower(a[_L], m, a[_X, p])
        for p in range(poses.size):
            for q in range(poses.size):
                total = a[_V, p, q] + f * a[_V_D, p, q]
                for k in range(m):
                    total -= a[_X, p, k] * a[_X, q, k]
                a[_S, p, q] = total
        size = log_determinant(a[_S], poses.size, a[_W])
        if size < best:
            best, chosen = size, w
    return chosen


@kernel
def log_determinant(A: Floats, n: int, L: Floats) -> float:
    """log det of the leading (n, n) block; infinite if it is no covariance."""
    if not cholesky(A, n, L):
        return np.inf
    total = 0.0
    for k in range(n):
        total += 2.0 * log(L[k, k])
    return total
