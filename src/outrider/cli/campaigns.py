"""A campaign in the terminal."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.markup import escape
from rich.text import Text

from outrider.cli.render import console, number, print_table, table_of

SHOWN = 40  # lines of the table
NONE = "-"


def show(document: Mapping[str, Any], page: Path, *, quiet: bool = False) -> None:
    """How many ended, what the values were, what failed."""
    out = console()
    failed = document["failed"]
    text = f"{document['ended']} of {document['asked']} trials" if document["asked"] else f"{document['ended']} trials"
    out.print(Text(f"{text}, {failed} failed", "bold red" if failed else "bold green"))
    for told in document["warnings"]:
        out.print(Text(told, "yellow"))
    if quiet:
        return
    for f in document["failures"]:
        out.print(Text(f"{f['times']} x {f['error']} (the first: trial {f['trial']})", "yellow"))
    rows = document["lines"]
    compared = any(r["difference"] is not None for r in rows)
    headings = ["value", "case", ">n", ">mean", ">spread", ">95 % of the mean", ">least", ">largest"]
    table = table_of(*headings, *([">against the first", ">p"] if compared else []))
    table.columns[0].overflow = "fold"  # names differ at their ends
    for r in rows[:SHOWN]:
        cells = [
            escape(r["value"]), escape(r["case"]), str(r["n"]), number(r["mean"]), number(r["sd"]), _interval(r),
            number(r["least"]), number(r["largest"]),
        ]  # fmt: skip
        d = r["difference"]
        if compared:
            cells += [NONE, NONE] if d is None else [f"{_signed(d['mean'])} [{_interval(d)}]", number(d["p"], 2)]
        table.add_row(*cells)
    print_table(out, table)
    if len(rows) > SHOWN:
        out.print(Text(f"and {len(rows) - SHOWN} more lines, see the report", "dim"))
    out.print(Text(f"report: {page}"))


def _interval(r: Mapping[str, Any]) -> str:
    return f"{number(r['low'])} to {number(r['high'])}" if r["low"] is not None else NONE


def _signed(value: float | None) -> str:
    return NONE if value is None else f"{'+' if value > 0.0 else ''}{number(value)}"
