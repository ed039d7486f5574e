"""RRT* of OMPL, where it is installed."""

import importlib.util
import sys

import numpy as np
import pytest
from grids import costmap, drawn, middle

from outrider.data.grid import LETHAL
from outrider.data.routes import PathOutcome
from outrider.errors import UsageError
from outrider.planning.astar import AStar
from outrider.planning.refine import cost_along
from outrider.planning.sampling import SamplingPlanner
from outrider.planning.traversal import Traversal

needs_ompl = pytest.mark.skipif(not importlib.util.find_spec("ompl"), reason="needs ompl: pip install 'outrider[ompl]'")


@needs_ompl
@pytest.mark.compiled
def test_around_a_wall() -> None:
    cells = np.zeros((20, 30), np.uint8)
    cells[:15, 10:14] = LETHAL
    grid, ends = costmap(cells), (middle((3, 3)), middle((3, 25)))
    path, best = SamplingPlanner(seconds=3.0).plan(grid, *ends), AStar().plan(grid, *ends)
    assert path.found
    assert 0.9 * best.length < path.length < 1.5 * best.length
    assert cost_along(grid, Traversal(), path.points) < np.inf
    assert np.array_equal(path.points[[0, -1]], ends)


@needs_ompl
def test_no_way_is_out_of_time_and_blocked_ends_are_named() -> None:
    grid, start, goal = drawn("S#G")
    assert SamplingPlanner(seconds=0.05).plan(grid, start, goal).outcome is PathOutcome.OUT_OF_TIME
    assert SamplingPlanner().plan(grid, start, middle((0, 1))).outcome is PathOutcome.GOAL_BLOCKED


def test_absent_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("ompl", "ompl.util"):
        monkeypatch.setitem(sys.modules, name, None)
    grid, start, goal = drawn("S.G")
    with pytest.raises(UsageError, match="pip install"):
        SamplingPlanner().plan(grid, start, goal)
