"""Heading, speed and height over time, how sure the filter is of its position, and its slow states."""

from collections.abc import Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import StrMethodFormatter

from outrider.data import Block, Estimates, Manifold, Run
from outrider.plot.series import break_wraps, end_time, extremes, has_height, position_sd, seconds, spans, speed, yaw_sd
from outrider.plot.style import AXES, FUSED, LOCAL, MUTED, REJECTED, finish, panels, styled
from outrider.typing import Floats

SLOW = ("bias", "scale", "wind", "offset")  # words in the name of a state that changes slowly
_IN_DEGREES = {"rad": "deg", "rad/s": "deg/s"}


@styled
def motion_figure(run: Run) -> Figure | None:
    """Heading [deg], speed [m/s] and, if it is estimated, height [m]; with 2-sigma bands for the fused estimate.

    The local estimate has none: its heading drifts without bound, and its band would cover everything.
    """
    estimates = [(run.fused, FUSED, "fused (map)")]
    if run.local is not None:
        estimates.append((run.local, LOCAL, "local (odom)"))
    estimates = [e for e in estimates if e[0].t.size]
    if not estimates:
        return None
    tall = has_height(run.fused.pose)
    draws = [("heading [deg]", _heading), ("speed [m/s]", _speed), *([("height [m]", _height)] if tall else [])]
    figure, axes = panels(len(draws))
    for ax, (unit, draw) in zip(axes, draws, strict=True):
        ax.set_ylabel(unit)
        for estimate, colour, _ in estimates:
            draw(ax, estimate, run.start, colour, band=estimate is run.fused)
    axes[-1].set_xlim(0.0, end_time(run))
    axes[0].set_ylim(-190, 190)
    axes[0].set_yticks([-180, -90, 0, 90, 180])
    handles: list[Artist] = [Line2D([], [], color=colour, label=name) for _, colour, name in estimates]
    handles.append(Patch(facecolor=(MUTED, 0.25), label="2σ, fused"))
    return finish(figure, [*handles, *_shade(axes[0], run, 2, "heading"), *_mark_resets(axes, run)])


def _heading(ax: Axes, estimates: Estimates, start: int, colour: str, *, band: bool) -> None:
    """Counter-clockwise from east, broken where it wraps."""
    yaw = np.degrees(estimates.pose.yaw)
    sd = np.minimum(np.degrees(yaw_sd(estimates.pose)), 180.0)
    rows = extremes(yaw)
    _line(ax, seconds(estimates.t, start)[rows], break_wraps(yaw[rows]), sd[rows] if band else None, colour)


def _speed(ax: Axes, estimates: Estimates, start: int, colour: str, *, band: bool) -> None:
    value, sd = speed(estimates)
    rows = extremes(value)
    _line(ax, seconds(estimates.t, start)[rows], value[rows], sd[rows] if band else None, colour)
    ax.set_ylim(*_around(ax, value, sd, floor=0.0))


def _height(ax: Axes, estimates: Estimates, start: int, colour: str, *, band: bool) -> None:
    value, sd = estimates.pose.p[:, 2], position_sd(estimates)[:, 2]
    rows = extremes(value)
    _line(ax, seconds(estimates.t, start)[rows], value[rows], sd[rows] if band else None, colour)
    ax.set_ylim(*_around(ax, value, sd))


def _around(ax: Axes, value: Floats, sd: Floats, floor: float = -np.inf) -> tuple[float, float]:
    """Limits that show the values well, however wide the band is, and all that an earlier curve needed."""
    known = value[np.isfinite(value)]
    if not known.size:
        return ax.get_ylim()
    low, high = float(known.min()), float(known.max())
    band = float(np.median(sd[np.isfinite(sd)])) if np.isfinite(sd).any() else 0.0
    margin = max(0.1 * (high - low), 0.2, min(2.3 * band, 2.0 * (high - low) + 1.0))
    if len(ax.lines) > 1:
        low, high = min(low - margin, ax.get_ylim()[0]), max(high + margin, ax.get_ylim()[1])
        return max(low, floor), high
    return max(low - margin, floor), high + margin


@styled
def sigma_figure(run: Run) -> Figure | None:
    """Standard deviation of the position over time [m], with the times at which it is declared invalid in grey."""
    if not run.fused.t.size or not np.isfinite(position_sd(run.fused)).any():
        return None
    figure, (ax,) = panels(1, 2.4)
    start = run.start
    sd = position_sd(run.fused)
    handles: list[Artist] = []
    for k, name in enumerate(("east", "north", "up")):
        if np.nanmax(sd[:, k], initial=0.0) > 1e-9:
            handles += _curve(ax, seconds(run.fused.t, start), sd[:, k], AXES[k], f"fused, {name}")
    if run.local is not None and run.local.t.size:
        horizontal = np.max(position_sd(run.local)[:, :2], axis=1)
        handles += _curve(ax, seconds(run.local.t, start), horizontal, LOCAL, "local, horizontal", dashed=True)
    ax.set_ylabel("position 1σ [m]")
    ax.set_xlim(0.0, end_time(run))
    _log_if_wide(ax, sd)
    return finish(figure, [*handles, *_shade(ax, run, 0, "position"), *_mark_resets([ax], run)])


def _curve(ax: Axes, t: Floats, y: Floats, colour: str, name: str, *, dashed: bool = False) -> list[Line2D]:
    rows = extremes(y)
    return ax.plot(t[rows], y[rows], color=colour, label=name, linestyle=(0, (4, 2)) if dashed else "-")


def _log_if_wide(ax: Axes, y: Floats) -> None:
    known = y[np.isfinite(y) & (y > 1e-9)]
    if known.size and known.max() > 20 * known.min():
        ax.set_yscale("log")
        ax.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    else:
        ax.set_ylim(bottom=0.0)


@styled
def slow_figure(run: Run) -> Figure | None:
    """Biases, scales and the like with their 2-sigma bands, one panel per state; None if nothing told any of them."""
    fused = run.fused
    blocks = [b for b in fused.layout if _is_slow(b) and _learned(fused, b)]
    if not blocks:
        return None
    figure, axes = panels(len(blocks), 1.45)
    axes[-1].set_xlim(0.0, end_time(run))
    t = seconds(fused.t, run.start)
    for ax, block in zip(axes, blocks, strict=True):
        _slow_panel(ax, t, fused, block)
    widest = max(b.error.stop - b.error.start for b in blocks)
    handles: list[Artist] = [
        Line2D([], [], color=AXES[k % 3], label="xyz"[k]) for k in range(min(widest, 3)) if widest > 1
    ]
    return finish(figure, [*handles, Patch(facecolor=(MUTED, 0.25), label="2σ"), *_mark_resets(axes, run)])


def _is_slow(block: Block) -> bool:
    return block.manifold is Manifold.VECTOR and any(word in block.name for word in SLOW)


def _learned(fused: Estimates, block: Block) -> bool:
    """Whether the log said anything about a state: it moved by more than a trace of its deviation."""
    moved = np.nanmax(np.ptp(fused.x[:, block.state], axis=0), initial=0.0) if fused.t.size else 0.0
    return bool(moved > 0.01 * np.nanmax(fused.sd[:, block.error], initial=0.0))


def _slow_panel(ax: Axes, t: Floats, fused: Estimates, block: Block) -> None:
    scale = 180 / np.pi if block.unit in _IN_DEGREES else 1.0
    unit = _IN_DEGREES.get(block.unit, block.unit).replace("^2", "²")
    ax.set_ylabel(block.name.replace("_", " ") + (f"\n[{unit}]" if unit and unit != "-" else ""))
    ax.axhline(0.0, color=MUTED, linewidth=0.6)
    x, sd = fused.x[:, block.state] * scale, fused.sd[:, block.error] * scale
    for k in range(x.shape[1]):
        rows = extremes(x[:, k])
        _line(ax, t[rows], x[rows, k], sd[rows, k], AXES[k % 3])
    settled = sd[sd.shape[0] // 10 :]  # the first tenth holds the prior, which would flatten everything after it
    reach = 1.15 * np.nanmax(np.abs(x[x.shape[0] // 10 :]) + 2 * settled, initial=1e-9)
    ax.set_ylim(-reach, reach)


def _line(ax: Axes, t: Floats, y: Floats, sd: Floats | None, colour: str) -> None:
    """A curve with its 2-sigma band, if one is given; a single sample shows as a dot with a bar."""
    if t.size == 1:
        ax.errorbar(t, y, yerr=None if sd is None else 2 * np.nan_to_num(sd), fmt="o", color=colour, capsize=3)
        return
    ax.plot(t, y, color=colour)
    if sd is not None and np.isfinite(sd).any():
        ax.fill_between(t, y - 2 * sd, y + 2 * sd, color=colour, alpha=0.18, linewidth=0)


def _shade(ax: Axes, run: Run, column: int, what: str) -> list[Patch]:
    """Grey where the fused estimate does not stand by its position (0), velocity (1) or heading (2)."""
    if not run.fused.valid.shape[0]:
        return []
    found = spans(seconds(run.fused.t, run.start), run.fused.valid[:, column] == 0)
    for begin, end in found:
        ax.axvspan(begin, end, facecolor=(MUTED, 0.22), edgecolor="none", zorder=0)
    return [Patch(facecolor=(MUTED, 0.22), label=f"{what} declared invalid")] if found else []


def _mark_resets(axes: Sequence[Axes], run: Run) -> list[Line2D]:
    for reset in run.resets[:100]:
        for ax in axes:
            ax.axvline((reset.t - run.start) * 1e-9, color=REJECTED, linewidth=0.9, linestyle=(0, (1, 1.5)))
    return [Line2D([], [], color=REJECTED, linewidth=0.9, linestyle=(0, (1, 1.5)), label="reset")] if run.resets else []
