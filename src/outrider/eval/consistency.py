"""Is a covariance honest? Averages of normalised squared errors against chi-square bounds, and coverage of ellipses.

NEES of a state error e with covariance P, and NIS of an innovation with covariance S, are e' P^-1 e: chi-square with
dim(e) degrees of freedom if the filter is honest. Samples along one run are correlated, so an average over time has
wider bounds than independent samples have: average over seeds at one time, or divide by `effective_samples`.
Source: Bar-Shalom, Li and Kirubarajan, "Estimation with Applications to Tracking and Navigation", 5.4.
"""

from dataclasses import dataclass
from typing import final

import numpy as np
from scipy.special import chdtri

from outrider.errors import UsageError
from outrider.typing import Floats


def chi_square(e: Floats, P: Floats) -> Floats:
    """(...,) e' P^-1 e for e (..., d) and P (..., d, d): NEES or NIS. NaN where P is not positive definite."""
    shape = np.broadcast_shapes(e.shape[:-1], P.shape[:-2])
    d = e.shape[-1]
    errors = np.broadcast_to(e, (*shape, d)).reshape(-1, d)
    covariances = np.broadcast_to(P, (*shape, d, d)).reshape(-1, d, d)
    out = np.full(errors.shape[0], np.nan)
    rows = np.flatnonzero(np.isfinite(errors).all(axis=1) & np.isfinite(covariances).all(axis=(1, 2)))
    rows = rows[np.linalg.eigvalsh(covariances[rows])[:, 0] > 0.0]
    out[rows] = np.einsum("ni,ni->n", errors[rows], np.linalg.solve(covariances[rows], errors[rows, :, None])[..., 0])
    return out.reshape(shape)


def family_level(probability: float, tests: int, method: str = "sidak") -> float:
    """Probability inside for each of several tests, so that all hold together with the given one.

    "sidak" is exact for independent tests, "bonferroni" holds for any.
    """
    if not (0.0 < probability < 1.0 and tests >= 1):
        raise UsageError(f"no bounds for probability {probability} and {tests} tests")
    if method == "sidak":
        return float(np.exp(np.log(probability) / tests))
    if method == "bonferroni":
        return 1.0 - (1.0 - probability) / tests
    raise UsageError(f"no correction '{method}'", fix="sidak or bonferroni")


def average_bounds(
    dof: float, n: float, *, probability: float = 0.999, tests: int = 1, method: str = "sidak"
) -> tuple[float, float]:
    """Two-sided bounds of the mean of n independent chi-square values of `dof` degrees of freedom.

    n * mean is chi-square with n * dof degrees. n may be fractional (effective samples). With `tests` > 1 each interval
    is widened so that all of that many averages stay inside with the given probability.
    """
    tail = 0.5 * (1.0 - family_level(probability, tests, method))
    return float(chdtri(n * dof, 1.0 - tail)) / n, float(chdtri(n * dof, tail)) / n


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Test:
    """One average against its bounds. `n` independent or effective samples; above `high` is over-confident."""

    __test__ = False  # not a test case, whatever pytest thinks of the name

    mean: float
    low: float
    high: float
    dof: int
    n: float

    @property
    def inside(self) -> bool:
        """Whether the average lies within its bounds (no samples: no)."""
        return bool(self.low <= self.mean <= self.high)

    def __str__(self) -> str:
        word = "consistent" if self.inside else "over-confident" if self.mean > self.high else "over-cautious"
        return f"{word}: mean {self.mean:.3g} of {self.n:.0f}, expected {self.dof} in [{self.low:.3g}, {self.high:.3g}]"


def average_test(
    values: Floats,
    dof: int,
    *,
    probability: float = 0.999,
    tests: int = 1,
    method: str = "sidak",
    independent: bool = True,
) -> Test:
    """Mean of NEES or NIS values (n,) against its bounds; `independent=False` for values along one run."""
    values = values[np.isfinite(values)]
    if values.size == 0:
        raise UsageError("no finite value to average", fix="check that covariances are positive definite")
    n = float(values.size) if independent else effective_samples(values)
    low, high = average_bounds(dof, n, probability=probability, tests=tests, method=method)
    return Test(mean=float(values.mean()), low=low, high=high, dof=dof, n=n)


def effective_samples(values: Floats) -> float:
    """How many independent samples have a mean as uncertain as that of a correlated series (n,).

    n / (1 + 2 sum rho_k), summed while neighbouring pairs of autocorrelations stay positive (Geyer 1992).
    """
    n = values.size
    x = values - values.mean()
    power = float(x @ x)
    if n < 4 or power == 0.0:
        return float(n)
    spectrum = np.fft.rfft(x, 2 * n)
    rho = np.fft.irfft(np.abs(spectrum) ** 2)[:n] / power
    pairs = rho[0 : n - n % 2 : 2] + rho[1::2][: n // 2]  # the first holds lag 0
    negative = np.flatnonzero(pairs <= 0.0)
    time = 2.0 * float(pairs[: negative[0] if negative.size else pairs.size].sum()) - 1.0
    return float(np.clip(n / max(time, 1e-12), 1.0, n))


def ellipse_coverage(e: Floats, P: Floats, probability: float = 0.95) -> float:
    """Share of errors e (n, d) inside the ellipse of P (n, d, d) that should hold the given share."""
    values = chi_square(e, P)
    values = values[np.isfinite(values)]
    if values.size == 0:
        return float("nan")
    return float(np.mean(values <= chdtri(e.shape[-1], 1.0 - probability)))
