"""What a lidar says of the cells around it: endpoints are taken, what the beams passed through is free."""

from dataclasses import dataclass
from math import cos, floor, inf, sin
from typing import Any, Final, TypeAlias, final

import numpy as np

from outrider._kernel import kernel
from outrider.data.grid import FREE, LETHAL
from outrider.data.scan import Scan
from outrider.errors import ConfigError
from outrider.typing import Floats, Ints

Box: TypeAlias = tuple[int, int, int, int]
"""First and end row, first and end column."""

HIT: Final = 3  # times that a beam must pass for each that ended in a cell, to make up for it
TWICE: Final = 6  # hits that are of no account
MOST: Final = 30  # hits that are remembered
NEVER: Final = 255  # no beam has passed
_DONE: Final = 64  # on top of a count: it is that of this scan


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Marking:
    """How far a lidar's beams are trusted.

    mark : endpoints up to here are taken [m];  clear : beams clear up to here [m], at most to what they hit.

    Raises ConfigError unless mark < clear: between the two, what was marked and has gone would stay for ever.
    """

    mark: float = 5.0
    clear: float = 6.0

    def __post_init__(self) -> None:
        if not 0.0 < self.mark < self.clear < inf:
            what = f"marks up to {self.mark:g} m and clears up to {self.clear:g} m"
            raise ConfigError(what, where="marking", fix="clearing must reach farther than marking")


def observe(cells: Any, resolution: float, origin: Floats, scan: Scan, marking: Marking, held: Any = None) -> Box:
    """Enter a scan into (rows, cols) uint8 cells, in place: `FREE` along the beams, then `LETHAL` where they end.

    Every cell that a beam touches before the one it ends in is free: nothing is cleared at the hit or beyond. A beam
    without a return clears as far as the lidar sees; one that tells nothing (`Scan.usable`) does nothing. What one beam
    hit no other beam of the scan clears. Gives the box of cells that may have changed.
    held : (rows, cols) uint8, how often cells were hit lately (see `remember`), None where nobody asks.
    """
    x, y, heading = scan.pose.tolist()
    ends = np.empty(len(scan.ranges), np.int64)
    box = enter_scan(
        cells,
        float(origin[0]),
        float(origin[1]),
        resolution,
        x,
        y,
        heading,
        scan.bearings,
        scan.ranges,
        scan.blind,
        scan.reach,
        marking.mark,
        marking.clear,
        ends,
    )
    if held is not None:
        remember(cells, held, *box, ends)
    return box


@kernel
def enter_scan(
    cells: Any,
    west: float,
    south: float,
    resolution: float,
    x: float,
    y: float,
    heading: float,
    bearings: Floats,
    ranges: Floats,
    blind: float,
    reach: float,
    mark: float,
    clear: float,
    ends: Ints,
) -> tuple[int, int, int, int]:
    """`observe`, on numbers; lengths in m, angles in rad.  ends (n,) <- the flat index of the cell hit, -1 for none."""
    rows, cols = cells.shape
    u, v = (x - west) / resolution, (y - south) / resolution  # in cells from here on
    reach, mark, clear = reach / resolution, mark / resolution, min(clear, reach) / resolution
    low_u, high_u, low_v, high_v = u, u, v, v
    for i in range(ranges.size):
        r = ranges[i]
        if r >= blind:
            r = min(r / resolution, clear)
            du, dv = cos(heading + bearings[i]), sin(heading + bearings[i])
            trace(cells, u, v, du, dv, r, FREE, False)
            low_u, high_u = min(low_u, u + r * du), max(high_u, u + r * du)
            low_v, high_v = min(low_v, v + r * dv), max(high_v, v + r * dv)
    for i in range(ranges.size):
        r, ends[i] = ranges[i] / resolution, -1
        if ranges[i] >= blind and r < reach and r <= mark:
            col = floor(u + r * cos(heading + bearings[i]))
            row = floor(v + r * sin(heading + bearings[i]))
            if 0 <= row < rows and 0 <= col < cols:
                cells[row, col] = LETHAL
                ends[i] = row * cols + col
    r0, r1 = max(floor(low_v), 0), min(floor(high_v) + 1, rows)
    c0, c1 = max(floor(low_u), 0), min(floor(high_u) + 1, cols)
    return r0, max(r0, r1), c0, max(c0, c1)


@kernel
def remember(cells: Any, held: Any, r0: int, r1: int, c0: int, c1: int, ends: Ints) -> None:
    """How often cells are hit: what flickers at the edge of a wall is not free.

    In the box, each free cell of `held` counts down, from `NEVER` to 0; each that was hit (`ends`) counts up by `HIT`,
    unless no beam has passed it yet.
    """
    none, one, never, free = np.uint8(0), np.uint8(1), np.uint8(NEVER), np.uint8(FREE)
    for r in range(r0, r1):
        told, row = cells[r, c0:c1], held[r, c0:c1]
        for c in range(row.size):
            count = row[c]
            less = np.uint8(count - one) if (count != none) & (count != never) else none
            row[c] = less if told[c] == free else count
    flat = held.reshape(held.size)
    for i in range(ends.size):
        if ends[i] >= 0 and flat[ends[i]] < _DONE:  # once, however many beams
            flat[ends[i]] = min(flat[ends[i]] + HIT, MOST) + _DONE
    for i in range(ends.size):
        if ends[i] >= 0 and _DONE <= flat[ends[i]] < NEVER:
            flat[ends[i]] -= _DONE


@kernel
def look_up(cells: Any, west: float, south: float, resolution: float, points: Floats, beyond: int, out: Any) -> None:
    """out (n,) <- the cells in which the points (n, 2) m lie."""
    rows, cols = cells.shape
    for i in range(out.size):
        u, v = floor((points[i, 0] - west) / resolution), floor((points[i, 1] - south) / resolution)
        out[i] = cells[v, u] if 0 <= u < cols and 0 <= v < rows else beyond


@kernel
def trace(cells: Any, u: float, v: float, du: float, dv: float, length: float, value: int, to_the_end: bool) -> None:
    """Set the cells that a beam from (u, v) [cells] along the unit vector (du, dv) touches; the last only on demand."""
    rows, cols = cells.shape
    flat = cells.reshape(rows * cols)
    if abs(du) >= abs(dv):
        _trace(flat, cols, 1, rows, cols, u, v, du, dv, length, value, to_the_end)
    else:
        _trace(flat, rows, cols, cols, 1, v, u, dv, du, length, value, to_the_end)


@kernel
def _trace(
    flat: Any,
    n: int,
    n_by: int,
    m: int,
    m_by: int,
    a: float,
    b: float,
    da: float,
    db: float,
    length: float,
    value: int,
    to_the_end: bool,
) -> None:
    """`trace` along the axis a, of n cells that are n_by apart, that it goes along more than along b.

    From one cell of a to the next, the beam is in one or in two neighbours along b: no choice is left to rounding.
    """
    t, end = -a / da, (n - a) / da
    t, end = max(0.0, min(t, end)), min(length, max(t, end))
    if db != 0.0:
        t, end = max(t, min(-b / db, (m - b) / db)), min(end, max(-b / db, (m - b) / db))
    elif not 0.0 <= b < m:
        return
    if not t < end:
        return
    by = 1 if da > 0.0 else -1
    slope = db / da
    i, i_last = min(max(floor(a + t * da), 0), n - 1), min(max(floor(a + end * da), 0), n - 1)
    j, j_last = min(max(floor(b + t * db), 0), m - 1), min(max(floor(b + end * db), 0), m - 1)
    i_hit, j_hit = floor(a + length * da), floor(b + length * db)
    leaves = b + (i + (da > 0.0) - a) * slope
    away, side = by * n_by, by * slope
    at = i * n_by
    while i != i_last:
        k = min(max(int(leaves), 0), m - 1)
        flat[at + j * m_by] = value
        flat[at + k * m_by] = value
        i, j, at, leaves = i + by, k, at + away, leaves + side
    if to_the_end or i != i_hit or j != j_hit:
        flat[i * n_by + j * m_by] = value
    if to_the_end or i != i_hit or j_last != j_hit:
        flat[i * n_by + j_last * m_by] = value
