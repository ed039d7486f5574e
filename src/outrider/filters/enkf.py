"""Ensemble Kalman filter on the tangent space at the ensemble mean: stochastic, and a deterministic square root.

Models are functions of all members at once, rows of an array. Members, not moments, are the belief; a covariance is
the members' own, S = (N - 1)^-1 sum e e'. Every random number comes from the generator that is passed in.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.random import Generator

from outrider._kernel import kernel
from outrider.core.linalg import cholesky, solve_lower, solve_lower_rows, solve_upper_rows
from outrider.data.belief import Ensemble, Gaussian
from outrider.errors import ConfigError, DataError
from outrider.filters.ekf import kept
from outrider.filters.ukf import perturb, tangent_mean
from outrider.typing import Floats

# ------------------------------------------------------------------------------------------------ kernels


@kernel
def draw(rng: Generator, L: Floats, mean: Floats, out: Floats) -> None:
    """out (N, k) <- normals with covariance L L', L lower triangular, their sample mean (k,) taken off.

    Centring keeps the ensemble mean free of the noise drawn; divided by N - 1 the sample covariance stays unbiased.
    """
    members, k = out.shape
    for i in range(members):
        for j in range(k):
            out[i, j] = rng.standard_normal()
    centre(out, mean)
    for j in range(k - 1, -1, -1):  # from the last row of L up, so that those above it are still needed and there
        for i in range(members):
            out[i, j] *= L[j, j]
        for l in range(j):
            c = L[j, l]
            if c != 0.0:
                for i in range(members):
                    out[i, j] += c * out[i, l]


@kernel
def centre(Y: Floats, y: Floats) -> None:
    """y <- the mean of the rows of Y, Y <- Y - y."""
    members, k = Y.shape
    y[:] = 0.0
    for i in range(members):
        for j in range(k):
            y[j] += Y[i, j]
    for j in range(k):
        y[j] /= members
    for i in range(members):
        for j in range(k):
            Y[i, j] -= y[j]


@kernel
def gain(S: Floats, C: Floats, y: Floats, L: Floats, v: Floats) -> float:
    """C <- S^-1 C, the gain transposed, from C (m, n) the covariance of h with the state; returns the NIS, or NaN."""
    m = y.size
    if not cholesky(S, m, L):
        return np.nan
    nis = 0.0
    for k in range(m):
        v[k] = y[k]
    solve_lower(L, m, v)
    for k in range(m):
        nis += v[k] * v[k]
    solve_lower_rows(L, m, C)
    solve_upper_rows(L, m, C)
    return nis


# ------------------------------------------------------------------------------------------------ pure steps


@final
@dataclass(frozen=True, slots=True)
class Updated:
    """An ensemble after a measurement, with what the gate needs: S (m, m) and nis = y' S^-1 y, y the mean."""

    belief: Ensemble
    S: Floats
    nis: float


def sample(belief: Gaussian, members: int, rng: Generator) -> Ensemble:
    """Members drawn from a Gaussian; their mean is exactly the belief's."""
    if members < 2:
        raise ConfigError(f"an ensemble of {members}", fix="two members at least; dozens for a useful covariance")
    X = np.zeros((members, belief.x.size))
    X[:] = belief.x
    perturb(X, _noise(belief.P, members, rng), belief.layout.table)
    return Ensemble(X, belief.layout)


def moments(belief: Ensemble) -> tuple[Gaussian, Floats]:
    """The ensemble's Gaussian, and the members' tangent vectors E (N, n) at its mean."""
    x, E = _tangents(belief)
    return Gaussian(x, E.T @ E / (E.shape[0] - 1), belief.layout), E


def predict(
    belief: Ensemble,
    f: Callable[[Floats, float], Floats],
    dt: float,
    Q: Floats,
    rng: Generator,
    *,
    inflation: float = 1.0,
) -> Ensemble:
    """The ensemble one process step later.

    Parameters
    ----------
    f : (X (N, layout.size), dt) -> the members after dt
    Q : (n, n) noise that the step adds to the error state
    inflation : factor on the members' distances from their mean afterwards; 1 changes nothing
    """
    X, table = np.array(f(belief.X, dt), float, order="C"), belief.layout.table
    perturb(X, _noise(Q, X.shape[0], rng), table)
    if inflation == 1.0:
        return Ensemble(X, belief.layout)
    mean, E = moments(Ensemble(X, belief.layout))
    X[:] = mean.x
    perturb(X, inflation * E, table)
    return Ensemble(X, belief.layout)


def update(
    belief: Ensemble,
    residual: Callable[[Floats], Floats],
    R: Floats,
    rng: Generator,
    *,
    consider: tuple[str, ...] = (),
) -> Updated:
    """Fuse one measurement, each member its own perturbed copy (Burgers, van Leeuwen, Evensen 1998).

    Parameters
    ----------
    residual : X (N, layout.size) -> (N, m) innovations z [-] h(X), their angles wrapped
    R : (m, m) noise covariance of z, or (m,) variances
    consider : names of state blocks that the measurement depends on and must not change
    """
    a = _analyse(belief, residual, R)
    innovations = _noise(a.R, a.Y.shape[0], rng)
    innovations += a.Y
    innovations += a.y
    return _updated(belief, a, a.E + innovations @ (a.K * kept(belief.layout, consider)))


def update_square_root(
    belief: Ensemble,
    residual: Callable[[Floats], Floats],
    R: Floats,
) -> Updated:
    """Fuse one measurement without drawing noise: the ensemble transform with the symmetric root, mean preserving.

    E <- (I + V V')^(-1/2) E with V = Y R^(-1/2) / sqrt(N - 1)  (Bishop 2001; Wang, Bishop, Julier 2004). The root is
    found in the m measurements, not in the N members: I + V W diag(((1 + s)^(-1/2) - 1) / s) W' V', V'V = W diag(s) W'.
    Parameters as `update`; states cannot be considered, because one root cannot serve two gains.
    """
    a = _analyse(belief, residual, R)
    V = a.Y @ (np.linalg.inv(np.linalg.cholesky(a.R)).T / np.sqrt(a.Y.shape[0] - 1))
    s, W = np.linalg.eigh(V.T @ V)
    s = np.maximum(s, 0.0)
    root = np.sqrt(1.0 + s)
    shrink = (W * (-1.0 / (root * (1.0 + root)))) @ W.T  # ((1 + s)^(-1/2) - 1) / s without the division by s
    E = a.E + V @ (shrink @ (V.T @ a.E)) + a.y @ a.K
    return _updated(belief, a, E)


@final
@dataclass(frozen=True, slots=True)
class _Analysis:
    """What both updates need: mean x, tangent vectors E, innovations Y about their mean y, gain K transposed (m, n)."""

    x: Floats
    E: Floats
    Y: Floats
    y: Floats
    R: Floats
    S: Floats
    K: Floats
    nis: float


def _analyse(belief: Ensemble, residual: Callable[[Floats], Floats], R: Floats) -> _Analysis:
    """C = -E'Y / (N - 1),  S = Y'Y / (N - 1) + R,  K = C S^-1."""
    x, E = _tangents(belief)
    noise = np.diag(R) if np.ndim(R) == 1 else np.array(R, float, order="C")
    Y = np.array(residual(belief.X), float, order="C")
    members, m = Y.shape
    y = np.zeros(m)
    centre(Y, y)
    share = Y.T / (members - 1)
    S = share @ Y + noise
    K = -(share @ E)
    nis = gain(S, K, y, np.zeros((m, m)), np.zeros(m))
    if not np.isfinite(nis):
        raise DataError("the innovation covariance is not positive definite", fix="check R and the members for NaN")
    return _Analysis(x, E, Y, y, noise, S, K, nis)


def _tangents(belief: Ensemble) -> tuple[Floats, Floats]:
    """The mean x of the members, and their tangent vectors E (N, n) there."""
    X, layout = belief.X, belief.layout
    members, n = X.shape[0], layout.error_size
    x, E = np.zeros(layout.size), np.zeros((members, n))
    tangent_mean(X, np.full(members, 1.0 / members), layout.table, x, E, np.zeros(n))
    return x, E


def _updated(belief: Ensemble, a: _Analysis, E: Floats) -> Updated:
    """The members x [+] E."""
    X = np.zeros_like(belief.X)
    X[:] = a.x
    perturb(X, E, belief.layout.table)
    return Updated(Ensemble(X, belief.layout), a.S, a.nis)


def _noise(covariance: Floats, members: int, rng: Generator) -> Floats:
    """(members, n) centred normals with a covariance, which may be singular."""
    n = covariance.shape[0]
    W, L = np.zeros((members, n)), np.zeros((n, n))
    if cholesky(np.ascontiguousarray(covariance, float), n, L):
        draw(rng, L, np.zeros(n), W)
        return W
    draw(rng, np.eye(n), np.zeros(n), W)
    values, vectors = np.linalg.eigh(covariance)
    return W @ (vectors * np.sqrt(np.maximum(values, 0.0))).T
