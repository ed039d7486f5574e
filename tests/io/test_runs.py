"""The folder of a run: complete or absent, replaced without loss, and read back."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from outrider.data import Datum, Estimates, Manifold, Run, StateLayout, Trajectory
from outrider.errors import DataError, OutputExistsError, UsageError
from outrider.io import folders
from outrider.io.runs import (
    SCHEMA,
    SUMMARY,
    ensure_free,
    is_run_folder,
    read_fused,
    read_summary,
    run_folder,
    write_run,
)

T0 = 1_700_000_000_000_000_000
LAYOUT = StateLayout(("position", 3, "m"), ("attitude", Manifold.ROTATION, "rad"))
ALL = [
    "config.yaml",
    "estimates.parquet",
    "fused.tum",
    "innovations.parquet",
    "local.tum",
    "run.mcap",
    "summary.json",
    "track.geojson",
]


def small_run(n: int = 5) -> Run:
    t = T0 + 10**8 * np.arange(n, dtype=np.int64)
    p = np.stack([np.arange(n), 0.5 * np.arange(n), np.zeros(n)], axis=1).astype(float)
    q = np.tile([0.0, 0.0, 0.0, 1.0], (n, 1))
    pose = Trajectory(t=t, p=p, q=q, v=np.ones((n, 3)), P=np.tile(np.eye(6), (n, 1, 1)), valid=np.ones(n, np.bool_))
    x = np.hstack([p, q])
    made = Estimates(layout=LAYOUT, t=t, x=x, sd=np.ones((n, 6)), valid=np.ones((n, 3), np.int64), pose=pose)
    return Run(
        log_path="log.bag", log_sha256="ab", config={"seed": 3, "mounts": {"imu": {"xyz_m": (1.0, 0.0, 0.0)}}}, seed=3,
        versions={"outrider": "0"}, robot="rover", start=T0, datum=Datum(lat=0.8, lon=0.2, alt=300.0), fused=made,
        local=made, innovations={}, accounts=(), findings=(), resets=(),
    )  # fmt: skip


def write(folder: Path, run: Run, *, force: bool = False, **more: object) -> None:
    with run_folder(folder, force=force) as part:
        write_run(run, part, {"schema": SCHEMA, **more})


def names(folder: Path) -> list[str]:
    return sorted(p.name for p in folder.iterdir())


def test_everything_is_there_and_comes_back(tmp_path: Path) -> None:
    run, folder = small_run(), tmp_path / "deep" / "run"
    write(folder, run, number=float("nan"), array=np.array([1.0, np.inf]))
    assert names(folder) == ALL and names(tmp_path / "deep") == ["run"]
    summary = read_summary(folder)
    assert summary == {"schema": SCHEMA, "number": None, "array": [1.0, None], "files": ALL}
    assert yaml.safe_load((folder / "config.yaml").read_text()) == {
        "seed": 3,
        "mounts": {"imu": {"xyz_m": [1.0, 0, 0]}},
    }
    fused = read_fused(folder)
    assert fused.t.tolist() == run.fused.t.tolist() and fused.datum is not None
    np.testing.assert_array_equal(fused.p, run.fused.pose.p)
    np.testing.assert_array_equal(fused.P, run.fused.pose.P)
    assert fused.datum.lat == pytest.approx(0.8, abs=1e-15)


def test_a_site_without_a_place_has_no_map_and_a_drone_no_odom(tmp_path: Path) -> None:
    write(tmp_path / "run", replace(small_run(), datum=None, local=None))
    assert set(ALL) - set(names(tmp_path / "run")) == {"track.geojson", "local.tum"}


def test_nothing_half_written(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), run_folder(tmp_path / "run") as part:
        (part / "fused.tum").write_text("1")
        _ = 1 / 0
    with pytest.raises(KeyboardInterrupt), run_folder(tmp_path / "run") as part:
        raise KeyboardInterrupt
    assert names(tmp_path) == []
    with pytest.raises(UsageError, match="no space left"), run_folder(tmp_path / "run"):
        raise OSError(28, "No space left on device")
    assert names(tmp_path) == []


def test_an_earlier_run_is_replaced_only_on_request_and_other_files_stay(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    write(folder, small_run(), round=1)
    (folder / "notes.txt").write_text("mine")
    with pytest.raises(OutputExistsError, match="earlier result"):
        write(folder, small_run(), round=2)
    assert read_summary(folder)["round"] == 1
    write(folder, replace(small_run(3), local=None), force=True, round=2)
    assert read_summary(folder)["round"] == 2 and len(read_fused(folder)) == 3
    assert (folder / "notes.txt").read_text() == "mine"
    assert "local.tum" not in names(folder)  # a leftover of the first run would be a lie
    assert names(tmp_path) == ["run"]


def test_a_failed_replacement_keeps_the_earlier_run(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    write(folder, small_run(), round=1)
    before = {p.name: p.read_bytes() for p in folder.iterdir()}
    with pytest.raises(ZeroDivisionError), run_folder(folder, force=True) as part:
        (part / "fused.tum").write_text("half")
        _ = 1 / 0
    assert {p.name: p.read_bytes() for p in folder.iterdir()} == before and names(tmp_path) == ["run"]


def test_two_runs_into_one_new_folder_lose_neither(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    with pytest.raises(OutputExistsError), run_folder(folder) as part:
        write_run(small_run(), part, {"schema": SCHEMA})
        write(folder, small_run(), round=1)
    assert json.loads((folder / SUMMARY).read_text())["round"] == 1 and names(tmp_path) == ["run"]


@pytest.mark.parametrize("force", [False, True])
def test_what_is_no_run_is_never_overwritten(tmp_path: Path, force: bool) -> None:
    home, file = tmp_path / "home", tmp_path / "file"
    home.mkdir()
    (home / "config.yaml").write_text("precious")
    file.write_text("precious")
    for place in (home, file):
        with pytest.raises(OutputExistsError):
            ensure_free(place, force=force)
        with pytest.raises(OutputExistsError), run_folder(place, force=force):
            pass
    assert (home / "config.yaml").read_text() == file.read_text() == "precious"
    (home / SUMMARY).write_text(json.dumps({"schema": "something.else/1"}))
    with pytest.raises(OutputExistsError):
        ensure_free(home, force=force)


def test_a_marker_cannot_point_outside(tmp_path: Path) -> None:
    outside = tmp_path / "precious"
    outside.write_text("mine")
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / SUMMARY).write_text(json.dumps({"schema": SCHEMA, "files": ["../precious", "", ".", 7]}))
    write(folder, small_run(), force=True)
    assert outside.read_text() == "mine" and names(folder) == ALL


def test_an_empty_folder_is_taken(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    write(tmp_path / "run", small_run())
    assert names(tmp_path / "run") == ALL and oct((tmp_path / "run").stat().st_mode)[-3:] == "755"


def test_reading_what_is_no_run(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no folder of results"):
        read_summary(tmp_path)
    for text, what in (("{", "damaged"), ("[1]", "schema ''"), ('{"schema": "outrider.run/9"}', "outrider.run/9")):
        (tmp_path / SUMMARY).write_text(text)
        with pytest.raises(DataError, match=what):
            read_summary(tmp_path)
    assert is_run_folder(tmp_path)  # of a later version: still not anybody's own files
    assert not is_run_folder(tmp_path / "none")


def test_plain_json() -> None:
    value = {"a": (1, float("inf")), 2: np.float64(1.5), "c": np.arange(2), "d": None, "e": True}
    assert folders.plain(value) == {"a": [1, None], "2": 1.5, "c": [0, 1], "d": None, "e": True}
