"""A path is kept unless it cannot be followed or another is clearly better."""

import numpy as np
import pytest
from grids import costmap

from outrider.data.grid import LETHAL, Costmap
from outrider.data.routes import Path, PathOutcome
from outrider.errors import ConfigError
from outrider.planning.astar import AStar
from outrider.planning.replan import Choice, Replanning, remaining
from outrider.planning.traversal import Traversal

FREE = np.zeros((21, 41), np.uint8)
START, GOAL = np.array([2.5, 10.5]), np.array([38.5, 10.5])
RULES, POLICY = Traversal(), Replanning()
NONE = Path(outcome=PathOutcome.NO_WAY)


def wall(grid: np.ndarray, col: int, gap: slice) -> Costmap:
    cells = grid.copy()
    cells[:, col] = LETHAL
    cells[gap, col] = 0
    return costmap(cells)


def planned(grid: Costmap, start: np.ndarray = START) -> Path:
    return AStar().plan(grid, start, GOAL)


def test_what_is_left_of_a_path() -> None:
    rest = remaining(costmap(FREE), RULES, planned(costmap(FREE)), np.array([20.0, 11.5]))
    assert (rest.cost, rest.offset, rest.blocked_at) == (pytest.approx(18.5), pytest.approx(1.0), np.inf)


def test_a_path_that_is_as_good_is_kept() -> None:
    """Two gaps, and the better one changes by less than the hysteresis with every look: no flipping."""
    grid = wall(FREE, 20, slice(0, 0))
    grid.cells[3, 20] = grid.cells[17, 20] = 0
    path, choices = planned(grid), []
    for k in range(20):
        here = START + np.array([0.5 * k, 0.0])
        grid.cells[3 if k % 2 else 17, 10:30][grid.cells[3 if k % 2 else 17, 10:30] < LETHAL] = 10
        grid.cells[17 if k % 2 else 3, 10:30][grid.cells[17 if k % 2 else 3, 10:30] < LETHAL] = 0
        here = path.points[np.hypot(*(path.points - here).T).argmin()]
        choices.append(POLICY.choose(grid, RULES, path, planned(grid, here), here))
    assert set(choices) == {Choice.KEPT}


def test_blocked_ahead_and_blocked_behind() -> None:
    path, grid = planned(costmap(FREE)), wall(FREE, 20, slice(0, 2))
    before, after = np.array([10.5, 10.5]), np.array([25.5, 10.5])
    assert POLICY.needs_plan(grid, RULES, path, before)
    assert not POLICY.needs_plan(grid, RULES, path, after)
    assert POLICY.choose(grid, RULES, path, planned(grid, before), before) is Choice.BLOCKED
    assert POLICY.choose(grid, RULES, path, NONE, before) is Choice.STOP
    assert POLICY.choose(grid, RULES, path, NONE, after) is Choice.KEPT
    assert not Replanning(ahead=5.0).needs_plan(grid, RULES, path, before)


def test_clearly_better() -> None:
    closed, opened = wall(FREE, 20, slice(0, 1)), costmap(FREE)
    path = planned(closed)
    assert POLICY.choose(opened, RULES, path, planned(opened), START) is Choice.BETTER
    assert Replanning(better=0.9).choose(opened, RULES, path, planned(opened), START) is Choice.KEPT


def test_first_left_and_nothing() -> None:
    grid = costmap(FREE)
    path, aside = planned(grid), np.array([20.5, 13.5])
    assert POLICY.choose(grid, RULES, NONE, path, START) is Choice.FIRST
    assert POLICY.choose(grid, RULES, NONE, NONE, START) is Choice.STOP
    assert POLICY.choose(grid, RULES, path, planned(grid, aside), aside) is Choice.LEFT
    assert Choice.LEFT.switches
    assert not Choice.KEPT.switches


@pytest.mark.parametrize("wrong", [{"better": 1.0}, {"least": -1.0}, {"stray": 0.0}, {"ahead": np.nan}])
def test_what_is_no_policy(wrong: dict) -> None:
    with pytest.raises(ConfigError, match="replanning"):
        Replanning(**wrong)
