"""What cooperation is worth: errors and honesty by the way of sharing, over time, and where the robots go."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from outrider.plot.style import FUSED, GRID, LOCAL, MUTED, REJECTED, SOURCES, WIDTH, finish, panels, styled
from outrider.typing import Floats

COLOURS: Final = {
    "none": MUTED, "local": SOURCES[3], "naive": REJECTED, "ci": SOURCES[1], "split ci": SOURCES[2],
    "distributed": SOURCES[0], "joint": FUSED,
}  # fmt: skip
"""Of a way of sharing, the same everywhere."""


def colour(name: str) -> str:
    """Of a curve whose name begins with a way of sharing."""
    return next((c for key, c in COLOURS.items() if name.startswith(key)), LOCAL)


@styled
def worth_figure(values: Mapping[str, Mapping[str, Floats]], honest: Sequence[str] = ()) -> Figure:
    """One panel per quantity: the trials (dots) and mean (bar) of each way of sharing. values : quantity with unit ->
    way -> (seeds,);  honest : quantities that should be 1"""
    ways = list(next(iter(values.values())))
    figure = Figure(figsize=(WIDTH, 0.26 * len(ways) + 0.9), layout="constrained")
    for ax, (quantity, own) in zip(figure.subplots(1, len(values), sharey=True), values.items(), strict=True):
        for y, (way, v) in enumerate(own.items()):
            jitter = np.linspace(-0.28, 0.28, v.size)
            ax.plot(v, y + jitter, ".", ms=2.2, color=colour(way), alpha=0.5, rasterized=True)
            ax.plot([v.mean()] * 2, [y - 0.4, y + 0.4], color=colour(way), lw=2.4)
        if quantity in honest:
            ax.axvline(1.0, color=MUTED, lw=0.8, ls="--")
        ax.set_xlim(0.0, 1.03 * max(float(v.max()) for v in own.values()))
        ax.set_xlabel(quantity)
        ax.set_yticks(range(len(ways)), ways)
        ax.set_ylim(len(ways) - 0.5, -0.5)
    return figure


@styled
def honesty_figure(
    t: Floats, nees: Mapping[str, Mapping[str, Floats]], band: Mapping[str, tuple[float, float]]
) -> Figure:
    """NEES per degree of freedom over time, a panel for each robot. nees : robot -> way of sharing -> (n,), averaged
    over seeds;  band : robot -> its 95 % band"""
    figure, axes = panels(len(nees), 1.5)
    handles: list[Artist] = []
    for ax, (robot, own) in zip(axes, nees.items(), strict=True):
        ax.axhspan(*band[robot], color=GRID, lw=0.0)
        ax.set_yscale("log")
        ax.set_yticks([0.5, 1.0, 2.0, 4.0], ["0.5", "1", "2", "4"])
        ax.minorticks_off()
        ax.set_ylabel(f"{robot}, NEES / dof")
        handles = [ax.plot(t, v, color=colour(way), label=way)[0] for way, v in own.items()]
    return finish(figure, handles)


@styled
def errors_figure(t: Floats, errors: Mapping[str, Mapping[str, Floats]]) -> Figure:
    """Errors of one run over time. errors : quantity with unit -> curve -> (n,)"""
    figure, axes = panels(len(errors), 1.1)
    handles: list[Artist] = []
    for ax, (quantity, own) in zip(axes, errors.items(), strict=True):
        handles = [ax.plot(t, v, color=colour(way), label=way, lw=0.9)[0] for way, v in own.items()]
        ax.set_ylabel(quantity)
        ax.set_ylim(bottom=0.0)
    return finish(figure, handles)


@styled
def tours_figure(outline: Floats, ways: Mapping[str, Floats], seen: Mapping[str, Floats]) -> Figure:
    """From above and from the side. outline : (n, 3) points of what is inspected;  ways : robot -> (k, 3);  seen :
    the same where robots see one another"""
    figure = Figure(figsize=(WIDTH, 5.2), layout="constrained")
    colours = dict(zip(ways, (SOURCES[0], FUSED), strict=False))
    for ax, (i, j), names in zip(
        figure.subplots(1, 2), ((0, 1), (1, 2)), (("east", "north"), ("north", "up")), strict=True
    ):
        ax.plot(*outline[:, [i, j]].T, ".", ms=1.0, color=MUTED, alpha=0.4, rasterized=True)
        for name, p in ways.items():
            ax.plot(*p[:, [i, j]].T, color=colours[name], lw=0.9)
            ax.plot(*seen[name][:, [i, j]].T, ".", ms=3.5, color=colours[name], rasterized=True)
        ax.set_aspect("equal")
        ax.set_xlabel(f"{names[0]} [m]")
        ax.set_ylabel(f"{names[1]} [m]")
    handles = [Line2D([], [], color=c, label=name) for name, c in colours.items()]
    handles.append(Line2D([], [], color=MUTED, marker=".", ls="", label="dots on the way: they see one another"))
    figure.legend(handles=handles, loc="outside upper left", ncols=3)
    return figure
