"""Robots that tell one another all that they have heard: as good as one filter, as late as the news.

Only the two that meet talk. Each hands on the segments and relative records that the other lacks (see `ledger`), so
both end with the same knowledge; the news of third parties comes with them. No rule of fusion loses less when only
those that meet may talk; what is left behind the joint filter is the age of the news. The ledger of a robot grows with
its team, and so does a message by what has happened since the two last heard of one another.

News may be late, lost, doubled or out of order. A meeting that two robots know of holds back both of their chains until
what both have to say of it is here, or until it is older than `patience`; a robot itself goes on from the last meeting
that is settled, by its own records since (a replay), so late news count as if they had come at once.

A robot whose records are refused again and again is isolated: from then on it is judged, but not believed, and what was
shared with it is undone for the time to come: its block of the ledger begins anew, vague, from its own records only. If
these agree with what others measure of it, it is admitted again.
"""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeAlias, final

import numpy as np

from outrider.data import Verdict
from outrider.filters.cooperative.ledger import Ledger, Relative, Segment, close
from outrider.filters.cooperative.meeting import Outcome
from outrider.filters.cooperative.robot import Filter
from outrider.typing import Floats

LONGEST_CHAIN = 512  # segments of one robot that are kept for others
WINDOW, TOO_MANY = 5, 3  # judgements of one robot, and how many of them may not be refusals
VAGUE = 100.0  # times the first covariance: of a robot of which nothing is believed

Meeting: TypeAlias = tuple[float, int, int]
"""Time [s] and both robots, the lower number first."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class News:
    """What one robot tells another.  heard : (robots, robots) s, up to where each robot is known to have heard of
    each;  now : s, of the sender."""

    sender: int
    now: float
    segments: tuple[Segment, ...]
    records: tuple[Relative, ...]
    meetings: frozenset[Meeting]
    heard: Floats


@final
class Teammate:
    """One robot with its own filter, and its ledger of the team.

    `close` makes a node of now, where it meets a partner; `note` takes what was measured there; `news` is what a
    partner lacks, and `hear` takes the partner's; `settle` works it all out and corrects the robot. The filter of its
    own records has to be run up to now before each of them.
    patience : s, for how long a meeting waits for what the other has to say
    isolated : who is not believed, since when
    """

    def __init__(self, number: int, own: Filter, team: Filter, start: float, *, patience: float = np.inf) -> None:
        self.number, self.own, self.patience = number, own, patience
        first = float(np.nextafter(start, -np.inf))  # so records of the start itself belong to the first segment
        self.ledger = Ledger(team, first)
        self.heard = np.full((len(team.members),) * 2, first)
        self.outcomes: dict[tuple[float, int, int, int], Outcome] = {}
        self.isolated: dict[int, float] = {}
        self.events: list[tuple[float, int, bool]] = []  # s, who, whether isolated or admitted
        self._judged: list[deque[bool]] = [deque(maxlen=WINDOW) for _ in team.members]
        self._chains: dict[int, dict[float, Segment]] = {m: {} for m in range(len(team.members))}
        self._records: dict[tuple[float, int, int, int], Relative] = {}
        self._waiting: dict[Meeting, list[Relative]] = {}
        self._meetings: set[Meeting] = set()
        self._states = {first: own.snapshot()}
        self._go_on(first, *self.ledger.belief(number))

    @property
    def now(self) -> float:
        """The time to which its filter has run [s]."""
        return float(self.own.belief.clock[0])

    def close(self, partner: int) -> None:
        """Make now a node, where it meets a partner."""
        self._meet((self.now, min(partner, self.number), max(partner, self.number)))
        if self.now > self._node:
            self._chains[self.number][self._node] = close(self.own, self.number, self._node, self._x)
            self._states[self.now] = self.own.snapshot()
            self._go_on(self.now, self.own.belief.x.copy(), self.own.belief.P.copy())

    def note(self, record: Relative) -> None:
        """A relative record, of its own or heard, that is to be used once both chains have reached it."""
        if record.key not in self._records and record.key not in self.outcomes:
            self._records[record.key] = record
            self._meetings.add(record.meeting)
            if (self.ledger.node[[record.observer, record.observed]] <= record.t).all():
                self._waiting.setdefault(record.meeting, []).append(record)
            else:
                self.outcomes[record.key] = _late()

    def news(self, partner: int) -> News:
        """What the partner is not known to have heard."""
        known = self.heard[partner]
        return News(
            sender=self.number, now=self.now,
            segments=tuple(s for m, c in self._chains.items() for s in c.values() if s.end > known[m]),
            records=tuple(r for r in self._records.values() if r.t >= min(known[r.observer], known[r.observed])),
            meetings=frozenset(m for m in self._meetings if m[0] >= min(known[m[1]], known[m[2]])),
            heard=self.heard.copy(),
        )  # fmt: skip

    def hear(self, news: News) -> None:
        """Take what somebody tells; what is known already changes nothing."""
        for s in news.segments:
            if s.robot != self.number and s.end > self.ledger.node[s.robot]:
                self._chains[s.robot].setdefault(s.start, s)
        for meeting in news.meetings:
            self._meet(meeting)
        for r in news.records:
            self.note(r)
        np.maximum(self.heard, news.heard, out=self.heard)

    def settle(self) -> None:
        """Work out what has been heard, in the order of time, and go on from the last meeting that is settled."""
        now = self.now
        for meeting in sorted(self._waiting):
            t, *pair = meeting
            there = [self._reach(m, t) for m in pair]  # both go as far as they can
            if ready := all(there):
                for r in sorted(self._waiting[meeting], key=lambda r: r.key):
                    self.outcomes[r.key] = self._relate(r)
            elif t >= now - self.patience and not any(self.ledger.node[m] > t for m in pair):
                continue
            for r in () if ready else self._waiting[meeting]:
                self.outcomes[r.key] = _late()
            del self._waiting[meeting]
        for m in self._chains:
            self._reach(m, np.inf)
        self._replay(now)
        for m, chain in self._chains.items():
            self.heard[self.number, m] = max([s.end for s in chain.values()] + [float(self.ledger.node[m])])
        self._forget()

    def _meet(self, meeting: Meeting) -> None:
        if meeting not in self._meetings:
            self._meetings.add(meeting)
            if not any(self.ledger.node[m] > meeting[0] for m in meeting[1:]):
                self._waiting[meeting] = []

    def _reach(self, m: int, t: float) -> bool:
        """Advance robot m as far as its chain goes, but not beyond t, nor a meeting that waits; whether it is there."""
        chain, node = self._chains[m], self.ledger.node
        limit = min([w[0] for w in self._waiting if m in w[1:]] + [t])
        while node[m] < limit and (s := chain.get(float(node[m]))) is not None and s.end <= limit:
            outcome = self.ledger.advance(s, trusted=m == self.number or m in self.isolated)
            if m != self.number and m not in self.isolated and outcome.verdict is not Verdict.NOT_OBSERVING:
                self._judge(m, outcome)
            if outcome.verdict in (Verdict.GATED, Verdict.DIVERGED):
                self._isolate(m, s.end)
        return bool(node[m] == t)

    def _relate(self, r: Relative) -> Outcome:
        """Use a record between robots that are believed; judge one that is not."""
        pair = (r.observer, r.observed)
        doubted = [m for m in pair if m in self.isolated]
        outcome = self.ledger.relate(r, fuse=not doubted)
        for m in doubted if doubted else pair:
            if m != self.number:
                self._judge(m, outcome)
                if m in self.isolated and not any(self._judged[m]) and len(self._judged[m]) == WINDOW:
                    del self.isolated[m]
                    self.events.append((r.t, m, False))
                elif m not in self.isolated and sum(self._judged[m]) >= TOO_MANY:
                    self._isolate(m, r.t)
        return outcome

    def _judge(self, m: int, outcome: Outcome) -> None:
        if outcome.verdict in (Verdict.USED, Verdict.GATED, Verdict.DIVERGED):
            self._judged[m].append(outcome.verdict is not Verdict.USED)

    def _isolate(self, m: int, t: float) -> None:
        """Nothing of m is believed any longer, and nothing of what was shared with it helps it."""
        self.isolated[m] = t
        self.events.append((t, m, True))
        self._judged[m].clear()
        self.ledger.begin_anew(m, VAGUE)

    def _replay(self, now: float) -> None:
        """Its own records once more, from the last settled node to now; nodes in between are closed again."""
        node = float(self.ledger.node[self.number])
        later = sorted(t for t in self._states if t > node)
        self.own.restore(self._states[node], node)
        self._go_on(node, *self.ledger.belief(self.number))
        for t in later:
            self.own.run(t)
            self._chains[self.number][self._node] = close(self.own, self.number, self._node, self._x)
            self._go_on(t, self.own.belief.x.copy(), self.own.belief.P.copy())
        if now > node:
            self.own.run(now)
        for t in [t for t in self._states if t < node]:
            del self._states[t]

    def _forget(self) -> None:
        """Drop what everybody has heard."""
        known = self.heard.min(axis=0)
        for m, chain in self._chains.items():
            node = self.ledger.node[m]
            for t in [t for t, s in chain.items() if s.end <= min(known[m], node)] + list(chain)[:-LONGEST_CHAIN]:
                chain.pop(t, None)
        for key in [k for k, r in self._records.items() if r.t < min(known[r.observer], known[r.observed])]:
            del self._records[key]
        self._meetings = {m for m in self._meetings if m in self._waiting or m[0] >= min(known[m[1]], known[m[2]])}

    def _go_on(self, node: float, x: Floats, P: Floats) -> None:
        """The filter begins a segment at a node, from this estimate."""
        b = self.own.belief
        b.x[...], b.P[...], self.own.before[...] = x, P, P
        self._node, self._x = node, x
        self.own.forget()


def meet(one: Teammate, two: Teammate, records: Iterable[Relative]) -> None:
    """Two robots at one time, to which both filters have run, tell one another everything."""
    one.close(two.number)
    two.close(one.number)
    for r in records:
        one.note(r)
        two.note(r)
    to_two, to_one = one.news(two.number), two.news(one.number)
    one.hear(to_one)
    two.hear(to_two)
    for robot, other in ((one, two), (two, one)):
        robot.settle()
        robot.heard[other.number] = robot.heard[robot.number]


def _late() -> Outcome:
    return Outcome(Verdict.NOT_ALIGNED, float("nan"), 0)
