"""`outrider run`: a scenario becomes a folder, always the same one; what cannot be leaves nothing behind."""

import json
import sys
from pathlib import Path

import pytest

from conftest import Outrider

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "scenarios"))
from yard import YARD

from outrider.io.registry import read_log

CROSSED = YARD.replace("team:", "  walls: [{name: shed, outline: [[0, 2], [2, 2], [2, 3], [0, 3]]}]\nteam:")


@pytest.fixture
def yard(tmp_path: Path) -> Path:
    path = tmp_path / "yard.yaml"
    path.write_text(YARD)
    return path


def test_a_run_folder_holds_everything(outrider: Outrider, yard: Path, tmp_path: Path) -> None:
    done = outrider("run", yard, "--no-report", "--json")
    told, folder = json.loads(done.out), tmp_path / "yard-run"
    assert done.code == 0 and told["schema"] == "outrider.simulation/1" and told["folder"] == "yard-run"
    listed = json.loads((folder / "summary.json").read_text())["files"]
    files = {"run.mcap", "scenario.yaml", "summary.json", "truth_rover.tum"}
    assert {p.name for p in folder.iterdir()} == files == set(listed)
    rover = told["robots"]["rover"]
    assert told["outcome"] == {"code": "time", "text": "the time is over"} and told["duration_s"] == 3.0
    assert rover["sensors"]["imu"] == {"kind": "imu", "records": 61, "rate_hz": 20.0} and rover["clearance"] is None
    assert 1.0 < rover["distance_m"] < 1.5 and 20.0 < rover["fence"]["distance_m"] < 30.0
    assert len(read_log(folder / "run.mcap")) == told["log"]["records"]


def test_the_same_run_gives_the_same_bytes(outrider: Outrider, yard: Path, tmp_path: Path) -> None:
    assert outrider("run", yard, "--no-report", "-o", "one").code == 0
    assert outrider("run", yard, "--no-report", "-o", "two").code == 0
    assert outrider("run", "one/scenario.yaml", "--no-report", "-o", "three").code == 0
    assert outrider("run", yard, "--no-report", "-o", "other", "--seed", 4).code == 0
    recordings = {name: (tmp_path / name / "run.mcap").read_bytes() for name in ("one", "two", "three", "other")}
    assert recordings["one"] == recordings["two"] == recordings["three"] != recordings["other"]
    digests = {json.loads((tmp_path / n / "summary.json").read_text())["log"]["sha256"] for n in recordings}
    assert len(digests) == 2


def test_a_collision_ends_with_one(outrider: Outrider, tmp_path: Path) -> None:
    (tmp_path / "crossed.yaml").write_text(CROSSED)
    done = outrider("run", "crossed.yaml", "--no-report", "--quiet", "--duration", 10)
    assert done.code == 1 and done.out.startswith("rover collides with shed after 3.")
    told = json.loads((tmp_path / "yard-run" / "summary.json").read_text())
    assert told["outcome"]["code"] == "collision" and told["robots"]["rover"]["clearance"]["to"] == "shed"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("yard.yaml", "--set", "team.rover.sensors.0.rate_hz=-1"), "should be more than 0, is -1"),
        (("yard.yaml", "--set", "world.place.type=nowhere"), "there is no 'nowhere'"),
        (("yard.yaml", "--set", "speed"), "write a.b=value"),
        (("yard.yaml", "--duration", "-3"), "--duration -3: is too small (give more than 0)"),
        (("yard.yaml", "--set", "world.walls=[{name: hut, outline: [[0, -1], [2, -1], [2, 1]]}]"), "inside hut"),
        (("absent.yaml",), "no such file"),
        (("patrl",), "did you mean 'patrol'?"),
        ((), "names no scenario"),
    ],
)
def test_what_cannot_be_is_one_line_and_leaves_nothing(
    outrider: Outrider, yard: Path, tmp_path: Path, arguments: tuple[str, ...], words: str
) -> None:
    done = outrider("run", *arguments)
    assert done.code == 2 and done.out == "" and words in done.err and done.err.count("\n") == 1
    assert list(tmp_path.iterdir()) == [yard]


def test_a_folder_in_use_is_refused_before_anything_runs(outrider: Outrider, yard: Path, tmp_path: Path) -> None:
    (tmp_path / "yard-run").mkdir()
    (tmp_path / "yard-run" / "notes.txt").write_text("mine")
    assert outrider("run", yard, "--force").code == 2
    assert outrider("run", yard, "--no-report", "-o", "mine").code == 0
    assert "earlier result" in outrider("run", yard, "-o", "mine").err
    assert outrider("run", yard, "--no-report", "-o", "mine", "--force").code == 0


def test_a_dry_run_prints_what_would_be_run(outrider: Outrider, yard: Path, tmp_path: Path) -> None:
    done = outrider("run", yard, "--dry-run", "--set", "team.rover.start.x=2")
    assert done.code == 0 and list(tmp_path.iterdir()) == [yard]
    (tmp_path / "whole.yaml").write_text(done.out)
    assert outrider("run", "whole.yaml", "--dry-run").out == done.out and "x: 2.0" in done.out


def test_scenarios_are_listed(outrider: Outrider) -> None:
    done = outrider("run", "--list")
    assert done.code == 0 and all(name in done.out for name in ("patrol", "airliner-tour", "follow-field"))
    listed = {s["name"]: s for s in json.loads(outrider("run", "--list", "--json").out)["scenarios"]}
    assert listed["patrol"]["settings"] == {"site": "amr_bend", "speed": 1.0}


@pytest.mark.compiled
@pytest.mark.parametrize(("name", "limit"), [("patrol", 0.06), ("airliner-tour", 0.5)])
def test_a_simulated_recording_is_fused_like_any_other(
    outrider: Outrider, tmp_path: Path, name: str, limit: float
) -> None:
    assert outrider("run", name, "--no-report", "-o", "run").code == 0
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    datum = ",".join(f"{summary['datum'][key]:.12g}" for key in ("lat_deg", "lon_deg", "alt_m"))
    robot = ("--robot", "uav") if name == "airliner-tour" else ()
    if robot:
        refused = outrider("fuse", "run/run.mcap")
        assert refused.code == 2 and "--robot uav or ugv" in refused.err
        assert "no robot 'uaw'" in outrider("fuse", "run/run.mcap", "--robot", "uaw").err
    fused = outrider("fuse", "run/run.mcap", "--datum", datum, "--no-report", "-o", "fused", "--json", *robot)
    assert fused.code == 0, fused.out
    truth = f"run/truth_{robot[1] if robot else 'robot'}.tum"
    compared = json.loads(outrider("eval", "fused", truth, "--json").out)
    assert compared["estimates"][0]["position_2d"]["rmse"] < limit
