"""The main job: a log and a configuration in, a `Run` out."""

import platform
import time
from collections.abc import Callable
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from typing import Final

import numpy as np

from outrider import __version__
from outrider._kernel import compiling
from outrider.data import (
    Datum,
    EventLog,
    Finding,
    Gaussian,
    Kind,
    Outcome,
    Reset,
    Run,
    Stream,
    Trajectory,
    Verdict,
    empty_estimates,
    stream,
)
from outrider.data.run import SILENCE
from outrider.errors import DataError
from outrider.filters.align import Alignment, align
from outrider.filters.channels import Records, records, site_position
from outrider.filters.engine import Events, Filter, Queue, Track, queue, run_batch
from outrider.models.motion import Motion
from outrider.typing import Floats
from outrider.workflows.collect import Collector, accounts
from outrider.workflows.config import FuseConfig
from outrider.workflows.discover import Plan, plan
from outrider.workflows.doctor import prescribed
from outrider.workflows.draft import first_stamp
from outrider.workflows.evidence import with_evidence
from outrider.workflows.findings import in_order_of_harm, judge
from outrider.workflows.findings.contradiction import evened

Progress = Callable[[str, float], None]
THROUGHOUT: Final = 0.99  # share of the time; a second or two go by before a heading shows


def fuse(
    log: EventLog,
    config: FuseConfig | None = None,
    *,
    remarks: tuple[Finding, ...] = (),
    progress: Progress | None = None,
) -> Run:
    """Fuse a log into a trajectory with honest uncertainty, and say what is wrong with the data.

    Parameters
    ----------
    log : as `outrider.io.registry.read_log` gives it; never modified
    config : what the log cannot tell; the defaults suit every log
    remarks : findings of whoever made the configuration, told and counted with those of the run
    progress : called with (what is being done, share done)

    Raises
    ------
    DataError     nothing in the log can be fused
    ConfigError   the configuration names what the log does not have, or contradicts itself
    """
    began = time.perf_counter()
    with compiling() as compiled:
        run = estimate(log, config if config is not None else FuseConfig(), remarks, progress)
    took = compiled()
    return replace(run, wall_seconds=time.perf_counter() - began - took, compile_seconds=took)


def estimate(log: EventLog, cfg: FuseConfig, told: tuple[Finding, ...], progress: Progress | None) -> Run:
    """The job itself, see `fuse`."""
    cfg, remarks = prescribed(log, cfg)
    chosen = evened(plan(log, cfg)) if cfg.preset == "default" else plan(log, cfg)
    start = first_stamp(chosen)
    everything = channel_records(chosen, chosen.whole, cfg, start)
    whole = Collector(chosen.whole, start)
    starts: list[Alignment] = []
    for parts in sessions(everything, chosen.whole):
        q = queue(parts, start, cfg.history_s)
        aligned = align(chosen.whole, q, chosen.spread)
        if aligned is None:
            raise DataError("no usable record", where=log.path, fix="`outrider sources` tells why each was refused")
        starts.append(trusted_start(aligned, cfg))
        forward(chosen.whole, starts[-1], q, whole, cfg, progress, "fusing")
    aligned = starts[0]
    local = run_local(chosen, cfg, start, progress)
    estimates = whole.estimates(chosen.datum)
    run = Run(
        log_path=log.path,
        log_sha256=log.sha256,
        config=cfg.model_dump(mode="json"),
        seed=cfg.seed,
        versions=versions(),
        robot=cfg.robot,
        start=start,
        datum=chosen.datum,
        fused=estimates if len(estimates.pose) else empty_estimates(chosen.whole.layout),
        local=local.estimates() if local is not None else None,
        innovations=whole.innovations(),
        accounts=accounts(chosen.whole, whole, tuple(everything), chosen.log.streams, chosen.roles),
        findings=(),
        resets=deliberate_jumps(whole, chosen.whole, start),
        tracks=tracks(chosen),
        health={
            c.name: np.array(t.states).reshape(-1, 2)
            for c, t in zip(chosen.whole.channels, whole.tallies, strict=True)
            if t.states and not c.scored
        },
    )
    before = {f.code for f in remarks} & {"wheel-scale"}  # by the whole path: better than by the state of a filter
    judged = (f for f in judge(run, chosen, aligned) if f.code not in before)
    findings = in_order_of_harm((*told, *remarks, *judged, *log_notes(log)))
    findings = with_evidence(findings, log, chosen, run)
    return replace(run, findings=findings, outcome=outcome(run, findings, aligned, chosen))


def channel_records(chosen: Plan, f: Filter, cfg: FuseConfig, start: int) -> list[Records]:
    """Records of every channel, with those withheld on request marked so."""
    out: list[Records] = []
    for c in f.channels:
        part = records(c, chosen.log.streams[c.stream], chosen.verdicts[c.stream], chosen.datum)
        held = np.zeros(part.t.size, np.bool_)
        if c.stream in cfg.withhold:
            held |= part.row % cfg.withhold[c.stream] != 0
        for begin, end in cfg.outages_s.get(c.stream, ()):
            t = (part.t - start) * 1e-9
            held |= (t >= begin) & (t < end)
        part.flag[held & (part.flag == Verdict.USED)] = Verdict.WITHHELD
        out.append(part)
    return out


def sessions(parts: list[Records], f: Filter) -> list[list[Records]]:
    """The records, parted where nothing usable came for `SILENCE`: nobody knows where a robot has been meanwhile.

    Only before a part that tells its own position; without one the old estimate is better than none.
    """
    stamps = np.sort(np.concatenate([p.t[p.flag <= Verdict.WITHHELD] for p in parts]))
    begins = stamps[1:][np.diff(stamps) > SILENCE * 1e9]
    ends = np.append(begins, np.iinfo(np.int64).max)[1:]

    def placed(begin: int, end: int) -> bool:
        sources = (p for p, c in zip(parts, f.channels, strict=True) if c.reset[1] and not c.scored)
        return any(((p.flag == Verdict.USED) & (p.t >= begin) & (p.t < end)).any() for p in sources)

    cuts = [b for b, e in zip(begins, ends, strict=True) if placed(b, e)]
    if not cuts:
        return [parts]
    return [[p.select(np.searchsorted(cuts, p.t, side="right") == k) for p in parts] for k in range(len(cuts) + 1)]


def trusted_start(a: Alignment, cfg: FuseConfig) -> Alignment:
    """robot_localization starts at the origin and is sure of it."""
    if cfg.preset != "robot_localization":
        return a
    P = a.prior.P.copy()
    s = a.prior.layout.error("position")
    P[s, s] = 1e-9 * np.eye(3)
    return replace(a, prior=Gaussian(a.prior.x, P, a.prior.layout))


def forward(
    f: Filter, a: Alignment, q: Queue, sink: Collector, cfg: FuseConfig, progress: Progress | None, what: str
) -> None:
    """Run the batch driver, reporting progress; events before the alignment's start are marked."""
    before_start(q, a.t_start)

    def report(first: int, ev: Events, out: Floats, track: Track) -> None:
        sink(first, ev, out, track)
        if progress is not None:
            progress(what, min(1.0, (first + ev.t.size) / max(len(q), 1)))

    run_batch(f, a.prior, a.t_start, q, report, period=cfg.output_period_s)


def before_start(q: Queue, t_start: float) -> None:
    """Mark usable records from before the start as not used for lack of a start."""
    first = q.t0 + int(t_start * 1e9)
    for part in q.parts:
        early = (part.t < first) & (part.flag <= Verdict.WITHHELD)
        part.flag[early] = Verdict.NOT_ALIGNED


def run_local(chosen: Plan, cfg: FuseConfig, start: int, progress: Progress | None) -> Collector | None:
    """The odom frame: the same vehicle with wheels and IMU only, from the origin."""
    if chosen.local is None:
        return None
    q = queue(channel_records(chosen, chosen.local, cfg, start), start, cfg.history_s)
    aligned = align(chosen.local, q, chosen.spread)
    if aligned is None:
        return None
    collector = Collector(chosen.local, start)
    forward(chosen.local, aligned, q, collector, cfg, progress, "local estimate")
    return collector


def deliberate_jumps(whole: Collector, f: Filter, start: int) -> tuple[Reset, ...]:
    """What the collector saw of resets, with their reason."""
    why = "it disagreed steadily and nothing else contradicted it"
    return tuple(
        Reset(t=start + round(t * 1e9), source=f.channels[c].name, state="position", delta=delta, reason=why)
        for t, c, delta in whole.resets
    )


def tracks(chosen: Plan) -> dict[str, Trajectory]:
    """What each source alone says about the path, in the site frame (odometry: from its own origin)."""
    out: dict[str, Trajectory] = {}
    for s in chosen.log:
        part = s.select(chosen.verdicts[s.name] == Verdict.USED)
        if s.kind in (Kind.GNSS, Kind.POSITION, Kind.POSE, Kind.ODOMETRY_POSE, Kind.ESTIMATE) and len(part) > 1:
            path = track(part, places(part, chosen.datum), chosen.datum)
            if len(path) > 1:
                out[s.name] = path
    return out


def places(s: Stream, datum: Datum | None) -> Floats:
    """(n, 3) positions in the site frame [m], NaN where there is none."""
    if s.kind is Kind.GNSS:
        return site_position(s, datum)
    if datum is None or "lat" not in s.extra:
        return s.z[:, :3]
    lat, lon, alt = s.extra["lat"], s.extra["lon"], s.extra.get("alt", np.full(len(s), np.nan))
    null = (lat == 0.0) & (lon == 0.0)
    z = np.column_stack([np.where(null, np.nan, lat), lon, alt])
    return site_position(stream(s.name, Kind.GNSS, s.t, z), datum)


def track(s: Stream, p: Floats, datum: Datum | None) -> Trajectory:
    """A stream of positions as a trajectory; records that step back in time or have no place are left out."""
    placed = np.flatnonzero(np.isfinite(p[:, :2]).all(axis=1))
    s, p = s.select(placed), p[placed]
    newest = np.maximum.accumulate(s.t)
    keep = np.concatenate([[True], s.t[1:] > newest[:-1]])[: len(s)]
    q = s.z[:, 3:7] if s.z.shape[1] >= 7 else np.full((len(s), 4), np.nan)
    q = np.where(np.abs(np.linalg.norm(q, axis=1, keepdims=True) - 1) < 0.1, q, np.nan)
    valid = s.extra["valid"][keep] > 0 if "valid" in s.extra else np.zeros(0, np.bool_)
    p = np.where(np.isfinite(p), p, 0.0)[keep]  # a position without a height lies on the datum's
    return Trajectory(t=s.t[keep], p=p, q=q[keep], valid=valid, datum=datum, name=s.name)


def log_notes(log: EventLog) -> list[Finding]:
    """What the reader had to say."""
    return [Finding(severity="info", code="reader", text=note) for note in log.notes]


def outcome(run: Run, findings: tuple[Finding, ...], aligned: Alignment, chosen: Plan) -> Outcome:
    """How it ended."""
    if not len(run.fused.pose) or not any(a.used for a in run.accounts):
        return Outcome.NO_DATA
    if any(f.code == "diverged" for f in findings):
        return Outcome.DIVERGED
    if chosen.datum is not None and not aligned.heading_known and "heading-unobservable" in {f.code for f in findings}:
        return Outcome.NEVER_ALIGNED
    if any(f.code in ("not-credible", "contradiction") for f in findings):
        return Outcome.NOT_CREDIBLE
    if any(f.severity == "error" for f in findings):
        return Outcome.FLAWED
    if any(f.severity != "info" for f in findings):
        return Outcome.DEGRADED
    return Outcome.OK if throughout(run, chosen) else Outcome.PARTLY_VALID


def throughout(run: Run, chosen: Plan) -> bool:
    """Whether position and heading, as far as there is one, are valid nearly all the time."""
    position, _, heading = run.valid_shares
    return position >= THROUGHOUT and (chosen.whole.motion is Motion.FOLLOWER or heading >= THROUGHOUT)


def versions() -> dict[str, str]:
    """Of everything that the numbers may depend on."""
    out = {"outrider": __version__, "python": platform.python_version(), "machine": platform.machine()}
    for name in ("numpy", "numba", "scipy", "pymap3d", "pygeomag", "rosbags", "pyulog", "pymavlink"):
        try:
            out[name] = version(name)
        except PackageNotFoundError:
            out[name] = "absent"
    return out


__all__ = ["Progress", "fuse"]
