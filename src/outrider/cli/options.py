"""Arguments and options that several commands share."""

from pathlib import Path
from typing import Annotated

import typer

from outrider.cli import parse

LogFile = Annotated[
    Path,
    typer.Argument(
        metavar="LOG",
        parser=parse.file("LOG"),
        help="A recording: .bag, .mcap, .db3 or ROS 2 bag, .ulg, .bin, .tlog, .csv.",
    ),
]
ConfigFile = Annotated[
    Path | None,
    typer.Option(
        "--config", "-c", metavar="FILE", parser=parse.file("--config"), help="YAML, see `outrider schema fuse`."
    ),
]
FOLDER = typer.Option("--output", "-o", metavar="DIR", parser=parse.written("--output"), help="Folder for the results.")
Output = Annotated[Path | None, FOLDER]
Force = Annotated[bool, typer.Option("--force", help="Replace an earlier result in that folder.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document, nothing else, on stdout.")]
Topics = Annotated[
    list[str] | None,
    typer.Option(
        "--topic", metavar="NAME", parser=parse.name("--topic"), help="Read only this topic; may be repeated."
    ),
]
Start = Annotated[
    float | None,
    typer.Option(
        "--start", metavar="S", parser=parse.number("--start"), help="Leave out what is before, in seconds of the log."
    ),
]
End = Annotated[
    float | None,
    typer.Option(
        "--end", metavar="S", parser=parse.number("--end"), help="Leave out what is after, in seconds of the log."
    ),
]
Mapping = Annotated[
    Path | None,
    typer.Option(
        "--mapping",
        metavar="FILE",
        parser=parse.file("--mapping"),
        help="YAML that says what the columns of a CSV, .npy or .mat are.",
    ),
]
OneRobot = Annotated[
    str | None,
    typer.Option(
        "--robot", metavar="NAME", parser=parse.name("--robot"), help="Which one, if the recording is of several."
    ),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress, and only the outcome.")]
Debug = Annotated[bool, typer.Option("--debug", help="Show where an error comes from.")]
