"""What robots tell one another to correct each other, on a real radio: the message, its size, and what is refused.

A `Telegram` holds what the partner lacks (see `filters.cooperative.gossip`) and goes out at a meeting. It is one row of
float64: a head (version, sender, datum, time, the least age that it has seen of the receiver's telegrams, counts), up
to where everybody is known to have heard of everybody, then meetings, segments (matrices that are symmetric by their
triangle) and relative records. News that were lost come with the next telegram, since only the partner's own word tells
what it has heard. Telegrams may be late, doubled or out of order; `Exchange.receive` refuses, by name, what cannot be
right, and the estimate stays as it was.
"""

from collections import Counter
from dataclasses import dataclass
from enum import Enum
from functools import cache
from math import inf, nan
from typing import Final, final

import numpy as np

from outrider.data.agents import Message
from outrider.filters.cooperative.gossip import Meeting, News, Teammate
from outrider.filters.cooperative.ledger import Relative, Segment
from outrider.typing import Floats, Ints

TOPIC: Final = "cooperation"
VERSION: Final = 1.0
CLOCK_S: Final = 0.01  # by how much clocks may differ
_HEAD: Final = 11


class Refusal(Enum):
    """Why a telegram was not used."""

    UNREADABLE = "it is damaged or of another version"
    UNKNOWN = "it comes from, or tells of, a robot that is not of this team"
    ITSELF = "it tells of a robot that measured itself"
    DATUM = "its coordinates have another origin: give both robots the same datum"
    FUTURE = "it is from the future: synchronise the clocks"
    CLOCK = "the sender's clock is off: synchronise the clocks"
    NOT_FINITE = "it holds numbers that are not finite"
    COVARIANCE = "it holds a covariance that is not positive definite"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Telegram:
    """News with what is needed to judge them.  datum : latitude, longitude [rad], height [m] of the origin;  age : s,
    the least that the sender has seen of telegrams of the receiver, by its own clock; NaN: of none"""

    news: News
    datum: tuple[float, float, float]
    age: float = nan


def encode(telegram: Telegram) -> Floats:
    """(k,) the row on the air."""
    n = telegram.news
    head = [VERSION, n.sender, *telegram.datum, n.now, telegram.age, len(n.heard), len(n.meetings), len(n.segments),
            len(n.records)]  # fmt: skip
    parts: list[Floats] = [np.array(head, np.float64), n.heard.ravel()]
    parts += [np.array(m, np.float64) for m in sorted(n.meetings)]
    for s in n.segments:
        up = _upper(len(s.c))
        ends = np.array([s.robot, s.start, s.end, len(s.x_start), len(s.c)], np.float64)
        parts += [ends, s.x_start, s.x_end, s.G.ravel(), s.c, s.W[up], s.J[up], s.h]
    for r in n.records:
        parts += [np.array([r.observer, r.observed, r.t, r.serial, r.code, r.theta.size, r.z.size, r.r.size]), r.theta]
        parts += [r.z, r.r]
    return np.concatenate(parts)


@cache
def _upper(n: int) -> tuple[Ints, Ints]:
    """Rows and columns of the upper triangle."""
    rows, columns = np.triu_indices(n)
    return rows.astype(np.int64), columns.astype(np.int64)


class _Reader:
    """Takes numbers from a row, one after the other."""

    def __init__(self, row: Floats) -> None:
        self._row, self._at = row, 0

    def take(self, n: int) -> Floats:
        if not 0 <= n <= self._row.size - self._at:
            raise ValueError("the row is too short")
        self._at += n
        return self._row[self._at - n : self._at].copy()

    def counts(self, n: int) -> list[int]:
        values = self.take(n)
        if not (np.isfinite(values).all() and (values == np.rint(values)).all()):
            raise ValueError("a count is not a whole number")
        return [int(v) for v in values]

    def symmetric(self, n: int) -> Floats:
        out = np.zeros((n, n))
        out[_upper(n)] = self.take(n * (n + 1) // 2)
        return out + np.triu(out, 1).T

    @property
    def done(self) -> bool:
        return self._at == self._row.size


def decode(row: Floats) -> Telegram:
    """The telegram of a row. Raises `ValueError` for a row that is none."""
    read = _Reader(np.asarray(row, np.float64))
    if read.take(1)[0] != VERSION:
        raise ValueError("another version")
    (sender,) = read.counts(1)
    latitude, longitude, height, now, age = read.take(5).tolist()
    robots, meetings, segments, records = read.counts(4)
    heard = read.take(robots * robots).reshape(robots, robots)
    met: list[Meeting] = []
    for _ in range(meetings):
        t = float(read.take(1)[0])
        one, two = read.counts(2)
        met.append((t, one, two))
    news = News(
        sender=sender, now=now, heard=heard, meetings=frozenset(met),
        segments=tuple(_segment(read) for _ in range(segments)), records=tuple(_record(read) for _ in range(records)),
    )  # fmt: skip
    if not read.done:
        raise ValueError("the row is too long")
    return Telegram(news=news, datum=(latitude, longitude, height), age=age)


def _segment(read: _Reader) -> Segment:
    (robot,), (start, end), (size, n) = read.counts(1), read.take(2).tolist(), read.counts(2)
    return Segment(
        robot=robot, start=start, end=end, x_start=read.take(size), x_end=read.take(size),
        G=read.take(n * n).reshape(n, n), c=read.take(n), W=read.symmetric(n), J=read.symmetric(n), h=read.take(n),
    )  # fmt: skip


def _record(read: _Reader) -> Relative:
    (one, two), t = read.counts(2), float(read.take(1)[0])
    serial, code, theta, z, r = read.counts(5)
    return Relative(observer=one, observed=two, t=t, serial=serial, code=code, theta=read.take(theta), z=read.take(z),
                    r=read.take(r))  # fmt: skip


@final
class Exchange:
    """One robot's end of the exchange.  refused : sender -> how often for what reason;  sent : bytes;  offset : of
    partners' clocks [s], as far as both directions were heard"""

    def __init__(
        self, mate: Teammate, names: tuple[str, ...], datum: tuple[float, float, float] = (0.0, 0.0, 0.0)
    ) -> None:
        self.mate, self.names, self.datum = mate, names, datum
        self.refused: Counter[tuple[str, Refusal]] = Counter()
        self.offset: dict[str, float] = {}
        self.sent = self.telegrams = self.received = 0
        self._age: dict[str, float] = {}

    @property
    def name(self) -> str:
        """Of this robot."""
        return self.names[self.mate.number]

    def telegram(self, partner: str) -> Telegram:
        """What to tell a partner now."""
        news = self.mate.news(self.names.index(partner))
        return Telegram(news=news, datum=self.datum, age=self._age.get(partner, nan))

    def post(self, partner: str, telegram: Telegram) -> Message:
        """A telegram as a message for the radio."""
        message = Message(sender=self.name, receiver=partner, topic=TOPIC, t=round(telegram.news.now * 1e9),
                          data={"telegram": encode(telegram)})  # fmt: skip
        self.sent += message.size
        self.telegrams += 1
        return message

    def receive(self, message: Message, now: float) -> Refusal | None:
        """Take a message that arrives at `now` [s]; why not, if it is refused. `mate.settle` then works it out."""
        try:
            telegram = decode(message.data["telegram"])
        except (ValueError, KeyError):
            return self._refuse(message.sender, Refusal.UNREADABLE)
        why = self._why_not(telegram, message.sender, now)
        if why is not None:
            return self._refuse(message.sender, why)
        self.received += 1
        self.mate.hear(telegram.news)
        return None

    def _refuse(self, sender: str, why: Refusal) -> Refusal:
        self.refused[sender, why] += 1
        return why

    def _why_not(self, telegram: Telegram, sender: str, now: float) -> Refusal | None:
        n, robots = telegram.news, range(len(self.names))
        told = [s.robot for s in n.segments] + [m for w in n.meetings for m in w[1:]]
        told += [m for r in n.records for m in (r.observer, r.observed)]
        if sender not in self.names or n.sender != self.names.index(sender) or any(m not in robots for m in told):
            return Refusal.UNKNOWN
        if n.sender == self.mate.number or any(r.observer == r.observed for r in n.records):
            return Refusal.ITSELF
        if telegram.datum != self.datum:
            return Refusal.DATUM
        if len(n.heard) != len(self.names) or not self._fits(n):
            return Refusal.UNREADABLE
        if not _finite(n):
            return Refusal.NOT_FINITE
        late = self._clock(telegram, sender, now)
        if late is not None:
            return late
        return None if all(_positive(s.W) and _positive(s.J) for s in n.segments) else Refusal.COVARIANCE

    def _clock(self, telegram: Telegram, sender: str, now: float) -> Refusal | None:
        """Offset of the sender's clock, from the least ages of telegrams in both directions. It is off for certain if
        one of these is negative: nobody has heard or measured anything in the future."""
        n = telegram.news
        age = self._age[sender] = min(self._age.get(sender, inf), now - n.now)
        if np.isfinite(telegram.age):
            self.offset[sender] = 0.5 * (telegram.age - age)
        latest = max([n.now, float(n.heard.max())] + [s.end for s in n.segments] + [r.t for r in n.records])
        if latest > now + CLOCK_S:
            return Refusal.FUTURE
        return Refusal.CLOCK if telegram.age < -CLOCK_S else None

    def _fits(self, n: News) -> bool:
        """Whether states have the sizes of the robots that they are of, and times run forward."""
        layouts = [m.belief.layout for m in self.mate.ledger.joint.members]
        return all(
            (len(s.x_start), len(s.c)) == (layouts[s.robot].size, layouts[s.robot].error_size) and s.start < s.end
            for s in n.segments
        )


def _finite(n: News) -> bool:
    arrays = [n.heard, *(a for s in n.segments for a in (s.x_start, s.x_end, s.G, s.c, s.W, s.J, s.h))]
    arrays += [np.array([t for t, *_ in n.meetings]), *(a for r in n.records for a in (r.theta, r.z))]
    return np.isfinite(n.now) and all(bool(np.isfinite(a).all()) for a in arrays)


def _positive(M: Floats) -> bool:
    """Whether a symmetric matrix has no eigenvalue below zero, to rounding, whatever the units of its rows. What is
    left of the covariance of two nodes close to each other is rounding, some 1e-14, of either sign."""
    d = np.diag(M)
    if (d < -1e-9 * max(1.0, float(np.abs(d).max(initial=0.0)))).any():
        return False
    scale = np.sqrt(np.maximum(d, 1e-9))
    return bool(np.linalg.eigvalsh(M / np.outer(scale, scale))[0] > -1e-3)
