"""A log written as a recording is the same log when it is read back."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from outrider.data import Fix, Kind
from outrider.errors import DataError, OutputExistsError
from outrider.io.record import write_recording
from outrider.io.registry import read_log
from outrider.sim import Baro, demo_log, wheeled_log


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


def test_what_cannot_be_said_is_refused(tmp_path: Path) -> None:
    log, _ = wheeled_log(1, 2.0, rate_hz=10.0, sensors=(Baro(),))
    assert log.of(Kind.BARO)
    with pytest.raises(DataError, match="baro"):
        write_recording(log, tmp_path / "log.mcap")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.evidence
def test_the_demo_survives_recording(tmp_path: Path) -> None:
    log, _ = demo_log(1)
    write_recording(log, tmp_path / "demo.mcap")
    assert len(read_log(tmp_path / "demo.mcap")) == len(log)
