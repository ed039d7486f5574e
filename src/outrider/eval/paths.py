"""How smooth and how long a path is."""

import numpy as np

from outrider.core.angles import wrap_all
from outrider.errors import DataError
from outrider.typing import Floats


def length(points: Floats) -> float:
    """Of the polyline through (n, 2) or (n, 3) points [m]."""
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def resampled(points: Floats, spacing: float) -> Floats:
    """(m, 2) places every `spacing` [m] of arc length along the polyline through points (n, 2), its end included.

    The last two are nearer to each other. Raises DataError for a spacing that is not positive.
    """
    if not spacing > 0.0:
        raise DataError(f"a spacing of {spacing:g} m", where="path", fix="a positive number")
    steps = np.hypot(*np.diff(points, axis=0).T)
    moving = np.concatenate([[True], steps > 0.0])  # who stands makes no way
    points = points[moving]
    s = np.concatenate([[0.0], np.cumsum(steps[steps > 0.0])])
    at = np.arange(0.0, s[-1], spacing)
    at = np.append(at[: -1 if s[-1] - at[-1] < 1e-9 * s[-1] else None], s[-1]) if s[-1] > 0.0 else np.zeros(1)
    return np.column_stack([np.interp(at, s, points[:, k]) for k in range(2)])


def smoothness(points: Floats, spacing: float = 0.5) -> float:
    """SMC = 1 - sum |wrap(theta_{i+1} - theta_i)| / (pi (N - 2)) of N points every `spacing` [m] along a path (n, 2).

    theta_i is the direction of the i-th segment: 1 on a straight line, 0 where every segment turns back. The value
    depends on the spacing, so only those of one spacing may be compared. amr2025 (23), which is printed as an image:
    the form is ours. NaN with fewer than three points.
    """
    p = resampled(np.asarray(points, np.float64)[:, :2], spacing)
    if len(p) < 3:
        return float("nan")
    theta = np.arctan2(*np.diff(p, axis=0).T[::-1])
    return 1.0 - float(np.abs(wrap_all(np.diff(theta))).mean()) / np.pi
