"""Two robots meet: one measures the other, both correct themselves, nobody else is asked.

A relative measurement does not notice if the whole world is moved, so its Jacobian by the one who is seen follows from
that by the one who looks: every sensor that looks at a target works between robots.

`catch_up` is what makes the distributed filter exact for two. Let P_ij = s_i s_j' after the last meeting, and Psi,
Lambda, xi of both as in `alone`; with l = s' Lambda s and h = s' xi of each, all that both have measured meanwhile is

    p_j = (I - l_j l_i)^-1 (h_j - l_j h_i),   x_i <- x_i + Psi_i s_i p_j,   and the same with i and j exchanged,
    P_ii <- P_ii - S_i (I - l_j l_i)^-1 l_j S_i',   P_ij = S_i (I - l_j l_i)^-1 S_j',   S = Psi s,

by conditioning both errors on both robots' innovations, which are white each and correlated through s_i s_j' only.
Robots keep factors of their correlations as Luft et al. 2018 do, and as there those of third parties follow by
P_new P_old^-1: exact if third parties know of the partner only through this robot. Derivation and code are our own.
"""

import numpy as np

from outrider._kernel import kernel
from outrider.core.linalg import chain, cholesky, mirror, solve_lower_rows, solve_upper_rows
from outrider.core.manifold import retract
from outrider.filters.cooperative.alone import look, squeeze, turn_rows
from outrider.filters.cooperative.tables import (
    DIVERGED,
    GATED,
    I_N,
    NOT_OBSERVING,
    USED,
    Beliefs,
    Scratch,
    Tables,
    blocks,
    errors,
    factor,
    identity,
    shaped,
    sized,
    square,
    state,
    view,
)
from outrider.filters.ekf import innovate, transport
from outrider.models.kinematics import K_P, K_R, T_P, T_TH
from outrider.models.sensors.dispatch import evaluate
from outrider.models.sensors.layout import OWN
from outrider.typing import Floats


@kernel
def relate(t: Tables, b: Beliefs, ws: Scratch, src: int, z: Floats, r: Floats) -> int:
    """Innovation ws.y and Jacobian ws.H by the errors of both, earlier member first; returns how many rows count."""
    i, j = t.member[src], t.partner[src]
    look(t, b, ws, i)
    look(t, b, ws, j)
    for c in range(ws.parameters.size):
        ws.parameters[c] = t.parameters[src, c]
    for c in range(3):
        ws.parameters[OWN + c] = ws.k[j, K_P + c]
    for c in range(9):
        ws.parameters[OWN + 3 + c] = ws.k[j, K_R + c]
    rows = evaluate(t.code[src], ws.k[i], z, ws.parameters, ws.y, ws.D[0])
    other_side(ws, ws.k[i], ws.k[j], rows)
    m = squeeze(ws, rows, r)
    n_i, n_j = t.index[i, I_N], t.index[j, I_N]
    H = shaped(ws.H, ws.y.size, n_i + n_j)
    for side in range(2):
        who, first = (i, 0 if i < j else n_j) if side == 0 else (j, n_i if i < j else 0)
        own = shaped(ws.H_own, ws.y.size, t.index[who, I_N])
        chain(ws.D[side], view(t, ws, who), m, own)
        for k in range(m):
            for c in range(own.shape[1]):
                H[k, first + c] = own[k, c]
    return m


@kernel
def other_side(ws: Scratch, k_i: Floats, k_j: Floats, rows: int) -> None:
    """D[1], by the one who is seen, such that moving or turning the whole world changes nothing."""
    d0, d1, d2 = k_i[K_P] - k_j[K_P], k_i[K_P + 1] - k_j[K_P + 1], k_i[K_P + 2] - k_j[K_P + 2]
    for row in range(rows):
        D, E = ws.D[0, row], ws.D[1, row]
        for c in range(E.size):
            E[c] = 0.0
        p0, p1, p2 = D[T_P], D[T_P + 1], D[T_P + 2]
        E[T_P], E[T_P + 1], E[T_P + 2] = -p0, -p1, -p2
        # turned by phi about the other's place: p by phi x d, attitude by R' phi
        w0, w1, w2 = d1 * p2 - d2 * p1, d2 * p0 - d0 * p2, d0 * p1 - d1 * p0
        for c in range(3):
            w0 += k_i[K_R + c] * D[T_TH + c]
            w1 += k_i[K_R + 3 + c] * D[T_TH + c]
            w2 += k_i[K_R + 6 + c] * D[T_TH + c]
        for c in range(3):
            E[T_TH + c] = -(k_j[K_R + c] * w0 + k_j[K_R + 3 + c] * w1 + k_j[K_R + 6 + c] * w2)


@kernel
def product(A: Floats, B: Floats, out: Floats) -> None:
    """out <- A B."""
    for i in range(A.shape[0]):
        for j in range(B.shape[1]):
            out[i, j] = 0.0
        for k in range(A.shape[1]):
            a = A[i, k]
            if a != 0.0:
                for j in range(B.shape[1]):
                    out[i, j] += a * B[k, j]


@kernel
def within(s: Floats, A: Floats, W: Floats, out: Floats) -> None:
    """out <- s' A s.  s (n, r), A (n, n), W (n, r) scratch, out (r, r)."""
    product(A, s, W)
    for i in range(s.shape[1]):
        for j in range(s.shape[1]):
            total = 0.0
            for k in range(s.shape[0]):
                total += s[k, i] * W[k, j]
            out[i, j] = total


@kernel
def invert(A: Floats, out: Floats) -> None:
    """out <- A^-1 by elimination with pivots; A is lost. Singular: what is left is not finite."""
    n = A.shape[0]
    identity(out)
    for c in range(n):
        best = c
        for i in range(c + 1, n):
            if abs(A[i, c]) > abs(A[best, c]):
                best = i
        for j in range(n):
            A[c, j], A[best, j] = A[best, j], A[c, j]
            out[c, j], out[best, j] = out[best, j], out[c, j]
        share = 1.0 / A[c, c]
        for j in range(n):
            A[c, j] *= share
            out[c, j] *= share
        for i in range(n):
            a = A[i, c]
            if i != c and a != 0.0:
                for j in range(n):
                    A[i, j] -= a * A[c, j]
                    out[i, j] -= a * out[c, j]


@kernel
def catch_up(t: Tables, b: Beliefs, ws: Scratch, i: int, j: int, cross: Floats) -> None:
    """Both robots hear what the other has measured since; cross (n_i, n_j) <- P_ij.  i < j."""
    n_j = t.index[j, I_N]
    l_i, l_j = shaped(ws.square[1], n_j, n_j), shaped(ws.square[2], n_j, n_j)
    A, inverse = shaped(ws.square[3], n_j, n_j), shaped(ws.square[4], n_j, n_j)
    h_i, h_j, p_i, p_j = ws.vector[0], ws.vector[1], ws.vector[2], ws.vector[3]
    for side in range(2):
        who, s = (i, factor(t, b, i, j)) if side == 0 else (j, factor(t, b, j, i))
        n, h, heard = t.index[who, I_N], (h_i if side == 0 else h_j), errors(t, b.heard, who)
        within(s, square(t, b.told, who), shaped(ws.square[0], n, n_j), l_i if side == 0 else l_j)
        for c in range(n_j):
            h[c] = 0.0
            for k in range(n):
                h[c] += s[k, c] * heard[k]
        carry(t, b, ws, who, s)
    if not (estimated(t, i) and estimated(t, j)):
        silence(l_i, h_i)
        silence(l_j, h_j)
    product(l_j, l_i, A)
    for r in range(n_j):
        for c in range(n_j):
            A[r, c] = (1.0 if r == c else 0.0) - A[r, c]
    invert(A, inverse)
    for r in range(n_j):
        p_i[r] = h_j[r]
        for c in range(n_j):
            p_i[r] -= l_j[r, c] * h_i[c]
    for r in range(n_j):
        p_j[r] = 0.0
        for c in range(n_j):
            p_j[r] += inverse[r, c] * p_i[c]
    for r in range(n_j):
        p_i[r] = h_i[r]
        for c in range(n_j):
            p_i[r] -= l_i[r, c] * p_j[c]
    G = shaped(ws.square[5], n_j, n_j)
    product(inverse, l_j, G)
    learn(t, b, ws, i, factor(t, b, i, j), p_j, G)
    product(l_i, inverse, G)
    learn(t, b, ws, j, factor(t, b, j, i), p_i, G)
    W = shaped(ws.square[0], t.index[i, I_N], n_j)
    product(factor(t, b, i, j), inverse, W)
    s_j = factor(t, b, j, i)
    for r in range(W.shape[0]):
        for c in range(n_j):
            cross[r, c] = 0.0
            for k in range(n_j):
                cross[r, c] += W[r, k] * s_j[c, k]


@kernel
def estimated(t: Tables, i: int) -> bool:
    """Whether member i estimates all of its states."""
    keep = errors(t, t.keep, i)
    every = True
    for k in range(keep.size):
        every = every and keep[k] != 0.0
    return every


@kernel
def silence(l: Floats, h: Floats) -> None:
    """Nothing was measured."""
    for r in range(l.shape[0]):
        h[r] = 0.0
        for c in range(l.shape[0]):
            l[r, c] = 0.0


@kernel
def carry(t: Tables, b: Beliefs, ws: Scratch, i: int, s: Floats) -> None:
    """s <- Psi s."""
    W = shaped(ws.square[0], s.shape[0], s.shape[1])
    product(square(t, b.carried, i), s, W)
    for r in range(s.shape[0]):
        for c in range(s.shape[1]):
            s[r, c] = W[r, c]


@kernel
def learn(t: Tables, b: Beliefs, ws: Scratch, i: int, s: Floats, p: Floats, G: Floats) -> None:
    """x <- x [+] s p,  P <- P - s G s'."""
    n, P, dx = t.index[i, I_N], square(t, b.P, i), ws.w.dx
    W = shaped(ws.square[0], n, s.shape[1])
    product(s, G, W)
    for r in range(n):
        dx[r] = 0.0
        for k in range(s.shape[1]):
            dx[r] += s[r, k] * p[k]
    for r in range(n):
        for c in range(r + 1):
            total = 0.0
            for k in range(s.shape[1]):
                total += 0.5 * (W[r, k] * s[c, k] + W[c, k] * s[r, k])
            P[r, c] -= total
            P[c, r] = P[r, c]
    retract(state(t, b, i), dx, blocks(t, i))
    transport(P, dx, blocks(t, i), False, ws.w.J)
    turn_rows(s, dx, blocks(t, i), ws.w.J)


@kernel
def pair(t: Tables, b: Beliefs, ws: Scratch, i: int, j: int, cross: Floats, known: bool) -> Floats:
    """C <- [[P_i, P_ij], [P_ji, P_j]], P_ij zero unless `known`; ws.keep of both."""
    n_i, n_j = t.index[i, I_N], t.index[j, I_N]
    C, P_i, P_j = shaped(ws.C[0], n_i + n_j, n_i + n_j), square(t, b.P, i), square(t, b.P, j)
    for r in range(n_i):
        for c in range(n_i):
            C[r, c] = P_i[r, c]
        for c in range(n_j):
            C[r, n_i + c] = C[n_i + c, r] = cross[r, c] if known else 0.0
    for r in range(n_j):
        for c in range(n_j):
            C[n_i + r, n_i + c] = P_j[r, c]
    keep_i, keep_j = errors(t, t.keep, i), errors(t, t.keep, j)
    for r in range(n_i):
        ws.keep[r] = keep_i[r]
    for r in range(n_j):
        ws.keep[n_i + r] = keep_j[r]
    return C


@kernel
def divide(t: Tables, b: Beliefs, ws: Scratch, i: int, j: int, C: Floats, M: Floats, cross: Floats) -> None:
    """Both take what is theirs of an update in M and ws.w.dx of C; cross (n_i, n_j) <- P_ij."""
    n_i, n, dx = t.index[i, I_N], C.shape[0], ws.w.dx
    for r in range(n):
        if ws.keep[r] == 0.0:
            dx[r] = 0.0
            for c in range(n):
                if ws.keep[c] == 0.0:
                    M[r, c] = C[r, c]
    mirror(M, C)
    take(t, b, ws, i, C, 0, dx)
    take(t, b, ws, j, C, n_i, dx[n_i:])
    for r in range(n_i):
        for c in range(n - n_i):
            cross[r, c] = C[r, n_i + c]


@kernel
def take(t: Tables, b: Beliefs, ws: Scratch, i: int, C: Floats, first: int, dx: Floats) -> None:
    """Member i's own covariance from C, its state corrected by dx."""
    P = square(t, b.P, i)
    for r in range(P.shape[0]):
        for c in range(P.shape[0]):
            P[r, c] = C[first + r, first + c]
    retract(state(t, b, i), dx, blocks(t, i))
    transport(P, dx, blocks(t, i), False, ws.w.J)


@kernel
def settle(t: Tables, b: Beliefs, ws: Scratch, i: int, j: int, old: Floats) -> None:
    """What third parties share with member i follows it through the meeting with j; i starts anew.

    s_ik <- P P_old^-1 Psi s_ik, P_old being i's covariance before the meeting; singular where a state is not in use.
    """
    n, P = t.index[i, I_N], square(t, b.P, i)
    L = shaped(ws.square[1], n, n)
    ready = False
    for k in range(t.index.shape[0]):
        if b.met[i, k] == 0 or k == j:
            continue
        if not ready:
            for r in range(n):
                old[r, r] = old[r, r] * (1.0 + 1e-12) if old[r, r] > 0.0 else 1.0
            ready = cholesky(old, n, L)
        s = factor(t, b, i, k)
        carry(t, b, ws, i, s)
        if ready:
            solve_lower_rows(L, n, s)
            solve_upper_rows(L, n, s)
            W = shaped(ws.square[0], n, s.shape[1])
            product(P, s, W)
            for r in range(n):
                for c in range(s.shape[1]):
                    s[r, c] = W[r, c]
    identity(square(t, b.carried, i))
    told, heard = square(t, b.told, i), errors(t, b.heard, i)
    for r in range(n):
        heard[r] = 0.0
        for c in range(n):
            told[r, c] = 0.0


@kernel
def distributed(t: Tables, b: Beliefs, ws: Scratch, src: int, z: Floats, r: Floats, out: Floats) -> None:
    """Fuse a relative record with the cross-covariance of the two.  out <- verdict, NIS, degrees of freedom."""
    i, j = min(t.member[src], t.partner[src]), max(t.member[src], t.partner[src])
    n_i, n_j = t.index[i, I_N], t.index[j, I_N]
    old_i, old_j = shaped(ws.square[6], n_i, n_i), shaped(ws.square[7], n_j, n_j)
    keep_copy(square(t, b.P, i), old_i)
    keep_copy(square(t, b.P, j), old_j)
    known = b.met[i, j] != 0
    cross = factor(t, b, i, j)
    if known:
        cross = shaped(ws.square[3], n_i, n_j)
        catch_up(t, b, ws, i, j, shaped(ws.square[5], n_i, n_j))
        keep_copy(shaped(ws.square[5], n_i, n_j), cross)
    m = relate(t, b, ws, src, z, r)
    accepted = update_pair(t, b, ws, i, j, src, m, cross, known, out)
    if known or accepted:
        s_i, s_j = factor(t, b, i, j), factor(t, b, j, i)
        keep_copy(cross, s_i)
        identity(s_j)
        if accepted:
            turn_rows(s_i, ws.w.dx, blocks(t, i), ws.w.J)
            turn_rows(s_j, ws.w.dx[n_i:], blocks(t, j), ws.w.J)
        b.met[i, j] = b.met[j, i] = 1
        settle(t, b, ws, i, j, old_i)
        settle(t, b, ws, j, i, old_j)


@kernel
def keep_copy(A: Floats, out: Floats) -> None:
    """out <- A."""
    for r in range(A.shape[0]):
        for c in range(A.shape[1]):
            out[r, c] = A[r, c]


@kernel
def update_pair(
    t: Tables, b: Beliefs, ws: Scratch, i: int, j: int, src: int, m: int, cross: Floats, known: bool, out: Floats
) -> bool:
    """Gate the innovation of `relate` and correct both; whether it was accepted. cross <- P_ij, if it was."""
    out[0], out[2] = NOT_OBSERVING, m
    if m == 0:
        return False
    C = pair(t, b, ws, i, j, cross, known)
    n = C.shape[0]
    w = sized(t, ws, n, (n + 7) // 8 * 8)
    nis = innovate(C, shaped(ws.H, ws.y.size, n), ws.r, ws.y, m, w)
    out[1] = nis
    if not nis <= t.gate[src, m]:
        out[0] = GATED if np.isfinite(nis) else DIVERGED
        return False
    out[0] = USED
    divide(t, b, ws, i, j, C, w.M, cross)
    return True


@kernel
def naive(t: Tables, b: Beliefs, ws: Scratch, src: int, z: Floats, r: Floats, out: Floats) -> None:
    """Each takes the other's estimate, with its covariance, for independent of its own: unsafe.  coop2024, III"""
    i, j = min(t.member[src], t.partner[src]), max(t.member[src], t.partner[src])
    m = relate(t, b, ws, src, z, r)
    update_pair(t, b, ws, i, j, src, m, shaped(ws.square[3], t.index[i, I_N], t.index[j, I_N]), False, out)
