"""A ground robot that goes to goals in turn, and says of each how that ended."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from math import isnan
from typing import final

import numpy as np

from outrider.data import Stream
from outrider.data.agents import Action, Message
from outrider.errors import ConfigError
from outrider.team.driver import Answer, Drive
from outrider.team.ground import Ground
from outrider.team.navigator import Fused
from outrider.typing import Floats


class Visit(Enum):
    """What became of a goal."""

    OPEN = "not reached before the time was over"
    ARRIVED = "arrived"
    UNREACHABLE = "unreachable"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """goal : (3,);  t : ns, when it was left, 0 while it is open;  estimate : (3,) where the robot then thought it was;
    error : m, of that to the goal;  reason : in words, of what was not reached;  path : (n, 2) m, as first planned."""

    goal: Floats
    visit: Visit = Visit.OPEN
    t: int = 0
    estimate: Floats = field(default_factory=lambda: np.full(3, np.nan))
    reason: str = ""
    path: Floats = field(default_factory=lambda: np.empty((0, 2)))

    @property
    def error(self) -> float:
        """How far off the goal the robot thinks it is [m]; NaN while it is open."""
        return float(np.hypot(*(self.estimate[:2] - self.goal[:2])))


@final
@dataclass(slots=True, kw_only=True)
class Errand:
    """An `Agent`. goals : (n, 3) east, north [m], heading [rad] (NaN: any);  hold_s : s that it stands at each."""

    body: Ground
    goals: Floats
    hold_s: float = 1.0
    period_s: float = 0.1
    outcomes: list[Outcome] = field(default_factory=list[Outcome])
    _next: int = 0
    _there: int = -1  # ns, since when it stands at the goal
    _waits: str = ""

    def __post_init__(self) -> None:
        if self.goals.ndim != 2 or self.goals.shape[1:] != (3,) or not np.isfinite(self.goals[:, :2]).all():
            fix = "rows of east, north [m], heading [rad] or NaN"
            raise ConfigError(f"goals of shape {self.goals.shape}", where="errand", fix=fix)
        self.outcomes = [Outcome(goal=g) for g in self.goals]

    def act(self, t: int, records: Sequence[Stream], inbox: Sequence[Message]) -> Action:
        """Drive towards the goal whose turn it is."""
        done = self._next >= len(self.goals)
        self.body.driver.go(None if done else self.goals[self._next])
        here, answer = self.body.drive(t, records, inbox)
        if not done and not len(self.outcomes[self._next].path) and answer.path is not None and answer.path.found:
            self.outcomes[self._next] = replace(self.outcomes[self._next], path=answer.path.points)
        notes = ["" if done else self._judged(t, here, answer), answer.note]
        own = self.body.navigator
        return Action(
            command=answer.twist,
            records=(own.record(here), own.command(here, answer.twist)),
            done=self._next >= len(self.goals),
            note="; ".join(n for n in notes if n),
        )

    def _judged(self, t: int, here: Fused, answer: Answer) -> str:
        """Whether the goal is settled, and what to say of it."""
        if answer.state is Drive.ARRIVED:
            self._there = t if self._there < 0 else self._there
            if t - self._there >= round(self.hold_s * 1e9):
                return self._settled(t, here, Visit.ARRIVED, "")
            return ""
        if answer.state is Drive.UNREACHABLE:
            return self._settled(t, here, Visit.UNREACHABLE, answer.reason)
        waits = answer.reason if answer.state in (Drive.WAITING, Drive.BLIND) else ""
        changed = bool(waits) and not self._waits
        self._waits = waits
        return f"{self._name()}: {answer.state.value} ({waits})" if changed else ""

    def _settled(self, t: int, here: Fused, visit: Visit, reason: str) -> str:
        k, estimate = self._next, np.array([here.p[0], here.p[1], here.heading])
        told = self._name()
        self.outcomes[k] = replace(self.outcomes[k], visit=visit, t=t, estimate=estimate, reason=reason)
        self._next, self._there, self._waits = k + 1, -1, ""
        if visit is Visit.UNREACHABLE:
            return f"{told}: {visit.value}: {reason}"
        return f"{told}: {visit.value}, {100.0 * self.outcomes[k].error:.1f} cm off by its own estimate"

    def _name(self) -> str:
        east, north, heading = self.goals[self._next].tolist()
        turned = "" if isnan(heading) else f", {np.degrees(heading):.0f} deg"
        return f"goal {self._next + 1} of {len(self.goals)} at ({east:g}, {north:g}{turned})"
