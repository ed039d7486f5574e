"""What a lidar says of the cells around it: endpoints are taken, what the beams passed through is free."""

from dataclasses import dataclass
from math import cos, floor, inf, sin
from typing import Any, TypeAlias, final

from outrider._kernel import kernel
from outrider.data.grid import FREE, LETHAL
from outrider.data.scan import Scan
from outrider.errors import ConfigError
from outrider.typing import Floats

Box: TypeAlias = tuple[int, int, int, int]
"""First and end row, first and end column."""


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


def observe(cells: Any, resolution: float, origin: Floats, scan: Scan, marking: Marking) -> Box:
    """Enter a scan into (rows, cols) uint8 cells, in place: `FREE` along the beams, then `LETHAL` where they end.

    Every cell that a beam touches before the one it ends in is free: nothing is cleared at the hit or beyond. A beam
    without a return clears as far as the lidar sees; one that tells nothing (`Scan.usable`) does nothing. What one beam
    hit no other beam of the scan clears. Gives the box of cells that may have changed.
    """
    x, y, heading = scan.pose.tolist()
    return enter_scan(
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
    )


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
) -> tuple[int, int, int, int]:
    """`observe`, on numbers; lengths in m, angles in rad."""
    rows, cols = cells.shape
    u, v = (x - west) / resolution, (y - south) / resolution  # in cells from here on
    reach, mark, clear = reach / resolution, mark / resolution, min(clear, reach) / resolution
    low_u, high_u, low_v, high_v = u, u, v, v
    for i in range(ranges.size):
        r = ranges[i]
        if r >= blind:
            r = min(r / resolution, clear)
            du, dv = cos(heading + bearings[i]), sin(heading + bearings[i])
            clear_beam(cells, u, v, du, dv, r)
            low_u, high_u = min(low_u, u + r * du), max(high_u, u + r * du)
            low_v, high_v = min(low_v, v + r * dv), max(high_v, v + r * dv)
    for i in range(ranges.size):
        r = ranges[i] / resolution
        if ranges[i] >= blind and r < reach and r <= mark:
            col = floor(u + r * cos(heading + bearings[i]))
            row = floor(v + r * sin(heading + bearings[i]))
            if 0 <= row < rows and 0 <= col < cols:
                cells[row, col] = LETHAL
    r0, r1 = max(floor(low_v), 0), min(floor(high_v) + 1, rows)
    c0, c1 = max(floor(low_u), 0), min(floor(high_u) + 1, cols)
    return r0, max(r0, r1), c0, max(c0, c1)


@kernel
def clear_beam(cells: Any, u: float, v: float, du: float, dv: float, length: float) -> None:
    """Free every cell that a beam from (u, v) [cells] along the unit vector (du, dv) touches, but the one it ends in.

    From one cell to the next across whichever boundary comes first (Amanatides and Woo 1987).
    """
    rows, cols = cells.shape
    start, end = 0.0, length
    if du != 0.0:
        a, b = -u / du, (cols - u) / du
        start, end = max(start, min(a, b)), min(end, max(a, b))
    elif not 0.0 <= u < cols:
        return
    if dv != 0.0:
        a, b = -v / dv, (rows - v) / dv
        start, end = max(start, min(a, b)), min(end, max(a, b))
    elif not 0.0 <= v < rows:
        return
    if not start < end:
        return
    last_col, last_row = floor(u + length * du), floor(v + length * dv)
    col = min(max(floor(u + start * du), 0), cols - 1)
    row = min(max(floor(v + start * dv), 0), rows - 1)
    t_col, every_col, by_col, t_row, every_row, by_row = inf, inf, 1, inf, inf, 1
    if du != 0.0:
        by_col = 1 if du > 0.0 else -1
        t_col, every_col = (col + (du > 0.0) - u) / du, 1.0 / abs(du)
    if dv != 0.0:
        by_row = 1 if dv > 0.0 else -1
        t_row, every_row = (row + (dv > 0.0) - v) / dv, 1.0 / abs(dv)
    t = start
    while t < end and not (col == last_col and row == last_row):
        cells[row, col] = FREE
        if t_col < t_row:
            t, t_col, col = t_col, t_col + every_col, col + by_col
        else:
            t, t_row, row = t_row, t_row + every_row, row + by_row
        if col < 0 or col >= cols or row < 0 or row >= rows:
            return
