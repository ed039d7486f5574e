"""Ways through one-way zones: against Dijkstra's search of networkx over a directed graph of cells."""

from itertools import product

import networkx as nx
import numpy as np
import pytest
from grids import costmap
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.data.grid import LETHAL, Costmap, Grid
from outrider.data.site import Shape, ShapeKind
from outrider.errors import DataError
from outrider.mapping.zones import Zones
from outrider.planning.astar import AStar
from outrider.planning.reach import Reach
from outrider.planning.refine import Refined, lawful
from outrider.planning.traversal import Traversal

STEPS = [(0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1)]


def zoned(cells: np.ndarray, *lanes: tuple[tuple[int, int, int, int], float]) -> Costmap:
    """lanes : west, south, east, north [m] of a zone, and its heading [rad]."""
    shapes = tuple(
        Shape(
            kind=ShapeKind.ONE_WAY, area=True, heading=heading,
            points=np.array([[w, s], [e, s], [e, n], [w, n]]) + 0.4 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]),
        )
        for (w, s, e, n), heading in lanes
    )  # fmt: skip
    on = Grid(cells=np.zeros(cells.shape, np.uint8), resolution=1.0, origin=np.zeros(2))
    ways = Zones(on=on, keep_out=np.zeros(cells.shape, np.uint8), one_way=shapes).ways
    return Costmap(cells=cells, resolution=1.0, origin=np.zeros(2), ways=ways)


def directed(m: Costmap) -> nx.DiGraph:
    rows, cols = m.cells.shape
    w, graph = Traversal().weights[m.cells], nx.DiGraph()
    for r, c, d in product(range(rows), range(cols), range(8)):
        s, k = r + STEPS[d][0], c + STEPS[d][1]
        if not (0 <= s < rows and 0 <= k < cols) or not np.isfinite([w[r, c], w[s, k], w[r, k], w[s, c]]).all():
            continue
        if m.ways is None or m.ways[r, c] >> d & 1:
            graph.add_edge((r, c), (s, k), weight=float(np.hypot(*STEPS[d]) * (w[r, c] + w[s, k]) / 2))
    return graph


@pytest.mark.compiled
@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1))
def test_no_lawful_way_is_cheaper(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cells = rng.choice(np.array([0, 0, 60, 200, LETHAL], np.uint8), (14, 16))
    lanes = []
    for _ in range(int(rng.integers(1, 3))):
        (w, e), (s, n) = np.sort(rng.choice(16, 2, replace=False)), np.sort(rng.choice(14, 2, replace=False))
        lanes.append(((int(w), int(s), int(e) + 1, int(n) + 1), float(rng.integers(8)) * np.pi / 4))
    m = zoned(cells, *lanes)
    free = np.argwhere(cells < LETHAL)
    a, b = (tuple(map(int, free[k])) for k in rng.integers(len(free), size=2))
    graph = directed(m)
    graph.add_nodes_from([a, b])
    try:
        best = nx.dijkstra_path_length(graph, a, b)
    except nx.NetworkXNoPath:
        best = np.inf
    start, goal = m.centre_of(np.array(a)), m.centre_of(np.array(b))
    path, reach = AStar().plan(m, start, goal), Reach().costs(m, start, goal[None])
    assert (path.cost if path.found else np.inf) == pytest.approx(best) == reach[0]
    if path.found:
        assert lawful(m, path.points) and lawful(m, Refined(planner=AStar()).plan(m, start, goal).points)


def test_a_robot_in_a_lane_leaves_it_ahead_and_comes_round() -> None:
    cells = np.full((9, 20), LETHAL, np.uint8)
    cells[1], cells[7], cells[1:8, 1], cells[1:8, 18] = 0, 0, 0, 0
    m = zoned(cells, ((4, 1, 16, 2), 0.0))
    path = AStar().plan(m, np.array([10.5, 1.5]), np.array([5.5, 1.5]))
    assert path.found and path.length > 30.0 and path.points[:, 1].max() > 7.0
    assert AStar().plan(costmap(cells), np.array([10.5, 1.5]), np.array([5.5, 1.5])).length == pytest.approx(5.0)
    assert Reach().costs(m, np.array([10.5, 1.5]), np.array([[5.5, 1.5]]))[0] == pytest.approx(path.cost)


def test_lines_that_are_not_lawful() -> None:
    m = zoned(np.zeros((9, 20), np.uint8), ((4, 0, 16, 9), 0.0))
    for to, allowed in (((15.0, 4.5), True), ((10.0, 8.0), True), ((6.0, 4.5), False), ((9.0, 8.0), False)):
        assert lawful(m, np.array([[10.0, 4.5], to])) is allowed
    with pytest.raises(DataError, match="ways"):
        Costmap(cells=m.cells, resolution=1.0, origin=np.zeros(2), ways=np.zeros((2, 2), np.uint8))
