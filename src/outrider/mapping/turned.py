"""Cells drawn in a frame that is turned, in cells of the site's frame."""

from math import cos, pi, sin
from typing import Final

import numpy as np

from outrider.data.grid import OCCUPIED, UNKNOWN, Grid
from outrider.typing import Floats

QUARTER: Final = 0.5 * pi
EXACT: Final = 1e-9  # quarters


def levelled(grid: Grid, heading: float) -> Grid:
    """The same ground in cells along the site's axes.

    grid : its columns point to `heading` [rad], counter-clockwise from the site's x axis, about its corner.

    Quarter turns are exact. Otherwise a cell is taken if it overlaps anything taken, else unknown if it overlaps
    anything unknown or lies partly beyond the map, else the fullest of what it overlaps: nothing taken is lost, and
    what is taken grows by less than the diagonal of a cell.
    """
    quarters = heading / QUARTER
    if abs(quarters - round(quarters)) < EXACT:
        k = round(quarters) % 4
        cells = np.ascontiguousarray(np.rot90(grid.cells[::-1], k)[::-1])
        return Grid(cells=cells, resolution=grid.resolution, origin=_corners(grid, k * QUARTER).min(axis=0))
    box = _corners(grid, heading)
    origin, side = box.min(axis=0), grid.resolution
    cols, rows = np.ceil((box.max(axis=0) - origin) / side - EXACT).astype(int).tolist()
    c, s = cos(heading), sin(heading)
    middle = origin + (np.stack(np.meshgrid(np.arange(cols), np.arange(rows)), axis=-1) + 0.5) * side
    place = (middle - grid.origin) @ np.array([[c, -s], [s, c]]) / side  # column and row, in cells of the map
    return Grid(cells=_fullest(grid, place, c, s), resolution=side, origin=origin)


def _fullest(grid: Grid, place: Floats, c: float, s: float) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
    """(rows, cols) of what cells with their middles at `place` (rows, cols, 2) overlap: two squares do unless one of
    their four axes lies between them."""
    rank = np.arange(256)
    rank[OCCUPIED:UNKNOWN] += 256
    drawn = np.pad(rank[grid.cells], 1, constant_values=UNKNOWN)
    near, reach = np.floor(place).astype(np.int64), 0.5 * (1.0 + abs(c) + abs(s))
    out = np.zeros(place.shape[:2], np.int64)
    for by_row in (-1, 0, 1):
        for by_col in (-1, 0, 1):
            cell = near + np.array([by_col, by_row])
            d = cell + 0.5 - place
            turned = d @ np.array([[c, -s], [s, c]]).T
            touches = (np.maximum(np.abs(d), np.abs(turned)).max(axis=-1)) < reach
            row = np.clip(cell[..., 1] + 1, 0, drawn.shape[0] - 1)
            col = np.clip(cell[..., 0] + 1, 0, drawn.shape[1] - 1)
            out = np.where(touches, np.maximum(out, drawn[row, col]), out)
    return (out & 255).astype(np.uint8)


def _corners(grid: Grid, heading: float) -> Floats:
    """(4, 2) m, site frame."""
    rows, cols = grid.cells.shape
    c, s = np.cos(heading), np.sin(heading)
    box = np.array([[0.0, 0.0], [cols, 0.0], [cols, rows], [0.0, rows]]) * grid.resolution
    return grid.origin + box @ np.array([[c, s], [-s, c]])
