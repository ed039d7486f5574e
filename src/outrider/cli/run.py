"""`outrider run`: list scenarios, check one, or run it into a folder."""

import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from outrider.cli.progress import Progress
from outrider.errors import ExitCode, UsageError


def print_scenarios(*, json: bool) -> int:
    """Which scenarios there are."""
    from outrider.cli import simulated
    from outrider.scenarios.registry import scenarios

    listed = [
        {"name": s.name, "tags": list(s.tags), "about": s.about, "settings": s.knobs} for s in scenarios().values()
    ]
    if json:
        return _print_json({"schema": "outrider.scenarios/1", "scenarios": listed}, ExitCode.OK)
    simulated.listing(listed)
    return ExitCode.OK


def run(
    name: str | None,
    *,
    settings: Sequence[str],
    seed: int | None,
    duration: float | None,
    output: Path | None,
    dry_run: bool,
    force: bool,
    report: bool,
    film: float,
    json: bool,
    quiet: bool,
) -> int:
    """Everything that can be refused is refused before anything is simulated."""
    if name is None:
        raise UsageError("names no scenario", fix="give a file, or a name that `outrider run --list` shows")
    from outrider.scenarios.files import load_scenario, resolved, scenario_text, settings_of

    given = settings_of(tuple(settings))
    given |= {key: v for key, v in {"seed": seed, "duration_s": duration}.items() if v is not None}
    scenario, where = load_scenario(name, given)
    folder = output or Path(f"{scenario.name}-run")
    with Progress(quiet=quiet) as progress:
        from outrider.io.files import as_text
        from outrider.scenarios.runs import ensure_free, rehearse, run_scenario

        if dry_run:
            progress("simulating", 0.0)
            rehearse(scenario, where)
            if json:
                return _print_json(resolved(scenario), ExitCode.OK)
            sys.stdout.write(scenario_text(scenario))
            return ExitCode.OK
        ensure_free(folder, force=force)
        typed = [as_text(a) for a in sys.argv]
        command = shlex.join(["outrider", *typed[1:]]) if typed[0].endswith("outrider") else ""
        done, summary = run_scenario(
            scenario, folder, where=where, force=force, report=report, film=film, command=command, progress=progress
        )
    if json:
        return _print_json({**summary, "folder": str(folder)}, done.exit_code)
    from outrider.cli import simulated

    simulated.run(summary, folder, quiet=quiet)
    return done.exit_code


def _print_json(document: dict[str, Any], code: ExitCode) -> int:
    from outrider.io.folders import as_json

    sys.stdout.write(as_json(document) + "\n")
    return code
