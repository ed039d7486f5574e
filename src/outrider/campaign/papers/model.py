"""What a paper is made of here: tables of printed values beside ours, comparisons in pairs, and pictures.

A paper's module registers one function per table and picture:

    PAPER = Paper(name="amr2025", title=..., citation=...)

    @PAPER.table
    def goal_errors(work: Work) -> Table: ...

A value that nobody has simulated yet is a row without `ours`, and says so.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from enum import Enum
from math import isfinite, nan
from pathlib import Path
from typing import Any, Final, SupportsFloat, TypeAlias, final

from outrider.campaign.trials import Params, Progress, Trial, Trials, run_trials
from outrider.errors import UsageError
from outrider.eval import Paired, Summary

FEWEST: Final = 3  # seeds below which a mean has no interval that says anything
LISTED: Final = 4  # names before "and so many others"


class Verdict(Enum):
    """Ours against the printed value; each is a sentence about it."""

    AGREES = "agrees with what is printed"
    DIFFERS = "differs from what is printed"
    FEW = "too few seeds for a verdict"
    OPEN = "not simulated yet"
    NEVER = "never came about in ours"
    UNPRINTED = "the paper prints no such value"


def exact(value: SupportsFloat) -> Summary:
    """A number that follows from others, without seeds or spread."""
    return Summary(n=0, mean=float(value), sd=nan, low=nan, high=nan)


def shortened(names: Sequence[str]) -> str:
    """The first few of some names, each once, and how many more there are."""
    once = list(dict.fromkeys(names))
    more = len(names) - len(once[:LISTED])
    return "; ".join(once[:LISTED]) + (f" and {more} more" if more else "")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One quantity: as printed, and ours.

    printed : digit by digit as in the paper, since its digits say how exact it means to be; empty if it has none
    relation : "=", or "<" and ">" for a value that is printed as a bound
    ours : `outrider.eval.summary` over seeds, or `exact`; None if nobody has simulated it yet
    accept : within which ours counts as agreeing; else half a unit of the last printed digit
    """

    name: str
    unit: str = ""
    group: str = ""
    printed: str = ""
    printed_sd: str = ""
    relation: str = "="
    ours: Summary | None = None
    accept: tuple[float, float] | None = None
    note: str = ""

    @property
    def band(self) -> tuple[float, float]:
        """What agrees with the printed value."""
        if self.accept is not None:
            return self.accept
        value = float(self.printed)
        if self.relation != "=":
            return (-float("inf"), value) if self.relation == "<" else (value, float("inf"))
        half = 0.5 * 10.0 ** -len(self.printed.partition(".")[2]) * (1 + 1e-9)
        return value - half, value + half

    @property
    def verdict(self) -> Verdict:
        """Whether the mean of ours lies in the band; nothing is said of fewer than `FEWEST` seeds."""
        if not self.printed:
            return Verdict.UNPRINTED if self.ours is not None else Verdict.OPEN
        if self.ours is None:
            return Verdict.OPEN
        if not isfinite(self.ours.mean):
            return Verdict.NEVER
        if 0 < self.ours.n < FEWEST:  # 0: it follows from other numbers
            return Verdict.FEW
        low, high = self.band
        return Verdict.AGREES if low <= self.ours.mean <= high else Verdict.DIFFERS

    @property
    def deviation(self) -> float:
        """Ours minus printed; NaN without one of them, and for a bound that is kept."""
        if self.ours is None or not self.printed or (self.relation != "=" and self.verdict is Verdict.AGREES):
            return nan
        value = float(self.printed)
        deviation = self.ours.mean - value
        return 0.0 if abs(deviation) <= 1e-12 * abs(value) else deviation


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """Two variants on the same seeds: `better` minus `worse`, as the paper or common sense orders them."""

    name: str
    result: Paired
    unit: str = ""
    note: str = ""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Rows under one title. key : stable name, for scripts and links;  note : what to know to read it."""

    key: str
    title: str
    rows: tuple[Row, ...] = ()
    pairs: tuple[Pair, ...] = ()
    note: str = ""

    @property
    def sentence(self) -> str:
        """What came of it."""
        count = {v: sum(r.verdict is v for r in self.rows) for v in Verdict}
        judged = count[Verdict.AGREES] + count[Verdict.DIFFERS]
        parts = [f"{count[Verdict.AGREES]} of {judged} values agree with what is printed"] if judged else []
        differ = shortened([r.name for r in self.rows if r.verdict is Verdict.DIFFERS])
        parts += [f"what differs: {differ}"] if differ else []
        few = count[Verdict.FEW]
        parts += [f"{few} without a verdict: it takes {FEWEST} seeds or more"] if few else []
        parts += [f"{count[v]} {v.value}" for v in (Verdict.NEVER, Verdict.OPEN) if count[v]]
        return "; ".join(parts)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A figure: `draw` makes it (by a function of `outrider.plot`) when a page wants it."""

    key: str
    title: str
    draw: Callable[[], Any]
    caption: str = ""


@final
@dataclass(kw_only=True)
class Work:
    """What tables may ask for: how many seeds, where to compute, and trials that several tables share.

    seeds : how many, None for each experiment's own number, 0 to simulate nothing
    trials : folder that keeps rows between calls
    """

    seeds: int | None = None
    workers: int = 0
    trials: Path | None = None
    progress: Progress | None = None
    _done: dict[str, Trials] = field(default_factory=dict[str, Trials])

    @property
    def simulates(self) -> bool:
        """Whether trials are to be run at all."""
        return self.seeds != 0

    def run(self, name: str, trial: Trial, cases: Sequence[Params], *, seeds: int) -> Trials:
        """The trials called `name`, run once for all tables; `seeds` unless the user wants another number."""
        if name not in self._done:
            self._done[name] = run_trials(
                trial,
                cases,
                self.seeds or seeds,
                workers=self.workers,
                store=self.trials / name if self.trials is not None else None,
                resume=True,
                progress=self.progress,
            )
        return self._done[name]


MakeTable: TypeAlias = Callable[[Work], Table]
MakePicture: TypeAlias = Callable[[Work], Picture | None]
"""None: there is nothing to draw without trials."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Paper:
    """A paper and the functions that make its tables and pictures, in the order of their registration."""

    name: str
    title: str
    citation: str
    doi: str = ""
    about: str = ""
    tables: list[MakeTable] = field(default_factory=list[MakeTable])
    pictures: list[MakePicture] = field(default_factory=list[MakePicture])

    def table(self, make: MakeTable) -> MakeTable:
        """Register a table."""
        self.tables.append(make)
        return make

    def picture(self, make: MakePicture) -> MakePicture:
        """Register a picture."""
        self.pictures.append(make)
        return make


def check_keys(tables: Sequence[Table], pictures: Sequence[Picture], where: str) -> None:
    """Keys name anchors of the page: each only once."""
    keys = [t.key for t in tables] + [p.key for p in pictures]
    twice = sorted({k for k in keys if keys.count(k) > 1})
    if twice:
        raise UsageError(f"two tables or pictures are called {', '.join(twice)}", where=where)


def counts(tables: Sequence[Table]) -> Mapping[str, int]:
    """How many values have each verdict."""
    rows = [r for t in tables for r in t.rows]
    return {v.name.lower(): sum(r.verdict is v for r in rows) for v in Verdict}


def plain_row(row: Row) -> dict[str, Any]:
    """A row as plain values, for JSON and for pictures."""
    printed = float(row.printed) if row.printed else nan
    share = row.deviation / printed if printed else nan
    return {
        "name": row.name,
        "group": row.group,
        "unit": row.unit,
        "relation": row.relation,
        "printed": row.printed or None,
        "printed_sd": row.printed_sd or None,
        "ours": asdict(row.ours) if row.ours is not None else None,
        "deviation": row.deviation,
        "deviation_percent": 100.0 * share,
        "verdict": row.verdict.name.lower(),
        "sentence": row.verdict.value,
        "note": row.note,
    }
