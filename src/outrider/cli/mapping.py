"""`outrider map`: a drawing, a map or an image becomes a map for robots."""

from pathlib import Path
from typing import Annotated

import typer

from outrider.cli import parse
from outrider.cli.options import AsJson, Debug, Force, Output, Quiet
from outrider.cli.shared import hush_matplotlib, print_json, typed

ABOUT = "Make a map from a drawing of a site: cells, routes, zones, a picture, a report."


def map_command(
    site: Annotated[
        Path,
        typer.Argument(
            metavar="SITE",
            parser=parse.file("SITE"),
            help="A drawing (.yaml in metres, .geojson), a map's .yaml, or an image with control points.",
        ),
    ],
    output: Output = None,
    resolution: Annotated[
        float | None,
        typer.Option(
            "--resolution",
            metavar="M",
            parser=parse.number("--resolution", above=0.0),
            help="Side of a cell; 0.05 if not said.",
        ),
    ] = None,
    control_points: Annotated[
        Path | None,
        typer.Option(
            "--control-points",
            metavar="FILE",
            parser=parse.file("--control-points"),
            help="YAML with pixels of an image whose places are known.",
        ),
    ] = None,
    radius: Annotated[
        float,
        typer.Option(
            "--robot-radius",
            metavar="M",
            parser=parse.number("--robot-radius", above=0.0),
            help="Of the disc inside the robot, for costs and for what it fits through.",
        ),
    ] = 0.3,
    force: Force = False,
    json: AsJson = False,
    report: Annotated[bool, typer.Option("--report/--no-report", help="Write report.html.")] = True,
    quiet: Quiet = False,
    debug: Debug = False,
) -> int:
    """Make a map from a drawing of a site, in a folder: cells for map servers, routes, zones, a picture and a report.

    Ends with 1 if a way or a dock that was drawn cannot be used by a robot of that radius.
    """
    from outrider.cli.progress import Progress
    from outrider.workflows.map_site import ensure_free, map_site

    hush_matplotlib()
    folder = output or Path(f"{site.resolve().stem}-map")
    ensure_free(folder, force=force)
    with Progress(quiet=quiet) as progress:
        done, summary = map_site(
            site, folder, control_points=control_points, resolution=resolution, radius=radius, force=force,
            report=report, command=typed(), progress=progress,
        )  # fmt: skip
    if json:
        return print_json({**summary, "folder": str(folder)}, done.exit_code)
    from outrider.cli.mapped import show

    show(summary, folder, quiet=quiet)
    return done.exit_code
