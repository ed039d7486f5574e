"""One robot by itself: its prediction and its own records, and what a later meeting needs to know of them.

Between meetings a robot runs an ordinary filter. Beside it, it carries how an error e_0 at its last meeting is felt now
(Psi e_0), the information that its own records since then hold of e_0 (Lambda) and what they say of it (xi):

    predict   Psi <- F Psi                    update  Psi <- (I - K H) Psi
    Lambda <- Lambda + Psi' H' S^-1 H Psi     xi <- xi + Psi' H' S^-1 y

That is a fixed-point smoother of e_0 (Meditch 1969) and costs as much as the filter, however many others there are.
"""

import numpy as np

from outrider._kernel import kernel
from outrider.core.linalg import chain, sandwich, times
from outrider.core.rotations import right_jacobian
from outrider.filters.cooperative.tables import (
    DIVERGED,
    GATED,
    I_AT,
    I_CODE,
    I_E,
    I_N,
    NOT_OBSERVING,
    USED,
    Beliefs,
    Scratch,
    Tables,
    blocks,
    errors,
    shaped,
    sized,
    square,
    state,
    view,
)
from outrider.filters.ekf import correct, innovate
from outrider.models.kinematics import T_SIZE
from outrider.models.motion import kinematic_view, propagate
from outrider.models.sensors.dispatch import evaluate
from outrider.typing import Floats, Ints

LONGEST = 0.1  # s, of one step of the prediction


@kernel
def advance(t: Tables, b: Beliefs, ws: Scratch, i: int, now: float, carries: bool) -> None:
    """Predict member i up to `now`; Psi too if it `carries`."""
    n, e = t.index[i, I_N], t.index[i, I_E]
    x, P, F, Q = state(t, b, i), square(t, b.P, i), square(t, ws.F, i), square(t, ws.Q, i)
    at = ws.at[t.index[i, I_AT] : t.index[i, I_AT] + n * (n + 1)].reshape((n, n + 1))
    W = shaped(ws.square[0], n, n)
    while now > b.clock[i]:
        dt = min(now - b.clock[i], LONGEST)
        propagate(t.index[i, I_CODE], x, dt, b.u[i], t.theta[i], F, Q)
        sandwich(P, F, Q, W, square(t, ws.seen, i), at, ws.d[e : e + n])
        if carries:
            Psi = square(t, b.carried, i)
            times(F, at, Psi, W)
            for r in range(n):
                for c in range(n):
                    Psi[r, c] = W[r, c]
        b.clock[i] = b.clock[i] + dt if now - b.clock[i] > LONGEST else now


@kernel
def look(t: Tables, b: Beliefs, ws: Scratch, i: int) -> None:
    """Kinematic view of member i."""
    kinematic_view(t.index[i, I_CODE], state(t, b, i), b.u[i], t.theta[i], ws.k[i], view(t, ws, i))


@kernel
def measure(t: Tables, b: Beliefs, ws: Scratch, src: int, z: Floats, r: Floats, H: Floats) -> int:
    """Innovation ws.y, variances ws.r and Jacobian H (rows, n) of one own record; returns how many rows count."""
    i = t.member[src]
    look(t, b, ws, i)
    rows = evaluate(t.code[src], ws.k[i], z, t.parameters[src], ws.y, ws.D[0])
    m = squeeze(ws, rows, r)
    chain(ws.D[0], view(t, ws, i), m, H)
    return m


@kernel
def squeeze(ws: Scratch, rows: int, r: Floats) -> int:
    """Leave out the rows without a finite variance or innovation."""
    m = 0
    for i in range(rows):
        if np.isfinite(r[i]) and r[i] > 0.0 and np.isfinite(ws.y[i]):
            ws.y[m], ws.r[m] = ws.y[i], r[i]
            if m != i:
                for j in range(T_SIZE):
                    ws.D[0, m, j], ws.D[1, m, j] = ws.D[0, i, j], ws.D[1, i, j]
            m += 1
    return m


@kernel
def absorb(t: Tables, b: Beliefs, ws: Scratch, src: int, z: Floats, r: Floats, carries: bool, out: Floats) -> None:
    """Fuse one record that concerns its robot alone.  out <- verdict, NIS, degrees of freedom."""
    i = t.member[src]
    n = t.index[i, I_N]
    x, P, H = state(t, b, i), square(t, b.P, i), ws.H_own[: ws.y.size * n].reshape((ws.y.size, n))
    m = measure(t, b, ws, src, z, r, H)
    out[0], out[2] = NOT_OBSERVING, m
    if m == 0:
        return
    width = ((2 if carries else 1) * n + 7) // 8 * 8
    w = sized(t, ws, n, width)
    for k in range(n):
        for j in range(n, width):
            w.M[k, j] = 0.0
    Psi = square(t, b.carried, i) if carries else P
    if carries:  # further columns of P: an update treats them as it treats its own
        for k in range(n):
            for j in range(n):
                w.M[k, n + j] = Psi[k, j]
    nis = innovate(P, H, ws.r, ws.y, m, w)
    out[1] = nis
    if not nis <= t.gate[src, m]:
        out[0] = GATED if np.isfinite(nis) else DIVERGED
        return
    out[0] = USED
    keep = errors(t, t.keep, i)
    if carries:
        note(t, b, ws, i, m, H, keep, w.M, w.dx)
    correct(x, P, keep, blocks(t, i), w)
    if carries:
        turn_rows(Psi, w.dx, blocks(t, i), w.J)


@kernel
def note(t: Tables, b: Beliefs, ws: Scratch, i: int, m: int, H: Floats, keep: Floats, M: Floats, dx: Floats) -> None:
    """Psi, Lambda and xi after an update whose M holds P and the new Psi.

    S^-1 H Psi is R^-1 H Psi_new: no inverse is needed. A filter that only considers some of its states has innovations
    that are not white, so what they say is not passed on; its Psi holds all the same.
    """
    n = t.index[i, I_N]
    Psi, told, heard = square(t, b.carried, i), square(t, b.told, i), errors(t, b.heard, i)
    whole = True
    for k in range(n):
        whole = whole and keep[k] != 0.0
    if whole:
        for j in range(n):
            heard[j] += dx[n + j]
        for k in range(m):
            old, new = ws.vector[0], ws.vector[1]
            for j in range(n):
                a = c = 0.0
                for l in range(n):
                    if H[k, l] != 0.0:
                        a += H[k, l] * Psi[l, j]
                        c += H[k, l] * M[l, n + j]
                old[j], new[j] = a, c / ws.r[k]
            for j in range(n):
                if old[j] != 0.0:
                    for l in range(n):
                        told[j, l] += old[j] * new[l]
    for k in range(n):
        if keep[k] != 0.0:
            for j in range(n):
                Psi[k, j] = M[k, n + j]


@kernel
def turn_rows(A: Floats, dx: Floats, table: Ints, J: Floats) -> None:
    """A <- Jr(dx) A in the rows of rotations: errors that stand to the left follow the mean that has moved by dx."""
    for b in range(table.shape[0]):
        if table[b, 0] != 2:
            continue
        s = table[b, 2]
        right_jacobian(dx[s : s + 3], J)
        for j in range(A.shape[1]):
            p, q, r = A[s, j], A[s + 1, j], A[s + 2, j]
            for i in range(3):
                A[s + i, j] = J[i, 0] * p + J[i, 1] * q + J[i, 2] * r
