"""Calibration of generated logs: what is told with an interval holds the truth, what shows in nothing is said to."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calibration_logs import True_, flown, parked, straight, wheeled
from outrider.__main__ import main
from outrider.data import EventLog
from outrider.io.record import write_recording
from outrider.io.registry import read_log
from outrider.sim.logs import wheeled_log
from outrider.workflows.calibration import Calibration, calibrate
from outrider.workflows.calibration.fit import sandwich
from outrider.workflows.calibration.tune import tune
from outrider.workflows.config import FuseConfig
from outrider.workflows.settings import load_config

pytestmark = pytest.mark.compiled


def off(done: Calibration, true: True_) -> dict[tuple[str, str], float]:
    """Errors in half widths of the intervals, of what was found."""
    rows = {(r.source, r.what): r for r in done.rows}
    assert set(true) <= set(rows)
    return {key: (rows[key].value - x) / rows[key].half for key, x in true.items() if rows[key].found}


@pytest.mark.parametrize(("make", "seed"), [(wheeled, 1), (wheeled, 2), (flown, 1)])
def test_what_is_found_is_so(make: Callable[[int], tuple[EventLog, True_]], seed: int) -> None:
    log, true = make(seed)
    found = off(calibrate(log, FuseConfig()), true)
    assert len(found) == len(true)
    errors = np.abs(list(found.values()))
    assert np.sum(errors > 1.0) <= 1, found  # 95 % intervals: one of ten may miss
    assert errors.max() < 2.0, found


def test_straight_on_tells_no_lever_across_and_no_scale_of_turns() -> None:
    done = calibrate(straight(1), FuseConfig())
    verdicts = {(r.source, r.what): r.verdict for r in done.rows}
    for key in (
        ("gnss", "lever arm, left"),
        ("imu", "turn rate scale"),
        ("wheels", "turn rate scale against the gyro"),
    ):
        assert verdicts[key].startswith("not observable"), verdicts
    speed = next(r for r in done.rows if r.what == "speed scale")
    assert speed.found and done.complete


def test_a_log_without_motion_is_named_and_nothing_is_invented(tmp_path: Path) -> None:
    done = calibrate(parked(1), FuseConfig())
    assert [f.code for f in done.findings] == ["no-motion"] and done.rows == () and not done.complete
    assert done.config.sources == {}
    write_recording(parked(1), tmp_path / "parked.mcap")
    assert main(["calibrate", str(tmp_path / "parked.mcap"), "--quiet"]) == 1


def test_the_command_writes_a_configuration_that_leaves_nothing_to_calibrate(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_recording(wheeled(3)[0], tmp_path / "drive.mcap")
    config = tmp_path / "calibrated.yaml"
    assert main(["calibrate", str(tmp_path / "drive.mcap"), "-o", str(config)]) == 0
    assert "lever arm, forward" in capsys.readouterr().out
    again = calibrate(read_log(tmp_path / "drive.mcap"), load_config(config))
    assert sum(r.differs for r in again.rows) <= 1, [r for r in again.rows if r.differs]


@pytest.mark.parametrize("boast", [1.0, 4.0])
def test_a_receiver_that_boasts_is_tuned_and_an_honest_one_is_left_alone(boast: float) -> None:
    log = wheeled_log(1, 120.0)[0]
    s = log.streams["gnss"]
    noise = np.random.default_rng(1).normal(0.0, 0.1, (len(s), 2)) / 6.37e6
    noise[:, 1] /= np.cos(s.z[0, 0])
    z = s.z + np.column_stack([noise, np.zeros(len(s))])
    told = np.full(len(s), 0.1 / boast)
    noisy = replace(s, z=z, var=np.full(s.var.shape, told[0] ** 2), extra={**s.extra, "hacc": told})
    found, cfg = tune(log.with_streams(noisy), FuseConfig(), lambda _, __: None)
    (gnss,) = (t for t in found if t.source == "gnss")
    assert gnss.scale == pytest.approx(boast, rel=0.2)
    assert gnss.after == pytest.approx(1.0, abs=0.25)
    assert (gnss.before > 8.0) == (boast > 1.0)
    assert ("gnss" in cfg.sources) == (boast > 1.0)


def test_correlated_noise_widens_an_interval() -> None:
    rng = np.random.default_rng(1)
    t, M = np.arange(0.0, 500.0, 0.5), np.ones((1000, 1))
    means, told = [], []
    for _ in range(300):
        white = rng.standard_normal(1000 + 7)
        e = np.convolve(white, np.ones(8) / 8.0, "valid")  # correlated over 4 s
        means.append(float(e.mean()))
        told.append(float(sandwich(M.T @ M, M * (e - e.mean())[:, None], t)[0, 0]))
    assert 0.6 < np.mean(told) / np.var(means) < 1.2  # a triangular window sees some two thirds of it and more
