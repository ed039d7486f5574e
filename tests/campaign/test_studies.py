"""Campaigns from the command line: what varies, what is refused, what is told, and the trial that is replayed."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyarrow import parquet

from outrider.campaign.report import document
from outrider.campaign.results import read_results
from outrider.campaign.vary import Axis, Sampling, axis_of, cases_of, seed_of
from outrider.cli import main
from outrider.errors import ExitCode, UsageError

SHORT = ["follow-field", "--set", "duration_s=12", "--workers", "0", "--quiet"]


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("speed=1,2.5,4", (1, 2.5, 4)),
        ("team.drone.name=a,b", ("a", "b")),
        ("tells=true,false", (True, False)),
        ("at=[1, 2]", ([1, 2],)),
        ("speed=1:3:3", (1.0, 2.0, 3.0)),
        ("gain=1:100:3:log", (1.0, 10.0, 100.0)),
        ("when=12", (12,)),
    ],
)
def test_lists_and_grids(text: str, values: tuple[object, ...]) -> None:
    axis = axis_of(text)
    assert axis.key == text.partition("=")[0]
    assert axis.values == pytest.approx(values) if isinstance(values[0], float) else axis.values == values


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("speed", "cannot be understood"),
        ("=1,2", "cannot be understood"),
        ("a..b=1", "cannot be understood"),
        ("speed=", "cannot be understood"),
        ("speed=1,,2", "empty value"),
        ("speed=3:1", "holds no points"),
        ("speed=1:1", "holds no points"),
        ("speed=1:2:1", "holds no grid"),
        ("speed=1:2:99999999", "too many"),
        ("speed=0:1:log", "no logarithm"),
        ("speed=1,2,1", "twice"),
        ("speed=nan", "no number that could be run"),
        ("speed=1,.inf", "no number that could be run"),
        ("speed=0:inf", "no number that could be run"),
    ],
)
def test_what_is_no_axis_is_one_line(text: str, says: str) -> None:
    with pytest.raises(UsageError, match=says) as e:
        axis_of(text)
    assert "\n" not in str(e.value) and "--vary" in str(e.value)


@given(st.sampled_from(list(Sampling)), st.integers(1, 40), st.integers(0, 5), st.integers(1, 3))
def test_samples_lie_in_their_ranges_and_are_the_same_again(
    sampling: Sampling, runs: int, seed: int, ranges: int
) -> None:
    axes = [Axis(key=f"k{i}", low=1.0 + i, high=10.0 + i, log=i == 1) for i in range(ranges)]
    axes.append(Axis(key="method", values=("a", "b")))
    cases, seeds = cases_of(axes, runs, sampling, seed)
    assert (cases, seeds) == cases_of(axes, runs, sampling, seed)
    assert len(cases) == 2 * runs and len(seeds) == 1
    for a in axes[:-1]:
        assert all(a.low <= float(str(c[a.key])) <= a.high for c in cases)
    first, second = cases[:runs], cases[runs:]
    strip = [{k: v for k, v in c.items() if k != "method"} for c in cases]
    assert strip[:runs] == strip[runs:] and {c["method"] for c in first} == {"a"} != {c["method"] for c in second}
    assert [seed_of(c, seed) for c in first] == list(range(seed, seed + runs))


def test_the_low_discrepancy_samples_fill_their_range_evenly() -> None:
    """64 places of Sobol or of a Latin hypercube: one in each 64th of the range, whatever the seed."""
    for sampling in (Sampling.SOBOL, Sampling.LATIN):
        cases, _ = cases_of([Axis(key="x", low=0.0, high=1.0)], 64, sampling, 3)
        x = np.array([float(str(c["x"])) for c in cases])
        assert sorted((64 * x).astype(int)) == list(range(64))


def test_what_varies_twice_or_is_the_campaigns_own_is_refused() -> None:
    for axes, says in (
        ([Axis(key="a", values=(1,)), Axis(key="a", values=(2,))], "varies twice"),
        ([Axis(key="seed", values=(1,))], "the campaign's own"),
        ([Axis(key="a", values=tuple(range(2000)))], "too many"),
    ):
        with pytest.raises(UsageError, match=says):
            cases_of(axes, 1000, Sampling.SOBOL, 0)


@pytest.mark.compiled
def test_a_campaign_is_run_told_gone_on_with_and_one_of_its_trials_replayed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "c"
    assert main(["campaign", *SHORT, "--vary", "speed=2,4", "--runs", "2", "-o", str(folder)]) == ExitCode.OK
    assert "4 of 4 trials, 0 failed" in capsys.readouterr().out
    table = parquet.read_table(folder / "trials.parquet")
    assert table["param.speed"].to_pylist() == [2, 2, 4, 4]
    far = table["robots.drone.distance_m"].to_numpy()
    assert far[2:].min() > far[:2].max()
    assert "<svg" in (folder / "report.html").read_text()
    # more seeds: only what is missing runs, and what is there stays as it is
    rows = (folder / "rows.jsonl").read_text().splitlines()
    more = ["campaign", *SHORT, "--vary", "speed=2,4", "--runs", "3", "-o", str(folder), "--resume"]
    assert main(more) == ExitCode.OK
    assert (folder / "rows.jsonl").read_text().splitlines()[:4] == rows
    told = document(read_results(folder), ["distance_m"])
    assert told["ended"] == told["asked"] == 6 and told["groups"] == ["speed=2", "speed=4"]
    # values that somebody chose have a page of their own
    own = (folder / "report.html").read_text()
    assert main(["campaign", "report", str(folder), "--value", "distance_m"]) == ExitCode.OK
    assert (folder / "report.html").read_text() == own and (folder / "report-distance_m.html").exists()
    pair = next(line["difference"] for line in told["lines"] if line["case"] == "speed=4")
    assert pair["mean"] > 0.0 and pair["n"] == 3
    # another configuration is refused, with the difference
    assert main([*more[:-4], "4", *more[-3:], "--set", "wind=9"]) != ExitCode.OK
    assert "another configuration" in capsys.readouterr().err
    # the fifth trial again, with its report
    assert main(["campaign", "replay", str(folder), "4", "-o", str(tmp_path / "t")]) == ExitCode.OK
    assert "the same as in the campaign" in capsys.readouterr().out
    assert (tmp_path / "t" / "report.html").exists()
    assert json.loads((tmp_path / "t" / "summary.json").read_text())["seed"] == 1


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["follow-field", "--vary", "sped=1,2"], "--vary sped: unknown key (did you mean 'speed'?)"),
        (["follow-field", "--vary", "team.drone.mision.speed=1,2"], "--vary team.drone.mision.speed"),
        (["follow-field", "--vary", "speed=-1,2"], "--vary speed=-1: "),
        (["follow-field", "--vary", "speed=nan"], "--vary speed=nan: "),
        (["follow-field", "--set", "speed=-1", "--vary", "wind=1,2"], "--set speed"),
        (["report", "somewhere", "-o", "there"], "leave out --output"),
        (["no-such-scenario"], "no-such-scenario"),
        (["follow-field", "--runs", "0"], "--runs"),
        (["follow-field", "--runs", "2", "--seed", str(2**63 - 1)], "go beyond 64 bits (a smaller first one)"),
        (["follow-field", "--engine", "slurm"], "no such engine"),
        (["follow-field", "--engine", "dask"], "no such engine"),
        (["follow-field", "--sampling", "halton"], "no such sampling"),
        (["report"], "names no campaign"),
        (["replay", "somewhere"], "names no trial"),
        (["follow-field", "elsewhere"], "takes no second name"),
        (["report", "nowhere"], "nowhere"),
    ],
)
def test_what_cannot_be_is_one_line_and_nothing_is_written(
    arguments: list[str], says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["campaign", *arguments]) != ExitCode.OK
    said = capsys.readouterr().err
    assert says in said and said.count("\n") == 1 and "Traceback" not in said
    assert not list(tmp_path.iterdir())


@pytest.mark.compiled
def test_a_folder_of_logs_is_fused_log_by_log(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "patrol", "--set", "duration_s=8", "-o", str(tmp_path / "r"), "--no-report", "-q"]) == 0
    logs = tmp_path / "logs"
    logs.mkdir()
    (logs / "notes.txt").write_text("no recording")
    for name in ("a.mcap", "b.mcap"):
        (logs / name).write_bytes((tmp_path / "r" / "run.mcap").read_bytes())
    command = ["campaign", str(logs), "--runs", "1", "--workers", "0", "-q", "-o", str(tmp_path / "c")]
    main([*command, "--vary", "preset=default,amr2025"])
    results = read_results(tmp_path / "c")
    assert len(results.case) == 4 and not results.errors
    assert results.groups == ("log=a.mcap, preset=default", "log=a.mcap, preset=amr2025", "log=b.mcap, preset=default",
                              "log=b.mcap, preset=amr2025")  # fmt: skip
    capsys.readouterr()
