"""Papers as one plain document, from which text, page and JSON are made."""

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeAlias

from outrider import __version__
from outrider.campaign.papers.model import FEWEST, Pair, Paper, Picture, Table, Work, check_keys, counts, plain_row
from outrider.campaign.papers.registry import find_paper, paper_names
from outrider.io import folders

SCHEMA = "outrider.papers/1"
MARKER, PAGE = "papers.json", "report.html"

Document: TypeAlias = dict[str, Any]
Pictures: TypeAlias = Mapping[str, Sequence[Picture]]
"""Of each paper by its name."""


def listing() -> Document:
    """Which papers there are, without computing anything."""
    papers = [_about(find_paper(name)) for name in paper_names()]
    return {"schema": SCHEMA, "papers": papers}


def make_document(papers: Sequence[Paper], work: Work) -> tuple[Document, Pictures]:
    """Compute every table of some papers; pictures come undrawn."""
    parts, pictures = list[Document](), dict[str, Sequence[Picture]]()
    for paper in papers:
        tables = [make(work) for make in paper.tables]
        pictures[paper.name] = [p for p in (make(work) for make in paper.pictures) if p is not None]
        check_keys(tables, pictures[paper.name], paper.name)
        drawn = [{"key": p.key, "title": p.title, "caption": p.caption} for p in pictures[paper.name]]
        part = {"counts": counts(tables), "tables": [_table(t) for t in tables], "figures": drawn}
        parts.append({**_about(paper), **part})
    made = {"schema": SCHEMA, "version": __version__, "seeds": work.seeds, "papers": parts}
    return folders.plain(made), pictures


def page(document: Document, pictures: Pictures) -> str:
    """The papers as one HTML page that needs nothing else."""
    from outrider.plot.papers import papers_page  # imports matplotlib

    return papers_page(document, {name: [p.draw() for p in made] for name, made in pictures.items()})


def write_folder(document: Document, pictures: Pictures, folder: Path, *, force: bool = False) -> None:
    """Write the page and the document into a folder that appears when it is complete."""
    with _result(folder, force=force) as part:
        (part / PAGE).write_text(page(document, pictures), encoding="utf-8")
        folders.write_marker(part, MARKER, document)


def ensure_free(folder: Path, *, force: bool = False) -> None:
    """Refuse, before the work is done, a place that `write_folder` would refuse."""
    folders.ensure_free(folder, MARKER, SCHEMA, force=force)


def _result(folder: Path, *, force: bool) -> AbstractContextManager[Path]:
    return folders.result_folder(folder, MARKER, SCHEMA, force=force)


def _about(paper: Paper) -> Document:
    words = {"title": paper.title, "citation": paper.citation, "doi": paper.doi, "about": paper.about}
    return {"name": paper.name, **words}


def _table(table: Table) -> Document:
    rows, pairs = [plain_row(r) for r in table.rows], [_pair(p) for p in table.pairs]
    words = {"key": table.key, "title": table.title, "note": table.note, "sentence": table.sentence}
    return {**words, "rows": rows, "pairs": pairs}


def _pair(pair: Pair) -> Document:
    told = {"name": pair.name, "unit": pair.unit, "note": pair.note, **asdict(pair.result)}
    few = ("wins", "p_t", "p_wilcoxon", "effect") if pair.result.n < FEWEST else ()
    return {**told, **dict.fromkeys(few)}
