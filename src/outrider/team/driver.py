"""Takes a ground robot to a pose: scans into a costmap, a path over it, a trajectory along the path, a command.

It sees the robot's own estimate, its lidar and what other robots say of themselves; whatever it cannot do has a reason.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from math import cos, hypot, sin
from typing import Final, final

import numpy as np

from outrider.core.angles import wrap
from outrider.data.driving import DriveLimits, LocalOutcome, LocalPlan, LocalPlanner, Situation, Steering
from outrider.data.footprint import Footprint
from outrider.data.grid import Costmap, Grid
from outrider.data.routes import GlobalPlanner, Path, PathOutcome
from outrider.data.scan import Scan
from outrider.mapping.inflation import Inflation
from outrider.mapping.layers import LayeredCostmap, Other
from outrider.mapping.obstacles import Marking
from outrider.mapping.zones import Zones
from outrider.planning.local.yielding import Yielding, YieldSettings
from outrider.planning.replan import Choice, Replanning
from outrider.planning.traversal import Traversal
from outrider.team.lawful import obeyed
from outrider.team.navigator import Fused
from outrider.team.progress import Progress, drives, way_left
from outrider.team.sight import Sight
from outrider.typing import Floats

STILL: Final = np.zeros(3)
NONE: Final = np.empty((0, 5))
URGENT_S: Final = 0.5  # s between plans where the path is blocked or leads nowhere
MARKING: Final = Marking(mark=5.0, clear=9.0)  # what moves is known by coming to where beams have passed
LAST: Final = 1.5  # m before a goal from where on its heading is the robot's choice, if it is free
SLOW: Final = 0.2  # of its speed: a detour takes no longer
IN_VAIN: Final = "it drives and comes no nearer to the goal"
OUT: Final = 1.0  # m that a plan may start beside a robot that stands too near to something


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
    """twist : (3,) body frame, what to command;  state, with its `reason` in words;  path, plan : what it follows;
    note : what is new and worth telling."""

    state: Drive
    twist: Floats = field(default_factory=lambda: STILL.copy())
    reason: str = ""
    path: Path | None = None
    plan: LocalPlan | None = None
    note: str = ""

    @property
    def at_rest(self) -> "Answer":
        """The same, but standing."""
        return replace(self, twist=STILL.copy())


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class DriverSettings:
    """window : m, side of the square around the robot in which obstacles are seen;  patience_s : how long it waits for
    something to go away before a goal counts as out of reach;  progress_s : s that it drives without coming nearer
    before it does, and longer on a detour;  replan_s : s between looks for a better path;
    better, least : share and metres of free ground that it must save;  stale_s : s without a scan after which the robot
    is blind;  sigma : m, standard deviation of its position above which it does not know where it is."""

    window: float = 12.0
    patience_s: float = 30.0
    progress_s: float = 60.0
    replan_s: float = 2.0
    better: float = 0.15
    least: float = 1.0
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
        zones: Zones | None = None,
        settings: DriverSettings = DriverSettings(),
        sees: bool = True,
        traversal: Traversal = Traversal(),
        period_s: float = 0.1,
    ) -> None:
        """traversal : the planner's own rules, by which paths are compared;  period_s : s between steps."""
        self.footprint, self.sees = footprint, sees
        self._planner, self._settings, self._traversal = planner, settings, traversal
        self._local = Yielding(planner=local, footprint=footprint, settings=YieldSettings(period=period_s))
        s = settings
        self.zones = zones
        costs = zoned(ground, zones, inflation, footprint, speed=local.limits.forward, weight=traversal.weight)
        self._sight = Sight(costs, sees=sees, window=s.window, stale_s=s.stale_s, sigma=s.sigma)
        self._replanning = Replanning(better=s.better, least=s.least)
        self._goal: Floats | None = None
        self._path: Path | None = None
        self._plan: LocalPlan | None = None
        self._planned_s = self._moved_s = -np.inf
        self.plans, self.choices = 0, dict.fromkeys(Choice, 0)
        self.legs = {"roads": 0, "open ground": 0}
        self._progress = self._watch()

    @property
    def costmap(self) -> Costmap:
        """What stands now, and what it costs to drive near it."""
        return self._sight.costmap

    @property
    def limits(self) -> DriveLimits:
        """What the base can do."""
        return self._local.limits

    def go(self, goal: Floats | None) -> None:
        """Drive to (3,) east, north [m], heading [rad], NaN for any; None: stay."""
        same = goal is not None and self._goal is not None and np.array_equal(goal, self._goal, equal_nan=True)
        if not same:
            self._goal, self._path, self._plan = goal, None, None
            self._planned_s = self._moved_s = -np.inf
            self._progress = self._watch()

    def step(
        self, t_s: float, here: Fused, scans: Sequence[Scan] = (), others: Sequence[Other] = (), moving: Floats = NONE
    ) -> Answer:
        """What to command now. others : robots that stand;  moving : (n, 5) discs, robots that say how they move."""
        pose = np.array([here.p[0], here.p[1], here.heading])
        # what stands around
        blind = self._sight.look(t_s, here, scans, others)
        if blind:
            return Answer(state=Drive.BLIND, reason=blind)
        if self._goal is None:
            return Answer(state=Drive.IDLE)
        # the path, a new one where there is a reason
        path = self._route(t_s, pose[:2])
        if not path.found:
            return self._lost(t_s, path)
        # the trajectory along it
        now = self._situation(t_s, here, pose, path, moving)
        self._plan = self._local.plan(now, self._plan)
        return self._within_zones(self._watched(self._told(t_s, self._plan), now), pose, path)

    def _within_zones(self, answer: Answer, pose: Floats, path: Path) -> Answer:
        """The answer with what the zones of the site leave of its command."""
        if self.zones is None:
            return answer
        twist, why = obeyed(self.zones, answer.twist, pose, path.points, self.limits)
        return replace(answer, twist=twist, reason=why or answer.reason)

    def _route(self, t_s: float, p: Floats) -> Path:
        """The path to follow: planned anew now and then, and soon where it is blocked or leads nowhere."""
        assert self._goal is not None
        old, ago, stuck = self._path, t_s - self._planned_s, self._stuck()
        urgent = ago >= URGENT_S and old is not None and (stuck or self._blocked(old, p))
        if old is not None and ago < self._settings.replan_s and not urgent:
            return old
        self._planned_s = t_s
        self.plans += 1
        new = self._planned(p, self._goal[:2])
        choice = Choice.FIRST
        if old is not None:
            choice = self._replanning.choose(self.costmap, self._traversal, old, new, p)
        self.choices[choice] += 1
        if choice is Choice.FIRST and new.found:
            self.legs["roads" if new.nodes else "open ground"] += 1
        self._path = new if old is None or choice is not Choice.KEPT or (stuck and new.found) else old
        return self._path

    def _blocked(self, path: Path, p: Floats) -> bool:
        return self._replanning.needs_plan(self.costmap, self._traversal, path, p)

    def _planned(self, p: Floats, goal: Floats) -> Path:
        """A new path; a robot that stands too near to something starts where it could stand."""
        new = self._planner.plan(self.costmap, p, goal)
        aside = new.suggestion
        if new.outcome is PathOutcome.START_BLOCKED and aside is not None and np.hypot(*(aside - p)) < OUT:
            return self._planner.plan(self.costmap, aside, goal)
        return new

    def _stuck(self) -> bool:
        return self._plan is not None and self._plan.outcome in (LocalOutcome.BACK_OUT, LocalOutcome.REPLAN)

    def _lost(self, t_s: float, path: Path) -> Answer:
        """No path: wait for a while in case something goes away."""
        self._plan = None
        if self._moved_s == -np.inf:
            self._moved_s = t_s
        hopeless = path.outcome in (PathOutcome.GOAL_OUTSIDE, PathOutcome.START_OUTSIDE)
        given_up = hopeless or t_s - self._moved_s > self._settings.patience_s
        state = Drive.UNREACHABLE if given_up else Drive.WAITING
        return Answer(state=state, reason=path.outcome.value, path=path)

    def _situation(self, t_s: float, here: Fused, pose: Floats, path: Path, moving: Floats) -> Situation:
        assert self._goal is not None
        c, s = cos(here.heading), sin(here.heading)
        twist = np.array([c * here.v[0] + s * here.v[1], c * here.v[1] - s * here.v[0], here.w])
        goal = self._goal.copy()
        faces = not np.isnan(goal[2])
        if not faces:
            goal[2] = _facing(pose, path.points, self.limits)
        return Situation(
            time=t_s, pose=pose, twist=twist, goal=np.array([goal[0], goal[1], wrap(float(goal[2]))]),
            path=path.points, surroundings=self._sight.surroundings(t_s, pose[:2], moving), faces=faces,
        )  # fmt: skip

    def _told(self, t_s: float, plan: LocalPlan) -> Answer:
        yields = plan.outcome is LocalOutcome.GIVE_WAY
        state = Drive.UNDER_WAY
        if plan.outcome is LocalOutcome.ARRIVED:
            state = Drive.ARRIVED
        elif plan.outcome in (LocalOutcome.STOP, LocalOutcome.REPLAN):
            state = Drive.WAITING
        if self._moved_s == -np.inf or (state is not Drive.WAITING and not yields):
            self._moved_s = t_s
        if t_s - self._moved_s > self._settings.patience_s:
            state = Drive.UNREACHABLE
        return Answer(state=state, twist=plan.twist, reason=plan.reason, path=self._path, plan=plan)

    def _watch(self) -> Progress:
        return Progress(patience_s=self._settings.progress_s, slow=SLOW * self.limits.forward)

    def _watched(self, answer: Answer, now: Situation) -> Answer:
        """The answer, unless the robot drives in vain: then it stops, and the goal is out of reach."""
        if answer.state is Drive.ARRIVED:
            self._progress = self._watch()
        if answer.state is not Drive.UNDER_WAY:
            return answer
        counts = drives(now.twist, answer.twist)
        if not self._progress.step(now.time, way_left(now.path, now.pose[:2]), drives=counts):
            return answer
        why = f"{IN_VAIN}: {self._progress.least:.1f} m of way were left at best"
        return replace(answer.at_rest, state=Drive.UNREACHABLE, reason=why)


def zoned(
    ground: Grid, zones: Zones | None, inflation: Inflation, footprint: Footprint, *, speed: float, weight: float
) -> LayeredCostmap:
    """A costmap of a whole site as a robot of `speed` [m/s] may use it; weight : of the planner's `Traversal`."""
    return LayeredCostmap(
        ground, inflation=inflation, footprint=footprint, marking=MARKING,
        keep_out=None if zones is None else zones.keep_out,
        least=None if zones is None else zones.least_costs(speed, weight),
        ways=None if zones is None else zones.ways,
    )  # fmt: skip


def _facing(pose: Floats, path: Floats, limits: DriveLimits) -> float:
    """The heading to arrive with where any will do: along the path; on its last metres, the one that is there anyway.

    That is the own one of a base that goes sideways, and towards or away from the goal for all others.
    """
    ahead = path[-1] - path[max(len(path) - 4, 0)]
    gap = path[-1] - pose[:2]
    if hypot(*gap) > LAST and hypot(*ahead) > 0.0:
        return float(np.arctan2(ahead[1], ahead[0]))
    if limits.steering is Steering.HOLONOMIC or hypot(*gap) < 1e-6:
        return float(pose[2])
    bearing = float(np.arctan2(gap[1], gap[0]))
    behind = limits.backward > 0.0 and abs(wrap(bearing - float(pose[2]))) > 0.5 * np.pi
    return bearing + np.pi if behind else bearing
