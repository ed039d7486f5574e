"""The shortest way between two poses on circles of one radius and straights, forward and backward.

J. Reeds, L. Shepp, "Optimal paths for a car that goes both forwards and backwards", Pacific J. Math. 145, 1990; the
equation numbers below are theirs. Lengths are in radii, negative backward; L, S, R turn left, not, right.
"""

from collections.abc import Callable, Iterator
from itertools import pairwise
from math import acos, asin, atan2, cos, hypot, pi, sin, sqrt
from typing import Final

import numpy as np

from outrider.core.angles import wrap
from outrider.planning.local.dubins import arc
from outrider.typing import Floats

Lengths = tuple[float, ...]
QUARTER: Final = 0.5 * pi
SAME: Final = 1e-9


def _lsl(x: float, y: float, h: float) -> Lengths:  # (8.1)
    a, b = x - sin(h), y - 1.0 + cos(h)
    t = atan2(b, a)
    return t, hypot(a, b), wrap(h - t)


def _lsr(x: float, y: float, h: float) -> Lengths:  # (8.2)
    a, b = x + sin(h), y - 1.0 - cos(h)
    d2 = a * a + b * b
    if d2 < 4.0:
        return ()
    u = sqrt(d2 - 4.0)
    t = wrap(atan2(b, a) + atan2(2.0, u))
    return t, u, wrap(t - h)


def _lrl(x: float, y: float, h: float) -> Lengths:  # (8.3), (8.4)
    a, b = x - sin(h), y - 1.0 + cos(h)
    d = hypot(a, b)
    if d > 4.0:
        return ()
    u = -2.0 * asin(0.25 * d)
    t = wrap(atan2(b, a) + 0.5 * u + pi)
    return t, u, wrap(h - t + u)


def _turns(u: float, v: float, a: float, b: float, h: float) -> tuple[float, float]:
    """First and last turn of four, of which the middle ones are u and v."""
    d = u - v
    A, B = sin(u) - sin(d), cos(u) - cos(d) - 1.0
    t = atan2(b * A - a * B, a * A + b * B)
    if 2.0 * (cos(d) - cos(v) - cos(u)) + 3.0 < 0.0:
        t += pi
    t = wrap(t)
    return t, wrap(t - u + v - h)


def _lrlr_equal(x: float, y: float, h: float) -> Lengths:  # (8.7)
    a, b = x + sin(h), y - 1.0 - cos(h)
    c = 0.25 * (2.0 + hypot(a, b))
    if c > 1.0:
        return ()
    u = acos(c)
    t, v = _turns(u, -u, a, b, h)
    return t, u, -u, v


def _lrlr_opposite(x: float, y: float, h: float) -> Lengths:  # (8.8)
    a, b = x + sin(h), y - 1.0 - cos(h)
    c = (20.0 - a * a - b * b) / 16.0
    if not 0.0 <= c <= 1.0:
        return ()
    u = -acos(c)
    t, v = _turns(u, u, a, b, h)
    return t, u, u, v


def _lrsl(x: float, y: float, h: float) -> Lengths:  # (8.9)
    a, b = x - sin(h), y - 1.0 + cos(h)
    d = hypot(a, b)
    if d < 2.0:
        return ()
    u = sqrt(d * d - 4.0)
    t = wrap(atan2(b, a) + atan2(u, -2.0))
    return t, -QUARTER, 2.0 - u, wrap(h - QUARTER - t)


def _lrsr(x: float, y: float, h: float) -> Lengths:  # (8.10)
    a, b = x + sin(h), y - 1.0 - cos(h)
    d = hypot(a, b)
    if d < 2.0:
        return ()
    t = atan2(a, -b)
    return t, -QUARTER, 2.0 - d, wrap(t + QUARTER - h)


def _lrslr(x: float, y: float, h: float) -> Lengths:  # (8.11)
    a, b = x + sin(h), y - 1.0 - cos(h)
    d2 = a * a + b * b
    if d2 < 4.0:
        return ()
    u = 4.0 - sqrt(d2 - 4.0)
    if u > 0.0:
        return ()
    t = wrap(atan2((4.0 - u) * a - 2.0 * b, -2.0 * a + (u - 4.0) * b))
    return t, -QUARTER, u, -QUARTER, wrap(t - h)


WORDS: Final[tuple[tuple[str, Callable[[float, float, float], Lengths]], ...]] = (
    ("LSL", _lsl), ("LSR", _lsr), ("LRL", _lrl), ("LRLR", _lrlr_equal), ("LRLR", _lrlr_opposite), ("LRSL", _lrsl),
    ("LRSR", _lrsr), ("LRSLR", _lrslr),
)  # fmt: skip
OTHER: Final = str.maketrans("LR", "RL")


def _candidates(x: float, y: float, h: float) -> Iterator[tuple[str, Lengths]]:
    """Every word to (x, y, h), also mirrored in time, in the lane, and driven from the other end."""
    c, s = cos(h), sin(h)
    for word, solve in WORDS:
        for back, (a, b) in ((False, (x, y)), (True, (x * c + y * s, x * s - y * c))):
            for in_time in (1.0, -1.0):
                for aside in (1.0, -1.0):
                    lengths = tuple(in_time * p for p in solve(in_time * a, aside * b, in_time * aside * h))
                    letters = word if aside > 0.0 else word.translate(OTHER)
                    if lengths:
                        yield (letters[::-1], lengths[::-1]) if back else (letters, lengths)


def _end(letters: str, lengths: Lengths) -> tuple[float, float, float]:
    x, y, h = 0.0, 0.0, 0.0
    for letter, p in zip(letters, lengths, strict=True):
        if letter == "S":
            x, y = x + p * cos(h), y + p * sin(h)
        else:
            side = 1.0 if letter == "L" else -1.0
            x, y, h = x + side * (sin(h + side * p) - sin(h)), y - side * (cos(h + side * p) - cos(h)), h + side * p
    return x, y, h


def reeds_shepp(start: Floats, goal: Floats, radius: float, *, back: float = 1.0, cusp: float = 0.0) -> list[Floats]:
    """Pieces of way from start to goal (3,): length [m], negative backward, and the angle turned to the left [rad].

    back : how many metres forward one backward is worth;  cusp : m that a change between them is worth. With 1 and 0 it
    is the shortest way there is, else the best of the words that the shortest one is among.
    """
    dx, dy = (goal[:2] - start[:2]) / radius
    c, s = cos(start[2]), sin(start[2])
    x, y, h = float(c * dx + s * dy), float(c * dy - s * dx), wrap(float(goal[2] - start[2]))
    best, chosen = np.inf, ("", ())
    for letters, lengths in _candidates(x, y, h):
        signs = [p > 0.0 for p in lengths if abs(p) > SAME]
        worth = sum(p if p > 0.0 else -back * p for p in lengths)
        worth += cusp / radius * sum(a != b for a, b in pairwise(signs))
        if worth < best - SAME:
            ex, ey, eh = _end(letters, lengths)
            if hypot(ex - x, ey - y) < 1e-6 and abs(wrap(eh - h)) < 1e-6:  # not every branch of an arc leads there
                best, chosen = worth, (letters, lengths)
    side = {"L": 1.0, "S": 0.0, "R": -1.0}
    return [np.array([radius * p, side[w] * p]) for w, p in zip(*chosen, strict=True) if abs(p) > SAME]


def driven(start: Floats, pieces: list[Floats], grain: float) -> Floats:
    """(n, 3) poses about `grain` [m] apart from a start (3,) along pieces of length [m] and turned angle [rad]."""
    poses = [start[None]]
    for length, turned in pieces:
        poses.append(arc(poses[-1][-1], float(turned), float(length), grain))
    return np.vstack(poses)
