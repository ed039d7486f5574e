"""From a log of several robots to what their filters read: odometry on one clock, sightings sorted out, the truth."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias, final

import numpy as np

from outrider.core.angles import wrap
from outrider.core.attitudes import wrap_all
from outrider.data import EventLog, Kind, Stream, Trajectory
from outrider.data.team_run import CODES, Sighting
from outrider.errors import ConfigError, DataError
from outrider.filters.cooperative.placing import Pairs
from outrider.typing import Bools, Floats, Ints
from outrider.workflows.config import FuseConfig, TeamSection

STEP: Final = 0.1  # s, of the prediction
STALE: Final = 0.5  # s, how long a record of odometry holds
BLIND_NOISE: Final = (0.1, 0.3)  # m/s, rad/s per sqrt(Hz), where there is none
AT_REST: Final = 5.0  # s without any, after which a robot is taken to stand
REST_NOISE: Final = (0.01, 0.02)
REACH: Final = 50.0  # m: no camera reads a barcode from further away
FIRST_SIGMA: Final = 0.15  # m, of a place, until the noise is known
FRAMES: Final = 4  # in which a frame that comes twice is looked for
OPEN: Final = -1  # code of a sighting of which nothing is known yet

Anchor: TypeAlias = tuple[Floats, Floats, Floats]
"""Times (k,) [s], poses (k, 3) and variances (k,) [m^2] of the place of a robot that is known."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Mate:
    """One robot. t : (k,) s;  u : (k, 6) input of its model;  way : (k, 3) poses that odometry alone gives, from 0."""

    name: str
    number: int
    t: Floats
    u: Floats
    way: Floats
    truth: Trajectory | None


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Seen:
    """All sightings by time. t : (n,) s;  t_ns : (n,);  robot : (n,) who;  subject : (n,) whom;  z : (n, 2) range,
    bearing;  what : (n,) codes, written as things become known"""

    t: Floats
    t_ns: Ints
    robot: Ints
    subject: Ints
    z: Floats
    what: Ints


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class TeamLog:
    """A team's log. start : ns, when time begins;  marks : places of landmarks by number"""

    start: int
    mates: tuple[Mate, ...]
    absent: Mapping[str, str]
    marks: Mapping[int, Floats]
    seen: Seen

    @property
    def names(self) -> list[str]:
        """Of the robots."""
        return [m.name for m in self.mates]

    @property
    def end(self) -> float:
        """The last record [s]."""
        return max(float(m.t[-1]) for m in self.mates)


def team_log(log: EventLog, cfg: FuseConfig) -> TeamLog:
    """Sort a log out. Raises `DataError` where there is no odometry, `ConfigError` for robots that are not there."""
    team = cfg.team or TeamSection()
    names = sorted({s.robot for s in log})
    _check(team, names, log)
    ids = {**log.ids, **team.ids}
    absent = dict.fromkeys(team.without, "left out in the configuration")
    chosen = [n for n in names if n not in team.without]
    for n in [n for n in chosen if not _of(log, n, Kind.TWIST)]:
        absent[n] = "it has no odometry"
    chosen = [n for n in chosen if n not in absent]
    if not chosen:
        raise DataError("no robot has odometry", where=log.path, fix="a team needs wheel speeds of each robot")
    lost = next((n for n in chosen if n not in ids), None)
    if lost is not None and len(chosen) > 1:
        raise ConfigError(f"{lost} has no number", where="team.ids", fix=f"say how others see it, e.g. {{{lost}: 1}}")
    streams = [s for n in chosen for s in (*_of(log, n, Kind.TWIST), *_of(log, n, Kind.RANGE_BEARING)) if len(s)]
    start = min(int(s.t.min()) for s in streams)
    marks = {int(k): np.array(p[:2], np.float64) for k, p in log.beacons.items()}
    marks |= {int(b.id): np.array(b.xyz_m[:2], np.float64) for b in cfg.beacons}
    end = float(max(int(s.t.max()) for s in streams) - start) * 1e-9
    mates = tuple(_mate(log, n, ids.get(n, 0), start, end) for n in chosen)
    return TeamLog(
        start=start, mates=mates, absent=absent, marks=marks, seen=_sightings(log, mates, start, marks, team)
    )


def _check(team: TeamSection, names: Sequence[str], log: EventLog) -> None:
    told = {"without": team.without, "landmarks_for": team.landmarks_for or (), "ids": tuple(team.ids),
            "starts": tuple(team.starts)}  # fmt: skip
    for key, given in told.items():
        for name in given:
            if name not in names:
                known = ", ".join(names) or "none"
                raise ConfigError(f"no robot '{name}' in the log", where=f"team.{key}", fix=f"it has {known}")
    numbers = list({**log.ids, **team.ids}.values())
    if len(numbers) > len(set(numbers)):
        raise ConfigError("two robots have one number", where="team.ids", fix="give each its own")


def _of(log: EventLog, robot: str, kind: Kind) -> list[Stream]:
    return [s for s in log.of(kind) if s.robot == robot and len(s)]


def _mate(log: EventLog, name: str, number: int, start: int, end: float) -> Mate:
    odometry = _of(log, name, Kind.TWIST)[0]
    t, u = _inputs(_seconds(odometry.t, start), odometry.z[:, [0, 5]], end)
    references = _of(log, name, Kind.ESTIMATE)
    return Mate(name=name, number=number, t=t, u=u, way=_dead_reckoned(t, u),
                truth=_trajectory(references[0]) if references else None)  # fmt: skip


def _seconds(t: Ints, start: int) -> Floats:
    return np.asarray((t - start) * 1e-9, np.float64)


def _inputs(t: Floats, v: Floats, end: float) -> tuple[Floats, Floats]:
    """Records of odometry, each of which holds until the next, as means about the times of a grid: a fifth of the steps
    and the same way. Where there are none the robot is taken to stand, and not to be sure of it."""
    good = np.isfinite(v).all(axis=1) & (np.abs(v) < 50.0).all(axis=1)
    order = np.argsort(t[good], kind="stable")
    t, v = t[good][order], v[good][order]
    holds = np.minimum(np.diff(t, append=t[-1]), STALE)
    edges = np.column_stack([t, t + holds]).ravel()
    steps = np.zeros((edges.size, 3))
    steps[1::2, :2], steps[1::2, 2] = v * holds[:, None], holds
    total = np.cumsum(steps, axis=0)
    grid = STEP * np.arange(np.floor(t[0] / STEP), np.ceil(end / STEP) + 1.0)
    ends = np.append(grid - 0.5 * STEP, grid[-1] + 0.5 * STEP)
    got = np.diff(np.column_stack([np.interp(ends, edges, total[:, i]) for i in range(3)]), axis=0) / STEP
    u = np.zeros((grid.size, 6))
    u[:, :2] = got[:, :2]
    silent = grid - t[np.clip(np.searchsorted(t, grid, side="right") - 1, 0, None)]
    noise = np.where(silent[:, None] < AT_REST, BLIND_NOISE, REST_NOISE)
    u[:, 2:4] = np.sqrt(np.clip(1.0 - got[:, 2:], 0.0, 1.0)) * noise
    u[np.abs(u) < 1e-9] = 0.0
    return grid, u


def _dead_reckoned(t: Floats, u: Floats) -> Floats:
    step = np.diff(t, prepend=t[0])
    mean = 0.5 * (u[:, :2] + np.vstack([u[:1, :2], u[:-1, :2]]))
    heading = np.cumsum(mean[:, 1] * step)
    middle = heading - 0.5 * mean[:, 1] * step
    way = mean[:, 0] * step
    return np.column_stack([np.cumsum(way * np.cos(middle)), np.cumsum(way * np.sin(middle)), heading])


def _trajectory(s: Stream) -> Trajectory | None:
    t, first = np.unique(s.t, return_index=True)
    z = s.z[first]
    good = np.isfinite(z[:, :7]).all(axis=1)
    return Trajectory(t=t[good], p=z[good, :3], q=z[good, 3:7], name=s.name) if good.any() else None


def _sightings(
    log: EventLog, mates: Sequence[Mate], start: int, marks: Mapping[int, Floats], team: TeamSection
) -> Seen:  # fmt: skip
    t, robot, z = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)], [np.zeros((0, 3))]
    for i, m in enumerate(mates):
        for s in _of(log, m.name, Kind.RANGE_BEARING):
            t.append(s.t)
            robot.append(np.full(len(s), i))
            z.append(s.z)
    order = np.argsort(np.concatenate(t), kind="stable")
    t_ns, who, values = np.concatenate(t)[order], np.concatenate(robot)[order], np.vstack(z)[order]
    subject = np.where(np.isfinite(values[:, 0]), values[:, 0], -1.0).astype(np.int64)
    seen = Seen(t=_seconds(t_ns, start), t_ns=t_ns, robot=who, subject=subject, z=values[:, 1:],
                what=np.full(t_ns.size, OPEN))  # fmt: skip
    _judge(seen, mates, marks, {**log.ids, **team.ids}, team)
    return seen


def _judge(
    seen: Seen, mates: Sequence[Mate], marks: Mapping[int, Floats], ids: Mapping[str, int], team: TeamSection
) -> None:
    """Refuse what can be told at once, for the first reason that holds."""
    numbers = np.array([m.number for m in mates], np.int64)
    blind = [i for i, m in enumerate(mates) if team.landmarks_for is not None and m.name not in team.landmarks_for]
    mapped, teammate = np.isin(seen.subject, list(marks)), np.isin(seen.subject, [*ids.values(), *numbers.tolist()])
    r, b = seen.z.T
    reasons: dict[Sighting, Bools] = {
        Sighting.UNKNOWN: seen.subject < 0,
        Sighting.IMPLAUSIBLE: ~((r > 0.0) & (r < REACH) & (np.abs(b) <= np.pi)),
        Sighting.ITSELF: seen.subject == numbers[seen.robot],
        Sighting.REPEATED: _repeated(seen),
        Sighting.WITHHELD: mapped & np.isin(seen.robot, blind),
        Sighting.UNMAPPED: ~(mapped | teammate),
    }
    for reason, rows in reasons.items():
        seen.what[rows & (seen.what == OPEN)] = CODES[reason]


def _repeated(seen: Seen) -> Bools:
    """Whether a robot saw just the same of the same subject in one of the frames before, less than a second ago."""
    out = np.zeros(seen.t.size, np.bool_)
    order = np.lexsort((seen.t, seen.subject, seen.robot))
    for back in range(1, FRAMES + 1):
        a, b = order[:-back], order[back:]
        same = (seen.robot[a] == seen.robot[b]) & (seen.subject[a] == seen.subject[b])
        out[b] |= same & (seen.z[a] == seen.z[b]).all(axis=1) & (seen.t[b] - seen.t[a] < 1.0)
    return out


def own_place(m: Mate, t: Floats) -> Floats:
    """(n, 3) dead-reckoned poses at times."""
    return np.column_stack([np.interp(t, m.t, m.way[:, i]) for i in range(3)])


def seen_at(pose: Floats, z: Floats) -> Floats:
    """(n, 2) places that are seen from poses (n, 3) at range and bearing (n, 2)."""
    a = pose[:, 2] + z[:, 1]
    return pose[:, :2] + z[:, :1] * np.column_stack([np.cos(a), np.sin(a)])


def pairs(log: TeamLog, who: int, known: Mapping[int, Anchor], *, own_eyes: bool = True) -> Pairs:
    """What tells where a robot is: landmarks that it saw, and robots that it saw or that saw it.

    known : robots whose place is known, by index;  own_eyes : whether to take what it saw itself
    """
    m, seen = log.mates[who], log.seen
    t, own, world, var, row = (
        [np.zeros(0)],
        [np.zeros((0, 2))],
        [np.zeros((0, 2))],
        [np.zeros(0)],
        [np.zeros(0, np.int64)],
    )

    def add(rows: Ints, mine: Floats, there: Floats, variance: Floats | float) -> None:
        t.append(seen.t[rows])
        own.append(mine)
        world.append(there)
        var.append(FIRST_SIGMA**2 + (0.03 * seen.z[rows, 0]) ** 2 + variance)
        row.append(rows)

    usable = (seen.what == OPEN) & (seen.t >= m.t[0]) & (seen.t <= m.t[-1])
    mine = usable & (seen.robot == who) & own_eyes
    rows = np.flatnonzero(mine & np.isin(seen.subject, list(log.marks)))
    places = np.array([log.marks[k] for k in seen.subject[rows].tolist()]).reshape(-1, 2)
    add(rows, seen_at(own_place(m, seen.t[rows]), seen.z[rows]), places, 0.0)
    for k, (times, poses, variances) in known.items():
        inside = usable & (seen.t >= times[0]) & (seen.t <= times[-1])
        rows = np.flatnonzero(inside & mine & (seen.subject == log.mates[k].number))
        at = _between(seen.t[rows], times, poses)
        add(
            rows,
            seen_at(own_place(m, seen.t[rows]), seen.z[rows]),
            at[:, :2],
            np.interp(seen.t[rows], times, variances),
        )
        rows = np.flatnonzero(inside & (seen.robot == k) & (seen.subject == m.number))
        at = _between(seen.t[rows], times, poses)
        there = seen_at(at, seen.z[rows])
        add(rows, own_place(m, seen.t[rows])[:, :2], there, np.interp(seen.t[rows], times, variances))
    order = np.argsort(np.concatenate(t), kind="stable")
    floats = (np.concatenate(a)[order] for a in (t, own, world, var))
    return Pairs(*floats, row=np.concatenate(row)[order])


def _between(t: Floats, times: Floats, poses: Floats) -> Floats:
    turned = np.unwrap(poses[:, 2])
    return np.column_stack([*(np.interp(t, times, poses[:, i]) for i in range(2)), np.interp(t, times, turned)])


def truth_at(truth: Trajectory, t_ns: Ints, gap_s: float = 0.5) -> tuple[Floats, Bools]:
    """(n, 3) true poses between records, and where there are records close enough on both sides."""
    j = np.clip(np.searchsorted(truth.t, t_ns), 1, max(truth.t.size - 1, 1))
    if truth.t.size < 2:
        return np.zeros((t_ns.size, 3)), np.zeros(t_ns.size, np.bool_)
    a, b = truth.t[j - 1], truth.t[j]
    good = (t_ns >= a) & (t_ns <= b) & (b - a <= gap_s * 1e9)
    share = np.clip((t_ns - a) / np.maximum(b - a, 1), 0.0, 1.0)
    yaw = truth.yaw
    turn = wrap_all(yaw[j] - yaw[j - 1])
    p = truth.p[j - 1, :2] + share[:, None] * (truth.p[j, :2] - truth.p[j - 1, :2])
    return np.column_stack([p, yaw[j - 1] + share * turn]), good


def first_true(m: Mate, start: int) -> tuple[float, Floats] | None:
    """The first pose of the ground truth at which the robot's odometry has begun: s, (3,)."""
    if m.truth is None:
        return None
    t = (m.truth.t - start) * 1e-9
    k = np.flatnonzero((t >= m.t[0]) & (t <= m.t[-1]))[:1]
    if not k.size:
        return None
    i = int(k[0])
    return float(t[i]), np.array([*m.truth.p[i, :2], wrap(float(m.truth.yaw[i]))])
