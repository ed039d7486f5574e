"""The commands and their options. Each parses, calls one workflow, prints what came of it and returns an exit code."""

import shlex
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from outrider.cli import mapping as maps
from outrider.cli import parse
from outrider.cli.options import (
    FOLDER,
    AsJson,
    ConfigFile,
    Debug,
    End,
    Force,
    LogFile,
    Mapping,
    OneRobot,
    Output,
    Quiet,
    Start,
    Topics,
)
from outrider.cli.output import tell
from outrider.errors import ExitCode, UsageError

app = typer.Typer(
    help="Fuse, diagnose and evaluate the logs of ground and aerial robots.",
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # plain help starts in half the time
    no_args_is_help=True,
)


def _version(wanted: bool) -> None:
    if wanted:
        from outrider.cli.versions import version_text

        typer.echo(version_text())
        raise typer.Exit


@app.callback()
def outrider(
    version: Annotated[
        bool,
        typer.Option("--version", help="Print the versions that results depend on.", callback=_version, is_eager=True),
    ] = False,
) -> None:
    """Fuse, diagnose and evaluate the logs of ground and aerial robots."""


@app.command(short_help="Fuse a recording, and say what is wrong with the data.")
def fuse(
    log: LogFile,
    config: ConfigFile = None,
    output: Output = None,
    force: Force = False,
    json: AsJson = False,
    seed: Annotated[
        int | None,
        typer.Option("--seed", metavar="N", parser=parse.whole("--seed"), help="Seed of everything random."),
    ] = None,
    preset: Annotated[
        str | None, typer.Option("--preset", metavar="NAME", help="default, amr2025 or robot_localization.")
    ] = None,
    mount: Annotated[
        list[str] | None,
        typer.Option(
            "--mount", metavar="FRAME=x,y,z,r,p,y", help="Where a sensor frame sits: metres, degrees; may be repeated."
        ),
    ] = None,
    datum: Annotated[
        str | None, typer.Option("--datum", metavar="LAT,LON,ALT", help="Origin of the site: degrees, metres.")
    ] = None,
    withhold: Annotated[
        list[str] | None,
        typer.Option("--withhold", metavar="SOURCE=N", help="Fuse every N-th record of a source, score the others."),
    ] = None,
    topic: Topics = None,
    start: Start = None,
    end: End = None,
    mapping: Mapping = None,
    robot: OneRobot = None,
    report: Annotated[bool, typer.Option("--report/--no-report", help="Write report.html.")] = True,
    quiet: Quiet = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Also tell where records went, and every remark.")
    ] = False,
    debug: Debug = False,
) -> int:
    """Fuse a recording into a trajectory, and say what is wrong with the data."""
    overrides = parse.overrides(robot=robot, seed=seed, preset=preset, mounts=mount, datum=datum, withhold=withhold)
    from outrider.workflows.settings import load_config

    settings = load_config(config, overrides)
    from outrider.cli.progress import Progress
    from outrider.io.files import as_text
    from outrider.io.registry import check_input
    from outrider.io.runs import ensure_free

    check_input(log, start_s=start, end_s=end, mapping=mapping)  # before the compiler is loaded
    folder = output or Path(f"{log.resolve().stem}-run")
    _hush_matplotlib()
    ensure_free(folder, force=force)
    with Progress(quiet=quiet) as progress:
        from outrider.workflows.fuse_file import Input, document, fuse_file

        source = Input(log=log, topics=topic, start_s=start, end_s=end, mapping=mapping, robot=robot)
        typed = [as_text(a) for a in sys.argv]
        command = shlex.join(["outrider", *typed[1:]]) if typed[0].endswith("outrider") else ""
        run = fuse_file(source, folder, settings, force=force, report=report, command=command, progress=progress)
    from outrider.cli import render
    from outrider.workflows.summary import exit_code

    summary = document(run, source)
    if json:
        return _print_json({**summary, "folder": str(folder)}, exit_code(run))
    render.run(summary, folder, quiet=quiet, verbose=verbose)
    return exit_code(run)


@app.command(short_help="Compare a trajectory with a reference.")
def compare(
    estimate: Annotated[
        Path,
        typer.Argument(
            metavar="ESTIMATE",
            parser=parse.file("ESTIMATE"),
            help="Run folder, TUM, CSV, Parquet, or a log with an estimate.",
        ),
    ],
    reference: Annotated[
        Path,
        typer.Argument(metavar="REFERENCE", parser=parse.file("REFERENCE"), help="The same, taken as true."),
    ],
    max_gap: Annotated[
        float,
        typer.Option(
            "--max-gap",
            metavar="S",
            parser=parse.number("--max-gap", above=0),
            help="Longest gap of the estimate to interpolate over.",
        ),
    ] = 0.5,
    align: Annotated[
        str, typer.Option("--align", metavar="MOTION", help="none, yaw, se2 or se3: taken out before errors count.")
    ] = "none",
    topic: Annotated[
        str | None,
        typer.Option("--topic", metavar="NAME", parser=parse.name("--topic"), help="Which estimate of a log."),
    ] = None,
    output: Output = None,
    force: Force = False,
    json: AsJson = False,
    max_rmse: Annotated[
        float | None,
        typer.Option(
            "--max-rmse",
            metavar="M",
            parser=parse.number("--max-rmse", least=0),
            help="Exit with 1 if the horizontal RMSE is larger.",
        ),
    ] = None,
    debug: Debug = False,
) -> int:
    """Compare a trajectory with a reference: time association, then errors; no alignment unless asked for."""
    from outrider.cli import render
    from outrider.workflows.compare import compare_files

    _hush_matplotlib()
    done = compare_files(estimate, reference, max_gap_s=max_gap, align=align, topic=topic, output=output, force=force)
    if estimate.samefile(reference):
        tell(f"outrider: {estimate}: compared with itself, so nothing differs\n")
    code = ExitCode.OK if done.within(max_rmse) else ExitCode.FAILED_CHECK
    if json:
        return _print_json(done.as_dict(), code)
    render.comparison(done, max_rmse, output)
    return code


@app.command(short_help="Simulate, record, fuse and compare a patrol: start here.")
def demo(
    output: Annotated[Path, FOLDER] = Path("outrider-demo"),
    force: Force = False,
    seed: Annotated[
        int, typer.Option("--seed", metavar="N", parser=parse.whole("--seed"), help="Another patrol with other noise.")
    ] = 1,
    json: AsJson = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> int:
    """Record a simulated patrol with the faults of the field, fuse it, and compare with what really happened."""
    from outrider.cli.progress import Progress

    _hush_matplotlib()
    with Progress(quiet=quiet) as progress:
        from outrider.workflows.demo import run_demo

        done = run_demo(output, seed=seed, force=force, progress=progress)
    from outrider.cli import render

    if json:
        return _print_json(
            {**done.summary, "comparison": done.comparison.as_dict(), "folder": str(output)}, done.exit_code
        )
    render.demo(done, output, quiet=quiet)
    return done.exit_code


@app.command(short_help="List what a recording holds and how it would be used.")
def sources(
    log: LogFile,
    config: ConfigFile = None,
    json: AsJson = False,
    topic: Topics = None,
    start: Start = None,
    end: End = None,
    mapping: Mapping = None,
    robot: OneRobot = None,
    quiet: Quiet = False,
    debug: Debug = False,
) -> int:
    """List what a recording holds, and what each source would be used for."""
    from outrider.workflows.settings import load_config

    settings = load_config(config)
    from outrider.cli.progress import Progress

    with Progress(quiet=quiet) as progress:
        from outrider.workflows.fuse_file import Input
        from outrider.workflows.sources import list_sources

        source = Input(log=log, topics=topic, start_s=start, end_s=end, mapping=mapping, robot=robot)
        listing = list_sources(source.read(settings.robot, progress), settings)
    if json:
        return _print_json(listing.as_dict(), ExitCode.OK)
    from outrider.cli import render

    render.sources(listing)
    return ExitCode.OK


@app.command("run", short_help="Simulate a scenario: robots, sensors, radio and the world around them.")
def run_command(
    name: Annotated[
        str | None, typer.Argument(metavar="[FILE|NAME]", help="A scenario file (.yaml), or the name of one of ours.")
    ] = None,
    names: Annotated[bool, typer.Option("--list", help="Say which scenarios there are.")] = False,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="A.B=VALUE", help="Instead of what the scenario says; may be repeated."),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option("--seed", metavar="N", parser=parse.whole("--seed"), help="Seed of everything random."),
    ] = None,
    duration: Annotated[
        float | None,
        typer.Option(
            "--duration",
            metavar="S",
            parser=parse.number("--duration", above=0.0),
            help="At most so many simulated seconds.",
        ),
    ] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Only check it, and print the whole scenario with every default.")
    ] = False,
    output: Output = None,
    force: Force = False,
    json: AsJson = False,
    report: Annotated[bool, typer.Option("--report/--no-report", help="Write report.html.")] = True,
    film: Annotated[
        float | None,
        typer.Option(
            "--film",
            metavar="HZ",
            parser=parse.number("--film", above=0.0),
            help="Also render film.gif: pictures per simulated second (MuJoCo, OpenGL).",
        ),
    ] = None,
    quiet: Quiet = False,
    debug: Debug = False,
) -> int:
    """Simulate a scenario into a folder: the recording, the truth, a summary and a report."""
    from outrider.cli.run import print_scenarios, run

    if names:
        return print_scenarios(json=json)
    return run(
        name, settings=settings or (), seed=seed, duration=duration, output=output, dry_run=dry_run, force=force,
        report=report, film=film or 0.0, json=json, quiet=quiet,
    )  # fmt: skip


app.command("map", short_help=maps.ABOUT)(maps.map_command)


@app.command(short_help="Show the tables of the papers beside ours.")
def papers(
    name: Annotated[str | None, typer.Argument(metavar="[NAME]", help="Which paper; all if there is none.")] = None,
    names: Annotated[bool, typer.Option("--list", help="Say which papers there are.")] = False,
    form: Annotated[
        str, typer.Option("--format", metavar="FORMAT", help="What to print on stdout: text, html or json.")
    ] = "text",
    seeds: Annotated[
        int | None,
        typer.Option(
            "--seeds",
            metavar="N",
            parser=parse.whole("--seeds", 1),
            help="Runs per case, instead of each experiment's number.",
        ),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            "--workers",
            metavar="N",
            parser=parse.whole("--workers"),
            help="Processes; 0 for none but this one, else all cores.",
        ),
    ] = None,
    trials: Annotated[
        Path | None,
        typer.Option(
            "--trials",
            metavar="DIR",
            parser=parse.file("--trials"),
            help="Keep every run there, and go on with what it holds.",
        ),
    ] = None,
    output: Output = None,
    force: Force = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> int:
    """Show every table and figure of the papers, as printed and ours, with seeds, spread and a verdict."""
    from outrider.cli.papers import print_listing, print_papers

    if names:
        return print_listing(form)
    return print_papers(
        name, form=form, seeds=seeds, workers=workers, trials=trials, output=output, force=force, quiet=quiet
    )


@app.command(short_help="Print the JSON schema of a configuration file.")
def schema(
    what: Annotated[
        str,
        typer.Argument(
            metavar="WHAT", help="fuse: its configuration; scenario: a file of `outrider run`; site: a drawing."
        ),
    ] = "fuse",
    debug: Debug = False,
) -> int:
    """Print the JSON schema of a configuration file, for editors."""
    if what == "scenario":
        from outrider.scenarios.files import schema as schema_of
    elif what == "site":
        from outrider.io.sites import schema as schema_of
    elif what == "fuse":
        from outrider.workflows.settings import schema as schema_of
    else:
        raise UsageError(f"no schema '{what}'", fix="there are: fuse, scenario, site")
    return _print_json(schema_of(), ExitCode.OK)


def _print_json(document: dict[str, Any], code: ExitCode) -> int:
    from outrider.io.folders import as_json

    typer.echo(as_json(document))
    return code


def _hush_matplotlib() -> None:
    """It logs to stderr, at length, where it keeps its fonts if the home folder is read-only."""
    import logging

    logging.getLogger("matplotlib").setLevel(logging.ERROR)
