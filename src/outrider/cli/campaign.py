"""`outrider campaign`: run a scenario or fuse logs many times, look at what came of it, replay one trial."""

import os
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated

import typer

from outrider.cli import parse
from outrider.cli.options import AsJson, Debug, Force, Output, Quiet
from outrider.cli.output import tell
from outrider.cli.shared import hush_matplotlib, print_json, typed
from outrider.errors import ExitCode, InterruptionError, UsageError

ABOUT = "Run a scenario, or fuse logs, many times; report on it; replay one trial."
REPORT, REPLAY = "report", "replay"


def campaign_command(
    what: Annotated[
        str,
        typer.Argument(
            metavar="WHAT",
            help="A scenario (name or .yaml), a folder of logs to fuse; or `report DIR`, `replay DIR TRIAL`.",
        ),
    ],
    folder: Annotated[
        Path | None,
        typer.Argument(metavar="DIR", parser=parse.file("DIR"), help="Of `report` and `replay`: the campaign."),
    ] = None,
    trial: Annotated[
        int | None,
        typer.Argument(metavar="TRIAL", parser=parse.whole("TRIAL"), help="Of `replay`: its number, from 0."),
    ] = None,
    runs: Annotated[
        int | None,
        typer.Option(
            "--runs",
            metavar="N",
            parser=parse.whole("--runs", 1),
            help="Seeds of each case; of ranges, places drawn in them. 20 if not said.",
        ),
    ] = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            "--vary",
            metavar="KEY=...",
            help="a,b,c (each), low:high:points (a grid), low:high (sampled), :log at the end; may be repeated.",
        ),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="A.B=VALUE", help="For all trials, as of `outrider run`; may be repeated."),
    ] = None,
    sampling: Annotated[
        str, typer.Option("--sampling", metavar="HOW", help="Places in ranges: sobol, lhs or random.")
    ] = "sobol",
    seed: Annotated[
        int, typer.Option("--seed", metavar="N", parser=parse.whole("--seed"), help="The first seed, and of sampling.")
    ] = 0,
    engine: Annotated[
        str, typer.Option("--engine", metavar="NAME", help="processes on this machine, or dask.")
    ] = "processes",
    workers: Annotated[
        int | None,
        typer.Option(
            "--workers", metavar="N", parser=parse.whole("--workers"), help="Processes; all cores if not said, 0: none."
        ),
    ] = None,
    scheduler: Annotated[
        str, typer.Option("--scheduler", metavar="ADDRESS", help="Of the Dask cluster, tcp://HOST:8786.")
    ] = "",
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the folder: only what is missing runs.")] = False,
    values: Annotated[
        list[str] | None,
        typer.Option("--value", metavar="NAME", help="Tell this value, by its name or a part of it; may be repeated."),
    ] = None,
    output: Output = None,
    force: Force = False,
    json: AsJson = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> int:
    """Run a scenario, or fuse the logs of a folder, many times; a row per trial is kept as it ends.

    `outrider campaign report DIR` makes tables and plots of what has ended, `outrider campaign replay DIR 317` runs a
    trial again with its full report.
    """
    if what == REPORT and not Path(what).exists():
        from outrider.campaign.report import page_of

        if output is not None:
            raise UsageError("writes its page into the folder of the campaign", where=REPORT, fix="leave out --output")
        at = _named(folder, REPORT)
        return _report(at, page_of(at, values or ()), values or (), json=json, quiet=quiet)
    if what == REPLAY and not Path(what).exists():
        if trial is None:
            raise UsageError("names no trial", where=REPLAY, fix="outrider campaign replay DIR NUMBER")
        return _replay(_named(folder, REPLAY), trial, output, force=force, quiet=quiet)
    if folder is not None:
        raise UsageError(f"{what} takes no second name", where=str(folder), fix="-o DIR names the folder for results")
    if engine not in ("processes", "dask") or (engine == "dask") != bool(scheduler):
        fix = "--engine processes, or --engine dask --scheduler tcp://HOST:8786"
        raise UsageError("no such engine", where=f"--engine {engine}", fix=fix)
    from outrider.campaign.report import page_of
    from outrider.campaign.vary import Sampling, axis_of

    known = [s.value for s in Sampling]
    if sampling not in known:
        raise UsageError("no such sampling", where=f"--sampling {sampling}", fix=f"one of {', '.join(known)}")
    axes = [axis_of(text) for text in vary or ()]
    from outrider.campaign.studies import run_study, study_of
    from outrider.cli.progress import Progress
    from outrider.scenarios.files import settings_of

    given = settings_of(tuple(settings or ()))
    study = study_of(what, axes, 20 if runs is None else runs, Sampling(sampling), seed, given)
    into = output or Path(f"{Path(what).resolve().stem if '/' in what or '.' in what else what}-campaign")
    if resume:
        _tell_damage(into)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    with Progress(quiet=quiet) as progress:
        try:
            done = run_study(
                study, into, workers=cores if workers is None else workers, scheduler=scheduler, resume=resume,
                progress=_with_time_left(progress),
            )  # fmt: skip
        except KeyboardInterrupt as e:
            fix = f"go on with --resume -o {into}"
            raise InterruptionError(f"interrupted, {e}; {fix}" if str(e) else f"interrupted; {fix}") from None
    _report(into, page_of(into), values or (), json=json, quiet=quiet)
    return ExitCode.FAILED_CHECK if done.failed else ExitCode.OK


def _tell_damage(folder: Path) -> None:
    """Which lines of a folder that is gone on with hold no row."""
    from outrider.campaign.results import damage
    from outrider.io.trials import MARKER, read_trials

    if (folder / MARKER).exists() and (told := damage(read_trials(folder).damaged, "run again")):
        tell(f"outrider: {folder}: {told}\n")


def _with_time_left(progress: Callable[[str, float], None]) -> Callable[[str, float], None]:
    """Progress that says how long it will still take, from how long the trials of this time took."""
    first: list[tuple[float, float]] = []

    def told(what: str, share: float) -> None:
        now = time.monotonic()
        first.append((now, share)) if not first else None
        began, at = first[0]
        if share > at and now - began > 2.0 and not sys.stderr.isatty():
            left = (now - began) * (1.0 - share) / (share - at)
            what = f"{what}, {left:.0f} s left:"
        progress(what, share)

    return told


def _named(folder: Path | None, verb: str) -> Path:
    if folder is None:
        raise UsageError("names no campaign", where=verb, fix=f"outrider campaign {verb} DIR")
    return folder


def _report(folder: Path, page: Path, values: Sequence[str], *, json: bool, quiet: bool) -> int:
    from outrider.campaign.report import document, write_report
    from outrider.campaign.results import read_results

    hush_matplotlib()
    results = read_results(folder)
    told = document(results, values)
    write_report(results, told, page, command=typed())
    if json:
        return print_json(told, ExitCode.OK)
    from outrider.cli.campaigns import show

    show(told, page, quiet=quiet)
    return ExitCode.OK


def _replay(folder: Path, trial: int, output: Path | None, *, force: bool, quiet: bool) -> int:
    from outrider.campaign.replay import replay

    into = output or folder.parent / f"{folder.name}-{trial}"
    code, sentence = replay(folder, trial, into, force=force, command=typed())
    if not quiet:
        sys.stdout.write(f"trial {trial}: {sentence}\nreport: {into / 'report.html'}\n")
    return code
