"""How a base slows down: the way it still goes, and commands that it can follow."""

from math import cos, sin
from typing import Final

import numpy as np

from outrider._kernel import kernel
from outrider.data.driving import DriveLimits, Steering
from outrider.typing import Floats

REST: Final = 1e-9


def stopping_distance(speed: float, deceleration: float, reaction: float = 0.0) -> float:
    """|v| t_r + v^2 / 2 b [m]."""
    return abs(speed) * reaction + 0.5 * speed * speed / deceleration


def stopping_time(twist: Floats, limits: DriveLimits) -> float:
    """Seconds to rest, all axes together, so that the shape of the motion is kept."""
    speed = float(np.hypot(twist[0], twist[1]))
    return max(speed / limits.deceleration, abs(float(twist[2])) / limits.turn_acceleration)


def brakeable(soon: float, rest: float, reaction: float) -> float:
    """The largest share s <= 1 of a command that still stops in time: s t_r + s^2 T / 2 = t_c.

    soon : t_c, s at the whole command to the first touch;  rest : T, s from it to rest;  reaction : t_r, s.
    """
    if soon >= reaction + 0.5 * rest:
        return 1.0
    if soon <= 0.0:
        return 0.0
    return min(2.0 * soon / (reaction + float(np.sqrt(reaction * reaction + 2.0 * rest * soon))), 1.0)


def braking(pose: Floats, twist: Floats, limits: DriveLimits, reaction: float, knots: int = 9) -> Floats:
    """(n, 4) poses and times of a base that keeps its twist for `reaction` seconds and then brakes to rest.

    The twist shrinks as a whole, so the way is a circle: the turned angle is w s with s = t_r + T / 2 at the end.
    """
    T = stopping_time(twist, limits)
    t = np.concatenate([[0.0], reaction + T * np.linspace(0.0, 1.0, knots)])
    late = np.maximum(t - reaction, 0.0)
    s = np.minimum(t, reaction) + late - (0.5 * late * late / T if T > 0.0 else 0.0)
    return np.column_stack([moved(pose, twist, s), t])


def moved(pose: Floats, twist: Floats, seconds: Floats) -> Floats:
    """(n, 3) poses after going at a constant twist for each of `seconds` (n,): exact, a circle or a straight line."""
    out = np.empty((len(seconds), 3))
    go_on(pose, twist, seconds, out)
    return out


@kernel
def go_on(pose: Floats, twist: Floats, seconds: Floats, out: Floats) -> None:
    """`moved`."""
    for i in range(seconds.size):
        turned = twist[2] * seconds[i]
        half, middle = 0.5 * turned, pose[2] + 0.5 * turned
        chord = seconds[i] * (sin(half) / half if half != 0.0 else 1.0)
        c, s = cos(middle), sin(middle)
        out[i, 0] = pose[0] + chord * (c * twist[0] - s * twist[1])
        out[i, 1] = pose[1] + chord * (s * twist[0] + c * twist[1])
        out[i, 2] = pose[2] + turned


def saturated(twist: Floats, limits: DriveLimits) -> Floats:
    """The twist within the velocity set, scaled down as a whole: its direction, and the circle it drives, are kept.

    What the base cannot do at all is left out: going sideways without rollers, going backward where that is not
    allowed, turning tighter than a car can.
    """
    out = np.array(twist, np.float64)
    if not np.isfinite(out).all():
        return np.zeros(3)
    if limits.steering is not Steering.HOLONOMIC:
        out[1] = 0.0
    if out[0] < 0.0 and limits.backward == 0.0:
        out[0] = 0.0
    if limits.steering is Steering.CAR:
        most = abs(out[0]) / limits.min_radius
        out[2] = min(max(out[2], -most), most)
    excess = limits.excess(out)
    return out / excess if excess > 1.0 else out


def smoothed(want: Floats, last: Floats, limits: DriveLimits, dt: float) -> Floats:
    """The twist that follows `last` by dt on the way to `want`: every axis within its limit of change.

    One factor for all axes, so that the direction of the change is kept; slowing down may be harder than speeding up.
    """
    change = want - last
    share = 1.0
    for axis in range(3):
        if abs(change[axis]) < REST:
            continue
        slower = last[axis] * change[axis] < 0.0
        rate = limits.turn_acceleration if axis == 2 else limits.deceleration if slower else limits.acceleration
        share = min(share, rate * dt / abs(float(change[axis])))
    return last + share * change


def stop(last: Floats, limits: DriveLimits, dt: float) -> Floats:
    """The next twist of a controlled stop: the last one, shrunk as a whole."""
    T = stopping_time(last, limits)
    return np.zeros(3) if dt >= T else last * (1.0 - dt / T)
