"""What a person reads on stdout. Everything shown comes from the same documents that `--json` prints."""

from collections.abc import Iterable, Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    from outrider.workflows.demo import Demo
    from outrider.workflows.sources import Listing
    from outrider.workflows.upstream import Row

NONE = "-"
PIPE_WIDTH = 140  # columns where there is no terminal
STYLES = {"error": "bold red", "warning": "yellow", "info": "dim"}
DEGREES = 57.29577951308232


def console() -> Console:
    """Stdout: colours and width of the terminal, or plain wide text in a pipe."""
    made = Console(highlight=False)
    return made if made.is_terminal else Console(highlight=False, width=PIPE_WIDTH, color_system=None, soft_wrap=True)


def run(summary: Mapping[str, Any], folder: Path, *, quiet: bool = False, verbose: bool = False) -> None:
    """Outcome, key figures, findings and the table of sources."""
    out = console()
    outcome = summary["outcome"]
    style = {"ok": "bold green", "degraded": "bold yellow", "partly_valid": "bold yellow"}.get(
        outcome["code"], "bold red"
    )
    out.print(Text(outcome["text"], style))
    if quiet:
        return
    for line in _figures(summary):
        out.print(Text(line))
    _findings(out, summary["findings"], verbose=verbose)
    _accounts(out, summary["accounts"], verbose=verbose)
    _scores(out, summary)
    report = folder / "report.html"
    out.print(Text(f"report: {report}" if report.exists() else f"written to {folder}"))


def flags(rows: "Iterable[Row]") -> None:
    """What each flag of a configuration of robot_localization means, and what was done with it."""
    out = console()
    table = table_of("flag", "value", "there it means", "here")
    rows = list(rows)
    table.columns[0].min_width = max((len(r.flag) for r in rows), default=0)  # a name that is cut cannot be looked up
    for r in rows:
        table.add_row(escape(r.flag), escape(r.value), r.meaning, Text(r.done, "" if r.used else "dim"))
    out.print(Text("flags of robot_localization:"))
    print_table(out, table)


def _figures(summary: Mapping[str, Any]) -> Iterable[str]:
    f = summary["figures"]
    if not f:
        yield "no estimate"
        return
    end, sd, share = f["end"], f["deviation"], f["valid_share"]
    pace = f", {number(f['times_real_time'])} x real time" if f["times_real_time"] else ""
    compiled = f" plus {number(summary['compile_s'])} s compiling" if summary["compile_s"] > 0.0 else ""
    took = f"computed in {number(summary['wall_s'])} s{pace}{compiled}"
    yield f"{number(f['duration_s'])} s, {number(f['distance_m'])} m, {took}"
    known = [f"position +-{number(sd['horizontal_m']['end'])} m" if "horizontal_m" in sd else ""]
    known += [f"heading +-{number(sd['heading_deg']['end'])} deg" if "heading_deg" in sd else ""]
    at = f"{end['east_m']:.2f} m east, {end['north_m']:.2f} m north, heading {number(end['heading_deg'], 4)} deg"
    sigma = ", ".join(k for k in known if k)
    yield f"ends {at}" + (f" (1 sigma: {sigma})" if sigma else "")
    yield f"valid: position {share['position']:.1%}, heading {share['heading']:.1%} of the time"


def _findings(out: Console, findings: Sequence[Mapping[str, str]], *, verbose: bool) -> None:
    shown = [f for f in findings if verbose or f["severity"] != "info"]
    if shown:
        out.print()
    for f in shown:
        out.print(Text.assemble((f"{f['severity']}: ", STYLES.get(f["severity"], "")), f["text"]))
        if f["fix"]:
            out.print(Text(f"    {f['fix']}", "dim"))
    hidden = len(findings) - len(shown)
    if hidden:
        out.print(Text(f"and {hidden} remark{'s' * (hidden > 1)}, see the report or -v", "dim"))


def _accounts(out: Console, accounts: Sequence[Mapping[str, Any]], *, verbose: bool) -> None:
    """One row per source; why a source is not fused stands below, where there is room for a sentence."""
    table = table_of("source", "kind", "use", ">received", ">used", ">gated", ">Hz", ">NIS/dof", "state")
    for a in accounts:
        cells = (a["source"], a["kind"].lower().replace("_", " "), a["role"].split(":")[0])
        nis = a["nis_per_dof_fused"] if a["used"] else a["nis_per_dof"]
        counts = (f"{a['received']}", f"{a['used']}", f"{a['by_verdict'].get('gated', 0)}", number(a["rate_hz"]))
        table.add_row(*(escape(c) for c in cells), *counts, number(nis), _state(a))
    print_table(out, table)
    for a in accounts:
        use, _, why = a["role"].partition(": ")
        if why and use != "fused":
            out.print(Text(f"{a['source']} is {use}: {why}", "dim"))
    if verbose:
        _refused(out, accounts)


def _state(a: Mapping[str, Any]) -> str:
    """Health at the end, and the worst before it; a source that is not fused has none."""
    worst = a["trouble"]
    if a["state"] is None or not a["used"]:
        return NONE
    if worst is None:
        return a["state"]
    times = f"{worst['times']} times from" if worst["times"] > 1 else "at"
    return f"{a['state']}, {worst['state']} {times} {worst['first_s']:.0f} s"


def _refused(out: Console, accounts: Sequence[Mapping[str, Any]]) -> None:
    """Where the records went that were not used."""
    from outrider.data import Verdict, reason

    for a in accounts:
        lost = {k: n for k, n in a["by_verdict"].items() if k not in ("used", "input")}
        lost |= {"malformed": a["malformed"]} if a["malformed"] else {}
        for verdict, n in lost.items():
            why = reason(Verdict[verdict.upper()], a["role"]) if verdict != "malformed" else "could not be decoded"
            out.print(Text(f"{a['source']}: {n} {why}"))


def _scores(out: Console, summary: Mapping[str, Any]) -> None:
    """Sources that were compared and not fused."""
    if not summary["scored"]:
        return
    table = table_of("compared, not fused", ">records", ">RMSE", ">NIS/dof", ">within 95 %")
    for name, s in summary["scored"].items():
        unit, scale = ("deg", DEGREES) if s["unit"] == "rad" else (s["unit"], 1.0)
        row = (
            f"{s['records']}",
            f"{number(scale * s['rmse'])} {unit}".strip(),
            number(s["nis_per_dof"]),
            f"{s['within_95']:.1%}",
        )
        table.add_row(escape(name), *row)
    print_table(out, table)


def demo(done: "Demo", folder: Path, *, quiet: bool = False) -> None:
    """The summary of the demo's run, its errors against the truth, and what to look at."""
    run(done.summary, folder, quiet=quiet)
    if quiet:
        return
    out = console()
    out.print()
    from outrider.cli.scores import comparison

    comparison(done.comparison)
    out.print()
    for line in done.invitations(folder):
        out.print(Text(line))


def sources(listing: "Listing") -> None:
    """What a log holds."""
    out, listed = console(), listing.as_dict()
    log = listing.log
    out.print(Text(f"{log.path}: {len(log)} records of {len(log.streams)} sources, {number(log.duration)} s", "bold"))
    table = table_of("source", "kind", ">records", ">Hz", "frame", "mount", "used as")
    for s in cast("list[dict[str, Any]]", listed["sources"]):
        cells = (
            s["name"],
            s["kind"].replace("_", " "),
            f"{s['records']}",
            number(s["rate_hz"]),
            s["frame"] or NONE,
            s["mount"] or NONE,
        )
        table.add_row(*(escape(str(c)) for c in cells), escape(s["used_for"]) or NONE)
    print_table(out, table)
    for note in log.notes:
        out.print(Text(f"note: {note}", "dim"))
    if listing.complaint:
        out.print(Text(listing.complaint, "bold red"))


def papers(document: Mapping[str, Any]) -> None:
    """The tables of papers, or the papers themselves where nothing was computed."""
    out = console()
    for k, paper in enumerate(document["papers"]):
        if k and "tables" in paper:
            out.print()
        out.print(Text.assemble((paper["name"], "bold"), f": {paper['title']}"))
        if "tables" not in paper:
            out.print(Text(f"  {paper['citation']}", "dim"))
            continue
        out.print(Text(f"{paper['citation']}. {paper['about']}", "dim"))
        for table in paper["tables"]:
            _paper_table(out, table)
        if paper["figures"]:
            out.print()
            out.print(Text(f"figures, with --output: {'; '.join(f['title'] for f in paper['figures'])}", "dim"))


def _paper_table(out: Console, table: Mapping[str, Any]) -> None:
    out.print()
    out.print(Text(table["title"], "bold"))
    told = [f"{table['sentence']}." if table["sentence"] else "", table["note"]]
    out.print(Text(" ".join(t for t in told if t)), soft_wrap=True)
    if table["rows"]:
        print_table(out, _values(table["rows"]))
    if table["pairs"]:
        made = table_of(
            "on the same seeds", ">difference", ">95 % of the mean", ">less in", ">p (t)", ">p (W)", ">pairs"
        )
        for p in table["pairs"]:
            wins = NONE if p["wins"] is None else f"{p['wins']:.0%}"
            numbers = (number(p["mean"]), _between(p), wins, number(p["p_t"], 2))
            made.add_row(escape(_named(p)), *numbers, number(p["p_wilcoxon"], 2), f"{p['n']}")
        print_table(out, made)
    for row in (*table["rows"], *table["pairs"]):
        if row["note"]:
            where = f"{row['group']}: " if row.get("group") else ""
            out.print(Text(f"  {where}{row['name']}: {row['note']}", "dim"), soft_wrap=True)


def _values(rows: Sequence[Mapping[str, Any]]) -> Table:
    """Printed and ours; a group has a line of its own."""
    seeded = any(r["ours"] and r["ours"]["n"] for r in rows)
    interval = (">95 % of the mean", ">seeds") if seeded else ()
    made = table_of("value", ">printed", ">ours", *interval, ">ours - printed", "verdict")
    group = ""
    for r in rows:
        if r["group"] != group:
            group = r["group"]
            made.add_row(Text(group, "bold"))
        ours = r["ours"] or {"mean": None, "low": None, "high": None, "n": 0}
        sign = "" if r["relation"] == "=" else f"{r['relation']} "
        spread = f" +- {r['printed_sd']}" if r["printed_sd"] else ""
        made.add_row(
            escape(_named(r)),
            f"{sign}{r['printed']}{spread}" if r["printed"] else NONE,
            number(ours["mean"], 4),
            *((_between(ours), f"{ours['n']}") if ours["n"] else ("", "") if seeded else ()),
            number(r["deviation"], 2) if r["deviation"] is not None else "",
            Text(r["sentence"], {"agrees": "green", "differs": "yellow"}.get(r["verdict"], "dim")),
        )
    return made


def _named(row: Mapping[str, Any]) -> str:
    return f"{row['name']} [{row['unit']}]" if row["unit"] else row["name"]


def _between(ours: Mapping[str, Any]) -> str:
    return f"{number(ours['low'])} to {number(ours['high'])}" if ours["low"] is not None else NONE


def table_of(*headings: str) -> Table:
    """A plain table; a heading that begins with > is of a column of numbers."""
    table = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False)
    for h in headings:
        table.add_column(h.lstrip(">"), justify="right" if h.startswith(">") else "left", no_wrap=h.startswith(">"))
    return table


def print_table(out: Console, table: Table) -> None:
    """With a line before it and no blanks at the ends of its lines."""
    with out.capture() as rendered:
        out.print(table)
    out.print()
    for line in rendered.get().splitlines():
        out.out(Text.from_ansi(line.rstrip()) if out.color_system else line.rstrip(), highlight=False)


def times(count: int) -> str:
    """How many times, in words."""
    return "once" if count == 1 else f"{count} times"


def number(value: float | None, digits: int = 3) -> str:
    """A few significant digits, no exponent where it can be helped."""
    if value is None or not isfinite(value):
        return NONE
    if value and not 1e-5 <= abs(value) < 1e6:
        return f"{value:.{digits - 1}e}"
    whole = len(str(int(abs(value))))
    return (
        f"{value:.{max(digits - whole, 0)}f}"
        if abs(value) >= 1
        else f"{value:.{digits - 1 if abs(value) < 1e-3 else digits}g}"
    )
