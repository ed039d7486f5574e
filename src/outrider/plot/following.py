"""One aircraft behind another: the way from above, distance and zones, speeds, errors over time."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from outrider.plot.style import FUSED, GRID, MUTED, REJECTED, SOURCES, styled
from outrider.typing import Floats

TARGET, OWN = SOURCES[1], FUSED


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
    """From above, distance with its zones, speeds, height, errors of the estimate."""
    figure = Figure(figsize=(10.5, 6.6), layout="constrained")
    parts = figure.subplot_mosaic(
        [["map", "distance"], ["map", "speed"], ["height", "error"]], width_ratios=(1.0, 1.35)
    )
    from_above(parts["map"], p)
    distances(parts["distance"], p)
    speeds(parts["speed"], p)
    ax = parts["height"]
    ax.plot(p.t, p.target[:, 2], color=TARGET)
    ax.plot(p.t, p.own[:, 2], color=OWN)
    ax.set_ylabel("up [m]")
    ax.margins(y=0.3)
    errors(parts["error"], p)
    for name in ("height", "error"):
        parts[name].set_xlabel("time from start [s]")
    figure.suptitle(title)
    return figure


def from_above(ax: Axes, p: Pursuit) -> None:
    """Both ways, the danger zone around the target at a few moments."""
    turns = np.linspace(0.0, 2.0 * np.pi, 61)
    for k in np.linspace(0, len(p.t) - 1, 6).astype(int).tolist():
        for radius, style in ((p.danger, "-"), (p.zone, ":")):
            circle = p.target[k, :2] + radius * np.column_stack([np.cos(turns), np.sin(turns)])
            ax.plot(*circle.T, color=REJECTED if style == "-" else MUTED, ls=style, lw=0.7)
        ax.plot(*np.vstack([p.target[k, :2], p.own[k, :2]]).T, color=GRID, lw=0.8)
    ax.plot(*p.target[:, :2].T, color=TARGET, label="target")
    ax.plot(*p.own[:, :2].T, color=OWN, label="follower")
    ax.plot(*p.estimate[:, :2].T, color=SOURCES[0], lw=0.7, ls="--", label="as it estimates")
    ax.plot(*p.fixes[:, 1:3].T, ".", ms=2.5, color=SOURCES[6], label="its fixes")
    ax.set_aspect("equal", adjustable="datalim")
    ax.set_xlabel("east [m]")
    ax.set_ylabel("north [m]")
    ax.legend(loc="best", fontsize=7)


def distances(ax: Axes, p: Pursuit) -> None:
    """True and estimated distance, zones and set-point; stages below, spells without fixes shaded."""
    ax.axhspan(0.0, p.danger, color=REJECTED, alpha=0.12, lw=0)
    ax.axhspan(p.danger, p.zone, color=FUSED, alpha=0.08, lw=0)
    if len(p.told):
        ax.plot(p.told[:, 0], p.told[:, 1], color=SOURCES[0], lw=0.7, label="as the follower knows it")
        ax.plot(p.told[:, 0], p.told[:, 2], color=MUTED, lw=0.9, ls="--", label="set-point")
    ax.plot(p.t, p.distance, color=OWN, label="true")
    top = max(float(np.percentile(p.distance, 97)), p.zone) * 1.25
    for name, since, until in p.stages:
        if until - since > 0.04 * (p.t[-1] - p.t[0]):
            ax.text(
                0.5 * (since + until), 0.99 * top, name, ha="center", va="top", fontsize=5.5, rotation=90, color=MUTED
            )
        ax.axvline(since, color=GRID, lw=0.6)
    _shade(ax, p.blocked)
    ax.set_ylim(0.0, top)
    ax.set_ylabel("distance [m]")
    ax.legend(loc="lower right", fontsize=7, ncols=3)


def speeds(ax: Axes, p: Pursuit) -> None:
    """Of both."""
    ax.plot(p.t, p.v_target, color=TARGET, label="target")
    ax.plot(p.t, p.v_own, color=OWN, label="follower")
    ax.set_ylabel("speed [m/s]")
    ax.legend(loc="lower right", fontsize=7, ncols=2)


def errors(ax: Axes, p: Pursuit) -> None:
    """Of the estimate and of the receiver."""
    _shade(ax, p.blocked)
    ax.plot(p.t, np.linalg.norm(p.estimate - p.own, axis=1), color=SOURCES[0], label="estimate")
    if len(p.fixes):
        truth = np.column_stack([np.interp(p.fixes[:, 0], p.t, p.own[:, i]) for i in range(3)])
        ax.plot(
            p.fixes[:, 0], np.linalg.norm(p.fixes[:, 1:] - truth, axis=1), ".", ms=3, color=SOURCES[6], label="fixes"
        )
    ax.set_ylabel("error [m]")
    ax.legend(loc="upper right", fontsize=7, ncols=2)


def _shade(ax: Axes, spells: Sequence[tuple[float, float]]) -> None:
    for since, until in spells:
        ax.axvspan(since, until, color=SOURCES[6], alpha=0.2, lw=0)


@styled
def tracks_figure(ways: Mapping[str, Pursuit]) -> Figure:
    """Distances of several runs, one below the other."""
    figure = Figure(figsize=(9.6, 1.9 * len(ways) + 0.3), layout="constrained")
    for ax, (name, p) in zip(figure.subplots(len(ways), 1, squeeze=False)[:, 0], ways.items(), strict=True):
        distances(ax, p)
        ax.set_title(name, fontsize=8)
    return figure
