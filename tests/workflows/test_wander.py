"""Wheels measured by the whole path of a receiver whose error wanders."""

from dataclasses import replace
from pathlib import Path as File

import numpy as np
import pytest

from calibration_logs import wandering, wheeled
from outrider.data import EventLog, Finding
from outrider.workflows.calibration.calibrate import by_whole_path, patient
from outrider.workflows.calibration.row import VAGUE, Row
from outrider.workflows.config import FuseConfig
from outrider.workflows.doctor.examine import examine, paths, whole_paths
from outrider.workflows.doctor.signals import Path, Signal
from outrider.workflows.doctor.wander import Whole, scale_by_path, wanders
from outrider.workflows.doctor.whole_path import Values, pieces
from outrider.workflows.fuse import fuse
from recorded import HUSKY, recording

SPEED = Row(source="wheels", what="speed scale", unit="", told=1.0, verdict=VAGUE)


def found(log: EventLog) -> list[Whole]:
    return [one for _, _, one in whole_paths(patient(log, FuseConfig()))]


def gain_of(said: Finding) -> float:
    return float(said.fix.split("speed_gain: ")[1].rstrip("}"))


@pytest.mark.compiled
def test_the_interval_holds_the_scale() -> None:
    """Twelve drives; fifty in the evidence."""
    off = []
    for seed in range(1, 13):
        log, true = wandering(seed)
        (one,) = found(log)
        off.append((one.scale - true["wheels", "speed scale"]) / one.sd)
    assert np.sum(np.abs(off) > 2.2) <= 2 and 0.5 < np.std(off) < 1.7, off


@pytest.mark.compiled
def test_rows_of_calibration_and_findings_say_so() -> None:
    log, true = wandering(3, 250.0)
    (row,) = by_whole_path([SPEED], patient(log, FuseConfig()))
    assert row.found and abs(row.value - true["wheels", "speed scale"]) < row.half < 0.05
    told = patient(log, FuseConfig.model_validate({"sources": {"wheels": {"speed_gain": row.value}}}))
    (again,) = by_whole_path([replace(SPEED, told=row.value)], told)
    assert not again.differs and again.value == pytest.approx(row.value, rel=2e-3)
    (said,) = (f for f in examine(log, FuseConfig()).findings if f.code == "wheel-scale")
    assert (
        gain_of(said) == pytest.approx(row.value, abs=2e-3) and said.evidence is not None
    )  # wheels' clock is mended before
    points, line = said.evidence.curves
    assert np.mean(np.hypot(points.x - line.x, points.y - line.y)) < 5.0  # m: the receiver's error
    assert [f.text for f in fuse(log, FuseConfig()).findings if f.code == "wheel-scale"] == [said.text]


@pytest.mark.compiled
def test_white_noise_is_left_to_the_filter() -> None:
    log = wheeled(1, 70.0)[0]
    p = patient(log, FuseConfig())
    (way,) = paths(p)
    stated = np.sqrt(p.log.streams["gnss"].var[:, 0])
    assert not wanders(way, stated) and wanders(way, 20.0 * stated) and not wanders(way, np.full(len(stated), np.nan))
    assert found(log) == [] and by_whole_path([SPEED], p) == [SPEED]


def reckoned(duration: float, hole: tuple[float, float] = (0.0, 0.0)) -> tuple[Path, Signal, Signal]:
    """Winding eastward without noise, by wheels that measure 4 % too long and a gyro with a bias."""
    t = np.arange(0.0, duration, 0.1)
    psi, turn = 1.2 * np.sin(t / 9.0), 1.2 / 9.0 * np.cos(t / 9.0)
    v = np.column_stack([np.cos(psi), np.sin(psi), np.zeros(len(t))])
    steps = 0.05 * (v[1:] + v[:-1])
    at = np.arange(0, len(t), 4)
    way = Path("gnss", t[at], np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])[at])
    heard = (t < hole[0]) | (t >= hole[1])
    speed = Signal("wheels", t[heard], np.full(int(heard.sum()), 1.0 / 0.96))
    return way, speed, Signal("imu", t, turn + 0.01)


@pytest.mark.parametrize(("duration", "hole", "parts"), [(200.0, (0.0, 0.0), 1), (200.0, (80.0, 90.0), 2),
                                                         (1300.0, (0.0, 0.0), 3)])  # fmt: skip
def test_a_path_without_noise_tells_the_scale_through_silences(
    duration: float, hole: tuple[float, float], parts: int
) -> None:
    way, speed, turn = reckoned(duration, hole)
    assert sum(1 for _ in pieces(way, speed, turn)) == parts
    one = scale_by_path(way, speed, turn)
    assert one is not None and one.scale == pytest.approx(0.96, abs=max(one.half, 2e-3)) and one.half < 0.02


def test_a_minute_is_asked_for_and_wheels_that_tell_nothing_tell_nothing() -> None:
    assert scale_by_path(*reckoned(50.0)) is None
    way, speed, turn = reckoned(200.0)
    assert scale_by_path(way, Signal("wheels", speed.t, 0.0 * speed.y), turn) is None


def test_slopes_of_the_path_are_its_differences() -> None:
    (piece,) = pieces(*reckoned(120.0))
    at = Values(0.9 * np.exp(0.3j), 0.4 - 0.2j, 0.006, 1.01)
    slopes = piece.residual(at)[1]
    for k in range(2, 8):
        x = np.zeros(8)
        x[k] = 1e-5
        change = (piece.residual(at.plus(-x))[0] - piece.residual(at.plus(x))[0]) / 2e-5
        np.testing.assert_allclose(slopes[:, k], change, atol=1e-4 * max(1.0, np.abs(change).max()))


@pytest.mark.compiled
def test_the_husky_s_wheels_measure_what_a_fit_of_the_whole_path_says(recordings: File) -> None:
    """0.967 in the notes beside the recording: one similarity of the path by gyro and wheels to all fixes."""
    log = recording(recordings / HUSKY)
    (said,) = (f for f in fuse(log, FuseConfig()).findings if f.code == "wheel-scale")
    assert gain_of(said) == pytest.approx(0.967, rel=0.01)
