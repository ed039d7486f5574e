"""A team whose robots tell one another what they measure over a radio that loses, delays and shuffles."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from outrider.data import Verdict
from outrider.filters.cooperative import FALSE_ALARM, Member, Method, Shared, Source, TeamEstimate
from outrider.filters.cooperative.fusion import Prepared, prepare
from outrider.filters.cooperative.ledger import Relative
from outrider.sim.radio import Air, Lost, Radio
from outrider.team.channel import Channel, Lie, Places, nowhere
from outrider.team.exchange import Refusal
from outrider.typing import Floats


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
    mates, names = ready.mates(patience), tuple(m.name for m in members)
    air = Air(radio, names, seed, 0)
    channel = Channel(mates, names, air, places or nowhere(names), lie=lie)
    for met in _by_time(ready):
        channel.receive(met[0].t)
        channel.meet(met)
    channel.receive(ready.end)
    ends = channel.ends
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


def _by_time(ready: Prepared) -> list[list[Relative]]:
    out: list[list[Relative]] = []
    for e in ready.meetings():
        seen = ready.relative(e)
        if out and out[-1][0].t == seen.t:
            out[-1].append(seen)
        else:
            out.append([seen])
    return out
