"""What a large error may come from: a clock that is off, exchanged axes, another order of the quaternion."""

from dataclasses import replace
from typing import Final

import numpy as np

from outrider.data import Trajectory
from outrider.eval.associate import Association
from outrider.typing import Floats

MOST_S: Final = 5.0  # s: clocks further apart are another fault
STEPS_S: Final = (0.1, 0.01)  # of the first search and of the second
HALF: Final = 0.5  # of the error must be gone before a cause is named
LEAST_M: Final = 0.05  # errors below which nobody asks for a cause
LEAST_RAD: Final = np.radians(5.0)
FEW: Final = 20  # poses


def causes(pairs: Association, whole: Trajectory) -> tuple[str, ...]:
    """What would take away more than half of the error, each as a sentence; they are no part of the comparison.

    whole : the estimate at all its own stamps, in the frame of the pairs.
    """
    if len(pairs) < FEW:
        return ()
    p, r = pairs.estimate.p[:, :2], pairs.reference.p[:, :2]
    error, out = rms(p - r), list[str]()
    if error > LEAST_M:
        limit = HALF * min(error, rms(p - r - (p - r).mean(axis=0)))  # a constant offset is no clock
        lag, least = best_lag(pairs, whole)
        swapped = rms(p - r[:, ::-1])
        if swapped < HALF * error:
            out.append(f"were x and y of one of them exchanged, the horizontal RMSE would be {swapped:.2g} m")
        elif least < limit and abs(lag) >= STEPS_S[1]:
            out.append(f"with the reference shifted by {lag:+.2f} s the horizontal RMSE would be {least:.2g} m")
    return (*out, *quaternions(pairs))


def best_lag(pairs: Association, whole: Trajectory) -> tuple[float, float]:
    """The shift [s] of the reference's stamps at which the horizontal RMSE [m] is least, and that RMSE.

    Only the stamps that stay inside under every shift count, so that all are of the same poses.
    """
    known, begin = np.isfinite(whole.p).all(axis=1), pairs.reference.t[0]
    u, p = (whole.t[known] - begin) * 1e-9, whole.p[known]
    t, r = (pairs.reference.t - begin) * 1e-9, pairs.reference.p[:, :2]
    most = min(MOST_S, 0.25 * float(t[-1]))
    inside = (t >= most) & (t <= t[-1] - most)
    if inside.sum() < FEW:
        return 0.0, float("inf")

    def at(lag: float) -> float:
        moved = np.column_stack([np.interp(t[inside] + lag, u, p[:, i]) for i in range(2)])
        return rms(moved - r[inside])

    lag = 0.0
    for step, wide in zip(STEPS_S, (most, STEPS_S[0]), strict=True):
        near = np.clip(lag + step * np.arange(-round(wide / step), round(wide / step) + 1), -most, most)
        lag = float(min(near, key=at))
    return lag, at(lag)


def quaternions(pairs: Association) -> list[str]:
    """Whether one of them has its quaternions as w x y z instead of x y z w."""
    a, b = pairs.estimate, pairs.reference
    error = heading_rms(a, b)
    if not error > LEAST_RAD:
        return []
    for name, left in (("reference", heading_rms(a, reordered(b))), ("estimate", heading_rms(reordered(a), b))):
        if left < HALF * error:
            told = f"the heading RMSE would be {np.degrees(left):.2g} deg"
            return [f"were the quaternions of the {name} taken as w x y z, {told}"]
    return []


def reordered(x: Trajectory) -> Trajectory:
    """With what was read as x y z w read as w x y z."""
    return replace(x, q=np.roll(x.q, -1, axis=1))


def heading_rms(a: Trajectory, b: Trajectory) -> float:
    """RMS difference of two headings [rad], NaN where none is known."""
    d = np.angle(np.exp(1j * (a.yaw - b.yaw)))
    d = d[np.isfinite(d)]
    return float(np.sqrt(np.mean(d**2))) if d.size else float("nan")


def rms(d: Floats) -> float:
    """Root mean square length of rows (n, 2)."""
    return float(np.sqrt(np.mean(np.sum(d**2, axis=1))))


__all__ = ["causes"]
