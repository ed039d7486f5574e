"""What came of a campaign: per case and value the mean with its interval, paired differences, and what failed."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Final, cast, final

import numpy as np

from outrider.campaign.studies import OWN
from outrider.errors import UsageError
from outrider.eval.paired import Paired, Summary, corrected, paired, summary
from outrider.io.trials import ROWS, Record, Stored, read_trials
from outrider.typing import Floats, Ints

MOST: Final = 6  # values told where nobody chose any
TELLING: Final = (
    "*rmse*", "*error_m*", "clearance.distance_m", "separations.*.distance_m", "*.least_m", "*nees*", "*nis*",
    "*duration_s*",
)  # fmt: skip


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Results:
    """Of a campaign: its cases, what varies among them, and a row per trial that has ended, by case and seed.

    values : by name, (trials,), NaN where a trial has none;  case, seeds : (trials,) of each trial

    Trials are compared in groups: those of one case, or, where ranges were sampled, of one combination of the rest.
    """

    folder: Path
    trial: str
    cases: tuple[Mapping[str, object], ...]
    varied: tuple[str, ...]
    case: Ints
    seeds: Ints
    values: Mapping[str, Floats]
    errors: Mapping[int, str] = field(default_factory=dict[int, str])  # by place in these
    damaged: tuple[int, ...] = ()  # lines of rows.jsonl that hold no row

    @property
    def numbers(self) -> Ints:
        """(trials,) the number of each, see `numbers_of`."""
        return numbers_of(self.case, self.seeds)

    @property
    def sampled(self) -> bool:
        """Whether cases are places in ranges, each run once."""
        return "sample" in self.cases[0]

    @property
    def listed(self) -> tuple[str, ...]:
        """What varies and is not sampled from a range."""
        first = [c for c in self.cases if c.get("sample", 0) == 0]
        return tuple(k for k in self.varied if k != "sample" and len({repr(c.get(k)) for c in first}) > 1)

    @property
    def groups(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(dict.fromkeys(map(self._named, range(len(self.cases)))))

    @property
    def group(self) -> Ints:
        """(trials,) the group of each."""
        names = self.groups
        of_case = np.array([names.index(self._named(c)) for c in range(len(self.cases))])
        return of_case[self.case]

    def _named(self, case: int) -> str:
        return ", ".join(f"{key}={_short(self.cases[case].get(key))}" for key in self.listed) or "all"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """One value of one group; against the first group on the same seeds and samples."""

    value: str
    group: str
    summary: Summary
    against: Paired | None = None
    p: float = float("nan")  # of `against`, corrected for all that were made


def read_results(folder: Path) -> Results:
    """What a folder of a campaign holds, whether or not all trials have ended; UsageError if none has."""
    stored = read_trials(folder)
    cases = tuple(cast("list[dict[str, object]]", stored.configuration["cases"]))
    ordered = rows_of(stored, folder)
    names = list(dict.fromkeys(n for r in ordered for n, v in r["values"].items() if not isinstance(v, list)))
    keys = list(dict.fromkeys(k for c in cases for k in c))
    varied = tuple(k for k in keys if k not in OWN[2:] and len({repr(c.get(k)) for c in cases}) > 1)
    return Results(
        folder=folder,
        trial=str(stored.configuration["trial"]),
        cases=cases,
        varied=varied,
        case=np.array([r["case"] for r in ordered]),
        seeds=np.array([r["seed"] for r in ordered]),
        values={n: np.array([_number(r["values"].get(n)) for r in ordered]) for n in names},
        errors={k: str(r["error"]) for k, r in enumerate(ordered) if r["error"]},
        damaged=stored.damaged,
    )


def rows_of(stored: Stored, folder: Path) -> list[Record]:
    """The last row of every trial, case by case and seed by seed; UsageError if there is none."""
    ordered = [row for _, row in sorted({(r["case"], r["seed"]): r for r in stored.rows}.items())]
    if not ordered:
        told = damage(stored.damaged)
        raise UsageError(f"no trial has ended{'; ' + told if told else ''}", where=str(folder),
                         fix="run the campaign again with --resume")  # fmt: skip
    return ordered


def numbers_of(case: Ints, seeds: Ints) -> Ints:
    """(trials,) the number of each, counted case by case, seed by seed, whether or not those between have ended."""
    first = seeds.min()
    return case * (seeds.max() - first + 1) + seeds - first


def damage(lines: Sequence[int], fate: str = "left out: run again with --resume") -> str:
    """What to tell of lines that hold no row, and what becomes of their trials; "" of none."""
    if not lines:
        return ""
    which = f"{', '.join(map(str, lines[:5]))}{', ...' if len(lines) > 5 else ''}"
    if len(lines) == 1:
        return f"line {which} of {ROWS} is damaged, its trial is {fate}"
    return f"lines {which} of {ROWS} are damaged ({len(lines)}), their trials are {fate}"


def chosen(r: Results, wanted: Sequence[str]) -> list[str]:
    """The values to tell: those asked for, by name or part of it, else the telling ones that are not all the same."""
    if not r.values:
        return []
    if wanted:
        out = list[str]()
        for word in wanted:
            found = [word] if word in r.values else [n for n in r.values if word in n]
            if not found:
                fix = f"there are: {', '.join(list(r.values)[:20])}{', ...' if len(r.values) > 20 else ''}"
                raise UsageError(f"no value '{word}'", where="--value", fix=fix)
            out += [n for n in found if n not in out]
        return out
    differ = [n for n, x in r.values.items() if np.unique(x[np.isfinite(x)]).size > 1]
    telling = [n for n in differ if any(fnmatchcase(n, shape) for shape in TELLING)] or differ
    return [*(["ok"] if "ok" in r.values else []), *[n for n in telling if n != "ok"][:MOST]]


def lines(r: Results, names: Sequence[str]) -> list[Line]:
    """Every value of every group, compared with the first on the same seeds (t test, corrected by Holm)."""
    group = r.group
    made = [(n, g, r.values[n][group == g]) for n in names for g in range(len(r.groups))]
    first = {n: x for n, g, x in made if g == 0}
    both = {g: _both(r, group, g) for g in range(1, len(r.groups))}
    pairs = {
        k: paired(x[both[g][0]], first[n][both[g][1]])
        for k, (n, g, x) in enumerate(made)
        if g > 0 and both[g][0].size > 1
    }
    tested = [k for k, pair in pairs.items() if np.isfinite(pair.p_t)]
    held = dict(zip(tested, corrected([pairs[k].p_t for k in tested]).tolist(), strict=True)) if tested else {}
    return [
        Line(value=n, group=r.groups[g], summary=summary(x), against=pairs.get(k), p=held.get(k, float("nan")))
        for k, (n, g, x) in enumerate(made)
    ]


def _both(r: Results, group: Ints, g: int) -> tuple[Ints, Ints]:
    """(m,), (m,) rows of group g, and those of the first group, that have the same seeds and samples."""
    samples = np.array([int(str(c.get("sample", 0))) for c in r.cases])[r.case]
    keys = list(zip(r.seeds.tolist(), samples.tolist(), strict=True))
    ours, theirs = ([k for k, here in zip(keys, group == which, strict=True) if here] for which in (g, 0))
    place = {key: row for row, key in enumerate(theirs)}
    met = [(row, place[key]) for row, key in enumerate(ours) if key in place]
    rows = np.array(met, np.int64).reshape(-1, 2)
    return rows[:, 0], rows[:, 1]


def failures(r: Results) -> list[tuple[str, int, int]]:
    """What failed: the reason, how many times, and the number of the first such trial."""
    first: dict[str, int] = {}
    for place, error in r.errors.items():
        first.setdefault(error, int(r.numbers[place]))
    return [(error, n, first[error]) for error, n in Counter(r.errors.values()).most_common()]


def _number(value: Any) -> float:
    return float(value) if isinstance(value, int | float) else np.nan


def _short(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value).rsplit("/", 1)[-1]
