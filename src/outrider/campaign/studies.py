"""Campaigns of a scenario or of a log: what a trial is, how it is checked before anything runs, how one is replayed."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any, Final, cast, final

from outrider.campaign.trials import Progress, Trials, run_trials
from outrider.campaign.vary import Axis, Sampling, cases_of, seed_of
from outrider.errors import ExitCode, OutriderError, UsageError
from outrider.io.config import merged
from outrider.io.files import sha256
from outrider.io.trials import read_trials

SCENARIO, LOG, DIGEST = "scenario", "log", "digest"
OWN: Final = (SCENARIO, LOG, DIGEST, "sample")
YAML: Final = (".yaml", ".yml")
# What is no result: names, versions, times of this machine, and how many records each sensor made.
LEFT_OUT: Final = frozenset(
    {"schema", "versions", "wall_s", "compile_s", "times_real_time", "start_ns", "datum", "seed", "sensors", "log"}
    | {"notes", "zones", "config"}
)

Params = Mapping[str, object]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """What is to be run. cases : parameters;  seeds : of each case."""

    cases: tuple[Params, ...]
    seeds: tuple[int, ...]

    @property
    def logs(self) -> bool:
        """Whether logs are fused, not scenarios simulated."""
        return LOG in self.cases[0]


def study_of(target: str, axes: Sequence[Axis], runs: int, sampling: Sampling, seed: int, settings: Params) -> Study:
    """A study of a scenario (a name, a file), or of `fuse` over the logs of a folder. settings : for all trials.

    The first case, and every value of every list, are checked as far as that goes without a run. Raises what checking
    raises: ConfigError above all.
    """
    cases, seeds = cases_of(axes, runs, sampling, seed)
    path = Path(target)
    if path.is_dir():
        logs = _logs(path)
        whole: list[dict[str, object]] = [
            {LOG: str(log), DIGEST: _digest(log), **settings, **case} for log in logs for case in cases
        ]
    else:
        about: dict[str, object] = {SCENARIO: target}
        if path.suffix.lower() in YAML and path.exists():
            about = {SCENARIO: str(path.resolve()), DIGEST: sha256(path)}
        whole = [{**about, **settings, **case} for case in cases]
    out = Study(cases=tuple(whole), seeds=seeds)
    _check(out, axes)
    return out


def run_study(
    study: Study,
    folder: Path,
    *,
    workers: int,
    scheduler: str = "",
    resume: bool = False,
    progress: Progress | None = None,
) -> Trials:
    """Run it into a folder. scheduler : address of a Dask cluster that is to do it instead of processes here."""
    trial = fused if study.logs else simulated
    return run_trials(
        trial, study.cases, study.seeds, workers=workers, scheduler=scheduler, store=folder, resume=resume,
        progress=progress,
    )  # fmt: skip


def simulated(params: Params, seed: int) -> Mapping[str, float]:
    """A trial: a scenario is run, and the numbers of its summary are the row; `ok` is 1 if it ended as planned."""
    from outrider.scenarios.build import build
    from outrider.scenarios.files import load_scenario
    from outrider.scenarios.runs import Done, summarise

    scenario, where = load_scenario(str(params[SCENARIO]), {**_settings(params), "seed": seed_of(params, seed)})
    cast_ = build(scenario, where)
    began = time.perf_counter()
    run = cast_.run()
    done = Done(scenario=scenario, cast=cast_, run=run, wall_s=max(time.perf_counter() - began, 1e-9), compile_s=0.0)
    return {"ok": float(done.exit_code is ExitCode.OK), **numbers(summarise(done))}


def fused(params: Params, seed: int) -> Mapping[str, float]:
    """A trial: a log is fused, and the numbers of its summary are the row; `ok` is 1 if nothing was found amiss."""
    from outrider.workflows.fuse import fuse
    from outrider.workflows.fuse_file import Input, document
    from outrider.workflows.settings import parse_config
    from outrider.workflows.summary import exit_code

    config = parse_config(_nested({**_settings(params), "seed": seed_of(params, seed)}))
    source = Input(log=Path(str(params[LOG])))
    run = fuse(source.read(config.robot), config)
    return {"ok": float(exit_code(run) == ExitCode.OK), **numbers(document(run, source))}


def replay(folder: Path, number: int, output: Path, *, force: bool = False, command: str = "") -> tuple[int, str]:
    """Run trial `number` (case by case, seed by seed, from 0) again with its full report; whether it came out the same.

    Returns the exit code of the run and a sentence on the comparison.
    """
    configuration, rows = read_trials(folder)
    cases = cast("list[dict[str, object]]", configuration["cases"])
    ordered = sorted({(r["case"], r["seed"]): r for r in rows}.items())
    if not 0 <= number < len(ordered):
        raise UsageError(f"there is no trial {number}", where=str(folder), fix=f"0 to {len(ordered) - 1} have ended")
    (case, seed), row = ordered[number]
    params = cases[case]
    if LOG in params:
        code, now = _refuse(params, seed, output, force=force, command=command)
    elif SCENARIO in params:
        code, now = _rerun(params, seed, output, force=force, command=command)
    else:
        raise UsageError("was no campaign of a scenario or a log", where=str(folder), fix="call its own function")
    return code, _compared(row, now)


def _rerun(params: Params, seed: int, output: Path, *, force: bool, command: str) -> tuple[int, Mapping[str, float]]:
    from outrider.scenarios.files import load_scenario
    from outrider.scenarios.runs import run_scenario

    scenario, where = load_scenario(str(params[SCENARIO]), {**_settings(params), "seed": seed_of(params, seed)})
    done, summary = run_scenario(scenario, output, where=where, force=force, command=command)
    return int(done.exit_code), {"ok": float(done.exit_code is ExitCode.OK), **numbers(summary)}


def _refuse(params: Params, seed: int, output: Path, *, force: bool, command: str) -> tuple[int, Mapping[str, float]]:
    from outrider.workflows.fuse_file import Input, document, fuse_file
    from outrider.workflows.settings import parse_config
    from outrider.workflows.summary import exit_code

    config = parse_config(_nested({**_settings(params), "seed": seed_of(params, seed)}))
    source = Input(log=Path(str(params[LOG])))
    run = fuse_file(source, output, config, force=force, command=command)
    code = exit_code(run)
    return int(code), {"ok": float(code == ExitCode.OK), **numbers(document(run, source))}


def _compared(row: Mapping[str, Any], now: Mapping[str, float]) -> str:
    if row["error"]:
        return f"in the campaign it failed: {row['error']}"
    stored = row["values"]
    different = [
        name for name in stored if name in now and stored[name] != now[name] and not _both_nan(stored, now, name)
    ]
    if not different:
        return f"the same as in the campaign, all {len(stored)} numbers to the last bit"
    name = different[0]
    what = f"{len(different)} of {len(stored)} numbers differ from the campaign's: {name} was {stored[name]}"
    return f"{what}, is {now[name]}; another version or another machine?"


def _both_nan(a: Mapping[str, Any], b: Mapping[str, float], name: str) -> bool:
    return a[name] is None or (a[name] != a[name] and b[name] != b[name])


def numbers(summary: Mapping[str, Any], prefix: str = "") -> dict[str, float]:
    """The numbers of a summary by dotted name, in its order; what says nothing of the outcome is left out."""
    out: dict[str, float] = {}
    for key, value in summary.items():
        if key not in LEFT_OUT:
            out |= _numbers(value, f"{prefix}{key}")
    return out


def _numbers(value: Any, name: str) -> dict[str, float]:
    if isinstance(value, bool | int | float):
        return {name: float(value)} if isfinite(float(value)) else {}
    if isinstance(value, Mapping):
        return numbers(cast("Mapping[str, Any]", value), f"{name}.")
    if isinstance(value, list | tuple):
        out: dict[str, float] = {}
        for k, item in enumerate(cast("Sequence[Any]", value)):
            if isinstance(item, Mapping):
                out |= numbers(
                    cast("Mapping[str, Any]", item), f"{name}.{_called(cast('Mapping[str, Any]', item), k)}."
                )
        return out
    return {}


def _called(item: Mapping[str, Any], k: int) -> str:
    """The name of an item of a list: its own, that of a pair of robots, or its number."""
    robots = item.get("robots")
    if isinstance(robots, list):
        return "-".join(map(str, cast("list[object]", robots)))
    return str(item.get("name", item.get("reason", k)))


def _settings(params: Params) -> dict[str, object]:
    return {key: value for key, value in params.items() if key not in OWN}


def _nested(flat: Params) -> dict[str, Any]:
    """Values by dotted key as the sections of a configuration."""
    out: dict[str, Any] = {}
    for key, value in flat.items():
        inner: Any = value
        for word in reversed(key.split(".")):
            inner = {word: inner}
        out = merged(out, inner)
    return out


def _logs(folder: Path) -> list[Path]:
    """The recordings of a folder, by name."""
    from outrider.io.registry import check_input

    found: list[Path] = []
    for path in sorted(folder.iterdir()):
        try:
            check_input(path)
        except OutriderError:
            continue
        found.append(path)
    if not found:
        raise UsageError("holds no recording", where=str(folder), fix="name a scenario, or a folder of logs")
    return found


def _digest(path: Path) -> str:
    return sha256(path) if path.is_file() else ",".join(sha256(p) for p in sorted(path.iterdir()) if p.is_file())


def _check(study: Study, axes: Sequence[Axis]) -> None:
    """Raise for a key or a value that cannot be: the first case, and each value of each list once."""
    first = study.cases[0]
    tried: list[Params] = [first, *({**first, a.key: v} for a in axes for v in a.values)]
    tried += [{**first, a.key: end} for a in axes if not a.values for end in (a.low, a.high)]
    for params in tried:
        if study.logs:
            from outrider.workflows.settings import parse_config

            parse_config(_nested({**_settings(params), "seed": 0}))
        else:
            from outrider.scenarios.files import load_scenario

            load_scenario(str(params[SCENARIO]), {**_settings(params), "seed": 0})
