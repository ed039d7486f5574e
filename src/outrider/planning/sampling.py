"""RRT* of the Open Motion Planning Library, for comparison: the only module that knows `ompl`, an optional package."""

from dataclasses import dataclass, field
from importlib import import_module
from time import perf_counter
from typing import Any, final

import numpy as np

from outrider.data.grid import Costmap
from outrider.data.routes import Path, PathOutcome
from outrider.errors import UsageError
from outrider.planning.ends import find_ends
from outrider.planning.refine import cost_along, line_cost
from outrider.planning.traversal import Traversal
from outrider.typing import Floats


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class SamplingPlanner:
    """A path by random samples, as short as could be found in the time; the costs of cells do not count, only whether
    they may be entered.

    S. Karaman, E. Frazzoli, "Sampling-based algorithms for optimal motion planning", IJRR 2011.

    traversal : see `Traversal`;  seconds : how long to go on looking for a shorter one, within the budget;  seed : of
    OMPL's generator, which only the first planner of a process can set.
    """

    traversal: Traversal = field(default_factory=Traversal)
    seconds: float = 1.0
    seed: int = 1

    def plan(self, costmap: Costmap, start: Floats, goal: Floats, *, budget_s: float = np.inf) -> Path:
        """See `GlobalPlanner`. It never knows that there is no way: it runs out of time.

        UsageError : `ompl` is not installed.
        """
        begun = perf_counter()
        base, geometric = _library(self.seed)
        ends = find_ends(costmap, self.traversal, start, goal, budget_s)
        if ends.outcome is not None:
            suggestion = ends.suggest(costmap, self.traversal)
            return Path(outcome=ends.outcome, suggestion=suggestion, seconds=perf_counter() - begun)
        setup = _problem(base, geometric, costmap, self.traversal, start, goal)
        cost_along(costmap, self.traversal, np.stack([start, goal]))  # compiled before the clock runs
        setup.solve(min(self.seconds, budget_s))
        seconds = perf_counter() - begun
        if not setup.haveExactSolutionPath():
            return Path(outcome=PathOutcome.OUT_OF_TIME, seconds=seconds)
        points = np.array([(s[0], s[1]) for s in setup.getSolutionPath().getStates()])
        return Path(
            outcome=PathOutcome.FOUND,
            points=points,
            length=float(np.hypot(*np.diff(points, axis=0).T).sum()),
            cost=cost_along(costmap, self.traversal, points),
            expanded=int(setup.getPlanner().numIterations()),
            seconds=seconds,
        )


def _library(seed: int) -> tuple[Any, Any]:
    try:
        util, base, geometric = (import_module(f"ompl.{name}") for name in ("util", "base", "geometric"))
    except ImportError:
        fix = "pip install 'outrider[ompl]'"
        raise UsageError("RRT* needs the package ompl", where="planning", fix=fix) from None
    util.setLogLevel(util.LogLevel.LOG_NONE)
    util.RNG.setSeed(seed)
    return base, geometric


def _problem(base: Any, geometric: Any, costmap: Costmap, traversal: Traversal, start: Floats, goal: Floats) -> Any:
    weights, cutting = traversal.weights, int(traversal.corner_cutting)
    (west, south), side = costmap.origin.tolist(), costmap.resolution

    def valid(state: Any) -> bool:
        x, y = (state[0] - west) / side, (state[1] - south) / side
        return line_cost(costmap.cells, weights, cutting, x, y, x, y) < np.inf

    class Sight(base.MotionValidator):  # straight lines, checked in every cell that they touch
        def checkMotion(self, a: Any, b: Any) -> bool:
            ax, ay, bx, by = (a[0] - west) / side, (a[1] - south) / side, (b[0] - west) / side, (b[1] - south) / side
            return line_cost(costmap.cells, weights, cutting, ax, ay, bx, by) < np.inf

    space, bounds = base.RealVectorStateSpace(2), base.RealVectorBounds(2)
    for axis, size in ((0, costmap.cells.shape[1]), (1, costmap.cells.shape[0])):
        bounds.setLow(axis, float(costmap.origin[axis]))
        bounds.setHigh(axis, float(costmap.origin[axis] + size * side))
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)
    setup.setStateValidityChecker(valid)
    information = setup.getSpaceInformation()
    information.setMotionValidator(Sight(information))
    states = []
    for p in (start, goal):
        state = space.allocState()
        state[0], state[1] = float(p[0]), float(p[1])
        states.append(state)
    setup.setStartAndGoalStates(*states)
    setup.setPlanner(geometric.RRTstar(information))
    return setup
