"""Rows of the benchmark table: what is timed, that both sides agree, and how it is printed.

A module of this package contributes with a function `rows() -> list[Row]`. Times are CPU time per event. Repetitions of
all sides of a row are interleaved, so that what disturbs the machine disturbs everybody; the ratio is the median of
the ratios within each repetition. What has taken `BOUND_S` is timed no more, a peer after one time, ours after
`FEWEST`: the slow get fewer repetitions.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from time import process_time
from typing import final

import numpy as np

BOUND_S, FEWEST = 5.0, 3


@final
@dataclass(frozen=True)
class Side:
    """One implementation. `run(events)` starts afresh, takes so many events and returns the numbers it ends with."""

    name: str
    run: Callable[[int], np.ndarray]
    events: int  # per timed batch; a tenth of a second is plenty


@final
@dataclass(frozen=True)
class Row:
    """Ours beside the peers. `tolerance`: largest difference of the results, None where the algorithms differ; then
    `quality` may tell how good ours are beside the peer's."""

    name: str
    ours: Side
    peers: Sequence[Side] = ()
    target: float | None = None  # us per event
    tolerance: float | None = 1e-9
    quality: Callable[[], str] | None = None


@final
@dataclass
class Timing:
    """Times of one row [us per event], one per repetition; ours first."""

    row: Row
    times: list[list[float]] = field(default_factory=list)
    quality: str = ""

    def median(self, side: int = 0) -> float:
        """The middle repetition."""
        return float(np.median(self.times[side]))

    def best(self, side: int = 0) -> float:
        """The least disturbed repetition."""
        return min(self.times[side])

    def ratio(self, side: int) -> float:
        """How many of our events fit in one of the peer's."""
        both = list(zip(self.times[side], self.times[0], strict=False))
        return float(np.median([theirs / ours for theirs, ours in both]))


def agree(row: Row, events: int = 60) -> float:
    """The largest difference between ours and any peer after so many events; raises when it is above the tolerance."""
    ours = row.ours.run(events)
    worst = max((float(np.abs(peer.run(events) - ours).max()) for peer in row.peers), default=0.0)
    if row.tolerance is not None and not worst <= row.tolerance:
        raise AssertionError(f"{row.name}: results differ by {worst:.3g}, allowed {row.tolerance:.3g}")
    return worst


def measure(row: Row, repetitions: int) -> Timing:
    """Time all sides of a row, interleaved, after a warm-up that compiles and compares."""
    agree(row)
    sides = [row.ours, *row.peers]
    timing = Timing(row, [[] for _ in sides], row.quality() if row.quality else "")
    for _ in range(repetitions):
        for side, times in zip(sides, timing.times, strict=True):
            enough = len(times) >= (FEWEST if side is row.ours else 1)
            if enough and sum(times) * side.events > BOUND_S * 1e6:
                continue
            start = process_time()
            side.run(side.events)
            times.append((process_time() - start) / side.events * 1e6)
    return timing


def cells(timing: Timing) -> list[str]:
    """One line of the table."""
    row = timing.row
    target = "" if row.target is None else f"{row.target:g}"
    peers = [
        f"{peer.name} {timing.median(k):.3g} / {timing.best(k):.3g}: **{timing.ratio(k):.0f} x**"
        for k, peer in enumerate(row.peers, start=1)
    ]
    same = "" if not row.peers else "other algorithm" if row.tolerance is None else f"within {row.tolerance:g}"
    same = timing.quality or same
    return [row.name, f"{timing.median():.3g} / {timing.best():.3g}", target, "; ".join(peers), same]


def figures(timing: Timing) -> dict:
    """One line of the table as numbers, for programs and for the gate."""
    peers = [
        {"name": peer.name, "median_us": timing.median(k), "ratio": timing.ratio(k)}
        for k, peer in enumerate(timing.row.peers, start=1)
    ]
    target = timing.row.target
    return {
        "name": timing.row.name,
        "median_us": timing.median(),
        "best_us": timing.best(),
        "target_us": target,
        "peers": peers,
    }


HEADER = ["what", "ours: median / best", "target", "peers: median / best: ratio", "results agree"]


def markdown(timings: Sequence[Timing], preamble: Sequence[str]) -> str:
    """The table as a page."""
    lines = ["# Benchmarks", "", *(f"- {line}" for line in preamble), "", "Microseconds of CPU time per event.", ""]
    lines += ["| " + " | ".join(HEADER) + " |", "|" + " --- |" * len(HEADER)]
    lines += ["| " + " | ".join(cells(t)) + " |" for t in timings]
    return "\n".join(lines) + "\n"
