"""Takes a ground robot to a pose: scans into a costmap, a path over it, a trajectory along the path, a command.

It sees the robot's own estimate, its lidar and what other robots say of themselves; whatever it cannot do has a reason.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from math import cos, hypot, sin
from typing import Final, final

import numpy as np

from outrider.core.angles import wrap
from outrider.data.driving import LocalOutcome, LocalPlan, LocalPlanner, Situation
from outrider.data.footprint import Footprint
from outrider.data.grid import INSCRIBED, LETHAL, UNKNOWN, Costmap, Grid
from outrider.data.routes import GlobalPlanner, Path, PathOutcome
from outrider.data.scan import Scan
from outrider.data.surroundings import DistanceField, Surroundings
from outrider.errors import DataError
from outrider.mapping.inflation import Inflation
from outrider.mapping.layers import Cells, LayeredCostmap, Other
from outrider.team.navigator import Fused
from outrider.typing import Floats

STILL: Final = np.zeros(3)


class Drive(Enum):
    """What the driver is doing; the value is the sentence a user reads."""

    IDLE = "it has nowhere to go"
    UNDER_WAY = "it is on its way"
    ARRIVED = "it is there"
    WAITING = "something is in the way: it waits for it to go"
    UNREACHABLE = "there is no way to the goal"
    BLIND = "it does not see or does not know where it is: a controlled stop"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """twist : (3,) body frame, what to command;  state, with its `reason` in words;  path, plan : what it follows."""

    state: Drive
    twist: Floats = field(default_factory=lambda: STILL.copy())
    reason: str = ""
    path: Path | None = None
    plan: LocalPlan | None = None


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class DriverSettings:
    """window : m, side of the square around the robot in which obstacles are seen;  patience_s : how long it waits for
    something to go away before a goal counts as out of reach;  replan_s : s between looks for a better path;
    better : share by which a new path must be shorter;  stale_s : s without a scan after which it is blind;
    sigma : m, standard deviation of its position above which it does not know where it is."""

    window: float = 12.0
    patience_s: float = 30.0
    replan_s: float = 2.0
    better: float = 0.1
    stale_s: float = 1.0
    sigma: float = 1.0


@final
class Driver:
    """One robot's way from pose to pose. `go` sets the goal, `step` is called every period."""

    def __init__(
        self,
        *,
        ground: Grid,
        footprint: Footprint,
        planner: GlobalPlanner,
        local: LocalPlanner,
        inflation: Inflation,
        keep_out: Cells | None = None,
        settings: DriverSettings = DriverSettings(),
        sees: bool = True,
    ) -> None:
        self._planner, self._local, self._settings, self._sees = planner, local, settings, sees
        self._map = LayeredCostmap(ground, inflation=inflation, footprint=footprint, keep_out=keep_out)
        self._goal: Floats | None = None
        self._path: Path | None = None
        self._plan: LocalPlan | None = None
        self._planned_s = self._seen_s = self._moved_s = -np.inf
        self.plans = 0

    @property
    def costmap(self) -> Costmap:
        """What stands now, and what it costs to drive near it."""
        return self._map.costmap

    def go(self, goal: Floats | None) -> None:
        """Drive to (3,) east, north [m], heading [rad], NaN for any; None: stay."""
        same = goal is not None and self._goal is not None and np.array_equal(goal, self._goal, equal_nan=True)
        if not same:
            self._goal, self._path, self._plan = goal, None, None
            self._planned_s = self._moved_s = -np.inf

    def step(self, t_s: float, here: Fused, scans: Sequence[Scan] = (), others: Sequence[Other] = ()) -> Answer:
        """What to command now."""
        pose = np.array([here.p[0], here.p[1], here.heading])
        # what stands around
        blind = self._look(t_s, here, pose, scans, others)
        if blind:
            return Answer(state=Drive.BLIND, reason=blind)
        if self._goal is None:
            return Answer(state=Drive.IDLE)
        # the path, a new one where there is a reason
        if self._wants_path(t_s):
            self._replan(t_s, pose)
        if self._path is None or not self._path.found:
            return self._lost(t_s)
        # the trajectory along it
        self._plan = self._local.plan(self._situation(t_s, here, pose, others), self._plan)
        return self._told(t_s, self._plan)

    def _look(self, t_s: float, here: Fused, pose: Floats, scans: Sequence[Scan], others: Sequence[Other]) -> str:
        """Enter what came in; why the robot is blind, or nothing."""
        if not (
            np.isfinite(pose).all() and np.isfinite(here.v).all() and np.isfinite(here.w) and np.isfinite(here.P).all()
        ):
            return "the estimate is not finite"
        worst = float(np.sqrt(np.linalg.eigvalsh(here.P[:2, :2])[-1]))
        if not worst <= self._settings.sigma:
            return f"the position is known to {worst:.1f} m only"
        try:
            self._map.update(scans, pose=pose, others=others)
        except DataError as e:
            return str(e)
        if scans:
            self._seen_s = t_s
        if self._seen_s == -np.inf:
            self._seen_s = t_s  # the first scan is due
        if self._sees and t_s - self._seen_s > self._settings.stale_s:
            return f"no scan for {t_s - self._seen_s:.1f} s"
        return ""

    def _wants_path(self, t_s: float) -> bool:
        if self._path is None or t_s - self._planned_s >= self._settings.replan_s:
            return True
        return self._plan is not None and self._plan.outcome is LocalOutcome.REPLAN and t_s > self._planned_s + 0.5

    def _replan(self, t_s: float, pose: Floats) -> None:
        """A new path, kept unless the one in use is still good and hardly longer."""
        assert self._goal is not None
        self._planned_s = t_s
        self.plans += 1
        new = self._planner.plan(self.costmap, pose[:2], self._goal[:2])
        old = self._path
        if new.found and old is not None and old.found and self._open(old) and not self._stuck():
            left = _rest(old.points, pose[:2])
            if new.length > (1.0 - self._settings.better) * left:
                return
        if new.found or old is None or not old.found or not self._open(old):
            self._path = new

    def _stuck(self) -> bool:
        return self._plan is not None and self._plan.outcome is LocalOutcome.REPLAN

    def _open(self, path: Path) -> bool:
        """Whether no cell of a path is taken."""
        m = self.costmap
        cells = m.cell_of(path.points)
        inside = (cells >= 0).all(axis=1) & (cells < m.cells.shape).all(axis=1)
        on = m.cells[tuple(cells[inside].T)]
        return bool(((on < INSCRIBED) | (on == UNKNOWN)).all())

    def _lost(self, t_s: float) -> Answer:
        """No path: wait for a while in case something goes away."""
        assert self._path is not None
        self._plan = None
        if self._moved_s == -np.inf:
            self._moved_s = t_s
        hopeless = self._path.outcome in (PathOutcome.GOAL_OUTSIDE, PathOutcome.START_OUTSIDE)
        given_up = hopeless or t_s - self._moved_s > self._settings.patience_s
        state = Drive.UNREACHABLE if given_up else Drive.WAITING
        return Answer(state=state, reason=self._path.outcome.value, path=self._path)

    def _situation(self, t_s: float, here: Fused, pose: Floats, others: Sequence[Other]) -> Situation:
        assert self._goal is not None and self._path is not None
        c, s = cos(here.heading), sin(here.heading)
        twist = np.array([c * here.v[0] + s * here.v[1], c * here.v[1] - s * here.v[0], here.w])
        goal = self._goal.copy()
        if np.isnan(goal[2]):
            ahead = self._path.points[-1] - self._path.points[max(len(self._path.points) - 4, 0)]
            goal[2] = float(np.arctan2(ahead[1], ahead[0])) if hypot(*ahead) > 0.0 else here.heading
        return Situation(
            time=t_s, pose=pose, twist=twist, goal=np.array([goal[0], goal[1], wrap(float(goal[2]))]),
            path=self._path.points, surroundings=Surroundings(field=self._field(pose)),
        )  # fmt: skip

    def _field(self, pose: Floats) -> DistanceField:
        """Distances to what is taken in the window around the robot."""
        m, half = self.costmap, int(0.5 * self._settings.window / self._map.resolution)
        row, col = (int(v) for v in m.cell_of(pose[:2]))
        r0, c0 = max(row - half, 0), max(col - half, 0)
        cells = m.cells[r0 : row + half + 1, c0 : col + half + 1]
        taken = np.where((cells == LETHAL) | (cells == UNKNOWN), cells, 0).astype(np.uint8)
        corner = m.origin + np.array([c0, r0]) * m.resolution
        return DistanceField.of(Costmap(cells=taken, resolution=m.resolution, origin=corner))

    def _told(self, t_s: float, plan: LocalPlan) -> Answer:
        state = Drive.UNDER_WAY
        if plan.outcome is LocalOutcome.ARRIVED:
            state = Drive.ARRIVED
        elif plan.outcome in (LocalOutcome.STOP, LocalOutcome.REPLAN):
            state = Drive.WAITING
        if state is not Drive.WAITING or self._moved_s == -np.inf:
            self._moved_s = t_s
        if t_s - self._moved_s > self._settings.patience_s:
            state = Drive.UNREACHABLE
        return Answer(state=state, twist=plan.twist, reason=plan.reason, path=self._path, plan=plan)


def _rest(points: Floats, p: Floats) -> float:
    """Length of a path [m] from its vertex nearest to p on."""
    at = int(np.argmin(np.hypot(points[:, 0] - p[0], points[:, 1] - p[1])))
    return float(np.hypot(*np.diff(points[at:], axis=0).T).sum())
