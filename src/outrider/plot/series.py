"""What the figures and tables show, computed from a `Run`: times, headings, speeds, their deviations, and thinning."""

import numpy as np
from scipy.special import chdtri

from outrider.data import Estimates, Manifold, Run, Trajectory
from outrider.typing import Bools, Floats, Ints

GAP = 3.0  # s without a record before a source counts as silent
CHI2_95_2D = 5.991  # 95 % of a two-dimensional Gaussian lie inside this squared radius


def seconds(t: Ints, start: int) -> Floats:
    """Stamps [ns] as seconds from `start`."""
    return (t - start).astype(np.float64) * 1e-9


def end_time(run: Run) -> float:
    """The last second the run knows of; never zero, so that even a single sample gives an axis."""
    last = float(seconds(run.fused.t[-1:], run.start)[0]) if run.fused.t.size else 0.0
    known = [a.last for a in run.accounts if np.isfinite(a.last)]
    return max([last, *known, *(float(h[-1, 0]) for h in run.health.values() if h.shape[0])], default=0.0) or 1.0


def has_height(pose: Trajectory) -> bool:
    """Whether a height was estimated; the covariance of a planar vehicle has none."""
    if pose.P.shape[0]:
        return bool((pose.P[:, 2, 2] > 0.0).any())
    return bool(np.nanmax(np.abs(pose.p[:, 2]), initial=0.0) > 1e-6)


def with_gaps(t: Floats, *values: Floats) -> tuple[Floats, ...]:
    """The same curve with NaN where the source was silent, so that no line bridges what nobody measured."""
    steps = np.diff(t)
    at = np.flatnonzero(steps > max(GAP, 8 * float(np.median(steps)))) + 1 if steps.size else np.zeros(0, np.int64)
    return np.insert(t, at, t[at - 1]), *(np.insert(v, at, np.nan) for v in values)


def gate(dof: Ints | Floats, tail: float) -> Floats:
    """The NIS that a good record exceeds with probability `tail`."""
    values, which = np.unique(np.maximum(dof, 1), return_inverse=True)
    return np.asarray(chdtri(values, tail), np.float64)[which]


def position_sd(estimates: Estimates) -> Floats:
    """(n, 3) standard deviation of east, north, up [m]; NaN where unknown."""
    P = estimates.pose.P
    if not P.shape[0]:
        return np.full((estimates.t.size, 3), np.nan)
    return np.sqrt(np.maximum(np.diagonal(P[:, :3, :3], axis1=1, axis2=2), 0.0))


def radius_95(pose: Trajectory, rows: Ints | slice = slice(None)) -> Floats:
    """(n,) larger semi-axis [m] of the horizontal 95 % ellipse; NaN where unknown."""
    if not pose.P.shape[0]:
        return np.full(len(pose), np.nan)[rows]
    a, b, c = pose.P[rows, 0, 0], pose.P[rows, 0, 1], pose.P[rows, 1, 1]
    largest = (a + c) / 2 + np.hypot((a - c) / 2, b)
    return np.sqrt(CHI2_95_2D * np.maximum(largest, 0.0))


def yaw_sd(pose: Trajectory) -> Floats:
    """(n,) standard deviation of the heading [rad]: the body-frame rotation error seen about the vertical."""
    if not pose.P.shape[0]:
        return np.full(len(pose), np.nan)
    x, y, z, w = pose.q.T
    row = np.stack([np.zeros(len(pose)), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=1)  # last row of R, x cut
    row /= np.maximum((row**2).sum(axis=1, keepdims=True), 1e-9)  # yaw' = (w_y sin roll + w_z cos roll) / cos pitch
    return np.sqrt(np.maximum(np.einsum("ni,nij,nj->n", row, pose.P[:, 3:, 3:], row), 0.0))


def speed(estimates: Estimates) -> tuple[Floats, Floats]:
    """Speed and its standard deviation [m/s], the larger of the two horizontal components; empty if not estimated."""
    v = estimates.pose.v
    blocks = [b for b in estimates.layout if b.name.startswith("vel") and b.manifold is Manifold.VECTOR]
    if not v.shape[0]:
        return np.zeros(0), np.zeros(0)
    value = np.linalg.norm(v, axis=1)
    if not blocks:
        return value, np.full(value.size, np.nan)
    return value, np.max(estimates.sd[:, blocks[0].error][:, :2], axis=1)


def spans(t: Floats, flag: Bools) -> list[tuple[float, float]]:
    """Times over which a flag holds, each as (begin, end); spans closer than a thousandth of the whole are joined."""
    if not t.size or not flag.any():
        return []
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flag, [False]]).astype(np.int8)))
    out: list[tuple[float, float]] = []
    least = 1e-3 * float(t[-1] - t[0])
    for begin, end in zip(t[edges[::2]], t[np.minimum(edges[1::2], t.size - 1)], strict=True):
        if out and begin - out[-1][1] < least:
            out[-1] = (out[-1][0], float(end))
        else:
            out.append((float(begin), float(end)))
    return out


def extremes(y: Floats, limit: int = 1500) -> Ints:
    """Rows that draw the same curve with at most about `limit` points: first, lowest and highest of equal slices."""
    n = y.size
    if n <= limit:
        return np.arange(n)
    width = -(-n // max(limit // 3, 1))
    rows = -(-n // width)
    grid = np.full(rows * width, np.nan)
    grid[:n] = y
    grid = grid.reshape(rows, width)
    first = np.arange(rows) * width
    low = first + np.where(np.isnan(grid), np.inf, grid).argmin(axis=1)
    high = first + np.where(np.isnan(grid), -np.inf, grid).argmax(axis=1)
    keep = np.unique(np.concatenate([first, low, high, [n - 1]]))
    return keep[keep < n]


def every(n: int, limit: int) -> Ints:
    """At most `limit` rows, evenly spread, the last among them."""
    return np.arange(n) if n <= limit else np.unique(np.linspace(0, n - 1, limit).astype(np.int64))


def break_wraps(angle_deg: Floats) -> Floats:
    """The same angles with NaN where they jump through +-180, so that no line crosses the plot."""
    out = angle_deg.copy()
    out[1:][np.abs(np.diff(angle_deg)) > 180.0] = np.nan
    return out
