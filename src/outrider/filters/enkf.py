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
from outrider.core.manifold import retract
from outrider.data.belief import Ensemble, Gaussian
from outrider.errors import ConfigError
from outrider.filters.ekf import kept
from outrider.filters.ukf import tangent_mean
from outrider.typing import Floats, Ints

# ------------------------------------------------------------------------------------------------ kernels


@kernel
def standard_normals(rng: Generator, out: Floats) -> None:
    """out (N, k) <- independent normals with mean 0 and variance 1, their sample mean taken off.

    Centring keeps the ensemble mean free of the noise drawn; divided by N - 1 the sample covariance stays unbiased.
    """
    members, k = out.shape
    for j in range(k):
        total = 0.0
        for i in range(members):
            out[i, j] = rng.standard_normal()
            total += out[i, j]
        total /= members
        for i in range(members):
            out[i, j] -= total


@kernel
def retract_all(X: Floats, x: Floats, E: Floats, table: Ints) -> None:
    """X[i] <- x [+] E[i]."""
    for i in range(X.shape[0]):
        for j in range(x.size):
            X[i, j] = x[j]
        retract(X[i], E[i], table)


@kernel
def perturb(X: Floats, E: Floats, table: Ints) -> None:
    """X[i] <- X[i] [+] E[i]."""
    for i in range(X.shape[0]):
        retract(X[i], E[i], table)


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
    retract_all(X, belief.x, _noise(belief.P, members, rng), belief.layout.table)
    return Ensemble(X, belief.layout)


def moments(belief: Ensemble) -> tuple[Gaussian, Floats]:
    """The ensemble's Gaussian, and the members' tangent vectors E (N, n) at its mean."""
    X, layout = belief.X, belief.layout
    members, n = X.shape[0], layout.error_size
    x, E = np.zeros(layout.size), np.zeros((members, n))
    tangent_mean(X, np.full(members, 1.0 / members), layout.table, x, E, np.zeros(n))
    return Gaussian(x, E.T @ E / (members - 1), layout), E


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
    retract_all(X, mean.x, inflation * E, table)
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
    # e <- e + K (y + noise); members' innovations carry the spread of h themselves
    E = a.E + (a.Y + a.y + _noise(a.R, a.Y.shape[0], rng)) @ (a.K * kept(belief.layout, consider))
    return _updated(belief, a, E)


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
    V = np.linalg.solve(np.linalg.cholesky(a.R), a.Y.T).T / np.sqrt(a.Y.shape[0] - 1)
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


def _analyse(belief: Ensemble, residual: Callable[[Floats], Floats], R: Floats) -> _Analysis:
    """C = -E'Y / (N - 1),  S = Y'Y / (N - 1) + R,  K = C S^-1."""
    mean, E = moments(belief)
    noise = np.diag(R) if np.ndim(R) == 1 else np.array(R, float)
    innovations = residual(belief.X)
    y = innovations.mean(axis=0)
    Y = innovations - y
    S = Y.T @ Y / (Y.shape[0] - 1) + noise
    K = np.linalg.solve(S, -(Y.T @ E) / (Y.shape[0] - 1))
    return _Analysis(mean.x, E, Y, y, noise, S, K)


def _updated(belief: Ensemble, a: _Analysis, E: Floats) -> Updated:
    """The members x [+] E."""
    X = np.zeros_like(belief.X)
    retract_all(X, a.x, np.ascontiguousarray(E), belief.layout.table)
    return Updated(Ensemble(X, belief.layout), a.S, float(a.y @ np.linalg.solve(a.S, a.y)))


def _noise(covariance: Floats, members: int, rng: Generator) -> Floats:
    """(members, n) centred normals with a covariance, which may be singular."""
    W = np.zeros((members, covariance.shape[0]))
    standard_normals(rng, W)
    variances = np.diag(covariance)
    if not np.any(covariance - np.diag(variances)):
        return W * np.sqrt(variances)
    values, vectors = np.linalg.eigh(covariance)
    return W @ (vectors * np.sqrt(np.maximum(values, 0.0))).T
