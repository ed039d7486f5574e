"""`outrider run`: list scenarios, check one, or run it into a folder."""

import gc
import sys
from pathlib import Path
from typing import Annotated

import typer

from outrider.cli import parse
from outrider.cli.options import AsJson, Debug, Force, Output, Quiet
from outrider.cli.shared import print_json, typed
from outrider.errors import ExitCode, UsageError

ABOUT = "Simulate a scenario: robots, sensors, radio and the world around them."


def run_command(
    name: Annotated[
        str | None, typer.Argument(metavar="FILE|NAME", help="A scenario file (.yaml), or the name of one of ours.")
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
            parser=parse.number("--film", above=0.0, most=1000.0),
            help="Also render film.gif: pictures per simulated second (MuJoCo, OpenGL).",
        ),
    ] = None,
    quiet: Quiet = False,
    debug: Debug = False,
) -> int:
    """Simulate a scenario into a folder: the recording, the truth, a summary and a report.

    Everything that can be refused is refused before anything is simulated.
    """
    if names:
        return _list(json=json)
    if name is None:
        raise UsageError("names no scenario", fix="give a file, or a name that `outrider run --list` shows")
    from outrider.cli.progress import Progress
    from outrider.scenarios.files import load_scenario, resolved, scenario_text, settings_of

    given = settings_of(tuple(settings or ()))
    given |= {key: v for key, v in {"seed": seed, "duration_s": duration}.items() if v is not None}
    scenario, where = load_scenario(name, given)
    folder = output or Path(f"{scenario.name}-run")
    with Progress(quiet=quiet) as progress:
        from outrider.scenarios.followed import promises
        from outrider.scenarios.runs import ensure_free, rehearse, run_scenario

        if dry_run:
            progress("simulating", 0.0)
            for line in promises(rehearse(scenario, where)):
                progress.say(line)
            if json:
                return print_json(resolved(scenario), ExitCode.OK)
            sys.stdout.write(scenario_text(scenario))
            return ExitCode.OK
        ensure_free(folder, force=force)
        gc.freeze()  # what is loaded stays: looking through it again and again takes 0.1 s each time
        done, summary = run_scenario(
            scenario,
            folder,
            where=where,
            force=force,
            report=report,
            film=film or 0.0,
            command=typed(),
            progress=progress,
            say=progress.say,
        )
    if json:
        return print_json({**summary, "folder": str(folder)}, done.exit_code)
    from outrider.cli import simulated

    simulated.run(summary, folder, quiet=quiet)
    return done.exit_code


def _list(*, json: bool) -> int:
    """Which scenarios there are."""
    from outrider.cli import simulated
    from outrider.scenarios.registry import scenarios

    listed = [
        {"name": s.name, "tags": list(s.tags), "about": s.about, "settings": s.knobs} for s in scenarios().values()
    ]
    if json:
        return print_json({"schema": "outrider.scenarios/1", "scenarios": listed}, ExitCode.OK)
    simulated.listing(listed)
    return ExitCode.OK
