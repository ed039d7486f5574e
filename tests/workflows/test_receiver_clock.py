"""Receivers stamped late or early against an IMU that drives the estimate: found where they are, and only there."""

from pathlib import Path

import numpy as np
import pytest

from calibration_logs import late
from outrider.data import EventLog, Run, Stream
from outrider.io.registry import read_log
from outrider.sim.logs import drone_log
from outrider.workflows.config import FuseConfig
from outrider.workflows.doctor import prescribed
from outrider.workflows.doctor.receiver import receiver_clock
from outrider.workflows.fuse import fuse
from recorded import FLIGHT

pytestmark = pytest.mark.compiled

IMU = """time: {column: time}
streams:
  imu:
    kind: IMU
    columns: {gyro_x: Gyr_X, gyro_y: Gyr_Y, gyro_z: Gyr_Z, accel_x: Acc_X, accel_y: Acc_Y, accel_z: Acc_Z}
    units: {gyro_x: deg/s, gyro_y: deg/s, gyro_z: deg/s}
"""
RTK = "time: {column: time}\nstreams: {rtk: {kind: POSITION, frame: ned, columns: {x: North, y: East, z: Down}}}\n"


@pytest.mark.parametrize(("seed", "delay"), [(1, 0.2), (2, -0.3)])
def test_a_receiver_with_another_clock_is_found_and_used(seed: int, delay: float) -> None:
    log = drone_log(seed, 60.0)[0]
    log = late(late(log, "gnss", delay), "gnss_velocity", delay)
    cfg, found = prescribed(log, FuseConfig())
    assert [f.code for f in found] == ["clock-offset"]
    assert cfg.sources["gnss"].delay_s == cfg.sources["gnss_velocity"].delay_s == pytest.approx(delay, abs=0.03)
    told = FuseConfig.model_validate({"sources": {"gnss": {"delay_s": 0.0}}})
    assert prescribed(log, told) == (told, ())


@pytest.mark.parametrize("seed", [20, 21])
def test_a_clock_that_is_right_is_left_alone(seed: int) -> None:
    assert receiver_clock(drone_log(seed, 60.0)[0], FuseConfig()) is None


def test_a_receiver_that_smooths_is_no_witness(recordings: Path) -> None:
    """Its positions fit to a quarter of what they claim, for their errors go on: no precision."""
    assert receiver_clock(read_log(recordings / FLIGHT), FuseConfig()) is None


def quadrotor(recordings: Path, room: Path, path: str, seed: int) -> tuple[EventLog, Stream]:
    """IMU and every tenth RTK position, with 5 cm of noise; all positions for the score."""
    folder = recordings / "ansfl-quad" / path
    (room / "imu.yaml").write_text(IMU)
    (room / "rtk.yaml").write_text(RTK)
    imu = read_log(folder / "IMU_1.csv", mapping=room / "imu.yaml").streams["imu"]
    truth = read_log(folder / "GT.csv", mapping=room / "rtk.yaml").streams["rtk"]
    rtk = truth.select(slice(0, None, 10))
    z = rtk.z + 0.05 * np.random.default_rng(seed).standard_normal(rtk.z.shape)
    noisy = EventLog(streams={"imu": imu}).with_streams(Stream(
        name="rtk", kind=rtk.kind, t=rtk.t, t_arrival=rtk.t, z=z, var=np.full(z.shape, 0.05**2)
    ))  # fmt: skip
    return noisy, truth


def rmse(run: Run, truth: Stream, delay: float) -> float:
    """3-D, of all ten positions a second, on the IMU's clock."""
    t, at = truth.t - round(delay * 1e9), run.fused.pose.t
    inside = (t >= at[0]) & (t <= at[-1])
    e = [np.interp(t[inside], at, run.fused.pose.p[:, k]) - truth.z[inside, k] for k in range(3)]
    return float(np.sqrt(np.mean(np.sum(np.square(e), axis=0))))


@pytest.mark.parametrize(
    ("path", "best", "bound"), [("Horizontal/path_4", -0.12, 0.41), ("Horizontal/path_7", -0.22, 0.41)]
)
def test_the_quadrotors_clock(recordings: Path, tmp_path: Path, path: str, best: float, bound: float) -> None:
    """best : the delay at which the error is least, by trying every 0.06 s."""
    log, truth = quadrotor(recordings, tmp_path, path, 2)
    run = fuse(log, FuseConfig())
    delay = FuseConfig.model_validate(run.config).sources["rtk"].delay_s
    assert delay == pytest.approx(best, abs=0.05)
    off = fuse(log, FuseConfig.model_validate({"diagnose": False}))
    assert rmse(run, truth, delay) < bound < rmse(off, truth, 0.0)
