"""Which stamps belong to the log: judged by what most of its sources agree on, before any record is looked at.

Two questions. *Whose clock?* Where a recorder noted arrivals, a stream's usual arrival minus stamp must be about that
of most streams. *Which time?* Records of one source that follow one another form a stretch; stretches of all sources
that lie close together form a session, and a session counts if most sources took part in it. A robot that is switched
off for a night gives two sessions; a clock that jumps or a block of wrong stamps gives a session of one source.
"""

from collections.abc import Iterable, Mapping
from typing import Final, NamedTuple

import numpy as np

from outrider.data import Stream
from outrider.typing import Bools, Floats, Ints

EARLIEST: Final = 1  # ns: a stamp of zero is no stamp, but where a clock begins
BEGINNING: Final = 3.0  # usual periods within which the next stamp then follows
LATEST: Final = 2**62  # ns, the year 2116
CLOCK_JUMP: Final = 600.0  # s between a stamp and its arrival, beyond the stream's usual offset
SESSION_GAP: Final = 60.0  # s without any record that part two sessions
PAUSE: Final = 5.0  # s between records that part two stretches of a source, or
PERIODS: Final = 20.0  # so many of its usual periods
FEW: Final = 3  # different stamps that make a stretch
THIN: Final = 0.2  # of the density of a source's longest stretch: thinner ones are strays
MARGIN: Final = 5.0  # s around a session that single records may lie outside


class Stretch(NamedTuple):
    """Records of one source that follow one another. first, last [ns]; stamps: how many different ones."""

    first: int
    last: int
    stamps: int


class Session(NamedTuple):
    """Stretches that lie close together. first, last [ns]; names of the sources; stamps: how many."""

    first: int
    last: int
    names: set[str]
    stamps: int


def usable(s: Stream) -> Bools:
    """(n,) whether a stamp is one at all."""
    return (s.t >= earliest(s)) & (s.t < LATEST)


def earliest(s: Stream) -> int:
    """The least stamp that is one [ns]: 0 for a clock that begins with this stream, as that of a table does.

    It has one stamp of zero, the next follows as any other does, and the recorder's clock says no other time.
    """
    if np.count_nonzero(s.t == 0) != 1:
        return EARLIEST
    after, arrived = np.unique(s.t[s.t >= 0]), int(s.t_arrival[s.t == 0][0])
    if len(after) < FEW or not 0 <= arrived <= PAUSE * 1e9:
        return EARLIEST
    return 0 if after[1] <= BEGINNING * float(np.median(np.diff(after))) else EARLIEST


def lag(s: Stream) -> Floats:
    """(n,) arrival minus stamp [ns]."""
    return (np.clip(s.t_arrival, -LATEST, LATEST) - np.clip(s.t, -LATEST, LATEST)).astype(np.float64)


def usual_lags(log: Iterable[Stream]) -> dict[str, float]:
    """Usual arrival minus stamp [ns] by stream: its own median, or the log's where its own is another clock's.

    The log's is the one that most streams agree with to within `CLOCK_JUMP`, of equals that of most records.
    """
    own = {s.name: (float(np.median(lag(s)[good])), len(s)) for s in log if (good := usable(s)).any()}

    def support(offset: float) -> tuple[int, int]:
        near = [n for other, n in own.values() if abs(other - offset) <= CLOCK_JUMP * 1e9]
        return len(near), sum(near)

    common = max((offset for offset, _ in own.values()), key=support, default=0.0)
    return {name: m if abs(m - common) <= CLOCK_JUMP * 1e9 else common for name, (m, _) in own.items()}


def astray(log: Iterable[Stream], bad: Mapping[str, Bools]) -> dict[str, Bools]:
    """(n,) by stream: which records lie outside all sessions that most sources took part in.

    bad : (n,) by stream, stamps that are known to be wrong and have no vote
    """
    streams = list(log)
    spans = sessions({s.name: stretches(s.t[~bad[s.name]]) for s in streams})
    out: dict[str, Bools] = {}
    for s in streams:
        inside = np.zeros(len(s), np.bool_)
        for first, last in spans:
            inside |= (s.t >= first) & (s.t <= last)
        out[s.name] = ~inside & ~bad[s.name]
    return out


def stretches(t: Ints) -> list[Stretch]:
    """The stretches of one source, in order; the longest always counts, however few its records are."""
    t = np.unique(t)
    if not t.size:
        return []
    gaps = np.diff(t)
    longest_pause = max(PAUSE * 1e9, PERIODS * float(np.median(gaps))) if gaps.size else 0.0
    cut = np.flatnonzero(gaps > longest_pause)
    firsts, lasts = np.concatenate([[0], cut + 1]), np.concatenate([cut, [t.size - 1]])
    counts = lasts - firsts + 1
    found = [Stretch(int(t[a]), int(t[b]), int(n)) for a, b, n in zip(firsts, lasts, counts, strict=True)]
    best = max(found, key=lambda f: f.stamps)
    return [f for f in found if f is best or (f.stamps >= FEW and density(f) >= THIN * density(best))]


def density(f: Stretch) -> float:
    """Different stamps per second, of a single one within a second."""
    return f.stamps / max((f.last - f.first) * 1e-9, 1.0)


def sessions(found: Mapping[str, list[Stretch]]) -> list[tuple[int, int]]:
    """(first, last) [ns] of every session that counts, with a margin.

    The session that most sources shared does (of equals the one of most records), and every other in which more than
    half of those sources took part.
    """
    everything = sorted((f, name) for name, parts in found.items() for f in parts)
    parts: list[Session] = []
    for f, name in everything:
        if not parts or f.first - parts[-1].last > SESSION_GAP * 1e9:
            parts.append(Session(f.first, f.last, set(), 0))
        s = parts[-1]
        s.names.add(name)
        parts[-1] = s._replace(last=max(s.last, f.last), stamps=s.stamps + f.stamps)
    main = max(parts, key=lambda s: (len(s.names), s.stamps), default=None)
    if main is None:
        return []
    margin = round(MARGIN * 1e9)
    return [(s.first - margin, s.last + margin) for s in parts if 2 * len(s.names & main.names) > len(main.names)]


__all__ = ["SESSION_GAP", "astray", "earliest", "sessions", "stretches", "usual_lags"]
