"""Ways through a site: a network of roads, and a path found in it or on a costmap."""

from dataclasses import dataclass, field
from enum import Enum
from typing import Protocol, final

import numpy as np

from outrider.data.grid import Costmap
from outrider.errors import DataError
from outrider.typing import Floats, Ints


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class RouteGraph:
    """Places and the ways between them.

    names : of the nodes;  nodes : (n, 2) m, site frame;  edges : (m, 2) from node, to node, two
    rows for a way both ways;  speed : (m,) m/s allowed, inf where nothing is said;  width : (m,) m, inf likewise.
    """

    names: tuple[str, ...]
    nodes: Floats
    edges: Ints
    speed: Floats
    width: Floats

    def __post_init__(self) -> None:
        n, m = len(self.names), len(self.edges)
        if (self.nodes.shape, self.edges.shape, self.speed.shape, self.width.shape) != ((n, 2), (m, 2), (m,), (m,)):
            shapes = f"{n} names, nodes {self.nodes.shape}, edges {self.edges.shape}"
            raise DataError(f"{shapes}, speed {self.speed.shape}, width {self.width.shape}", where="route graph")
        if m and (int(self.edges.min()) < 0 or int(self.edges.max()) >= n):
            raise DataError("an edge between nodes that are not there", where="route graph")
        if len(set(self.names)) < n:
            raise DataError("two nodes have one name", where="route graph", fix="name every node once")

    @property
    def lengths(self) -> Floats:
        """(m,) m."""
        gap = self.nodes[self.edges[:, 1]] - self.nodes[self.edges[:, 0]]
        return np.hypot(gap[:, 0], gap[:, 1])


class PathOutcome(Enum):
    """How a search for a path ended."""

    FOUND = "a path was found"
    START_OUTSIDE = "the start is outside the map: draw more of the site, or check the position and its datum"
    GOAL_OUTSIDE = "the goal is outside the map: draw more of the site, or choose a goal on it"
    START_BLOCKED = "the robot cannot stand where it starts: its cell is taken, unknown or too near to something"
    GOAL_BLOCKED = "the robot cannot stand at the goal: its cell is taken, unknown or too near to something"
    NO_WAY = "nothing that the robot fits through leads from the start to the goal"
    OUT_OF_TIME = "the time allowed for planning ran out"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Path:
    """Where to go, or why not.

    points : (n, 2) m, site frame, from the start to the goal; empty unless `outcome` is FOUND;  length [m];
    cost : what was minimised, in metres of free ground;  nodes : of the roads that it takes, if any;
    suggestion : (2,) m, the nearest place that would have worked, where there is one;  expanded : cells or nodes looked
    at;  seconds : of computing.
    """

    outcome: PathOutcome
    points: Floats = field(default_factory=lambda: np.empty((0, 2)))
    length: float = 0.0
    cost: float = 0.0
    nodes: tuple[int, ...] = ()
    suggestion: Floats | None = None
    expanded: int = 0
    seconds: float = 0.0

    @property
    def found(self) -> bool:
        """Whether there is a path to follow."""
        return self.outcome is PathOutcome.FOUND


class GlobalPlanner(Protocol):
    """Finds a path over a costmap."""

    def plan(self, costmap: Costmap, start: Floats, goal: Floats, *, budget_s: float = np.inf) -> Path:
        """From start to goal, (2,) m in the site frame; every way to fail is an outcome, not an exception."""
        ...
