"""Roads against networkx, and where they meet the open ground."""

from dataclasses import replace

import networkx as nx
import numpy as np
import pytest
from grids import costmap
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.data.grid import LETHAL, Costmap
from outrider.data.routes import Path, PathOutcome, RouteGraph
from outrider.errors import ConfigError, UsageError
from outrider.planning.astar import AStar
from outrider.planning.refine import cost_along, lawful
from outrider.planning.roads import RoadPlanner, quickest
from outrider.planning.traversal import Traversal


def network(rng: np.random.Generator, n: int, m: int) -> RouteGraph:
    return RouteGraph(
        names=tuple(f"n{i}" for i in range(n)),
        nodes=rng.uniform(0.0, 50.0, (n, 2)),
        edges=rng.integers(0, n, (m, 2)),
        speed=rng.choice([0.5, 1.0, 3.0, np.inf], m),
        width=rng.choice([1.0, 2.0, np.inf], m),
    )


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(2, 12), st.integers(0, 40))
def test_quickest_as_networkx_has_it(seed: int, n: int, m: int) -> None:
    graph = network(np.random.default_rng(seed), n, m)
    other = nx.MultiDiGraph()
    other.add_nodes_from(range(n))
    for (a, b), length, speed, width in zip(graph.edges, graph.lengths, graph.speed, graph.width, strict=True):
        if width >= 1.5:
            other.add_edge(int(a), int(b), weight=length / min(speed, 2.0))
    times = nx.single_source_dijkstra_path_length(other, 0)
    for goal in range(n):
        route = quickest(graph, 0, goal, speed=2.0, width=1.5)
        assert route.seconds == pytest.approx(times.get(goal, np.inf), abs=1e-6)
        assert bool(route.nodes) == (goal in times)
        assert all(other.has_edge(a, b) for a, b in zip(route.nodes, route.nodes[1:], strict=False))


LANE = RouteGraph(
    names=("west", "bend", "east"),
    nodes=np.array([[5.5, 8.5], [30.5, 8.5], [55.5, 8.5]]),
    edges=np.array([[0, 1], [1, 2]]),  # one way
    speed=np.array([2.0, np.inf]),
    width=np.full(2, 2.0),
)


def test_a_road_is_taken_where_it_is_quicker() -> None:
    cells = np.full((20, 61), 200, np.uint8)  # rough ground
    cells[8] = 0
    start, goal = np.array([5.5, 4.5]), np.array([55.5, 12.5])
    planner = RoadPlanner(graph=LANE, planner=AStar(), speed=2.0)
    path = planner.plan(costmap(cells), start, goal)
    assert path.found
    assert np.array_equal(path.points[[0, -1]], [start, goal])
    assert tuple(LANE.nodes[1]) in {tuple(p) for p in path.points}
    assert path.cost < AStar().plan(costmap(cells), start, goal).cost + 1e-9
    on = AStar().plan(costmap(cells), start, LANE.nodes[0]).cost
    off = AStar().plan(costmap(cells), LANE.nodes[2], goal).cost
    assert path.cost <= on + 50.0 + off + 1e-9
    back = planner.plan(costmap(cells), goal, start)
    assert back.found
    assert back.cost == pytest.approx(AStar().plan(costmap(cells), goal, start).cost)  # not against the traffic


def test_something_stands_on_the_road() -> None:
    cells = np.zeros((20, 61), np.uint8)
    cells[:9, 40] = LETHAL
    path = RoadPlanner(graph=LANE, planner=AStar(), speed=2.0).plan(
        costmap(cells), np.array([5.5, 8.5]), np.array([55.5, 8.5])
    )
    assert path.found
    assert path.points[:, 1].max() > 9.0
    assert np.isfinite(cost_along(costmap(cells), Traversal(), path.points))


def test_too_wide_for_the_road() -> None:
    cells = np.zeros((20, 61), np.uint8)
    cells[:8, 20] = cells[9:, 20] = LETHAL
    start, goal = np.array([5.5, 4.5]), np.array([55.5, 12.5])
    far = Refuse()
    narrow, wide = (RoadPlanner(graph=LANE, planner=far, speed=2.0, width=w) for w in (1.5, 2.5))
    assert narrow.plan(costmap(cells), start, goal).found
    assert wide.plan(costmap(cells), start, goal).outcome is PathOutcome.NO_WAY


class Refuse:
    """Open ground is crossed for ten metres, not further."""

    def plan(self, costmap: Costmap, start: np.ndarray, goal: np.ndarray, *, budget_s: float = np.inf) -> Path:
        if np.hypot(*(goal - start)) > 10.0:
            return Path(outcome=PathOutcome.NO_WAY)
        return AStar().plan(costmap, start, goal, budget_s=budget_s)


class Asked:
    """Notes how far it is asked to go over open ground."""

    def __init__(self) -> None:
        self.legs: list[float] = []

    def plan(self, costmap: Costmap, start: np.ndarray, goal: np.ndarray, *, budget_s: float = np.inf) -> Path:
        self.legs.append(float(np.hypot(*(goal - start))))
        return AStar().plan(costmap, start, goal, budget_s=budget_s)


def test_long_legs_take_the_roads_and_short_ones_the_open_ground() -> None:
    cells, start, goal = np.zeros((20, 61), np.uint8), np.array([5.5, 8.5]), np.array([55.5, 8.5])
    far, near = Asked(), Asked()
    path = RoadPlanner(graph=LANE, planner=far, speed=2.0, near=40.0, far=40.0, nearby=1).plan(
        costmap(cells), start, goal
    )
    assert path.nodes == (0, 1, 2) and max(far.legs) < 10.0
    path = RoadPlanner(graph=LANE, planner=near, speed=2.0, near=60.0, far=60.0).plan(costmap(cells), start, goal)
    assert path.nodes == () and near.legs == [50.0]


def test_long_legs_without_a_road_take_the_open_ground() -> None:
    cells = np.zeros((20, 61), np.uint8)
    cells[8:10, 30] = LETHAL  # on the road
    path = RoadPlanner(graph=LANE, planner=AStar(), speed=2.0, near=40.0, far=40.0).plan(
        costmap(cells), np.array([5.5, 8.5]), np.array([55.5, 8.5])
    )
    assert path.found and path.nodes == ()


def test_a_road_that_leads_against_a_one_way_zone_is_not_taken() -> None:
    cells = np.zeros((20, 61), np.uint8)
    west = np.uint8(sum(1 << d for d in (2, 3, 4, 5, 6)))
    ways = np.full(cells.shape, 255, np.uint8)
    ways[6:11, 25:35] = west
    one = replace(costmap(cells), ways=ways)
    path = RoadPlanner(graph=LANE, planner=AStar(), speed=2.0).plan(one, np.array([5.5, 8.5]), np.array([55.5, 8.5]))
    assert path.found and path.nodes == () and lawful(one, path.points)


def test_a_start_outside_is_named() -> None:
    path = RoadPlanner(graph=LANE, planner=AStar(), speed=1.0).plan(
        costmap(np.zeros((20, 61), np.uint8)), np.array([-5.0, 0.0]), np.array([1.0, 1.0])
    )
    assert path.outcome is PathOutcome.START_OUTSIDE


def test_what_cannot_be_asked_of_roads() -> None:
    with pytest.raises(UsageError, match="no node 3"):
        quickest(LANE, 0, 3, speed=1.0)
    with pytest.raises(ConfigError, match="road planner"):
        RoadPlanner(graph=LANE, planner=AStar(), speed=0.0)
