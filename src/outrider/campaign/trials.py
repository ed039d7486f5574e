"""Run one experiment over cases and seeds: every trial a row, kept as it ends.

A *trial* is an importable function `trial(params, seed) -> {name: number or (n,) array}` that takes all its randomness
from the seed. The same seeds serve every case, so that cases can be compared in pairs. Rows depend on nothing else:
any number of processes, any order and any interruption give the same bits.
"""

import hashlib
import inspect
import itertools
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, TypeAlias, cast, final

import numpy as np

import outrider
from outrider.campaign.pool import LOST, Record, Task, find, here, in_processes
from outrider.errors import UsageError
from outrider.io.folders import plain
from outrider.io.trials import MARKER, TrialStore, read_trials
from outrider.typing import Floats

Params: TypeAlias = Mapping[str, object]
Trial: TypeAlias = Callable[[Params, int], Mapping[str, Any]]
Progress: TypeAlias = Callable[[str, float], None]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One trial: its case (index), seed, and what it returned, or why it failed."""

    case: int
    seed: int
    values: Mapping[str, float | Floats] = field(default_factory=dict[str, float | Floats])
    error: str = ""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Trials:
    """All rows of a campaign, by case and then in the order of the seeds."""

    cases: tuple[Params, ...]
    seeds: tuple[int, ...]
    rows: tuple[Row, ...]

    @property
    def failed(self) -> tuple[Row, ...]:
        """The rows without values."""
        return tuple(r for r in self.rows if r.error)

    def column(self, name: str, **params: object) -> Floats:
        """(seeds,) or (seeds, n) one value of the one case that has these parameters; NaN where the trial failed.

        Rows stand in the order of the seeds for every case, ready for `outrider.eval.paired`.
        """
        chosen = [i for i, case in enumerate(self.cases) if all(case.get(k) == v for k, v in params.items())]
        if len(chosen) != 1:
            raise UsageError(f"{len(chosen)} cases have {dict(params)}", fix="name the parameters of exactly one")
        rows = self.rows[chosen[0] * len(self.seeds) : (chosen[0] + 1) * len(self.seeds)]
        found = [r.values[name] for r in rows if name in r.values]
        if not found and not all(r.error for r in rows):
            names = sorted({n for r in rows for n in r.values})
            raise UsageError(f"no value '{name}'", fix=f"there are: {', '.join(names)}")
        missing = np.full(np.shape(found[0]) if found else (), np.nan)
        return np.array([r.values.get(name, missing) for r in rows], np.float64)


def grid(**axes: Iterable[object]) -> list[dict[str, object]]:
    """Every combination of the values of named parameters, the last varying fastest."""
    return [dict(zip(axes, values, strict=True)) for values in itertools.product(*axes.values())]


def run_trials(
    trial: Trial,
    cases: Sequence[Params],
    seeds: int | Sequence[int],
    *,
    workers: int = 0,
    scheduler: str = "",
    store: Path | None = None,
    resume: bool = False,
    progress: Progress | None = None,
) -> Trials:
    """Run a trial for every case and seed.

    cases : parameters of each case, plain values (numbers, words, lists); see `grid`
    seeds : how many (0, 1, ...), or which
    workers : processes; 0 runs here, one after the other. With spawned processes a script needs its `__main__` guard
    scheduler : address of a Dask cluster that runs them instead, see `outrider.campaign.cluster`
    store : folder in which every row is kept as it ends, see `outrider.io.trials`
    resume : go on with the trials of `store` that are missing; further seeds may be asked for. Trials whose process
        died run again, those that raised do not
    progress : told the name of the trial and the share done

    A trial that raises is a row with its error; the others go on. Ctrl-C ends the processes, leaves what is stored and
    is raised again, saying how much that is. Raises `UsageError` for what cannot run, `ConfigError` for a store of
    another trial, other cases or other code, naming the difference.
    """
    wanted = _seeds(seeds)
    plain_cases = _cases(cases)
    name = _name(trial)
    if workers < 0:
        raise UsageError(f"{workers} processes cannot run anything", fix="0 runs in this process")
    order = [(case, seed) for case in range(len(plain_cases)) for seed in wanted]
    done: dict[tuple[int, int], Record] = {}
    with ExitStack() as stack:
        kept = None
        if store is not None:
            configuration = {"trial": name, "cases": plain_cases, "code": _code(trial)}
            kept = stack.enter_context(TrialStore(store, configuration, resume=resume))
            stored = {(r["case"], r["seed"]): r for r in reversed(kept.rows) if r["error"] not in LOST}
            done = {key: stored[key] for key in order if key in stored}
        tasks: list[Task] = [(c, s, plain_cases[c]) for c, s in order if (c, s) not in done]
        try:
            with closing(_rows(trial, name, tasks, workers, scheduler)) as rows:
                for row in rows:
                    if kept is not None:
                        kept.append(row)
                    done[row["case"], row["seed"]] = row
                    if progress is not None:
                        progress(name.partition(":")[2], len(done) / len(order))
        except KeyboardInterrupt:
            where = f"{len(done)} of {len(order)} trials are kept in {store}" if kept is not None else ""
            raise KeyboardInterrupt(where) from None
        records = [done[key] for key in order]
        if kept is not None:
            kept.write_table(records, plain_cases)
    return Trials(cases=tuple(plain_cases), seeds=wanted, rows=tuple(_row(r) for r in records))


def _rows(
    trial: Trial, name: str, tasks: Sequence[Task], workers: int, scheduler: str
) -> Generator[Record, None, None]:
    if scheduler and tasks:
        from outrider.campaign.cluster import in_cluster

        return in_cluster(name, tasks, scheduler, _code(trial))
    if not workers or not tasks:
        return here(trial, tasks)
    from outrider._kernel import is_warm  # imports the compiler

    return in_processes(name, tasks, min(workers, len(tasks)), first_alone=not is_warm())


def _row(r: Record) -> Row:
    values = {k: np.array(v, np.float64) if isinstance(v, list) else float(v) for k, v in r["values"].items()}
    return Row(case=r["case"], seed=r["seed"], values=values, error=r["error"])


def _seeds(seeds: int | Sequence[int]) -> tuple[int, ...]:
    wanted = tuple(range(seeds)) if isinstance(seeds, int) else tuple(int(s) for s in seeds)
    if not wanted or min(wanted) < 0 or len(set(wanted)) < len(wanted):
        raise UsageError(f"no trials can have the seeds {seeds}", fix="give one or more different numbers from 0")
    return wanted


def _cases(cases: Sequence[Params]) -> list[dict[str, object]]:
    out: list[dict[str, object]] = []
    for case in cases:
        whole = plain(case)
        if not _is_plain(whole):
            raise UsageError(
                f"{dict(case)} cannot be stored", fix="parameters are numbers, words, lists or dicts of them"
            )
        if whole in out:
            raise UsageError(f"the case {whole} is there twice")
        out.append(whole)
    if not out:
        raise UsageError("there is no case to run", fix="a grid needs a value on every axis")
    return out


def _is_plain(value: object) -> bool:
    if isinstance(value, dict):
        return all(map(_is_plain, cast("dict[str, object]", value).values()))
    if isinstance(value, list):
        return all(map(_is_plain, cast("list[object]", value)))
    return value is None or isinstance(value, (bool, int, float, str))


def _name(trial: Trial) -> str:
    """ "module:function", by which a worker finds the trial."""
    name = f"{getattr(trial, '__module__', '')}:{getattr(trial, '__qualname__', '')}"
    try:
        if find(name) is trial:
            return name
    except (ImportError, AttributeError, ValueError):
        pass
    raise UsageError(f"{trial!r} cannot be imported by its name", fix="a trial is a plain function of a module")


def code_of(name: str) -> dict[str, str]:
    """What a trial, "module:function", is computed with in this process."""
    return _code(find(name))


def _code(trial: Trial) -> dict[str, str]:
    """What the rows were computed with: results of different programs never mix."""
    source = inspect.getsourcefile(trial)
    own = hashlib.blake2s(Path(source).read_bytes() if source else b"", digest_size=8).hexdigest()
    return {"outrider": _program(), "trial": own}


def require_same_program(folder: Path) -> None:
    """Raises `ConfigError` if another program computed rows of one of the stores in a folder."""
    for store in sorted(marker.parent for marker in folder.glob(f"*/{MARKER}")):
        told = read_trials(store).configuration
        TrialStore(store, {**told, "code": {**told.get("code", {}), "outrider": _program()}}, resume=True)


@cache
def _program() -> str:
    digest = hashlib.blake2s(digest_size=8)
    root = Path(outrider.__file__).parent
    for path in sorted(root.rglob("*.py")):
        digest.update(str(path.relative_to(root)).encode() + b"\0" + path.read_bytes())
    return f"{outrider.__version__} {digest.hexdigest()}"
