"""When to give up a path for a new one: if it is blocked, or if the new one is clearly better."""

from dataclasses import dataclass
from enum import Enum
from math import inf
from typing import final

import numpy as np

from outrider.data.grid import Costmap
from outrider.data.routes import Path
from outrider.errors import ConfigError
from outrider.planning.refine import costs_along
from outrider.planning.traversal import Traversal
from outrider.typing import Floats


class Choice(Enum):
    """Which path to follow, and why."""

    FIRST = "there was no path so far: the new one is followed"
    KEPT = "the path is still free, and the new one is not clearly better"
    BLOCKED = "something stands in the path: the new one is followed"
    LEFT = "the robot is too far from its path: the new one is followed"
    BETTER = "the new path is clearly better"
    STOP = "the path is blocked and there is no new one: stop"

    @property
    def switches(self) -> bool:
        """Whether the new path is taken."""
        return self in (Choice.FIRST, Choice.BLOCKED, Choice.LEFT, Choice.BETTER)


@final
@dataclass(frozen=True, slots=True)
class Remaining:
    """What is left of a path: its cost in metres of free ground, inf if it is blocked, and the distance to it [m]."""

    cost: float
    offset: float
    blocked_at: float  # m ahead, inf if nowhere


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Replanning:
    """Hysteresis between two paths that cost about the same.

    better : share of the remaining cost that a new path must save;  least [m] of free ground, too;  stray [m] from the
    path at which it is given up;  ahead [m] of the path that must be free (what is further may have gone by then).
    """

    better: float = 0.15
    least: float = 1.0
    stray: float = 1.0
    ahead: float = inf

    def __post_init__(self) -> None:
        if not (0.0 <= self.better < 1.0 and self.least >= 0.0 and self.stray > 0.0 and self.ahead > 0.0):
            said = f"better {self.better:g}, least {self.least:g} m, stray {self.stray:g} m, ahead {self.ahead:g} m"
            raise ConfigError(said, where="replanning", fix="better 0..1, least 0 or more, stray and ahead positive")

    def needs_plan(self, costmap: Costmap, traversal: Traversal, path: Path, position: Floats) -> bool:
        """Whether the path cannot be followed any more, so that a new one has to be made now."""
        return not path.found or self._why(remaining(costmap, traversal, path, position)) is not None

    def choose(self, costmap: Costmap, traversal: Traversal, path: Path, new: Path, position: Floats) -> Choice:
        """Between the path followed so far and a new one from `position`."""
        if not path.found:
            return Choice.FIRST if new.found else Choice.STOP
        rest = remaining(costmap, traversal, path, position)
        why = self._why(rest)
        if why is not None:
            return why if new.found else Choice.STOP
        if new.found and rest.cost - new.cost > max(self.better * rest.cost, self.least) and rest.cost < inf:
            return Choice.BETTER
        return Choice.KEPT

    def _why(self, rest: Remaining) -> Choice | None:
        if rest.blocked_at < inf and rest.blocked_at <= self.ahead:
            return Choice.BLOCKED
        return Choice.LEFT if rest.offset > self.stray else None


def remaining(costmap: Costmap, traversal: Traversal, path: Path, position: Floats) -> Remaining:
    """What is left of a path from the place on it that is nearest to `position`."""
    p = path.points
    if len(p) < 2:
        return Remaining(0.0, float(np.hypot(*(p[0] - position))), inf)
    gap = np.diff(p, axis=0)
    squared = np.maximum((gap**2).sum(axis=1), 1e-300)
    s = np.clip(((position - p[:-1]) * gap).sum(axis=1) / squared, 0.0, 1.0)
    foot = p[:-1] + s[:, None] * gap
    offset = np.hypot(*(foot - position).T)
    i = int(offset.argmin())
    rest = np.concatenate([foot[i : i + 1], p[i + 1 :]])
    costs = costs_along(costmap, traversal, rest)
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(rest, axis=0).T))])
    blocked = np.flatnonzero(np.isinf(costs))
    return Remaining(float(costs.sum()), float(offset[i]), float(along[blocked[0]]) if blocked.size else inf)
