"""One aircraft behind another: the way from above, distance and zones, speeds, errors over time."""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from outrider.plot.style import FUSED, GRID, MUTED, PAPER, REJECTED, SOURCES, styled
from outrider.typing import Floats

TARGET, OWN, KNOWN, FIXES = FUSED, SOURCES[0], SOURCES[1], SOURCES[6]  # the hues of a report's first two robots
MOMENTS: Final = 6  # at which the danger zone is drawn


class Pursuit(NamedTuple):
    """A follower and its target at the same times t (n,) s.

    target, own, estimate : (n, 3) m;  v_target, v_own : (n,) m/s;  danger, zone : m;  told : (k, 3) times [s],
    distance as the follower had it, and its set-point [m];  stages : name and spell [s];  blocked : spells without
    fixes;  fixes : (m, 4) s and m, its receiver's own
    """

    t: Floats
    target: Floats
    own: Floats
    estimate: Floats
    v_target: Floats
    v_own: Floats
    danger: float
    zone: float
    told: Floats
    stages: Sequence[tuple[str, float, float]] = ()
    blocked: Sequence[tuple[float, float]] = ()
    fixes: Floats = np.zeros((0, 4))

    @property
    def distance(self) -> Floats:
        """(n,) m, the true one."""
        return np.asarray(np.linalg.norm(self.target - self.own, axis=1), np.float64)


@styled
def pursuit_figure(p: Pursuit, title: str = "") -> Figure:
    """From above, distance with its zones, what it was about, speeds, heights, errors of the estimate; one legend."""
    figure = Figure(figsize=(10.5, 7.4), layout="constrained")
    parts = figure.subplot_mosaic(
        [["map", "distance"], ["map", "stage"], ["map", "speed"], ["height", "error"]],
        width_ratios=(1.0, 1.35), height_ratios=(1.5, 0.25 + 0.12 * len({name for name, *_ in p.stages}), 1.0, 1.0),
    )  # fmt: skip
    from_above(parts["map"], p)
    distances(parts["distance"], p)
    stages(parts["stage"], p)
    over_time(parts["speed"], p, p.v_target, p.v_own, "speed [m/s]")
    over_time(parts["height"], p, p.target[:, 2], p.own[:, 2], "up [m]")
    parts["height"].margins(y=0.3)
    errors(parts["error"], p)
    for name in ("distance", "stage", "speed", "error", "height"):
        parts[name].set_xlim(p.t[0], p.t[-1])
        if name not in ("height", "error"):
            parts[name].tick_params(labelbottom=False)
    for name in ("height", "error"):
        parts[name].set_xlabel("time from start [s]")
    figure.align_ylabels([parts[name] for name in ("distance", "stage", "speed", "error")])
    figure.legend(handles=_legend(p), loc="outside upper left", ncols=5)
    if title:
        figure.suptitle(title)
    return figure


def from_above(ax: Axes, p: Pursuit) -> None:
    """Both ways over what the receiver said; the danger zone around the target at a few moments, the other zone at the
    last of them."""
    turns = np.linspace(0.0, 2.0 * np.pi, 61)
    ring = np.column_stack([np.cos(turns), np.sin(turns)])
    ax.plot(*p.fixes[:, 1:3].T, ".", ms=3.0, mew=0, alpha=0.35, color=FIXES, zorder=1)
    ax.plot(*(p.target[-1, :2] + p.zone * ring).T, color=MUTED, ls=":", lw=0.8, zorder=1)
    for k in np.linspace(0, len(p.t) - 1, MOMENTS).astype(int).tolist():
        ax.plot(*(p.target[k, :2] + p.danger * ring).T, color=REJECTED, lw=0.7, zorder=1)
        ax.plot(*np.vstack([p.target[k, :2], p.own[k, :2]]).T, color=GRID, lw=0.8, zorder=1)
    ax.plot(*p.target[:, :2].T, color=TARGET, zorder=2)
    ax.plot(*p.own[:, :2].T, color=OWN, zorder=3)
    ax.plot(*p.estimate[:, :2].T, color=KNOWN, lw=0.6, ls=(0, (4, 2)), zorder=4)
    for way, colour in ((p.target, TARGET), (p.own, OWN)):
        ax.plot(*way[0, :2], "o", ms=6.0, mfc="none", mec=colour, mew=1.0, zorder=5)
        ax.plot(*way[-1, :2], "o", ms=4.5, mfc=colour, mec=PAPER, mew=0.5, zorder=5)
    ax.set_aspect("equal", adjustable="datalim")
    ax.set_xlabel("east [m]")
    ax.set_ylabel("north [m]")


def distances(ax: Axes, p: Pursuit) -> None:
    """True and estimated distance, zones and set-point; spells without fixes shaded."""
    ax.axhspan(0.0, p.danger, color=REJECTED, alpha=0.12, lw=0)
    ax.axhspan(p.danger, p.zone, color=FUSED, alpha=0.08, lw=0)
    if len(p.told):
        ax.plot(p.told[:, 0], p.told[:, 2], color=MUTED, lw=0.9, ls="--")
        ax.plot(p.told[:, 0], p.told[:, 1], color=KNOWN, lw=0.7)
    ax.plot(p.t, p.distance, color=OWN)
    _shade(ax, p.blocked)
    known = float(p.told[:, 1].max()) if len(p.told) else 0.0  # may be far off: the true one stays readable
    ax.set_ylim(0.0, max(float(p.distance.max()), p.zone, min(known, 1.5 * float(p.distance.max()))) * 1.08)
    ax.set_ylabel("distance [m]")


def stages(ax: Axes, p: Pursuit) -> None:
    """What the follower was about when, a row for each."""
    names = list(dict.fromkeys(name for name, *_ in p.stages))
    for k, name in enumerate(names):
        spells = [(since, until - since) for n, since, until in p.stages if n == name]
        ax.broken_barh(spells, (k - 0.36, 0.72), color=MUTED, lw=0)
    ax.set_yticks(range(len(names)), names, fontsize=7)
    ax.set_ylim(len(names) - 0.4, -0.6)
    ax.grid(visible=False, axis="y")


def over_time(ax: Axes, p: Pursuit, target: Floats, own: Floats, name: str) -> None:
    """A quantity of both."""
    ax.plot(p.t, target, color=TARGET)
    ax.plot(p.t, own, color=OWN)
    ax.set_ylabel(name)


def errors(ax: Axes, p: Pursuit) -> None:
    """Of the estimate and of the receiver."""
    _shade(ax, p.blocked)
    if len(p.fixes):
        truth = np.column_stack([np.interp(p.fixes[:, 0], p.t, p.own[:, i]) for i in range(3)])
        off = np.linalg.norm(p.fixes[:, 1:] - truth, axis=1)
        ax.plot(p.fixes[:, 0], off, ".", ms=3.5, mew=0, alpha=0.7, color=FIXES)
    ax.plot(p.t, np.linalg.norm(p.estimate - p.own, axis=1), color=KNOWN, lw=1.0)
    ax.set_ylim(bottom=0.0)
    ax.set_ylabel("error in space [m]")


def _legend(p: Pursuit) -> list[Any]:
    handles: list[Any] = [
        Line2D([], [], color=TARGET, label="target"), Line2D([], [], color=OWN, label="follower, truly"),
        Line2D([], [], color=KNOWN, lw=0.9, label="as the follower knows it"),
        Line2D([], [], color=FIXES, marker=".", ls="", label="its fixes"),
        Line2D([], [], color=MUTED, lw=0.9, ls="--", label="set-point"),
        Patch(color=REJECTED, alpha=0.2, lw=0, label="danger zone"),
        Patch(color=FUSED, alpha=0.15, lw=0, label="rendezvous zone"),
    ]  # fmt: skip
    return handles + ([Patch(color=FIXES, alpha=0.25, lw=0, label="without fixes")] if len(p.blocked) else [])


def _shade(ax: Axes, spells: Sequence[tuple[float, float]]) -> None:
    for since, until in spells:
        ax.axvspan(since, until, color=FIXES, alpha=0.2, lw=0)
