"""A* against what others compute, against itself without its estimate, and against walls."""

import numpy as np
import pytest
from grids import costmap, drawn, is_legal, middle, problems
from hypothesis import given, settings
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from outrider.data.grid import INSCRIBED, LETHAL, UNKNOWN
from outrider.data.routes import PathOutcome
from outrider.errors import ConfigError, UsageError
from outrider.planning.astar import AStar
from outrider.planning.traversal import Traversal

SQRT2 = np.sqrt(2.0)
METHODS = {
    "jumps": {"jumps": True},
    "queue": {"jumps": False},
    "dijkstra": {"heuristic": False},
}


def by_scipy(cells: np.ndarray, traversal: Traversal, start: tuple[int, int], goal: tuple[int, int]) -> float:
    """The same rule as a graph, for scipy.sparse.csgraph: every step of it written out."""
    w = traversal.weights[cells]
    rows, cols = cells.shape
    n = np.arange(cells.size).reshape(cells.shape)
    tails, heads, costs = [], [], []
    for r in range(rows):
        for c in range(cols):
            for dr, dc in ((0, 1), (1, 0), (1, 1), (1, -1)):
                s, d = r + dr, c + dc
                if not (s < rows and 0 <= d < cols) or np.isinf(w[r, c] + w[s, d]):
                    continue
                if dr and dc and not traversal.corner_cutting and np.isinf(w[r, d] + w[s, c]):
                    continue
                tails.append(n[r, c])
                heads.append(n[s, d])
                costs.append(np.hypot(dr, dc) * (w[r, c] + w[s, d]) / 2)
    graph = coo_array((costs, (tails, heads)), shape=(cells.size, cells.size)).tocsr()
    return float(dijkstra(graph, directed=False, indices=n[start])[n[goal]])


@pytest.mark.parametrize("options", METHODS.values(), ids=METHODS)
@pytest.mark.parametrize(
    ("text", "cutting", "length"),
    [
        ("S..G", False, 3.0),
        ("S.\n.G", False, SQRT2),
        ("S#\n.G", False, 2.0),
        ("S#\n.G", True, SQRT2),
        ("S#\n#G", True, SQRT2),
        ("S....\n.###.\n...#.\n.##G.\n.....", False, 4 + 3 + 1),
        ("S....\n.###.\n...#.\n.##G.\n.....", True, 2 + 2 * SQRT2),
        ("....G\n.....\nS....", False, 2 * SQRT2 + 2),
        ("SG", False, 1.0),
    ],
)
def test_known_lengths(text: str, cutting: bool, length: float, options: dict) -> None:
    grid, start, goal = drawn(text)
    path = AStar(traversal=Traversal(corner_cutting=cutting), **options).plan(grid, start, goal)
    assert path.found
    assert path.length == pytest.approx(length, abs=1e-12)
    assert path.cost == pytest.approx(length, abs=1e-12)


@settings(max_examples=60)
@given(problems())
def test_cheapest_by_scipy_and_never_through_a_wall(problem: tuple) -> None:
    grid, start, goal = problem
    for cutting in (False, True):
        traversal = Traversal(weight=4.0, corner_cutting=cutting)
        best = by_scipy(grid.cells, traversal, tuple(grid.cell_of(start)), tuple(grid.cell_of(goal)))
        for options in METHODS.values():
            path = AStar(traversal=traversal, **options).plan(grid, start, goal)
            assert path.outcome is (PathOutcome.NO_WAY if np.isinf(best) else PathOutcome.FOUND)
            if path.found:
                assert path.cost == pytest.approx(best, rel=1e-9)
                assert is_legal(grid, path.points, traversal)
                assert np.array_equal(path.points[[0, -1]], [start, goal])


@pytest.mark.compiled
def test_a_hundred_weighted_grids_cost_what_scikit_image_says(rng: np.random.Generator) -> None:
    mcp = pytest.importorskip("skimage.graph").MCP_Geometric
    planner = AStar(traversal=Traversal(weight=9.0, corner_cutting=True))
    for _ in range(100):
        shape = rng.integers(20, 120, 2)
        cells = rng.integers(0, 253, shape).astype(np.uint8)
        cells[rng.random(shape) < 0.2] = LETHAL
        start, goal = rng.integers(0, shape), rng.integers(0, shape)
        cells[tuple(start)] = cells[tuple(goal)] = 0
        w = np.where(cells < INSCRIBED, 1.0 + 9.0 * cells / 252.0, -1.0)
        costs, _ = mcp(w).find_costs([tuple(start)], [tuple(goal)])
        path = planner.plan(costmap(cells), middle(start), middle(goal))
        best = costs[tuple(goal)]
        assert path.found == np.isfinite(best)
        assert not path.found or path.cost == pytest.approx(best, rel=1e-9)


@pytest.mark.compiled
@pytest.mark.parametrize("cutting", [False, True])
def test_long_looks_cost_what_queued_cells_cost(cutting: bool, rng: np.random.Generator) -> None:
    """Open maps, in which a look ends because it has gone far enough."""
    traversal = Traversal(corner_cutting=cutting)
    jumping, queueing = AStar(traversal=traversal, jumps=True), AStar(traversal=traversal, jumps=False)
    for _ in range(40):
        cells = np.zeros((300, 260), np.uint8)
        for r, c, a, b in rng.integers(0, 240, (12, 4)):
            cells[r : r + a // 8, c : c + b // 8] = LETHAL
        start, goal = (middle(p) for p in rng.permutation(np.argwhere(cells == 0))[:2])
        a, b = (p.plan(costmap(cells), start, goal) for p in (jumping, queueing))
        assert a.outcome is b.outcome
        assert a.cost == pytest.approx(b.cost, rel=1e-12)
        assert not a.found or is_legal(costmap(cells), a.points, traversal)


def test_a_workspace_remembers_nothing(rng: np.random.Generator) -> None:
    planner, sizes = AStar(), [(30, 30), (30, 30), (8, 50), (30, 30)]
    for i, shape in enumerate(sizes * 3):
        cells = (rng.random(shape) < 0.25).astype(np.uint8) * (LETHAL if i % 2 else 90)
        cells[0, 0] = cells[-1, -1] = 0
        ends = middle(np.zeros(2, int)), middle(np.array(shape) - 1)
        again, fresh = planner.plan(costmap(cells), *ends), AStar().plan(costmap(cells), *ends)
        assert (again.outcome, again.cost, again.expanded) == (fresh.outcome, fresh.cost, fresh.expanded)
        assert np.array_equal(again.points, fresh.points)


def test_the_ends_are_the_positions_given_and_the_cost_is_that_of_the_points() -> None:
    grid = costmap(np.full((4, 6), 126, np.uint8), resolution=0.5)
    start, goal = np.array([0.1, 0.2]), np.array([2.9, 1.9])
    path = AStar(traversal=Traversal(weight=2.0)).plan(grid, start, goal)
    assert np.array_equal(path.points[[0, -1]], [start, goal])
    assert path.length == pytest.approx(np.hypot(*np.diff(path.points, axis=0).T).sum())
    assert path.cost == pytest.approx(2.0 * path.length)  # every cell weighs 1 + 2 * 126 / 252


def test_the_start_is_the_goal() -> None:
    grid, start, _ = drawn("S.G")
    path = AStar().plan(grid, start, start)
    assert (path.found, path.length, path.points.tolist()) == (True, 0.0, [start.tolist()])


SEALED = """
S..#....
...#....
...#..G.
########
"""


@pytest.mark.parametrize("options", METHODS.values(), ids=METHODS)
def test_a_sealed_room_is_named_and_the_nearest_place_to_it(options: dict) -> None:
    grid, start, goal = drawn(SEALED)
    path = AStar(**options).plan(grid, start, goal)
    assert (path.outcome, path.points.shape, path.length) == (PathOutcome.NO_WAY, (0, 2), 0.0)
    assert path.suggestion is not None
    assert path.suggestion.tolist() == [2.5, 1.5]


def test_two_blocked_cells_at_a_corner_are_a_wall() -> None:
    grid, start, goal = drawn("..#G\n..##\nS...")
    assert AStar().plan(grid, start, goal).outcome is PathOutcome.NO_WAY
    assert AStar(traversal=Traversal(corner_cutting=True)).plan(grid, start, goal).outcome is PathOutcome.NO_WAY
    grid, start, goal = drawn("S#\n#G")
    assert AStar().plan(grid, start, goal).outcome is PathOutcome.NO_WAY


@pytest.mark.parametrize(
    ("start", "goal", "outcome", "suggestion"),
    [
        ((-3.0, 1.5), (2.5, 1.5), PathOutcome.START_OUTSIDE, (0.5, 1.5)),
        ((0.5, 1.5), (99.0, 2.5), PathOutcome.GOAL_OUTSIDE, (2.5, 2.5)),
        ((0.5, 1.5), (1e300, 1e300), PathOutcome.GOAL_OUTSIDE, (2.5, 3.5)),
        ((3.5, 1.5), (0.5, 0.5), PathOutcome.START_BLOCKED, (2.5, 1.5)),
        ((0.5, 1.5), (3.5, 1.5), PathOutcome.GOAL_BLOCKED, (2.5, 1.5)),
        ((3.5, 1.5), (99.0, 0.5), PathOutcome.START_BLOCKED, (2.5, 1.5)),
    ],
)
def test_ends_where_no_robot_can_be(start: tuple, goal: tuple, outcome: PathOutcome, suggestion: tuple) -> None:
    grid, _, _ = drawn(SEALED)
    path = AStar().plan(grid, np.array(start), np.array(goal))
    assert (path.outcome, path.found) == (outcome, False)
    assert path.suggestion is not None
    assert path.suggestion.tolist() == list(suggestion)


def test_nowhere_to_stand_at_all() -> None:
    grid = costmap(np.full((3, 3), LETHAL, np.uint8))
    path = AStar().plan(grid, middle(np.zeros(2, int)), middle(np.array([2, 2])))
    assert (path.outcome, path.suggestion) == (PathOutcome.START_BLOCKED, None)


@pytest.mark.parametrize("graded", [False, True])
def test_unknown_ground_is_entered_only_if_allowed(graded: bool) -> None:
    cells = np.zeros((3, 7), np.uint8)
    cells[:, 3], cells[0, 6] = UNKNOWN, 100 if graded else 0
    ends = middle(np.array([1, 0])), middle(np.array([1, 6]))
    assert AStar().plan(costmap(cells), *ends).outcome is PathOutcome.NO_WAY
    path = AStar(traversal=Traversal(weight=1.0, unknown=0)).plan(costmap(cells), *ends)
    assert (path.length, path.cost) == (6.0, 6.0)
    path = AStar(traversal=Traversal(weight=1.0, unknown=252)).plan(costmap(cells), *ends)
    assert (path.length, path.cost) == (6.0, 7.0)
    assert AStar().plan(costmap(cells), ends[0], middle(np.array([1, 3]))).outcome is PathOutcome.GOAL_BLOCKED


def test_keeps_away_from_what_is_dear() -> None:
    cells = np.zeros((7, 9), np.uint8)
    cells[2:5, 3:6] = 250
    path = AStar(traversal=Traversal(weight=5.0)).plan(costmap(cells), middle((3, 0)), middle((3, 8)))
    assert not (grid_cost := cells[tuple(costmap(cells).cell_of(path.points).T)]).any(), grid_cost
    straight = AStar(traversal=Traversal(weight=0.0)).plan(costmap(cells), middle((3, 0)), middle((3, 8)))
    assert straight.length == 8.0


@pytest.mark.compiled  # the clock is looked at every 20 000 cells
@pytest.mark.parametrize("graded", [False, True])
def test_out_of_time_is_an_outcome_with_how_far_it_came(graded: bool) -> None:
    side = 400
    cells = np.zeros((side, side), np.uint8)
    cells[:-1, ::4] = 0 if not graded else 7
    cells[1:-2:2, 1:-1] = LETHAL  # a comb to search
    ends = middle(np.zeros(2, int)), middle(np.array([side - 1, side - 1]))
    path = AStar(jumps=False).plan(costmap(cells), *ends, budget_s=1e-9)
    assert path.outcome is PathOutcome.OUT_OF_TIME
    assert path.points.size == 0
    assert path.suggestion is not None
    assert cells[tuple(costmap(cells).cell_of(path.suggestion))] < INSCRIBED


@pytest.mark.parametrize(
    ("start", "goal", "budget_s", "said"),
    [
        ((np.nan, 0.0), (1.0, 1.0), 1.0, "plan, start: .*nan.* is no position"),
        ((0.0, 0.0), (np.inf, 1.0), 1.0, "plan, goal: .*inf.* is no position"),
        ((0.0, 0.0), (1.0, 1.0, 1.0), 1.0, "plan, goal"),
        ((0.0, 0.0), (1.0, 1.0), np.nan, "budget of nan"),
        ((0.0, 0.0), (1.0, 1.0), 0.0, "budget of 0"),
    ],
)
def test_what_cannot_be_asked(start: tuple, goal: tuple, budget_s: float, said: str) -> None:
    grid, _, _ = drawn(SEALED)
    with pytest.raises(UsageError, match=said):
        AStar().plan(grid, np.array(start), np.array(goal), budget_s=budget_s)


@pytest.mark.parametrize(
    "wrong", [{"weight": -1.0}, {"weight": np.nan}, {"weight": 1e9}, {"unknown": 253}, {"unknown": -1}]
)
def test_what_is_no_rule(wrong: dict) -> None:
    with pytest.raises(ConfigError, match="traversal"):
        Traversal(**wrong)


@pytest.mark.compiled
@pytest.mark.parametrize("options", [{"heuristic": False}, {"jumps": True}], ids=["dijkstra", "jumps"])
def test_a_queue_grows_when_it_must(options: dict, rng: np.random.Generator) -> None:
    cells = np.zeros((1500, 1500), np.uint8)
    if "jumps" in options:
        cells[rng.random(cells.shape) < 0.2] = LETHAL
        cells[0, 0] = cells[-1, -1] = 0
    planner, grid, ends = AStar(**options), costmap(cells), (middle((0, 0)), middle((1499, 1499)))
    path = planner.plan(grid, *ends)
    assert planner.workspace.queue.size > planner.workspace.counts.size * 1024
    assert path.cost == pytest.approx(AStar(jumps=False).plan(grid, *ends).cost, rel=1e-12)
