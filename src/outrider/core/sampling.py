"""Random numbers with a wanted covariance. Randomness is an argument: a Generator, or normals z drawn by one."""

from math import exp, sqrt

import numpy as np
from numpy.typing import ArrayLike

from outrider.errors import DataError
from outrider.typing import Floats

# Rounding may leave eigenvalues this far below zero, relative to the largest; more is a covariance that is none.
_ROUNDING = 1e-9


def covariance_root(P: ArrayLike) -> Floats:
    """The symmetric L (d, d) with L L' = P, for a covariance P (d, d) that may be singular.

    Unlike a Cholesky factor it exists without full rank, and unlike bare eigenvectors it has no free signs, so that
    the same numbers come out of every linear algebra library. P far from symmetric positive semi-definite: `DataError`.

    >>> covariance_root([[4.0, 0.0], [0.0, 0.0]]).tolist()
    [[2.0, 0.0], [0.0, 0.0]]
    """
    matrix = np.asarray(P, dtype=np.float64)
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or not np.isfinite(matrix).all():
        raise DataError(f"a covariance must be a finite square matrix, not {matrix.shape}", fix="look for NaN in it")
    scale = max(float(np.abs(matrix).max(initial=0.0)), np.finfo(np.float64).tiny)
    if np.abs(matrix - matrix.T).max(initial=0.0) > _ROUNDING * scale:
        raise DataError("a covariance must be symmetric", fix="use 0.5 (P + P')")
    values, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    lowest = float(values.min(initial=0.0))
    if lowest < -_ROUNDING * scale:
        raise DataError(f"a covariance has the negative eigenvalue {lowest:g}", fix="no variance can be negative")
    return (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T


def correlated(z: ArrayLike, P: ArrayLike) -> Floats:
    """Standard normals z (..., d) turned into draws (..., d) of covariance P (d, d), singular or not."""
    return np.asarray(z, dtype=np.float64) @ covariance_root(P)


def normal(rng: np.random.Generator, P: ArrayLike, n: int) -> Floats:
    """n draws (n, d) of zero mean and covariance P (d, d)."""
    root = covariance_root(P)
    return rng.standard_normal((n, root.shape[0])) @ root


def gauss_markov(z: ArrayLike, dt: float, tau: float, sigma: float) -> Floats:
    """First-order Gauss-Markov sequences (n, ...) from standard normals z (n, ...), stationary from the first sample.

    b[0] = sigma z[0],  b[i] = phi b[i-1] + sigma sqrt(1 - phi^2) z[i],  phi = exp(-dt / tau): exact at any step dt [s];
    tau : correlation time [s];  sigma : standard deviation.
    """
    b = np.array(z, dtype=np.float64) * sigma
    phi = exp(-dt / tau)
    drive = sqrt(1.0 - phi * phi)
    for i in range(1, b.shape[0]):
        b[i] = phi * b[i - 1] + drive * b[i]
    return b


def random_walk(z: ArrayLike, dt: float, density: float) -> Floats:
    """Random walks (n, ...) from standard normals z (n, ...), zero before the first step dt [s].

    density : growth of the standard deviation, [unit/sqrt(s)].
    """
    return np.cumsum(np.asarray(z, dtype=np.float64), axis=0) * (density * sqrt(dt))
