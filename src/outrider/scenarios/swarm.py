"""Many drones at once: everyone with its own filter, neighbours known only by radio, in one compiled loop."""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import exp, inf
from typing import Final, final

import numpy as np

from outrider.errors import ConfigError
from outrider.guidance.avoidance import Avoidance
from outrider.guidance.column import Spacing
from outrider.guidance.neighbours import Cells
from outrider.models.motion.following import STEP, FollowerModel, lag_step
from outrider.models.vehicles.multirotor import Multirotor
from outrider.scenarios.swarm_loop import fly
from outrider.scenarios.swarm_state import (
    ASIDE,
    GOALS,
    H_JUDGED,
    H_SIZE,
    LEADER,
    M_SIZE,
    M_STAMP,
    MEMBER,
    T_AHEAD,
    T_GAP,
    T_SIZE,
    T_SPEED,
    Room,
    Swarm,
    World,
)
from outrider.sim.noise import generator
from outrider.typing import Floats, Ints

BLOCK: Final = 100  # decisions whose noise is drawn at once
LATEST: Final = 10  # steps that a message may be late
RANKS: Final = ("progress", "spacing", "avoidance", "safety filter", "avoidance gave way", "safety filter gave way")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Sky:
    """What is uncertain. Positions m, speeds m/s, times s; deviations per axis.

    fix_p, fix_v : of the receiver, 10 fixes a second;  loss : share of messages lost;  late_s : the most a message is
    late, evenly from one decision on;  radio : reach, m;  wind : from the west;  gust, gust_s : deviation and
    correlation of gusts;  noisy : False for exact sensors and still air.
    """

    fix_p: float = 0.15
    fix_v: float = 0.1
    loss: float = 0.2
    late_s: float = 0.2
    radio: float = 60.0
    wind: float = 2.0
    gust: float = 1.0
    gust_s: float = 2.0
    noisy: bool = True

    def __post_init__(self) -> None:
        if not 0.0 <= self.loss < 1.0:
            raise ConfigError(f"is {self.loss:g}", where="swarm loss", fix="a share from 0 to less than 1")
        if not DT <= self.late_s <= LATEST * DT:
            raise ConfigError(f"is {self.late_s:g} s", where="swarm late_s", fix=f"from {DT:g} to {LATEST * DT:g} s")
        for name in ("fix_p", "fix_v", "radio", "gust_s"):
            if not 0.0 < getattr(self, name) < inf:
                raise ConfigError(f"is {getattr(self, name)}", where=f"swarm {name}", fix="a number above 0")


DT: Final = 0.1  # s between decisions
SUB: Final = 5  # steps of the vehicle in one decision
FORGET_S: Final = 9.0  # s of silence after which nobody counts on somebody's being where it was
STALE_S: Final = 1.0  # s of silence after which it is taken to have stopped
LAYER: Final = 3.0  # m of height between drones that do not heed each other
ASIDE_M: Final = 6.0  # m that a drone without a radio climbs
VEHICLE: Final = Multirotor(tau_s=0.5, acceleration=4.0, speed=8.0, latency_s=DT, step_s=DT / SUB)
_NO_PATH: Final = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 1.0]])


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """Who starts where and is to do what. Lengths in m, times in s.

    start (N, 3);  kind (N,) GOALS, LEADER, MEMBER, or ASIDE for who waits above the trail to join;  goals (N, W, 3),
    one after the other;  release (N, W), from when on a drone may go on, for `window_s` in every `period_s`;  walls
    (m, 4), ends of pieces;  silent (N, windows, 2) without radio;  path (L, 2) of the leader, which starts on it where
    its start says;  pace (steps,) m/s of the leader;  trail (C, 2) known at the start;  branch (B, 2), from the path to
    the path again, of who is `second` and leads all behind it there;  leaves (N,), when a drone leaves the column for
    its goals;  near, on_the_way : how near counts as there."""

    start: Floats
    kind: Ints
    seconds: float
    goals: Floats | None = None
    release: Floats | None = None
    walls: Floats = field(default_factory=lambda: np.zeros((0, 4)))
    silent: Floats | None = None
    path: Floats | None = None
    pace: Floats | None = None
    trail: Floats | None = None
    branch: Floats | None = None
    second: int = -1
    leaves: Floats | None = None
    period_s: float = inf
    window_s: float = inf
    cruise: float = 3.0
    near: float = 1.0
    on_the_way: float = 3.0


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Flown:
    """What became of a swarm. track (rows, N, T_SIZE) of truth and estimates, a row every `every_s`;  least (N,) m, the
    least true distance of each to any other, at when (N,) s;  violations : drones and steps nearer than allowed;
    in_walls : the same, of walls;  ranks (N, 6) decisions by `RANKS`;  heard : messages;  there (N,) whether each is at
    its last goal;  error (N,) m, of the estimate at the end;  aside (N,) whether it is out of the column at the end."""

    track: Floats
    every_s: float
    least: Floats
    when: Floats
    violations: int
    in_walls: int
    ranks: Ints
    heard: int
    there: Ints
    error: Floats
    aside: Ints
    seconds: float


def fly_swarm(task: Task, seed: int, *, sky: Sky = Sky(), rules: Avoidance = Avoidance(), spacing: Spacing = Spacing(),
              every: int = 5, until_there: bool = True, room: int = 64,
              progress: Callable[[float], None] | None = None) -> Flown:  # fmt: skip
    """Fly a task. Every `every`th decision is recorded; it ends early when all are at their goals, if `until_there`.

    room : neighbours that a drone can remember, and hears at once, the nearest;  progress : told the share of the time.
    """
    n, steps = len(task.start), round(task.seconds / DT)
    w, s = _world(task, sky, rules, spacing), _swarm(task, sky, min(max(n - 1, 1), room), steps)
    r = _room(n, s.who.shape[1], len(task.walls), sky)
    track = np.zeros((steps // every + 1, n, T_SIZE))
    rng = generator(seed, "swarm", "noise")
    shape = (BLOCK, n, s.who.shape[1], 2)
    k = 0
    last = w.goals[:, -1]
    while k < steps:
        b = min(BLOCK, steps - k)
        fix, gust = rng.standard_normal((BLOCK, n, 6))[:b], rng.standard_normal((BLOCK, n, 3))[:b]
        fly(w, s, r, k, fix, gust, rng.random(shape)[:b], track, every)
        k += b
        if progress is not None:
            progress(k / steps)
        there = (s.goal == w.goals.shape[1] - 1) & (np.hypot(*(s.body[:, :2] - last[:, :2]).T) < 1.5 * task.near)
        if until_there and there.all():
            break
    there = (s.goal == w.goals.shape[1] - 1) & (np.hypot(*(s.body[:, :2] - last[:, :2]).T) < 1.5 * task.near)
    return Flown(
        track=track[: (k - 1) // every + 1], every_s=every * DT, least=s.least, when=s.when,
        violations=int(s.broken[0]), in_walls=int(s.broken[1]), ranks=s.ranks, heard=int(s.broken[2]),
        there=there.astype(np.int64), error=np.linalg.norm(s.X[:, :3] - s.body[:, :3], axis=1),
        aside=(s.kind == ASIDE).astype(np.int64), seconds=k * DT,
    )  # fmt: skip


def spacing_errors(flown: Flown, spacing: Spacing = Spacing()) -> Floats:
    """(rows, N) m, by how much each true gap to the one ahead differs from d_0 + h v; NaN for who follows nobody."""
    wanted = spacing.stand + spacing.headway_s * flown.track[:, :, T_SPEED]
    return np.where(flown.track[:, :, T_AHEAD] < 0.0, np.nan, flown.track[:, :, T_GAP] - wanted)


def _with_arc(p: Floats) -> Floats:
    """(n, 3) points (n, 2) with their arc length."""
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(p, axis=0).T))])
    return np.column_stack([p, arc])


def _world(task: Task, sky: Sky, rules: Avoidance, spacing: Spacing) -> World:
    n, steps = len(task.start), round(task.seconds / DT)
    on = 1.0 if sky.noisy else 0.0
    goals = task.start[:, None] if task.goals is None else task.goals
    step = np.zeros((3, STEP))
    lag_step(DT, FollowerModel(lag=VEHICLE.tau_s, lag_z=VEHICLE.tau_s).theta(), step)
    sigma = np.array([[sky.fix_p] * 3, [sky.fix_v] * 3])
    how = np.array([
        DT, SUB, sky.radio, sky.loss * on, round(sky.late_s / DT) if sky.noisy else 1, FORGET_S, STALE_S, 25.0, LAYER,
        1.0, task.cruise, task.near, ASIDE_M, sky.wind * on, sky.gust * on, exp(-DT / sky.gust_s),
        0.5 * rules.separation + rules.margin, rules.separation, task.period_s, task.window_s,
        task.on_the_way,
    ])  # fmt: skip
    assert len(how) == H_SIZE and how[H_JUDGED] == rules.separation
    return World(
        how=how, rules=rules.theta(),
        spacing=np.array([spacing.stand, spacing.headway_s, spacing.gain, spacing.preview, spacing.speed]),
        vehicle=VEHICLE._theta, step=step, variance=sigma**2, sigma=sigma * on,
        walls=np.ascontiguousarray(task.walls, np.float64), goals=np.ascontiguousarray(goals, np.float64),
        release=np.zeros(goals.shape[:2]) if task.release is None else task.release,
        silent=np.full((n, 1, 2), inf) if task.silent is None else task.silent,
        kind=np.where(task.kind == ASIDE, MEMBER, task.kind).astype(np.int64),
        path=_NO_PATH if task.path is None else _with_arc(task.path),
        branch=_NO_PATH if task.branch is None else _with_arc(task.branch), second=task.second,
        leaves=np.full(n, inf) if task.leaves is None else task.leaves,
        due=np.zeros(steps) if task.pace is None else np.cumsum(task.pace) * DT,
    )  # fmt: skip


def _swarm(task: Task, sky: Sky, slots: int, steps: int) -> Swarm:
    n = len(task.start)
    body = np.stack([VEHICLE.launch(p, np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(3)) for p in task.start])
    crumbs, known = np.zeros((2, 2, 3)), 2
    if task.trail is not None:
        trail = _with_arc(task.trail)
        crumbs, known = np.zeros((2, len(trail) + steps, 3)), len(trail)
        crumbs[0, :known] = trail
    arc = np.zeros(n)
    for i in range(n):
        points = task.path if task.kind[i] == LEADER else task.trail
        if points is not None:
            d = np.hypot(*(points - task.start[i, :2]).T)
            arc[i] = _with_arc(points)[d.argmin(), 2]
    P = np.zeros((n, 6, 6))
    P[:] = np.diag([sky.fix_p**2] * 3 + [sky.fix_v**2] * 3)
    sent = np.zeros((LATEST + 2, n, M_SIZE))
    sent[:, :, M_STAMP] = -inf
    return Swarm(
        body=body, X=np.column_stack([task.start, np.zeros((n, 3))]), P=P, u=np.zeros((n, 3, 4)),
        gust=np.zeros((n, 3)), sent=sent, who=np.full((n, slots), -1, np.int64), inbox=np.zeros((n, slots, M_SIZE)),
        kind=np.array(task.kind, np.int64), goal=np.zeros(n, np.int64), stuck=np.zeros(n),
        high=task.start[:, 2].copy(), arc=arc, true_arc=arc.copy(), dropped=arc.copy(),
        crumbs=crumbs, known=np.tile(np.array([known, 0], np.int64), (n, 1)), line=np.zeros(n, np.int64),
        shift=np.full(n, inf), fork=np.full(1, inf), hold=task.start[:, :2].copy(),
        mute=np.full(n, inf), rest=np.full(n, inf), least=np.full(n, inf), when=np.zeros(n),
        broken=np.zeros(3, np.int64), ranks=np.zeros((n, len(RANKS)), np.int64), last=np.zeros(n, np.int64),
    )  # fmt: skip


def _room(n: int, slots: int, walls: int, sky: Sky) -> Room:
    cells = Cells(n, sky.radio)
    return Room(
        place=np.zeros((n, 3)), first=cells.first, members=cells.members, ids=np.zeros(slots, np.int64),
        squared=np.zeros(slots), lines=np.zeros((2 * slots + walls, 3)), z=np.zeros(3), air=np.zeros((1, 3)),
    )  # fmt: skip


__all__ = ["GOALS", "LEADER", "MEMBER", "RANKS", "Flown", "Sky", "Task", "fly_swarm", "spacing_errors"]
