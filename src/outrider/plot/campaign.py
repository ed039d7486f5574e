"""Campaigns: how values are spread over trials, how they depend on what varies, and what trades off against what."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from outrider.plot.report import page_environment
from outrider.plot.style import DARK, FUSED, REJECTED, SOURCES, WIDTH, css_name, finish, label, styled, to_svg
from outrider.plot.tables import number
from outrider.typing import Floats, Ints

PANEL: Final = 1.5  # inches, of one value
MOST: Final = 6  # values drawn
MORE: Final = ("clearance", "separations", "least_m", "valid", "covered", "seen")  # more of it is better
Json = dict[str, Any]


def campaign_page(
    document: Json, values: Mapping[str, Floats], case: Ints, group: Ints, axes: Mapping[str, Sequence[object]], *,
    command: str,
) -> str:  # fmt: skip
    """A document of schema `outrider.campaign/1` as one HTML page.

    values : (trials,) by name;  case, group : (trials,) of each;  axes : what varies, a value for each case
    """
    drawn = {n: x for n, x in values.items() if np.unique(x[np.isfinite(x)]).size > 1}
    drawn = dict(list(drawn.items())[:MOST])
    figures = [("How the trials are spread", spread_figure(drawn, group, document["groups"]))] if drawn else []
    numeric = [k for k, told in axes.items() if all(isinstance(v, int | float) for v in told)]
    if drawn and len(numeric) == 2 and not document["sampled"] and len(axes) == 2:
        figures += [(f"Mean of {n}", map_figure(x, case, {k: axes[k] for k in numeric}, n)) for n, x in drawn.items()]
    elif drawn and numeric:
        figures.append(("Against what varies", against_figure(drawn, case, {k: axes[k] for k in numeric})))
    pair = [n for n in drawn if n != "ok"][:2]
    if len(pair) == 2:
        figures.append(("What trades off", pareto_figure(drawn[pair[0]], drawn[pair[1]], pair[0], pair[1])))
    return (
        page_environment()
        .get_template("campaign.html.j2")
        .render(
            d=document,
            figures=[(title, Markup(to_svg(figure, title))) for title, figure in figures],
            versions={"outrider": document["version"]},
            palette=[(css_name(light), light, dark) for light, dark in DARK.items()],
            number=_number,
            command=command,
        )
    )


def _number(x: float | None, digits: int = 3) -> str:
    return number(np.nan if x is None else x, digits=digits)


@styled
def spread_figure(values: Mapping[str, Floats], group: Ints, names: Sequence[str]) -> Figure:
    """Every trial a dot, a row per group, a panel per value; the mean as a stroke."""
    rows = len(names)
    tall = max(0.55, 0.24 * rows)
    figure = Figure(figsize=(WIDTH, (tall + 0.5) * len(values)))
    panels = figure.subplots(len(values), 1, squeeze=False, gridspec_kw={"hspace": 0.5 / tall})[:, 0]
    rng = np.random.default_rng(0)  # dots beside one another
    for ax, (name, x) in zip(panels, values.items(), strict=True):
        for k in range(rows):
            mine = x[(group == k) & np.isfinite(x)]
            ax.plot(mine, k + rng.uniform(-0.25, 0.25, mine.size), ".", color=FUSED, markersize=4, alpha=0.5)
            if mine.size:
                ax.plot([mine.mean()] * 2, [k - 0.4, k + 0.4], color=REJECTED, linewidth=2.0)
        ax.set_yticks(range(rows), [label(n) for n in names])
        ax.set_ylim(rows - 0.4, -0.6)
        ax.set_xlabel(label(name))
    handles = [
        Line2D([], [], color=FUSED, marker=".", linestyle="", label="a trial"),
        Line2D([], [], color=REJECTED, linewidth=2.0, label="mean"),
    ]
    return finish(figure, handles, left=0.4 + 0.068 * max(12, *(len(n) for n in names)))


@styled
def map_figure(x: Floats, case: Ints, axes: Mapping[str, Sequence[object]], name: str) -> Figure:
    """The mean over seeds for every combination of two settings."""
    (kx, told_x), (ky, told_y) = axes.items()
    xs, ys = (sorted({float(str(v)) for v in told}) for told in (told_x, told_y))
    mean = np.full((len(ys), len(xs)), np.nan)
    for k, (a, b) in enumerate(zip(told_x, told_y, strict=True)):
        mine = x[case == k]
        if np.isfinite(mine).any():
            mean[ys.index(float(str(b))), xs.index(float(str(a)))] = np.nanmean(mine)
    figure = Figure(figsize=(WIDTH, 0.9 + 0.34 * len(ys)))
    ax = figure.subplots()
    shown = ax.imshow(mean, origin="lower", aspect="auto", cmap="viridis")
    ax.set_xticks(range(len(xs)), [f"{v:.3g}" for v in xs])
    ax.set_yticks(range(len(ys)), [f"{v:.3g}" for v in ys])
    ax.set_xlabel(label(kx))
    ax.set_ylabel(label(ky))
    ax.grid(visible=False)
    middle = 0.5 * (np.nanmin(mean) + np.nanmax(mean))
    for (row, col), v in np.ndenumerate(mean):
        ax.text(col, row, number(float(v)), ha="center", va="center", fontsize=8,
                color="#1c2530" if v > middle else "#fefefe")  # fmt: skip
    figure.colorbar(shown, ax=ax, pad=0.01).set_label(label(name))
    return finish(figure, [])


@styled
def against_figure(values: Mapping[str, Floats], case: Ints, axes: Mapping[str, Sequence[object]]) -> Figure:
    """Every trial a dot: each value over each setting."""
    figure = Figure(figsize=(WIDTH, PANEL * len(values)))
    panels = figure.subplots(len(values), len(axes), squeeze=False, sharey="row", sharex="col")
    for row, (name, x) in zip(panels, values.items(), strict=True):
        for ax, told in zip(row, axes.values(), strict=True):
            at = np.array([float(str(v)) for v in told])[case]
            ax.plot(at, x, ".", color=FUSED, markersize=4, alpha=0.5)
            _means(ax, at, x)
        row[0].set_ylabel(label(name.replace(".", ".\n")), fontsize=7)
    for ax, key in zip(panels[-1], axes, strict=True):
        ax.set_xlabel(label(key))
    handles = [Line2D([], [], color=FUSED, marker=".", linestyle="", label="a trial")]
    return finish(figure, [*handles, Line2D([], [], color=REJECTED, label="mean of those about there")], left=1.4)


def _means(ax: Axes, at: Floats, x: Floats) -> None:
    """Means in up to eight parts of the range, or at every setting where there are few."""
    known = np.isfinite(x)
    places = np.unique(at[known])
    if places.size > 10:
        edges = np.quantile(at[known], np.linspace(0.0, 1.0, 9))
        part = np.clip(np.searchsorted(edges, at[known], side="right") - 1, 0, 7)
        groups = [(at[known][part == k], x[known][part == k]) for k in range(8)]
    else:
        groups = [(at[known][at[known] == p], x[known][at[known] == p]) for p in places]
    line = np.array([[a.mean(), v.mean()] for a, v in groups if a.size])
    if len(line) > 1:
        ax.plot(line[:, 0], line[:, 1], color=REJECTED, linewidth=1.6)


@styled
def pareto_figure(x: Floats, y: Floats, name_x: str, name_y: str) -> Figure:
    """Two values of each trial, and those trials that no other beats in both."""
    known = np.isfinite(x) & np.isfinite(y)
    p = np.column_stack([x[known], y[known]])
    senses = [-1.0 if any(word in name for word in MORE) else 1.0 for name in (name_x, name_y)]
    best = undominated(p * senses)
    figure = Figure(figsize=(WIDTH, 2.8))
    ax = figure.subplots()
    ax.plot(p[:, 0], p[:, 1], ".", color=FUSED, markersize=4, alpha=0.5)
    ax.plot(p[best, 0], p[best, 1], "-o", color=SOURCES[0], markersize=4, linewidth=1.0)
    broken = name_y.replace(".", ".\n")
    told = ["more is better" if s < 0.0 else "less is better" for s in senses]
    ax.set_xlabel(f"{label(name_x)} ({told[0]})")
    ax.set_ylabel(f"{label(broken)}\n({told[1]})", fontsize=7)
    handles = [
        Line2D([], [], color=FUSED, marker=".", linestyle="", label="a trial"),
        Line2D([], [], color=SOURCES[0], marker="o", label="no other is better in both"),
    ]
    return finish(figure, handles, left=1.4)


def undominated(costs: Floats) -> Ints:
    """Rows of costs (n, 2) that no other beats, by the first cost; one of those that are equal."""
    order = np.lexsort((costs[:, 1], costs[:, 0]))
    least = np.minimum.accumulate(np.r_[np.inf, costs[order, 1]])[:-1]  # of those before
    return order[costs[order, 1] < least]
