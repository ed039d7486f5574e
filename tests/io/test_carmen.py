"""CARMEN logs: odometry, speeds, lasers and their mounts, plain and packed, whole and cut."""

import bz2
import gzip
from pathlib import Path

import numpy as np
import other_logs as made
import pytest
from flight_logs import write

from outrider.data import EventLog, Kind, Verdict
from outrider.errors import DataError
from outrider.filters.screen import screen
from outrider.io import detect, read_log


def read(folder: Path, data: bytes) -> EventLog:
    return read_log(write(folder, "a.clf", data))


@pytest.mark.parametrize("pack", [bytes, gzip.compress, bz2.compress])
def test_odometry_and_laser(tmp_path: Path, pack) -> None:
    log = read(tmp_path, pack(made.carmen()))
    pose, twist, scan = (log.streams[n] for n in ("ODOM", "ODOM#twist", "FLASER"))
    assert len(pose) == len(twist) == len(scan) == 40 and not log.notes
    assert pose.t[1] == 1000_250_000_000 and (pose.t_arrival - pose.t)[:2].tolist() == [0, 10_000_000]
    np.testing.assert_allclose(twist.z[3], [0.5, 0.0, np.nan, np.nan, np.nan, 0.1])
    np.testing.assert_allclose(pose.z[-1, 5:], [np.sin(0.4875), np.cos(0.4875)], atol=1e-6)
    assert scan.z.shape == (40, 180) and (scan.z[0, :90] == 2.5).all() and np.isinf(scan.z[0, 90:]).all()
    np.testing.assert_allclose(np.degrees(scan.extra["angle_min"]), -90)
    np.testing.assert_allclose(np.degrees(scan.extra["angle_step"]), 1.0)
    assert set(screen(scan)) == {int(Verdict.USED)}  # beams that saw nothing are no damage
    assert scan.frame == "front_laser" and log.mounts["front_laser"][0, 3] == 0.2


def test_speeds_that_are_never_recorded(tmp_path: Path) -> None:
    log = read(tmp_path, made.carmen().replace(b" 0.5 0.1 0.0 ", b" 0.0 0.0 0.0 "))
    np.testing.assert_allclose(log.streams["ODOM#twist"].z[:, [0, 5]], np.tile([0.5, 0.1], (39, 1)), atol=1e-4)
    assert any("says speed 0 throughout" in n for n in log.notes)


def test_poses_beside_scans_stand_in_for_odometry(tmp_path: Path) -> None:
    log = read(tmp_path, made.carmen(odometry=False))
    twist = log.streams["FLASER#twist"]
    assert len(twist) == 39 and log.streams["FLASER#odom"].kind is Kind.ODOMETRY_POSE
    np.testing.assert_allclose(twist.z[:, 0], 0.5, atol=1e-4)
    np.testing.assert_allclose(twist.z[:, 5], 0.1, atol=1e-4)


@pytest.mark.parametrize(
    ("count", "begin", "step"), [(180, -90, 1), (181, -90, 1), (360, -90, 0.5), (361, -90, 0.5), (401, -50, 0.25)]
)
def test_geometry_of_old_lasers(tmp_path: Path, count: int, begin: float, step: float) -> None:
    line = f"FLASER {count} {' '.join(['3.0'] * count)} 0 0 0 0 0 0 12.5 host 0.1\n"
    s = read(tmp_path, line.encode()).streams["FLASER"]
    np.testing.assert_allclose(np.degrees([s.extra["angle_min"][0], s.extra["angle_step"][0]]), [begin, step])


def test_new_lasers_say_their_geometry(tmp_path: Path) -> None:
    line = (
        "ROBOTLASER1 0 -1.57 3.14 1.57 20.0 0.01 0 3 1.0 2.0 25.0 0 1 2 0.1 1 2 0.1 0.5 0.1 0.3 0.2 1e6 12.5 host 0.1\n"
    )
    line += "RAWLASER1 0 -1.0 2.0 1.0 20.0 0.01 0 3 1.0 2.0 3.0 0 12.5 host 0.1\n"
    log = read(tmp_path, line.encode())
    s = log.streams["ROBOTLASER1"]
    assert s.z[0].tolist() == [1.0, 2.0, np.inf] and s.extra["angle_min"][0] == -1.57 and s.extra["range_max"][0] == 20
    assert log.streams["RAWLASER1"].z[0].tolist() == [1, 2, 3]


def test_a_rear_laser_looks_back(tmp_path: Path) -> None:
    data = made.carmen() + b"PARAM robot_rearlaser_offset -0.3 nohost 0\n"
    np.testing.assert_allclose(read(tmp_path, data).mounts["rear_laser"][:2, [0, 3]], [[-1, -0.3], [0, 0]], atol=1e-12)


def test_broken_lines_are_counted(tmp_path: Path) -> None:
    data = made.carmen().replace(b"ODOM 0.1", b"ODOM zero", 1) + b"ODOM 1 2 3 4 5 6 nan h 0\nFLASER 3 1 2 12 h 0\n"
    log = read(tmp_path, data)
    assert (
        len(log.streams["ODOM"]) == 39 and log.streams["ODOM"].malformed == 2 and log.streams["FLASER"].malformed == 1
    )
    assert any("3 lines could not be read" in n for n in log.notes)


@pytest.mark.parametrize("pack", [gzip.compress, bz2.compress])
def test_a_cut_archive_is_read_up_to_the_cut(tmp_path: Path, pack, rng: np.random.Generator) -> None:
    noise = "".join(f"ODOM {' '.join(f'{v:.6f}' for v in rng.normal(size=6))} {k}.5 h {k}.6\n" for k in range(40_000))
    packed = pack(noise.encode())
    log = read(tmp_path, packed[: len(packed) * 3 // 4])
    assert 1000 < len(log.streams["ODOM"]) < 40_000 and any("truncated" in n for n in log.notes)


def test_another_archive_says_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="is compressed, and holds no CARMEN log"):
        detect(write(tmp_path, "a.gz", gzip.compress(b"hello\n")))
    with pytest.raises(DataError, match="is compressed, and holds no CARMEN log"):
        detect(write(tmp_path, "a.gz", gzip.compress(b"hello\n" * 99)[:20]))


@pytest.mark.parametrize(("name", "odom", "scans"), [("aces", 7375, 7374), ("fr079", 8951, 4934)])
def test_recorded_logs(recordings: Path, name: str, odom: int, scans: int) -> None:
    log = read_log(recordings / "mola" / "datasets" / "radish" / f"{name}.clf.bz2")
    assert len(log.streams["ODOM"]) == odom and len(log.streams["FLASER"]) == scans
    assert any("says speed 0 throughout" in n for n in log.notes) == (name == "aces")
    twist = log.streams["ODOM#twist"]
    way = np.linalg.norm(np.diff(log.streams["ODOM"].z[:, :2], axis=0), axis=1).sum()
    by_speed = np.abs(twist.z[:-1, 0]) @ (np.diff(twist.t) * 1e-9)
    assert by_speed == pytest.approx(way, rel=0.1)  # the speeds are those of the poses
