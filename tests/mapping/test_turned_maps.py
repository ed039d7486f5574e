"""Maps whose frame is turned, in cells of the site: exact by quarters, else nothing taken is lost, there and back."""

from math import pi
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import Polygon, box

from outrider.data.grid import UNKNOWN, Grid
from outrider.io.map_server import read_map, write_map
from outrider.mapping.turned import levelled

SIDE = 0.5
angles = st.floats(-4.0, 4.0)


def drawn(seed: int, rows: int = 9, cols: int = 13) -> Grid:
    cells = np.random.default_rng(seed).choice([0, 0, 0, 100, 30, UNKNOWN], (rows, cols)).astype(np.uint8)
    return Grid(cells=cells, resolution=SIDE, origin=np.array([3.0, -2.0]))


def in_site(grid: Grid, heading: float) -> np.ndarray:
    """(rows, cols, 2) where the middles of a turned map's cells are."""
    rows, cols = np.indices(grid.cells.shape)
    x, y = (cols + 0.5) * grid.resolution, (rows + 0.5) * grid.resolution
    c, s = np.cos(heading), np.sin(heading)
    return grid.origin + np.stack([c * x - s * y, s * x + c * y], axis=-1)


@pytest.mark.parametrize("quarters", range(-5, 6))
def test_quarter_turns_lose_nothing(quarters: int) -> None:
    grid = drawn(1)
    level = levelled(grid, quarters * pi / 2)
    cell = level.cell_of(in_site(grid, quarters * pi / 2))
    np.testing.assert_array_equal(level.cells[cell[..., 0], cell[..., 1]], grid.cells)
    assert level.cells.size == grid.cells.size


@given(heading=angles, seed=st.integers(0, 9))
@settings(max_examples=25)
def test_a_cell_is_the_fullest_of_what_it_overlaps(heading: float, seed: int) -> None:
    """Polygons of shapely decide what overlaps; slivers are left to rounding."""
    grid, c, s = drawn(seed, 4, 5), np.cos(heading), np.sin(heading)
    level = levelled(grid, heading)
    turned = np.array([[c, s], [-s, c]])
    pieces = [
        (Polygon(grid.origin + np.array([[j, i], [j + 1, i], [j + 1, i + 1], [j, i + 1]]) * SIDE @ turned), int(v))
        for (i, j), v in np.ndenumerate(grid.cells)
    ]
    for (row, col), value in np.ndenumerate(level.cells):
        west, south = level.origin + np.array([col, row]) * SIDE
        square = box(west, south, west + SIDE, south + SIDE)
        over = [(square.intersection(p).area, v) for p, v in pieces]
        if any(0.0 < area < 1e-6 for area, _ in over):
            continue
        inside = {v for area, v in over if area > 0.0}
        if sum(area for area, _ in over) < SIDE * SIDE - 1e-6:
            inside.add(UNKNOWN)
        expected = 100 if 100 in inside else UNKNOWN if UNKNOWN in inside else max(inside)
        assert value == expected


@given(heading=angles, seed=st.integers(0, 50))
@settings(max_examples=40)
def test_there_and_back_keeps_everything_taken_and_grows_it_by_two_cells_at_the_most(heading: float, seed: int) -> None:
    grid = drawn(seed)
    there = levelled(grid, heading)
    back = levelled(there, -heading)
    p = in_site(grid, heading)
    c, s = np.cos(-heading), np.sin(-heading)
    q = there.origin + (p - there.origin) @ np.array([[c, s], [-s, c]])  # where `back` has them
    cell = back.cell_of(q)
    value = back.cells[cell[..., 0], cell[..., 1]]
    assert (value[grid.cells == 100] == 100).all()
    taken = p[grid.cells == 100]
    for where in p[(grid.cells != 100) & (value == 100)]:
        assert np.hypot(*(taken - where).T).min() < 2.0 * np.sqrt(2.0) * SIDE + SIDE


def test_a_map_file_with_a_yaw_is_read_into_the_site(tmp_path: Path) -> None:
    grid = Grid(cells=np.zeros((20, 30), np.uint8), resolution=0.1, origin=np.array([5.0, 1.0]))
    grid.cells[4, 25] = 100
    write_map(grid, tmp_path / "map.yaml", heading=0.5)
    m = read_map(tmp_path / "map.yaml")
    assert m.heading == 0.5
    np.testing.assert_array_equal(m.grid.cells, grid.cells)  # the file's own frame, exactly
    p = np.array([5.0, 1.0]) + np.array([[np.cos(0.5), -np.sin(0.5)], [np.sin(0.5), np.cos(0.5)]]) @ [2.55, 0.45]
    row, col = m.level.cell_of(p)
    assert m.level.cells[row, col] == 100
    assert 1 <= (m.level.cells == 100).sum() <= 9
    write_map(grid, tmp_path / "straight.yaml")
    assert read_map(tmp_path / "straight.yaml").level.cells.tobytes() == grid.cells.tobytes()
