"""`outrider papers`: compute the tables, print them in one of three forms, write them into a folder."""

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from outrider.errors import ExitCode, InterruptionError, UsageError

if TYPE_CHECKING:
    from outrider.campaign.papers.document import Pictures

FORMATS = ("text", "html", "json")


def print_listing(form: str) -> int:
    """Which papers there are."""
    from outrider.campaign.papers import listing

    _check(form, ("text", "json"))
    _print(listing(), {}, form)
    return ExitCode.OK


def print_papers(
    name: str | None,
    *,
    form: str,
    seeds: int | None,
    workers: int | None,
    trials: Path | None,
    output: Path | None,
    force: bool,
    quiet: bool,
) -> int:
    """Everything that can be refused is refused before anything is computed."""
    _check(form, FORMATS)
    from outrider.campaign.papers import Work, find_paper, make_document, paper_names, write_folder
    from outrider.campaign.papers.document import PAGE, ensure_free
    from outrider.campaign.trials import require_same_program
    from outrider.cli.progress import Progress

    papers = [find_paper(n) for n in ([name] if name else paper_names())]
    if output is not None:
        ensure_free(output, force=force)
    if trials is not None:
        require_same_program(trials)
    with Progress(quiet=quiet) as progress:
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        work = Work(seeds=seeds, workers=cores if workers is None else workers, trials=trials, progress=progress)
        try:
            document, pictures = make_document(papers, work)
        except KeyboardInterrupt as e:
            raise InterruptionError(f"interrupted, {e}" if str(e) else "interrupted, nothing was written") from None
    if output is not None:
        write_folder(document, pictures, output, force=force)
    _print(document, pictures, form)
    if output is not None and not quiet:
        sys.stderr.write(f"outrider: written to {output / PAGE}\n")
    return ExitCode.OK


def _check(form: str, known: tuple[str, ...]) -> None:
    if form not in known:
        raise UsageError(f"no format '{form}'", where="--format", fix=f"there are: {', '.join(known)}")


def _print(document: dict[str, Any], pictures: "Pictures", form: str) -> None:
    if form == "json":
        from outrider.io.folders import as_json

        sys.stdout.write(as_json(document) + "\n")
    elif form == "html":
        from outrider.campaign.papers.document import page

        sys.stdout.write(page(document, pictures))
    else:
        from outrider.cli import render

        render.papers(document)
