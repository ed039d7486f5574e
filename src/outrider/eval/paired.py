"""Numbers over seeds: means with their uncertainty, and differences between two methods that saw the same data.

Two methods run on the same seeds share the noise, so their *paired* differences are far less scattered than either
alone: 5 mm instead of 19 mm in one of our studies. One run per method proves nothing.

Sources: Student's t; Wilcoxon signed ranks (exact for few pairs); BCa bootstrap (Efron 1987); Holm (1979).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, nan, sqrt
from typing import final

import numpy as np
from numpy.random import Generator
from scipy.special import ndtr, ndtri, stdtr, stdtrit

from outrider.errors import UsageError
from outrider.typing import Floats

EXACT = 50  # pairs up to which the distribution of the signed ranks is enumerated
_BLOCK = 1 << 20  # numbers drawn at a time by the bootstrap


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """Of n finite values: mean, standard deviation, and the interval [low, high] that holds the true mean (t).

    NaN where there are too few: a mean needs one value, a spread two. `lost` values were not finite.
    """

    n: int
    mean: float
    sd: float
    low: float
    high: float
    lost: int = 0
    confidence: float = 0.95


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Paired:
    """Differences a - b over n pairs; where less is better, a negative mean says that a is the better one.

    low, high : interval of the mean difference by Student's t;  boot_low, boot_high : by BCa bootstrap, NaN without rng
    wins : share of the pairs in which a is less than b, ties counting half
    p_t, p_wilcoxon : two-sided probabilities of such a difference if there were none
    effect : mean / sd (Cohen's d_z);  rank_effect : rank-biserial correlation, -1 if a is always less
    lost : pairs with a value that is not finite
    """

    n: int
    mean: float
    sd: float
    low: float
    high: float
    boot_low: float
    boot_high: float
    wins: float
    p_t: float
    p_wilcoxon: float
    effect: float
    rank_effect: float
    lost: int = 0
    confidence: float = 0.95


def summary(values: Sequence[float] | Floats, *, confidence: float = 0.95) -> Summary:
    """Mean, spread and confidence interval of one number per seed."""
    _check(confidence)
    x = np.asarray(values, np.float64).ravel()
    known = x[np.isfinite(x)]
    mean, sd = _moments(known)
    low, high = _student(known.size, mean, sd, confidence)
    return Summary(n=known.size, mean=mean, sd=sd, low=low, high=high, lost=x.size - known.size, confidence=confidence)


def paired(
    a: Sequence[float] | Floats,
    b: Sequence[float] | Floats,
    *,
    rng: Generator | None = None,
    confidence: float = 0.95,
    resamples: int = 4000,
) -> Paired:
    """Compare two methods by one number per seed each, a[i] and b[i] of the same seed; `rng` asks for the bootstrap."""
    _check(confidence)
    x, y = np.asarray(a, np.float64).ravel(), np.asarray(b, np.float64).ravel()
    if x.size != y.size:
        raise UsageError(f"{x.size} values cannot be paired with {y.size}", fix="give one of each per seed, in order")
    both = np.isfinite(x) & np.isfinite(y)
    d = x[both] - y[both]
    mean, sd = _moments(d)
    low, high = _student(d.size, mean, sd, confidence)
    boot = (nan, nan) if rng is None else bootstrap(d, rng, confidence=confidence, resamples=resamples)
    p_wilcoxon, rank_effect = wilcoxon(d)
    return Paired(
        n=d.size,
        mean=mean,
        sd=sd,
        low=low,
        high=high,
        boot_low=boot[0],
        boot_high=boot[1],
        wins=float(np.mean((d < 0) + 0.5 * (d == 0))) if d.size else nan,
        p_t=_p_student(d.size, mean, sd),
        p_wilcoxon=p_wilcoxon,
        effect=mean / sd if sd > 0 else _sided(mean) if d.size > 1 else nan,
        rank_effect=rank_effect,
        lost=x.size - d.size,
        confidence=confidence,
    )


def bootstrap(
    values: Floats, rng: Generator, *, confidence: float = 0.95, resamples: int = 4000
) -> tuple[float, float]:
    """Interval of the mean of values (n,) without assuming a shape: bias-corrected and accelerated (BCa)."""
    n = values.size
    if n < 2:
        return nan, nan
    d = values - values.mean()
    power = float(d @ d)
    if power == 0.0:
        return float(values[0]), float(values[0])
    means = _resampled(values, rng, resamples)
    below = float(np.mean(means < values.mean()) + 0.5 * np.mean(means == values.mean()))
    z0 = float(ndtri(np.clip(below, 0.5 / resamples, 1.0 - 0.5 / resamples)))
    acceleration = float((d**3).sum()) / (6.0 * power**1.5)  # of the jackknife, in closed form for a mean
    z = z0 + ndtri([0.5 - 0.5 * confidence, 0.5 + 0.5 * confidence])
    low, high = np.quantile(means, ndtr(z0 + z / (1.0 - acceleration * z)))
    return float(low), float(high)


def wilcoxon(d: Floats) -> tuple[float, float]:
    """Two-sided p of the signed ranks of differences d (n,), and their rank-biserial correlation; zeros are left out.

    Exact for up to `EXACT` differences, ties included (the distribution given the ranks); normal beyond.
    """
    d = d[d != 0.0]
    n = d.size
    if n == 0:
        return 1.0, 0.0
    ranks = _ranks(np.abs(d))
    plus, whole = float(ranks[d > 0].sum()), float(ranks.sum())
    less = min(plus, whole - plus)
    if n <= EXACT:
        p = 2.0 * _signed_rank_cdf(ranks, less)
    else:
        p = 2.0 * float(ndtr((less - 0.5 * whole) / sqrt(0.25 * float(ranks @ ranks))))
    return min(p, 1.0), 2.0 * plus / whole - 1.0


def corrected(p: Sequence[float] | Floats, method: str = "holm") -> Floats:
    """p values of a family of tests, so that any below alpha is a discovery at family-wise level alpha.

    "holm" holds for any dependence and is never weaker than "bonferroni"; "sidak" is exact for independent tests.
    NaN (a test that could not be made) stays NaN and does not count.
    """
    values = np.asarray(p, np.float64)
    out = values.copy()
    rows = np.flatnonzero(np.isfinite(values))
    rows = rows[np.argsort(values[rows], kind="stable")]
    m = rows.size
    if method == "holm":
        out[rows] = np.maximum.accumulate(values[rows] * np.arange(m, 0, -1))
    elif method == "bonferroni":
        out[rows] = values[rows] * m
    elif method == "sidak":
        out[rows] = -np.expm1(m * np.log1p(-np.minimum(values[rows], 1.0 - 1e-16)))
    else:
        raise UsageError(f"no correction '{method}'", fix="holm, bonferroni or sidak")
    return np.minimum(out, 1.0)


def _check(confidence: float) -> None:
    if not 0.0 < confidence < 1.0:
        raise UsageError(f"no interval with confidence {confidence}", fix="give a share between 0 and 1")


def _moments(x: Floats) -> tuple[float, float]:
    return float(x.mean()) if x.size else nan, float(x.std(ddof=1)) if x.size > 1 else nan


def _student(n: int, mean: float, sd: float, confidence: float) -> tuple[float, float]:
    if n < 2:
        return nan, nan
    reach = float(stdtrit(n - 1, 0.5 + 0.5 * confidence)) * sd / sqrt(n)
    return mean - reach, mean + reach


def _p_student(n: int, mean: float, sd: float) -> float:
    if n < 2:
        return nan
    t = abs(mean) / sd * sqrt(n) if sd > 0 else abs(_sided(mean))
    return 2.0 * float(stdtr(n - 1, -t))


def _sided(mean: float) -> float:
    """What mean / 0 tends to; 0 for two methods that are the same."""
    return 0.0 if mean == 0 else inf if mean > 0 else -inf


def _resampled(values: Floats, rng: Generator, resamples: int) -> Floats:
    """(resamples,) means of draws with replacement, in blocks that fit into the memory."""
    rows = max(1, _BLOCK // values.size)
    parts = [
        values[rng.integers(values.size, size=(min(rows, resamples - k), values.size))].mean(axis=1)
        for k in range(0, resamples, rows)
    ]
    return np.concatenate(parts)


def _ranks(x: Floats) -> Floats:
    """Ranks from 1, ties sharing their mean."""
    _, inverse, counts = np.unique(x, return_inverse=True, return_counts=True)
    last = np.cumsum(counts)
    return (last - 0.5 * (counts - 1))[inverse]


def _signed_rank_cdf(ranks: Floats, value: float) -> float:
    """P(sum of the ranks with a plus sign <= value) when every sign is a fair coin."""
    steps = np.rint(2.0 * ranks).astype(np.int64)  # shared ranks are halves
    ways = np.zeros(int(steps.sum()) + 1)
    ways[0] = 1.0
    for step in steps:
        ways[step:] += ways[:-step].copy()
        ways *= 0.5
    return float(ways[: round(2.0 * value) + 1].sum())
