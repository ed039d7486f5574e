"""Alerts, and what may become of them."""

from dataclasses import dataclass
from enum import Enum
from typing import final

import numpy as np

from outrider.errors import DataError
from outrider.typing import Floats


class AlertState(Enum):
    """Where an alert stands; the value is the sentence a user reads."""

    WAITING = "no robot has been sent yet"
    ASSIGNED = "a robot is on its way"
    ON_SCENE = "a robot observes it"
    OBSERVED = "it was observed"
    CANCELLED = "it was cancelled"
    TIMED_OUT = "nobody arrived in time"
    UNREACHABLE = "no robot can reach a place with a view of it"
    DUPLICATE = "it repeats an alert that is already open"

    @property
    def ended(self) -> bool:
        """Whether nothing more will become of it."""
        return self not in (AlertState.WAITING, AlertState.ASSIGNED, AlertState.ON_SCENE)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Alert:
    """Something that a robot should look at.

    number : its name, -1 for none;  t : ns, when it was raised;  p : (2,) m, site frame;  sigma : m, of each
    coordinate;  source : who raised it;  patience_s : how long until nobody needs to come any more;  hold_s : how long
    to observe.
    """

    t: int
    p: Floats
    number: int = -1
    sigma: float = 1.0
    source: str = ""
    patience_s: float = 600.0
    hold_s: float = 20.0

    def __post_init__(self) -> None:
        numbers = (*self.p.ravel().tolist(), self.sigma, self.patience_s, self.hold_s)
        if self.p.shape != (2,) or not np.isfinite(numbers).all():
            fix = "east and north, sigma and times as finite numbers"
            raise DataError(f"its place is {self.p.tolist()}", where=f"alert {self.number}", fix=fix)
        if self.sigma < 0.0 or self.patience_s <= 0.0 or self.hold_s < 0.0:
            raise DataError("a negative sigma, patience or hold", where=f"alert {self.number}", fix="zero or more")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class News:
    """What a source of alerts has had to say. cancelled : numbers of alerts called off;  faults : a line about each
    line that could not be used;  notes : what else there is to say."""

    raised: tuple[Alert, ...] = ()
    cancelled: tuple[int, ...] = ()
    faults: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
