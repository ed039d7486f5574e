"""Drones one behind the other on a trail: where on it each is, how fast it is to go, and who follows whom."""

from dataclasses import dataclass
from math import hypot, inf
from typing import Final, final

import numpy as np

from outrider._kernel import inlined, kernel
from outrider.errors import ConfigError
from outrider.typing import Floats

WINDOW: Final = 12  # pieces of the trail, on either side of where a drone was, among which it is looked for


@kernel
def along(trail: Floats, n: int, near: float, x: float, y: float) -> tuple[float, int]:
    """(s, k): arc length [m] of the point of a trail nearest to (x, y), and the piece it is on, n > 1 points known.

    trail (m, 3) : east, north, arc length from its beginning, which grows;  near : an arc length not far from the
    answer. Before its beginning and beyond its end a trail goes straight on.
    """
    low, high = 0, n - 1
    while high - low > 1:
        middle = (low + high) // 2
        if trail[middle, 2] <= near:
            low = middle
        else:
            high = middle
    best, s, at = inf, near, low
    for k in range(max(low - WINDOW, 0), min(low + WINDOW + 1, n - 1)):
        dx, dy = trail[k + 1, 0] - trail[k, 0], trail[k + 1, 1] - trail[k, 1]
        length = trail[k + 1, 2] - trail[k, 2]
        t = ((x - trail[k, 0]) * dx + (y - trail[k, 1]) * dy) / (length * length)
        t = max(t, 0.0) if k > 0 else t
        t = min(t, 1.0) if k < n - 2 else t
        d = hypot(x - trail[k, 0] - t * dx, y - trail[k, 1] - t * dy)
        if d < best:
            best, s, at = d, trail[k, 2] + t * length, k
    return s, at


@kernel
def latest(trail: Floats, n: int, x: float, y: float, within: float) -> float:
    """Arc length of the last time that a trail came within so many metres of (x, y), at its nearest; -inf if never."""
    best, s = within, -inf
    for k in range(n - 1, -1, -1):
        d = hypot(x - trail[k, 0], y - trail[k, 1])
        if d < best:
            best, s = d, trail[k, 2]
        elif s > -inf and d > within:
            break
    return s


@inlined
def place(trail: Floats, n: int, k: int, s: float) -> tuple[float, float]:
    """The point of a trail at arc length s, from piece k on; straight on beyond its ends."""
    while k < n - 2 and trail[k + 1, 2] < s:
        k += 1
    t = (s - trail[k, 2]) / (trail[k + 1, 2] - trail[k, 2])
    return trail[k, 0] + t * (trail[k + 1, 0] - trail[k, 0]), trail[k, 1] + t * (trail[k + 1, 1] - trail[k, 1])


@inlined
def pace(gap: float, own: float, ahead: float, stand: float, headway: float, gain: float, speed: float) -> float:
    """Speed along the trail [m/s]: that of the one ahead, and a share of what is missing to the wanted gap.

    u = v_ahead + k (gap - d_0 - h v_own), within 0 and `speed`. From one drone to the next, with a velocity that
    answers with lag tau,  V_i / V_(i-1) = (s + k) / (tau s^2 + (1 + k h) s + k), which is nowhere above 1 for
    h + k h^2 / 2 >= tau: a column is string stable if its headway is longer than the lag and the delays together.
    """
    return min(max(ahead + gain * (gap - stand - headway * own), 0.0), speed)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Spacing:
    """Of drones on a trail. stand : m, to the one ahead when both stand;  headway_s : s, more for every m/s;
    gain : 1/s, of a gap that is not as wanted;  preview : m, how far along the trail it steers;  speed : m/s, its most.
    """

    stand: float = 4.0
    headway_s: float = 1.5
    gain: float = 0.4
    preview: float = 2.5
    speed: float = 5.0

    def __post_init__(self) -> None:
        for name in ("stand", "headway_s", "gain", "preview", "speed"):
            if not 0.0 < getattr(self, name) < inf:
                raise ConfigError(f"is {getattr(self, name)}", where=f"spacing {name}", fix="a number above 0")

    def amplification(self, lag_s: float, command_s: float, radio_s: float) -> float:
        """The largest gain, over all frequencies, of a disturbance from one drone to the next; at most 1 is stable.

        V_i / V_(i-1) = (s + k (1 + r s)) e^(-r s) / (s (tau s + 1) e^(c s) + k (1 + h s)):  commands act c later, and
        the place of the one ahead is that of r ago, moved on by its velocity.
        """
        s = 1j * np.geomspace(1e-3, 1e2, 4000)
        ahead = s + self.gain * (1.0 + radio_s * s)  # a delay alone changes no magnitude
        own = s * (lag_s * s + 1.0) * np.exp(s * command_s) + self.gain * (1.0 + self.headway_s * s)
        return float(np.abs(ahead / own).max())

    def check(self, lag_s: float, command_s: float, radio_s: float) -> None:
        """Raise ConfigError for a column in which disturbances would grow from drone to drone."""
        if (worst := self.amplification(lag_s, command_s, radio_s)) > 1.0 + 1e-6:
            raise ConfigError(
                f"a disturbance grows by {worst:.3f} from drone to drone", where="spacing",
                fix=f"a headway_s well above {lag_s + command_s + radio_s:.2g} s, or a smaller gain",
            )  # fmt: skip
