"""What a person reads of a map that was made; from the document that `--json` prints."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.text import Text

from outrider.cli.render import console, number


def show(summary: Mapping[str, Any], folder: Path, *, quiet: bool = False) -> None:
    """Size, what was drawn, how much smaller it is, what is wrong."""
    out, m, blocked = console(), summary["map"], summary["blocked"]
    what = f"{len(blocked)} of what was drawn to be driven on cannot be" if blocked else "mapped"
    out.print(Text(f"{summary['name']}: {what}", "bold red" if blocked else "bold green"))
    for line in blocked:
        out.print(Text(f"  {line}"))
    if quiet:
        return
    for line in summary["notes"]:
        out.print(Text(f"  note: {line}", "yellow"))
    wide, high = m["columns"] * m["resolution_m"], m["rows"] * m["resolution_m"]
    cells = m["cells"]
    shares = ", ".join(f"{100 * n / max(1, m['columns'] * m['rows']):.0f} % {name}" for name, n in cells.items())
    out.print(Text(f"{wide:.1f} x {high:.1f} m in cells of {m['resolution_m']:g} m: {shares}"))
    if summary["shapes"]:
        out.print(Text(", ".join(f"{n} x {kind.replace('_', '-')}" for kind, n in summary["shapes"].items())))
    if summary["routes"]:
        r = summary["routes"]
        out.print(Text(f"routes: {r['nodes']} nodes, {r['edges']} edges, {number(r['length_m'])} m"))
    if summary["fit"]:
        f = summary["fit"]
        fitted = f"{number(f['resolution_m'])} m per pixel, turned {number(f['heading_deg'])} degrees"
        out.print(Text(f"control points: {fitted}, off by {number(f['rmse_m'])} m (RMS)"))
    v = summary["volume"]
    if v["drawing_bytes"]:
        ratio, drawing = v["dense_to_drawing"], v["drawing_bytes"] / 1000
        out.print(Text(f"drawing {drawing:.1f} kB; a dense lidar map would be some {ratio:,.0f} times as large"))
    report = folder / "report.html"
    out.print(Text(f"report: {report}" if report.exists() else f"written to {folder}"))
