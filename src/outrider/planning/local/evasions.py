"""Short motions of a base, and how near they come to who moves and to what stands: `yielding` in numbers."""

from math import cos, floor, hypot, inf, sin

from outrider._kernel import kernel
from outrider.typing import Floats, Ints


@kernel
def ramp(now: float, wanted: float, up: float, down: float, t: float) -> float:
    """A speed after t [s] on the way to another, as fast as it may: `down` while slowing down, then `up`."""
    change = wanted - now
    slower = min(abs(change), abs(now)) if now * change < 0.0 else 0.0  # this part of it
    gone = min(t * down, slower) + min(max(t - slower / down, 0.0) * up, abs(change) - slower)
    return now + gone if change > 0.0 else now - gone


@kernel
def motions(pose: Floats, twist: Floats, wanted: Floats, rates: Floats, hold: float, step: float, out: Floats) -> None:
    """out (k, n, 3) <- poses every `step` [s] on the way to each of the twists (k, 3), held until `hold`, then to rest.

    rates (2, 3) : changes per second of the three axes, speeding up and slowing down. Two Euler steps for each pose.
    """
    half = 0.5 * step
    for i in range(wanted.shape[0]):
        w = wanted[i]
        rest = max(max(abs(w[0]), abs(w[1])) / rates[1, 0], abs(w[2]) / rates[1, 2], 1e-9)
        x, y, heading = pose[0], pose[1], pose[2]
        for j in range(2 * out.shape[1]):
            t = half * j + 0.5 * half
            left = min(max(1.0 - (t - hold) / rest, 0.0), 1.0)
            a = left * ramp(twist[0], w[0], rates[0, 0], rates[1, 0], t)
            b = left * ramp(twist[1], w[1], rates[0, 1], rates[1, 1], t)
            heading += half * left * ramp(twist[2], w[2], rates[0, 2], rates[1, 2], t)
            c, s = cos(heading), sin(heading)
            x += half * (c * a - s * b)
            y += half * (s * a + c * b)
            if j % 2 == 1:
                out[i, j // 2, 0], out[i, j // 2, 1], out[i, j // 2, 2] = x, y, heading


@kernel
def shortages(
    poses: Floats, moving: Floats, step: float, wide: float, growth: float, horizon: float, short: Floats, who: Ints
) -> None:
    """short (k,) <- m of room that motions (k, n, 3) lack at worst, less the later (to `horizon`), negative to spare;
    who (k,) <- the disc (m, 5) that comes nearest. wide : m between the middle of the robot and a disc."""
    for i in range(poses.shape[0]):
        short[i], who[i] = -inf, 0
        for k in range(moving.shape[0]):
            for j in range(poses.shape[1]):
                t = step * (j + 1.0)
                dx = poses[i, j, 0] - moving[k, 0] - t * moving[k, 3]
                dy = poses[i, j, 1] - moving[k, 1] - t * moving[k, 4]
                soon = min(t, horizon)
                missing = wide + growth * soon + moving[k, 2] - hypot(dx, dy)
                if missing > 0.0:
                    missing *= 1.0 - 0.5 * soon / horizon
                if missing > short[i]:
                    short[i], who[i] = missing, k


@kernel
def nearest(field: Floats, west: float, south: float, resolution: float, poses: Floats, out: Floats) -> None:
    """out (k,) <- m from motions (k, n, 3) to the nearest taken cell, inf beyond the map."""
    rows, cols = field.shape
    for i in range(poses.shape[0]):
        out[i] = inf
        for j in range(poses.shape[1]):
            u, v = floor((poses[i, j, 0] - west) / resolution), floor((poses[i, j, 1] - south) / resolution)
            if 0 <= u < cols and 0 <= v < rows:
                out[i] = min(out[i], field[v, u])
