"""Papers beside ours: the page of `outrider papers`, and its figures."""

from collections.abc import Mapping, Sequence
from math import isfinite, nan
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from outrider.plot.report import page_environment
from outrider.plot.style import (
    DARK,
    FUSED,
    MUTED,
    REJECTED,
    SOURCES,
    WIDTH,
    css_name,
    finish,
    styled,
    to_svg,
)
from outrider.plot.tables import number
from outrider.typing import Bools, Floats

TONES = {
    "agrees": "good",
    "differs": "warning",
    "few": "plain",
    "never": "warning",
    "open": "plain",
    "unprinted": "info",
}
WORDS = {
    "agrees": "agrees", "differs": "differs", "few": "too few seeds", "never": "never in ours",
    "open": "not simulated yet", "unprinted": "not printed",
}  # fmt: skip
PLURAL = {**WORDS, "agrees": "agree", "differs": "differ"}
ROW = 0.21  # inches for one value

Json = dict[str, Any]


def papers_page(document: Json, figures: Mapping[str, Sequence[Figure]]) -> str:
    """A document of schema `outrider.papers/1` as one HTML page; `figures` of each paper, in its order."""
    drawn = {
        f"{paper['name']}/{told['key']}": Markup(to_svg(figure, f"{paper['name']} {told['key']}"))  # our own SVG
        for paper in document["papers"]
        for told, figure in zip(paper["figures"], figures.get(paper["name"], ()), strict=True)
    }
    return (
        page_environment()
        .get_template("papers.html.j2")
        .render(
            document=document,
            svg=drawn,
            versions={"outrider": document["version"]},
            palette=[(css_name(light), light, dark) for light, dark in DARK.items()],
            number=_number,
            printed=_printed,
            interval=_interval,
            tones=TONES,
            words=WORDS,
            plural=PLURAL,
        )
    )


def _number(value: float | None, digits: int = 4) -> str:
    return number(nan if value is None else value, digits=digits)


def _interval(row: Json) -> str:
    return f"{_number(row['low'])} to {_number(row['high'])}" if row["low"] is not None else ""


def _printed(row: Json) -> str:
    """As printed, with its sign of relation and its spread."""
    if row["printed"] is None:
        return ""
    sign = {"<": "< ", ">": "> "}.get(row["relation"], "")
    spread = f" ± {row['printed_sd']}" if row["printed_sd"] else ""
    return f"{sign}{row['printed']}{spread}".replace("-", "−")


@styled
def bars_figure(
    names: Sequence[str],
    values: Floats,
    label: str,
    *,
    pale: Bools | None = None,
    lines: Sequence[tuple[str, float]] = (),
) -> Figure:
    """A bar per name. lines : levels (name, value), the first in colour;  pale : bars that are of another kind."""
    figure = Figure(figsize=(WIDTH, 2.6))
    ax = figure.subplots()
    faint = np.zeros(len(names), np.bool_) if pale is None else pale
    ax.bar(range(len(names)), values, 0.62, color=[(FUSED, 0.35) if f else (FUSED, 1.0) for f in faint])
    ax.set_xticks(range(len(names)), names)
    ax.grid(visible=False, axis="x")
    ax.axhline(0.0, color=MUTED, linewidth=0.7)
    ax.set_ylabel(label)
    handles: list[Artist] = []
    for k, (name, level) in enumerate(lines):
        colour, style = (MUTED, (0, (4, 2))) if k else (REJECTED, "-")
        handles.append(ax.axhline(level, color=colour, linewidth=1.1, linestyle=style, label=name))
    made = finish(figure, handles)
    more = 0.15 * max(name.count("\n") for name in names)  # lines below the axes
    _deepen(made, more)
    return made


@styled
def values_figure(rows: Sequence[Json]) -> Figure:
    """Printed values (diamonds, with their spread) and ours (dots, with the interval of the mean), a panel per unit.

    rows : as in the tables of a document
    """
    units = list(dict.fromkeys(r["unit"] for r in rows))
    parts = [[r for r in rows if r["unit"] == unit] for unit in units]
    heights = [ROW * (len(part) + len({r["group"] for r in part})) for part in parts]
    gap = 0.55
    figure = Figure(figsize=(WIDTH, sum(heights) + gap * (len(parts) - 1)))
    space = gap / (sum(heights) / len(heights))
    axes = figure.subplots(len(parts), 1, squeeze=False, height_ratios=heights, gridspec_kw={"hspace": space})[:, 0]
    for ax, part, unit in zip(axes, parts, units, strict=True):
        _values(ax, part)
        ax.set_xlabel(f"[{unit}]" if unit else "")
    handles: list[Artist] = [
        Line2D([], [], color=SOURCES[1], marker="D", linestyle="", markersize=4.5, label="printed"),
    ]
    if any(r["ours"] is not None for r in rows):
        handles.append(
            Line2D([], [], color=FUSED, marker="o", linestyle="", markersize=4.5, label="ours, 95 % of the mean")
        )
    longest = max(len(r["name"]) for r in rows)
    return finish(figure, handles, left=0.3 + 0.068 * max(longest, 12))


def _values(ax: Axes, rows: Sequence[Json]) -> None:
    """One panel: groups from the top, their names bold."""
    ticks, labels, y = list[float](), list[str](), 0.0
    group = ""
    for row in rows:
        if row["group"] != group:
            group = row["group"]
            ax.text(0.006, y, group, transform=ax.get_yaxis_transform(), va="center", fontweight="bold", fontsize=8)
            y += 1.0
        ticks.append(y)
        labels.append(row["name"])
        _value(ax, row, y)
        y += 1.0
    ax.set_yticks(ticks, labels)
    ax.tick_params(axis="y", length=0)
    ax.set_ylim(y - 0.4, -0.6)
    left, right = ax.get_xlim()
    ax.set_xlim(min(0.0, left), right + 0.02 * (right - left))


def _value(ax: Axes, row: Json, y: float) -> None:
    both = row["printed"] is not None and row["ours"] is not None
    if row["printed"] is not None:
        spread = float(row["printed_sd"]) if row["printed_sd"] else nan
        if isfinite(spread):
            ax.plot([float(row["printed"]) - spread, float(row["printed"]) + spread], [y, y], color=SOURCES[1])
        ax.plot(float(row["printed"]), y, "D", color=SOURCES[1], markersize=4.5)
    if row["ours"] is not None:
        ours = row["ours"]
        y += 0.3 * both  # below, not over the printed one
        if ours["low"] is not None and isfinite(ours["low"]):
            ax.plot([ours["low"], ours["high"]], [y, y], color=FUSED)
        ax.plot(ours["mean"], y, "o", color=FUSED, markersize=4.5)


def _deepen(figure: Figure, inches: float) -> None:
    """Room below the axes, which keep their size."""
    tall = figure.get_figheight()
    top, bottom = figure.subplotpars.top, figure.subplotpars.bottom
    figure.set_figheight(tall + inches)
    figure.subplots_adjust(
        top=(top * tall + inches) / (tall + inches), bottom=(bottom * tall + inches) / (tall + inches)
    )
