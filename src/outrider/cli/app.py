"""The commands and their options. Each parses, calls one workflow, prints what came of it and returns an exit code."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from outrider.cli import calibrate as calibration
from outrider.cli import campaign as campaigns
from outrider.cli import doctor as doctors
from outrider.cli import evaluate as evaluation
from outrider.cli import mapping as maps
from outrider.cli import parse
from outrider.cli import run as scenarios
from outrider.cli import swarm as swarms
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
from outrider.cli.shared import hush_matplotlib, print_json, typed
from outrider.errors import ExitCode, UsageError

app = typer.Typer(
    help="Navigate teams of ground and aerial robots: fuse and diagnose their logs, map, plan, simulate, evaluate.",
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
    settings_given: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="A.B=VALUE", help="A key of the configuration, e.g. team.cooperation=joint; repeatable."
        ),
    ] = None,
    report: Annotated[bool, typer.Option("--report/--no-report", help="Write report.html.")] = True,
    quiet: Quiet = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Also tell where records went, and every remark.")
    ] = False,
    debug: Debug = False,
) -> int:
    """Fuse a recording into a trajectory, and say what is wrong with the data."""
    overrides = parse.overrides(robot=robot, seed=seed, preset=preset, mounts=mount, datum=datum, withhold=withhold)
    from outrider.io.config import merged, settings_of
    from outrider.workflows.settings import load_config

    overrides = merged(settings_of(settings_given or ()), overrides)
    from outrider.io.robot_localization import read_upstream

    upstream = read_upstream(config) if config is not None else None
    settings = load_config(config if upstream is None else None, overrides)
    from outrider.cli.progress import Progress
    from outrider.io.registry import check_input
    from outrider.io.runs import ensure_free

    kind = check_input(log, start_s=start, end_s=end, mapping=mapping)  # before the compiler is loaded
    if kind == "mrclam folder" or (robot is None and settings.team is not None):
        from outrider.cli.teams import fuse_team

        return fuse_team(
            log, settings, output, topics=topic, start=start, end=end, force=force, json=json, report=report,
            quiet=quiet, verbose=verbose, robot=robot,
        )  # fmt: skip
    folder = output or Path(f"{log.resolve().stem}-run")
    hush_matplotlib()
    ensure_free(folder, force=force)
    with Progress(quiet=quiet) as progress:
        from outrider.workflows.fuse_file import Input, document, fuse_file
        from outrider.workflows.upstream import Translator

        source = Input(log=log, topics=topic, start_s=start, end_s=end, mapping=mapping, robot=robot)
        made = settings if upstream is None else Translator(upstream, overrides)
        run = fuse_file(source, folder, made, force=force, report=report, command=typed(), progress=progress)
    from outrider.cli import render
    from outrider.workflows.summary import exit_code

    summary = document(run, source)
    flags = made.rows if isinstance(made, Translator) else ()
    if flags:
        summary["robot_localization"] = [asdict(row) for row in flags]
    if json:
        return print_json({**summary, "folder": str(folder)}, exit_code(run))
    render.run(summary, folder, quiet=quiet, verbose=verbose)
    if flags and not quiet:
        render.flags(flags)
    return exit_code(run)


@app.command(short_help="Simulate, record, fuse and compare a patrol: start here.")
def demo(
    output: Annotated[Path, FOLDER] = Path("outrider-demo"),
    force: Force = False,
    seed: Annotated[
        int, typer.Option("--seed", metavar="N", parser=parse.whole("--seed"), help="Another patrol with other noise.")
    ] = 1,
    team: Annotated[
        bool, typer.Option("--team", help="Instead, five robots that correct one another; one of them sees landmarks.")
    ] = False,
    json: AsJson = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> int:
    """Record a simulated patrol with the faults of the field, fuse it, and compare with what really happened."""
    if team:
        from outrider.cli.teams import demo_team

        return demo_team(output, seed=seed, force=force, json=json, quiet=quiet)
    from outrider.cli.progress import Progress

    hush_matplotlib()
    with Progress(quiet=quiet) as progress:
        from outrider.workflows.demo import run_demo

        done = run_demo(output, seed=seed, force=force, progress=progress)
    from outrider.cli import render

    if json:
        return print_json(
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
        return print_json(listing.as_dict(), ExitCode.OK)
    from outrider.cli import render

    render.sources(listing)
    return ExitCode.OK


app.command("doctor", short_help=doctors.ABOUT)(doctors.doctor_command)
app.command("calibrate", short_help=calibration.ABOUT)(calibration.calibrate_command)
app.command("eval", short_help=evaluation.ABOUT)(evaluation.eval_command)
app.command("run", short_help=scenarios.ABOUT)(scenarios.run_command)
app.command("campaign", short_help=campaigns.ABOUT)(campaigns.campaign_command)
app.command("swarm", short_help=swarms.ABOUT)(swarms.swarm_command)
app.command("map", short_help=maps.ABOUT)(maps.map_command)


@app.command(short_help="Show the tables of the papers beside ours.")
def papers(
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="Which paper; all if there is none.")] = None,
    names: Annotated[bool, typer.Option("--list", help="Say which papers there are.")] = False,
    form: Annotated[
        str, typer.Option("--format", metavar="FORMAT", help="What to print on stdout: text, html or json.")
    ] = "text",
    seeds: Annotated[
        int | None,
        typer.Option(
            "--seeds",
            metavar="N",
            parser=parse.whole("--seeds"),
            help="Runs per case, instead of each experiment's number; 0 simulates nothing.",
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
            parser=parse.written("--trials"),
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
    return print_json(schema_of(), ExitCode.OK)
