"""What the kernels of a team see: members and sources in tables, beliefs and scratch in flat arrays with offsets.

Members differ in size, and kernels know arrays of one type only: a matrix of member i is a slice of a flat array, given
its shape by a view. Nothing is padded, so each robot costs what its own states cost.
"""

from typing import Final, NamedTuple

import numpy as np

from outrider._kernel import inlined, kernel
from outrider.data import Verdict
from outrider.filters.ekf import Work, workspace
from outrider.filters.state import ROWS
from outrider.models.kinematics import K_SIZE, T_SIZE
from outrider.models.sensors.layout import THETA_SIZE
from outrider.typing import Floats, Ints

USED, GATED, NOT_OBSERVING, INPUT, NOT_ALIGNED, DIVERGED = (
    int(Verdict.USED),
    int(Verdict.GATED),
    int(Verdict.NOT_OBSERVING),
    int(Verdict.INPUT),
    int(Verdict.NOT_ALIGNED),
    int(Verdict.DIVERGED),
)

# columns of Tables.index
I_CODE, I_X, I_NX, I_E, I_N, I_SQUARE, I_VIEW, I_AT, I_TABLE, I_TABLES, I_POSE, I_POSES = range(12)
I_SIZE: Final = 12
MOTION_THETA: Final = 24  # parameters of the longest process model
POSES: Final = 6  # most rows of a pose


class Tables(NamedTuple):
    """What does not change during a run."""

    index: Ints  # (members, I_SIZE): motion, then first index and count in each flat array
    theta: Floats  # (members, MOTION_THETA)
    table: Ints  # (rows, 4) block tables of the members, one after another, each from 0
    rotations: Ints  # (rows, 4) of them the rotations, with their rows among all errors
    keep: Floats  # (n,) 1 estimated, 0 considered
    pose: Ints  # error rows of each member's pose
    code: Ints  # (sources,) Sensor, or -1: drives the prediction
    member: Ints  # (sources,)
    partner: Ints  # (sources,) who is seen, -1: nobody
    parameters: Floats  # (sources, THETA_SIZE)
    gate: Floats  # (sources, ROWS + 1) threshold by degrees of freedom


class Beliefs(NamedTuple):
    """What records change. Only one of `whole` and the exchange's arrays is as large as it says."""

    x: Floats  # all states
    P: Floats  # own covariances
    whole: Floats  # (n, n) the joint covariance
    clock: Floats  # (members,) s
    u: Floats  # (members, 6) input in force
    fed: Floats  # (members, 6) the input's last record
    carried: Floats  # Psi: how an error at the last meeting is felt now
    told: Floats  # Lambda: information that own records since then hold of that error
    heard: Floats  # (n,) xi: what they say of it
    before: Floats  # covariance after the last exchange (split covariance intersection)
    factor: Floats  # (members, members, most n squared) s_ij with P_ij = s_ij s_ji'
    met: Ints  # (members, members) whether they are correlated


class Scratch(NamedTuple):
    """Work arrays. F, Q, seen, at, view: of each member, for their zeros stay; the rest for all."""

    F: Floats
    Q: Floats
    seen: Floats
    at: Ints
    d: Floats
    view: Floats
    k: Floats  # (members, K_SIZE)
    y: Floats
    r: Floats
    D: Floats  # (2, ROWS + 1, T_SIZE) of observer and observed
    H: Floats  # Jacobian of the pair, flat
    H_own: Floats  # of one member, flat
    parameters: Floats  # (THETA_SIZE,)
    w: Work  # flat buffers, given their size by `sized`
    C: Floats  # (2, n squared) covariance of the pair, flat
    keep: Floats
    square: Floats  # (8, most n squared)
    vector: Floats  # (4, most n)
    F_whole: Floats
    Q_whole: Floats
    H_whole: Floats
    w_whole: Work
    pick: Floats  # (12, ROWS, ROWS)


@inlined
def square(t: Tables, flat: Floats, i: int) -> Floats:
    """Member i's (n, n) matrix in a flat array."""
    n, first = t.index[i, I_N], t.index[i, I_SQUARE]
    return flat[first : first + n * n].reshape((n, n))


@inlined
def state(t: Tables, b: Beliefs, i: int) -> Floats:
    """Member i's state."""
    first = t.index[i, I_X]
    return b.x[first : first + t.index[i, I_NX]]


@inlined
def errors(t: Tables, flat: Floats, i: int) -> Floats:
    """Member i's part of a vector of errors."""
    first = t.index[i, I_E]
    return flat[first : first + t.index[i, I_N]]


@inlined
def blocks(t: Tables, i: int) -> Ints:
    """Member i's block table."""
    first = t.index[i, I_TABLE]
    return t.table[first : first + t.index[i, I_TABLES]]


@inlined
def view(t: Tables, ws: Scratch, i: int) -> Floats:
    """Member i's K (T_SIZE, n)."""
    n, first = t.index[i, I_N], t.index[i, I_VIEW]
    return ws.view[first : first + T_SIZE * n].reshape((T_SIZE, n))


@inlined
def factor(t: Tables, b: Beliefs, i: int, j: int) -> Floats:
    """s_ij (n_i, n of the later one of both)."""
    rows, columns = t.index[i, I_N], t.index[max(i, j), I_N]
    return b.factor[i, j, : rows * columns].reshape((rows, columns))


@inlined
def shaped(flat: Floats, rows: int, columns: int) -> Floats:
    """The first numbers of a flat array as a matrix."""
    return flat[: rows * columns].reshape((rows, columns))


@inlined
def sized(t: Tables, ws: Scratch, n: int, width: int) -> Work:
    """The filter's scratch for n errors; rows of `width` numbers."""
    w = ws.w
    return Work(
        w.s, shaped(w.M, n, width), w.c[:width], w.K[:width], w.G[:width], w.dx[:width], w.on[: n + 1],
        w.W, w.seen, w.at, w.d, w.J,
    )  # fmt: skip


@kernel
def identity(A: Floats) -> None:
    """A <- I."""
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            A[i, j] = 1.0 if i == j else 0.0


def scratch(index: Ints, joint: bool) -> Scratch:
    """Work arrays for these members; those of the joint filter only if it is the one that runs."""
    n, members = index[:, I_N], index.shape[0]
    most, all_n = int(n.max()), int(n.sum())
    squares, pair = int((n * n).sum()), 2 * most
    width = -(-2 * pair // 8) * 8
    F = np.concatenate([np.eye(int(m)).ravel() for m in n])
    whole = all_n if joint else 1
    flat = Work(
        s=np.zeros(ROWS + 1), M=np.zeros(pair * width), c=np.zeros(width), K=np.zeros(width), G=np.zeros(width),
        dx=np.zeros(width), on=np.zeros(pair + 1, np.int64), W=np.zeros((most, most)), seen=np.zeros((1, 1)),
        at=np.zeros((1, 1), np.int64), d=np.zeros(1), J=np.zeros((3, 3)),
    )  # fmt: skip
    return Scratch(
        F=F, Q=np.zeros(squares), seen=np.zeros(squares), at=np.zeros(squares + all_n, np.int64), d=np.zeros(all_n),
        view=np.zeros(T_SIZE * all_n), k=np.zeros((members, K_SIZE)), y=np.zeros(ROWS + 1), r=np.zeros(ROWS + 1),
        D=np.zeros((2, ROWS + 1, T_SIZE)), H=np.zeros((ROWS + 1) * pair), H_own=np.zeros((ROWS + 1) * most),
        parameters=np.zeros(THETA_SIZE), w=flat, C=np.zeros((2, pair * pair)), keep=np.ones(pair),
        square=np.zeros((8, most * most)), vector=np.zeros((4, most)), F_whole=np.eye(whole),
        Q_whole=np.zeros((whole, whole)), H_whole=np.zeros((ROWS + 1, whole)), w_whole=workspace(whole, ROWS + 1),
        pick=np.zeros((12, ROWS, ROWS)),
    )  # fmt: skip
