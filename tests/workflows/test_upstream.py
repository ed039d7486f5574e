"""Configurations of robot_localization: read in every shape, translated, every flag accounted for."""

from pathlib import Path

import numpy as np
import pytest

from outrider.cli import main
from outrider.data import EventLog, Finding, Kind, Run
from outrider.errors import ConfigError, ExitCode
from outrider.io.robot_localization import read_upstream
from outrider.sim.logs import wheeled_log
from outrider.workflows.config import FuseConfig
from outrider.workflows.fuse import fuse
from outrider.workflows.settings import load_config
from outrider.workflows.summary import exit_code
from outrider.workflows.upstream import Translated, translate
from recorded import HUSKY, HUSKY_MOUNT, UPSTREAM_END, recording

F, T = "false", "true"
HUSKY_LIKE = f"""
odom_frame: odom
world_frame: odom
frequency: 50
odom0: husky_velocity_controller/odom
odom0_config: [{F}, {F}, {F}, {F}, {F}, {F}, {T}, {T}, {T}, {F}, {F}, {F}, {F}, {F}, {F}]
odom0_differential: false
imu0: imu/data
imu0_config: [{F}, {F}, {F}, {T}, {T}, {T}, {F}, {F}, {F}, {T}, {T}, {F}, {T}, {T}, {T}]
imu0_remove_gravitational_acceleration: true
"""
FLAT = f"""
two_d_mode: true
frequency: 10
sensor_timeout: 0.1
history_length: 3.5
print_diagnostics: true
odom0: /wheels
odom0_config: [{T}, {T}, {F}, {F}, {F}, {F}, {T}, {F}, {F}, {F}, {F}, {T}, {F}, {F}, {F}]
odom0_twist_rejection_threshold: 3.0
odom0_queue_size: 5
imu0: /imu
imu0_config: [{F}, {F}, {F}, {F}, {F}, {F}, {F}, {F}, {F}, {F}, {F}, {T}, {T}, {F}, {F}]
imu0_remove_gravitational_acceleration: false
pose0: /amcl_pose
pose0_config: [{T}, {T}, {F}, {F}, {F}, {T}, {F}, {F}, {F}, {F}, {F}, {F}, {F}, {F}, {F}]
made_up_flag: 7
"""


def under(text: str, *names: str) -> str:
    for name in reversed(names):
        text = f"{name}:\n" + "".join(f"  {line}\n" for line in text.strip().splitlines())
    return text


def translated(tmp_path: Path, text: str, log: EventLog) -> Translated:
    (tmp_path / "ekf.yaml").write_text(text, encoding="utf-8")
    up = read_upstream(tmp_path / "ekf.yaml")
    assert up is not None
    return translate(up, log)


@pytest.fixture(scope="module")
def log() -> EventLog:
    return wheeled_log(2, 20.0)[0]


def only(log: EventLog, kind: Kind) -> str:
    (s,) = log.of(kind)
    return s.name


@pytest.mark.parametrize(
    "names", [(), ("ekf_se",), ("ekf_filter_node", "ros__parameters"), ('"/**"', "ros__parameters")]
)
def test_every_shape_of_file_says_the_same(tmp_path: Path, log: EventLog, names: tuple[str, ...]) -> None:
    assert translated(tmp_path, under(FLAT, *names), log) == translated(tmp_path, FLAT, log)


def test_flags_become_settings_or_are_said_to_be_left_out(tmp_path: Path, log: EventLog) -> None:
    done = translated(tmp_path, FLAT, log)
    cfg, said = done.config, {r.flag: r for r in done.rows}
    assert (cfg.motion, cfg.output_period_s, cfg.history_s, cfg.diagnose) == ("planar", 0.1, 3.5, False)
    wheels, imu = cfg.sources[only(log, Kind.TWIST)], cfg.sources[only(log, Kind.IMU)]
    assert (wheels.rows, imu.rows) == ("100001", "001000")  # accelerations without gravity are left out
    assert wheels.gate == pytest.approx(1.0 - np.exp(-4.5))  # of two degrees of freedom beyond three deviations
    assert imu.gate == 1.0
    assert cfg.sources[only(log, Kind.GNSS)].use == "ignore"  # what it does not name is not fused
    assert not said["pose0"].used and "not in the log" in said["pose0"].done
    assert not said["made_up_flag"].used and not said["sensor_timeout"].used and said["two_d_mode"].used
    flags = {line.partition(":")[0] for line in FLAT.strip().splitlines()}
    assert [f.code for f in done.findings] == ["input-missing", "not-diagnosed"]
    assert flags - set(said) == {"pose0_config"}  # every flag has a row; of what is not there one is enough


def test_a_mistyped_topic_is_an_error_and_a_mistyped_flag_is_named(tmp_path: Path, log: EventLog) -> None:
    name = only(log, Kind.IMU)
    text = FLAT.replace("imu0: /imu\n", f"imu0: /{name}y\nimu0_rejection: 2\nodom0_diferential: true\n")
    done = translated(tmp_path, text.replace("made_up_flag: 7", "two_d_mod: true\nqwxz: 1"), log)
    first = done.findings[0]
    assert (first.severity, first.fix) == ("error", f"did you mean '{name}'?")
    assert f"imu0: '/{name}y' is not in the log" in first.text
    said = {r.flag: (r.meaning, r.done) for r in done.rows}
    assert said["imu0_rejection"] == ("unknown", "ignored: did you mean 'imu0_rejection_threshold'?")
    assert said["odom0_diferential"] == ("unknown", "ignored: did you mean 'odom0_differential'?")
    assert said["two_d_mod"] == ("unknown", "ignored: did you mean 'two_d_mode'?")
    assert said["qwxz"] == ("unknown", "ignored")


@pytest.mark.compiled
def test_findings_about_the_file_count(log: EventLog) -> None:
    bad = Finding(severity="error", code="input-missing", text="imu0 is not there")
    run = fuse(log, FuseConfig(local=False), remarks=(bad,))
    assert bad.text in {f.text for f in run.findings}
    assert exit_code(run) is ExitCode.FAILED_CHECK


def test_of_two_filters_the_one_in_the_map_is_taken(tmp_path: Path, log: EventLog) -> None:
    local = under(FLAT + "map_frame: map\nodom_frame: odom\nworld_frame: odom\n", "ekf_odom", "ros__parameters")
    whole = under("map_frame: map\nworld_frame: map\n" + FLAT.replace("frequency: 10", "frequency: 4"), "ekf_map",
                  "ros__parameters")  # fmt: skip
    navsat = under("magnetic_declination_radians: 0.1\nyaw_offset: 0.0", "navsat_transform", "ros__parameters")
    done = translated(tmp_path, local + whole + navsat, log)
    assert done.config.output_period_s == 0.25
    assert {"ekf_odom", "navsat_transform"} <= {r.flag for r in done.rows if not r.used}


def test_process_noise_is_theirs(tmp_path: Path, log: EventLog) -> None:
    noise = [0.01 * (k + 1) for k in range(15)]
    text = FLAT.replace("two_d_mode: true", f"process_noise_covariance: {np.diag(noise).ravel().tolist()}")
    assert translated(tmp_path, text, log).config.process_noise == pytest.approx(noise)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (FLAT.replace(f"odom0_config: [{T}, {T}, ", "odom0_config: ["), "ekf.yaml:8: odom0_config: is not fifteen"),
        (FLAT.replace("odom0: /wheels", "odom0: 7"), "ekf.yaml:7: odom0: is no topic"),
        (FLAT.replace("threshold: 3.0", "threshold: -1"), "odom0_twist_rejection_threshold: is no Mahalanobis"),
        (FLAT.replace("frequency: 10", "frequency: .inf"), "frequency: inf is no rate"),
        (FLAT.replace("/wheels", "/a").replace("/imu\n", "/b\n"), "none of its inputs (/a, /b, /amcl_pose) is in"),
        (FLAT.replace("odom0: /wheels\n", "").replace("imu0: /imu\n", "").replace("pose0: /amcl_pose\n", ""),
         "names no input"),
        (FLAT + "process_noise_covariance: [1, 2]\n", "process_noise_covariance: is not 15 or 225 numbers"),
    ],
)  # fmt: skip
def test_faults_are_named(tmp_path: Path, log: EventLog, text: str, said: str) -> None:
    with pytest.raises(ConfigError) as e:
        translated(tmp_path, text, log)
    assert said in str(e.value)


def test_others_are_not_taken_for_it(tmp_path: Path) -> None:
    own = tmp_path / "own.yaml"
    own.write_text("sources: {imu: {gate: 1.0}}\nodometry: 3\n", encoding="utf-8")
    assert read_upstream(own) is None
    (tmp_path / "ekf.yaml").write_text(FLAT, encoding="utf-8")
    with pytest.raises(ConfigError, match="is a configuration of robot_localization"):
        load_config(tmp_path / "ekf.yaml")


def test_rows_switch_columns_off(log: EventLog) -> None:
    name = only(log, Kind.TWIST)
    run = fuse(log, FuseConfig.model_validate({"sources": {name: {"rows": "000000"}}, "local": False}))
    assert next(a for a in run.accounts if a.source == name).role == "not used: all its rows are switched off"


@pytest.mark.compiled
def test_husky_ends_where_the_preset_does(recordings: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = recording(recordings / HUSKY)
    (tmp_path / "ekf.yaml").write_text(HUSKY_LIKE, encoding="utf-8")
    up = read_upstream(tmp_path / "ekf.yaml")
    assert up is not None
    mounts = {k: v.model_dump() for k, v in HUSKY_MOUNT.items()}

    def end(run: Run) -> np.ndarray:
        return run.fused.pose.p[-1, :2]

    theirs = end(fuse(log, translate(up, log, {"mounts": mounts}).config))
    preset = end(fuse(log, FuseConfig(preset="robot_localization", mounts=HUSKY_MOUNT, local=False)))
    assert np.linalg.norm(theirs - UPSTREAM_END) < 1.05
    assert np.linalg.norm(theirs - preset) < 0.02
    args = [str(recordings / HUSKY), "-c", str(tmp_path / "ekf.yaml"), "--end", "20", "--no-report"]
    code = main(["fuse", *args, "-o", str(tmp_path / "run")])
    out = capsys.readouterr().out
    assert code in (0, 1)
    assert "imu0_remove_gravitational_acceleration" in out
    assert "gravity is part of the model" in out
    assert (tmp_path / "run" / "config.yaml").is_file()
