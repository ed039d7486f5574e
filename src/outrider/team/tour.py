"""An agent that visits waypoints one after the other, on its own estimate. It plans nothing and avoids nothing."""

from collections.abc import Sequence
from typing import Final, final

import numpy as np

from outrider.core.angles import wrap
from outrider.data import Stream
from outrider.data.agents import Action, Message
from outrider.errors import ConfigError
from outrider.team.navigator import Fused, Navigator
from outrider.typing import Floats

GROUNDED: Final = 0.1  # m up, at most: a waypoint on the ground


@final
class Tour:
    """Straight legs from waypoint to waypoint (m, 3) [m, site]; the last one is the goal.

    A ground robot turns towards the next waypoint and drives; a flying one (`flies`) moves straight there and turns on
    the way. speed [m/s], reach [m]: how near counts as there;  turn : rad/s at most.
    """

    def __init__(
        self,
        navigator: Navigator,
        waypoints: Floats,
        *,
        speed: float = 1.0,
        reach: float = 0.5,
        turn: float = 0.8,
        flies: bool = False,
        period_s: float = 0.1,
    ) -> None:
        if waypoints.ndim != 2 or waypoints.shape[1] != 3 or not len(waypoints) or not np.isfinite(waypoints).all():
            raise ConfigError(f"waypoints {waypoints.shape}", where="tour", fix="give rows of east, north, up [m]")
        self.navigator, self._waypoints, self._next = navigator, waypoints, 0
        self._speed, self._reach, self._turn, self._flies, self.period_s = speed, reach, turn, flies, period_s

    def act(self, t: int, records: Sequence[Stream], inbox: Sequence[Message]) -> Action:
        """Fuse, choose the waypoint, command."""
        self.navigator.take(records)
        here = self.navigator.now(t)
        note = self._advance(here)
        done = self._next >= len(self._waypoints)
        command = np.zeros(4 if self._flies else 3) if done else self._towards(here)
        return Action(command=command, records=(self.navigator.record(here),), done=done, note=note)

    @property
    def landing(self) -> bool:
        """Whether it flies down to the ground: to a waypoint on it."""
        return self._flies and float(self._waypoints[min(self._next, len(self._waypoints) - 1), 2]) <= GROUNDED

    def _advance(self, here: Fused) -> str:
        gap = self._waypoints[min(self._next, len(self._waypoints) - 1)] - here.p
        if float(np.linalg.norm(gap if self._flies else gap[:2])) > self._reach or self._next >= len(self._waypoints):
            return ""
        self._next += 1
        return f"waypoint {self._next} of {len(self._waypoints)} reached"

    def _towards(self, here: Fused) -> Floats:
        gap = self._waypoints[self._next] - here.p
        flat = float(np.hypot(gap[0], gap[1]))
        aside = wrap(float(np.arctan2(gap[1], gap[0])) - here.heading) if flat > 0.1 else 0.0
        rate = float(np.clip(1.5 * aside, -self._turn, self._turn))
        last = self._next == len(self._waypoints) - 1
        if self._flies:
            distance = float(np.linalg.norm(gap))
            v = gap / max(distance, 1e-9) * min(self._speed, 0.8 * distance if last else self._speed)
            return np.array([*v, rate])
        ahead = max(np.cos(aside), 0.0) ** 2 * min(self._speed, 0.8 * flat + 0.1 if last else self._speed)
        return np.array([ahead, 0.0, rate])
