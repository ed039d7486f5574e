"""Cost around what is taken: exact Euclidean distances, and a table from distance to cost."""

from dataclasses import dataclass
from math import floor, inf, log
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from outrider._kernel import kernel
from outrider.data.grid import INSCRIBED, LETHAL, UNKNOWN
from outrider.errors import ConfigError
from outrider.typing import Floats

WIDEST: Final = 180  # cells: squared distances fit in 16 bits
CHUNK: Final = 256  # cells of a row that are looked at together
_LANES: Final = 64  # cells that a processor takes at once: rows are filled up to a multiple
_EDGE: Final = 1e-9  # cells: a distance of exactly the inscribed radius counts as within, whatever rounding says


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Inflation:
    """Cost at a distance d from the nearest lethal cell, between middles of cells, as nav2_costmap_2d has it:

    254 for d = 0,  253 for d <= inscribed,  floor(252 exp(-factor (d - inscribed))) for d <= radius,  0 beyond.

    inscribed : radius of the disc inside the footprint [m];  radius : where cost ends [m];
    factor : how fast it falls [1/m];  into_unknown : whether unknown cells take any cost above 0; else only one >= 253.

    nav2 rounds `radius` up to whole cells; here it is taken as it stands. Raises ConfigError for what is not >= 0.
    """

    inscribed: float
    radius: float = 0.55
    factor: float = 10.0
    into_unknown: bool = False

    def __post_init__(self) -> None:
        for name in ("inscribed", "radius", "factor"):
            if not 0.0 <= getattr(self, name) < inf:
                raise ConfigError(f"{name} is {getattr(self, name):g}", where="inflation", fix="zero or more, finite")
        if self.radius < self.inscribed:
            what = f"radius {self.radius:g} m is less than the inscribed radius {self.inscribed:g} m"
            raise ConfigError(what, where="inflation", fix="the robot would touch what it passes: widen it")

    def cost(self, distance: Floats, *, slack: float = 1e-9) -> NDArray[np.uint8]:
        """Cost at distances [m] from the middle of a lethal cell; `slack` [m] widens every bound."""
        graded = np.floor((INSCRIBED - 1) * np.exp(-self.factor * np.maximum(distance - self.inscribed, 0.0)) + 1e-9)
        cost = np.where(distance <= self.inscribed + slack, float(INSCRIBED), graded)
        cost = np.where(distance <= self.radius + slack, cost, 0.0)
        return np.where(distance <= 0.0, float(LETHAL), cost).astype(np.uint8)

    def distance(self, cost: float) -> float:
        """The distance [m] at which a graded cost (1..252) stands: inscribed + ln(252 / cost) / factor."""
        return self.inscribed + log((INSCRIBED - 1) / cost) / self.factor if self.factor > 0.0 else self.radius

    def reach(self, resolution: float) -> int:
        """Cells that `radius` spans; ConfigError where they are too many."""
        cells = floor(self.radius / resolution + _EDGE)
        if cells > WIDEST:
            what = f"a radius of {self.radius:g} m is {cells:.6g} cells of {resolution:g} m, more than {WIDEST}"
            raise ConfigError(what, where="inflation", fix="a smaller radius or a coarser map")
        return cells

    def table(self, resolution: float) -> NDArray[np.uint8]:
        """Cost by squared distance in cells, as `inflate` takes it."""
        beyond = self.reach(resolution) + 1
        cells = np.sqrt(np.arange(2 * beyond * beyond + 1, dtype=np.float64))
        return self.cost(cells * resolution, slack=_EDGE * resolution)


@final
class Inflater:
    """Inflates maps of one shape, or windows of them, with memory that it keeps."""

    def __init__(self, inflation: Inflation, resolution: float, shape: tuple[int, int]) -> None:
        self._reach, self._table = inflation.reach(resolution), inflation.table(resolution)
        self._free_unknown = np.uint8(0 if inflation.into_unknown else INSCRIBED - 1)
        self._near: NDArray[np.uint8] = np.empty(shape, np.uint8)
        self._line: NDArray[np.uint16] = np.empty(shape[1] + 2 * self._reach + _LANES, np.uint16)
        self._best: NDArray[np.uint16] = np.empty(CHUNK, np.uint16)

    @property
    def reach(self) -> int:
        """Cells that cost spreads."""
        return self._reach

    def __call__(
        self, base: NDArray[np.uint8], out: NDArray[np.uint8], box: tuple[int, int, int, int] | None = None
    ) -> None:
        """Write `base` inflated to `out`, both (rows, cols); only in `box`: first and end row, first and end column."""
        rows, cols = base.shape
        r0, r1, c0, c1 = box or (0, rows, 0, cols)
        if r0 < r1 and c0 < c1:
            near, line, best = self._near, self._line, self._best
            inflate(base, out, r0, r1, c0, c1, self._reach, self._table, self._free_unknown, near, line, best)


@kernel
def inflate(
    base: Any,
    out: Any,
    r0: int,
    r1: int,
    c0: int,
    c1: int,
    reach: int,
    table: Any,
    free_unknown: Any,
    near: Any,
    line: Any,
    best: Any,
) -> None:
    """Costs of the rows r0..r1 and columns c0..c1 of `base`, raised around its lethal cells, to `out`.

    table : cost by squared distance [cells];  an unknown cell takes costs above `free_unknown`;
    near : (rows, cols) uint8, line : (cols + 2 reach + 64) uint16, best : (CHUNK) uint16, all overwritten.

    The exact transform is separable: how far the nearest lethal cell of one's own column is, then over the row
    min_i i^2 + near^2. Both are capped at `reach`, so whole stretches of a row are worked on at once, outward,
    until no nearer cell can come, or not at all where nothing is near.
    """
    rows, cols = base.shape
    low, high = max(r0 - reach, 0), min(r1 + reach, rows)
    left, right = max(c0 - reach, 0), min(c1 + reach, cols)
    none, far = np.uint8(0), np.uint8(reach + 1)
    far2 = np.uint16((reach + 1) * (reach + 1))
    row, here = base[low, left:right], near[low, left:right]
    for c in range(here.size):
        here[c] = none if row[c] == LETHAL else far
    for r in range(low + 1, high):
        row, here, above = base[r, left:right], near[r, left:right], near[r - 1, left:right]
        for c in range(here.size):
            d = above[c]
            d = np.uint8(d + (d < far))
            here[c] = none if row[c] == LETHAL else d
    line[:] = far2  # beyond the map nothing is taken
    middle = line[reach + left : reach + right]
    for r in range(high - 1, r0 - 1, -1):
        here = near[r, left:right]
        if r < high - 1:
            below = near[r + 1, left:right]
            for c in range(here.size):
                d = below[c]
                d = np.uint8(d + (d < far))
                o = here[c]
                here[c] = d if d < o else o
        if r >= r1:
            continue
        for c in range(here.size):
            d2 = np.uint16(here[c])
            middle[c] = np.uint16(d2 * d2)
        for start in range(c0, c1, CHUNK):
            n = min(CHUNK, c1 - start)
            told, made = base[r, start : start + n], out[r, start : start + n]
            filled = (n + _LANES - 1) // _LANES * _LANES
            if _nearest(line[start : start + filled + 2 * reach], best[:filled], reach, far2):
                for c in range(n):
                    made[c] = table[best[c]]
                for c in range(n):
                    cost, o = made[c], told[c]
                    bar = free_unknown if o == UNKNOWN else o
                    made[c] = cost if cost > bar else o
            else:
                for c in range(n):
                    made[c] = told[c]


@kernel
def _nearest(line: Any, best: Any, reach: int, far2: Any) -> bool:
    """best_c = min_i i^2 + line_(c + reach +- i) for i <= reach; False, and nothing done, where all is far."""
    n = best.size
    least = far2
    for c in range(line.size):
        d2 = line[c]
        least = d2 if d2 < least else least
    if least >= far2:
        return False
    middle = line[reach : reach + n]
    for c in range(n):
        best[c] = middle[c]
    for i in range(1, reach + 1):
        i2 = np.uint16(i * i)
        west, east = line[reach - i : reach - i + n], line[reach + i : reach + i + n]
        for c in range(n):
            a, b, o = west[c], east[c], best[c]
            a = np.uint16((a if a < b else b) + i2)
            best[c] = a if a < o else o
        if i & 3 == 3:
            most = np.uint16(0)
            for c in range(n):
                o = best[c]
                most = o if o > most else most
            if most <= i2:
                break
    return True
