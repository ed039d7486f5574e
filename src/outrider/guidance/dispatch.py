"""Who goes where: orders by the least sum of path costs, and passages that only one robot may be in."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import final

import numpy as np

from outrider.typing import Floats


def assign(costs: Floats) -> tuple[tuple[int, int], ...]:
    """(robot, alert) pairs: as many as possible, and of these the least sum of costs.

    costs : (robots, alerts), inf where a robot cannot go.  By H. W. Kuhn's method, as SciPy has it.
    """
    from scipy.optimize import linear_sum_assignment  # slow to import

    possible = np.isfinite(costs)
    if not possible.any():
        return ()
    # an impossible pair costs more than every possible one together: it is taken only where nothing else is left
    dear = 1.0 + 2.0 * float(np.abs(costs[possible]).sum())
    rows, cols = linear_sum_assignment(np.where(possible, costs, dear))
    return tuple((int(r), int(c)) for r, c in zip(rows, cols, strict=True) if possible[r, c])


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Passages:
    """Who may be in which passage. holder : robot by passage;  queue : who waits, first come first served.

    A robot asks before it enters and waits outside. While it holds one it is not heard about another: no two robots can
    wait for each other. Passages with no room to wait between them are one passage.
    """

    holder: Mapping[str, str] = field(default_factory=dict[str, str])
    queue: Mapping[str, tuple[str, ...]] = field(default_factory=dict[str, tuple[str, ...]])

    def asked(self, passage: str, robot: str) -> "Passages":
        """The robot has it, or is in the queue for it. To ask twice changes nothing; a robot that asks for one passage
        gives up its place in the queues of all others."""
        if any(held != passage and robot == who for held, who in self.holder.items()):
            return self
        calm = self._unqueued(robot, passage)
        if calm.holder.get(passage, robot) == robot:
            return replace(calm, holder={**calm.holder, passage: robot})
        waiting = calm.queue.get(passage, ())
        return calm if robot in waiting else replace(calm, queue={**calm.queue, passage: (*waiting, robot)})

    def left(self, passage: str, robot: str) -> "Passages":
        """The next in the queue has it; what a robot does not hold, it cannot leave."""
        if self.holder.get(passage) != robot:
            return self
        rest = {k: v for k, v in self.holder.items() if k != passage}
        first, *others = self.queue.get(passage, ()) or ("",)
        queue = {**self.queue, passage: tuple(others)}
        return Passages(holder={**rest, passage: first} if first else rest, queue=queue)

    def lost(self, robot: str) -> "Passages":
        """A robot that is silent leaves all queues; what it holds stays closed, for it may be in there."""
        return self._unqueued(robot, "")

    def _unqueued(self, robot: str, but: str) -> "Passages":
        queue = {k: v if k == but else tuple(r for r in v if r != robot) for k, v in self.queue.items()}
        return replace(self, queue=queue)
