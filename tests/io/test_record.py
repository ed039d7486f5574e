"""A log written as a recording is the same log when it is read back."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from outrider.data import EventLog, Fix, Kind, Stream, stream
from outrider.errors import DataError, OutputExistsError
from outrider.io._ros_messages import Block, joint_state
from outrider.io._ros_record import WRITERS
from outrider.io.record import write_recording
from outrider.io.registry import read_log
from outrider.sim import demo_log, wheeled_log


def test_round_trip(tmp_path: Path) -> None:
    log, _ = wheeled_log(3, 5.0, rate_hz=20.0)
    fix = np.resize([f.value for f in Fix if f is not Fix.UNKNOWN], len(log.streams["gnss"])).astype(float)
    gnss = replace(log.streams["gnss"], extra={**log.streams["gnss"].extra, "fix": fix})
    log = log.with_streams(gnss)
    path = tmp_path / "log.mcap"
    write_recording(log, path)
    back = read_log(path)
    assert set(back.streams) == {"/imu", "/imu#attitude", "/wheels", "/gnss"}
    for ours, theirs in (("imu", "/imu"), ("imu_attitude", "/imu#attitude"), ("wheels", "/wheels"), ("gnss", "/gnss")):
        a, b = log.streams[ours], back.streams[theirs]
        assert a.kind is b.kind and a.frame == b.frame
        assert a.t.tolist() == b.t.tolist()
        np.testing.assert_allclose(b.z, a.z, rtol=1e-12, atol=1e-15)
        known = np.isfinite(a.var)
        np.testing.assert_allclose(b.var[known], a.var[known], rtol=1e-9)
    got = back.streams["/gnss"]
    assert got.t_arrival.tolist() == gnss.t_arrival.tolist()
    for name in ("fix", "satellites", "hdop", "hacc"):
        np.testing.assert_allclose(got.extra[name], gnss.extra[name])
    for frame, T in log.mounts.items():
        np.testing.assert_allclose(back.mounts[frame], T, atol=1e-12)
    with pytest.raises(OutputExistsError):
        write_recording(log, path)


def every_kind() -> dict[str, Stream]:
    """A stream of each kind that can be recorded, twelve records a tenth of a second apart, received 3 ms late."""
    rng, n = np.random.default_rng(5), 12
    t = 1_750_000_000_000_000_000 + 100_000_000 * np.arange(n)
    wide = {Kind.WHEELS: 4, Kind.SCAN: 31}
    turned = {Kind.ATTITUDE: 3, Kind.POSE: 6, Kind.RELATIVE_POSE: 6}
    silent = {Kind.ACKERMANN, Kind.WHEELS, Kind.SCAN, Kind.ESTIMATE}
    names = {Kind.GNSS_VELOCITY: "gnss_velocity", Kind.ACKERMANN: "steering", Kind.COMMAND: "cmd_vel"}
    made: dict[str, Stream] = {}
    for kind in WRITERS:
        z = rng.normal(0.0, 1.0, (n, wide.get(kind, len(kind.columns))))
        for k in [k for k, column in enumerate(kind.columns) if column == "qx"]:
            z[:, k : k + 4] /= np.linalg.norm(z[:, k : k + 4], axis=1, keepdims=True)
        z = np.abs(z) if kind in (Kind.RANGE, Kind.RANGE_FINDER, Kind.SCAN) else z
        var = None if kind in silent else rng.uniform(0.1, 2.0, (n, turned.get(kind, z.shape[1])))
        if var is not None and kind is Kind.RANGE:
            var[:, 0] = np.nan
        given = {"angle_min": -1.5, "angle_step": 0.1, "range_max": 30.0} if kind is Kind.SCAN else {}
        if kind is Kind.SCAN:
            z[:, 3] = np.inf
        extra = {name: np.full(n, value) for name, value in given.items()}
        name = f"ugv/{names.get(kind, kind.value)}"
        frame = f"ugv/{kind.value}_link"
        made[name] = stream(name, kind, t, z, var=var, t_arrival=t + 3_000_000, robot="ugv", frame=frame, extra=extra)
    return made


def test_every_kind_of_record_comes_back(tmp_path: Path) -> None:
    log = EventLog(streams=every_kind())
    write_recording(log, tmp_path / "log.mcap")
    asked = read_log(tmp_path / "log.mcap", topics=[f"/{name}" for name in log.streams])
    back = {s.kind: s for s in asked}
    assert Kind.SCAN not in {s.kind for s in read_log(tmp_path / "log.mcap")}  # a lidar's scans: only when asked for
    assert set(back) == set(WRITERS) - {Kind.COMMAND}  # a command is no measurement
    for s in log:
        if s.kind is Kind.COMMAND:
            continue
        ours = back[s.kind]
        assert ours.t.tolist() == s.t.tolist() and ours.t_arrival.tolist() == s.t_arrival.tolist()
        coarse = s.kind in (Kind.ACKERMANN, Kind.SCAN, Kind.RANGE_FINDER)  # float32 messages
        np.testing.assert_allclose(ours.z, s.z, rtol=1e-6 if coarse else 1e-12, atol=1e-9, err_msg=s.name)
        known = np.isfinite(s.var)
        np.testing.assert_allclose(ours.var[known], s.var[known], rtol=1e-6, err_msg=s.name)
        assert ours.frame == (s.frame if s.kind is not Kind.ESTIMATE else "map")
    scan = back[Kind.SCAN]
    np.testing.assert_allclose([scan.extra["angle_min"][0], scan.extra["angle_step"][0]], [-1.5, 0.1], rtol=1e-6)


def test_joints_that_are_no_rims_are_left_alone(tmp_path: Path) -> None:
    b = Block({"name": np.array([["left", "right"]]), "velocity": np.ones((1, 2))}, "/joint_states", "")
    ragged = Block({"name": np.array([["a"], ["b", "c"]], dtype=object), "velocity": np.ones((2, 1))}, "/j", "")
    assert joint_state(b) == () == joint_state(ragged)


def test_what_cannot_be_said_is_refused(tmp_path: Path) -> None:
    flow = stream("flow", Kind.FLOW, np.arange(3), np.zeros((3, 2)))
    with pytest.raises(DataError, match="flow"):
        write_recording(EventLog(streams={"flow": flow}), tmp_path / "log.mcap")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.evidence
def test_the_demo_survives_recording(tmp_path: Path) -> None:
    log, _ = demo_log(1)
    write_recording(log, tmp_path / "demo.mcap")
    assert len(read_log(tmp_path / "demo.mcap")) == len(log)
