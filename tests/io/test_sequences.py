"""Folders of data sets and of teams: drives of KITTI, sequences of EuRoC, one log per robot."""

from pathlib import Path

import numpy as np
import other_logs
import pytest
from flight_logs import cuts, damages, dataflash, ulog, write
from test_registry import attempt

import gnss_logs
from outrider.data import Fix, Kind
from outrider.errors import DataError, UsageError
from outrider.io import detect, read_log
from outrider.io.robots import of_robot, robots_of
from outrider.io.trajectories import read_trajectory

N = 12
YAW = 0.3


def kitti(folder: Path) -> Path:
    """A drive by the data set's own description of a line: thirty numbers, one file a line."""
    data = folder / "2011_09_26_drive_0001_sync" / "oxts" / "data"
    data.mkdir(parents=True)
    stamps: list[str] = []
    for k in range(N):
        stamps.append(f"2011-09-26 13:02:{25 + k // 10:02d}.{k % 10}64389445")
        line = [49.015 + 1e-6 * k, 8.43, 112.8, 0.02, 0.01, YAW, 3.0, 4.0, 5.0, 0.0, -0.1, 0.5, 0.2, 9.8, 0.4, 0.1, 9.7]
        line += [0.01, 0.02, 0.03, 0.01, 0.02, 0.03, 0.05, 0.02, 4, 11, 6, 6, 6]
        write(data, f"{k:010d}.txt", " ".join(map(str, line)).encode())
    write(data.parent, "timestamps.txt", "\n".join([*stamps, ""]).encode())
    return data.parent.parent


def euroc(folder: Path) -> Path:
    """A sequence by the headers of the data set."""
    root = folder / "MH_01" / "mav0"
    for name in ("imu0", "leica0", "state_groundtruth_estimate0", "cam0"):
        (root / name).mkdir(parents=True)
    t = [1403636579758555392 + k * 5_000_000 for k in range(N)]
    imu = ["#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2],a,b"]
    write(root / "imu0", "data.csv", "\r\n".join([*imu, *(f"{s},0.1,0.2,0.3,9.8,0.4,-2.6" for s in t), ""]).encode())
    yaml = "#Default imu sensor yaml file\nsensor_type: imu\n\nT_BS:\n  cols: 4\n  rows: 4\n"
    yaml += "  data: [0.0, -1.0, 0.0, 0.1,\n  1.0, 0.0, 0.0, 0.2,\n  0.0, 0.0, 1.0, 0.3,\n  0.0, 0.0, 0.0, 1.0]\n"
    write(root / "imu0", "sensor.yaml", yaml.encode())
    truth = "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], v"
    half = [f"{s},1.0,{k},3.0,0.8,0.0,0.0,0.6,0.5,0.6,0.7,0,0,0,0,0,0" for k, s in enumerate(t)]
    write(root / "state_groundtruth_estimate0", "data.csv", "\n".join([truth, *half, ""]).encode())
    write(
        root / "leica0", "data.csv", "\n".join(["#timestamp [ns], p_RS_R_x [m]", *(f"{s},1,2,3" for s in t)]).encode()
    )
    write(root / "cam0", "data.csv", b"#timestamp [ns],filename\n1,1.png\n")
    return root.parent


def test_a_drive_of_kitti(tmp_path: Path) -> None:
    path = kitti(tmp_path)
    assert detect(path) == "kitti drive"
    log = read_log(path, robot="car")
    imu, fix, velocity, told = (log.streams[n] for n in ("oxts/imu", "oxts/fix", "oxts/velocity", "oxts"))
    assert (
        imu.t[0] == 1_317_042_145_064_389_445 and np.diff(imu.t)[0] == 100_000_000 and {s.robot for s in log} == {"car"}
    )
    np.testing.assert_allclose(imu.z[0], [0.01, 0.02, 0.03, 0.5, 0.2, 9.8])
    np.testing.assert_allclose(np.degrees(fix.z[0, :2]), [49.015, 8.43])
    assert fix.extra["fix"][0] == Fix.FIXED.value and fix.extra["satellites"][0] == 11
    np.testing.assert_allclose(fix.var[0], 0.05**2)
    np.testing.assert_allclose(velocity.z[0], [4.0, 3.0, -0.1])
    assert told.kind is Kind.ESTIMATE and told.extra["lat"][0] == fix.z[0, 0]
    assert any("OXTS unit's own filter" in n for n in log.notes)


def test_a_damaged_drive(tmp_path: Path) -> None:
    path = kitti(tmp_path)
    write(path / "oxts" / "data", f"{3:010d}.txt", b"49.0 8.4")
    write(path / "oxts" / "data", f"{4:010d}.txt", b"")
    stamps = (path / "oxts" / "timestamps.txt").read_text().splitlines()
    write(path / "oxts", "timestamps.txt", "\n".join([*stamps[:10], "2011-09-"]).encode())
    log = read_log(path)
    assert len(log.streams["oxts/imu"]) == 8
    assert any("4 of 12 OXTS lines" in n for n in log.notes)
    (path / "oxts" / "timestamps.txt").unlink()
    with pytest.raises(DataError, match="no such file"):
        read_log(path)


def test_a_sequence_of_euroc(tmp_path: Path) -> None:
    path = euroc(tmp_path)
    assert detect(path) == detect(path / "mav0") == "euroc sequence"
    log = read_log(path)
    assert set(log.streams) == {"imu0", "leica0", "state_groundtruth_estimate0"} and not log.notes
    imu, truth = log.streams["imu0"], log.streams["state_groundtruth_estimate0"]
    assert imu.t[0] == 1403636579758555392 and imu.z[0].tolist() == [0.1, 0.2, 0.3, 9.8, 0.4, -2.6]
    assert truth.kind is Kind.ESTIMATE and truth.z[2].tolist() == [1, 2, 3, 0, 0, 0.6, 0.8, 0.5, 0.6, 0.7]
    np.testing.assert_allclose(log.mounts["imu0"][:3, 3], [0.1, 0.2, 0.3])
    with (path / "mav0" / "imu0" / "data.csv").open("a") as f:
        f.write("1403636579,0.1,cut")
    log = read_log(path)
    assert log.streams["imu0"].malformed == 1 and any("1 lines of imu0" in n for n in log.notes)


def test_trajectories_of_the_data_sets(tmp_path: Path) -> None:
    truth = read_trajectory(euroc(tmp_path) / "mav0" / "state_groundtruth_estimate0" / "data.csv")
    assert len(truth) == N and truth.q[0].tolist() == [0, 0, 0.6, 0.8] and truth.v[0].tolist() == [0.5, 0.6, 0.7]
    rows = [f"1 0 0 {0.1 * k} 0 1 0 {-0.2 * k} 0 0 1 {k}" for k in range(4)]  # forward, a little right and up
    path = write(tmp_path, "00.txt", "\n".join([*rows, ""]).encode())
    with pytest.raises(DataError, match=r"have no stamps .put its times.txt beside it"):
        read_trajectory(path)
    write(tmp_path, "times.txt", b"0.0\n1.036e-01\n0.207\n")
    with pytest.raises(DataError, match=r"has 4 poses, times.txt 3 stamps"):
        read_trajectory(path)
    write(tmp_path, "times.txt", b"0.0\n1.036e-01\n0.207\n0.311\n")
    poses = read_trajectory(path)
    np.testing.assert_allclose(poses.p[3], [3.0, -0.3, 0.6], atol=1e-12)
    np.testing.assert_allclose(poses.q[0], [0, 0, 0, 1], atol=1e-12)
    assert poses.t.tolist() == [0, 103_600_000, 207_000_000, 311_000_000]


def test_a_kitti_turn_is_a_turn_about_the_vertical(tmp_path: Path) -> None:
    c, s = np.cos(0.4), np.sin(0.4)  # about the camera's downward axis: to the right
    write(tmp_path, "times.txt", b"0\n")
    path = write(tmp_path, "00.txt", f"{c} 0 {s} 0 0 1 0 0 {-s} 0 {c} 0\n".encode())
    np.testing.assert_allclose(read_trajectory(path).q[0], [0, 0, -np.sin(0.2), np.cos(0.2)], atol=1e-12)


@pytest.mark.parametrize(("row", "words"), [("1e200 0 0 0 0 1 0 0 0 0 1 0", "pose 1 is nowhere"),
                                           ("1 0 0 -1e13 0 1 0 0 0 0 1 0", "pose 1 is nowhere"),
                                           ("2 0 0 0 0 1 0 0 0 0 1 0", "matrices are no rotations")])  # fmt: skip
def test_kitti_poses_that_cannot_be(tmp_path: Path, row: str, words: str) -> None:
    write(tmp_path, "times.txt", b"0\n")
    with pytest.raises(DataError, match=words):
        read_trajectory(write(tmp_path, "00.txt", row.encode()))


def team(folder: Path) -> Path:
    out = folder / "team"
    out.mkdir()
    write(out, "uav.ulg", ulog())
    write(out, "ugv.clf", other_logs.carmen())
    write(out, "base.nmea", gnss_logs.nmea())
    write(out, "notes.txt", b"sunny")
    write(out, "camera.avi", b"RIFF")
    return out


def test_a_team_folder(tmp_path: Path) -> None:
    path = team(tmp_path)
    assert detect(path) == "team folder"
    log = read_log(path)
    assert robots_of(log) == ("base", "uav", "ugv")
    with pytest.raises(UsageError, match=r"holds 3 robots .--robot base or uav or ugv"):
        of_robot(log, None)
    own = of_robot(log, "ugv")
    assert set(own.streams) == {"ugv/ODOM", "ugv/ODOM#twist", "ugv/FLASER"}
    assert own.streams["ugv/FLASER"].frame in own.mounts and {s.robot for s in own} == {"ugv"}
    alone = read_log(path / "ugv.clf")
    np.testing.assert_array_equal(own.streams["ugv/ODOM"].z, alone.streams["ODOM"].z)
    assert any("no logs, or logs that need a mapping: camera.avi" in n for n in log.notes)
    assert any(n.startswith("base: 20 of 20 RMC") for n in log.notes)


def test_a_team_with_a_broken_log_or_twice_a_name(tmp_path: Path) -> None:
    path = team(tmp_path)
    write(path, "other.ulg", ulog()[:30])
    write(path, "uav.BIN", dataflash())
    log = read_log(path)
    assert robots_of(log) == ("base", "uav.BIN", "uav.ulg", "ugv")
    assert any(n.startswith("other could not be read") for n in log.notes)


def test_one_log_alone_is_no_team(tmp_path: Path) -> None:
    write(tmp_path, "uav.ulg", ulog())
    with pytest.raises(DataError, match=r"not a ROS 2 bag, a drive of KITTI.*name the log file inside it"):
        read_log(tmp_path)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("make", [kitti, euroc, team])
def test_no_damage_escapes_from_folders(tmp_path: Path, make, rng: np.random.Generator) -> None:
    path = make(tmp_path)
    files = [f for f in sorted(path.rglob("*")) if f.is_file()]
    for _ in range(25):
        file = files[int(rng.integers(len(files)))]
        data = file.read_bytes()
        for broken in (*cuts(data, rng, 1)[-1:], *damages(data, rng, 2), b""):
            file.write_bytes(broken)
            attempt(path)
        file.unlink()
        attempt(path)
        file.write_bytes(data)
