"""Bands to start from: along a polyline at the speed the limits allow, or what is left of the one before."""

from math import sqrt
from typing import Final

import numpy as np

from outrider._kernel import kernel
from outrider.core.angles import wrap, wrap_all
from outrider.data.driving import DriveLimits, Situation, Steering
from outrider.planning.local.dubins import dubins
from outrider.planning.local.optimise import FEWEST
from outrider.planning.local.reeds_shepp import driven, reeds_shepp
from outrider.typing import Floats

GRAIN: Final = 0.02  # m between samples of a path, about
TURN: Final = 0.4  # rad, further than this a base turns before it goes
SOON: Final = 0.7  # steps; a knot nearer than that would turn a small error of position into a large one of speed
OFF: Final = 0.5  # m, from where the band would have it


def along(path: Floats, now: Situation, limits: DriveLimits, dt: float, capacity: int) -> Floats:
    """(n, 4) from the pose now to the goal along a polyline (m, 2), as fast as the limits allow on that shape.

    A holonomic base turns evenly on the way; a differential one turns on the spot where it faces another way; a car
    leaves and arrives on circles of its smallest radius, backward where that is quicker.
    """
    poses = _shape(np.vstack([now.pose[:2], path[1:-1], now.goal[:2]]), now, limits)
    clock = np.zeros(len(poses))
    ride(poses, limits.rows, limits.axes, float(np.hypot(now.twist[0], now.twist[1])), np.zeros((len(poses), 4)), clock)
    n = int(np.clip(np.ceil(clock[-1] / dt) + 1, FEWEST, capacity))
    t = np.linspace(0.0, max(clock[-1], 0.1), n)
    rows = np.column_stack([*(np.interp(t, clock, poses[:, k]) for k in range(3)), t])
    rows[:, 2] = wrap_all(rows[:, 2])
    rows[0, :3], rows[-1, :3] = now.pose, now.goal
    return rows


def _shape(corners: Floats, now: Situation, limits: DriveLimits) -> Floats:
    """(m, 3) close poses along a polyline, headings continuous."""
    p = _rounded(corners, max(limits.min_radius, 0.4))
    start, end = float(now.pose[2]), float(now.goal[2])
    turned = wrap(end - start)
    if limits.steering is Steering.HOLONOMIC or len(p) < 3:
        m = max(len(p), int(abs(turned) / 0.1) + 2)
        share = np.linspace(0.0, 1.0, m)
        x, y = (np.interp(share, np.linspace(0.0, 1.0, len(p)), p[:, k]) for k in range(2))
        return np.column_stack([x, y, start + turned * share])
    if limits.steering is Steering.CAR:
        return _for_car(p, now, limits)
    heading = np.unwrap(np.arctan2(np.gradient(p[:, 1]), np.gradient(p[:, 0])))
    if _better_backward(p, heading, now, limits):
        heading += np.pi
    heading += start + wrap(float(heading[0]) - start) - heading[0]
    middle = np.column_stack([p, heading])
    first = _turning(p[0], start, float(heading[0]))
    last = _turning(p[-1], float(heading[-1]), float(heading[-1]) + wrap(end - float(heading[-1])))
    return np.vstack([first, middle, last])


def _turning(p: Floats, a: float, b: float) -> Floats:
    """(k, 3) poses that turn on the spot, none for a small angle."""
    if abs(b - a) < TURN:
        return np.empty((0, 3))
    angles = np.linspace(a, b, int(abs(b - a) / 0.1) + 2)
    return np.column_stack([np.full(len(angles), p[0]), np.full(len(angles), p[1]), angles])


def _better_backward(p: Floats, heading: Floats, now: Situation, limits: DriveLimits) -> bool:
    """Whether the way lies behind at both ends and is too short to turn for."""
    behind = abs(wrap(float(heading[0] - now.pose[2]))) > 0.5 * np.pi
    facing_off = abs(wrap(float(heading[-1] - now.goal[2]))) > 0.5 * np.pi
    span = float(np.hypot(*(p[-1] - p[0])))
    slower = span / limits.backward - span / limits.forward if limits.backward > 0.0 else np.inf
    return behind and facing_off and slower < 2.0 * np.pi / limits.turn


def _for_car(p: Floats, now: Situation, limits: DriveLimits) -> Floats:
    """Circles and straights between the ends and the path, or from end to end where the path is too short for that."""
    r = 1.1 * limits.min_radius
    k = int(2.5 * r / GRAIN)
    if len(p) > 2 * k + 2:  # room to join the path and to leave it
        heading = np.unwrap(np.arctan2(np.gradient(p[:, 1]), np.gradient(p[:, 0])))
        joined, left = np.array([*p[k], heading[k]]), np.array([*p[-k], heading[-k]])
        ends = _turned(now.pose, joined, r, limits), _turned(left, now.goal, r, limits)
        if max(len(ends[0]), len(ends[1])) < 3 * k:
            poses = np.vstack([ends[0], np.column_stack([p, heading])[k + 1 : -k], ends[1]])
            poses[:, 2] = np.unwrap(poses[:, 2])
            return poses
    return _turned(now.pose, now.goal, r, limits)


def _turned(start: Floats, goal: Floats, radius: float, limits: DriveLimits) -> Floats:
    """(n, 3) poses on the quickest circles and straights, backward too if the car can; a cusp costs a stop."""
    if limits.backward == 0.0:
        return dubins(start, goal, radius, GRAIN)
    slower, stop = limits.forward / limits.backward, 0.5 * limits.forward**2 / limits.acceleration
    return driven(start, reeds_shepp(start, goal, radius, back=slower, cusp=stop), GRAIN)


def _rounded(corners: Floats, reach: float) -> Floats:
    """(m, 2) the polyline at GRAIN, its corners rounded over `reach` before and after; the ends stay."""
    gaps = np.hypot(*np.diff(corners, axis=0).T)
    s = np.concatenate([[0.0], np.cumsum(gaps)])
    if s[-1] < 1e-3:
        return corners[[0, -1]]
    m = int(np.clip(s[-1] / GRAIN, 2, 2000)) + 1
    at = np.linspace(0.0, s[-1], m)
    p = np.column_stack([np.interp(at, s, corners[:, 0]), np.interp(at, s, corners[:, 1])])
    half = min(int(reach / (at[1] - at[0])), (m - 1) // 2)
    if len(corners) > 2 and half > 0:
        window = np.minimum(np.minimum(np.arange(m), m - 1 - np.arange(m)), half)
        total = np.vstack([np.zeros(2), np.cumsum(p, axis=0)])
        k = np.arange(m)
        p = (total[k + window + 1] - total[k - window]) / (2 * window + 1)[:, None]
    return p


@kernel
def ride(poses: Floats, rows: Floats, axes: Floats, speed: float, work: Floats, clock: Floats) -> None:
    """clock (m,) <- when each pose (m, 3) is passed, as soon as velocity set and accelerations allow, then at rest.

    Along a unit u of the motion per metre, speeds are below 1 / max rows u and rates below 1 / max axes u; it stops
    where it begins or ends to turn on the spot, and where it changes direction.  work (m, 4) is scratch: length, speed,
    rate, whether it stops before that piece.
    """
    m, was_x, was_y, turned_there = poses.shape[0], 0.0, 0.0, False
    for k in range(m - 1):
        dx, dy, turned = poses[k + 1, 0] - poses[k, 0], poses[k + 1, 1] - poses[k, 1], poses[k + 1, 2] - poses[k, 2]
        length = sqrt(dx * dx + dy * dy)
        spot = length < 1e-4
        length = max(length, abs(turned)) if spot else length
        stops = k > 0 and (spot != turned_there or (not spot and dx * was_x + dy * was_y < 0.0))
        was_x, was_y, turned_there = dx, dy, spot
        work[k, 0], work[k, 3] = length, 1.0 if stops else 0.0
        if length < 1e-9:
            work[k, 1], work[k, 2] = 1e3, 1e3
            continue
        h = poses[k, 2] + 0.5 * turned
        c, s = np.cos(h), np.sin(h)
        a, b, w = (c * dx + s * dy) / length, (c * dy - s * dx) / length, turned / length
        most, hard = 1e-6, 1e-6
        for i in range(rows.shape[0]):
            y = rows[i, 0] * a + rows[i, 1] * b + rows[i, 2] * w
            limit = rows[i, 4] if y > 0.0 else -rows[i, 3]
            most = max(most, abs(y) / max(limit, 0.05))
        for i in range(3):
            hard = max(hard, abs(axes[i, 0] * a + axes[i, 1] * b + axes[i, 2] * w))
        work[k, 1], work[k, 2] = 1.0 / most, 1.0 / hard
    v = speed
    for k in range(m - 1):  # forward: speed at the end of each piece
        if work[k, 3] > 0.0:
            v = 0.0
        v = min(sqrt(v * v + 2.0 * work[k, 2] * work[k, 0]), work[k, 1])
        clock[k + 1] = v
    clock[0] = speed
    v = 0.0
    for k in range(m - 2, -1, -1):  # backward
        if work[k + 1, 3] > 0.0:
            v = 0.0
        clock[k + 1] = min(clock[k + 1], v)
        v = min(sqrt(v * v + 2.0 * work[k, 2] * work[k, 0]), work[k, 1])
    before, t = min(clock[0], v), 0.0
    clock[0] = 0.0
    for k in range(m - 1):
        after = clock[k + 1]
        t += 2.0 * work[k, 0] / max(before + after, 1e-3 + 0.02 * work[k, 1])
        clock[k + 1], before = t, after


def resumed(band: Floats, elapsed: float, now: Situation) -> Floats | None:
    """The band (n, 4) `elapsed` seconds later, from the pose now to the goal now; None if it does not fit any more."""
    if len(band) < 2 or not 0.0 <= elapsed < band[-1, 3]:
        return None
    rest = band[band[:, 3] > elapsed + SOON * float(band[-1, 3]) / (len(band) - 1)]
    expected = [np.interp(elapsed, band[:, 3], band[:, k]) for k in range(2)]
    moved = np.hypot(*(now.goal[:2] - band[-1, :2])) > OFF or abs(wrap(float(now.goal[2] - band[-1, 2]))) > OFF
    if len(rest) < 2 or moved or np.hypot(*(now.pose[:2] - expected)) > OFF:
        return None
    out = np.vstack([[*now.pose, elapsed], rest])
    out[:, 3] -= elapsed
    out[-1, :3] = now.goal
    return out
