"""Logs with damaged stamps through the whole job: the span stays, and the verdict agrees with the shares."""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scoring import codes, said

from damage import DAMAGE, DAY, HOUR, SECOND, damaged
from outrider.data import EventLog, Fix, Outcome, Run, Verdict
from outrider.errors import ExitCode
from outrider.io.record import write_recording
from outrider.io.registry import read_log
from outrider.sim import wheeled_log
from outrider.workflows.fuse import fuse
from outrider.workflows.summary import exit_code, figures, summarise

pytestmark = pytest.mark.compiled


@cache
def sound() -> EventLog:
    return wheeled_log(11, 20.0, rate_hz=20.0, exact=True)[0]


@cache
def usual() -> Run:
    return fuse(sound())


def lost(run: Run, source: str) -> int:
    """Records refused for their stamps."""
    of = [a.by_verdict for a in run.accounts if a.source.split(" (")[0] == source and "at rest" not in a.source]
    return sum(v.get(Verdict.BAD_STAMP, 0) + v.get(Verdict.ASTRAY, 0) for v in of)


@pytest.mark.parametrize("arrival_too", [True, False])
@pytest.mark.parametrize("which", ["imu", "wheels", "gnss"])
@pytest.mark.parametrize("damage", DAMAGE)
def test_neither_span_nor_positions_follow_damaged_stamps(damage, which, arrival_too):
    s = sound().streams[which]
    spoilt = damaged(s, damage, np.random.default_rng(5), arrival_too=arrival_too)
    run = fuse(sound().with_streams(spoilt))
    assert run.duration == pytest.approx(usual().duration, abs=0.5)
    assert (run.fused.t[-1] - run.fused.t[0]) * 1e-9 < 21.0
    assert np.linalg.norm(run.fused.pose.p[-1] - usual().fused.pose.p[-1]) < 6.0
    assert {"stamps-refused", "other-clock"} & codes(run)
    whole = damage == "since_power_on"
    assert exit_code(run) is (ExitCode.FAILED_CHECK if whole else ExitCode.OK)
    if not whole:
        assert lost(run, which) >= int((np.abs(spoilt.t - s.t) > 130 * SECOND).sum()) > 0
        assert f"of {len(s)} records" in said(run, "stamps-refused").text


@pytest.mark.parametrize("table", [False, True])
def test_wrong_header_stamps_in_files(tmp_path: Path, table: bool):
    """As MCAP, where the recorder's own time is right, and as CSV, where there is none."""
    rng = np.random.default_rng(2)
    wheels = sound().streams["wheels"]
    t = np.where(rng.random(len(wheels)) < 0.05, wheels.t + HOUR, wheels.t)
    log = replace(sound(), mounts={}).with_streams(replace(wheels, t=t))
    if table:
        rows = [f"{a},{b!r},{c!r}" for a, b, c in zip(t, wheels.z[:, 0].tolist(), wheels.z[:, 5].tolist(), strict=True)]
        (tmp_path / "log.csv").write_text("t,v,w\n" + "\n".join(rows) + "\n")
        (tmp_path / "map.yaml").write_text(
            "time: {column: t, unit: ns}\nstreams:\n  wheels:\n    kind: twist\n    columns: {v_x: v, w_z: w}\n"
        )
        read = read_log(tmp_path / "log.csv", mapping=tmp_path / "map.yaml")
    else:
        write_recording(log, tmp_path / "log.mcap")
        read = read_log(tmp_path / "log.mcap")
    run = fuse(read)
    name = next(n for n in read.streams if "wheels" in n)
    assert lost(run, name) == (t != wheels.t).sum() > 0
    assert run.duration < 20.5


@pytest.mark.parametrize("away", [120 * SECOND, HOUR, 9000 * DAY])
def test_a_night_in_between_is_told_and_not_counted(away):
    half = sound().span[0] + 10 * SECOND
    moved = [
        replace(s, t=s.t + np.where(s.t > half, away, 0), t_arrival=s.t_arrival + np.where(s.t > half, away, 0))
        for s in sound()
    ]
    run = fuse(sound().with_streams(*moved))
    assert run.duration == pytest.approx(usual().duration, abs=0.5)
    assert f"{away // SECOND} s from t = 10 s" in said(run, "silence").text
    assert not any(lost(run, a.source) for a in run.accounts)
    assert run.valid_shares[0] > 0.95
    assert run.fused.pose.length < 1.2 * usual().fused.pose.length
    assert exit_code(run) is ExitCode.OK


def test_what_is_known_to_kilometres_is_not_credible():
    """Inertial records alone for minutes, after a fix: the position is anywhere."""
    log = sound()
    imu = log.streams["imu"]
    gnss = log.streams["gnss"].select(slice(0, 50))
    n = 40
    later = np.concatenate([imu.t + k * (imu.t[-1] - imu.t[0] + SECOND // 20) for k in range(n)])
    long = replace(imu, t=later, t_arrival=later, z=np.tile(imu.z, (n, 1)), var=np.tile(imu.var, (n, 1)))
    run = fuse(replace(log, streams={"imu": long, "gnss": gnss}))
    assert run.outcome is Outcome.NOT_CREDIBLE
    assert exit_code(run) is ExitCode.FAILED_CHECK
    assert "position" in said(run, "not-credible").text


def test_shares_duration_and_pace_are_of_one_span():
    run = usual()
    f = figures(run)
    assert f["duration_s"] == run.duration == pytest.approx((run.fused.t[-1] - run.start) * 1e-9)
    assert f["times_real_time"] == pytest.approx(run.duration / run.wall_seconds)
    late = replace(run, start=run.start - 10 * SECOND)
    assert late.valid_shares[0] == pytest.approx(run.valid_shares[0] * run.duration / (run.duration + 10.0))


def test_the_sentence_agrees_with_the_shares():
    log = sound()
    gnss = log.streams["gnss"]
    late = gnss.select(gnss.t > log.span[0] + 8 * SECOND)
    run = fuse(log.with_streams(late))
    assert run.valid_shares[0] < 0.7
    assert run.outcome is not Outcome.OK
    assert usual().outcome is not Outcome.OK or min(usual().valid_shares[::2]) >= 0.99


def test_fix_types_nobody_knows_are_counted():
    s = sound().streams["gnss"]
    fix = s.extra["fix"].copy()
    fix[[3, 7]], fix[9] = (99.0, 2.5), Fix.NONE.value
    run = fuse(sound().with_streams(replace(s, extra={**s.extra, "fix": fix})))
    accounts = [a for a in run.accounts if a.source.startswith("gnss")]
    assert sum(a.received for a in accounts) == len(s)
    assert sum(a.by_verdict.get(Verdict.UNKNOWN_FIX, 0) for a in accounts) == 2
    assert sum(a.by_verdict.get(Verdict.NO_FIX, 0) for a in accounts) == 1


def test_compiling_is_told_apart():
    document = summarise(replace(usual(), wall_seconds=2.0, compile_seconds=30.0))
    assert document["wall_s"] == 2.0 and document["compile_s"] == 30.0
    assert document["figures"]["times_real_time"] == pytest.approx(usual().duration / 2.0)
    json.dumps(document["figures"])


def test_noise_does_not_add_up_to_distance():
    """A robot at rest goes nowhere, and a straight way is as long as it is, however shaky the estimate."""
    pose = usual().fused.pose
    n = len(pose)
    rng = np.random.default_rng(0)
    P = np.zeros((n, 6, 6))
    P[:, 0, 0] = P[:, 1, 1] = 0.3**2
    jitter = np.column_stack([0.05 * rng.standard_normal((n, 2)), np.zeros(n)])
    at_rest = replace(pose, p=jitter, P=P)
    straight = replace(pose, p=jitter + np.linspace(0.0, 50.0, n)[:, None] * [0.6, 0.8, 0.0], P=P)
    assert at_rest.length == 0.0
    assert straight.length == pytest.approx(50.0, rel=0.03)
    assert np.linalg.norm(np.diff(straight.p, axis=0), axis=1).sum() > 55.0
