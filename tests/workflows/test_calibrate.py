"""Calibration of generated logs: what is told with an interval holds the truth, what shows in nothing is said to."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calibration_logs import True_, flown, parked, steered, straight, tracked, tumbled, wheeled
from outrider.__main__ import main
from outrider.data import EventLog
from outrider.io.record import write_recording
from outrider.io.registry import read_log
from outrider.sim.logs import drone_log, wheeled_log
from outrider.workflows.bench import Bench
from outrider.workflows.calibration import Calibration, calibrate
from outrider.workflows.calibration.calibrate import patient
from outrider.workflows.calibration.comparison import parameters
from outrider.workflows.calibration.fit import Fit, fit
from outrider.workflows.calibration.iron import iron_rows
from outrider.workflows.calibration.noise import loudness
from outrider.workflows.calibration.rolling import rolling_rows
from outrider.workflows.calibration.tune import tune
from outrider.workflows.config import FuseConfig
from outrider.workflows.discover import scaled
from outrider.workflows.fuse import fuse
from outrider.workflows.parameters import Noise, Parameter, What
from outrider.workflows.sandwich import sandwich
from outrider.workflows.settings import load_config

pytestmark = pytest.mark.compiled


def off(done: Calibration, true: True_) -> dict[tuple[str, str], float]:
    """Errors in half widths of the intervals, of what was found."""
    rows = {(r.source, r.what): r for r in done.rows}
    assert set(true) <= set(rows)
    return {key: (rows[key].value - x) / rows[key].half for key, x in true.items() if rows[key].found}


@pytest.mark.parametrize(("make", "seed"), [(wheeled, 3), (flown, 1)])
def test_what_is_found_is_so(make: Callable[[int, float], tuple[EventLog, True_]], seed: int) -> None:
    log, true = make(seed, 70.0)
    found = off(calibrate(log, FuseConfig()), true)
    assert len(found) == len(true)
    errors = np.abs(list(found.values()))
    assert np.sum(errors > 1.0) <= 1, found  # 95 % intervals: one of ten may miss
    assert errors.max() < 2.0, found


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("make", [steered, tracked])
def test_wheels_tell_their_clock_and_their_geometry(
    make: Callable[[int, float], tuple[EventLog, True_]], seed: int
) -> None:
    log, true = make(seed, 60.0)
    rows = {(r.source, r.what): r for r in rolling_rows(patient(log, FuseConfig()), FuseConfig())}
    for key in set(true) & set(rows):  # a track goes with the scale of the wheels, up to 5 %, which positions tell
        slack = 0.05 * true[key] if key[1] == "wheel track" else 0.0
        assert abs(rows[key].value - true[key]) < 1.5 * rows[key].half + slack, key
    for what in ("steering zero", "wheel base"):
        assert (("steering", what) in rows) == ("steering" in log.streams)
    assert ("encoders" in log.streams) == (("encoders", "wheel track") in rows)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_iron_is_found_by_turning_about_and_taken_off(seed: int) -> None:
    log, true = tumbled(seed, 60.0)
    done = calibrate(log, FuseConfig())
    found = off(done, true)
    assert len(found) == len(true) == 8 and np.max(np.abs(list(found.values()))) < 2.0, found
    mended = scaled(log.streams["mag"], done.config).z
    size = np.linalg.norm(mended, axis=1)
    assert np.std(size) / np.mean(size) < 0.015  # noise is 0.01; with iron some 0.2
    assert done.complete and not any(r.differs for r in calibrate(log, done.config).rows)


def test_iron_of_a_robot_that_stays_level_has_no_vertical_part_and_a_flight_tells_none() -> None:
    log, true = steered(1, 60.0)
    rows = {r.what: r for r in iron_rows(patient(log, FuseConfig()), FuseConfig(), ground=True)}
    for (_, what), value in true.items():
        if "iron" in what:
            assert abs(rows[what].value - value) < 1.5 * rows[what].half, what
    assert all(r.verdict.startswith("not observable") == ("up" in what) for what, r in rows.items())
    flight = drone_log(1, 60.0)[0]
    assert not any(r.found for r in iron_rows(patient(flight, FuseConfig()), FuseConfig(), ground=False))


def test_what_is_found_of_steering_is_fused(tmp_path: Path) -> None:
    log, true = steered(2, 60.0)
    keys = {"wheel_base_m": true["steering", "wheel base"], "steering_zero_deg": true["steering", "steering zero"]}
    blind = replace(log, streams={n: s for n, s in log.streams.items() if n != "imu"})
    runs = [fuse(blind, FuseConfig.model_validate({"diagnose": False, "sources": {"steering": k}})) for k in (
        keys, {"wheel_base_m": keys["wheel_base_m"]}
    )]  # fmt: skip
    nis = [float(np.nanmean(r.innovations["gnss"].nis)) for r in runs]
    assert nis[0] < 0.7 * nis[1]  # without the zero the steering turns the path


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
    write_recording(wheeled(3, 60.0)[0], tmp_path / "drive.mcap")
    config = tmp_path / "calibrated.yaml"
    assert main(["calibrate", str(tmp_path / "drive.mcap"), "-o", str(config)]) == 0
    assert "lever arm, forward" in capsys.readouterr().out
    again = calibrate(read_log(tmp_path / "drive.mcap"), load_config(config))
    assert sum(r.differs for r in again.rows) <= 1, [r for r in again.rows if r.differs]


def boasting(boast: float) -> EventLog:
    """A drive whose receiver errs by 0.1 m more than it would, and claims so many times less."""
    log = wheeled_log(1, 60.0)[0]
    s = log.streams["gnss"]
    noise = np.random.default_rng(1).normal(0.0, 0.1, (len(s), 2)) / 6.37e6
    noise[:, 1] /= np.cos(s.z[0, 0])
    z = s.z + np.column_stack([noise, np.zeros(len(s))])
    told = np.full(len(s), 0.1 / boast)
    noisy = replace(s, z=z, var=np.full(s.var.shape, told[0] ** 2), extra={**s.extra, "hacc": told})
    return log.with_streams(noisy)


@pytest.mark.parametrize("boast", [0.5, 1.0, 4.0])
def test_noise_is_weighed_by_steps_alone(boast: float) -> None:
    """What `calibrate` does before it tells intervals: to the finest step, 1.2, without a simplex."""
    bench = Bench(boasting(boast), FuseConfig())
    found = loudness(bench, [Noise("gnss")], {}, 60.0)
    assert np.log(found[Noise("gnss")]) == pytest.approx(np.log(boast), abs=np.log(1.2))


@pytest.mark.parametrize("boast", [1.0, 4.0])
def test_a_receiver_that_boasts_is_tuned_and_an_honest_one_is_left_alone(boast: float) -> None:
    found, cfg = tune(boasting(boast), FuseConfig(), lambda _, __: None)
    factors = {c.name: c.factor for c in found.changes}
    assert factors.get("gnss", 1.0) == pytest.approx(boast, rel=0.2)
    assert found.after.nis["gnss"] == pytest.approx(1.0, abs=0.25)
    assert (found.before.nis["gnss"] > 5.0) == (boast > 1.0)
    assert found.after.likelihood > found.before.likelihood
    assert cfg.sources["gnss"].scale == pytest.approx(factors["gnss"], rel=0.01) if "gnss" in factors else True


def test_what_was_found_before_makes_the_rest_as_unsure_as_its_errors_move_it() -> None:
    """By fits whose wheels are stamped otherwise, which is another way than the slopes of one fit."""
    log, _ = wheeled(3, 50.0)
    late = 0.02

    def fitted(delay: float, unsure: float) -> Fit:
        cfg = FuseConfig.model_validate({"sources": {"wheels": {"delay_s": delay}}})
        bench = Bench(log, cfg, frozen=True)
        return fit(bench, parameters(bench), held={Parameter(What.DELAY, ("wheels",)): unsure})

    sure, unsure, moved = fitted(0.0, 0.0), fitted(0.0, late), fitted(late, 0.0)
    for p, x in sure.value.items():
        added = np.sqrt(unsure.sd[p] ** 2 - sure.sd[p] ** 2)
        assert abs(added - abs(moved.value[p] - x)) < 0.1 * added + 0.01 * sure.sd[p], p


def test_correlated_noise_widens_an_interval() -> None:
    rng = np.random.default_rng(1)
    t, M = np.arange(0.0, 500.0, 0.5), np.ones((1000, 1))
    means, told = [], []
    for _ in range(300):
        white = rng.standard_normal(1000 + 7)
        e = np.convolve(white, np.ones(8) / 8.0, "valid")  # correlated over 4 s
        means.append(float(e.mean()))
        told.append(float(sandwich(M.T @ M, M * (e - e.mean())[:, None], t, float(np.var(e)))[0, 0]))
    assert 0.6 < np.mean(told) / np.var(means) < 1.2  # a triangular window sees some two thirds of it and more
