"""What several commands do alike."""

import shlex
import sys
from collections.abc import Mapping
from typing import Any

import typer

from outrider.errors import ExitCode


def print_json(document: Mapping[str, Any], code: ExitCode) -> ExitCode:
    """One JSON document on stdout, and the exit code."""
    from outrider.io.folders import as_json

    typer.echo(as_json(document))
    return code


def typed() -> str:
    """The command as it was typed; "" where it was called in another way."""
    from outrider.io.files import as_text

    words = [as_text(a) for a in sys.argv]
    ours = words[0].endswith(("outrider", "outrider/__main__.py"))
    return shlex.join(["outrider", *words[1:]]) if ours else ""


def hush_matplotlib() -> None:
    """It logs to stderr, at length, where it keeps its fonts if the home folder is read-only."""
    import logging

    logging.getLogger("matplotlib").setLevel(logging.ERROR)
