"""The occupancy grid's conventions."""

import numpy as np
import pytest

from outrider.data import Grid
from outrider.errors import DataError

CELLS = np.array([[0, 100, 255], [64, 65, 0]], dtype=np.uint8)


def test_rows_run_north_and_columns_east_from_the_outer_corner() -> None:
    grid = Grid(cells=CELLS, resolution=0.5, origin=np.array([10.0, -2.0]))
    assert grid.occupied.tolist() == [[False, True, False], [False, True, False]]
    assert grid.cell_of(np.array([10.0, -2.0])).tolist() == [0, 0]
    assert grid.cell_of(np.array([[11.4, -1.6], [10.6, -1.4], [9.9, 0.1]])).tolist() == [[0, 2], [1, 1], [4, -1]]
    assert grid.centre_of(np.array([1, 0])).tolist() == [10.25, -1.25]
    every = np.argwhere(np.ones_like(CELLS, dtype=bool))
    assert (grid.cell_of(grid.centre_of(every)) == every).all()


@pytest.mark.parametrize(
    "wrong",
    [
        {"cells": CELLS.astype(np.int8)},
        {"cells": CELLS[0]},
        {"cells": CELLS[:0]},
        {"resolution": 0.0},
        {"resolution": np.nan},
        {"origin": np.zeros(3)},
        {"origin": np.array([0.0, np.inf])},
    ],
)
def test_what_is_no_grid(wrong: dict) -> None:
    with pytest.raises(DataError, match="grid"):
        Grid(**({"cells": CELLS, "resolution": 0.5, "origin": np.zeros(2)} | wrong))
