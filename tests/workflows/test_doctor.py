"""What is wrong with a log: each fault put into a clean one is named and mended; clean ones are left alone."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from outrider.core.attitudes import quats_to_matrices, rpy_to_quats
from outrider.data import EventLog, Verdict
from outrider.sim.logs import drone_log, wheeled_log
from outrider.typing import Floats
from outrider.workflows.config import FuseConfig
from outrider.workflows.doctor import examine, prescribed
from outrider.workflows.doctor.examine import course_side
from outrider.workflows.doctor.lags import lag_between
from outrider.workflows.doctor.mounting import angle_between, right_angled
from outrider.workflows.doctor.signals import Path as Way
from outrider.workflows.doctor.signals import Signal, signal
from outrider.workflows.doctor.visit import visit
from recorded import FIXES, HUSKY, recording

pytestmark = pytest.mark.compiled


def names(log: EventLog) -> tuple[str, str]:
    imu = next(s.name for s in log if s.kind.name == "IMU")
    return imu, next((s.name for s in log if s.kind.name == "TWIST"), "")


def changed(log: EventLog, source: str, f: Callable[[Floats], Floats]) -> EventLog:
    s = log.streams[source]
    return log.with_streams(replace(s, z=f(s.z.copy())))


def times(log: EventLog, source: str, columns: slice, gain: float) -> EventLog:
    def f(z: Floats) -> Floats:
        z[:, columns] *= gain
        return z

    return changed(log, source, f)


def turned(log: EventLog, source: str, R: Floats) -> EventLog:
    """The IMU bolted on by R (body from sensor), which nobody wrote down."""

    def f(z: Floats) -> Floats:
        return np.hstack([z[:, :3] @ R, z[:, 3:] @ R])

    return replace(changed(log, source, f), mounts={})


def clean(seed: int) -> EventLog:
    return wheeled_log(seed, 150.0)[0]


@pytest.mark.parametrize("make", [wheeled_log, drone_log])
def test_clean_logs_are_left_alone(make: Callable[[int], tuple[EventLog, object]]) -> None:
    alarms = [e.findings for seed in range(20, 30) if (e := examine(make(seed)[0], FuseConfig())).findings]
    assert alarms == []


ROTATION, FORCE, SPEED, TURN = slice(0, 3), slice(3, 6), slice(0, 3), slice(5, 6)
FAULTS = {  # what is multiplied by what, and the key that undoes it
    "unit-g": ("imu", FORCE, 1 / 9.80665, "force_gain"),
    "unit-deg": ("imu", ROTATION, 180 / np.pi, "rate_gain"),
    "unit-kmh": ("wheels", SPEED, 3.6, "speed_gain"),
    "turn-sense": ("imu", ROTATION, -1.0, "rate_gain"),
    "turn-sense of gravity": ("imu", FORCE, -1.0, "force_gain"),
    "turn-sense of wheels": ("wheels", TURN, -1.0, "rate_gain"),
}


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("seed", [1, 2])
def test_a_wrong_unit_or_sense_is_named_and_mended(fault: str, seed: int) -> None:
    log = clean(seed)
    whose, columns, gain, key = FAULTS[fault]
    source = names(log)[whose == "wheels"]
    found = examine(times(log, source, columns, gain), FuseConfig())
    assert [f.code for f in found.findings] == [fault.split()[0]]
    assert found.prescribed["sources"][source][key] == pytest.approx(1 / gain, rel=1e-6)


@pytest.mark.parametrize("lag", [-0.4, 0.15, 0.5])
def test_a_clock_that_is_off_is_found(lag: float) -> None:
    log = clean(3)
    wheels = names(log)[1]
    s = log.streams[wheels]
    late = log.with_streams(replace(s, t=s.t + round(lag * 1e9), t_arrival=s.t_arrival + round(lag * 1e9)))
    found = examine(late, FuseConfig())
    assert [f.code for f in found.findings] == ["clock-offset"]
    assert found.prescribed["sources"][wheels]["delay_s"] == pytest.approx(lag, abs=0.03)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_mount_is_found_from_gravity_and_wheels(seed: int) -> None:
    log = clean(seed)
    imu, _ = names(log)
    R = right_angled()[5 + 6 * seed]
    found = examine(turned(log, imu, R), FuseConfig())
    rpy = np.radians(next(iter(found.prescribed["mounts"].values()))["rpy_deg"])
    assert angle_between(quats_to_matrices(rpy_to_quats(rpy)).reshape(3, 3), R) < 1e-6


def test_a_mount_at_no_right_angle_is_found() -> None:
    log = clean(4)
    imu, _ = names(log)
    R = quats_to_matrices(rpy_to_quats(np.radians([25.0, -15.0, 130.0]))).reshape(3, 3)
    found = examine(turned(log, imu, R), FuseConfig())
    rpy = np.radians(next(iter(found.prescribed["mounts"].values()))["rpy_deg"])
    assert angle_between(quats_to_matrices(rpy_to_quats(rpy)).reshape(3, 3), R) < np.radians(8.0)


def test_what_is_told_is_not_overruled() -> None:
    log = clean(1)
    imu, _ = names(log)
    spoilt = times(log, imu, slice(3, 6), 1 / 9.80665)
    told = FuseConfig.model_validate({"sources": {imu: {"force_gain": 9.8}}})
    cfg, _ = prescribed(spoilt, told)
    assert cfg.sources[imu].force_gain == 9.8
    assert prescribed(spoilt, FuseConfig.model_validate({"diagnose": False})) == (
        FuseConfig.model_validate({"diagnose": False}), ()
    )  # fmt: skip


def test_what_it_prescribes_is_a_configuration_that_gives_the_same_run() -> None:
    log = clean(2)
    imu, _ = names(log)
    spoilt = turned(log, imu, right_angled()[7])
    seen = visit(spoilt, FuseConfig())
    again = visit(spoilt, seen.config)
    assert np.array_equal(seen.run.fused.x, again.run.fused.x)
    assert {f.code for f in again.findings} >= {"alignment"} and "mount-found" not in {f.code for f in again.findings}


def test_the_husky_needs_nothing_typed_in(recordings: Path) -> None:
    log = recording(recordings / HUSKY)
    seen = visit(log, FuseConfig.model_validate({"withhold": {FIXES: 5}}))
    assert seen.config.mounts["imu_link"].rpy_deg == (90.0, 0.0, -90.0)
    assert {"mount-found", "heading-conflict", "clock-offset"} <= {f.code for f in seen.findings}
    unused = seen.run.innovations[FIXES]
    held = unused.verdict == Verdict.WITHHELD
    assert np.sqrt(np.mean(np.sum(unused.y[held] ** 2, axis=1))) < 1.26  # with the mount typed in: 1.25


def test_two_that_contradict_each_other_alike_are_named_and_neither_is_believed() -> None:
    log = clean(1)
    imu, wheels = names(log)
    blind = replace(log, streams={n: s for n, s in log.streams.items() if n in (imu, wheels)})
    found = examine(times(blind, imu, ROTATION, -1.0), FuseConfig())
    assert [(f.code, f.severity) for f in found.findings] == [("turn-sense", "error")]
    assert found.prescribed == {}


@pytest.mark.parametrize("mirrored", [True, False])
def test_without_a_gyro_the_course_alone_tells_mirrored_wheels(mirrored: bool) -> None:
    log = clean(1)
    imu, wheels = names(log)
    log = replace(log, streams={n: s for n, s in log.streams.items() if n != imu})
    found = examine(times(log, wheels, TURN, -1.0) if mirrored else log, FuseConfig())
    assert [(f.code, f.source) for f in found.findings] == [("turn-sense", wheels)] * mirrored
    assert not mirrored or found.prescribed["sources"][wheels]["rate_gain"] == -1.0


def test_positions_too_noisy_for_a_course_one_by_one_tell_it_on_average() -> None:
    t = np.arange(0.0, 240.0, 0.2)
    turn = np.where(t % 30 < 10, 0.3, -0.1)
    speed = np.where(t % 4 < 3, 1.5, 0.5)
    yaw = np.cumsum(turn) * 0.2
    p = np.column_stack([np.cumsum(speed * f(yaw)) * 0.2 for f in (np.cos, np.sin)] + [0.0 * t])
    way = Way("gps", t, p + np.random.default_rng(1).normal(0.0, 0.05, p.shape))
    assert [course_side(way, Signal("wheels", t, k * turn)) for k in (1.0, -1.0)] == [1.0, -1.0]


def test_accelerations_of_nothing_but_zeros_are_named() -> None:
    log = clean(1)
    seen = visit(times(log, names(log)[0], FORCE, 0.0), FuseConfig(local=False))
    assert "are all 0" in next(f.text for f in seen.findings if f.code == "no-gravity")


def test_a_mount_that_is_told_with_a_wrong_yaw_is_an_error_and_stays() -> None:
    log = clean(1)
    imu, _ = names(log)
    told = FuseConfig.model_validate({"sources": {imu: {"mount": {"rpy_deg": [0, 0, 90]}}}})
    cfg, found = prescribed(log, told)
    assert [(f.code, f.severity) for f in found] == [("mount-conflict", "error")]
    assert "90 deg off" in found[0].text and cfg == told


def wiggle(seed: int, lag: float, noise: float) -> tuple[Signal, Signal]:
    """One slow random motion as two sources tell it, the second `lag` s late, both with white noise."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 200.0, 0.05)
    waves = [(rng.uniform(0.05, 0.6), rng.uniform(0.0, 6.3), rng.normal()) for _ in range(12)]
    both = [sum(a * np.sin(6.283 * f * (t - late) + p) for f, p, a in waves) for late in (0.0, lag)]
    a, b = (signal(n, t, y + noise * rng.standard_normal(len(t))) for n, y in zip("ab", both, strict=True))
    assert a is not None and b is not None
    return a, b


def test_a_lag_is_as_good_as_it_says() -> None:
    found = [(lag, lag_between(*wiggle(k, lag, 2.0))) for k, lag in enumerate(np.linspace(-0.9, 0.9, 60))]
    score = np.array([(f.lag - lag) / f.sd for lag, f in found if f is not None])
    assert len(score) == 60
    assert 0.5 < np.mean(score**2) < 2.0  # chi-square of 60 lies in 0.67 to 1.39 in 95 %; the sd is a first-order one


def test_what_repeats_itself_tells_no_lag() -> None:
    t = np.arange(0.0, 200.0, 0.05)
    a, b = signal("a", t, np.sin(6.283 * t)), signal("b", t, np.sin(6.283 * (t - 0.2)))
    assert a is not None and b is not None and lag_between(a, b) is None


def test_a_mean_is_exact_over_any_window_and_nothing_across_a_gap() -> None:
    t = np.concatenate([np.arange(0.0, 10.0, 0.1), np.arange(20.0, 30.0, 0.1)])
    line = signal("s", t, 3.0 + 2.0 * t)
    assert line is not None
    assert line.mean(np.array([5.0, 25.03]), 1.7) == pytest.approx([13.0, 53.06], abs=1e-9)
    assert np.isnan(line.mean(np.array([9.5, 15.0, 20.2, 29.9]), 1.7)).all()
