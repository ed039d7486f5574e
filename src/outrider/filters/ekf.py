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

from outrider._kernel import kernel
from outrider.core.linalg import (
    add_product,
    cholesky,
    innovation_covariance,
    mirror,
    sandwich,
    solve_lower,
    solve_lower_rows,
    solve_upper_rows,
    times_transpose,
)
from outrider.core.manifold import local, retract
from outrider.core.rotations import right_jacobian, right_jacobian_inverse
from outrider.data.belief import Gaussian, StateLayout
from outrider.errors import DataError
from outrider.typing import Floats, Ints

# ------------------------------------------------------------------------------------------------ kernels


class Work(NamedTuple):
    """Scratch of one filter, reused by every step. m is the largest number of measurements in one update.

    Rows are padded with zeros to whole vector registers (8 numbers) and measurements to threes, which halves the time.
    """

    HP: Floats  # (m, n)  H P, afterwards the second factor of the Joseph form
    S: Floats  # (m, m)  innovation covariance
    L: Floats  # (m, m)  its Cholesky factor
    v: Floats  # (m,)    L^-1 y, the whitened innovation
    K: Floats  # (m, n)  the gain, transposed
    M: Floats  # (n, n)
    W: Floats  # (n, n)  F P, not padded
    at: Ints  # (n, n + 1) where F is not zero
    dx: Floats  # (n,)   the correction
    J: Floats  # (3, 3)


def workspace(n: int, m: int) -> Work:
    """Scratch for n error states and at most m measurements."""
    rows, width = -(-m // 3) * 3, -(-n // 8) * 8
    return Work(
        HP=np.zeros((rows, width)),
        S=np.zeros((m, m)),
        L=np.zeros((m, m)),
        v=np.zeros(m),
        K=np.zeros((rows, width)),
        M=np.zeros((n, width)),
        W=np.zeros((n, n)),
        at=np.zeros((n, n + 1), np.int64),
        dx=np.zeros(n),
        J=np.zeros((3, 3)),
    )


@kernel
def innovate(P: Floats, H: Floats, r: Floats, y: Floats, m: int, w: Work) -> float:
    """S = H P H' + diag(r); returns the NIS y' S^-1 y to gate on, NaN when S is not positive definite."""
    times_transpose(H, P, m, w.HP)
    innovation_covariance(w.HP, H, r, m, w.S)
    return whiten(y, m, w)


@kernel
def whiten(y: Floats, m: int, w: Work) -> float:
    """L = chol(S), v = L^-1 y; returns v' v, or NaN."""
    if not cholesky(w.S, m, w.L):
        return np.nan
    nis = 0.0
    for k in range(m):
        w.v[k] = y[k]
    solve_lower(w.L, m, w.v)
    for k in range(m):
        nis += w.v[k] * w.v[k]
    return nis


@kernel
def gain(m: int, keep: Floats, w: Work) -> None:
    """K' = S^-1 H P and dx = K y, after `innovate`; states with keep 0 are considered, not corrected, with 1 both."""
    n = w.dx.size
    for k in range(m):
        for j in range(n):
            w.K[k, j] = w.HP[k, j] * keep[j]
    for k in range(m, w.K.shape[0]):
        w.K[k] = 0.0
        w.HP[k] = 0.0
    solve_lower_rows(w.L, m, w.K)
    for j in range(n):
        w.dx[j] = 0.0
    for k in range(m):
        for j in range(n):
            w.dx[j] += w.K[k, j] * w.v[k]
    solve_upper_rows(w.L, m, w.K)


@kernel
def joseph(P: Floats, H: Floats, r: Floats, m: int, w: Work) -> None:
    """P <- (I - K H) P (I - K H)' + K diag(r) K', for any gain; H P and K' are taken from the scratch.

    Three thin products instead of three square ones: M = P - P H' K',  G = H M - diag(r) K',  P = M - K G.
    """
    n, width = w.M.shape
    for i in range(n):
        for j in range(n):
            w.M[i, j] = P[i, j]
    add_product(-1.0, w.HP, w.K, m, w.M)
    for k in range(m):
        for j in range(width):
            w.HP[k, j] = -r[k] * w.K[k, j]
        for i in range(n):
            h = H[k, i]
            if h != 0.0:
                for j in range(width):
                    w.HP[k, j] += h * w.M[i, j]
    add_product(-1.0, w.K, w.HP, m, w.M)
    mirror(w.M, P)


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


@kernel
def correct(x: Floats, P: Floats, H: Floats, r: Floats, m: int, keep: Floats, table: Ints, w: Work) -> None:
    """Second half of an update, after `innovate` and its gate: gain, covariance, state. The correction is in w.dx."""
    gain(m, keep, w)
    joseph(P, H, r, m, w)
    transport(P, w.dx, table, False, w.J)
    retract(x, w.dx, table)


@kernel
def propagate(P: Floats, F: Floats, Q: Floats, w: Work) -> None:
    """P <- F P F' + Q."""
    sandwich(P, F, Q, w.W, w.at)


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
    white_y, white_H, r, root = whitened(y, H, R)
    m = r.size
    w = workspace(P.shape[0], m)
    nis = innovate(P, white_H, r, white_y, m, w)
    if not np.isfinite(nis):
        raise DataError("the innovation covariance is not positive definite", fix="check P and R for negative or NaN")
    S = root @ w.S @ root.T
    correct(x, P, white_H, r, m, kept(belief.layout, consider), belief.layout.table, w)
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


def whitened(y: Floats, H: Floats, R: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """(y, H, r, root) with independent noises: R = root diag(r) root'. A diagonal R is left as it is, zeros allowed."""
    white_y, white_H, noise = np.array(y, float), np.array(H, float, order="C"), np.array(R, float)
    variances = noise if noise.ndim == 1 else np.diag(noise).copy()
    root = np.eye(variances.size)
    if noise.ndim == 1 or not np.any(noise - np.diag(variances)):
        return white_y, white_H, variances, root
    if not cholesky(noise, white_y.size, root):
        raise DataError("the measurement covariance is not positive definite", fix="give variances, or a valid R")
    solve_lower(root, white_y.size, white_y)
    solve_lower_rows(root, white_y.size, white_H)
    return white_y, white_H, np.ones(white_y.size), root
