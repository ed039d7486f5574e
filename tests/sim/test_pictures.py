"""Pictures of a run, where there is OpenGL."""

import numpy as np
import pytest
from rovers import rover

from outrider.errors import ConfigError
from outrider.sim.engine import simulate
from outrider.sim.physics.pictures import _rectangles, pictures
from outrider.sim.places import amr_bend
from outrider.team import Schedule

pytest.importorskip("mujoco", reason="the extra `physics` is not installed")


def test_rectangles_cover_the_cells_once() -> None:
    cells = np.random.default_rng(1).random((30, 40)) < 0.4
    seen = np.zeros(cells.shape, int)
    parts = list(_rectangles(cells))
    for row, col, rows, cols in parts:
        seen[row : row + rows, col : col + cols] += 1
    assert (seen == cells).all() and len(parts) < cells.sum()


@pytest.mark.compiled
def test_the_robot_is_blue_and_moves_through_the_picture() -> None:
    ahead = Schedule(t_s=np.array([0.0]), u=np.array([[1.0, 0.0, 0.0]]))
    run = simulate(amr_bend(), [rover(agent=ahead)], 2.0, 1)
    try:
        first, last = pictures(run, np.array([0.0, 2.0]), 320, 180)
    except ConfigError as e:
        assert "nothing can be rendered here" in str(e) and "MUJOCO_GL" in str(e)
        pytest.skip("no OpenGL")
    for picture in (first, last):
        blue = (picture[..., 2].astype(int) - picture[..., 0]) > 60
        assert picture.shape == (180, 320, 3) and 20 < blue.sum() < 4000
    assert (first != last).mean() > 0.02  # the camera goes along, so the ground passes by
