"""`outrider calibrate`: lever arms, mounts, scales and delays of a recording's sensors, and how sure they are."""

from contextlib import nullcontext
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from outrider.cli import parse
from outrider.cli.options import AsJson, ConfigFile, Debug, End, Force, LogFile, Mapping, OneRobot, Quiet, Start, Topics
from outrider.cli.shared import print_json
from outrider.errors import ExitCode

if TYPE_CHECKING:
    from outrider.workflows.calibration import Calibration, Tuned

ABOUT = "Find lever arms, mounts, scales and delays from a recording, with intervals."


def calibrate_command(
    log: LogFile,
    config: ConfigFile = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="FILE", parser=parse.written("--output"), help="Write the configuration there."
        ),
    ] = None,
    tune: Annotated[
        bool,
        typer.Option("--tune", help="Also find how loud sources and motion are, and test it on half of the log."),
    ] = False,
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
    """Estimate what a recording tells of its sensors, each with a 95 % interval, or say that it does not tell it."""
    from outrider.workflows.settings import load_config

    settings = load_config(config)
    from outrider.cli.progress import Progress
    from outrider.io.files import replacing
    from outrider.io.registry import check_input

    check_input(log, start_s=start, end_s=end, mapping=mapping)
    place = (
        nullcontext(None) if output is None else replacing(output, force=force, source=log)
    )  # refuses before the work is done
    with place as part, Progress(quiet=quiet) as progress:
        from outrider.workflows.calibration import calibrate
        from outrider.workflows.fuse_file import Input

        source = Input(log=log, topics=topic, start_s=start, end_s=end, mapping=mapping, robot=robot)
        done = calibrate(source.read(settings.robot, progress), settings, noise=tune, progress=progress)
        if part is not None:
            part.write_text(done.yaml, encoding="utf-8")
    code = ExitCode.OK if done.complete else ExitCode.FAILED_CHECK
    if json:
        return print_json(done.as_dict(), code)
    _show(done, output, quiet=quiet)
    return code


def _show(done: "Calibration", output: Path | None, *, quiet: bool) -> None:
    from rich.markup import escape
    from rich.text import Text

    from outrider.cli import render

    out = render.console()
    found = sum(r.found for r in done.rows)
    word = f"{found} of {len(done.rows)} parameters found" if done.rows else "nothing to calibrate"
    out.print(Text(word, "bold green" if done.complete else "bold yellow"))
    if done.rows and not quiet:
        table = render.table_of("source", "parameter", ">told", ">found", ">95 %", "unit", "")
        for r in done.rows:
            value, half = (f"{r.value:.4g}", f"+-{r.half:.2g}") if r.found else ("-", "-")
            told = f"{r.told:.4g}" if isfinite(r.told) else "-"
            table.add_row(escape(r.source), r.what, told, value, half, r.unit, r.verdict)
        render.print_table(out, table)
    if done.tuned is not None:
        for line in _tuning(done.tuned):
            out.print(Text(line))
    for f in done.findings:
        if f.severity != "info":
            out.print(Text.assemble((f"{f.severity}: ", render.STYLES.get(f.severity, "")), f.text))
            if f.fix:
                out.print(Text(f"    {f.fix}", "dim"))
    if output is not None:
        out.print(Text(f"configuration written to {output}: outrider fuse {done.log.path} -c {output}"))
    elif done.config.model_fields_set and not quiet:
        out.print(Text("-o FILE writes what differs from what was told as a configuration:"))
        out.print(Text("\n".join(x for x in done.yaml.splitlines() if not x.startswith("#")), "dim"))


def _tuning(t: "Tuned") -> list[str]:
    """What tuning changed, and what the half of the log that it has not seen says of it."""
    if not t.changes:
        return ["noise: left as it is, no change made the second half of the log likelier"]
    lines = [f"noise of {c.name}: times {c.factor:.3g}, now {c.value:.3g}" for c in t.changes]
    gain = t.after.likelihood - t.before.likelihood
    nis = ", ".join(f"{name} {x:.2f} -> {t.after.nis[name]:.2f}" for name, x in t.before.nis.items())
    return [*lines, f"    second half of the log: log-likelihood +{gain:.1f}, NIS per degree of freedom {nis}"]
