"""The compiled part: one filter over one or several robots, from record to record.

A group of one is a robot by itself, a group of all the joint filter. Beside mean and covariance a group may carry how
an error e_0 at its last meeting is felt now (Psi e_0), the information that its records since then hold of e_0 (Lambda)
and what they say of it (xi):

    predict   Psi <- F Psi                            update  Psi <- (I - K H) Psi
    Lambda <- Lambda + Psi' H' S^-1 H Psi             xi <- xi + Psi' H' S^-1 y

That is a fixed-point smoother of e_0 (Meditch 1969). It costs as much as the filter, however many other robots are.
"""

from typing import Final, NamedTuple

import numpy as np

from outrider._kernel import kernel
from outrider.core.linalg import chain, mirror, times
from outrider.core.manifold import retract
from outrider.core.rotations import right_jacobian
from outrider.data import Verdict
from outrider.filters.ekf import Work, innovate, transport, workspace
from outrider.filters.ekf import propagate as propagate_covariance
from outrider.filters.state import ROWS
from outrider.models.kinematics import K_P, K_R, K_SIZE, T_P, T_SIZE, T_TH
from outrider.models.motion import kinematic_view, propagate
from outrider.models.sensors.dispatch import evaluate
from outrider.models.sensors.layout import OWN, THETA_SIZE
from outrider.typing import Bools, Floats, Ints

LONGEST: Final = 0.1  # s, of one step of the prediction
# columns of Group.rows
I_CODE, I_X, I_NX, I_E, I_N, I_TABLE, I_TABLES = range(7)
_USED, _GATED, _DIVERGED, _INPUT = int(Verdict.USED), int(Verdict.GATED), int(Verdict.DIVERGED), int(Verdict.INPUT)
_NOT_OBSERVING, _NOT_ALIGNED = int(Verdict.NOT_OBSERVING), int(Verdict.NOT_ALIGNED)


class Group(NamedTuple):
    """Members and sources, which do not change."""

    rows: Ints  # (members, 7): motion, then first index and count of states, errors, rows of the block table
    theta: Floats  # (members, parameters)
    table: Ints  # (rows, 4) block tables, one after another, each from 0
    rotations: Ints  # (rows, 4) of them the rotations, with their rows among all errors
    keep: Floats  # (n,) 1 estimated, 0 considered
    code: Ints  # (sources,) Sensor, or -1: drives the prediction
    member: Ints  # (sources,)
    partner: Ints  # (sources,) who is seen, -1: nobody
    parameters: Floats  # (sources, THETA_SIZE)
    gate: Floats  # (ROWS + 1,) threshold by degrees of freedom
    begin: Floats  # (members,) s, from when on the first belief of each counts; it rests until then


class Belief(NamedTuple):
    """What records change."""

    x: Floats  # states of all members
    P: Floats  # (n, n)
    clock: Floats  # (1,) s
    u: Floats  # (members, 6) input in force
    fed: Floats  # (members, 6) the input's last record
    carried: Floats  # (n, n) Psi; (0, 0): not carried
    told: Floats  # (n, n) Lambda
    heard: Floats  # (n,) xi


class Scratch(NamedTuple):
    """Work arrays. F, Q and K are each member's own, for their zeros stay."""

    F: Floats  # (members, most, most)
    Q: Floats
    K: Floats  # (members, T_SIZE, most)
    k: Floats  # (members, K_SIZE)
    F_all: Floats  # (n, n)
    Q_all: Floats
    y: Floats
    r: Floats
    D: Floats  # (2, ROWS + 1, T_SIZE) of observer and observed
    H: Floats  # (2, ROWS + 1, most)
    H_all: Floats  # (ROWS + 1, n)
    parameters: Floats  # (THETA_SIZE,)
    old: Floats  # (2, n)
    w: Work
    full: Ints  # (n,) the row among all errors of each row of P
    own: Ints  # (n,) and among those of its member
    first: Ints  # (members + 1,) the first row of P of each member
    rotations: Ints  # as those of the group, by rows of P
    move: Floats  # (all errors,)


def scratch(g: Group, full: Ints, carries: bool) -> Scratch:
    """Work arrays for a P of the rows `full` (n,) among all errors, ascending and with all of a rotation or nothing;
    rows of the update are twice as long if Psi is carried."""
    index, n = g.rows, full.size
    members, most = index.shape[0], int(index[:, I_N].max())
    first = np.searchsorted(full, np.append(index[:, I_E], index[:, I_N].sum()))
    rotations = g.rotations[np.isin(g.rotations[:, 2], full)].copy()
    rotations[:, 2] = np.searchsorted(full, rotations[:, 2])
    w = workspace(n, ROWS + 1)
    if carries:
        width = -(-2 * n // 8) * 8
        row = {name: np.zeros(width) for name in ("c", "K", "G", "dx")}
        w = w._replace(M=np.zeros((n, width)), **row)
    return Scratch(
        F=np.tile(np.eye(most), (members, 1, 1)), Q=np.zeros((members, most, most)),
        K=np.zeros((members, T_SIZE, most)), k=np.zeros((members, K_SIZE)), F_all=np.eye(n), Q_all=np.zeros((n, n)),
        y=np.zeros(ROWS + 1), r=np.zeros(ROWS + 1), D=np.zeros((2, ROWS + 1, T_SIZE)),
        H=np.zeros((2, ROWS + 1, most)), H_all=np.zeros((ROWS + 1, n)), parameters=np.zeros(THETA_SIZE),
        old=np.zeros((2, n)), w=w, full=full, own=full - np.repeat(index[:, I_E], np.diff(first)), first=first,
        rotations=rotations, move=np.zeros(g.keep.size),
    )  # fmt: skip


@kernel
def advance(g: Group, b: Belief, ws: Scratch, now: float) -> None:
    """Predict everybody up to `now`."""
    n = b.P.shape[0]
    while now > b.clock[0]:
        left = now - b.clock[0]
        dt = min(left, LONGEST)
        for i in range(g.rows.shape[0]):
            x = g.rows[i, I_X]
            F, Q = ws.F[i], ws.Q[i]
            awake = min(dt, b.clock[0] + dt - g.begin[i])
            if awake > 0.0:
                propagate(g.rows[i, I_CODE], b.x[x : x + g.rows[i, I_NX]], awake, b.u[i], g.theta[i], F, Q)
                for r in range(ws.first[i], ws.first[i + 1]):
                    for c in range(ws.first[i], ws.first[i + 1]):
                        a, d = ws.own[r], ws.own[c]
                        ws.F_all[r, c], ws.Q_all[r, c] = F[a, d], Q[a, d]
        propagate_covariance(b.P, ws.F_all, ws.Q_all, ws.w)
        if b.carried.shape[0] == n:
            times(ws.F_all, ws.w.at, b.carried, ws.w.W)
            for r in range(n):
                for c in range(n):
                    b.carried[r, c] = ws.w.W[r, c]
        b.clock[0] = b.clock[0] + dt if left > LONGEST else now


@kernel
def begun(g: Group, src: int, now: float) -> bool:
    """Whether the first beliefs of whom a record is about count by now."""
    j = g.partner[src]
    return bool(now >= g.begin[g.member[src]] and (j < 0 or now >= g.begin[j]))


@kernel
def look(g: Group, b: Belief, ws: Scratch, i: int) -> None:
    """Kinematic view of member i."""
    x = g.rows[i, I_X]
    kinematic_view(g.rows[i, I_CODE], b.x[x : x + g.rows[i, I_NX]], b.u[i], g.theta[i], ws.k[i], ws.K[i])


def stirred(g: Group, ws: Scratch) -> tuple[Bools, Bools]:
    """(n,) errors that the process makes grow by themselves, and (n, n) which of them feed on which."""
    rng, n = np.random.default_rng(0), g.keep.size
    grows, feeds = np.zeros(n, np.bool_), np.zeros((n, n), np.bool_)
    for i, row in enumerate(g.rows.tolist()):  # at some state in general position
        F, Q, own = ws.F[i].copy(), ws.Q[i].copy(), slice(row[I_E], row[I_E] + row[I_N])
        propagate(row[I_CODE], rng.normal(size=row[I_NX]), 0.01, rng.normal(size=6), g.theta[i], F, Q)
        grows[own], feeds[own, own] = Q.any(axis=1)[: row[I_N]], (F != 0.0)[: row[I_N], : row[I_N]]
    return grows, feeds


def views(g: Group, u: Floats, i: int, x: Floats) -> tuple[Floats, Floats]:
    """Kinematic views (k, K_SIZE) of member i and their Jacobians at states x (k, states) of all."""
    k, K = np.zeros((len(x), K_SIZE)), np.zeros((len(x), T_SIZE, int(g.rows[i, I_N])))
    _views(g, u[i], i, x, k, K)
    return k, K


@kernel
def _views(g: Group, u: Floats, i: int, x: Floats, k: Floats, K: Floats) -> None:
    a = g.rows[i, I_X]
    for row in range(x.shape[0]):
        kinematic_view(g.rows[i, I_CODE], x[row, a : a + g.rows[i, I_NX]], u, g.theta[i], k[row], K[row])


@kernel
def relate(code: int, k_i: Floats, k_j: Floats, z: Floats, theta: Floats, own: Floats, y: Floats, D: Floats) -> int:
    """y and D (2, rows, T_SIZE) of a robot i that sees a robot j; theta of its sensor; own (THETA_SIZE,) is scratch.

    A relative measurement does not notice if the whole world is moved or turned, so D[1], by the one who is seen,
    follows from D[0]: every sensor that looks at a target works between robots.
    """
    for c in range(own.size):
        own[c] = theta[c]
    for c in range(3):
        own[OWN + c] = k_j[K_P + c]
    for c in range(9):
        own[OWN + 3 + c] = k_j[K_R + c]
    rows = evaluate(code, k_i, z, own, y, D[0])
    d0, d1, d2 = k_i[K_P] - k_j[K_P], k_i[K_P + 1] - k_j[K_P + 1], k_i[K_P + 2] - k_j[K_P + 2]
    for row in range(rows):
        for c in range(T_SIZE):
            D[1, row, c] = 0.0
        p0, p1, p2 = D[0, row, T_P], D[0, row, T_P + 1], D[0, row, T_P + 2]
        D[1, row, T_P], D[1, row, T_P + 1], D[1, row, T_P + 2] = -p0, -p1, -p2
        # all turned by phi about the other's place: p by phi x d, an attitude by R' phi
        w0, w1, w2 = d1 * p2 - d2 * p1, d2 * p0 - d0 * p2, d0 * p1 - d1 * p0
        for c in range(3):
            w0 += k_i[K_R + c] * D[0, row, T_TH + c]
            w1 += k_i[K_R + 3 + c] * D[0, row, T_TH + c]
            w2 += k_i[K_R + 6 + c] * D[0, row, T_TH + c]
        for c in range(3):
            D[1, row, T_TH + c] = -(k_j[K_R + c] * w0 + k_j[K_R + 3 + c] * w1 + k_j[K_R + 6 + c] * w2)
    return rows


@kernel
def measure(g: Group, b: Belief, ws: Scratch, src: int, z: Floats, r: Floats) -> int:
    """Innovation ws.y, variances ws.r, Jacobian ws.H_all of one record; rows that say nothing are left out."""
    i, j = g.member[src], g.partner[src]
    look(g, b, ws, i)
    sides = 1
    if j >= 0:
        look(g, b, ws, j)
        sides = 2
        rows = relate(g.code[src], ws.k[i], ws.k[j], z, g.parameters[src], ws.parameters, ws.y, ws.D)
    else:
        rows = evaluate(g.code[src], ws.k[i], z, g.parameters[src], ws.y, ws.D[0])
    m = squeeze(rows, r, ws.y, ws.r, ws.D)
    for k in range(m):
        for c in range(ws.H_all.shape[1]):
            ws.H_all[k, c] = 0.0
    for side in range(sides):
        who = i if side == 0 else j
        chain(ws.D[side], ws.K[who], m, ws.H[side])
        for k in range(m):
            for c in range(ws.first[who], ws.first[who + 1]):
                ws.H_all[k, c] = ws.H[side, k, ws.own[c]]
    return m


@kernel
def squeeze(rows: int, r: Floats, y: Floats, kept: Floats, D: Floats) -> int:
    """Leave out the rows without a finite variance or innovation; kept <- variances of the others."""
    m = 0
    for i in range(rows):
        if np.isfinite(r[i]) and r[i] > 0.0 and np.isfinite(y[i]):
            y[m], kept[m] = y[i], r[i]
            if m != i:
                for j in range(T_SIZE):
                    D[0, m, j], D[1, m, j] = D[0, i, j], D[1, i, j]
            m += 1
    return m


@kernel
def absorb(g: Group, b: Belief, ws: Scratch, src: int, z: Floats, r: Floats, out: Floats) -> None:
    """Fuse one record.  out <- verdict, NIS, degrees of freedom."""
    m, n, w = measure(g, b, ws, src, z, r), b.P.shape[0], ws.w
    out[0], out[2] = _NOT_OBSERVING, m
    if m == 0:
        return
    carries = b.carried.shape[0] == n
    if carries:  # further columns beside P: an update treats them as it treats those of P
        for k in range(n):
            for j in range(n):
                w.M[k, n + j] = b.carried[k, j]
    nis = innovate(b.P, ws.H_all, ws.r, ws.y, m, w)
    out[1] = nis
    if not nis <= g.gate[m]:
        out[0] = _GATED if np.isfinite(nis) else _DIVERGED
        return
    out[0] = _USED
    if carries:
        note(g, b, ws, m)
    for i in range(n):
        if g.keep[ws.full[i]] == 0.0:
            w.dx[i] = 0.0
            for j in range(n):
                if g.keep[ws.full[j]] == 0.0:
                    w.M[i, j] = b.P[i, j]
        ws.move[ws.full[i]] = w.dx[i]
    mirror(w.M, b.P)
    transport(b.P, w.dx, ws.rotations, False, w.J)
    for i in range(g.rows.shape[0]):
        x, e, a = g.rows[i, I_X], g.rows[i, I_E], g.rows[i, I_TABLE]
        retract(b.x[x : x + g.rows[i, I_NX]], ws.move[e : e + g.rows[i, I_N]], g.table[a : a + g.rows[i, I_TABLES]])
    if carries:
        turn_rows(b.carried, w.dx, g.rotations, w.J)


@kernel
def note(g: Group, b: Belief, ws: Scratch, m: int) -> None:
    """Psi, Lambda and xi after an update.  S^-1 H Psi is R^-1 H Psi_new: no inverse is needed.

    A filter that only considers some of its states has innovations that are not white: what they say is not passed on.
    """
    n, M, H = b.P.shape[0], ws.w.M, ws.H_all
    estimated = True
    for k in range(n):
        estimated = estimated and g.keep[k] != 0.0
    if estimated:
        for j in range(n):
            b.heard[j] += ws.w.dx[n + j]
        for k in range(m):
            for j in range(n):
                old = new = 0.0
                for l in range(n):
                    if H[k, l] != 0.0:
                        old += H[k, l] * b.carried[l, j]
                        new += H[k, l] * M[l, n + j]
                ws.old[0, j], ws.old[1, j] = old, new / ws.r[k]
            for j in range(n):
                if ws.old[0, j] != 0.0:
                    for l in range(n):
                        b.told[j, l] += ws.old[0, j] * ws.old[1, l]
    for k in range(n):
        if g.keep[k] != 0.0:
            for j in range(n):
                b.carried[k, j] = M[k, n + j]


@kernel
def turn_rows(A: Floats, dx: Floats, rotations: Ints, J: Floats) -> None:
    """A <- Jr(dx) A in the rows of rotations: errors that stand to the left follow the mean that has moved by dx."""
    for b in range(rotations.shape[0]):
        s = rotations[b, 2]
        right_jacobian(dx[s : s + 3], J)
        for j in range(A.shape[1]):
            p, q, r = A[s, j], A[s + 1, j], A[s + 2, j]
            for i in range(3):
                A[s + i, j] = J[i, 0] * p + J[i, 1] * q + J[i, 2] * r


@kernel
def run(
    g: Group,
    b: Belief,
    ws: Scratch,
    t: Floats,
    source: Ints,
    z: Floats,
    r: Floats,
    until: float,
    kept: int,
    at: Floats,
    x: Floats,
    P: Floats,
    out: Floats,
) -> int:
    """Take the records t (n,), source (n,), z, r (n, ROWS), then predict up to `until`.  out (n, 3) as `absorb`.

    x (k, states) and P (k, all errors, all errors) <- the estimates at the times `at` (k,) before `until`, each after
    all records of its time, from row `kept` on; returns the next row.
    """
    for e in range(t.size + 1):
        now = until if e == t.size else t[e]
        while kept < at.size and at[kept] < now:
            advance(g, b, ws, at[kept])
            for c in range(b.x.size):
                x[kept, c] = b.x[c]
            for c in range(b.P.shape[0]):
                for d in range(b.P.shape[0]):
                    P[kept, ws.full[c], ws.full[d]] = b.P[c, d]
            kept += 1
        if e == t.size:
            advance(g, b, ws, now)
        elif now < b.clock[0] or (g.code[source[e]] >= 0 and not begun(g, source[e], now)):
            out[e, 0] = _NOT_ALIGNED
        elif g.code[source[e]] < 0:
            i = g.member[source[e]]
            for c in range(6):  # the mean of this record and the last one held in between
                b.u[i, c] = 0.5 * (b.fed[i, c] + z[e, c])
            advance(g, b, ws, now)
            for c in range(6):
                b.fed[i, c] = b.u[i, c] = z[e, c]
            out[e, 0] = _INPUT
        else:
            advance(g, b, ws, now)
            absorb(g, b, ws, source[e], z[e], r[e], out[e])
    return kept
