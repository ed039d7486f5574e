"""The shortest way forward between two poses on circles of one radius and a straight between them."""

from math import acos, atan2, cos, hypot, pi, sin, sqrt

import numpy as np

from outrider.core.attitudes import TURN
from outrider.typing import Floats


def dubins(start: Floats, goal: Floats, radius: float, grain: float) -> Floats:
    """(n, 3) poses about `grain` metres apart, start and goal included; headings continuous.

    The four words circle - straight - circle of Dubins (1957); the two of three circles are left out.
    """
    best = np.inf
    word = (1.0, 0.0, 0.0, 0.0, 1.0)
    for first in (1.0, -1.0):
        for last in (1.0, -1.0):
            ax, ay = start[0] - first * radius * sin(start[2]), start[1] + first * radius * cos(start[2])
            bx, by = goal[0] - last * radius * sin(goal[2]), goal[1] + last * radius * cos(goal[2])
            d = hypot(bx - ax, by - ay)
            if first != last and d < 2.0 * radius:
                continue
            straight = d if first == last else sqrt(d * d - 4.0 * radius * radius)
            heading = atan2(by - ay, bx - ax)
            if first != last:
                heading += first * (0.5 * pi - acos(min(2.0 * radius / d, 1.0)))
            a, b = (first * (heading - start[2])) % TURN, (last * (goal[2] - heading)) % TURN
            a, b = (x if x < TURN - 1e-9 else 0.0 for x in (a, b))
            length = radius * (a + b) + straight
            if length < best:
                best, word = length, (first, a, straight, b, last)
    first, a, straight, b, last = word
    pieces = ((first * a, radius * a), (0.0, straight), (last * b, radius * b))
    poses = [np.array([start])]
    for turned, length in pieces:
        if length > 1e-9:
            poses.append(arc(poses[-1][-1], turned, length, grain))
    return np.vstack(poses)


def arc(pose: Floats, turned: float, length: float, grain: float) -> Floats:
    """(k, 3) poses after this one along an arc or straight on, backward for a negative length."""
    k = int(np.ceil(abs(length) / grain))
    s = np.linspace(0.0, 1.0, k + 1)[1:]
    heading = pose[2] + turned * s
    chord = length * s * np.sinc(0.5 * turned * s / pi)
    middle = pose[2] + 0.5 * turned * s
    return np.column_stack([pose[0] + chord * np.cos(middle), pose[1] + chord * np.sin(middle), heading])
