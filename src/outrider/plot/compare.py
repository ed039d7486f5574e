"""One trajectory against another: how far apart they are over time, and both on a map. Nothing is aligned."""

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from outrider.data import Trajectory
from outrider.eval import Association, associate, heading_errors, position_errors
from outrider.plot.maps import two_tracks
from outrider.plot.series import extremes, has_height, radius_95, seconds, yaw_sd
from outrider.plot.style import FUSED, MUTED, finish, panels, styled
from outrider.typing import Floats


@styled
def error_figure(estimate: Trajectory, reference: Trajectory, *, start: int | None = None) -> Figure | None:
    """Horizontal, height [m] and heading error [deg] over time, with what the estimate expected of itself.

    Time counts from `start` [ns], else from the first stamp of either track. None where the two do not overlap.
    """
    if not len(estimate) or not len(reference):
        return None
    pairs = associate(estimate, reference)
    curves = [c for c in _curves(pairs) if np.isfinite(c[1]).any()]
    if not curves:
        return None
    zero = min(int(estimate.t[0]), int(reference.t[0])) if start is None else start
    figure, axes = panels(len(curves), 1.6)
    expected = False
    for ax, (name, error, limit) in zip(axes, curves, strict=True):
        ax.set_ylabel(name)
        expected |= _error(ax, seconds(pairs.reference.t, zero), error, limit)
    axes[0].set_ylim(bottom=0.0)
    if start is not None:
        axes[0].set_xlim(left=0.0)
    handles: list[Artist] = [Line2D([], [], color=FUSED, label="estimate minus reference")]
    if expected:
        handles.append(Line2D([], [], color=MUTED, linewidth=0.9, linestyle=(0, (3, 2)), label="95 % expected"))
    return finish(figure, handles)


def _curves(pairs: Association) -> list[tuple[str, Floats, Floats]]:
    """Label, error and 95 % limit of each panel; no height panel where none is estimated."""
    e, pose = position_errors(pairs, 3), pairs.estimate
    up = np.sqrt(np.maximum(pose.P[:, 2, 2], 0.0)) if pose.P.shape[0] else np.full(len(pose), np.nan)
    horizontal = ("horizontal\nerror [m]", np.hypot(e[:, 0], e[:, 1]), radius_95(pose))
    height = ("height\nerror [m]", e[:, 2], 1.96 * up)
    heading = ("heading\nerror [deg]", np.degrees(heading_errors(pairs)), 1.96 * np.degrees(yaw_sd(pose)))
    return [horizontal, height, heading] if has_height(pose) else [horizontal, heading]


def _error(ax: Axes, t: Floats, error: Floats, limit: Floats) -> bool:
    """Draw an error and its expected size; returns whether the latter is known. The error sets the scale."""
    rows = extremes(error)
    ax.plot(t[rows], error[rows], color=FUSED, marker="." if rows.size < 200 else "", markersize=4)
    signed = bool(np.nanmin(error) < 0.0)
    if signed:
        ax.axhline(0.0, color=MUTED, linewidth=0.6)
    known = np.isfinite(limit).any()
    if known:
        rows = extremes(limit)
        largest = float(np.nanmax(np.abs(error)))
        reach = max(1.15 * largest, min(1.15 * float(np.nanmedian(limit)), 4.0 * largest)) or 1e-3
        for sign in (-1, 1) if signed else (1,):
            ax.plot(t[rows], sign * limit[rows], color=MUTED, linewidth=0.9, linestyle=(0, (3, 2)))
        ax.set_ylim(-reach if signed else 0.0, reach)
    return bool(known)


def compare_figures(
    estimate: Trajectory, reference: Trajectory, *, names: tuple[str, str] = ("estimate", "reference")
) -> dict[str, Figure]:
    """The figures of `outrider eval`: "map" with both tracks and, where they overlap in time, "error" over time."""
    figures = {"map": two_tracks(estimate, reference, names)}
    error = error_figure(estimate, reference)
    return figures if error is None else {**figures, "error": error}
