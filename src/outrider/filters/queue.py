"""The events of all channels in the order of their stamps, whatever the order of their arrival."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np

from outrider._kernel import kernel
from outrider.data import Verdict
from outrider.filters.channels import Records
from outrider.filters.state import ROWS
from outrider.filters.step import plausible
from outrider.typing import Floats, Ints

_USED, _WITHHELD, _LATE = int(Verdict.USED), int(Verdict.WITHHELD), int(Verdict.LATE)


class Events(NamedTuple):
    """Events in time order: t (n,) s, src (n,) channel, z, r (n, ROWS), flag (n,) verdict so far."""

    t: Floats
    src: Ints
    z: Floats
    r: Floats
    flag: Ints

    def until(self, n: int) -> "Events":
        """The first n of them."""
        return Events(self.t[:n], self.src[:n], self.z[:n], self.r[:n], self.flag[:n])


@kernel
def is_input(ev: Events, i: int) -> bool:
    """Whether event i, of a channel that drives the prediction, will be used."""
    return (ev.flag[i] == _USED or ev.flag[i] == _WITHHELD) and plausible(ev.z[i])


@final
@dataclass(frozen=True, slots=True)
class Queue:
    """Events over all channels in order: t (n,) ns, src (n,), index (n,) into that channel's records, late (n,)."""

    t: Ints
    src: Ints
    index: Ints
    late: Ints
    parts: tuple[Records, ...]
    t0: int

    def __len__(self) -> int:
        return int(self.src.size)

    def whole_instants(self, last: int, stop: int) -> int:
        """The least end >= last, at most `stop`, that parts no events of equal time."""
        while 0 < last < stop and self.t[last] == self.t[last - 1]:
            last += 1
        return last

    def through_next_input(self, last: int, stop: int, inputs: Ints) -> int:
        """The least end >= last that has the next good record of one of the channels `inputs`; last if none follows."""
        for i in (last + np.flatnonzero(np.isin(self.src[last:stop], inputs))).tolist():
            if is_input(self.events(i, i + 1), 0):
                return i + 1
        return last

    def events(self, first: int, last: int) -> Events:
        """Events first..last as arrays."""
        src, index = self.src[first:last], self.index[first:last]
        t, flag = np.zeros(src.size), np.zeros(src.size, np.int64)
        z, r = np.zeros((src.size, ROWS)), np.zeros((src.size, ROWS))
        for c, part in enumerate(self.parts):
            here = src == c
            rows = index[here]
            t[here] = (part.t[rows] - self.t0) * 1e-9
            z[here], r[here], flag[here] = part.z[rows], part.r[rows], part.flag[rows]
        late = self.late[first:last] > 0
        flag[late & ((flag == Verdict.USED) | (flag == Verdict.WITHHELD))] = _LATE
        return Events(t, src, z, r, flag)


def queue(parts: Sequence[Records], t0: int, history: float) -> Queue:
    """Put the records of all channels in time order; those that arrive after their history is gone are late.

    Ties are broken by channel, then by the order within the stream, never by arrival: any arrival order inside the
    history gives the same events.
    """
    src = np.concatenate([np.full(p.t.size, c, np.int64) for c, p in enumerate(parts)])
    index = np.concatenate([np.arange(p.t.size, dtype=np.int64) for p in parts])
    t = np.concatenate([p.t for p in parts])
    arrival = np.concatenate([p.t_arrival for p in parts])
    usable = np.concatenate([p.flag for p in parts]) <= int(Verdict.WITHHELD)
    by_arrival = np.lexsort((index, src, t, arrival))
    seconds = (t[by_arrival] - t0) * 1e-9  # as `OnlineFilter` is told, so that both draw the line at the same bit
    newest = np.maximum.accumulate(np.where(usable[by_arrival], seconds, -np.inf))
    late = np.zeros(t.size, np.int64)
    late[by_arrival] = seconds < newest - history
    order = np.lexsort((index, src, t))
    return Queue(t[order], src[order], index[order], late[order], tuple(parts), t0)
