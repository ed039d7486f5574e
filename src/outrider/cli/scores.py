"""What a person reads of an evaluation: one estimate at length, several in one table, outages window by window."""

import csv
import sys
from collections.abc import Sequence
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Final

from rich.console import Console
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from outrider.cli.render import DEGREES, console, number, print_table, table_of
from outrider.errors import UsageError

if TYPE_CHECKING:
    from outrider.eval import Statistics, Test
    from outrider.workflows.evaluate import Evaluation, FileComparison
    from outrider.workflows.outages import Outages

FORMS: Final = ("text", "csv", "latex", "json")
COLUMNS: Final = (
    "estimate", "poses", "span [s]", "path [m]", "RMSE 2-D [m]", "median [m]", "95 % [m]", "largest [m]",
    "RMSE 3-D [m]", "heading RMSE [deg]", "drift [m]", "drift [m/km]", "drift [deg/km]", "NEES/dof", "in 95 %",
)  # fmt: skip
SHORT: Final = {  # of a terminal's table: metres and degrees
    "estimate": "estimate", "poses": "poses", "path [m]": "path", "RMSE 2-D [m]": "RMSE", "median [m]": "median",
    "95 % [m]": "95 %", "largest [m]": "largest", "RMSE 3-D [m]": "3-D RMSE", "heading RMSE [deg]": "heading",
    "drift [m]": "drift", "drift [m/km]": "m/km", "NEES/dof": "NEES/dof", "in 95 %": "in 95 %",
}  # fmt: skip
SHOWN_WINDOWS: Final = 12


def form_of(name: str) -> str:
    """Checked before any work is done."""
    if name not in FORMS:
        raise UsageError(f"no format '{name}'", where="--format", fix=f"there are: {', '.join(FORMS)}")
    return name


def evaluation(done: "Evaluation", form: str, max_rmse_m: float | None = None, output: Path | None = None) -> None:
    """One estimate at length, several as a table; as CSV or LaTeX always a table."""
    rows = [_row(one) for one in done.of]
    if form == "csv":
        csv.writer(sys.stdout, lineterminator="\n").writerows([COLUMNS, *rows])
        return
    if form == "latex":
        sys.stdout.write(_latex(COLUMNS, rows))
        return
    out = console()
    if len(done.of) == 1:
        comparison(done.of[0])
    else:
        _several(out, done, rows)
    for one in done.of:
        if max_rmse_m is not None and not one.within(max_rmse_m):
            rmse = number(one.errors.position_2d.rmse)
            name = f"{one.estimate.name}: " if len(done.of) > 1 else ""
            out.print(Text(f"{name}horizontal RMSE {rmse} m is above the limit of {max_rmse_m:g} m", "bold red"))
    if output is not None:
        out.print(Text(f"written to {output}"))


def comparison(done: "FileComparison") -> None:
    """Errors of an estimate against a reference."""
    out, c = console(), done.errors
    out.print(Text(f"{done.estimate.name or 'estimate'} against {done.reference.name or 'reference'}", "bold"))
    lost = ", ".join(f"{n} {why}" for why, n in c.lost.items())
    out.print(Text(f"{c.matched} of {c.of} reference poses compared" + (f" ({lost})" if lost else "")))
    scale = f" of {c.scale:.6g}" if c.scale != 1.0 else ""
    out.print(Text(f"over {number(c.span_s)} s and {number(c.path_m)} m; alignment: {c.alignment.value}{scale}"))
    table = table_of("error", ">RMSE", ">mean", ">median", ">95 %", ">largest", ">poses")
    _errors(table, "horizontal [m]", c.position_2d)
    if not done.flat:
        _errors(table, "in space [m]", c.position_3d)
    _errors(table, "heading [deg]", c.heading, DEGREES)
    _errors(table, "velocity [m/s]", c.velocity)
    _errors(table, f"drift in {c.span} [m]", c.relative)
    print_table(out, table)
    for cause in done.causes:
        out.print(Text(f"remark: {cause}"))
    if c.drift.lengths_m:
        ways = ", ".join(f"{length:g}" for length in c.drift.lengths_m)
        told = f"{number(c.drift.m_per_km)} m and {number(DEGREES * c.drift.rad_per_km)} deg per km"
        out.print(Text(f"drift over ways of {ways} m: {told} in the mean"))
    if isfinite(c.nees):
        told = f"NEES/dof {number(c.nees)} (1 is right), {c.coverage:.1%} of the references inside the 95 % ellipses"
        out.print(Text(f"stated uncertainty: {told}"))
    if c.verdict is not None:
        out.print(Text(f"it is {_bounds(c.verdict)}"))
    if done.nis:
        table = table_of("innovations", ">NIS/dof", ">95 % of honest runs", ">independent", "verdict")
        for source, test in done.nis.items():
            low, high = number(test.low / test.dof), number(test.high / test.dof)
            told = (number(test.mean / test.dof), f"{low} to {high}", number(test.n), str(test).split(":")[0])
            table.add_row(escape(source), *told)
        print_table(out, table)


def outages(done: "Outages", form: str, max_rmse_m: float | None = None, output: Path | None = None) -> None:
    """Scores of the windows: a summary, and the worst of them."""
    head = ("start [s]", "end [s]", "RMSE [m]", "largest [m]", "last [m]", "records")
    windows = done.as_dict()["by_window"]
    keys = ("start_s", "end_s", "rmse_m", "worst_m", "last_m", "records")
    rows = [[number(float(w[k]), 4) for k in keys[:-1]] + [str(w["records"])] for w in windows]
    if form == "csv":
        csv.writer(sys.stdout, lineterminator="\n").writerows([head, *([w[k] for k in keys] for w in windows)])
        return
    if form == "latex":
        sys.stdout.write(_latex(head, rows))
        return
    out, s = console(), done.score
    what = (
        f"{done.log}: {done.source} withheld for {done.length_s:g} s, {len(windows)} windows {done.every_s:g} s apart"
    )
    out.print(Text(what, "bold"))
    if not windows:
        out.print(Text("nothing to score inside any of them"))
        return
    spread = f"mean {number(float(s.rmse.mean()))}, largest {number(float(s.rmse.max()))}"
    out.print(
        Text(f"RMSE inside a window: median {number(s.median)} m ({spread}); {int(s.count.sum())} records scored")
    )
    if done.nis is not None:
        out.print(Text(f"withheld records: {_bounds(done.nis)}"))
    table = table_of(*(f">{escape(name)}" for name in head))
    worst = sorted(range(len(rows)), key=lambda k: -windows[k]["rmse_m"])[:SHOWN_WINDOWS]
    for k in sorted(worst):
        table.add_row(*rows[k])
    print_table(out, table)
    if len(rows) > len(worst):
        out.print(Text(f"these are the {len(worst)} worst; all of them: --format csv"))
    if max_rmse_m is not None and s.median > max_rmse_m:
        out.print(Text(f"the median of {number(s.median)} m is above the limit of {max_rmse_m:g} m", "bold red"))
    if output is not None:
        out.print(Text(f"written to {output}"))


def _several(out: Console, done: "Evaluation", rows: Sequence[Sequence[str]]) -> None:
    c = done.of[0].errors
    out.print(Text(f"{len(rows)} estimates against {done.reference}", "bold"))
    out.print(
        Text(f"horizontal errors in metres, headings in degrees; drift in {c.span}; alignment: {c.alignment.value}")
    )
    used = [k for k, name in enumerate(COLUMNS) if name in SHORT and any(row[k] for row in rows)]
    table = table_of(*((">" if k else "") + SHORT[COLUMNS[k]] for k in used))
    for row in rows:
        table.add_row(*(escape(row[k]) for k in used))
    print_table(out, table)


def _row(done: "FileComparison") -> list[str]:
    """Texts by column, empty where unknown."""
    c = done.errors
    deg = [DEGREES * v for v in (c.heading.rmse, c.drift.rad_per_km)]
    values = (
        c.span_s, c.path_m, c.position_2d.rmse, c.position_2d.median, c.position_2d.p95, c.position_2d.max,
        float("nan") if done.flat else c.position_3d.rmse, deg[0], c.relative.rmse, c.drift.m_per_km, deg[1], c.nees,
    )  # fmt: skip
    shown = [number(v, 4) if isfinite(v) else "" for v in values]
    return [done.estimate.name or "estimate", str(c.matched), *shown, f"{c.coverage:.1%}" if isfinite(c.nees) else ""]


def _bounds(test: "Test") -> str:
    """A test in words, per degree of freedom."""
    word = str(test).split(":")[0]
    low, high = number(test.low / test.dof), number(test.high / test.dof)
    mean = number(test.mean / test.dof)
    return f"{word}: {mean} per dof; 95 % of honest runs lie in {low} to {high} ({number(test.n)} independent samples)"


def _latex(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A tabular with booktabs' rules."""
    lines = [f"\\begin{{tabular}}{{l{'r' * (len(head) - 1)}}}", "\\toprule", _latex_row(head), "\\midrule"]
    lines += [*(_latex_row(row) for row in rows), "\\bottomrule", "\\end{tabular}"]
    return "\n".join(lines) + "\n"


def _latex_row(cells: Sequence[str]) -> str:
    special = {c: f"\\{c}" for c in "&%$#_{}"} | {"\\": "\\textbackslash{}", "~": "\\textasciitilde{}"}
    special["^"] = "\\textasciicircum{}"
    return " & ".join("".join(special.get(c, c) for c in cell) or "--" for cell in cells) + " \\\\"


def _errors(table: Table, name: str, s: "Statistics", scale: float = 1.0) -> None:
    if s.n:
        table.add_row(escape(name), *(number(scale * v) for v in (s.rmse, s.mean, s.median, s.p95, s.max)), f"{s.n}")
