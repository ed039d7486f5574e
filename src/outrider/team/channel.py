"""Robots that have met and talk of it by radio: who sends what when, and what arrives."""

import heapq
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol, TypeAlias, final

import numpy as np

from outrider.data.agents import Message
from outrider.filters.cooperative.gossip import Teammate
from outrider.filters.cooperative.ledger import Relative
from outrider.team.exchange import Exchange, Telegram
from outrider.typing import Floats

Places: TypeAlias = Callable[[float], Mapping[str, Floats]]
"""Positions [m] at a time [s], for the range of the radio."""
Lie: TypeAlias = Callable[[str, float, Telegram], Telegram]
"""What a robot (name) says at a time [s] instead of what it knows."""


class Arrival(Protocol):
    """One message at one receiver. t : ns of arrival, None if it is lost."""

    @property
    def t(self) -> int | None: ...


class Air(Protocol):
    """Any radio.  sent : messages;  lost : how many for what reason"""

    @property
    def sent(self) -> int: ...

    @property
    def lost(self) -> Mapping[Any, int]: ...

    def send(self, message: Message, places: Mapping[str, Floats]) -> Sequence[Arrival]:
        """Put a message on the air, from these places [m]."""
        ...

    def receive(self, robot: str, until: int) -> Sequence[Message]:
        """What has reached a robot by `until` [ns], each message once."""
        ...


def nowhere(names: Sequence[str]) -> Places:
    """Everybody in one place, for a radio without end."""

    def here(t: float) -> Mapping[str, Floats]:
        return dict.fromkeys(names, np.zeros(3))

    return here


@final
class Channel:
    """What goes on between teammates: `meet` and `receive`, by time.  ends : of each robot

    The air counts nanoseconds from second 0.
    """

    def __init__(
        self, mates: Sequence[Teammate], names: tuple[str, ...], air: Air, places: Places, *, lie: Lie | None = None
    ) -> None:
        self.ends = [Exchange(mate, names) for mate in mates]
        self.air, self._places, self._lie = air, places, lie
        self._due: list[tuple[float, int]] = []

    def meet(self, met: Sequence[Relative]) -> None:
        """All meetings of one time: both make a node, the observer notes its record, and both send."""
        now, ends = met[0].t, self.ends
        pairs = sorted({tuple(sorted((r.observer, r.observed))) for r in met})
        for r in met:
            for m, partner in ((r.observer, r.observed), (r.observed, r.observer)):
                ends[m].mate.own.run(now)
                ends[m].mate.close(partner)
            ends[r.observer].mate.note(r)
        for m in sorted({m for pair in pairs for m in pair}):
            ends[m].mate.settle()
        for pair in pairs:
            for m, partner in (pair, pair[::-1]):
                self._send(m, partner, now)

    def _send(self, m: int, partner: int, now: float) -> None:
        end, name = self.ends[m], self.ends[partner].name
        telegram = end.telegram(name)
        if self._lie is not None:
            telegram = self._lie(end.name, now, telegram)
        for delivery in self.air.send(end.post(name, telegram), self._places(now)):
            if delivery.t is not None:
                heapq.heappush(self._due, (delivery.t * 1e-9, partner))

    def receive(self, until: float) -> None:
        """Let arrive what arrives up to a time [s], each robot having run to it."""
        while self._due and self._due[0][0] <= until:
            now, robot = heapq.heappop(self._due)
            end = self.ends[robot]
            end.mate.own.run(now)
            for message in self.air.receive(end.name, round(now * 1e9)):
                end.receive(message, now)
            end.mate.settle()
