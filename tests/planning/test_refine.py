"""Lines of sight against shapely, and what shortening and smoothing must not do."""

import numpy as np
import pytest
from grids import costmap, drawn, middle, problems
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import LineString, box

from outrider.data.grid import INSCRIBED, LETHAL
from outrider.errors import ConfigError
from outrider.planning.astar import AStar
from outrider.planning.refine import Refined, cost_along, resample, shorten, smooth
from outrider.planning.traversal import Traversal


def length(points: np.ndarray) -> float:
    return float(np.hypot(*np.diff(points, axis=0).T).sum())


def taken_by(grid, points: np.ndarray) -> float:
    """Length of a line inside taken cells."""
    line = LineString(points)
    cells = np.argwhere(grid.cells >= INSCRIBED)
    return sum(line.intersection(box(c, r, c + 1, r + 1)).length for r, c in cells)


coordinates = st.tuples(*[st.floats(0.01, 7.99)] * 4)


@settings(max_examples=150)
@given(coordinates, st.integers(0, 2**32 - 1))
def test_cost_of_a_line_is_its_lengths_in_the_cells_times_their_weights(ends: tuple, seed: int) -> None:
    rng = np.random.default_rng(seed)
    grid, traversal = costmap(rng.integers(0, 253, (8, 8)).astype(np.uint8)), Traversal(weight=5.0)
    line, w = LineString([ends[:2], ends[2:]]), traversal.weights[grid.cells]
    parts = [line.intersection(box(c, r, c + 1, r + 1)).length * w[r, c] for r in range(8) for c in range(8)]
    along_edge = sum(parts) > line.length * w.max() * (1 + 1e-9)  # counted for the cells of both sides
    if not along_edge and not {x % 1 for x in ends} & {0.0}:
        cost = cost_along(grid, traversal, np.reshape(ends, (2, 2)))
        assert cost == pytest.approx(sum(parts), rel=1e-6, abs=1e-9)


@pytest.mark.parametrize(
    ("text", "seen", "seen_cutting"), [("S.\n.G", 1, 1), ("S#\n.G", 0, 1), ("S#\n#G", 0, 1), ("S#G", 0, 0)]
)
def test_sight_past_corners(text: str, seen: bool, seen_cutting: bool) -> None:
    grid, start, goal = drawn(text)
    for cutting, expected in ((False, seen), (True, seen_cutting)):
        cost = cost_along(grid, Traversal(corner_cutting=cutting), np.array([start, goal]))
        assert np.isfinite(cost) == expected


@settings(max_examples=60)
@given(problems())
def test_never_longer_nor_dearer_nor_through_anything(problem: tuple) -> None:
    grid, start, goal = problem
    traversal = Traversal(weight=4.0)
    path = AStar(traversal=traversal).plan(grid, start, goal)
    if len(path.points) < 2:
        return
    assert cost_along(grid, traversal, path.points) == pytest.approx(path.cost, rel=1e-9)
    short = shorten(grid, traversal, path.points)
    fine = resample(short, 0.4)
    soft = smooth(grid, traversal, fine)
    before = path.points
    for after in (short, fine, soft):
        assert length(after) <= length(before) * (1 + 1e-9)
        assert cost_along(grid, traversal, after) <= cost_along(grid, traversal, before) * (1 + 1e-9)
        assert taken_by(grid, after) < 1e-6
        assert np.array_equal(after[[0, -1]], [start, goal])
        before = after


def test_an_open_field_is_crossed_in_a_straight_line() -> None:
    grid = costmap(np.zeros((40, 60), np.uint8), resolution=0.5)
    start, goal = np.array([0.3, 0.2]), np.array([28.7, 11.1])
    path = Refined(planner=AStar(), spacing=0.25).plan(grid, start, goal)
    assert path.length == pytest.approx(np.hypot(*(goal - start)), rel=1e-12)
    assert np.hypot(*np.diff(path.points, axis=0).T).max() <= 0.25 + 1e-9
    assert path.cost == pytest.approx(path.length)


def test_corners_are_rounded() -> None:
    row, col = np.indices((40, 40))
    away = np.hypot(np.maximum(row - 29, 0), np.maximum(np.abs(col - 19.5) - 5, 0))  # cells from a wall
    cells = np.where(away == 0, LETHAL, 252 * np.exp(-0.3 * away)).astype(np.uint8)
    grid, ends = costmap(cells, 0.1), (np.array([0.55, 0.55]), np.array([3.55, 0.55]))

    def sharpest(points: np.ndarray) -> float:
        step = np.diff(points, axis=0)
        turn = np.diff(np.unwrap(np.arctan2(step[:, 1], step[:, 0])))
        return float(np.abs(turn).max())

    hard, soft = (Refined(planner=AStar(), spacing=0.2, rounds=n).plan(grid, *ends) for n in (0, 200))
    assert sharpest(soft.points) < 0.7 * sharpest(hard.points)
    assert soft.cost < hard.cost
    assert taken_by(grid, soft.points / 0.1) < 1e-6


def test_dear_ground_is_not_crossed_for_a_shorter_line() -> None:
    cells = np.zeros((21, 31), np.uint8)
    cells[4:17, 10:20] = 252
    grid, traversal = costmap(cells), Traversal(weight=9.0)
    path = Refined(planner=AStar(traversal=traversal), traversal=traversal).plan(
        grid, middle((10, 1)), middle((10, 29))
    )
    assert path.cost < 35.0  # straight through: 28 + 9 * 10
    assert path.length > 28.5


def test_resampled_points_lie_on_the_line() -> None:
    line = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.25]])
    assert resample(line, 0.3).tolist() == [[0.0, 0.0], [0.25, 0.0], [0.5, 0.0], [0.75, 0.0], [1.0, 0.0], [1.0, 0.25]]


def test_what_cannot_be_found_stays_as_it_is() -> None:
    grid, start, goal = drawn("S#G")
    path = Refined(planner=AStar()).plan(grid, start, goal)
    assert (path.found, path.points.shape) == (False, (0, 2))
    assert path.suggestion is not None
    same = Refined(planner=AStar()).plan(grid, start, start)
    assert same.found
    assert len(same.points) == 1


@pytest.mark.parametrize("wrong", [{"spacing": 0.0}, {"spacing": np.nan}, {"rounds": -1}])
def test_what_is_no_refinement(wrong: dict) -> None:
    with pytest.raises(ConfigError, match="refined"):
        Refined(planner=AStar(), **wrong)
