"""How far it is to the nearest of some cells, exactly."""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from outrider._kernel import kernel
from outrider.typing import Bools, Floats, Ints


@kernel
def transform(taken: NDArray[np.uint8], side: float, out: Floats, f: Floats, place: Ints, begin: Floats) -> None:
    """out (rows, cols) <- distance from the middle of a cell to that of the nearest with `taken` != 0, which there is.

    side : of a cell;  f (cols), place (cols), begin (cols + 1) : scratch.

    Along columns first, then over each row the lower envelope of the parabolas (c - q)^2 + d_q^2.
    P. Felzenszwalb, D. Huttenlocher, "Distance transforms of sampled functions", Theory of Computing 8, 2012.
    """
    rows, cols = taken.shape
    far = float(rows + cols)
    for c in range(cols):
        out[0, c] = 0.0 if taken[0, c] else far
    for r in range(1, rows):
        for c in range(cols):
            out[r, c] = 0.0 if taken[r, c] else out[r - 1, c] + 1.0
    for r in range(rows - 2, -1, -1):
        for c in range(cols):
            out[r, c] = min(out[r, c], out[r + 1, c] + 1.0)
    for r in range(rows):
        row = out[r]
        for c in range(cols):
            f[c] = row[c] * row[c]
        k, place[0], begin[0] = 0, 0, -np.inf
        for c in range(1, cols):
            q = int(place[k])
            s = 0.5 * (c + q + (f[c] - f[q]) / (c - q))
            while s <= begin[k]:
                k -= 1
                q = int(place[k])
                s = 0.5 * (c + q + (f[c] - f[q]) / (c - q))
            k += 1
            place[k], begin[k] = c, s
        begin[k + 1] = np.inf
        k = 0
        for c in range(cols):
            while begin[k + 1] < c:
                k += 1
            q = int(place[k])
            row[c] = side * sqrt((c - q) * (c - q) + f[q])


def distances(taken: Bools, side: float) -> Floats:
    """(rows, cols) distance between the middles of cells to the nearest taken one, inf where none is."""
    out = np.full(taken.shape, np.inf)
    if taken.any():
        cols = taken.shape[1]
        transform(taken.view(np.uint8), side, out, np.empty(cols), np.empty(cols, np.int64), np.empty(cols + 1))
    return out
