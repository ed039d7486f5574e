"""A team's log and a configuration in, a `TeamRun` out: who starts where, everybody's filters, what came of it."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np

from outrider._kernel import compiling
from outrider.core.angles import wrap
from outrider.core.attitudes import rpy_to_quats, wrap_all
from outrider.data import EventLog, Gaussian, Trajectory, Verdict
from outrider.data.team_run import CODES, RobotEstimate, Score, Sighting, Sightings, TeamRun
from outrider.errors import DataError
from outrider.eval import average_bounds, chi_square
from outrider.filters.cooperative import Member, Method, Source, TeamEstimate, fuse_team
from outrider.filters.cooperative.placing import LEAST, WINDOW, place
from outrider.models.motion import LAYOUTS, Motion, OdometricRobot
from outrider.models.sensors import RangeBearing
from outrider.typing import Floats, Ints
from outrider.workflows.config import FuseConfig, TeamSection
from outrider.workflows.fuse import versions
from outrider.workflows.team_noise import FIRST, Noise, noise_of
from outrider.workflows.team_records import (
    OPEN,
    STEP,
    Anchor,
    Mate,
    TeamLog,
    first_true,
    own_place,
    pairs,
    seen_at,
    team_log,
    truth_at,
)

Progress = Callable[[str, float], None]
LAYOUT: Final = LAYOUTS[Motion.ODOMETRIC]
POSE: Final = 3  # rows of the pose, which come first
PASSES: Final = 3  # of finding the noise
TRIALS: Final = 4  # of fusing, with what is not believed left out
FEW, HALF = 20, 0.5  # sightings, and the share of them that is refused, before a robot is doubted
SOON: Final = 10.0  # s: a start before that is not looked for any earlier, nor one that is earlier by less
ROUNDS: Final = 4  # of finding where robots start by those that are found
TOLD: Final = {
    Verdict.USED: Sighting.USED, Verdict.GATED: Sighting.GATED, Verdict.NOT_ALIGNED: Sighting.EARLY,
    Verdict.DIVERGED: Sighting.GATED,
}  # fmt: skip


@final
@dataclass(frozen=True, slots=True)
class Start:
    """Where a robot starts: at t [s], pose (3,), covariance (3, 3), how it is known, and which sightings told it."""

    t: float
    pose: Floats
    P: Floats
    how: str
    rows: Ints


def fuse_team_log(log: EventLog, config: FuseConfig | None = None, *, progress: Progress | None = None) -> TeamRun:
    """Fuse the logs of a team, each robot's odometry with what it sees of landmarks and of the others.

    Ground truth in the log is used to score the estimates, and for nothing else unless `team.start` asks for it.

    Raises
    ------
    DataError     there is no odometry, or nobody's start can be found
    ConfigError   the configuration names robots that the log does not have
    """
    began = time.perf_counter()
    with compiling() as compiled:
        run = _fuse(log, config or FuseConfig(), progress or _silent)
    took = compiled()
    return replace(run, wall_seconds=time.perf_counter() - began - took, compile_seconds=took)


def _fuse(log: EventLog, cfg: FuseConfig, progress: Progress) -> TeamRun:
    team, tl = cfg.team or TeamSection(), team_log(log, cfg)
    times = STEP * np.arange(0.0, np.floor(tl.end / STEP) + 1.0)
    starts = _starts(tl, team, times, progress)
    if not starts:
        what = "nobody's start can be found: no robot sees two known landmarks"
        raise DataError(what, where=log.path, fix="give team.starts, or `team.start: groundtruth`")
    starts, noise, done, nis = _believed(tl, team, starts, times, progress)
    alone = None
    if team.compare and done.method is not Method.NONE:
        progress("fusing each alone", 0.0)
        what = tl.seen.what.copy()
        tl.seen.what[np.isin(what, [CODES[s] for s in TOLD.values()])] = OPEN
        alone = _run(tl, starts, Method.NONE, noise, times, team.gate)[0]
        tl.seen.what[:] = what
    return _result(log, cfg, tl, starts, noise, (done, alone), nis)


def _believed(
    tl: TeamLog, team: TeamSection, starts: dict[int, Start], times: Floats, progress: Progress
) -> tuple[dict[int, Start], Noise, TeamEstimate, Floats]:
    """Fuse, and again without what turns out not to be believed: starts, noise, estimates, NIS of sightings."""
    method = Method[team.cooperation.upper()]
    for trial in range(TRIALS):
        told = tl.seen.what.copy()
        for s in starts.values():
            tl.seen.what[s.rows] = CODES[Sighting.START]
        noise = _noise(tl, team, starts, times, progress)
        progress("fusing", 0.3)
        done, rows = _run(tl, starts, method, noise, times, team.gate)
        nis = _tell(tl, done, rows, starts)
        again = _doubtful(tl, starts) if trial + 1 < TRIALS else {}
        if not again:
            return starts, noise, done, nis
        tl.seen.what[:] = told
        starts = _restarted(tl, starts, again, times, team.gate)
    raise AssertionError("the last trial returns")


def _doubtful(tl: TeamLog, starts: Mapping[int, Start]) -> dict[int, bool]:
    """Robots most of whose sightings are refused: True where the others' sightings of it are, too: it is not where it
    is thought to be. False: it is there, and does not see what it says."""
    used, gated = (tl.seen.what == CODES[s] for s in (Sighting.USED, Sighting.GATED))
    out: dict[int, bool] = {}
    for i in starts:
        own, of = tl.seen.robot == i, tl.seen.subject == tl.mates[i].number
        by, on = ((int((gated & k).sum()), int(((gated | used) & k).sum())) for k in (own, of))
        if by[1] >= FEW and by[0] > HALF * by[1]:
            out[i] = on[1] < FEW or on[0] > HALF * on[1]
    return out


def _restarted(
    tl: TeamLog, starts: dict[int, Start], again: Mapping[int, bool], times: Floats, gate: float
) -> dict[int, Start]:
    """Those that are lost look for another start, later and with the help of the others; what a robot that cannot be
    believed has seen is left out."""
    sure = {i: s for i, s in starts.items() if i not in again}
    for i, lost in again.items():
        if not lost:
            tl.seen.what[(tl.seen.robot == i) & (tl.seen.what == OPEN)] = CODES[Sighting.DISBELIEVED]
    known: dict[int, Anchor] = {}
    if sure:
        done = _run(tl, sure, Method.NONE, FIRST, times, gate)[0]
        known = {i: _known(tl.mates[i], done, sure[i]) for i in sure}
    found = {i: _found(tl, i, known, starts[i].t + WINDOW if lost else -np.inf) for i, lost in again.items()}
    return {**sure, **{i: s for i, s in found.items() if s is not None}}


def _starts(tl: TeamLog, team: TeamSection, times: Floats, progress: Progress) -> dict[int, Start]:
    """By configuration, from ground truth if asked for, from landmarks, and then from those whose place is known."""
    out = _told(tl, team)
    fixed = set(out)
    known: dict[int, Anchor] = {}
    for turn in range(ROUNDS):
        progress("finding starts", turn / ROUNDS)
        late = [i for i in range(len(tl.mates)) if i not in fixed and (i not in out or out[i].t > SOON)]
        found = {i: s for i in late if (s := _found(tl, i, known)) is not None}
        better = {i: s for i, s in found.items() if i not in out or s.t < out[i].t - SOON}
        out |= better
        if not out or (turn and not better) or all(i in out and out[i].t < SOON for i in late):
            break
        done = _run(tl, out, Method.JOINT if turn else Method.NONE, FIRST, times, team.gate)[0]
        known = {i: _known(tl.mates[i], done, out[i]) for i in out}
    return out


def _told(tl: TeamLog, team: TeamSection) -> dict[int, Start]:
    """Starts that need not be found."""
    out: dict[int, Start] = {}
    for i, m in enumerate(tl.mates):
        if m.name in team.starts:
            s = team.starts[m.name]
            P = np.diag([s.sigma_m**2, s.sigma_m**2, np.radians(s.sigma_deg) ** 2])
            pose = np.array([*s.xy_m, np.radians(s.heading_deg)])
            out[i] = Start(float(m.t[0]), pose, P, "given in the configuration", np.zeros(0, np.int64))
        elif team.start == "groundtruth" and (first := first_true(m, tl.start)) is not None:
            how = "first pose of the ground truth, as asked for"
            out[i] = Start(*first, np.diag(LEAST), how, np.zeros(0, np.int64))
    return out


def _found(tl: TeamLog, i: int, known: Mapping[int, Anchor], after: float = -np.inf) -> Start | None:
    m = tl.mates[i]
    tries = (
        place(pairs(tl, i, known, own_eyes=own), m.t, m.way, after) for own in ((True, False) if known else (True,))
    )
    told = next((p for p in tries if p is not None), None)
    if told is None:
        return None
    subjects = sorted({int(tl.seen.subject[r]) for r in told.rows.tolist() if tl.seen.subject[r] in tl.marks})
    others = sorted({n for r in told.rows.tolist() if (n := _other(tl, i, r))})
    parts = [f"landmarks {', '.join(map(str, subjects))}"] if subjects else []
    parts += [f"meetings with {', '.join(others)}"] if others else []
    how = f"found from {' and '.join(parts)}"
    return Start(told.t, told.pose, told.P, how, told.rows)


def _other(tl: TeamLog, i: int, row: int) -> str:
    who, subject = int(tl.seen.robot[row]), int(tl.seen.subject[row])
    if who != i:
        return tl.mates[who].name
    return next((m.name for m in tl.mates if m.number == subject and subject not in tl.marks), "")


def _known(m: Mate, done: TeamEstimate, start: Start) -> Anchor:
    """Poses of a robot from its start on, with the variance of its place, for those that are to be found by it."""
    k = done.t >= start.t
    P = done.P[m.name][k]
    return done.t[k], done.x[m.name][k, :POSE], np.maximum(P[:, 0, 0], P[:, 1, 1])


def _noise(tl: TeamLog, team: TeamSection, starts: dict[int, Start], times: Floats, progress: Progress) -> Noise:
    """Of sightings: as configured, else as they scatter about what a first run expects of landmarks."""
    given = (team.range_sigma_m, team.bearing_sigma_deg)
    if given[0] is None or given[1] is None:
        progress("finding noise", 0.0)
        seeing = {i: s for i, s in starts.items() if _sees_landmarks(tl, i)}
        found = FIRST
        for _ in range(PASSES if seeing else 0):
            found = noise_of(tl, _run(tl, seeing, Method.NONE, found, times, team.gate)[0], seeing)
    else:
        found = Noise(given[0], np.radians(given[1]), True)
    return Noise(
        range_m=given[0] if given[0] is not None else found.range_m,
        bearing=float(np.radians(given[1])) if given[1] is not None else found.bearing,
        measured=found.measured,
    )


def _sees_landmarks(tl: TeamLog, i: int) -> bool:
    rows = (tl.seen.robot == i) & (tl.seen.what == OPEN) & np.isin(tl.seen.subject, list(tl.marks))
    return int(rows.sum()) > 20


def _run(
    tl: TeamLog, starts: Mapping[int, Start], method: Method, noise: Noise, times: Floats, gate: float
) -> tuple[TeamEstimate, list[Ints]]:
    """Everybody's filters. Second: the rows of the sightings that each source holds, none for odometry."""
    members = [_member(tl.mates[i], s) for i, s in starts.items()]
    sources: list[Source] = []
    rows: list[Ints] = []
    for i in starts:
        m = tl.mates[i]
        sources.append(Source(robot=m.name, sensor=None, t=m.t, z=m.u))
        rows.append(np.zeros(0, np.int64))
    for i in starts:
        mine = np.flatnonzero((tl.seen.robot == i) & (tl.seen.what == OPEN))
        for subject in np.unique(tl.seen.subject[mine]).tolist():
            partner = next((tl.mates[k].name for k in starts if tl.mates[k].number == subject), "")
            if subject not in tl.marks and not partner:
                continue
            own = mine[tl.seen.subject[mine] == subject]
            x, y = tl.marks[subject].tolist() if subject in tl.marks else (0.0, 0.0)
            sensor = RangeBearing(beacon=(x, y, 0.0), sigma_range=noise.range_m, sigma_bearing=noise.bearing)
            z = np.column_stack([np.full(own.size, float(subject)), tl.seen.z[own]])
            partner = "" if subject in tl.marks else partner
            sources.append(Source(robot=tl.mates[i].name, sensor=sensor, t=tl.seen.t[own], z=z, partner=partner))
            rows.append(own)
    begin = min(s.t for s in starts.values())
    return fuse_team(members, sources, method, times, start=begin, false_alarm=1.0 - gate), rows


def _member(m: Mate, s: Start) -> Member:
    model = OdometricRobot()
    x, sd = LAYOUT.zeros(), np.zeros(LAYOUT.error_size)
    for name, value in (("speed_scale", model.initial_speed_scale), ("turn_scale", model.initial_turn_scale),
                        ("curvature", model.initial_curvature), ("range_bias", model.range_bias)):  # fmt: skip
        sd[LAYOUT.error(name)] = value
    P = np.diag(sd**2)
    x[:POSE], P[:POSE, :POSE] = s.pose, s.P
    x[2] = wrap(float(x[2]))
    return Member(name=m.name, motion=Motion.ODOMETRIC, model=model, belief=Gaussian(x, P, LAYOUT), start=s.t)


def _tell(tl: TeamLog, done: TeamEstimate, rows: Sequence[Ints], starts: Mapping[int, Start]) -> Floats:
    """Write down what became of every sighting; their NIS."""
    what = tl.seen.what
    nis = np.full(what.size, np.nan)
    for k, own in enumerate(rows):
        records = np.flatnonzero(done.source == k)
        if own.size and records.size:
            codes = [CODES[TOLD.get(Verdict(v), Sighting.REFUSED)] for v in done.verdict[records].tolist()]
            what[own], nis[own] = codes, done.nis[records]
    left = what == OPEN
    placed = np.array([tl.mates[i].number for i in starts])
    gone = ~np.isin(tl.seen.subject, [*tl.marks, *placed.tolist()]) | ~np.isin(tl.seen.robot, list(starts))
    what[left] = np.where(gone[left], CODES[Sighting.ABSENT], CODES[Sighting.NOT_SHARED])
    return nis


def _result(
    log: EventLog,
    cfg: FuseConfig,
    tl: TeamLog,
    starts: Mapping[int, Start],
    noise: Noise,
    done: tuple[TeamEstimate, TeamEstimate | None],
    nis: Floats,
) -> TeamRun:
    robots = tuple(_robot(tl, i, s, *done) for i, s in starts.items())
    never = {m.name: "its start was never found: it saw too little" for i, m in enumerate(tl.mates) if i not in starts}
    seen = tl.seen
    return TeamRun(
        log_path=log.path, log_sha256=log.sha256, config=cfg.model_dump(mode="json"), versions=versions(),
        cooperation=done[0].method.name.lower(), about=done[0].method.value, start=tl.start,
        names=tuple(tl.names), robots=robots,
        absent={**tl.absent, **never}, landmarks={k: (float(p[0]), float(p[1])) for k, p in tl.marks.items()},
        sightings=Sightings(t=seen.t_ns, robot=seen.robot, subject=seen.subject, z=seen.z, what=seen.what, nis=nis),
        noise={"range_m": noise.range_m, "bearing_deg": float(np.degrees(noise.bearing)),
               "from_data": float(noise.measured)},
        score=_together(tl, starts, done[0]), alone=_together(tl, starts, done[1]), notes=log.notes,
    )  # fmt: skip


def _robot(tl: TeamLog, i: int, s: Start, done: TeamEstimate, alone: TeamEstimate | None) -> RobotEstimate:
    m = tl.mates[i]
    k = done.t >= s.t
    x, P = done.x[m.name][k], done.P[m.name][k]
    t = tl.start + np.round(done.t[k] * 1e9).astype(np.int64)
    names = LAYOUT.names
    sd = np.sqrt(np.maximum(np.diagonal(P, axis1=1, axis2=2), 0.0))
    return RobotEstimate(
        name=m.name, number=m.number, start=s.how, started=tl.start + round(s.t * 1e9), t=t, x=x[:, :POSE],
        P=P[:, :POSE, :POSE], states={n: x[:, c] for c, n in enumerate(names)},
        sigmas={n: sd[:, c] for c, n in enumerate(names)}, odometry=_odometry(m, s, t, done.t[k]), truth=m.truth,
        score=_scored([_errors(tl, i, s, done)]),
        alone=_scored([_errors(tl, i, s, alone)]) if alone is not None else None,
    )  # fmt: skip


def _odometry(m: Mate, s: Start, t_ns: Ints, t: Floats) -> Trajectory:
    """Where odometry alone would have it, from the same start."""
    here, way = own_place(m, np.array([s.t]))[0], own_place(m, t)
    turned = s.pose[2] - here[2]
    d = way[:, :2] - here[:2]
    polar = np.column_stack([np.hypot(*d.T), np.arctan2(d[:, 1], d[:, 0])])
    p = seen_at(np.tile([*s.pose[:2], turned], (t.size, 1)), polar)
    flat = np.zeros(t.size)
    q = rpy_to_quats(np.column_stack([flat, flat, wrap_all(way[:, 2] + turned)]))
    return Trajectory(t=t_ns, p=np.column_stack([p, flat]), q=q, name=f"{m.name} odometry")


def _errors(tl: TeamLog, i: int, s: Start, done: TeamEstimate) -> tuple[Floats, Floats]:
    """Errors (n, 3) of the pose against ground truth, and their covariances."""
    m = tl.mates[i]
    k = np.flatnonzero(done.t >= s.t)
    if m.truth is None:
        return np.zeros((0, 3)), np.zeros((0, 3, 3))
    true, good = truth_at(m.truth, tl.start + np.round(done.t[k] * 1e9).astype(np.int64))
    k, true = k[good], true[good]
    e = done.x[m.name][k, :POSE] - true
    e[:, 2] = wrap_all(e[:, 2])
    return e, done.P[m.name][k, :POSE, :POSE]


def _together(tl: TeamLog, starts: Mapping[int, Start], done: TeamEstimate | None) -> Score | None:
    return _scored([_errors(tl, i, s, done) for i, s in starts.items()]) if done is not None else None


def _scored(parts: Sequence[tuple[Floats, Floats]]) -> Score | None:
    e, P = np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts])
    if not len(e):
        return None
    off, nees = np.hypot(e[:, 0], e[:, 1]), chi_square(e, P)
    low, high = average_bounds(POSE, 1, probability=0.95)
    return Score(
        n=len(e), rmse=float(np.sqrt(np.mean(off**2))), largest=float(off.max()),
        heading=float(np.sqrt(np.mean(e[:, 2] ** 2))), nees=float(nees.mean() / POSE),
        inside=float(np.mean((nees >= low) & (nees <= high))),
    )  # fmt: skip


def _silent(what: str, share: float) -> None:
    pass
