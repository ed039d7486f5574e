"""`outrider fuse` for a recording of several robots: what it does, and what is printed."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.markup import escape
from rich.text import Text

from outrider.cli import render
from outrider.cli.shared import hush_matplotlib, print_json

if TYPE_CHECKING:
    from outrider.workflows.config import FuseConfig


def fuse_team(
    log: Path,
    settings: "FuseConfig",
    output: Path | None,
    *,
    topics: Sequence[str] | None,
    start: float | None,
    end: float | None,
    force: bool,
    json: bool,
    report: bool,
    quiet: bool,
    verbose: bool,
    robot: str | None = None,
) -> int:
    """Fuse the logs of a team into a folder. robot : only this one, by what it sees of landmarks"""
    from outrider.cli.progress import Progress
    from outrider.io.team_runs import ensure_free

    folder = output or Path(f"{log.resolve().stem}-run")
    hush_matplotlib()
    ensure_free(folder, force=force)
    with Progress(quiet=quiet) as progress:
        from outrider.workflows.fuse_file import Input
        from outrider.workflows.team_file import exit_code, fuse_team_file

        source = Input(log=log, topics=topics, start_s=start, end_s=end, robot=robot)
        run, summary = fuse_team_file(source, folder, settings, force=force, report=report, progress=progress)
    code = exit_code(run)
    if json:
        return print_json({**summary, "folder": str(folder)}, code)
    show(summary, folder, quiet=quiet, verbose=verbose)
    return code


def demo_team(output: Path, *, seed: int, force: bool, json: bool, quiet: bool) -> int:
    """Simulate a team, and fuse its log."""
    from outrider.cli.progress import Progress

    hush_matplotlib()
    with Progress(quiet=quiet) as progress:
        from outrider.workflows.team_file import demo_team as made
        from outrider.workflows.team_file import exit_code

        run, summary = made(output, seed=seed, force=force, progress=progress)
    if json:
        return print_json({**summary, "folder": str(output)}, exit_code(run))
    show(summary, output, quiet=quiet)
    return exit_code(run)


def show(summary: Mapping[str, Any], folder: Path, *, quiet: bool = False, verbose: bool = False) -> None:
    """Outcome, the table of robots, findings, and what became of what they saw."""
    out = render.console()
    robots, how, team = summary["robots"], summary["cooperation"], summary["team"]
    lost = [why for why in summary["absent"].values() if "configuration" not in why]
    out.print(Text(_outcome(summary), "bold green" if not lost else "bold yellow"))
    if quiet:
        return
    took = f"computed in {render.number(summary['wall_s'])} s"
    compiled = f" plus {render.number(summary['compile_s'])} s compiling" if summary["compile_s"] > 0.0 else ""
    out.print(Text(f"{render.number(summary['duration_s'])} s, {took}{compiled}"))
    out.print(Text(f"cooperation {how['name']}: {how['text']}"))
    noise, told = summary["noise"], "from the data" if summary["noise"]["from_data"] else "as configured"
    out.print(Text(f"sightings are good to {noise['range_m']:.3f} m, {noise['bearing_deg']:.2f} deg ({told})"))
    table = render.table_of(
        "robot", ">from s", "start", ">RMSE m", ">alone", ">heading deg", ">NEES/dof", ">in band", ">used", ">gated"
    )
    for name, r in robots.items():
        seen = r["sightings"]
        table.add_row(
            escape(name), f"{r['start']['t_s']:.1f}", escape(r["start"]["how"]), *_scores(r),
            f"{seen.get('used', 0)}", f"{seen.get('gated', 0)}",
        )  # fmt: skip
    if team["score"] is not None:
        seen = summary["sightings"]
        table.add_row("all", "", "", *_scores(team), f"{seen.get('used', 0)}", f"{seen.get('gated', 0)}")
    render.print_table(out, table)
    if team["gain"] is not None and len(robots) > 1:
        out.print(Text(f"against ground truth: cooperation lowers the RMSE over all robots by {team['gain']:.0%}"))
    for f in summary["findings"]:
        if verbose or f["severity"] != "info":
            out.print(Text.assemble((f"{f['severity']}: ", render.STYLES.get(f["severity"], "")), f["text"]))
    counts = ", ".join(f"{n} {what.replace('_', ' ')}" for what, n in summary["sightings"].items())
    out.print(Text(f"sightings: {counts}"))
    if verbose:
        for what in summary["sightings"]:
            out.print(Text(f"    {what.replace('_', ' ')}: {summary['reasons'][what]}", "dim"))
        for name, r in robots.items():
            out.print(Text(f"{name} fused {', '.join(f'{n} {whom}' for whom, n in r['saw'].items()) or 'nothing'}"))
            for whom, a in r["agreement"].items():
                told = f"NIS {a['nis_per_dof']:.2f} per degree of freedom, {a['in_bound']:.0%} in the 95 % bound"
                out.print(Text(f"    {name} of {whom}: {told}", "dim"))
    out.print(Text(f"written to {folder}"))


def _outcome(summary: Mapping[str, Any]) -> str:
    n, gone = len(summary["robots"]), len(summary["absent"])
    return f"{n} robot{'s' * (n != 1)} fused" + (f", {gone} not" if gone else "")


def _scores(r: Mapping[str, Any]) -> tuple[str, ...]:
    s, alone = r["score"], r["alone"]
    if s is None:
        return ("-",) * 5
    return (
        f"{s['rmse_m']:.3f}", "-" if alone is None else f"{alone['rmse_m']:.3f}", f"{s['heading_rmse_deg']:.2f}",
        f"{s['nees_per_dof']:.2f}", f"{s['share_in_band']:.0%}",
    )  # fmt: skip
