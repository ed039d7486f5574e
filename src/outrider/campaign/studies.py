"""Campaigns of a scenario or of a log: what a trial is, how it is checked before anything runs."""

import time
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any, Final, cast, final

from outrider.campaign.trials import Progress, Trials, run_trials
from outrider.campaign.vary import Axis, Sampling, cases_of, seed_of
from outrider.errors import ConfigError, ExitCode, OutriderError, UsageError
from outrider.io.checked import remedy
from outrider.io.config import merged
from outrider.io.files import sha256

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

    scenario, where = load_scenario(str(params[SCENARIO]), {**settings_in(params), "seed": seed_of(params, seed)})
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

    config = parse_config(nested({**settings_in(params), "seed": seed_of(params, seed)}))
    source = Input(log=Path(str(params[LOG])))
    run = fuse(source.read(config.robot), config)
    return {"ok": float(exit_code(run) == ExitCode.OK), **numbers(document(run, source))}


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


def settings_in(params: Params) -> dict[str, object]:
    """The parameters that are settings, not the campaign's own."""
    return {key: value for key, value in params.items() if key not in OWN}


def nested(flat: Params) -> dict[str, Any]:
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
    if not study.logs and DIGEST not in first:
        _known(str(first[SCENARIO]), axes)
    varied = {a.key for a in axes}
    _load({k: v for k, v in first.items() if k not in varied})
    for axis in axes:
        for value in axis.values or (axis.low, axis.high):
            with _told_of(axis.key, value):
                _load({**first, axis.key: value})
    _load(first)


def _known(name: str, axes: Sequence[Axis]) -> None:
    """Raise for a key that a scenario of that name has not: neither a setting of its own nor a part of a file."""
    from outrider.scenarios.parts import Scenario
    from outrider.scenarios.registry import find_scenario

    known = list(dict.fromkeys([*find_scenario(name).knobs, *Scenario.model_fields]))
    for axis in axes:
        if (word := axis.key.split(".")[0]) not in known:
            raise ConfigError("unknown key", where=f"--vary {axis.key}", fix=remedy(word, known))


def _load(params: Params) -> None:
    """Raise for settings that cannot be."""
    if LOG in params:
        from outrider.workflows.settings import parse_config

        parse_config(nested({**settings_in(params), "seed": 0}))
    else:
        from outrider.scenarios.files import load_scenario

        load_scenario(str(params[SCENARIO]), {**settings_in(params), "seed": 0})


@contextmanager
def _told_of(key: str, value: object) -> Generator[None, None, None]:
    """Whatever the block finds wrong is told of what varies."""
    try:
        yield
    except ConfigError as e:
        raise ConfigError(e.what, where=f"--vary {key}={value}", fix=e.fix) from None
