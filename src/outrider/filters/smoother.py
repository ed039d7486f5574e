"""Rauch-Tung-Striebel smoother on the error state: what each moment would have known, had it seen the whole log."""

from typing import NamedTuple

import numpy as np

from outrider._kernel import kernel
from outrider.core.linalg import cholesky, solve_lower_rows, solve_upper_rows
from outrider.core.manifold import local, retract
from outrider.errors import DataError
from outrider.filters.ekf import transport
from outrider.typing import Floats, Ints


class Smoothed(NamedTuple):
    """Means xs (steps, layout.size) and error covariances Ps (steps, n, n)."""

    x: Floats
    P: Floats


class Work(NamedTuple):
    """Scratch of `backward`."""

    L: Floats  # (n, n) chol Pp
    G: Floats  # (n, n) the smoother gain, transposed
    D: Floats  # (n, n) Ps - Pp of the step after
    e: Floats  # (n,)
    dx: Floats  # (n,)
    J: Floats  # (3, 3)


@kernel
def backward(x: Floats, P: Floats, xp: Floats, Pp: Floats, F: Floats, table: Ints, w: Work) -> int:
    """Smooth x, P in place from the last step to the first; returns -1, or the step whose prediction is singular.

    G = P F' Pp^-1,  e = xs [-] xp of the step after,  xs = x [+] G e,  Ps = P + G (Ps - Pp) G'
    """
    steps, n = x.shape[0], P.shape[1]
    L, G, D, e, dx, J = w
    for k in range(steps - 2, -1, -1):
        if not cholesky(Pp[k + 1], n, L):
            return k + 1
        for i in range(n):  # G' = Pp^-1 F P
            for j in range(n):
                G[i, j] = 0.0
            for l in range(n):
                f = F[k + 1, i, l]
                if f != 0.0:
                    for j in range(n):
                        G[i, j] += f * P[k, l, j]
        solve_lower_rows(L, n, G)
        solve_upper_rows(L, n, G)
        local(x[k + 1], xp[k + 1], table, e)
        for i in range(n):
            dx[i] = 0.0
            for j in range(n):
                dx[i] += G[j, i] * e[j]
                D[i, j] = P[k + 1, i, j]
        transport(D, e, table, True, J)  # the later covariance, seen from the tangent space of its prediction
        for i in range(n):
            for j in range(n):
                D[i, j] -= Pp[k + 1, i, j]
        _add_sandwich(P[k], G, D, L)
        transport(P[k], dx, table, False, J)
        retract(x[k], dx, table)
    return -1


@kernel
def _add_sandwich(P: Floats, G: Floats, D: Floats, W: Floats) -> None:
    """P <- P + G' D G, symmetric.  All (n, n); W is scratch."""
    n = P.shape[0]
    for i in range(n):  # W = D G
        for j in range(n):
            W[i, j] = 0.0
        for k in range(n):
            for j in range(n):
                W[i, j] += D[i, k] * G[k, j]
    for k in range(n):
        for i in range(n):
            for j in range(i + 1):
                P[i, j] += 0.5 * (G[k, i] * W[k, j] + G[k, j] * W[k, i])
    for i in range(n):
        for j in range(i):
            P[j, i] = P[i, j]


def smooth(x: Floats, P: Floats, xp: Floats, Pp: Floats, F: Floats, table: Ints) -> Smoothed:
    """Smoothed means and covariances from the record of a filter.

    Parameters
    ----------
    x, P : (steps, layout.size), (steps, n, n) after the last update of each step
    xp, Pp : the same, as predicted from the step before; Pp positive definite. Row 0 is not used
    F : (steps, n, n) error-state transition from the step before. Row 0 is not used
    table : `StateLayout.table`

    Raises
    ------
    DataError   a predicted covariance is singular
    """
    xs, Ps = np.array(x, float, order="C"), np.array(P, float, order="C")
    predicted = np.ascontiguousarray(xp, float), np.ascontiguousarray(Pp, float), np.ascontiguousarray(F, float)
    n = Ps.shape[1]
    w = Work(*(np.zeros(shape) for shape in ((n, n), (n, n), (n, n), (n,), (n,), (3, 3))))
    failed = backward(xs, Ps, *predicted, table, w)
    if failed >= 0:
        raise DataError(
            "the predicted covariance is not positive definite",
            where=f"step {failed}",
            fix="give every state process noise, or leave out the states that are known exactly",
        )
    return Smoothed(xs, Ps)
