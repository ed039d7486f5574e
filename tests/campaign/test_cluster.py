"""A Dask cluster on this machine: the same bits, and nothing lost when a worker dies in the middle."""

import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from trial_functions import deadly, drift

from outrider.campaign import grid, run_trials
from outrider.campaign.pool import KILLED
from outrider.errors import UsageError
from outrider.io.trials import ROWS, TABLE

distributed = pytest.importorskip("distributed")
HERE = str(Path(__file__).parent)


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    options: dict[str, Any] = {"n_workers": 2, "threads_per_worker": 2, "dashboard_address": ":0", "silence_logs": 60}
    settings = {"distributed.scheduler.allowed-failures": 1, "distributed.nanny.pre-spawn-environ.PYTHONPATH":
                ":".join([HERE, *(p for p in sys.path if p)])}  # fmt: skip
    import dask

    with dask.config.set(settings), distributed.LocalCluster(**options) as cluster:
        yield cluster.scheduler_address


def test_a_cluster_gives_the_bytes_of_one_process(address: str, tmp_path: Path) -> None:
    cases = grid(sigma=[0.5, 2.0], model=["a", "b"])
    run_trials(drift, cases, 3, store=tmp_path / "here")
    run_trials(drift, cases, 3, store=tmp_path / "there", scheduler=address)
    assert (tmp_path / "here" / TABLE).read_bytes() == (tmp_path / "there" / TABLE).read_bytes()


def test_a_worker_that_dies_loses_no_trial(address: str, tmp_path: Path) -> None:
    marks = tmp_path / "marks"
    marks.mkdir()
    params = {"once": [2], "always": [5], "marks": str(marks)}
    trials = run_trials(deadly, [params], 8, store=tmp_path / "s", scheduler=address)
    assert [r.seed for r in trials.rows] == list(range(8))
    assert (marks / "2").exists()  # its worker was killed in the middle of it
    assert {r.seed: r.error for r in trials.failed} == {5: KILLED}  # whoever waited beside it is not blamed


def test_a_scheduler_that_goes_away_keeps_what_ended(tmp_path: Path) -> None:
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        port = s.getsockname()[1]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([HERE, *(p for p in sys.path if p)])}
    arguments = {
        "scheduler": ["--port", str(port), "--dashboard-address", ":0"],
        "worker": [f"tcp://127.0.0.1:{port}", "--nthreads", "1", "--no-dashboard", "--death-timeout", "60"],
    }
    started = {
        name: subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.dask_{name}", *given], env=environment, stderr=subprocess.DEVNULL
        )
        for name, given in arguments.items()
    }
    try:
        address, case = f"tcp://127.0.0.1:{port}", {"sigma": 1.0, "sleep_s": 0.05}
        with distributed.Client(address, timeout=60, set_as_default=False) as client:
            client.wait_for_workers(1, timeout=60)

        def after_three(_: str, share: float) -> None:
            if share >= 3 / 40:
                started["scheduler"].kill()

        with pytest.raises(UsageError, match=r"the scheduler is gone.*--resume"):
            run_trials(drift, [case], 40, store=tmp_path / "s", scheduler=address, progress=after_three)
    finally:
        for process in started.values():
            process.kill()
            process.wait()
    whole = run_trials(drift, [case], 40, store=tmp_path / "s", resume=True)
    assert not whole.failed
    assert len((tmp_path / "s" / ROWS).read_text().splitlines()) == 40  # none of those that ended ran again


def test_a_scheduler_that_does_not_answer_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("outrider.campaign.cluster.PATIENCE", 1.0)
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{s.getsockname()[1]}"
    with pytest.raises(UsageError, match="no scheduler answers") as e:
        run_trials(drift, [{"sigma": 1.0}], 1, scheduler=address)
    assert "\n" not in str(e.value)
