"""One trial of a campaign again, with its full report, and whether it came out the same."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

import numpy as np

from outrider.campaign.results import numbers_of, rows_of
from outrider.campaign.studies import LOG, SCENARIO, Params, nested, numbers, seed_of, settings_in
from outrider.errors import ExitCode, UsageError
from outrider.io.trials import read_trials


def replay(folder: Path, number: int, output: Path, *, force: bool = False, command: str = "") -> tuple[int, str]:
    """Run trial `number` (case by case, seed by seed, from 0) again with its full report; whether it came out the same.

    Returns the exit code of the run and a sentence on the comparison.
    """
    stored = read_trials(folder)
    ended = rows_of(stored, folder)
    places = numbers_of(np.array([r["case"] for r in ended]), np.array([r["seed"] for r in ended])).tolist()
    if number not in places:
        which = f"0 to {len(places) - 1}" if places[-1] == len(places) - 1 else f"{len(places)} of 0 to {places[-1]}"
        raise UsageError(f"trial {number} has not ended", where=str(folder), fix=f"{which} have")
    row = ended[places.index(number)]
    params, seed = cast("list[dict[str, object]]", stored.configuration["cases"])[row["case"]], int(row["seed"])
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

    scenario, where = load_scenario(str(params[SCENARIO]), {**settings_in(params), "seed": seed_of(params, seed)})
    done, summary = run_scenario(scenario, output, where=where, force=force, command=command)
    return int(done.exit_code), {"ok": float(done.exit_code is ExitCode.OK), **numbers(summary)}


def _refuse(params: Params, seed: int, output: Path, *, force: bool, command: str) -> tuple[int, Mapping[str, float]]:
    from outrider.workflows.fuse_file import Input, document, fuse_file
    from outrider.workflows.settings import parse_config
    from outrider.workflows.summary import exit_code

    config = parse_config(nested({**settings_in(params), "seed": seed_of(params, seed)}))
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
