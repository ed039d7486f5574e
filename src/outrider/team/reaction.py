"""What a base will be doing when the next command takes hold: plans start from there, not from what is past help."""

from collections import deque
from dataclasses import dataclass, field, replace
from itertools import pairwise
from math import cos, hypot, sin
from typing import Final, final

import numpy as np

from outrider.core.angles import wrap
from outrider.safety.stopping import moved
from outrider.team.navigator import Fused
from outrider.typing import Floats

KEPT_S: Final = 2.0  # s of commands that are remembered


@final
@dataclass(slots=True, kw_only=True)
class Reaction:
    """A base that answers with a delay and a first-order lag is, on a ramp, late by the sum of both: `seconds`.

    Its twist then will be the last command, and its pose the estimate carried on by the commands on their way. That
    holds as long as it does what it is told: where it moves otherwise by more than `trust` (m/s, rad/s), held up or
    slipping, the measured twist counts.
    """

    seconds: float
    trust: tuple[float, float] = (0.35, 0.7)
    _told: deque[tuple[float, Floats]] = field(default_factory=deque[tuple[float, Floats]])

    def told(self, t_s: float, twist: Floats) -> None:
        """Remember a command: twist (3,), body frame, in force from now on."""
        self._told.append((t_s, twist))
        while len(self._told) > 1 and self._told[1][0] < t_s - KEPT_S:
            self._told.popleft()

    def ahead(self, here: Fused) -> Fused:
        """The estimate at `here.t`, carried on to where a command given now takes hold."""
        if self.seconds <= 0.0 or not self._told:
            return here
        now = here.t * 1e-9
        c, s = cos(here.heading), sin(here.heading)
        forward, left = c * here.v[0] + s * here.v[1], c * here.v[1] - s * here.v[0]
        due = self._at(now - self.seconds)
        if not (
            hypot(forward - due[0], left - due[1]) < self.trust[0] and abs(here.w - due[2]) < self.trust[1]
        ):  # NaN, too
            return here
        pose = np.array([here.p[0], here.p[1], here.heading])
        for since, until, twist in self._pieces(now - self.seconds, now):
            pose = moved(pose, twist, np.array([until - since]))[0]
        last = self._told[-1][1]
        c, s = cos(pose[2]), sin(pose[2])
        v = np.array([c * last[0] - s * last[1], s * last[0] + c * last[1], 0.0])
        p = np.array([pose[0], pose[1], here.p[2]])
        return replace(here, p=p, v=v, heading=wrap(float(pose[2])), w=float(last[2]))

    def _at(self, t_s: float) -> Floats:
        """The command in force at a time; none before the first."""
        found = [twist for since, twist in self._told if since <= t_s]
        return found[-1] if found else np.zeros(3)

    def _pieces(self, start: float, end: float) -> list[tuple[float, float, Floats]]:
        """(since, until, twist) of the commands in force between two times."""
        times = [start, *(t for t, _ in self._told if start < t < end), end]
        return [(a, b, self._at(a)) for a, b in pairwise(times)]
