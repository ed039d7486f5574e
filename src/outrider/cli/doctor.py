"""`outrider doctor`: what is wrong with a recording, why, and a configuration that mends it."""

from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from outrider.cli import parse
from outrider.cli.options import AsJson, ConfigFile, Debug, End, Force, Mapping, OneRobot, Quiet, Start, Topics
from outrider.cli.shared import hush_matplotlib, print_json, typed
from outrider.errors import ExitCode, UsageError

if TYPE_CHECKING:
    from outrider.workflows.doctor.visit import Visit

ABOUT = "Say what is wrong with a recording, and write a configuration that mends it."


def doctor_command(
    log: Annotated[
        Path | None,
        typer.Argument(metavar="LOG", parser=parse.file("LOG"), help="A recording, as of `outrider fuse`."),
    ] = None,
    itself: Annotated[bool, typer.Option("--self", help="Instead of a recording, look at this installation.")] = False,
    config: ConfigFile = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="FILE", parser=parse.written("--output"), help="Write the configuration there."
        ),
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option(
            "--report",
            metavar="FILE",
            parser=parse.written("--report"),
            help="Write a page with plots of the evidence.",
        ),
    ] = None,
    force: Force = False,
    json: AsJson = False,
    topic: Topics = None,
    start: Start = None,
    end: End = None,
    mapping: Mapping = None,
    robot: OneRobot = None,
    quiet: Quiet = False,
    debug: Debug = False,
) -> int:
    """Find units, mounts, senses of rotation, clock offsets, gaps and doubtful accuracies; most damaging first."""
    if itself:
        from outrider.cli.installed import check_installation

        return check_installation(json=json)
    if log is None:
        raise UsageError("names no recording", fix="outrider doctor LOG, or outrider doctor --self")
    from outrider.workflows.settings import load_config

    settings = load_config(config)
    from outrider.cli.progress import Progress
    from outrider.io.files import replacing
    from outrider.io.registry import check_input

    check_input(log, start_s=start, end_s=end, mapping=mapping)
    hush_matplotlib()
    if output is not None and report is not None and output.absolute() == report.absolute():
        raise UsageError("is both the configuration and the page", where=str(output), fix="give them different names")

    def place(path: Path | None) -> AbstractContextManager[Path | None]:  # refuses before the work is done
        return nullcontext(None) if path is None else replacing(path, force=force, source=log)

    with place(output) as part, place(report) as page, Progress(quiet=quiet) as progress:
        from outrider.workflows.doctor.visit import visit
        from outrider.workflows.fuse_file import Input

        source = Input(log=log, topics=topic, start_s=start, end_s=end, mapping=mapping, robot=robot)
        seen = visit(source.read(settings.robot, progress), settings, progress=progress)
        if part is not None:
            part.write_text(seen.yaml, encoding="utf-8")
        if page is not None:
            from outrider.plot import write_report

            progress("report", 0.0)
            write_report(seen.run, page, command=typed())
    if json:
        return print_json(seen.as_dict(), ExitCode.OK)
    _show(seen, output, report, quiet=quiet)
    return ExitCode.OK


def _show(seen: "Visit", output: Path | None, report: Path | None, *, quiet: bool) -> None:
    from rich.markup import escape
    from rich.text import Text

    from outrider.cli import render

    out = render.console()
    harm = [f for f in seen.findings if f.severity != "info"]
    word = "nothing wrong was found" if not harm else f"{len(harm)} thing{'s' * (len(harm) != 1)} to look at"
    out.print(Text(word, "bold green" if not harm else "bold yellow"))
    if quiet:
        return
    table = render.table_of("source", "kind", ">records", ">rate", ">gaps", ">longest", "used for")
    for row in seen.as_dict()["sources"]:
        rate = "-" if row["rate_hz"] is None else f"{row['rate_hz']:.3g} Hz"
        longest = f"{row['longest_gap_s']:.1f} s" if row["gaps"] else "-"
        table.add_row(
            escape(row["name"]), row["kind"], f"{row['records']}", rate, f"{row['gaps'] or '-'}", longest,
            escape(row["used_for"]),
        )  # fmt: skip
    render.print_table(out, table)
    for f in seen.findings:
        style = render.STYLES.get(f.severity, "")
        out.print(Text.assemble((f"{f.severity}: ", style), f.text))
        if f.fix and f.severity != "info":
            out.print(Text(f"    {f.fix}", "dim"))
    if report is not None:
        out.print(Text(f"page with the evidence: {report}"))
    if output is not None:
        out.print(Text(f"configuration written to {output}: outrider fuse {seen.log.path} -c {output}"))
    elif seen.config.model_fields_set:
        out.print(Text("`outrider fuse` uses what was found; -o FILE writes it as a configuration:"))
        out.print(Text("\n".join(x for x in seen.yaml.splitlines() if not x.startswith("#")), "dim"))
