"""Unscented Kalman filter on the tangent space: building blocks for the loops, pure functions above them.

Sigma points are x [+] (+-) gamma (columns of chol P); their mean is found by averaging in the tangent space until the
average is the origin. They are drawn afresh before every measurement, so that on a linear problem the filter is the
Kalman filter to rounding. The updated covariance is a sum of squares, so with non-negative weights (the default) it
cannot become indefinite, whatever the gain.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np

from outrider._kernel import inlined
from outrider.core.angles import wrap
from outrider.core.linalg import add_product, cholesky, mirror, solve_lower, solve_lower_rows, solve_upper_rows
from outrider.core.manifold import local, retract, rotate_right, stretch
from outrider.data.belief import Gaussian
from outrider.errors import ConfigError, DataError
from outrider.filters.ekf import Updated, kept, transport
from outrider.typing import Floats, Ints

# ------------------------------------------------------------------------------------------------ kernels


class Work(NamedTuple):
    """Scratch of one filter with p = 2 n + 1 sigma points: the first is the centre, then +, then -.

    Padded with zeros for `add_product`: rows to eights, and where they are summed over (p; m in Yt and K) to sixes.
    """

    wm: Floats  # (p,)    weights of means
    wc: Floats  # (p,)    weights of covariances
    gamma: Floats  # (1,) spread in standard deviations
    X: Floats  # (p, layout.size) sigma points
    E: Floats  # (p, n)   their tangent vectors at the mean
    Y: Floats  # (p, m)   innovations z [-] h(X), afterwards about their mean
    Yt: Floats  # (m, p)  the same, transposed
    WE: Floats  # (p, n)  weighted tangent vectors
    WY: Floats  # (p, m)  weighted innovations
    L: Floats  # (n, n)
    dx: Floats  # (n,)
    y: Floats  # (m,)     mean innovation
    S: Floats  # (m, m)
    D: Floats  # (m, m)   chol S
    v: Floats  # (m,)
    K: Floats  # (m, n)   the gain, transposed
    RK: Floats  # (m, n)  diag(r) K'
    M: Floats  # (n, n)   covariance being summed
    J: Floats  # (3, 3)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """How far sigma points reach: gamma^2 = alpha^2 (n + kappa), centre weight 1 - n / gamma^2 (Wan, Merwe 2000).

    The default is the spherical cubature rule (Arasaratnam, Haykin 2009): 2 n equal weights, none at the centre, none
    negative. The customary alpha = 1e-3 puts a weight of about -1e6 on the centre and loses as many digits.
    """

    alpha: float = 1.0
    beta: float = 0.0
    kappa: float = 0.0

    def weights(self, n: int) -> tuple[Floats, Floats, float]:
        """(wm, wc, gamma) of 2 n + 1 points."""
        gamma2 = self.alpha**2 * (n + self.kappa)
        if not gamma2 > 0.0:
            raise ConfigError(f"no sigma points: alpha^2 (n + kappa) = {gamma2:g}", fix="choose kappa above -n")
        wm = np.full(2 * n + 1, 0.5 / gamma2)
        wm[0] = 1.0 - n / gamma2
        wc = wm.copy()
        wc[0] += 1.0 - self.alpha**2 + self.beta
        return wm, wc, float(np.sqrt(gamma2))


CUBATURE = Spread()


def workspace(size: int, n: int, m: int, spread: Spread = CUBATURE) -> Work:
    """Scratch for a state of `size` numbers with n errors, and at most m measurements."""
    wm, wc, gamma = spread.weights(n)
    points = 2 * n + 1
    p, q = -(-points // 6) * 6, -(-m // 6) * 6
    n8, m8 = -(-n // 8) * 8, -(-m // 8) * 8
    sums = ((p, n8), (p, m8), (q, points), (p, n8), (p, m8))
    small = ((n, n), (n8,), (m8,), (m, m8), (m, m), (m,), (q, n8), (q, n8), (n, n8), (3, 3))
    return Work(wm, wc, np.array([gamma]), np.zeros((points, size)), *(np.zeros(shape) for shape in sums + small))


@inlined
def draw(x: Floats, P: Floats, table: Ints, w: Work) -> bool:
    """X <- x [+] (0, +gamma L, -gamma L), E their tangent vectors, P = L L'; False when P has no Cholesky factor."""
    n, gamma = P.shape[0], w.gamma[0]
    if not cholesky(P, n, w.L):
        return False
    for j in range(n):
        w.E[0, j] = 0.0
        for k in range(n):
            e = gamma * w.L[j, k] if k <= j else 0.0
            w.E[1 + k, j] = e
            w.E[1 + n + k, j] = -e
    for i in range(w.X.shape[0]):
        for j in range(x.size):
            w.X[i, j] = x[j]
    perturb(w.X, w.E, table)
    return True


@inlined
def perturb(X: Floats, E: Floats, table: Ints) -> None:
    """X[i] <- X[i] [+] E[i] for all members, block by block: `retract` with the loops changed round."""
    for b in range(table.shape[0]):
        code, i0, k0, size = table[b, 0], table[b, 1], table[b, 2], table[b, 3]
        for i in range(X.shape[0]):
            if code == 0:
                for j in range(size):
                    X[i, i0 + j] += E[i, k0 + j]
            elif code == 1:
                X[i, i0] = wrap(X[i, i0] + E[i, k0])
            elif code == 3:
                stretch(X[i], i0, k0, size, E[i])
            else:
                rotate_right(X[i], i0, E[i, k0], E[i, k0 + 1], E[i, k0 + 2])


@inlined
def differences(X: Floats, x: Floats, table: Ints, E: Floats) -> None:
    """E[i] <- X[i] [-] x for all members, block by block."""
    for b in range(table.shape[0]):
        code, i0, k0, size = table[b, 0], table[b, 1], table[b, 2], table[b, 3]
        for i in range(X.shape[0]):
            if code == 0:
                for j in range(size):
                    E[i, k0 + j] = X[i, i0 + j] - x[i0 + j]
            else:
                local(X[i], x, table[b : b + 1], E[i])


@inlined
def tangent_mean(X: Floats, weights: Floats, table: Ints, x: Floats, E: Floats, dx: Floats) -> None:
    """x <- the weighted mean of members X, starting from X[0]; E (members, n) <- their tangent vectors at the mean.

    On a vector one step is exact; with rotations the step is repeated until it is below 1e-10 rad.
    """
    curved = False
    for b in range(table.shape[0]):
        curved = curved or table[b, 0] == 2
    for j in range(x.size):
        x[j] = X[0, j]
    for _ in range(30):
        for j in range(dx.size):
            dx[j] = 0.0
        differences(X, x, table, E)
        for i in range(X.shape[0]):
            for j in range(dx.size):
                dx[j] += weights[i] * E[i, j]
        retract(x, dx, table)
        if not curved or _turn(dx, table) < 1e-10:
            break
    for i in range(X.shape[0]):
        for j in range(dx.size):
            E[i, j] -= dx[j]


@inlined
def _turn(dx: Floats, table: Ints) -> float:
    """The largest component of the rotations in dx [rad]."""
    largest = 0.0
    for b in range(table.shape[0]):
        if table[b, 0] == 2:
            for j in range(table[b, 2], table[b, 2] + 3):
                largest = max(largest, abs(dx[j]))
    return largest


@inlined
def recover(x: Floats, P: Floats, Q: Floats, table: Ints, w: Work) -> None:
    """x, P <- moments of the sigma points w.X after the process, and the noise Q that the process added."""
    tangent_mean(w.X, w.wm, table, x, w.E, w.dx)
    for i in range(P.shape[0]):
        for j in range(P.shape[0]):
            w.M[i, j] = Q[i, j]
    _finish(P, w)


@inlined
def _finish(P: Floats, w: Work) -> None:
    """P <- M + sum w e e', symmetric to the last bit."""
    p = w.X.shape[0]
    for i in range(p):
        for j in range(w.dx.size):
            w.WE[i, j] = w.wc[i] * w.E[i, j]
    add_product(1.0, w.WE, w.E, p, w.M)
    mirror(w.M, P)


@inlined
def innovate(r: Floats, m: int, w: Work) -> float:
    """From innovations w.Y at the points of `draw`: y, S and the gain; returns the NIS, NaN when S is not positive.

    y = sum w Y,  C = - sum w e (Y - y)',  S = sum w (Y - y) (Y - y)' + diag(r),  K = C S^-1
    """
    p, width = w.X.shape[0], w.y.size
    for k in range(width):
        w.y[k] = 0.0
    for i in range(p):
        for k in range(width):
            w.y[k] += w.wm[i] * w.Y[i, k]
    for i in range(p):
        for k in range(width):
            w.Y[i, k] -= w.y[k]
            w.WY[i, k] = w.wc[i] * w.Y[i, k]
        for k in range(m):
            w.Yt[k, i] = w.Y[i, k]
    w.S[:, :] = 0.0
    w.K[:, :] = 0.0
    for k in range(m):
        w.S[k, k] = r[k]
        w.v[k] = w.y[k]
    add_product(1.0, w.WY, w.Y, p, w.S)
    add_product(-1.0, w.WY, w.E, p, w.K[:m])
    if not cholesky(w.S, m, w.D):
        return np.nan
    nis = 0.0
    solve_lower(w.D, m, w.v)
    for k in range(m):
        nis += w.v[k] * w.v[k]
    solve_lower_rows(w.D, m, w.K)
    solve_upper_rows(w.D, m, w.K)
    return nis


@inlined
def correct(x: Floats, P: Floats, r: Floats, m: int, keep: Floats, table: Ints, w: Work) -> None:
    """Second half of an update, after `innovate` and its gate.

    x <- x [+] K y,  P <- sum w (e + K (Y - y)) (e + K (Y - y))' + K diag(r) K', a sum of squares for any gain.
    """
    p, width = w.X.shape[0], w.dx.size
    for j in range(width):
        w.dx[j] = 0.0
    for k in range(m):
        for j in range(keep.size):
            w.K[k, j] *= keep[j]
        for j in range(width):
            w.RK[k, j] = r[k] * w.K[k, j]
            w.dx[j] += w.K[k, j] * w.y[k]
    add_product(1.0, w.Yt, w.K, m, w.E[:p])
    w.M[:, :] = 0.0
    add_product(1.0, w.RK, w.K, m, w.M)
    _finish(P, w)
    transport(P, w.dx, table, False, w.J)
    retract(x, w.dx, table)


# ------------------------------------------------------------------------------------------------ pure steps


@final
@dataclass(frozen=True, slots=True)
class Repair:
    """What was done to make a covariance positive definite: nothing if `lowest` is above `floor`."""

    P: Floats
    lowest: float  # smallest eigenvalue found, of P scaled to unit diagonal
    raised: int  # how many eigenvalues were raised to the floor


def repaired(P: Floats, floor: float = 1e-12) -> Repair:
    """The nearest usable covariance: symmetric, eigenvalues of the correlation matrix at least `floor`.

    Scaling first keeps a bias of 1e-6 rad/s from being drowned by a position of 1e3 m.
    """
    scale = np.sqrt(np.maximum(np.abs(np.diag(P)), 1e-300))
    values, vectors = np.linalg.eigh(0.5 * (P + P.T) / np.outer(scale, scale))
    lifted = np.maximum(values, floor)
    C = (vectors * lifted) @ vectors.T
    return Repair(0.5 * (C + C.T) * np.outer(scale, scale), float(values[0]), int(np.sum(values < floor)))


@final
@dataclass(frozen=True, slots=True)
class Predicted:
    """A belief after a process step, and how many eigenvalues of the prior covariance had to be raised to draw it."""

    belief: Gaussian
    repaired: int


def predict(
    belief: Gaussian, f: Callable[[Floats, float], Floats], dt: float, Q: Floats, *, spread: Spread = CUBATURE
) -> Predicted:
    """The belief one process step later.

    f : (x, dt) -> x after dt; need not return a normalised quaternion
    Q : (n, n) noise that the step adds to the error state
    """
    x, P, layout = belief.x.copy(), belief.P.copy(), belief.layout
    w = workspace(x.size, P.shape[0], 1, spread)
    raised = _draw(x, P, layout.table, w)
    for i, point in enumerate(w.X.copy()):
        w.X[i] = f(point, dt)
    recover(x, P, np.ascontiguousarray(Q, float), layout.table, w)
    return Predicted(Gaussian(x, P, layout), raised)


def update(
    belief: Gaussian,
    residual: Callable[[Floats], Floats],
    R: Floats,
    *,
    consider: tuple[str, ...] = (),
    spread: Spread = CUBATURE,
) -> Updated:
    """Fuse one measurement.

    Parameters
    ----------
    residual : x -> (m,) innovation z [-] h(x), its angles wrapped
    R : (m, m) noise covariance of z, or (m,) variances
    consider : names of state blocks that the measurement depends on and must not change
    """
    x, P, layout = belief.x.copy(), belief.P.copy(), belief.layout
    noise = np.array(R, float)
    root = np.diag(np.sqrt(noise)) if noise.ndim == 1 else np.linalg.cholesky(noise)
    m = root.shape[0]
    w = workspace(x.size, P.shape[0], m, spread)
    raised = _draw(x, P, layout.table, w)
    for i, point in enumerate(w.X.copy()):
        w.Y[i, :m] = np.linalg.solve(root, residual(point))  # whitened: unit variances
    r = np.ones(m)
    nis = innovate(r, m, w)
    if not np.isfinite(nis):
        raise DataError("the innovation covariance is not positive definite", fix="check P and R for negative or NaN")
    S = w.S[:, :m].copy()
    correct(x, P, r, m, kept(layout, consider), layout.table, w)
    return Updated(Gaussian(x, P, layout), root @ S @ root.T, nis, raised)


def _draw(x: Floats, P: Floats, table: Ints, w: Work) -> int:
    """Sigma points of a belief, its covariance repaired in place if it must be; returns how many eigenvalues were."""
    if draw(x, P, table, w):
        return 0
    repair = repaired(P)
    P[:] = repair.P
    if not draw(x, P, table, w):
        raise DataError("the covariance is not finite", fix="look at the step before for a division by zero")
    return repair.raised
