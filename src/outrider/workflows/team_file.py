"""`outrider fuse` of a recording of several robots: the log in, a folder with the team's run out."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import chdtri

from outrider.data import EventLog
from outrider.data.team_run import CODES, RobotEstimate, Score, Sighting, TeamRun
from outrider.errors import ExitCode
from outrider.io.mrclam import write_mrclam
from outrider.io.registry import read_log
from outrider.io.robots import of_robot
from outrider.io.team_runs import ERRORS, SCHEMA, TRACKS, ensure_free, team_folder, write_team
from outrider.models.motion import LAYOUTS, Motion
from outrider.sim.barcodes import BarcodeTeam, barcode_log
from outrider.typing import Bools, Floats
from outrider.workflows.config import FuseConfig, TeamSection
from outrider.workflows.fuse_file import Input
from outrider.workflows.team import fuse_team_log
from outrider.workflows.team_records import truth_at

Progress = Callable[[str, float], None]
GOOD_NEES = 3.0  # per degree of freedom: beyond, the team does not know how wrong it is
DOF = 2  # of a sighting: range and bearing
BOUND = float(chdtri(DOF, 0.05))  # of its NIS
UNTOLD = 0.99  # of its first deviation: what is left of it if nothing was learnt
POSE = LAYOUTS[Motion.ODOMETRIC].names[:3]
LOST = ("could not be read", "nobody can recognise", "no landmark is known")  # in notes of the reader: much is missing


def fuse_team_file(
    source: Input,
    output: Path,
    config: FuseConfig,
    *,
    force: bool = False,
    report: bool = True,
    progress: Progress | None = None,
) -> tuple[TeamRun, dict[str, Any]]:
    """Read, fuse and write a team's folder, complete or not at all; the run and its summary.

    report : whether pictures are drawn. Raises as `fuse_team_log`, and `OutputExistsError` before any work is done.
    """
    ensure_free(output, force=force)
    tell = progress or _silent

    def of_files(done: int, total: int) -> None:
        tell("reading", min(1.0, done / max(total, 1)))

    log = read_log(source.log, topics=source.topics, start_s=source.start_s, end_s=source.end_s, progress=of_files)
    tell("fusing", 0.0)
    run = fuse_team_log(log, config if source.robot is None else _only(log, config, source.robot), progress=progress)
    document = summarise(run)
    with team_folder(output, force=force) as part:
        _write(run, document, part, tell, report=report)
    return run, document


def _only(log: EventLog, config: FuseConfig, robot: str) -> FuseConfig:
    """The configuration with everybody else left out."""
    of_robot(log, robot)  # refuses one that is not there
    others = tuple(sorted({s.robot for s in log} - {robot}))
    return config.model_copy(update={"team": (config.team or TeamSection()).model_copy(update={"without": others})})


def demo_team(
    output: Path, *, seed: int = 1, force: bool = False, progress: Progress | None = None
) -> tuple[TeamRun, dict[str, Any]]:
    """Simulate five robots of which the first sees landmarks, write their log as text files, read and fuse it; one
    folder for all, which `outrider fuse` opens again."""
    ensure_free(output, force=force)
    tell = progress or _silent
    tell("simulating", 0.0)
    log, truth = barcode_log(BarcodeTeam(seers=1), seed)
    with team_folder(output, force=force) as part:
        write_mrclam(log, truth, part)
        read = read_log(part)
        tell("fusing", 0.0)
        run = fuse_team_log(
            replace(read, path=str(output)), FuseConfig(seed=seed, team=TeamSection()), progress=progress
        )
        document = summarise(run)
        _write(run, document, part, tell, report=True)
    return run, document


def _write(run: TeamRun, document: dict[str, Any], folder: Path, tell: Progress, *, report: bool) -> None:
    if report:
        tell("pictures", 0.0)
        _draw(run, folder)
    tell("writing", 0.0)
    write_team(run, folder, document)


def _draw(run: TeamRun, folder: Path) -> None:
    from outrider.plot import save_png  # imports matplotlib
    from outrider.plot.teams import errors_figure, tracks_figure

    save_png(tracks_figure(run), folder / TRACKS)
    errors = _errors(run)
    if errors:
        save_png(errors_figure(run, errors), folder / ERRORS)


def _errors(run: TeamRun) -> dict[str, tuple[Floats, Floats, Floats]]:
    out: dict[str, tuple[Floats, Floats, Floats]] = {}
    for r in run.robots:
        if r.truth is None:
            continue
        true, good = truth_at(r.truth, r.t)
        off = np.hypot(*(r.x[:, :2] - true[:, :2])[good].T)
        sigma = np.sqrt(np.maximum(r.P[:, 0, 0] + r.P[:, 1, 1], 0.0))[good]
        out[r.name] = (np.asarray((r.t[good] - run.start) * 1e-9, np.float64), off, sigma)
    return out


def summarise(run: TeamRun) -> dict[str, Any]:
    """Everything about a team's run but its time series."""
    lasted = max((int(r.t[-1]) for r in run.robots if r.t.size), default=run.start) - run.start
    return {
        "schema": SCHEMA,
        "log": {"path": run.log_path, "sha256": run.log_sha256, "notes": list(run.notes)},
        "cooperation": {"name": run.cooperation, "text": run.about},
        "start_ns": run.start,
        "duration_s": lasted * 1e-9,
        "noise": dict(run.noise),
        "team": {"score": _score(run.score), "alone": _score(run.alone), "gain": gain(run.score, run.alone)},
        "robots": {r.name: _robot(run, k) for k, r in enumerate(run.robots)},
        "absent": dict(run.absent),
        "landmarks": {str(k): list(p) for k, p in run.landmarks.items()},
        "sightings": run.sightings.counts(),
        "reasons": {s.name.lower(): s.value for s in Sighting},
        "findings": findings(run),
        "wall_s": run.wall_seconds,
        "compile_s": run.compile_seconds,
        "config": dict(run.config),
        "versions": dict(run.versions),
    }


def _robot(run: TeamRun, k: int) -> dict[str, Any]:
    r = run.robots[k]
    who = run.names.index(r.name)
    end = {"x_m": r.x[-1, 0], "y_m": r.x[-1, 1], "heading_deg": np.degrees(r.x[-1, 2])} if r.t.size else {}
    return {
        "number": r.number,
        "start": {"how": r.start, "t_s": (r.started - run.start) * 1e-9},
        "end": {name: float(v) for name, v in end.items()},
        "sigma_m": float(np.sqrt(np.median(r.P[:, 0, 0] + r.P[:, 1, 1]))) if r.t.size else None,
        "score": _score(r.score),
        "alone": _score(r.alone),
        "gain": gain(r.score, r.alone),
        "sightings": run.sightings.counts(run.sightings.robot == who),
        "saw": _of_whom(run, who),
        "agreement": agreement(run, who),
    }


def _of_whom(run: TeamRun, who: int) -> dict[str, int]:
    """What of a robot's information came from whom: sightings that were fused, by what was seen, and who saw it."""
    s = run.sightings
    used = s.what == CODES[Sighting.USED]
    out = {"landmarks": int((used & (s.robot == who) & np.isin(s.subject, list(run.landmarks))).sum())}
    me = next(r.number for r in run.robots if r.name == run.names[who])
    for r in run.robots:
        if r.number != me:
            other = run.names.index(r.name)
            out[f"of {r.name}"] = int((used & (s.robot == who) & (s.subject == r.number)).sum())
            out[f"by {r.name}"] = int((used & (s.robot == other) & (s.subject == me)).sum())
    return {k: n for k, n in out.items() if n}


def gain(score: Score | None, alone: Score | None) -> float | None:
    """By which share cooperation lowers the RMSE."""
    return 1.0 - score.rmse / alone.rmse if score is not None and alone is not None and alone.rmse > 0.0 else None


def findings(run: TeamRun) -> list[dict[str, str]]:
    """What somebody should know, most severe first: severity and text."""
    out = [
        {"severity": "info" if "configuration" in why else "warning", "text": f"{n} is not part of the team: {why}"}
        for n, why in run.absent.items()
    ]
    for r in run.robots:
        late = (r.started - run.start) * 1e-9
        if late > 30.0:
            out.append({"severity": "warning", "text": f"{r.name} is estimated from {late:.0f} s on: {r.start}"})
        if r.score is not None and r.score.nees > GOOD_NEES:
            text = f"{r.name} is further off than it knows: NEES {r.score.nees:.1f} per degree of freedom"
            out.append({"severity": "warning", "text": text})
    s = run.sightings
    for name in run.names:
        own = s.robot == run.names.index(name)
        if (own & (s.what == CODES[Sighting.DISBELIEVED])).any():
            out.append({"severity": "warning", "text": f"{name} is not believed: {Sighting.DISBELIEVED.value}"})
    if run.cooperation == "naive":
        out.append({"severity": "warning", "text": f"cooperation is naive: {run.about}"})
    wrong = sum(int((s.what == CODES[k]).sum()) for k in (Sighting.UNKNOWN, Sighting.ITSELF, Sighting.GATED))
    if wrong:
        text = f"{wrong} of {s.t.size} sightings refused as misread (barcode of nobody, its own, or outside the gate)"
        out.append({"severity": "info", "text": text})
    out += [{"severity": "warning", "text": text} for text in unmeasured(run)]
    notes = [("warning" if any(word in note for word in LOST) else "info", note) for note in run.notes]
    return sorted(out + [{"severity": s, "text": note} for s, note in notes], key=lambda f: f["severity"] != "warning")


def unmeasured(run: TeamRun) -> list[str]:
    """Robots that saw and were seen by nobody after their start, and errors of odometry of which nothing was learnt."""
    out: list[str] = []
    for r in run.robots:
        names = [n.replace("_", " ") for n, sd in r.sigmas.items() if n not in POSE and 0.0 < UNTOLD * sd[0] <= sd[-1]]
        if not run.sightings.counts(involved(run, r)).get("used"):
            out.append(f"{r.name} is estimated from odometry only: nobody saw it, and it saw nothing, after its start")
        elif names:
            out.append(f"{', '.join(names)} of {r.name}: nothing has measured it; longer logs or turns would")
    return out


def involved(run: TeamRun, r: RobotEstimate) -> Bools:
    """(n,) sightings by a robot, or of it."""
    return (run.sightings.robot == run.names.index(r.name)) | (run.sightings.subject == r.number)


def agreement(run: TeamRun, who: int) -> dict[str, dict[str, float]]:
    """NIS of what a robot saw of landmarks and of each other robot: mean per degree of freedom, 1 is honest, and the
    share below its 95 % bound."""
    s, out = run.sightings, dict[str, dict[str, float]]()
    used = (s.what == CODES[Sighting.USED]) & (s.robot == who) & np.isfinite(s.nis)
    whom = {"landmarks": np.isin(s.subject, list(run.landmarks)), **{r.name: s.subject == r.number for r in run.robots}}
    for name, rows in whom.items():
        nis = s.nis[used & rows]
        if nis.size:
            inside = float(np.mean(nis <= BOUND))
            out[name] = {"used": nis.size, "nis_per_dof": float(nis.mean() / DOF), "in_bound": inside}
    return out


def exit_code(run: TeamRun) -> ExitCode:
    """Whether everybody that was asked for is estimated."""
    asked = [n for n in run.absent if n not in run.config["team"]["without"]] if run.config["team"] else run.absent
    return ExitCode.FAILED_CHECK if asked else ExitCode.OK


def _score(s: Score | None) -> dict[str, float | int] | None:
    return s.as_dict() if s is not None else None


def _silent(what: str, share: float) -> None:
    pass
