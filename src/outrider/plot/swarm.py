"""Many drones: ways from above, how near they were, what decided, gaps of a column; and the page of a swarm."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from outrider.plot import tables
from outrider.plot.report import page_environment
from outrider.plot.style import (
    DARK,
    FUSED,
    GRID,
    INK,
    MUTED,
    PAPER,
    REJECTED,
    SOURCES,
    WIDTH,
    css_name,
    finish,
    panels,
    styled,
    to_svg,
)
from outrider.typing import Floats, Ints

RANK_COLOURS: Final = (GRID, SOURCES[4], SOURCES[0], FUSED, SOURCES[1], REJECTED)
LISTED: Final = 24  # drones of the table, those that came nearest to another
Json = dict[str, Any]


@styled
def swarm_figure(
    ways: Floats, every_s: float, nearest: Floats, allowed: float, walls: Floats, arcs: Floats | None = None
) -> Figure:
    """ways (rows, N, 2) m;  nearest (rows, N) m, from each to the next, beside what is `allowed`;  walls (m, 4) m,
    ends;  arcs (rows, N) m, along the trail of a column, NaN for who is not in it."""
    wide, high = np.ptp(ways[:, :, 0]) + 1.0, np.ptp(ways[:, :, 1]) + 1.0
    flat = wide > 1.8 * high  # below one another rather than side by side
    figure = Figure(figsize=(WIDTH, 6.4 if flat else 4.9), layout="constrained")
    if flat:
        above, time = figure.subplots(2, 1, height_ratios=(1.25, 1.0))
    else:
        above, time = figure.subplots(1, 2, width_ratios=(1.15, 1.0))
    from_above(above, ways, walls)
    t = every_s * np.arange(len(nearest))
    if arcs is None:
        distances(time, every_s, nearest, allowed)
    else:
        for i in range(arcs.shape[1]):
            time.plot(t, arcs[:, i], color=SOURCES[i % len(SOURCES)], lw=0.6)
        time.set_ylabel("along the trail [m]")
    time.set_xlabel("time from start [s]")
    handles = [
        Line2D([], [], color=INK, marker="o", ms=6.0, mfc="none", mew=0.8, ls="", label="start"),
        Line2D([], [], color=INK, marker="o", ms=3.0, ls="", label="end"),
    ]
    handles += [Line2D([], [], color=INK, lw=2.4, label="wall")] if len(walls) else []
    handles += [h for h in time.get_lines() if not str(h.get_label()).startswith("_")]
    figure.legend(handles=handles, loc="outside upper left", ncols=len(handles))
    return figure


def from_above(ax: Axes, ways: Floats, walls: Floats) -> None:
    """Each way in a colour, a ring where it starts, a dot where it ends: where one starts another may end."""
    for i in range(ways.shape[1]):
        colour = SOURCES[i % len(SOURCES)]
        ax.plot(*ways[:, i].T, color=colour, lw=0.7, alpha=0.85)
        ax.plot(*ways[0, i], "o", ms=6.0, mfc="none", mec=colour, mew=0.8, zorder=3)
        ax.plot(*ways[-1, i], "o", ms=3.0, mfc=colour, mec=PAPER, mew=0.3, zorder=4)
    for w in walls:
        ax.plot(w[[0, 2]], w[[1, 3]], color=INK, lw=2.4, zorder=2)
    ax.set_aspect("equal", adjustable="datalim")
    ax.margins(0.04)
    ax.set_xlabel("east [m]")
    ax.set_ylabel("north [m]")


def distances(ax: Axes, every_s: float, nearest: Floats, allowed: float) -> None:
    """From everybody to the next one: the least of all and the median, over what is never to be."""
    t = every_s * np.arange(len(nearest))
    ax.axhspan(0.0, allowed, color=REJECTED, alpha=0.12, lw=0)
    ax.axhline(allowed, color=REJECTED, lw=0.9, ls="--", label="never to be less")
    ax.plot(t, nearest.min(axis=1), color=FUSED, lw=1.0, label="nearest two")
    ax.plot(t, np.median(nearest, axis=1), color=MUTED, lw=0.8, label="median to the next")
    ax.set_ylim(bottom=0.0)
    ax.set_ylabel("distance [m]")


@styled
def distances_figure(every_s: float, nearest: Floats, allowed: float) -> Figure:
    """nearest (rows, N) m, over time."""
    figure, (ax,) = panels(1, 2.0)
    distances(ax, every_s, nearest, allowed)
    return finish(figure, ax.get_lines())


@styled
def decided_figure(ranks: Ints, every_s: float, names: Sequence[str]) -> Figure:
    """ranks (rows, N), the highest that decided since the row before: which share of the drones had which."""
    figure, (ax,) = panels(1, 2.0)
    shares = np.array([(ranks == k).mean(axis=1) for k in range(len(names))])
    ax.stackplot(every_s * np.arange(len(ranks)), 100.0 * shares, colors=RANK_COLOURS, lw=0)
    ax.set_ylim(0.0, 100.0)
    ax.set_ylabel("drones [%]")
    return finish(figure, [Patch(color=RANK_COLOURS[k], label=name) for k, name in enumerate(names)])


@styled
def gaps_figure(errors: Floats, every_s: float, limit: float = 3.0) -> Figure:
    """errors (rows, N) m, of the gap of drones 1 to N to the one ahead; a row of the picture is a drone."""
    figure, (ax,) = panels(1, min(4.0, 1.2 + 0.06 * errors.shape[1]))
    shown = ax.imshow(
        errors.T, origin="upper", aspect="auto", cmap="RdBu_r", vmin=-limit, vmax=limit, interpolation="nearest",
        extent=(0.0, every_s * len(errors), errors.shape[1] + 0.5, 0.5), rasterized=True,
    )  # fmt: skip
    ax.set_ylabel("drone")
    ax.yaxis.set_major_locator(MaxNLocator(8, integer=True, min_n_ticks=1))
    ax.grid(visible=False)
    figure.colorbar(shown, ax=ax, pad=0.01, fraction=0.03).set_label("too far [m]")
    return finish(figure, [])


def swarm_page(summary: Json, figures: Sequence[tuple[str, str, Figure]], *, command: str) -> str:
    """A document of schema `outrider.swarm/1` as one HTML page. figures : title, caption, picture."""
    return (
        page_environment()
        .get_template("swarm.html.j2")
        .render(
            s=summary,
            figures=[(title, caption, Markup(to_svg(figure, title))) for title, caption, figure in figures],
            cards=_cards(summary),
            drones=sorted(summary["each"], key=lambda d: d["least_m"])[:LISTED],
            ranks=summary["decided_by"],
            command=command,
            palette=[(css_name(light), light, dark) for light, dark in DARK.items()],
            versions=summary["versions"],
            number=tables.number,
            span=tables.span,
        )
    )


def _cards(s: Mapping[str, Any]) -> list[Json]:
    near = f"drone {s['least_of']}, after {s['least_at_s']:.1f} s; {s['separation_m']:g} m are to be kept"
    air = f"{100.0 * s['loss']:g} % lost, 0.1 to {s['late_s']:g} s late"
    cards = [
        {"name": "least distance", "value": tables.number(s["least_m"], "m"), "note": near},
        {"name": "decisions too near", "value": str(s["violations"]), "note": f"and {s['in_walls']} at walls"},
        {"name": "simulated", "value": tables.span(s["duration_s"]), "note": f"in {tables.number(s['wall_s'], 's')}"},
        {"name": "messages heard", "value": f"{s['messages']:,}", "note": air},
    ]
    if s["there"] is not None:
        cards.append({"name": "at their goals", "value": f"{s['there']} of {s['drones']}", "note": ""})
    if s["column"]:
        rms = [r for r in s["column"]["rms_m"] if r is not None]
        if rms:
            first, worst = tables.number(rms[0], "m"), tables.number(max(rms), "m")
            cards.append({"name": "gaps, RMS error at most", "value": worst, "note": f"{first} at the first of them"})
        cards.append({"name": "out of the column", "value": str(s["aside"]), "note": "at the end"})
    return cards
