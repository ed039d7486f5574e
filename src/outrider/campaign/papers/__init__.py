"""The tables and figures of the papers beside ours: what `outrider papers` shows."""

from outrider.campaign.papers.document import SCHEMA, listing, make_document, write_folder
from outrider.campaign.papers.model import Pair, Paper, Picture, Row, Table, Verdict, Work, exact
from outrider.campaign.papers.registry import find_paper, paper_names

__all__ = [
    "SCHEMA", "Pair", "Paper", "Picture", "Row", "Table", "Verdict", "Work", "exact", "find_paper", "listing",
    "make_document", "paper_names", "write_folder",
]  # fmt: skip
