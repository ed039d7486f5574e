"""Maps: where the robot was, how sure of it the filter is, and what each source alone says."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.transforms import ScaledTranslation
from mpl_toolkits.axes_grid1.anchored_artists import AnchoredSizeBar

from outrider.data import Estimates, Run, Trajectory, Verdict
from outrider.plot.series import every
from outrider.plot.shapes import aligned_at_start, ellipses, shown_ellipses
from outrider.plot.style import (
    FUSED,
    INK,
    LEFT,
    LOCAL,
    MUTED,
    PAPER,
    REJECTED,
    RIGHT,
    WIDTH,
    finish,
    label,
    source_colours,
    styled,
)
from outrider.typing import Floats

TRACK_POINTS = 4000
REFUSED_SHOWN = 2000


def run_colours(run: Run) -> dict[str, str]:
    """The colour of every source of a run, in the order of its accounts."""
    return source_colours([*(a.source for a in run.accounts), *run.tracks, *run.innovations, *run.health])


@styled
def map_figure(run: Run, *, reference: Trajectory | None = None) -> Figure:
    """The site from above: fused and local track, every source alone, 95 % ellipses, start, end and resets."""
    fused = run.fused.pose
    local = aligned_at_start(run.local.pose, fused) if run.local is not None else None
    tracks = {name: _laid(run, name) for name in run_colours(run) if name in run.tracks}
    near = [_outlines(fused), *tracks.values()]
    view = _view([fused.p, *([reference.p] if reference is not None else [])], near)
    figure, ax = _sheet(view)
    colours = run_colours(run)
    handles = [_source_track(ax, run, name, p, colours[name]) for name, p in tracks.items()]
    if reference is not None:
        handles.append(_track(ax, reference.p, INK, "reference", width=1.0))
    if local is not None and len(local):
        handles.append(_track(ax, local, LOCAL, "local (odom)", dashed=True, width=1.1))
    handles += _estimate(ax, run.fused, FUSED, "fused (map)")
    handles += [*_refused(ax, run), *_resets(ax, run)]
    return finish(figure, [h for h in handles if h is not None])


@styled
def odom_figure(run: Run) -> Figure | None:
    """The local estimate in its own odom frame, and the fused track laid on it; None without a local one."""
    if run.local is None or not len(run.local.pose):
        return None
    fused = aligned_at_start(run.fused.pose, run.local.pose)
    figure, ax = _sheet(_view([run.local.pose.p, fused], [_outlines(run.local.pose)]), "odom x", "odom y")
    handles = [_track(ax, fused, FUSED, "fused (map)", width=1.0)]
    handles += _estimate(ax, run.local, LOCAL, "local (odom)", doubt=False)
    return finish(figure, [h for h in handles if h is not None])


@styled
def two_tracks(estimate: Trajectory, reference: Trajectory, names: tuple[str, str]) -> Figure:
    """An estimate and a reference on one map, as they stand, with the ellipses of the estimate."""
    figure, ax = _sheet(_view([estimate.p, reference.p], [_outlines(estimate)]))
    handles = [_track(ax, reference.p, INK, names[1], width=1.0), _track(ax, estimate.p, FUSED, names[0])]
    if len(estimate):
        handles += [_ellipses(ax, estimate, FUSED, names[0]), *_ends(ax, estimate.p)]
    return finish(figure, [h for h in handles if h is not None])


def _view(lines: list[Floats], near: list[Floats]) -> tuple[Floats, Floats]:
    """Lower and upper corner of the map: all of `lines`, and of `near` the points that stay in their vicinity."""
    known = [p[np.isfinite(p).all(axis=1), :2] for p in lines]
    points = np.concatenate([k for k in known if k.size] or [np.zeros((1, 2))])
    low, high = points.min(axis=0), points.max(axis=0)
    reach = max(float(np.max(high - low)), 2.0)
    first, last = low - 0.5 * reach, high + 0.5 * reach
    for p in near:
        inside = p[((p[:, :2] > first) & (p[:, :2] < last)).all(axis=1), :2]
        if inside.size:
            low, high = np.minimum(low, inside.min(axis=0)), np.maximum(high, inside.max(axis=0))
    margin = max(0.05 * float(np.max(high - low)), 0.5)
    return low - margin, high + margin


def _sheet(view: tuple[Floats, Floats], x: str = "east", y: str = "north") -> tuple[Figure, Axes]:
    """Empty map paper that shows a view at equal scale, with a scale bar below the axes."""
    low, high = view
    wide = WIDTH - LEFT - RIGHT
    tall = float(np.clip(wide * (high[1] - low[1]) / (high[0] - low[0]), 3.2, 6.8))
    scale = max((high[0] - low[0]) / wide, (high[1] - low[1]) / tall)  # metres per inch
    (x0, y0), (x_half, y_half) = (low + high) / 2, (scale * wide / 2, scale * tall / 2)
    figure = Figure(figsize=(WIDTH, tall))
    ax = figure.add_subplot()
    ax.set_xlim(x0 - x_half, x0 + x_half)
    ax.set_ylim(y0 - y_half, y0 + y_half)
    ax.set_aspect("equal", adjustable="box")
    ax.set_autoscale_on(False)
    ax.set_xlabel(f"{x} [m]")
    ax.set_ylabel(f"{y} [m]")
    size = _round_length(2 * x_half / 6)
    below = ax.transAxes + ScaledTranslation(0.0, -0.25, figure.dpi_scale_trans)
    ax.add_artist(
        AnchoredSizeBar(
            ax.transData,
            size,
            f"{size:g} m",
            "upper right",
            frameon=False,
            color=MUTED,
            pad=0.0,
            borderpad=0.0,
            sep=3,
            bbox_to_anchor=(1.0, 0.0),
            bbox_transform=below,
        )
    )
    return figure, ax


def _round_length(length: float) -> float:
    """The largest 1, 2 or 5 times a power of ten below a length."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(power * max(f for f in (1, 2, 5) if f * power <= length * (1 + 1e-9)))


def _track(ax: Axes, p: Floats, colour: str, name: str, *, dashed: bool = False, width: float = 1.6) -> Line2D | None:
    rows = every(len(p), TRACK_POINTS)
    if not rows.size:
        return None
    (line,) = ax.plot(
        p[rows, 0],
        p[rows, 1],
        color=colour,
        label=label(name),
        linewidth=width,
        zorder=4,
        linestyle=(0, (4, 2)) if dashed else "-",
    )
    return line


def _kind(run: Run, name: str) -> str:
    return next((a.kind for a in run.accounts if a.source == name), "")


def _laid(run: Run, name: str) -> Floats:
    """Positions of one source alone; what a base integrated from an origin of its own is laid on the fused track."""
    track = run.tracks[name]
    return aligned_at_start(track, run.fused.pose) if "ODOM" in _kind(run, name) else track.p


def _source_track(ax: Axes, run: Run, name: str, p: Floats, colour: str) -> Line2D | None:
    """One source alone: absolute positions as dots, integrated ones as a thin line."""
    kind, rows = _kind(run, name), every(len(p), TRACK_POINTS)
    if not rows.size:
        return None
    if "ODOM" in kind or "ESTIMATE" in kind or "TWIST" in kind:
        return _track(ax, p, colour, name, width=0.9)
    (dots,) = ax.plot(
        p[rows, 0],
        p[rows, 1],
        "o",
        markersize=2.6,
        markeredgewidth=0,
        color=colour,
        alpha=0.75,
        label=label(name),
        zorder=3,
        rasterized=rows.size > 600,
    )
    return dots


def _estimate(ax: Axes, estimates: Estimates, colour: str, name: str, *, doubt: bool = True) -> list[Line2D | None]:
    """An estimate's track (pale where it is declared invalid, if `doubt`), its ellipses, and its two ends."""
    pose = estimates.pose
    if not len(pose):
        return []
    handles = [_track(ax, pose.p, colour, name)]
    bad = estimates.valid[:, 0] == 0 if estimates.valid.shape[0] else np.zeros(len(pose), np.bool_)
    if doubt and bad.any():
        gaps = (0, (0.9, 0.9))
        rows = every(len(pose), TRACK_POINTS)
        p = np.where(bad[:, None], pose.p, np.nan)[rows]
        ax.plot(p[:, 0], p[:, 1], color=PAPER, linestyle=gaps, linewidth=1.8, zorder=4.5)
        handles.append(
            Line2D([], [], color=colour, linestyle=gaps, linewidth=1.6, label=f"{name.split()[0]}, declared invalid")
        )
    return [*handles, _ellipses(ax, pose, colour, name.split()[0]), *_ends(ax, pose.p)]


def _outlines(pose: Trajectory) -> Floats:
    """(n, 2) points on the ellipses that a map of this track shows."""
    rows = shown_ellipses(pose)
    return ellipses(pose.p[rows], pose.P[rows]).reshape(-1, 2) if rows.size else np.zeros((0, 2))


def _ellipses(ax: Axes, pose: Trajectory, colour: str, name: str) -> Line2D | None:
    rows = shown_ellipses(pose)
    if not rows.size:
        return None
    shapes = PolyCollection(
        list(ellipses(pose.p[rows], pose.P[rows])),
        facecolors=(colour, 0.07),
        edgecolors=(colour, 0.6),
        linewidths=0.8,
        zorder=2,
    )
    ax.add_collection(shapes, autolim=False)
    return Line2D(
        [],
        [],
        linestyle="",
        marker="o",
        markersize=9,
        markerfacecolor=(colour, 0.10),
        markeredgecolor=(colour, 0.75),
        label=f"95 % ellipse, {name}",
    )


def _ends(ax: Axes, p: Floats) -> list[Line2D]:
    known = p[np.isfinite(p).all(axis=1)]
    ends: list[Line2D] = []
    for point, marker, size, inside, text in (
        (known[:1], "o", 9.5, PAPER, "start"),
        (known[-1:], "s", 4.5, INK, "end"),
    ):
        ends += ax.plot(
            point[:, 0],
            point[:, 1],
            marker,
            color=inside,
            markeredgecolor=INK,
            markeredgewidth=1.4,
            markersize=size,
            label=text,
            linestyle="",
            zorder=6,
        )
    return ends


def _refused(ax: Axes, run: Run) -> list[Line2D]:
    """A cross at every position that its gate refused."""
    places = [
        i.z[i.verdict == Verdict.GATED, :2] for i in run.innovations.values() if i.columns[:2] == ("east", "north")
    ]
    p = np.concatenate([np.zeros((0, 2)), *places])
    if not len(p):
        return []
    rows = every(len(p), REFUSED_SHOWN)
    name = f"gated ({len(p)})"
    return ax.plot(p[rows, 0], p[rows, 1], "x", color=REJECTED, markersize=5, zorder=5, label=name)


def _resets(ax: Axes, run: Run) -> list[Line2D]:
    """A cross where the estimate was reset on purpose."""
    pose = run.fused.pose
    if not run.resets or not len(pose):
        return []
    rows = np.searchsorted(pose.t, [r.t for r in run.resets]).clip(0, len(pose) - 1)
    return ax.plot(
        pose.p[rows, 0],
        pose.p[rows, 1],
        "X",
        color=REJECTED,
        markeredgecolor=PAPER,
        markersize=9,
        zorder=7,
        linestyle="",
        label="reset",
    )
