"""Long legs over a network of roads, the first and the last mile over open ground."""

from dataclasses import dataclass, field, replace
from itertools import product
from math import inf
from time import perf_counter
from typing import final

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from outrider.data.grid import Costmap
from outrider.data.routes import GlobalPlanner, Path, PathOutcome, RouteGraph
from outrider.errors import ConfigError, UsageError
from outrider.planning.refine import cost_along, lawful
from outrider.planning.traversal import Traversal
from outrider.typing import Floats

_UNREACHED = -9999  # scipy's word for it


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Route:
    """A way over a network: the nodes on it, in order, and how long it takes; none: `nodes` is empty, `seconds` inf."""

    nodes: tuple[int, ...]
    seconds: float


def quickest(graph: RouteGraph, start: int, goal: int, *, speed: float, width: float = 0.0) -> Route:
    """The quickest way from node to node at no more than `speed` [m/s], on roads at least `width` [m] wide.

    UsageError : a node that is not there.
    """
    for node in (start, goal):
        if not 0 <= node < len(graph.names):
            fix = f"0..{len(graph.names) - 1}"
            raise UsageError(f"there is no node {node}", where="route graph", fix=fix)
    times, before = dijkstra(_matrix(graph, speed, width), indices=start, return_predecessors=True)
    nodes = [goal]
    while nodes[-1] != start:
        nodes.append(int(before[nodes[-1]]))
        if nodes[-1] == _UNREACHED:
            return Route(nodes=(), seconds=inf)
    return Route(nodes=tuple(reversed(nodes)), seconds=float(times[goal]))


def _matrix(graph: RouteGraph, speed: float, width: float) -> coo_array:
    """Seconds from node to node; the quickest of several edges between the same two."""
    usable = (graph.width >= width) & (graph.speed > 0.0)
    tail, head = graph.edges[usable].T
    # scipy takes a zero for no edge: two nodes on one spot are a nanosecond apart
    seconds = np.maximum(graph.lengths[usable] / np.minimum(graph.speed[usable], speed), 1e-9)
    order = np.lexsort((seconds, head, tail))
    pair = tail[order] * len(graph.names) + head[order]
    first = order[np.concatenate([[True], pair[1:] != pair[:-1]])[: len(order)]]
    return coo_array((seconds[first], (tail[first], head[first])), shape=(len(graph.names), len(graph.names)))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class RoadPlanner:
    """Takes the roads where that is quicker than the open ground.

    The ways on and off are looked for at the `nearby` nodes around either end; a leg over open ground takes its cost,
    in metres of free ground, at `speed`, and so does a road. One on which something stands, or that leads against a
    one-way zone, is not taken; what lies beyond the map is taken to be free.

    graph : the network;  planner : finds the ways over open ground;  traversal : its rules;  speed [m/s] of the robot;
    width [m] of the robot;  near : m as the crow flies, within which only the open ground is looked at, and  far : from
    where on it is only if no road leads there: a search over all of a large site takes long.
    """

    graph: RouteGraph
    planner: GlobalPlanner
    speed: float
    traversal: Traversal = field(default_factory=Traversal)
    width: float = 0.0
    nearby: int = 3
    near: float = 0.0
    far: float = inf

    def __post_init__(self) -> None:
        if not (0.0 < self.speed < inf) or not min(self.width, self.near, self.far) >= 0.0 or self.nearby < 1:
            said = f"speed {self.speed:g} m/s, width {self.width:g} m, {self.nearby} nodes nearby"
            raise ConfigError(said, where="road planner", fix="a positive speed, a width of 0 or more, 1 or more nodes")

    def plan(self, costmap: Costmap, start: Floats, goal: Floats, *, budget_s: float = np.inf) -> Path:
        """See `GlobalPlanner`; the cost is what the quickest way takes, times `speed`. Without a way over the roads, it
        is the way over open ground."""
        begun = perf_counter()

        def leg(a: Floats, b: Floats) -> Path:
            left = budget_s - (perf_counter() - begun)
            if not left > 0.0:
                return Path(outcome=PathOutcome.OUT_OF_TIME)
            return self.planner.plan(costmap, a, b, budget_s=left)

        gap = float(np.hypot(*(goal - start)))
        long = gap >= self.far
        best = Path(outcome=PathOutcome.NO_WAY) if long else leg(start, goal)
        if gap < self.near or best.outcome in (PathOutcome.START_OUTSIDE, PathOutcome.START_BLOCKED):
            return best
        graph, nodes = self._open(costmap), self.graph.nodes
        on = [(n, way) for n in self._near(start) if (way := leg(start, nodes[n])).found]
        off = [(n, way) for n in self._near(goal) if (way := leg(nodes[n], goal)).found]
        for (n, first), (m, last) in product(on, off):
            best = self._better(best, first, quickest(graph, n, m, speed=self.speed, width=self.width), last)
        best = leg(start, goal) if long and not best.found else best
        return replace(best, seconds=perf_counter() - begun)

    def _open(self, costmap: Costmap) -> RouteGraph:
        """The roads that may be taken, each as slow as its ground is dear."""
        graph, size = self.graph, np.array(costmap.cells.shape)
        cell = costmap.cell_of(graph.nodes)
        there = np.asarray(((cell >= 0) & (cell < size)).all(axis=1), np.bool_)
        inside = there[graph.edges[:, 0]] & there[graph.edges[:, 1]]
        dear = np.ones(len(graph.edges))
        for k in np.flatnonzero(inside & (graph.lengths > 0.0)).tolist():
            ends = graph.nodes[graph.edges[k]]
            cost = cost_along(costmap, self.traversal, ends) if lawful(costmap, ends) else inf
            dear[k] = cost / graph.lengths[k]
        keep, speed = dear < inf, np.minimum(graph.speed, self.speed) / dear
        return replace(graph, edges=graph.edges[keep], speed=speed[keep], width=graph.width[keep])

    def _near(self, p: Floats) -> list[int]:
        gap = self.graph.nodes - p
        return np.argsort(np.hypot(gap[:, 0], gap[:, 1]), kind="stable")[: self.nearby].tolist()

    def _better(self, best: Path, first: Path, route: Route, last: Path) -> Path:
        cost = first.cost + route.seconds * self.speed + last.cost
        if len(route.nodes) < 2 or (best.found and best.cost <= cost):
            return best
        points = np.concatenate([first.points, self.graph.nodes[list(route.nodes)], last.points])
        keep = np.concatenate([[True], np.hypot(*np.diff(points, axis=0).T) > 0.0])
        length = float(np.hypot(*np.diff(points, axis=0).T).sum())
        return Path(outcome=PathOutcome.FOUND, points=points[keep], length=length, cost=cost, nodes=route.nodes)
