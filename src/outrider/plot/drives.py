"""Drives through mapped sites: tracks over their maps, and speeds over time."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon

from outrider.data.grid import Grid
from outrider.plot.style import FUSED, GRID, INK, MUTED, REJECTED, SOURCES, WIDTH, finish, panels, styled
from outrider.typing import Floats

HUES = {
    "planned": (MUTED, "--"), "driven": (FUSED, "-"), "wheels": (SOURCES[1], "-"), "wheels, IMU": (SOURCES[0], "-"),
    "RTK": (MUTED, ":"), "all": (FUSED, "-"), "receiver": (REJECTED, "-"), "fused": (FUSED, "-"), "truth": (INK, "--"),
    "command": (REJECTED, "-"), "encoders": (FUSED, "-"),
}  # fmt: skip
TALL = 4.2  # inches at most of a map
MARGIN = 1.5  # m around what is shown


@final
@dataclass(frozen=True, slots=True)
class Line:
    """points : (n, 2) east, north [m]."""

    name: str
    points: Floats


@final
@dataclass(frozen=True, slots=True)
class Curve:
    """values (n,) over times (n,) [s]."""

    name: str
    t: Floats
    values: Floats


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Site:
    """A map with what happened on it. boxes : outlines (k, 2) of what is on no map;  goals : (n, 2), in order."""

    title: str
    grid: Grid
    lines: tuple[Line, ...] = ()
    boxes: tuple[Floats, ...] = ()
    goals: Floats = field(default_factory=lambda: np.empty((0, 2)))


@styled
def sites_figure(sites: Sequence[Site]) -> Figure:
    """Maps side by side, east to the right, each to its own scale."""
    windows = [_window(s) for s in sites]
    shares = [(w[1] - w[0]) / (w[3] - w[2]) for w in windows]
    tall = min(TALL, (WIDTH - 0.9) / sum(shares))
    figure = Figure(figsize=(WIDTH, tall))
    axes = figure.subplots(1, len(sites), squeeze=False, width_ratios=shares)[0]
    handles: dict[str, Line2D] = {}
    others: dict[str, str] = {}
    for ax, site, window in zip(axes, sites, windows, strict=True):
        _map(ax, site, window)
        for line in site.lines:
            colour, style = HUES.get(line.name) or (
                others.setdefault(line.name, SOURCES[len(others) % len(SOURCES)]),
                "-",
            )
            (drawn,) = ax.plot(*line.points.T, color=colour, linestyle=style, linewidth=1.1, label=line.name)
            handles.setdefault(line.name, drawn)
    return finish(figure, list(handles.values()))


def _map(ax: Axes, site: Site, window: tuple[float, float, float, float]) -> None:
    rows, columns = site.grid.cells.shape
    (west, south), side = site.grid.origin, site.grid.resolution
    x, y = west + (np.arange(columns) + 0.5) * side, south + (np.arange(rows) + 0.5) * side
    ax.contourf(x, y, site.grid.occupied.astype(float), levels=[0.5, 1.5], colors=[GRID])
    ax.set_aspect("equal")
    for box in site.boxes:
        ax.add_patch(Polygon(box, closed=True, color=INK))
    for k, (x, y) in enumerate(site.goals.tolist()):
        ax.plot(x, y, "P", color=SOURCES[0], markersize=6, zorder=4)
        ax.annotate(f"{k + 1}", (x, y), (4, 4), textcoords="offset points", fontsize=8, fontweight="bold")
    if len(site.goals):
        ax.plot(0.0, 0.0, "o", color=INK, markersize=4, zorder=4)
    ax.set_xlim(window[0], window[1])
    ax.set_ylim(window[2], window[3])
    ax.set_title(site.title, fontsize=9)
    ax.grid(visible=False)
    ax.tick_params(labelsize=7)


def _window(site: Site) -> tuple[float, float, float, float]:
    """West, east, south, north [m]: the map, and what left it."""
    rows, columns = site.grid.cells.shape
    corner, side = site.grid.origin, site.grid.resolution
    p = np.vstack([corner, corner + np.array([columns, rows]) * side, *(line.points for line in site.lines)])
    (west, south), (east, north) = np.nanmin(p, axis=0), np.nanmax(p, axis=0)
    return float(west) - MARGIN, float(east) + MARGIN, float(south) - MARGIN, float(north) + MARGIN


@styled
def curves_figure(parts: Sequence[tuple[str, Sequence[Curve]]], label: str) -> Figure:
    """A panel of curves over time for each part (title, curves)."""
    figure, axes = panels(len(parts), 1.35 if len(parts) > 1 else 2.4)
    handles: dict[str, Line2D] = {}
    for ax, (title, curves) in zip(axes, parts, strict=True):
        for curve in curves:
            colour, style = HUES[curve.name]
            (drawn,) = ax.plot(curve.t, curve.values, color=colour, linestyle=style, linewidth=1.0, label=curve.name)
            handles.setdefault(curve.name, drawn)
        ax.set_ylabel(f"{title}\n{label}")
    axes[-1].set_xlabel("time [s]")
    return finish(figure, list(handles.values()))
