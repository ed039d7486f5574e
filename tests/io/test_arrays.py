"""NumPy and MATLAB arrays by the same mapping as tables."""

from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from flight_logs import cuts, damages, write
from hypothesis import given
from hypothesis import strategies as st
from test_registry import attempt

from outrider.data import EventLog, Kind
from outrider.errors import ConfigError, DataError, UsageError
from outrider.io import detect, read_log
from outrider.io._matlab import read_matlab

T = 100.0 + 0.5 * np.arange(10)
GYRO = np.arange(30.0).reshape(10, 3)

SINGLE = """
time: {column: "[0]"}
streams:
  imu:
    kind: IMU
    frame: frd
    columns: {gyro_x: "[1]", gyro_y: "[2]", gyro_z: "[3]"}
    units: {gyro_x: deg/s, gyro_y: deg/s, gyro_z: deg/s}
"""
NAMED = """
streams:
  gyro: {kind: IMU, time: {column: t}, columns: {gyro_x: "w[0]", gyro_y: "w[1]", gyro_z: "w[2]"}}
  range: {kind: RANGE, time: {column: "r[0]", unit: ms}, columns: {beacon: "r[1]", range: "r[2]"}, where: {"r[1]": 7}}
"""
RANGES = np.array([[100_000, 7, 2.5], [100_500, 8, 3.5], [101_000, 7, 4.5]])


def read(folder: Path, mapping: str, path: Path) -> EventLog:
    return read_log(path, mapping=write(folder, "m.yaml", mapping.encode()))


def test_a_single_array(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.column_stack([T, GYRO]))
    s = read(tmp_path, SINGLE, tmp_path / "a.npy").streams["imu"]
    np.testing.assert_array_equal(s.t, np.round(T * 1e9).astype(np.int64))
    np.testing.assert_allclose(s.z[:, :3], np.radians(GYRO) * [1, -1, -1])
    assert np.isnan(s.z[:, 3:]).all()


def make_folder(folder: Path) -> Path:
    out = folder / "run"
    (out / "deep").mkdir(parents=True)
    np.save(out / "t.npy", T)
    np.save(out / "w.npy", GYRO)
    np.save(out / "r.npy", RANGES)
    np.save(out / "deep" / "x.npy", T[:, None])
    return out


@pytest.mark.parametrize("kind", ["npz", "mat", "folder"])
def test_named_arrays(tmp_path: Path, kind: str) -> None:
    arrays = {"t": T, "w": GYRO, "r": RANGES}
    if kind == "npz":
        path = tmp_path / "a.npz"
        np.savez(path, **arrays)
    elif kind == "mat":
        path = tmp_path / "a.mat"
        scipy.io.savemat(path, arrays)
    else:
        path = make_folder(tmp_path)
    log = read(tmp_path, NAMED, path)
    np.testing.assert_array_equal(log.streams["gyro"].z[:, :3], GYRO)
    r = log.streams["range"]
    assert r.z.tolist() == [[7, 2.5], [7, 4.5]] and r.t.tolist() == [100 * 10**9, 101 * 10**9]


def test_a_structure_of_matlab_and_a_record_of_numpy(tmp_path: Path) -> None:
    mapping = 'streams: {h: {kind: HEADING, time: {column: "S.t"}, columns: {heading: "S.a.yaw"}}}'
    scipy.io.savemat(tmp_path / "a.mat", {"S": {"t": T, "a": {"yaw": 0.1 * T}}})
    np.testing.assert_allclose(read(tmp_path, mapping, tmp_path / "a.mat").streams["h"].z[:, 0], 0.1 * T)
    record = np.array([(1_500_000_000, 0.25), (2_500_000_000, 0.5)], dtype=[("ns", "<i8"), ("yaw", "<f4")])
    np.save(tmp_path / "a.npy", record)
    mapping = "streams: {h: {kind: HEADING, time: {column: ns, unit: ns}, columns: {heading: yaw}}}"
    s = read(tmp_path, mapping, tmp_path / "a.npy").streams["h"]
    assert s.t.tolist() == [1_500_000_000, 2_500_000_000] and s.z[:, 0].tolist() == [0.25, 0.5]


@given(
    st.sampled_from(["f8", "f4", "i4", "u1", "i8", "bool"]), st.integers(0, 4), st.integers(1, 4), st.booleans(),
    st.integers(0, 2**32),
)  # fmt: skip
def test_matlab_arrays_as_scipy_reads_them(dtype: str, rows: int, columns: int, packed: bool, seed: int) -> None:
    drawn = np.random.default_rng(seed).integers(0, 2, (rows + 1, columns)).astype(dtype)
    file = BytesIO()
    saved = {"a": drawn, "s": {"b": drawn[:1], "name": "text"}, "text": "no numbers", "c": np.array([1 + 2j])}
    scipy.io.savemat(file, saved, do_compression=packed)
    ours, theirs = read_matlab(file.getvalue()), scipy.io.loadmat(BytesIO(file.getvalue()))
    np.testing.assert_array_equal(ours["a"], theirs["a"])
    np.testing.assert_array_equal(ours["s.b"], theirs["s"]["b"][0, 0])
    assert set(ours) == {"a", "s.b", "c"}


def test_increments_become_rates_in_the_middle(tmp_path: Path) -> None:
    way = np.column_stack([[10.0, 11.0, 11.0, 13.0, 14.0], [9.0, 0.5, 9.0, 1.0, 2.0], [9.0, 0.1, 9.0, 0.2, 0.3]])
    np.save(tmp_path / "a.npy", way)
    mapping = 'time: {column: "[0]"}\nstreams: {o: {kind: TWIST, increments: true, columns: {v_x: "[1]", w_z: "[2]"}}}'
    s = read(tmp_path, mapping, tmp_path / "a.npy").streams["o"]
    np.testing.assert_allclose(s.z[:, [0, 5]], [[0.5, 0.1], [0.5, 0.1], [2.0, 0.3]])  # a repeated stamp has no rate
    assert s.t.tolist() == [10_500_000_000, 12_000_000_000, 13_500_000_000]


@pytest.mark.parametrize(
    ("mapping", "says"),
    [
        (NAMED.replace("w[0]", "v[0]"), "no array 'v'"),
        (NAMED.replace("w[2]", "w[3]"), r"'w\[3\]' is no column of an array of 10x3 .write w\[0\] to w\[2\]"),
        (NAMED.replace('"w[2]"', "w"), "'w' is no column of an array of 10x3"),
        (NAMED.replace("column: t", 'column: "r[0]"'), r"unequal length: r\[0\] 3, w\[0\] 10"),
        (NAMED.replace("unit: ms", "unit: iso"), "are numbers, not texts"),
        (NAMED.replace("column: t", "column: text"), "'text' holds no numbers"),
        (NAMED.replace("time: {column: t}, ", ""), "no stamps for stream gyro"),
    ],
)
def test_faults_of_a_mapping_of_arrays(tmp_path: Path, mapping: str, says: str) -> None:
    np.savez(tmp_path / "a.npz", t=T, w=GYRO, r=RANGES, text=np.array(["a"] * 10))
    with pytest.raises(ConfigError, match=says) as e:
        read(tmp_path, mapping, tmp_path / "a.npz")
    assert "\n" not in str(e.value)


def test_without_a_mapping_they_say_what_they_hold(tmp_path: Path) -> None:
    scipy.io.savemat(tmp_path / "a.mat", {"GT": GYRO, "t": T})
    with pytest.raises(DataError, match=r"arrays need a mapping.*GT 10x3, t 1x10"):
        read_log(tmp_path / "a.mat")
    assert detect(tmp_path / "a.mat") == "arrays"
    hdf = write(tmp_path, "b.mat", b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512, b"\0") + b"\x89HDF\r\n\x1a\n")
    with pytest.raises(DataError, match=r"MATLAB 7.3 file, which is HDF5 .save it with"):
        read_log(hdf)


def test_pickled_objects_are_never_loaded(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.array([{"a": 1}], dtype=object), allow_pickle=True)
    with pytest.raises(DataError, match="is damaged: Object arrays cannot be loaded"):
        read(tmp_path, SINGLE, tmp_path / "a.npy")


def test_a_mapping_for_something_else(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="a mapping is for tables, this is carmen log"):
        read(tmp_path, SINGLE, write(tmp_path, "a.clf", b"# CARMEN Logfile\nODOM 0 0 0 0 0 0 1 h 1\n"))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("kind", ["npy", "npz", "mat", "packed.mat"])
def test_no_damage_escapes_from_arrays(tmp_path: Path, kind: str, rng: np.random.Generator) -> None:
    path = tmp_path / f"a.{kind}"
    mapping = write(tmp_path, "m.yaml", (SINGLE if kind == "npy" else NAMED).encode())
    if kind == "npy":
        np.save(path, np.column_stack([T, GYRO]))
    elif kind == "npz":
        np.savez(path, t=T, w=GYRO, r=RANGES)
    else:
        scipy.io.savemat(path, {"t": T, "w": GYRO, "r": RANGES}, do_compression=kind.startswith("packed"))
    data = path.read_bytes()
    for broken in (*cuts(data, rng, 20), *damages(data, rng, 60)):
        attempt(write(tmp_path, f"x.{kind}", broken), mapping)


PLAZA = """
streams:
  odometry: {kind: TWIST, time: {column: "DR[0]"}, increments: true, columns: {v_x: "DR[1]", w_z: "DR[2]"}}
  ranges: {kind: RANGE, time: {column: "TD[0]"}, columns: {beacon: "TD[2]", range: "TD[3]"}}
  reference: {kind: ESTIMATE, time: {column: "GT[0]"}, columns: {x: "GT[1]", y: "GT[2]", yaw: "GT[3]"}}
"""


def test_a_recorded_mower(recordings: Path, tmp_path: Path) -> None:
    log = read(tmp_path, PLAZA, recordings / "gtsam" / "examples" / "Data" / "Plaza1_.mat")
    assert {n: len(s) for n, s in log.streams.items()} == {"odometry": 9656, "ranges": 3529, "reference": 9658}
    text = np.loadtxt(recordings / "gtsam" / "examples" / "Data" / "Plaza1_TD.txt")
    np.testing.assert_allclose(log.streams["ranges"].z, text[:, 2:4])
    way, told = log.streams["odometry"], log.streams["reference"].z[:, :2]
    driven = np.linalg.norm(np.diff(told, axis=0), axis=1).sum()
    assert way.z[1:, 0] @ (np.diff(way.t) * 1e-9) == pytest.approx(driven, rel=0.02)


COMMA = """
streams:
  imu:
    kind: IMU
    time: {column: "processed_log/IMU/gyro/t"}
    columns: {gyro_x: "processed_log/IMU/gyro/value[2]", gyro_y: "processed_log/IMU/gyro/value[1]",
              gyro_z: "processed_log/IMU/gyro/value[0]"}
  wheels:
    kind: WHEELS
    time: {column: "processed_log/CAN/wheel_speed/t"}
    columns: {fl: "processed_log/CAN/wheel_speed/value[0]", fr: "processed_log/CAN/wheel_speed/value[1]",
              rl: "processed_log/CAN/wheel_speed/value[2]", rr: "processed_log/CAN/wheel_speed/value[3]"}
  ublox:
    kind: GNSS
    time: {column: "processed_log/GNSS/live_gnss_ublox/t"}
    columns: {lat: "processed_log/GNSS/live_gnss_ublox/value[0]", lon: "processed_log/GNSS/live_gnss_ublox/value[1]",
              alt: "processed_log/GNSS/live_gnss_ublox/value[5]"}
    units: {lat: deg, lon: deg}
"""


def test_a_recorded_minute_of_a_highway(recordings: Path, tmp_path: Path) -> None:
    (folder,) = (recordings / "comma2k19" / "Example_1").glob("*/40")
    log = read(tmp_path, COMMA, folder)
    assert {s.name: len(s) for s in log} == {"imu": 6256, "wheels": 4974, "ublox": 579}
    assert log.duration == pytest.approx(60, abs=1) and log.streams["imu"].rate == pytest.approx(104, abs=2)
    assert log.streams["wheels"].kind is Kind.WHEELS and log.streams["wheels"].z.mean() > 15
