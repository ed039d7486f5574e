"""Pictures of a team's run: the ways of everybody with the landmarks, and errors against ground truth."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from outrider.data.team_run import TeamRun
from outrider.plot.style import AXES, INK, MUTED, SOURCES, finish, styled
from outrider.typing import Floats

POINTS = 4000
COLOURS = (AXES[0], *SOURCES)


def team_colours(run: TeamRun) -> Mapping[str, str]:
    """A colour for each robot."""
    return {r.name: COLOURS[k % len(COLOURS)] for k, r in enumerate(run.robots)}


@styled
def tracks_figure(run: TeamRun) -> Figure:
    """Where everybody was; ground truth, if there is one, thin beneath."""
    lines = [r.x[:: max(1, len(r.x) // POINTS)] for r in run.robots]
    everything = np.vstack([line[:, :2] for line in lines] + [np.array([*run.landmarks.values()]).reshape(-1, 2)])
    size = np.maximum(np.ptp(everything, axis=0), 1.0)
    figure = Figure(figsize=(9.0, float(np.clip(9.0 * size[1] / size[0], 4.0, 10.0))))
    ax = figure.add_subplot()
    ax.set_aspect("equal")
    ax.set_xlabel("x [m]")
    ax.set_ylabel("y [m]")
    handles: list[Line2D] = []
    if any(r.truth is not None for r in run.robots):
        handles.append(Line2D([], [], color=INK, lw=0.6, label="ground truth"))
    for r, line in zip(run.robots, lines, strict=True):
        if r.truth is not None:
            p = r.truth.p[r.truth.t >= r.started]
            p = p[:: max(1, len(p) // POINTS)]
            ax.plot(p[:, 0], p[:, 1], color=INK, lw=0.6, zorder=1)
        (drawn,) = ax.plot(line[:, 0], line[:, 1], color=team_colours(run)[r.name], lw=1.2, label=r.name, zorder=2)
        ax.plot(*line[0, :2], marker="o", ms=6, mfc="none", color=team_colours(run)[r.name], zorder=3)
        handles.append(drawn)
    for number, (x, y) in run.landmarks.items():
        ax.plot(x, y, marker="s", ms=5, color=MUTED, zorder=4)
        ax.annotate(f"{number}", (x, y), xytext=(4, 4), textcoords="offset points", fontsize=8, color=MUTED)
    if run.landmarks:
        handles.append(Line2D([], [], color=MUTED, marker="s", ls="", ms=5, label="landmark"))
    return finish(figure, handles)


@styled
def errors_figure(run: TeamRun, errors: Mapping[str, tuple[Floats, Floats, Floats]]) -> Figure:
    """Distance to the truth [m] of each robot over time, over twice its standard deviation. errors : by robot, times
    [s], distances, deviations."""
    figure = Figure(figsize=(9.0, 1.5 * max(len(errors), 1) + 0.6))
    axes = figure.subplots(max(len(errors), 1), 1, sharex=True, squeeze=False)[:, 0]
    colours = team_colours(run)
    for ax, (name, (t, off, sigma)) in zip(axes, errors.items(), strict=False):
        ax.fill_between(t, 0.0, 2.0 * sigma, color=colours[name], alpha=0.2, lw=0)
        ax.plot(t, off, color=colours[name], lw=0.8)
        ax.set_ylabel(f"{name} [m]")
        ax.set_ylim(0.0, max(0.05, 1.1 * float(np.quantile(np.maximum(off, 2.0 * sigma), 0.998)) if off.size else 1.0))
    axes[-1].set_xlabel("time [s]; line: distance to ground truth, band: 2 standard deviations")
    return finish(figure, [])
