"""How sure a least-squares estimate is whose residuals are neither white nor of the variance that was believed."""

from typing import Final

import numpy as np

from outrider.typing import Floats

BIN_S: Final = 0.5  # s over which scores are summed
LAG_S: Final = 5.0  # s over which they are taken to be correlated
SURE: Final = 2.2  # deviations of a 95 % interval: of Student's t with some ten, which is what a sandwich leaves


def sandwich(A: Floats, scores: Floats, t: Floats, scatter: float) -> Floats:
    """(p, p) A^-1 B A^-1, B the sum of the products of scores (n, p) at times (n,) [s], by Newey & West (1987).

    A few moments with much to say make B too small (MacKinnon & White 1985), so no deviation is less than that of white
    residuals, A^-1 times their `scatter` (mean square).
    """
    bins = np.floor((t - t.min()) / BIN_S).astype(np.int64)
    g = np.zeros((int(bins.max()) + 1, A.shape[0]))
    np.add.at(g, bins, scores)
    products, lags = g.T @ g, round(LAG_S / BIN_S)
    for k in range(1, min(lags + 1, len(g))):
        cross = g[k:].T @ g[:-k]
        products += (1.0 - k / (lags + 1)) * (cross + cross.T)
    inverse = np.linalg.inv(A)
    cov = inverse @ products @ inverse
    grow = np.sqrt(np.maximum(scatter * np.diag(inverse) / np.maximum(np.diag(cov), 1e-300), 1.0))
    return np.asarray(cov * np.outer(grow, grow), np.float64)


__all__ = ["SURE", "sandwich"]
