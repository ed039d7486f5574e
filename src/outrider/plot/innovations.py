"""Innovations: what each source said against what the filter expected, with the limits it had to keep."""

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import NullLocator

from outrider.data import Innovations, Verdict
from outrider.plot.series import extremes, gate, seconds, with_gaps
from outrider.plot.style import INK, MUTED, REJECTED, finish, panels, styled
from outrider.typing import Bools, Floats, Ints

GATE_TAIL = 1e-3  # where the run's configuration does not say how rare a gated record should be
WINDOW = 50  # records in the running mean of NIS
_POINTS = 1200
_RASTER = 300  # more points than this become pixels
_SHOWN = {"rad": ("deg", 180 / np.pi), "rad/s": ("deg/s", 180 / np.pi), "1": ("", 1.0)}


@styled
def innovation_figure(
    innovations: Innovations, colour: str, start: int, end: float, tail: float = GATE_TAIL
) -> Figure | None:
    """A panel per component with its 2-sigma band and gate, NIS per degree of freedom below; None without a record.

    Times count from `start` [ns] and are shown up to `end` [s], so that all figures of a run are in line.
    """
    shown = [k for k in range(len(innovations.columns)) if np.isfinite(innovations.y[:, k]).any()]
    if not shown:
        return None
    order = np.argsort(innovations.t, kind="stable")
    t = seconds(innovations.t[order], start)
    groups = _groups(innovations.verdict[order], colour)
    limit = np.sqrt(gate(innovations.dof[order], tail))
    figure, axes = panels(len(shown) + 1, 1.25)
    for ax, k in zip(axes, shown, strict=False):
        unit, scale = _SHOWN.get(innovations.units[k], (innovations.units[k], 1.0))
        ax.set_ylabel(f"{innovations.columns[k]}" + (f" [{unit}]" if unit else ""))
        _component(ax, t, innovations.y[order, k] * scale, innovations.s[order, k] * scale, limit, groups)
    _nis(
        axes[-1],
        t,
        innovations.nis[order] / np.maximum(innovations.dof[order], 1),
        innovations.dof[order],
        tail,
        np.isin(innovations.verdict[order], (Verdict.GATED, Verdict.FAULTED)),
        groups,
    )
    axes[-1].set_xlim(0.0, end)
    return finish(figure, _handles(groups))


def _groups(verdict: Ints, colour: str) -> list[tuple[str, Bools, str, str]]:
    """Records by what became of them: label, rows, marker, colour."""
    fused = np.isin(verdict, (Verdict.USED, Verdict.RESET, Verdict.INPUT))
    gated, withheld = verdict == Verdict.GATED, verdict == Verdict.WITHHELD
    every = [
        ("fused", fused, ".", colour),
        ("gated", gated, "x", REJECTED),
        ("compared only", withheld, "+", colour),
        ("not used", ~(fused | gated | withheld), "1", MUTED),
    ]
    return [g for g in every if g[1].any()]


def _component(
    ax: Axes, t: Floats, y: Floats, s: Floats, limit: Floats, groups: list[tuple[str, Bools, str, str]]
) -> None:
    """One component; what lies beyond the panel stands at its edge."""
    rows = extremes(s)
    rows = rows[np.isfinite(s[rows])]
    u, band, gated = with_gaps(t[rows], 2 * s[rows], (limit * s)[rows])
    ax.fill_between(u, -band, band, color=MUTED, alpha=0.18, linewidth=0)
    for sign in (-1, 1):
        ax.plot(u, sign * gated, color=INK, linewidth=0.8, linestyle=(0, (3, 2)))
    ax.axhline(0.0, color=MUTED, linewidth=0.6)
    top = 1.25 * _high(limit * s, 98.0)
    if not top > 0.0:
        top = 1.1 * _high(np.abs(y), 99.0) or 1.0
    ax.set_ylim(-top, top)
    _points(ax, t, np.clip(y, -0.96 * top, 0.96 * top), groups)


def _nis(
    ax: Axes,
    t: Floats,
    ratio: Floats,
    dof: Ints,
    tail: float,
    refused: Bools,
    groups: list[tuple[str, Bools, str, str]],
) -> None:
    """NIS per degree of freedom on a logarithmic scale: 1 on average if the stated noise is right.

    The running mean leaves out what was refused: one wild record would hide fifty good ones.
    """
    limit = gate(dof, tail) / np.maximum(dof, 1)
    top, bottom = 6.0 * float(np.max(limit)), _floor(ratio)
    ticks = [10.0**k for k in range(round(np.log10(bottom)), 2)]
    ax.set_yscale("log")
    ax.set_ylim(bottom, top)
    ax.set_ylabel("NIS/dof")
    ax.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    ax.yaxis.set_minor_locator(NullLocator())
    rows = extremes(limit)
    ax.plot(t[rows], limit[rows], color=INK, linewidth=0.8, linestyle=(0, (3, 2)))
    ax.axhline(1.0, color=MUTED, linewidth=0.8)
    _points(ax, t, np.clip(ratio, 1.15 * bottom, 0.8 * top), groups)
    known = np.isfinite(ratio) & ~refused
    if known.sum() >= WINDOW:
        mean = np.convolve(ratio[known], np.ones(WINDOW) / WINDOW, "valid")
        middle = t[known][WINDOW // 2 : WINDOW // 2 + mean.size]
        rows = extremes(mean, 900)
        u, mean = with_gaps(middle[rows], np.clip(mean[rows], 1.15 * bottom, 0.8 * top))
        ax.plot(u, mean, color=INK, linewidth=1.2)


def _points(ax: Axes, t: Floats, y: Floats, groups: list[tuple[str, Bools, str, str]]) -> None:
    for _, member, marker, colour in groups:
        rows = np.flatnonzero(member)
        rows = rows[extremes(y[rows], _POINTS)]
        size = 3.0 if marker == "." else 4.5
        ax.plot(t[rows], y[rows], marker, color=colour, markersize=size, alpha=0.85, rasterized=rows.size > _RASTER)


def _handles(groups: list[tuple[str, Bools, str, str]]) -> list[Artist]:
    points = [
        Line2D([], [], linestyle="", marker=marker, color=colour, markersize=6, label=f"{name} ({int(member.sum())})")
        for name, member, marker, colour in groups
    ]
    lines = [
        Patch(facecolor=(MUTED, 0.25), label="±2σ expected"),
        Line2D([], [], color=INK, linewidth=0.8, linestyle=(0, (3, 2)), label="gate"),
        Line2D([], [], color=INK, linewidth=1.2, label=f"NIS/dof, mean of {WINDOW}"),
    ]
    return [*points, *lines]


def _floor(ratio: Floats) -> float:
    """Where the logarithmic axis begins: below most of the points, between 1e-4 and 1e-2."""
    known = ratio[np.isfinite(ratio) & (ratio > 0.0)]
    low = float(np.percentile(known, 10.0)) if known.size else 1.0
    return float(np.clip(10.0 ** np.floor(np.log10(low)), 1e-4, 1e-2))


def _high(y: Floats, percent: float) -> float:
    known = y[np.isfinite(y)]
    return float(np.percentile(known, percent)) if known.size else 0.0
