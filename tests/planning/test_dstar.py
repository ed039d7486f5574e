"""D* Lite against A* while the map changes and the robot moves."""

import numpy as np
import pytest
from grids import costmap, drawn, is_legal, middle
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.data.grid import LETHAL
from outrider.data.routes import PathOutcome
from outrider.planning.astar import AStar
from outrider.planning.dstar import DStarLite
from outrider.planning.traversal import Traversal


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1), st.booleans(), st.integers(4, 18))
def test_as_cheap_as_a_star_after_every_change(seed: int, cutting: bool, side: int) -> None:
    rng = np.random.default_rng(seed)
    traversal = Traversal(weight=3.0, corner_cutting=cutting)
    cells = rng.integers(0, 253, (side, side)).astype(np.uint8) * np.uint8(seed % 2)
    cells[rng.random(cells.shape) < 0.25] = LETHAL
    incremental, afresh = DStarLite(traversal=traversal), AStar(traversal=traversal)
    goal = rng.integers(0, side, 2)
    here = rng.integers(0, side, 2)
    for _ in range(6):
        cells = cells.copy()
        for r, c in rng.integers(0, side, (5, 2)):
            cells[r, c] = rng.choice([0, 100, LETHAL])
        cells[tuple(here)] = cells[tuple(goal)] = 0
        grid = costmap(cells)
        a, b = (p.plan(grid, middle(here), middle(goal)) for p in (incremental, afresh))
        assert a.outcome is b.outcome
        assert a.cost == pytest.approx(b.cost, rel=1e-9)
        if a.found:
            assert is_legal(grid, a.points, traversal)
            here = grid.cell_of(a.points[min(2, len(a.points) - 1)])


@pytest.mark.compiled
def test_a_small_change_costs_little(rng: np.random.Generator) -> None:
    cells = np.zeros((200, 200), np.uint8)
    cells[rng.random(cells.shape) < 0.2] = LETHAL
    cells[0, 0] = cells[199, 199] = 0
    planner, ends = DStarLite(), (middle((0, 0)), middle((199, 199)))
    first = planner.plan(costmap(cells), *ends)
    again = planner.plan(costmap(cells), *ends)
    assert (again.expanded, again.cost) == (0, first.cost)
    row, col = costmap(cells).cell_of(first.points[5])  # near the robot
    changed = cells.copy()
    changed[row, col] = LETHAL
    repaired = planner.plan(costmap(changed), *ends)
    assert repaired.cost == pytest.approx(AStar().plan(costmap(changed), *ends).cost)
    assert 0 < repaired.expanded < 0.2 * first.expanded


def test_named_failures_and_another_goal() -> None:
    grid, start, goal = drawn("S.#G\n..#.\n....")
    planner = DStarLite()
    assert planner.plan(grid, start, goal).length == pytest.approx(AStar().plan(grid, start, goal).length)
    closed = costmap(grid.cells.copy())
    closed.cells[0, 2] = LETHAL
    path = planner.plan(closed, start, goal)
    assert path.outcome is PathOutcome.NO_WAY
    assert path.suggestion is not None
    assert planner.plan(closed, start, middle((0, 1))).found
    assert planner.plan(closed, start, middle((0, 2))).outcome is PathOutcome.GOAL_BLOCKED


@pytest.mark.compiled
def test_out_of_time_goes_on_with_the_next_plan() -> None:
    planner, grid, ends = DStarLite(), costmap(np.full((300, 300), 40, np.uint8)), (middle((0, 0)), middle((299, 150)))
    grid.cells[150, 1:] = LETHAL
    outcomes = []
    for _ in range(100):
        path = planner.plan(grid, *ends, budget_s=1e-9)
        outcomes.append(path.outcome)
        if path.found:
            break
    assert outcomes[0] is PathOutcome.OUT_OF_TIME
    assert path.cost == pytest.approx(AStar().plan(grid, *ends).cost)
