"""How much one source's clock is behind another's, from a motion that both tell."""

from dataclasses import dataclass
from typing import Final, final

import numpy as np

from outrider.typing import Floats
from outrider.workflows.doctor.signals import Signal, instants

MOST: Final = 2.0  # s: clocks further apart are another fault
STEPS: Final = (0.05, 0.01)  # s of the first search and of the second
LIKE: Final = 0.6  # correlation below which two signals do not tell the same motion
CLEAR: Final = 10.0  # log-likelihood that the best lag must have over any that lies a window off
LEAST: Final = 1e-4  # of the power: two sources of one motion are never more alike
NEAR_S: Final = 0.5  # s: of clocks when only the sense of a motion is asked for
FEW: Final = 100  # instants compared, at least
LEAST_WINDOW: Final = 0.2  # s
BETWEEN: Final = 0.1  # of a period: what interpolation between noisy samples adds to the deviation of a lag
OVERLAP: Final = 4  # windows by which slopes of neighbours share samples


@final
@dataclass(frozen=True, slots=True)
class Lag:
    """b's stamps are `lag` s too late against a's (its records are so much older than they say), +- sd; a = gain b;
    r : correlation at that lag."""

    a: str
    b: str
    lag: float
    sd: float
    gain: float
    r: float


def lag_between(a: Signal, b: Signal) -> Lag | None:
    """The lag of b behind a at which they are most alike; None where they are not, or alike at several lags.

    b(t + lag) is what a(t) was. Both are averaged over one window; the correlation's peak is found by search, then by
    a parabola; its deviation is that of the time shift in a least-squares fit, with as many independent residuals as
    there are windows.
    """
    window = max(2.0 * a.period, 2.0 * b.period, LEAST_WINDOW)
    at = instants(a, b, 0.5 * window)
    if len(at) < FEW:
        return None
    mine = a.mean(at, window)
    lags = np.arange(-MOST, MOST + 0.5 * STEPS[0], STEPS[0])
    likeness = np.array([correlation(mine, b.mean(at + lag, window)) for lag in lags])
    best = int(np.nanargmax(np.abs(likeness))) if np.isfinite(likeness).any() else 0
    if not abs(likeness[best]) > LIKE or best in (0, len(lags) - 1):
        return None
    sign = np.sign(likeness[best])
    away = np.abs(lags - lags[best]) > max(2.0 * window, 0.5)
    if np.any(unlike(likeness[away], sign) < unlike(likeness[best], sign) * np.exp(2.0 * CLEAR / (0.5 * len(at)))):
        return None
    near = lags[best] + np.arange(-STEPS[0], STEPS[0] + 0.5 * STEPS[1], STEPS[1])
    likeness = sign * np.array([correlation(mine, b.mean(at + lag, window)) for lag in near])
    if not np.isfinite(likeness).all():
        return None
    best = int(np.clip(np.argmax(likeness), 1, len(near) - 2))
    low, mid, high = likeness[best - 1 : best + 2]
    bend = low - 2.0 * mid + high
    lag = near[best] + (0.5 * (low - high) / bend * STEPS[1] if bend < 0.0 else 0.0)
    return fitted(a, b, at, window, float(lag))


def unlike(r: Floats, sign: float) -> Floats:
    """Share of the power that a line leaves where the correlation is r, all of it where that has the wrong sign. A
    likelihood of n windows grows by n/2 times the logarithm of its ratio; every other window here is one of its own."""
    return np.asarray(1.0 - np.maximum(sign * r, 0.0) ** 2 + LEAST, np.float64)


def alike(a: Signal, b: Signal) -> float:
    """The correlation of largest magnitude within `NEAR_S` of no lag, 0 where the two do not tell the same motion."""
    window = max(2.0 * a.period, 2.0 * b.period, LEAST_WINDOW)
    at = instants(a, b, 0.5 * window)
    if len(at) < FEW:
        return 0.0
    lags = np.arange(-NEAR_S, NEAR_S + 0.5 * STEPS[0], 2.0 * STEPS[0])
    r = np.nan_to_num([correlation(a.mean(at, window), b.mean(at + lag, window)) for lag in lags])
    best = float(r[np.argmax(np.abs(r))])
    return best if abs(best) > LIKE else 0.0


def correlation(x: Floats, y: Floats, few: int = FEW) -> float:
    """Pearson's r of what is finite in both; NaN of less than a few."""
    good = np.isfinite(x) & np.isfinite(y)
    if good.sum() < few:
        return float("nan")
    x, y = x[good] - x[good].mean(), y[good] - y[good].mean()
    size = float(np.sqrt((x @ x) * (y @ y)))
    return float(x @ y) / size if size > 0.0 else float("nan")


def fitted(a: Signal, b: Signal, at: Floats, window: float, lag: float) -> Lag:
    """The gain at a lag, and how sure the lag is.

    The lag is where the score sum x y' is zero, y' the slope of y. With x = gain y + left the score is sum left y', for
    sum y y' is nothing but ends; its own slope is -sum x' y'. So the lag's variance is that of sum left y' over the
    square of sum x' y', whose noises are independent; neighbouring windows overlap, so their products count too.
    """
    x, y = a.mean(at, window), b.mean(at + lag, window)
    slopes = a.slope(at, 2.0 * window), b.slope(at + lag, 2.0 * window)
    good = np.isfinite(x) & np.isfinite(y) & np.isfinite(slopes[0]) & np.isfinite(slopes[1])
    x, y = x[good] - x[good].mean(), y[good] - y[good].mean()
    dx, dy = slopes[0][good], slopes[1][good]
    gain = float(x @ y) / float(y @ y)
    score = (x - gain * y) * dy
    spread = float(score @ score) + 2.0 * sum(max(float(score[k:] @ score[:-k]), 0.0) for k in range(1, OVERLAP + 1))
    told = abs(float(dx @ dy))
    between = BETWEEN * max(a.period, b.period)
    sd = float(np.hypot(np.sqrt(spread) / told, between)) if told > 0.0 else float("inf")
    return Lag(a.source, b.source, lag, sd, gain, float(x @ y) / float(np.sqrt((x @ x) * (y @ y))))
