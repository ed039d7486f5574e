"""`outrider swarm`: many drones swap places, or follow one another, into a folder."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from outrider.cli import parse
from outrider.cli.options import AsJson, Debug, Force, Output, Quiet
from outrider.cli.shared import hush_matplotlib, print_json, typed
from outrider.errors import ExitCode, UsageError

SLOW_S = 20.0  # of computing, from which on a user is told beforehand
ABOUT = "Fly many drones at once: swaps of places, a doorway, a column on a trail."


def swarm_command(
    task: Annotated[
        str, typer.Argument(metavar="TASK", help="circle, head-on, crossing, doorway, column, crossed, convoy.")
    ],
    drones: Annotated[
        int, typer.Option("--drones", metavar="N", parser=parse.whole("--drones"), help="The leader counts.")
    ] = 16,
    duration: Annotated[
        float | None,
        typer.Option(
            "--duration",
            metavar="S",
            parser=parse.number("--duration", above=0.0),
            help="Of a column (600); of others at most.",
        ),
    ] = None,
    seed: Annotated[
        int, typer.Option("--seed", metavar="N", parser=parse.whole("--seed"), help="Seed of everything random.")
    ] = 0,
    loss: Annotated[
        float, typer.Option("--loss", metavar="SHARE", parser=parse.number("--loss"), help="Of messages that are lost.")
    ] = 0.2,
    late: Annotated[
        float, typer.Option("--late", metavar="S", parser=parse.number("--late"), help="How late a message is at most.")
    ] = 0.2,
    separation: Annotated[
        float,
        typer.Option(
            "--separation", metavar="M", parser=parse.number("--separation"), help="Between two, never to be less."
        ),
    ] = 1.5,
    silent: Annotated[
        list[str] | None,
        typer.Option("--silent", metavar="DRONE,FROM,TO", help="A follower whose radio is dead; may be repeated."),
    ] = None,
    report: Annotated[bool, typer.Option("--report/--no-report", help="Write report.html.")] = True,
    output: Output = None,
    force: Force = False,
    json: AsJson = False,
    quiet: Quiet = False,
    debug: Debug = False,
) -> int:
    """Fly many drones, everyone with its own filter and knowing the others by radio only."""
    spans = tuple(map(_span, silent or ()))
    from outrider.cli.progress import Progress
    from outrider.io.folders import ensure_free

    hush_matplotlib()
    folder = output or Path(f"swarm-{task}")
    with Progress(quiet=quiet) as progress:
        from outrider.scenarios.swarm_folder import write_swarm
        from outrider.scenarios.swarm_runs import MARKER, SCHEMA, Asked, expected_s, fly_task, planned

        asked = Asked(task=task, drones=drones, seconds=duration, seed=seed, loss=loss, late_s=late,
                      separation=separation, silent=spans)  # fmt: skip
        ensure_free(folder, MARKER, SCHEMA, force=force)
        flown_as = planned(asked)
        if (takes := expected_s(flown_as)) > SLOW_S:
            until = f"{drones} drones for up to {flown_as.seconds:.0f} s"
            progress.say(f"{until}: {takes / 60.0:.1f} min or less to compute")
        progress("flying", 0.0)
        summary, flown = fly_task(asked, flown_as, lambda share: progress("flying", share))
        progress("writing", 0.0)
        write_swarm(summary, flown, flown_as, folder, force=force, report=report, command=typed())
    code = ExitCode.OK if summary["outcome"]["code"] == "done" else ExitCode.FAILED_CHECK
    if json:
        return print_json({**summary, "folder": str(folder)}, code)
    _print(summary, folder, quiet=quiet)
    return code


def _span(text: str) -> tuple[int, float, float]:
    parts = text.split(",")
    if len(parts) != 3:
        raise UsageError("is no span", where=f"--silent {text}", fix="DRONE,FROM,TO, e.g. 17,60,90")
    seconds = parse.number("--silent")
    return parse.whole("--silent")(parts[0]), seconds(parts[1]), seconds(parts[2])


def _print(summary: Mapping[str, Any], folder: Path, *, quiet: bool) -> None:
    from rich.text import Text

    from outrider.cli.render import console, number

    out = console()
    done = summary["outcome"]["code"] == "done"
    out.print(Text(summary["outcome"]["text"], "bold green" if done else "bold red"))
    if quiet:
        return
    pace = summary["duration_s"] / max(summary["wall_s"], 1e-9)
    out.print(Text(f"{summary['drones']} drones, {summary['duration_s']:.0f} s, {number(pace)} x real time"))
    near = f"drone {summary['least_of']} came within {summary['least_m']:.2f} m of another"
    out.print(Text(f"{near}, after {summary['least_at_s']:.1f} s; {summary['separation_m']:g} m are to be kept"))
    shares = ", ".join(f"{name} {100.0 * share:.1f} %" for name, share in summary["decided_by"].items())
    out.print(Text(f"decided by: {shares}"))
    rms = [r for r in (summary["column"] or {}).get("rms_m", ()) if r is not None]
    if rms:
        out.print(Text(f"gaps, RMS error: {rms[0]:.2f} m at the first follower, at most {max(rms):.2f} m"))
    for change in summary["changes"]:
        out.print(Text(f"after {change['t_s']:.1f} s drone {change['drone']} {change['text']}", "dim"))
    report = folder / "report.html"
    out.print(Text(f"report: {report}" if report.exists() else f"written to {folder}"))
