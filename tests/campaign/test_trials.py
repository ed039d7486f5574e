"""Campaigns: the same bits on any number of processes, in any order, and after any interruption."""

import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trial_functions
from pyarrow import parquet
from trial_functions import clock, deadly, drift, environment, fragile

from outrider.campaign import Trials, grid, run_trials
from outrider.campaign.pool import DIED
from outrider.campaign.replay import replay
from outrider.campaign.report import document
from outrider.campaign.results import lines as results_lines
from outrider.campaign.results import read_results
from outrider.errors import ConfigError, DataError, OutputExistsError, OutriderError, UsageError
from outrider.eval import paired
from outrider.io.trials import MARKER, ROWS, TABLE, TrialStore, read_trials

CASES = grid(sigma=[0.5, 2.0], model=["a", "b"])


def bits(trials: Trials) -> list[object]:
    return [(r.case, r.seed, r.error, {k: np.asarray(v).tobytes() for k, v in r.values.items()}) for r in trials.rows]


def test_grid_is_every_combination() -> None:
    assert CASES == [
        {"sigma": 0.5, "model": "a"},
        {"sigma": 0.5, "model": "b"},
        {"sigma": 2.0, "model": "a"},
        {"sigma": 2.0, "model": "b"},
    ]
    assert grid() == [{}] and grid(a=[]) == []


def test_columns_stand_in_the_order_of_the_seeds() -> None:
    trials = run_trials(drift, CASES, [3, 1, 2])
    wide, slim = trials.column("rms", sigma=2.0, model="a"), trials.column("rms", sigma=0.5, model="a")
    np.testing.assert_allclose(wide, 4 * slim, rtol=1e-12)  # the same noise for every case
    assert paired(slim, wide).wins == 1.0
    assert trials.column("walk", sigma=2.0, model="b").shape == (3, 5)
    np.testing.assert_array_equal(run_trials(drift, CASES, [1, 2, 3]).column("end", sigma=2.0, model="a")[[2, 0, 1]],
                                  trials.column("end", sigma=2.0, model="a"))  # fmt: skip
    with pytest.raises(UsageError, match="2 cases have"):
        trials.column("rms", sigma=2.0)
    with pytest.raises(UsageError, match="no value 'rmse'"):
        trials.column("rmse", sigma=2.0, model="a")


def test_processes_give_the_bits_and_the_bytes_of_one(tmp_path: Path) -> None:
    alone = run_trials(drift, CASES, 3, store=tmp_path / "0")
    for workers in (1, 3):
        many = run_trials(drift, CASES, 3, workers=workers, store=tmp_path / str(workers))
        assert bits(many) == bits(alone)
        assert (tmp_path / str(workers) / TABLE).read_bytes() == (tmp_path / "0" / TABLE).read_bytes()


def test_the_table_holds_everything(tmp_path: Path) -> None:
    trials = run_trials(drift, CASES, 2, store=tmp_path)
    table = parquet.read_table(tmp_path / TABLE)
    assert table.column_names == [
        "trial.case", "trial.seed", "trial.error", "param.sigma", "param.model", "end", "rms", "steps", "walk",
    ]  # fmt: skip
    assert table["param.model"].to_pylist() == ["a", "a", "b", "b"] * 2
    np.testing.assert_array_equal(table["end"].to_numpy(), [r.values["end"] for r in trials.rows])
    np.testing.assert_array_equal(table["walk"].to_pylist()[5], trials.rows[5].values["walk"])
    stored = read_trials(tmp_path)
    assert stored.configuration["cases"] == CASES and len(stored.rows) == 8
    assert all(r["wall_s"] >= 0 for r in stored.rows)


@pytest.mark.parametrize("workers", [0, 2])
def test_a_trial_that_raises_is_a_row(workers: int, tmp_path: Path) -> None:
    trials = run_trials(fragile, [{"bad": [1, 3], "how": "raise"}], 5, workers=workers, store=tmp_path)
    assert [r.seed for r in trials.failed] == [1, 3]
    assert trials.failed[0].error.startswith("IndexError: list index out of range (trial_functions.py:")
    np.testing.assert_array_equal(trials.column("value"), [0, math.nan, 2, math.nan, 4])
    np.testing.assert_array_equal(trials.column("odd"), [math.inf, math.nan, math.inf, math.nan, math.inf])
    again = run_trials(fragile, [{"bad": [1, 3], "how": "raise"}], 5, store=tmp_path, resume=True)
    assert bits(again) == bits(trials)  # infinities and NaN, too, survive the file
    assert parquet.read_table(tmp_path / TABLE)["trial.error"].to_pylist() == [r.error for r in trials.rows]


@pytest.mark.parametrize(
    ("returned", "words"),
    [(3.0, "not float"), ({"x": "far"}, "'x' is neither"), ({"x": [[1.0]]}, "'x' is neither"), (None, "not NoneType"),
     ({"x": None}, "'x' is neither")],
)  # fmt: skip
def test_what_is_no_row_of_numbers_is_an_error_row(returned: object, words: str) -> None:
    (row,) = run_trials(fragile, [{"bad": [0], "how": "return", "returns": returned}], 1).rows
    assert words in row.error and not row.values


def test_all_failed_is_a_column_of_nan() -> None:
    trials = run_trials(fragile, [{"bad": [0, 1], "how": "raise"}], 2)
    assert np.isnan(trials.column("value")).all() and trials.column("value").shape == (2,)


def test_a_process_that_dies_takes_nothing_with_it(tmp_path: Path) -> None:
    """One trial that always kills its process is a row; one that does so once completes; no other is touched."""
    case = {"always": [4], "once": [1, 7], "marks": str(tmp_path)}
    trials = run_trials(deadly, [case], 10, workers=2, store=tmp_path / "rows")
    assert [(r.seed, r.error) for r in trials.failed] == [(4, DIED)]
    np.testing.assert_array_equal(np.delete(trials.column("value"), 4), np.delete(np.arange(10) * 0.1, 4))
    assert len(read_trials(tmp_path / "rows").rows) == 10


def test_a_death_is_tried_again_on_resuming(tmp_path: Path) -> None:
    case = {"once": [0], "marks": str(tmp_path)}
    with TrialStore(tmp_path / "rows", _configuration(case, tmp_path)) as kept:
        kept.append({"case": 0, "seed": 0, "values": {}, "error": DIED, "wall_s": 0.0})
    (tmp_path / "0").touch()
    trials = run_trials(deadly, [case], 1, store=tmp_path / "rows", resume=True)
    assert not trials.failed and trials.column("value").tolist() == [0.0]


def _configuration(case: dict[str, object], tmp_path: Path) -> dict[str, Any]:
    """What a campaign of `deadly` writes into its folder."""
    run_trials(deadly, [case | {"once": []}], 1, store=tmp_path / "other")
    return {**read_trials(tmp_path / "other").configuration, "cases": [case]}


def test_workers_compute_with_one_thread_and_leave_the_environment_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "5")
    trials = run_trials(environment, [{}], 4, workers=2)
    assert set(trials.column("threads")) == {1.0} and os.getpid() not in set(trials.column("pid"))
    assert os.environ["OMP_NUM_THREADS"] == "5"


@pytest.mark.parametrize("warm", [True, False])
def test_kernels_are_compiled_once(warm: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """While the cache is empty the first trial has the machine for itself; after it two run at a time."""
    monkeypatch.setattr("outrider._kernel.is_warm", lambda: warm)
    trials = run_trials(clock, [{"marks": str(tmp_path)}], 3, workers=2)
    begun, ended = trials.column("begun"), trials.column("ended")
    assert warm or begun[1:].min() >= ended[0]
    assert begun[1:].max() < ended[1:].min(), "two at a time"


def script(body: str) -> list[str]:
    here = Path(trial_functions.__file__).parent
    return [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(here)!r})\nfrom pathlib import Path\n{body}"]


def wait_for(condition: Callable[[], bool]) -> None:
    until = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.02)


def rows_in(folder: Path) -> int:
    return (folder / ROWS).read_bytes().count(b"\n") if (folder / ROWS).exists() else 0


RUN = """
from outrider.campaign import run_trials
from trial_functions import drift
run_trials(drift, [{{"sigma": 1.0, "sleep_s": 0.1}}], 12, workers={workers}, store=Path({folder!r}))
"""


def children_of(pid: int) -> set[int]:
    listed = subprocess.run(["ps", "-o", "pid=", "--ppid", str(pid)], capture_output=True, text=True, check=False)
    return {int(p) for p in listed.stdout.split()}


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.parametrize("workers", [0, 2])
def test_nothing_is_lost_by_kill_9(workers: int, tmp_path: Path) -> None:
    folder, whole = tmp_path / "killed", tmp_path / "whole"
    process = subprocess.Popen(script(RUN.format(workers=workers, folder=str(folder))))
    wait_for(lambda: rows_in(folder) >= 1)
    children = children_of(process.pid)
    wait_for(lambda: rows_in(folder) >= 3)
    process.kill()
    process.wait()
    done = rows_in(folder)
    assert 3 <= done < 12 and not (folder / TABLE).exists()
    with (folder / ROWS).open("a") as f:
        f.write('{"case": 0, "se')  # and killed in the middle of a line
    trial_functions.CALLS.clear()
    case = {"sigma": 1.0, "sleep_s": 0.1}
    trials = run_trials(drift, [case], 12, store=folder, resume=True)
    assert len(trial_functions.CALLS) == 12 - done, "only what was missing"
    assert bits(trials) == bits(run_trials(drift, [case], 12, store=whole, workers=2))
    assert (folder / TABLE).read_bytes() == (whole / TABLE).read_bytes()
    wait_for(lambda: not any(map(alive, children)))  # no process outlives its parent


STOPPED = """
from multiprocessing import active_children
from outrider.campaign import run_trials
from trial_functions import drift
try:
    run_trials(drift, [{{"sigma": 1.0}}, {{"sigma": 2.0, "sleep_s": 120.0}}], 3, workers=2, store=Path({folder!r}))
except KeyboardInterrupt as e:
    print(e)
    for process in active_children():
        process.join()
"""


def test_ctrl_c_leaves_what_was_done_and_waits_for_nothing(tmp_path: Path) -> None:
    """The trials under way would take two minutes."""
    folder = tmp_path / "rows"
    process = subprocess.Popen(script(STOPPED.format(folder=str(folder))), stdout=subprocess.PIPE, text=True)
    wait_for(lambda: rows_in(folder) == 3)
    process.send_signal(signal.SIGINT)
    told, _ = process.communicate(timeout=60)
    assert told == f"3 of 6 trials are kept in {folder}\n" and process.returncode == 0
    assert sorted((r["case"], r["seed"]) for r in read_trials(folder).rows) == [(0, 0), (0, 1), (0, 2)]


def test_resuming_adds_seeds(tmp_path: Path) -> None:
    run_trials(drift, CASES, 2, store=tmp_path)
    trial_functions.CALLS.clear()
    more = run_trials(drift, CASES, 4, store=tmp_path, resume=True)
    assert trial_functions.CALLS == [2, 3] * 4 and bits(more) == bits(run_trials(drift, CASES, 4))
    fewer = run_trials(drift, CASES, [1], store=tmp_path, resume=True)
    assert bits(fewer) == bits(run_trials(drift, CASES, [1]))


def test_damaged_lines_run_again(tmp_path: Path) -> None:
    whole = run_trials(drift, CASES, 2, store=tmp_path)
    lines = (tmp_path / ROWS).read_text().splitlines(keepends=True)
    lines[2], lines[4], lines[5] = (
        lines[2][:20] + "\n",
        "\0\0\xff\n",
        lines[5].replace('"values": {', '"values": {"x": null, '),
    )
    (tmp_path / ROWS).write_text("".join(lines))
    assert read_trials(tmp_path).damaged == (3, 5, 6)
    told = document(read_results(tmp_path))
    assert told["ended"] == 5 and told["damaged_lines"] == [3, 5, 6]
    assert "lines 3, 5, 6 of rows.jsonl are damaged" in told["warnings"][0] and "--resume" in told["warnings"][0]
    trial_functions.CALLS.clear()
    again = run_trials(drift, CASES, 2, store=tmp_path, resume=True)
    assert len(trial_functions.CALLS) == 3 and bits(again) == bits(whole)
    assert read_trials(tmp_path).damaged == () and document(read_results(tmp_path))["ended"] == 8


@pytest.mark.parametrize(
    "configuration",
    ["[]", "{}", '{"cases": []}', '{"trial": "a", "cases": [3]}', '{"trial": "a", "cases": [{"sample": "x"}]}'],
)
def test_a_campaign_that_says_no_cases_is_damaged(tmp_path: Path, configuration: str) -> None:
    run_trials(drift, CASES, 1, store=tmp_path)
    (tmp_path / MARKER).write_text(f'{{"schema": "outrider.trials/1", "configuration": {configuration}}}')
    with pytest.raises(DataError, match=r"campaign\.json: is damaged: it says no cases \(make it again\)"):
        read_results(tmp_path)


def test_numbers_of_trials_do_not_move_while_others_are_missing(tmp_path: Path) -> None:
    run_trials(drift, CASES, 3, store=tmp_path)
    lines = (tmp_path / ROWS).read_text().splitlines(keepends=True)
    (tmp_path / ROWS).write_text("".join([lines[0], "torn\n", *lines[2:7], lines[8]]))
    results = read_results(tmp_path)
    assert results.numbers.tolist() == [0, 2, 3, 4, 5, 6, 8]
    with pytest.raises(UsageError, match=r"trial 7 has not ended \(7 of 0 to 8 have\)"):
        replay(tmp_path, 7, tmp_path / "again")


def test_pairs_are_of_the_same_seeds_although_rows_are_missing(tmp_path: Path) -> None:
    whole = run_trials(drift, CASES[:2], 6, store=tmp_path)
    lines = (tmp_path / ROWS).read_text().splitlines(keepends=True)
    (tmp_path / ROWS).write_text("".join([*lines[:1], *lines[2:8], *lines[9:]]))  # seed 1 of one case, 2 of the other
    r = read_results(tmp_path)
    against = next(line.against for line in results_lines(r, ["end"]) if line.group == r.groups[1])
    seeds = [0, 3, 4, 5]
    a, b = (whole.column("end", **case)[seeds] for case in CASES[:2])
    assert against is not None and against.n == 4 and against.mean == pytest.approx(float(np.mean(b - a)), abs=1e-15)


def test_a_campaign_without_a_row_says_so(tmp_path: Path) -> None:
    run_trials(drift, CASES, 1, store=tmp_path)
    (tmp_path / ROWS).write_text("torn\n")
    for ask in (lambda: read_results(tmp_path), lambda: replay(tmp_path, 0, tmp_path / "again")):
        with pytest.raises(UsageError, match=r"no trial has ended; line 1 of rows.jsonl is damaged.*--resume"):
            ask()


def test_another_configuration_is_refused_with_the_difference(tmp_path: Path) -> None:
    run_trials(drift, CASES, 2, store=tmp_path)
    before = (tmp_path / ROWS).read_bytes()
    changed = [*CASES[:3], {"sigma": 2.5, "model": "b"}]
    with pytest.raises(
        ConfigError, match=r"another configuration: cases\[3\].sigma: 2.0 in the folder, 2.5 now \(name"
    ):
        run_trials(drift, changed, 2, store=tmp_path, resume=True)
    with pytest.raises(ConfigError, match=r"cases: 4 in the folder, 1 now"):
        run_trials(drift, CASES[:1], 2, store=tmp_path, resume=True)
    with pytest.raises(ConfigError, match=r"trial: .*drift.* in the folder, .*environment.* now"):
        run_trials(environment, CASES, 2, store=tmp_path, resume=True)
    with pytest.raises(ConfigError, match=r"cases\[0\].x: null in the folder, 1 now.* and 1 more"):
        run_trials(drift, [{**c, "x": 1} for c in CASES], 2, store=tmp_path, resume=True)
    assert (tmp_path / ROWS).read_bytes() == before


def test_other_code_is_refused(tmp_path: Path) -> None:
    run_trials(drift, CASES, 1, store=tmp_path)
    marker = json.loads((tmp_path / MARKER).read_text())
    marker["configuration"]["code"]["trial"] = "0123456789abcdef"
    (tmp_path / MARKER).write_text(json.dumps(marker))
    with pytest.raises(ConfigError, match=r'code.trial: "0123456789abcdef" in the folder'):
        run_trials(drift, CASES, 1, store=tmp_path, resume=True)


def test_folders_in_use_are_left_alone(tmp_path: Path) -> None:
    run_trials(drift, CASES, 1, store=tmp_path / "rows")
    with pytest.raises(OutputExistsError, match="holds an earlier campaign"):
        run_trials(drift, CASES, 1, store=tmp_path / "rows")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").write_text("precious")
    for resume in (False, True):
        with pytest.raises(OutputExistsError, match="not empty and holds no campaign"):
            run_trials(drift, CASES, 1, store=tmp_path / "mine", resume=resume)
    with pytest.raises(OutputExistsError, match="not a directory"):
        run_trials(drift, CASES, 1, store=tmp_path / "mine" / "letter.txt")
    assert [p.name for p in (tmp_path / "mine").iterdir()] == ["letter.txt"]


def test_two_cannot_write_at_once(tmp_path: Path) -> None:
    run_trials(drift, CASES, 1, store=tmp_path)
    with (
        TrialStore(tmp_path, read_trials(tmp_path).configuration, resume=True),
        pytest.raises(UsageError, match="another process"),
    ):
        run_trials(drift, CASES, 2, store=tmp_path, resume=True)
    run_trials(drift, CASES, 2, store=tmp_path, resume=True)


def test_a_full_disk_stops_cleanly(tmp_path: Path) -> None:
    """The file may not grow beyond a size: the system refuses in the middle of a line, as a full disk does."""
    resource = pytest.importorskip("resource")
    _, hard = (limits := resource.getrlimit(resource.RLIMIT_FSIZE))
    resource.setrlimit(resource.RLIMIT_FSIZE, (900, hard))
    try:
        with pytest.raises(UsageError, match=r"cannot be written: file too large \(rows so far stay\)"):
            run_trials(drift, CASES, 2, store=tmp_path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert (tmp_path / ROWS).stat().st_size == 900 and 0 < rows_in(tmp_path) < 4
    assert bits(run_trials(drift, CASES, 2, store=tmp_path, resume=True)) == bits(run_trials(drift, CASES, 2))


def not_importable() -> Any:
    return lambda params, seed: {"x": 1.0}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"trial": not_importable()}, "cannot be imported by its name"),
        ({"seeds": 0}, "seeds 0"),
        ({"seeds": []}, "no trials can have the seeds"),
        ({"seeds": [1, 1]}, "different numbers"),
        ({"seeds": [-1]}, "numbers from 0"),
        ({"cases": []}, "a grid needs a value on every axis"),
        ({"cases": [{"a": 1}, {"a": 1}]}, "there twice"),
        ({"cases": [{"a": object()}]}, "cannot be stored"),
        ({"workers": -1}, "-1 processes"),
    ],
    ids=lambda a: str(a)[:30],
)
def test_refusals(arguments: dict[str, Any], words: str, tmp_path: Path) -> None:
    call: dict[str, Any] = {"trial": drift, "cases": CASES, "seeds": 1, "store": tmp_path / "rows", **arguments}
    with pytest.raises(OutriderError, match=words):
        run_trials(call.pop("trial"), call.pop("cases"), call.pop("seeds"), **call)
    assert not (tmp_path / "rows").exists()


def test_progress_ends_at_one(tmp_path: Path) -> None:
    told: list[tuple[str, float]] = []
    run_trials(drift, CASES, 2, progress=lambda what, share: told.append((what, share)), store=tmp_path)
    assert told[0] == ("drift", 0.125) and told[-1] == ("drift", 1.0) and len(told) == 8
    told.clear()
    run_trials(drift, CASES, 4, progress=lambda what, share: told.append((what, share)), store=tmp_path, resume=True)
    assert told[0] == ("drift", 9 / 16)
