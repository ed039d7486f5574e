"""Spans over which a drift is counted: a time, a way, or a number of records."""

from dataclasses import dataclass
from enum import Enum
from typing import Final, final

import numpy as np

from outrider.data import Trajectory
from outrider.errors import UsageError
from outrider.typing import Ints

LENGTHS_M: Final = (10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0, 5000.0, 10_000.0)
LONGEST: Final = 1e9  # s, m or records


class Unit(Enum):
    """What a span is counted in; the value is its sign."""

    SECONDS = "s"
    METRES = "m"
    RECORDS = "r"


@final
@dataclass(frozen=True, slots=True)
class Span:
    """So many seconds, metres of the reference's way, or records. chained : each begins where the last one ended, as
    `evo_rpe` counts by default; else one begins at every record."""

    value: float
    unit: Unit = Unit.SECONDS
    chained: bool = False

    def __post_init__(self) -> None:
        whole = self.unit is not Unit.RECORDS or float(self.value).is_integer()
        if not (0.0 < self.value <= LONGEST and whole):
            raise UsageError(
                f"no span of {self.value:g} {self.unit.value}",
                where="--span",
                fix=f"10s, 100m or 5r: more than 0, {LONGEST:g} at most",
            )

    @classmethod
    def parse(cls, text: str, *, chained: bool = False) -> "Span":
        """From 10s, 100m or 5r; a bare number is seconds."""
        text = text.strip()
        unit = next((u for u in Unit if text.endswith(u.value)), None)
        try:
            value = float(text[: -len(unit.value)] if unit else text)
        except ValueError:
            raise UsageError(
                f"no span '{text}'", where="--span", fix="seconds, metres or records: 10s, 100m, 5r"
            ) from None
        return cls(value, unit or Unit.SECONDS, chained)

    def __str__(self) -> str:
        name = "records" if self.unit is Unit.RECORDS else self.unit.value
        return f"{self.value:g} {name}"


USUAL_SPAN: Final = Span(10.0)


def span_ends(reference: Trajectory, span: Span) -> tuple[Ints, Ints]:
    """(k,) first and last rows of every span: the last is the first one that lies far enough on.

    Spans of time more than half as long again (across a gap) are left out.
    """
    n = len(reference)
    if span.unit is Unit.RECORDS:
        i = np.arange(0, n - int(span.value), int(span.value) if span.chained else 1)
        return i, i + int(span.value)
    if span.unit is Unit.SECONDS:
        mark, step = reference.t.astype(np.int64), round(span.value * 1e9)
    else:
        mark = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(reference.p, axis=0), axis=1))])
        step = span.value
    if span.chained:
        ends = [0]
        while (last := int(np.searchsorted(mark, mark[ends[-1]] + step))) < n:
            ends.append(last)
        i, j = np.array(ends[:-1], np.int64), np.array(ends[1:], np.int64)
    else:
        j = np.searchsorted(mark, mark + step)
        i = np.flatnonzero(j < n)
        j = j[i]
    if span.unit is Unit.SECONDS:
        near = mark[j] - mark[i] <= 1.5 * step
        i, j = i[near], j[near]
    return i, j


def fitting_lengths(path_m: float) -> tuple[float, ...]:
    """Lengths [m] that go into a way at least twice, at most five of them, the longest ones."""
    return tuple(length for length in LENGTHS_M if 2.0 * length <= path_m)[-5:]
