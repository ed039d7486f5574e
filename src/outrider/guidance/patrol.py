"""The mission of one robot as a pure transition: it patrols, responds to alerts, observes, charges.

There is no more to it than being there: "on scene" is the end of a task.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from math import inf
from typing import final

from outrider.errors import ConfigError
from outrider.typing import Floats


class Duty(Enum):
    """What a robot is about."""

    PATROL = "it patrols"
    RESPOND = "it is on its way to an alert"
    OBSERVE = "it observes an alert"
    CHARGE = "it is on its way to the dock, or charges"
    STAND = "it stands: nowhere of its round can be reached"
    BLIND = "it stands: it does not see, or does not know where it is"
    EMPTY = "it stands: its battery is empty"


class Ended(Enum):
    """How a response to an order ended."""

    OBSERVED = "it was observed for as long as was asked"
    CANCELLED = "it was cancelled"
    TIMED_OUT = "the time for it ran out on the way"
    UNREACHABLE = "the place from which to look cannot be reached"
    REPLACED = "another order came in its place"
    BATTERY = "the battery must be charged first"
    BLIND = "the robot did not see, or did not know where it was"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """Go and look. number : of the order, never used twice;  alert : what it is about;  view : (3,) east, north [m]
    and heading [rad] to stand at;  until_s : when it is too late [s], on the clock of `Inputs.t_s`."""

    number: int
    alert: int
    view: Floats
    hold_s: float
    until_s: float


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Rules:
    """When to charge, and when to give up. low, full : shares of a full battery;  blind_s : how long a robot may be
    blind before somebody else is to go."""

    low: float = 0.2
    full: float = 0.95
    blind_s: float = 5.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.low < self.full <= 1.0:
            raise ConfigError(f"low {self.low:g}, full {self.full:g}", where="battery", fix="0 <= low < full <= 1")
        if not self.blind_s >= 0.0:
            raise ConfigError(f"blind_s is {self.blind_s:g}", where="patrol", fix="0 or more seconds")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Inputs:
    """What a transition looks at.

    t_s : s, on a clock that robots and station share;  arrived : at the goal of the present duty;  unreachable : that
    goal, as the planner says;  blind : it does not see, or does not know where it is;  battery : share left;  order :
    one that has just come;  cancelled : numbers of orders that are called off;  stops : of the round.
    """

    t_s: float
    arrived: bool = False
    unreachable: bool = False
    blind: bool = False
    battery: float = 1.0
    order: Order | None = None
    cancelled: tuple[int, ...] = ()
    stops: int = 1


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Mission:
    """duty; the order it answers to; the stop of the round that is next, and how many in a row were out of reach;
    since when it observes; since when it is blind."""

    duty: Duty = Duty.PATROL
    order: Order | None = None
    stop: int = 0
    missed: int = 0
    since_s: float = 0.0
    blind_s: float = inf


Report = tuple[int, Ended]
"""The number of an order, and how the response to it ended."""
Transition = Callable[[Mission, Inputs, Rules], tuple[Mission, tuple[Report, ...]]]
"""What a mission becomes, and the responses that ended with it."""


def advance(m: Mission, s: Inputs, rules: Rules = Rules()) -> tuple[Mission, tuple[Report, ...]]:
    """The next state of a mission, and the responses that ended with it; every order taken ends exactly once."""
    m, ended = _given_up(m, s)
    m = replace(m, blind_s=min(m.blind_s, s.t_s) if s.blind else inf)
    stopped = _stopped(m, s, rules)
    if stopped is not None:
        duty, how = stopped
        m, more = _released(m, how)
        return replace(m, duty=duty), ended + more + _refused(s, how)
    fresh = bool(ended)  # on a duty for which it cannot have arrived yet
    if m.duty in (Duty.CHARGE, Duty.BLIND, Duty.EMPTY):
        m, fresh = replace(m, duty=Duty.PATROL, missed=0), True
    if s.order is not None and s.order.number not in s.cancelled:
        m, more = _released(m, Ended.REPLACED)
        return replace(m, duty=Duty.RESPOND, order=s.order, missed=0), ended + more
    m, more = (m, ()) if fresh else _gone_on(m, s)
    return m, ended + more


def _stopped(m: Mission, s: Inputs, rules: Rules) -> tuple[Duty, Ended] | None:
    """What stands over every order: an empty battery, blindness, a battery that must be charged."""
    if s.battery <= 0.0:
        return Duty.EMPTY, Ended.BATTERY
    if s.t_s - m.blind_s >= rules.blind_s:
        return Duty.BLIND, Ended.BLIND
    charges = m.duty in (Duty.CHARGE, Duty.EMPTY)
    if s.battery < (rules.full if charges else rules.low):
        return Duty.CHARGE, Ended.BATTERY
    return None


def _given_up(m: Mission, s: Inputs) -> tuple[Mission, tuple[Report, ...]]:
    """Orders that are called off or too late."""
    if m.order is not None and m.order.number in s.cancelled:
        return _released(m, Ended.CANCELLED)
    if m.order is not None and m.duty is Duty.RESPOND and s.t_s > m.order.until_s:
        return _released(m, Ended.TIMED_OUT)
    return m, ()


def _gone_on(m: Mission, s: Inputs) -> tuple[Mission, tuple[Report, ...]]:
    """What follows from having arrived, or from not being able to."""
    if m.order is not None and m.duty is Duty.RESPOND:
        if s.unreachable:
            return _released(m, Ended.UNREACHABLE)
        return (replace(m, duty=Duty.OBSERVE, since_s=s.t_s) if s.arrived else m), ()
    if m.order is not None and m.duty is Duty.OBSERVE:
        return _released(m, Ended.OBSERVED) if s.t_s - m.since_s >= m.order.hold_s else (m, ())
    if s.unreachable and (m.duty is Duty.STAND or m.missed + 1 >= s.stops):  # it tries the next, without hope
        return replace(m, duty=Duty.STAND, stop=_after(m, s), missed=0), ()
    if s.unreachable:
        return replace(m, duty=Duty.PATROL, stop=_after(m, s), missed=m.missed + 1), ()
    if s.arrived:
        return replace(m, duty=Duty.PATROL, stop=_after(m, s), missed=0), ()
    return m, ()


def _after(m: Mission, s: Inputs) -> int:
    return (m.stop + 1) % max(s.stops, 1)


def _released(m: Mission, how: Ended) -> tuple[Mission, tuple[Report, ...]]:
    """Back to the round, to the stop it was on its way to."""
    if m.order is None:
        return m, ()
    return replace(m, duty=Duty.PATROL, order=None, missed=0), ((m.order.number, how),)


def _refused(s: Inputs, how: Ended) -> tuple[Report, ...]:
    """An order that comes while the robot can follow none."""
    return ((s.order.number, how),) if s.order is not None else ()
