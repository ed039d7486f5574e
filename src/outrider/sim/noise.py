"""Random processes: white noise, random walks, first-order Gauss-Markov, and one generator per robot and sensor."""

from zlib import crc32

import numpy as np
from numpy.random import Generator

from outrider._kernel import kernel
from outrider.typing import Floats


def generator(seed: int, robot: str, source: str) -> Generator:
    """The random numbers of one source of one robot; adding another source leaves them as they are."""
    key = (crc32(robot.encode()), crc32(source.encode()))
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))


def white(rng: Generator, n: int, columns: int, sigma: float | tuple[float, ...] | Floats) -> Floats:
    """(n, columns) independent draws of standard deviation sigma, one for all columns or one each."""
    out = rng.standard_normal((n, columns))
    out *= sigma
    return out


def random_walk(rng: Generator, n: int, columns: int, dt: float, density: float, start: float = 0.0) -> Floats:
    """(n, columns) x' = white noise of the given density [unit/s/sqrt(Hz)]; x_0 ~ N(0, start^2)."""
    if density == 0.0 and start == 0.0:
        return np.zeros((n, columns))
    steps = rng.standard_normal((n, columns)) * density * np.sqrt(dt)
    steps[:1] = rng.standard_normal((1, columns)) * start
    return np.cumsum(steps, axis=0)


def gauss_markov(
    rng: Generator, n: int, columns: int, dt: float, sigma: float | tuple[float, ...], tau_s: float
) -> Floats:
    """(n, columns) x' = -x / tau + noise, in its steady state: deviation sigma, autocorrelation exp(-lag / tau)."""
    if not np.any(sigma):
        return np.zeros((n, columns))
    x = rng.standard_normal((n, columns)) * np.asarray(sigma)
    keep = float(np.exp(-dt / tau_s))
    x[1:] *= np.sqrt(1.0 - keep * keep)
    carry_on(x, keep)
    return x


@kernel
def carry_on(x: Floats, keep: float) -> None:
    """x_k += keep x_(k-1), row by row."""
    for k in range(1, x.shape[0]):
        for j in range(x.shape[1]):
            x[k, j] += keep * x[k - 1, j]
