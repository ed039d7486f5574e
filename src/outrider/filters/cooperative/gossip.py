"""Robots that tell one another all that they have heard: as good as one filter, as late as the news.

Only the two that meet talk. Each hands on the segments and relative records that the other lacks (see `ledger`), so
both end with the same knowledge; the news of third parties comes with them. No rule of fusion loses less when only
those that meet may talk; what is left behind the joint filter is the age of the news. The ledger of a robot grows with
its team, and so does a message by what has happened since the two last heard of one another.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import final

import numpy as np

from outrider.data import Verdict
from outrider.filters.cooperative.ledger import Ledger, Relative, Segment, close
from outrider.filters.cooperative.meeting import Outcome
from outrider.filters.cooperative.robot import Filter
from outrider.typing import Floats

LONGEST_CHAIN = 512  # segments of one robot that are kept for others


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class News:
    """What one robot tells another.  heard : (robots, robots) s, up to where each robot is known to have heard of
    each."""

    segments: tuple[Segment, ...]
    records: tuple[Relative, ...]
    heard: Floats


@final
class Teammate:
    """One robot with its own filter, and its ledger of the team.

    `close` makes a node of now; `news` is what a partner lacks; `hear` takes the partner's; `settle` works it all out
    and corrects the robot. Two robots that meet close, hear one another, note what they have measured, and settle.
    """

    def __init__(self, number: int, own: Filter, team: Filter, start: float) -> None:
        self.number, self.own = number, own
        first = float(np.nextafter(start, -np.inf))  # so records of the start itself belong to the first segment
        self.ledger = Ledger(team, first)
        self.heard = np.full((len(team.members),) * 2, first)
        self.outcomes: dict[tuple[float, int, int, int], Outcome] = {}
        self._chains: dict[int, dict[float, Segment]] = {m: {} for m in range(len(team.members))}
        self._records: dict[tuple[float, int, int, int], Relative] = {}
        self._waiting: dict[tuple[float, int, int, int], Relative] = {}
        self._restart()

    def close(self) -> None:
        """Make now, to which its filter has run, a node."""
        start, now = float(self.ledger.node[self.number]), float(self.own.belief.clock[0])
        if now > start:
            s = close(self.own, self.number, start, self._x)
            self._chains[self.number][start] = s
            self.ledger.advance(s)
            self.heard[self.number, self.number] = now
            self._restart()

    def note(self, record: Relative) -> None:
        """A relative record, of its own or heard, that is to be used once both chains have reached it."""
        if record.key not in self._records:
            self._records[record.key] = self._waiting[record.key] = record

    def news(self, partner: int) -> News:
        """What the partner is not known to have heard."""
        known = self.heard[partner]
        return News(
            segments=tuple(s for m, c in self._chains.items() for t, s in c.items() if t >= known[m]),
            records=tuple(
                r for r in self._records.values() if r.t >= min(known[r.observer], known[r.observed])
            ),
            heard=self.heard.copy(),
        )  # fmt: skip

    def hear(self, news: News) -> None:
        """Take what somebody tells; what is known already changes nothing."""
        for s in news.segments:
            if s.robot != self.number and s.end > self.ledger.node[s.robot]:
                self._chains[s.robot].setdefault(s.start, s)
        for r in news.records:
            self.note(r)
        np.maximum(self.heard, news.heard, out=self.heard)

    def settle(self) -> None:
        """Work out what has been heard, in the order of time, and go on from the estimate at the last node."""
        for key in sorted(self._waiting):
            r = self._waiting[key]
            pair = (r.observer, r.observed)
            if all(self._reach(m, r.t) for m in pair):
                self.outcomes[key] = self.ledger.relate(r)
                del self._waiting[key]
            elif any(self.ledger.node[m] > r.t for m in pair):
                self.outcomes[key] = Outcome(Verdict.NOT_ALIGNED, float("nan"), 0)
                del self._waiting[key]
        for m in self._chains:
            self._reach(m, min([r.t for r in self._waiting.values() if m in (r.observer, r.observed)] + [np.inf]))
        self.heard[self.number] = self.ledger.node
        self._forget()
        self._restart()

    def _reach(self, m: int, t: float) -> bool:
        """Advance robot m as far as its chain goes, but not beyond t; whether it is there."""
        chain, node = self._chains[m], self.ledger.node
        while node[m] < t and (s := chain.get(float(node[m]))) is not None and s.end <= t:
            self.ledger.advance(s)
        return bool(node[m] == t)

    def _forget(self) -> None:
        """Drop what everybody has heard."""
        known = self.heard.min(axis=0)
        for m, chain in self._chains.items():
            for t in [t for t, s in chain.items() if s.end <= known[m]] + list(chain)[:-LONGEST_CHAIN]:
                chain.pop(t, None)
        old = [k for k, r in self._records.items() if r.t < min(known[r.observer], known[r.observed])]
        for key in old:
            del self._records[key]

    def _restart(self) -> None:
        """The filter goes on from the estimate in the ledger, which is of now."""
        x, P = self.ledger.belief(self.number)
        b = self.own.belief
        b.x[...], b.P[...], self.own.before[...], self._x = x, P, P, x
        self.own.forget()


def meet(one: Teammate, two: Teammate, records: Iterable[Relative]) -> None:
    """Two robots at one time, to which both filters have run, tell one another everything."""
    one.close()
    two.close()
    for r in records:
        one.note(r)
        two.note(r)
    to_two, to_one = one.news(two.number), two.news(one.number)
    one.hear(to_one)
    two.hear(to_two)
    for robot, other in ((one, two), (two, one)):
        robot.settle()
        robot.heard[other.number] = robot.heard[robot.number]
