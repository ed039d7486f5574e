"""`outrider eval`: how good estimates are, against a reference or through outages."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from outrider.cli import parse
from outrider.cli.options import AsJson, ConfigFile, Debug, Force, Output, Quiet
from outrider.cli.output import tell
from outrider.cli.shared import hush_matplotlib, print_json
from outrider.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from outrider.workflows.evaluate import Rules

ABOUT = "Score trajectories against a reference, or a recording through outages of a source."


def eval_command(
    paths: Annotated[
        list[Path],
        typer.Argument(
            metavar="ESTIMATE... REFERENCE",
            parser=parse.file("ESTIMATE"),
            help="Run folders, TUM, CSV, Parquet, or logs with an estimate; the last one is taken as true. "
            "With --outages: LOG [REFERENCE].",
        ),
    ],
    align: Annotated[
        str,
        typer.Option("--align", metavar="MOTION", help="none, yaw, se2, se3 or sim3: taken out before errors count."),
    ] = "none",
    span: Annotated[
        str, typer.Option("--span", metavar="N", help="Over which drift is counted: 10s, 100m, or 5r (records).")
    ] = "10s",
    chained: Annotated[
        bool, typer.Option("--chained", help="Each span begins where the last one ended, not at every record.")
    ] = False,
    max_gap: Annotated[
        float,
        typer.Option(
            "--max-gap",
            metavar="S",
            parser=parse.number("--max-gap", above=0),
            help="Longest gap of the estimate to interpolate over.",
        ),
    ] = 0.5,
    nearest: Annotated[
        float | None,
        typer.Option(
            "--nearest",
            metavar="S",
            parser=parse.number("--nearest", least=0),
            help="Pair with the nearest pose within so many seconds, instead of interpolating.",
        ),
    ] = None,
    topic: Annotated[
        str | None,
        typer.Option("--topic", metavar="NAME", parser=parse.name("--topic"), help="Which estimate of a log."),
    ] = None,
    outages: Annotated[
        str | None,
        typer.Option(
            "--outages",
            metavar="SOURCE=S",
            help="Fuse LOG again and again, each time with S seconds of SOURCE withheld.",
        ),
    ] = None,
    every: Annotated[
        float,
        typer.Option(
            "--every", metavar="S", parser=parse.number("--every", above=0), help="Seconds from outage to outage."
        ),
    ] = 10.0,
    config: ConfigFile = None,
    form: Annotated[
        str, typer.Option("--format", metavar="FORMAT", help="What to print: text, csv, latex or json.")
    ] = "text",
    json: AsJson = False,
    max_rmse: Annotated[
        float | None,
        typer.Option(
            "--max-rmse",
            metavar="M",
            parser=parse.number("--max-rmse", least=0),
            help="Exit with 1 if a horizontal RMSE is larger (of outages: the median).",
        ),
    ] = None,
    output: Output = None,
    force: Force = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> int:
    """Score estimates: association in time, then errors; nothing is aligned unless asked for."""
    from outrider.cli import scores
    from outrider.eval import Span
    from outrider.workflows.evaluate import Rules, alignment_named, evaluate_files

    form = scores.form_of("json" if json else form)
    rules = Rules(
        max_gap_s=max_gap, nearest_s=nearest, alignment=alignment_named(align), span=Span.parse(span, chained=chained)
    )
    hush_matplotlib()
    if outages is not None:
        return _outages(paths, outages, every, config, rules, form, max_rmse, output=output, force=force, quiet=quiet)
    if len(paths) < 2:
        raise UsageError("names no reference", fix="outrider eval ESTIMATE... REFERENCE; or a log and --outages")
    *estimates, reference = paths
    done = evaluate_files(estimates, reference, rules, topic=topic, output=output, force=force)
    for path in estimates:
        if path.samefile(reference):
            tell(f"outrider: {path}: compared with itself, so nothing differs\n")
    code = ExitCode.OK if done.within(max_rmse) else ExitCode.FAILED_CHECK
    if form == "json":
        return print_json(done.as_dict(), code)
    scores.evaluation(done, form, max_rmse, output)
    return code


def _outages(
    paths: list[Path],
    wanted: str,
    every: float,
    config: Path | None,
    rules: "Rules",
    form: str,
    max_rmse: float | None,
    *,
    output: Path | None,
    force: bool,
    quiet: bool,
) -> int:
    from outrider.cli import scores
    from outrider.cli.progress import Progress
    from outrider.workflows.settings import load_config

    source, length = parse.seconds_of(wanted, "--outages")
    if len(paths) > 2:
        raise UsageError(f"{len(paths)} files with --outages", fix="a log, and a reference if there is one")
    settings = load_config(config)
    with Progress(quiet=quiet) as progress:
        from outrider.workflows.fuse_file import Input
        from outrider.workflows.outages import outage_protocol

        done = outage_protocol(
            Input(log=paths[0]), settings, source, length, every_s=every, reference=paths[1] if paths[1:] else None,
            rules=rules, output=output, force=force, progress=progress,
        )  # fmt: skip
    code = ExitCode.OK if max_rmse is None or done.score.median <= max_rmse else ExitCode.FAILED_CHECK
    if form == "json":
        return print_json(done.as_dict(), code)
    scores.outages(done, form, max_rmse, output)
    return code
