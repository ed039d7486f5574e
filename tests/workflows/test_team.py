"""Teams from logs: starts and noise are found, misread barcodes refused by reason, the truth never used."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from outrider.cli.app import app
from outrider.data import EventLog, Kind, Trajectory
from outrider.data.team_run import CODES, Sighting, TeamRun
from outrider.errors import ConfigError, DataError, ExitCode, UsageError
from outrider.io.mrclam import write_mrclam
from outrider.io.registry import read_log
from outrider.sim.barcodes import UNKNOWN, BarcodeTeam, barcode_log
from outrider.workflows.config import FuseConfig, TeamSection
from outrider.workflows.team import fuse_team_log
from outrider.workflows.team_file import agreement, findings
from outrider.workflows.team_records import STEP, team_log

pytestmark = pytest.mark.compiled  # minutes of odometry at 67 Hz
SMALL = BarcodeTeam(robots=3, duration_s=150.0)


@cache
def small(seed: int = 1, **changes: Any) -> tuple[EventLog, dict[str, Trajectory]]:
    log, truth = barcode_log(replace(SMALL, **changes), seed)
    return with_truth(log, truth), truth


def with_truth(log: EventLog, truth: dict[str, Trajectory]) -> EventLog:
    """As the reader gives it."""
    with TemporaryDirectory() as room:
        write_mrclam(log, truth, Path(room))
        return read_log(Path(room))


def fused(log: EventLog, **team: Any) -> TeamRun:
    return fuse_team_log(log, FuseConfig(team=TeamSection.model_validate(team)))


def scores(run: TeamRun) -> tuple[float, float]:
    assert run.score is not None and run.alone is not None
    return run.score.rmse, run.alone.rmse


def changed(log: EventLog, name: str, z: Any) -> EventLog:
    return log.with_streams(replace(log.streams[name], z=z))


def test_cooperation_pays_where_landmarks_are_few_and_everybody_knows_how_wrong_it_is() -> None:
    run = fused(small(2, shown=3)[0])
    together, alone = scores(run)
    assert len(run.robots) == 3 and together < 0.75 * alone
    assert run.score is not None and 0.5 < run.score.nees < 1.5 and run.score.inside > 0.85


def test_robots_that_see_no_landmark_are_found_and_held_by_those_that_do() -> None:
    run = fused(small(1, seers=1)[0])
    assert len(run.robots) == 3
    for r in run.robots:
        assert r.score is not None and r.score.rmse < 0.30
    assert any("meetings with" in r.start for r in run.robots)


@pytest.mark.parametrize("cooperation", ["none", "naive", "ci", "split_ci", "distributed", "joint"])
def test_every_way_of_sharing_can_be_chosen(cooperation: str) -> None:
    run = fused(small(duration_s=60.0)[0], cooperation=cooperation)
    assert run.cooperation == cooperation and run.score is not None and run.score.rmse < 0.2
    assert (run.alone is None) == (cooperation == "none")
    used = run.sightings.what == CODES[Sighting.USED]
    assert used[run.sightings.subject <= 3].any() == (cooperation != "none")


def test_ground_truth_reaches_no_estimate() -> None:
    log = small(duration_s=60.0)[0]
    bare = replace(log, streams={n: s for n, s in log.streams.items() if s.kind is not Kind.ESTIMATE})
    one, two = fused(log), fused(bare)
    assert two.score is None and one.score is not None
    for a, b in zip(one.robots, two.robots, strict=True):
        np.testing.assert_array_equal(a.x, b.x)
        np.testing.assert_array_equal(a.P, b.P)


def test_the_first_true_pose_is_used_only_when_asked_for_and_said_so() -> None:
    log, truth = small(duration_s=60.0)
    run = fused(log, start="groundtruth")
    for r in run.robots:
        assert r.start == "first pose of the ground truth, as asked for"
        k = np.searchsorted(truth[r.name].t, r.started)
        assert np.hypot(*(r.x[0, :2] - truth[r.name].p[k, :2])) < 0.15
    assert not any("ground truth" in r.start for r in fused(log).robots)


def test_the_noise_is_found() -> None:
    run = fused(small()[0])
    assert run.noise["range_m"] == pytest.approx(0.12, rel=0.15)
    assert 0.45 < run.noise["bearing_deg"] < 1.0
    told = fused(small(duration_s=60.0)[0], range_sigma_m=0.2, bearing_sigma_deg=1.0)
    assert told.noise["range_m"] == 0.2 and told.noise["bearing_deg"] == pytest.approx(1.0)


def test_misread_barcodes_are_refused_by_reason() -> None:
    """Faults put in by hand, and what became of each."""
    log = small(misread=0.0)[0]
    s = log.streams["robot1/measurement"]
    z = s.z.copy()
    late = np.flatnonzero((s.t - s.t[0] > 30e9) & (z[:, 0] > 3))[::5]
    z[late[0::4], 0] = -UNKNOWN
    z[late[1::4], 0] = 1
    z[late[2::4], 1] += 3.0  # as if it were another's
    z[late[3::4], 1] = 80.0
    run = fused(changed(log, "robot1/measurement", z))
    what = run.sightings.what[run.sightings.robot == 0]
    for k, reason in ((0, Sighting.UNKNOWN), (1, Sighting.ITSELF), (3, Sighting.IMPLAUSIBLE)):
        assert (what[late[k::4]] == CODES[reason]).all(), reason
    assert np.mean(what[late[2::4]] == CODES[Sighting.GATED]) > 0.95
    clean = fused(log)
    assert run.score is not None and clean.score is not None and run.score.rmse < clean.score.rmse + 0.01


def test_a_frame_that_comes_twice_counts_once() -> None:
    log = small(misread=0.0, duration_s=60.0)[0]
    s = log.streams["robot2/measurement"]
    again = replace(s, t=s.t + 150_000_000, t_arrival=s.t_arrival)
    both = {k: np.concatenate([getattr(s, k), getattr(again, k)]) for k in ("t", "z", "var", "t_arrival")}
    run = fused(log.with_streams(replace(s, **both)))
    what, who = run.sightings.what, run.sightings.robot
    assert ((what == CODES[Sighting.REPEATED]) & (who == 1)).sum() >= len(s)


def test_a_robot_that_misreads_everything_harms_nobody_and_is_named() -> None:
    run, good = (fused(small(1, liar=k)[0]) for k in (2, 0))
    mine = {r.name: r.score.rmse for r in run.robots if r.score}
    for r in good.robots:
        if r.name != "robot2" and r.score:
            assert mine[r.name] < r.score.rmse + 0.02
    own = run.sightings.what[run.sightings.robot == 1]
    assert not (own == CODES[Sighting.USED]).any() or mine["robot2"] < 0.3
    assert (own == CODES[Sighting.DISBELIEVED]).any() or "robot2" in run.absent


def test_landmarks_of_one_robot_only_by_configuration() -> None:
    run = fused(small()[0], landmarks_for=["robot1"], compare=False)
    s = run.sightings
    assert not ((s.what == CODES[Sighting.USED]) & (s.robot > 0) & (s.subject > 3)).any()
    assert ((s.what == CODES[Sighting.WITHHELD]) & (s.robot > 0)).sum() > 100
    assert all(r.score is not None and r.score.rmse < 0.30 for r in run.robots)


def test_odometry_that_stops_is_a_robot_that_stands() -> None:
    log, _ = small(duration_s=60.0)
    s = log.streams["robot3/odometry"]
    stops = log.with_streams(s.select(s.t - s.t[0] < 20e9))
    m = team_log(stops, FuseConfig()).mates[2]
    assert m.t[-1] > 59.0 and (m.u[m.t > 26.0][:, :2] == 0.0).all() and (m.u[m.t > 26.0][:, 2:4] > 0.0).all()


def test_odometry_keeps_its_way_on_the_coarser_grid() -> None:
    """Distance and turn of zero-order hold, summed by hand."""
    log, _ = small()
    s = log.streams["robot1/odometry"]
    hold = np.minimum(np.diff(s.t) * 1e-9, 0.5)
    m = team_log(log, FuseConfig()).mates[0]
    assert (m.u[:, 0] * STEP).sum() == pytest.approx((s.z[:-1, 0] * hold).sum(), abs=1e-6)
    assert (m.u[:, 1] * STEP).sum() == pytest.approx((s.z[:-1, 5] * hold).sum(), abs=1e-6)


@pytest.mark.parametrize(
    ("team", "what"),
    [
        ({"without": ["robot9"]}, "no robot 'robot9' in the log"),
        ({"landmarks_for": ["x"]}, "no robot 'x' in the log"),
        ({"ids": {"robot1": 2}}, "two robots have one number"),
    ],
)
def test_a_configuration_of_others_is_refused(team: dict[str, Any], what: str) -> None:
    with pytest.raises(ConfigError, match=what):
        fused(small(duration_s=60.0)[0], **team)


def test_without_landmarks_nobody_starts_and_it_is_said_how_to_help() -> None:
    log = replace(small(duration_s=60.0)[0], beacons={})
    with pytest.raises(DataError, match=r"nobody's start can be found.*team\.start: groundtruth"):
        fused(log)
    run = fused(log, start="groundtruth")
    assert len(run.robots) == 3 and run.sightings.counts()["unmapped"] > 100


def test_without_odometry_there_is_nothing() -> None:
    log = small(duration_s=60.0)[0]
    with pytest.raises(DataError, match="no robot has odometry"):
        fused(replace(log, streams={n: s for n, s in log.streams.items() if s.kind is not Kind.TWIST}))
    one = replace(log, streams={n: s for n, s in log.streams.items() if n != "robot2/odometry"})
    run = fused(one)
    assert run.absent == {"robot2": "it has no odometry"} and len(run.robots) == 2


@contextmanager
def folder(**changes: Any) -> Iterator[Path]:
    with TemporaryDirectory() as room:
        log, truth = barcode_log(replace(SMALL, duration_s=60.0, **changes), 1)
        write_mrclam(log, truth, Path(room) / "log")
        yield Path(room)


def test_the_command_writes_a_folder_and_its_configuration_does_it_again() -> None:
    with folder() as room:
        run = CliRunner().invoke(app, ["fuse", str(room / "log"), "-o", str(room / "out"), "--json", "-q"])
        assert run.exit_code == ExitCode.OK, run.output
        told = json.loads(run.stdout)
        assert told["schema"] == "outrider.team/1" and set(told["robots"]) == {"robot1", "robot2", "robot3"}
        assert told["team"]["score"]["rmse_m"] < 0.2 and told["cooperation"]["name"] == "joint"
        names = {p.name for p in (room / "out").iterdir()}
        assert {"summary.json", "robot1.tum", "estimates.parquet", "sightings.parquet", "tracks.png"} <= names
        again = [
            "fuse",
            str(room / "log"),
            "-o",
            str(room / "two"),
            "--json",
            "-q",
            "-c",
            str(room / "out/config.yaml"),
        ]
        same = json.loads(CliRunner().invoke(app, again).stdout)
        assert same["robots"] == told["robots"]
        apart = [*again[:3], str(room / "three"), "-q", "--no-report", "--set", "team.cooperation=none"]
        assert CliRunner().invoke(app, apart).exit_code == ExitCode.OK
        assert json.loads((room / "three/summary.json").read_text())["cooperation"]["name"] == "none"


def test_one_robot_of_a_team_by_what_it_sees_of_landmarks() -> None:
    with folder() as room:
        words = ["fuse", str(room / "log"), "-o", str(room / "out"), "--json", "-q", "--no-report", "--robot"]
        run = CliRunner().invoke(app, [*words, "robot2"])
        assert run.exit_code == ExitCode.OK and set(json.loads(run.stdout)["robots"]) == {"robot2"}
        told = json.loads(run.stdout)
        assert told["robots"]["robot2"]["score"]["rmse_m"] < 0.15
        assert told["sightings"]["absent"] > 10 and "unmapped" not in told["sightings"]
        with pytest.raises(UsageError, match="no robot 'robot9'"):
            CliRunner().invoke(app, [*words[:3], str(room / "two"), "--robot", "robot9"], catch_exceptions=False)


@pytest.mark.parametrize("given", ["team.cooperation=all", "team.what=1", "team"])
def test_a_setting_that_is_none_is_refused_before_anything_is_read(given: str) -> None:
    with folder() as room, pytest.raises(ConfigError):
        CliRunner().invoke(app, ["fuse", str(room / "log"), "--set", given], catch_exceptions=False)


def test_sightings_need_no_order() -> None:
    """Those of one image share a stamp; files may hold images in any order."""
    log = small(duration_s=60.0)[0]
    s = log.streams["robot1/measurement"]
    mixed = log.with_streams(s.select(np.random.default_rng(1).permutation(len(s))))
    for a, b in zip(fused(log).robots, fused(mixed).robots, strict=True):
        np.testing.assert_allclose(a.x, b.x, atol=1e-6)


def test_pairs_say_whether_they_agree() -> None:
    """White noise of the size that is found: NIS about 1. A camera that is turned by 3 deg shows in what it sees."""
    log = small(2, misread=0.0)[0]
    for told in (agreement(fused(log), k) for k in range(3)):
        for a in told.values():
            if a["used"] > 50:
                assert 0.6 < a["nis_per_dof"] < 1.4 and a["in_bound"] > 0.88
    s = log.streams["robot2/measurement"]
    z = s.z.copy()
    z[:, 2] += np.radians(3.0) * np.where(z[:, 0] > 3, 0.0, 1.0)  # of robots only
    off = agreement(fused(changed(log, "robot2/measurement", z), range_sigma_m=0.12, bearing_sigma_deg=0.5), 1)
    assert max(a["nis_per_dof"] for name, a in off.items() if name != "landmarks") > 2.0


def test_what_tells_nothing_is_a_warning(tmp_path: Path) -> None:
    log, truth = barcode_log(replace(SMALL, duration_s=60.0), 1)
    write_mrclam(log, truth, tmp_path)
    (tmp_path / "Robot2_Measurement.dat").write_bytes(np.random.default_rng(1).bytes(5000))
    run = fuse_team_log(read_log(tmp_path))
    told = [f["text"] for f in findings(run) if f["severity"] == "warning"]
    assert any("lines of Robot2_Measurement.dat could not be read" in text for text in told)
    assert any("robot2" in text and ("nothing has measured it" in text or "not part" in text) for text in told)
