"""A team whose robots tell one another what they measure over a radio that loses, delays and shuffles."""

import heapq
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias, final

import numpy as np

from outrider.data import Verdict
from outrider.filters.cooperative import FALSE_ALARM, Member, Method, Shared, Source, TeamEstimate
from outrider.filters.cooperative.fusion import Prepared, prepare
from outrider.filters.cooperative.ledger import Relative
from outrider.sim.radio import Air, Lost, Radio
from outrider.team.exchange import Exchange, Refusal, Telegram
from outrider.typing import Floats

Places: TypeAlias = Callable[[float], Mapping[str, Floats]]
"""True positions [m] at a time [s], for the range of the radio."""
Lie: TypeAlias = Callable[[str, float, Telegram], Telegram]
"""What a robot (name) says at a time [s] instead of what it knows."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Heard:
    """What became of the exchange.  isolated : robot -> (s, who, whether isolated or admitted again)"""

    estimate: TeamEstimate
    telegrams: int
    sent_bytes: int
    received: int
    lost: Counter[Lost]
    refused: Counter[tuple[str, Refusal]]
    isolated: Mapping[str, Sequence[tuple[float, str, bool]]]


def fuse_by_radio(
    members: Sequence[Member],
    sources: Sequence[Source],
    t: Floats,
    radio: Radio,
    seed: int,
    *,
    shared: Sequence[Shared] = (),
    start: float | None = None,
    false_alarm: float = FALSE_ALARM,
    patience: float = 3.0,
    places: Places | None = None,
    lie: Lie | None = None,
) -> Heard:
    """`fuse_team` by `Method.DISTRIBUTED`, where robots that measure one another send telegrams by this radio.

    Both know when they met; what was measured, and all else, is told. Estimates at the times t are those of the moment:
    what arrives later does not change them.
    patience : s, for how long a meeting waits for news of it
    """
    ready = prepare(members, sources, Method.DISTRIBUTED, t, shared=shared, start=start, false_alarm=false_alarm)
    mates = ready.mates(patience)
    names = tuple(m.name for m in members)
    ends = [Exchange(mate, names) for mate in mates]
    air = Air(radio, names, seed, 0)
    here = places or _together(names)
    due: list[tuple[float, int]] = []
    for met in _by_time(ready):
        _receive(ends, air, due, met[0].t)
        _meet(ends, air, due, met, here, lie)
    _receive(ends, air, due, ready.end)
    out = np.full((ready.records.t.size, 3), np.nan)
    ready.finish(out)
    for e in np.flatnonzero(ready.whom[ready.records.source] >= 0).tolist():
        seen = ready.relative(e)
        found = mates[seen.observer].outcomes.get(seen.key)
        out[e] = (found.verdict, found.nis, found.dof) if found is not None else (Verdict.NOT_ALIGNED, np.nan, 0)
    return Heard(
        estimate=ready.estimate(Method.DISTRIBUTED, ready.filters, out), telegrams=sum(e.telegrams for e in ends),
        sent_bytes=sum(e.sent for e in ends), received=sum(e.received for e in ends), lost=air.lost,
        refused=sum((e.refused for e in ends), Counter()),
        isolated={e.name: [(at, names[m], out) for at, m, out in e.mate.events] for e in ends if e.mate.events},
    )  # fmt: skip


def _together(names: Sequence[str]) -> Places:
    """Everybody in one place, for a radio without end."""

    def here(t: float) -> Mapping[str, Floats]:
        return dict.fromkeys(names, np.zeros(3))

    return here


def _by_time(ready: Prepared) -> list[list[Relative]]:
    out: list[list[Relative]] = []
    for e in ready.meetings():
        seen = ready.relative(e)
        if out and out[-1][0].t == seen.t:
            out[-1].append(seen)
        else:
            out.append([seen])
    return out


def _meet(
    ends: Sequence[Exchange], air: Air, due: list[tuple[float, int]], met: Sequence[Relative], here: Places,
    lie: Lie | None,
) -> None:  # fmt: skip
    """All meetings of one time: both make a node, the observer notes its record, and both send."""
    now = met[0].t
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
            name = ends[partner].name
            telegram = ends[m].telegram(name)
            if lie is not None:
                telegram = lie(ends[m].name, now, telegram)
            for delivery in air.send(ends[m].post(name, telegram), here(now)):
                if delivery.t is not None:
                    heapq.heappush(due, (delivery.t * 1e-9, partner))


def _receive(ends: Sequence[Exchange], air: Air, due: list[tuple[float, int]], until: float) -> None:
    """Let arrive what arrives up to a time, each robot having run to it."""
    while due and due[0][0] <= until:
        now, robot = heapq.heappop(due)
        end = ends[robot]
        end.mate.own.run(now)
        for message in air.receive(end.name, round(now * 1e9)):
            end.receive(message, now)
        end.mate.settle()
