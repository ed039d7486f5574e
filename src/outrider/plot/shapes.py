"""What is laid on a map: one track on another where both know their pose, and ellipses that do not cover it."""

import numpy as np

from outrider.data import Trajectory
from outrider.plot.series import CHI2_95_2D, radius_95, yaw_sd
from outrider.typing import Floats, Ints

ELLIPSES = 24
LARGEST = 0.25  # of the path's extent; larger ellipses would cover the map and are left out


def aligned_at_start(moved: Trajectory, fixed: Trajectory) -> Floats:
    """Positions (n, 3) of a track turned about the vertical and shifted onto another where both first know a pose."""
    i, k = _first_common(moved, fixed)
    if i < 0:
        return moved.p
    turn = float(fixed.yaw[k] - moved.yaw[i])
    c, s = np.cos(turn), np.sin(turn)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return (moved.p - moved.p[i]) @ R.T + fixed.p[k]


def _first_common(a: Trajectory, b: Trajectory) -> tuple[int, int]:
    """Rows of two tracks nearest in time when both first know position and heading well; (-1, -1) if they never do."""
    good_a, good_b = _posed(a), _posed(b)
    if not good_a.size or not good_b.size:
        return -1, -1
    start = max(int(a.t[good_a[0]]), int(b.t[good_b[0]]))
    return int(good_a[np.abs(a.t[good_a] - start).argmin()]), int(good_b[np.abs(b.t[good_b] - start).argmin()])


def _posed(track: Trajectory) -> Ints:
    """Rows with a pose whose heading has settled: at first it may be wrong by tens of degrees."""
    known = np.isfinite(track.p).all(axis=1) & np.isfinite(track.q).all(axis=1)
    sd = yaw_sd(track)
    if known.any() and np.isfinite(sd[known]).any():
        known &= ~(sd > 1.5 * np.nanmedian(sd[known]))
    return np.flatnonzero(known)


def ellipse_rows(p: Floats, count: int = ELLIPSES) -> Ints:
    """Rows at which to draw an ellipse: evenly spread along the path, so that standing still does not pile them up."""
    known = np.flatnonzero(np.isfinite(p).all(axis=1))
    if not known.size:
        return known
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(p[known, :2], axis=0), axis=1))])
    return known[np.unique(np.searchsorted(way, np.linspace(0.0, way[-1], count)).clip(0, known.size - 1))]


def shown_ellipses(pose: Trajectory) -> Ints:
    """Rows whose ellipse a map shows: small enough beside the path not to cover it."""
    rows = ellipse_rows(pose.p)
    if not pose.P.shape[0] or not rows.size:
        return rows[:0]
    extent = np.ptp(pose.p[np.isfinite(pose.p).all(axis=1), :2], axis=0)
    return rows[radius_95(pose, rows) <= LARGEST * max(float(extent.max()), 2.0)]


def ellipses(p: Floats, P: Floats, points: int = 40) -> Floats:
    """(n, points, 2) outlines of the horizontal 95 % ellipses of positions p (n, 3) with covariance P (n, 6, 6)."""
    good = np.isfinite(P[:, :2, :2]).all(axis=(1, 2))
    values, vectors = np.linalg.eigh(P[good][:, :2, :2])
    axes = vectors * np.sqrt(CHI2_95_2D * np.maximum(values, 0.0))[:, None, :]
    turn = np.linspace(0.0, 2 * np.pi, points, endpoint=False)
    circle = np.stack([np.cos(turn), np.sin(turn)])
    return p[good, None, :2] + np.swapaxes(axes @ circle, 1, 2)
