"""Missions in behaviour trees of py_trees (the extra `trees`): the transitions as behaviours beside one's own.

D. Stonier, py_trees 2: a behaviour is ticked and answers RUNNING, SUCCESS or FAILURE.
"""

from dataclasses import dataclass, field
from typing import final

from outrider.errors import UsageError
from outrider.guidance.patrol import Duty, Ended, Inputs, Mission, Report, Rules, Transition, advance

try:
    from py_trees.behaviour import Behaviour
    from py_trees.common import Status
except ImportError:
    raise UsageError("py_trees is not installed", where="trees", fix="pip install 'outrider[trees]'") from None


@final
@dataclass(slots=True)
class Slate:
    """What the behaviours of one tree share: what they look at, and what they have made of it in this tick."""

    now: Inputs = field(default_factory=lambda: Inputs(t_s=0.0))
    mission: Mission = field(default_factory=Mission)
    rules: Rules = field(default_factory=Rules)
    ended: tuple[Report, ...] = ()


@final
class Advance(Behaviour):
    """One transition of the mission: RUNNING while it follows an order, SUCCESS without one, FAILURE in the tick in
    which a response ended before the alert was observed; the message says why. rules : instead of the robot's."""

    def __init__(self, name: str, slate: Slate, rules: Rules | None = None) -> None:
        super().__init__(name)
        self._slate, self._rules = slate, rules

    def update(self) -> Status:
        """See `py_trees`."""
        s = self._slate
        s.mission, ended = advance(s.mission, s.now, s.rules if self._rules is None else self._rules)
        s.ended += ended
        failed = [how.value for _, how in ended if how is not Ended.OBSERVED]
        self.feedback_message = "; ".join(failed) or s.mission.duty.value
        if failed:
            return Status.FAILURE
        return Status.SUCCESS if s.mission.order is None else Status.RUNNING


@final
class During(Behaviour):
    """A condition: SUCCESS while the mission has one of some duties, else FAILURE."""

    def __init__(self, name: str, slate: Slate, *duties: Duty) -> None:
        super().__init__(name)
        self._slate, self._duties = slate, duties

    def update(self) -> Status:
        """See `py_trees`."""
        self.feedback_message = self._slate.mission.duty.value
        return Status.SUCCESS if self._slate.mission.duty in self._duties else Status.FAILURE


def transition_of(root: Behaviour, slate: Slate) -> Transition:
    """A tree as the `transition` of a patrol: each call is one tick; `root` and its behaviours share the slate.

    Where no `Advance` is ticked the mission stays as it is.
    """

    def transition(mission: Mission, now: Inputs, rules: Rules) -> tuple[Mission, tuple[Report, ...]]:
        slate.now, slate.mission, slate.rules, slate.ended = now, mission, rules, ()
        root.tick_once()
        return slate.mission, slate.ended

    return transition
