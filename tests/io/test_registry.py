"""One call for every format: what it tells apart, what it says when it cannot, and that no damage escapes it."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from flight_logs import CSV_MAPPING, N, cuts, damages, dataflash, replay, table, tlog, ulog, write

from outrider.data import Kind
from outrider.errors import DataError, OutriderError, UsageError
from outrider.io import detect, files, read_log

FORMATS: dict[str, tuple[str, Callable[[], bytes]]] = {
    "ulog": (".ulg", ulog),
    "tlog": (".tlog", tlog),
    "dataflash": (".BIN", dataflash),
    "ekf2 replay": (".csv", replay),
}


@pytest.mark.parametrize("name", FORMATS)
def test_the_content_decides_not_the_name(tmp_path: Path, name: str) -> None:
    ending, make = FORMATS[name]
    for wrong in (ending, "", ".txt", ".bag"):
        assert detect(write(tmp_path, f"log{wrong}", make())) == name
    log = read_log(write(tmp_path, f"log{ending}", make()), robot="r2")
    (imu, *_), (gnss, *_) = log.of(Kind.IMU), log.of(Kind.GNSS)
    assert len(imu) == N and len(gnss) == N // 5 and {s.robot for s in log} == {"r2"} and len(log.sha256) == 64
    np.testing.assert_allclose(np.degrees(gnss.z[0, :2]), [47.4, 8.5], atol=1e-6)  # all of them are the same flight


@pytest.mark.parametrize(("head", "name"), [(b"#ROSBAG V2.0\n", "ros1 bag"), (b"\x89MCAP0\r\n", "mcap"),
                                            (b"SQLite format 3\0", "ros2 bag")])  # fmt: skip
def test_ros_recordings_are_told_by_their_first_bytes(tmp_path: Path, head: bytes, name: str) -> None:
    assert detect(write(tmp_path, "log.dat", head + bytes(50))) == name


def test_topics_times_and_progress(tmp_path: Path) -> None:
    path = write(tmp_path, "log.ulg", ulog())
    assert set(read_log(path, topics=["vehicle_gps_position"]).streams) == {
        "vehicle_gps_position", "vehicle_gps_position#velocity"}  # fmt: skip
    assert set(read_log(path, topics=["*mag*", "ekf2"]).streams) == {"vehicle_magnetometer", "ekf2"}
    with pytest.raises(DataError, match="did you mean 'sensor_combined'"):
        read_log(path, topics=["sensor_combine"])
    part = read_log(path, start_s=0.6, end_s=1.1)  # the first event is a fix, 0.1 s before the first rate
    assert part.streams["sensor_combined"].t[0] == pytest.approx(7.5e9) and part.duration == pytest.approx(0.5)
    with pytest.raises(DataError, match=r"no record after 100 s .the log lasts 2.08 s"):
        read_log(path, start_s=100)
    for name, (ending, make) in FORMATS.items():
        calls: list[tuple[int, int]] = []
        path = write(tmp_path, f"p{ending}", make())
        read_log(path, progress=lambda done, size, calls=calls: calls.append((done, size)))
        assert calls and {size for _, size in calls} == {path.stat().st_size}, name
        assert all(0 <= done <= size for done, size in calls)


def test_a_csv_needs_a_mapping_and_nothing_else_does(tmp_path: Path) -> None:
    path, mapping = write(tmp_path, "a.csv", table()), write(tmp_path, "m.yaml", CSV_MAPPING.encode())
    with pytest.raises(DataError, match=r"needs a mapping.*us, sensor, wx"):
        read_log(path)
    assert len(read_log(path, mapping=mapping).streams["imu"]) == N
    with pytest.raises(UsageError, match="this is ulog"):
        read_log(write(tmp_path, "a.ulg", ulog()), mapping=mapping)


def test_what_cannot_be_read_says_why(tmp_path: Path) -> None:
    for path, says in (
        (tmp_path / "missing.ulg", "no such file"),
        (tmp_path, "not a ROS 2 bag"),
        (write(tmp_path, "empty.bag", b""), "empty"),
        (write(tmp_path, "cat.jpg", b"\xff\xd8\xff" + bytes(99)), "supported: ROS 1"),
    ):
        with pytest.raises(DataError, match=says) as e:
            read_log(path)
        assert str(path) in str(e.value) and "\n" not in str(e.value)


def attempt(path: Path, mapping: Path | None = None) -> None:
    """Reading gives a log without surprises, or one line."""
    try:
        log = read_log(path, mapping=mapping)
    except OutriderError as e:
        assert "\n" not in str(e) and len(str(e)) < 600
        return
    for s in log:
        assert (
            s.z.dtype == np.float64 and len(s.t_arrival) == len(s) and all(len(c) == len(s) for c in s.extra.values())
        )


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", [*FORMATS, "csv"])
def test_no_damage_escapes(tmp_path: Path, name: str, rng: np.random.Generator) -> None:
    ending, make = FORMATS.get(name, (".csv", table))
    mapping = write(tmp_path, "m.yaml", CSV_MAPPING.encode()) if name == "csv" else None
    data = make()
    for broken in (*cuts(data, rng, 40), *damages(data, rng, 60)):
        attempt(write(tmp_path, f"x{ending}", broken), mapping)


@pytest.mark.parametrize("name", FORMATS)
def test_a_shorter_file_never_gives_a_longer_log(tmp_path: Path, name: str) -> None:
    ending, make = FORMATS[name]
    data, last = make(), 0
    for k in range(1, 11):
        try:
            n = len(read_log(write(tmp_path, f"x{ending}", data[: len(data) * k // 10])))
        except DataError:
            n = 0
        assert n >= last
        last = n
    assert last == len(read_log(write(tmp_path, f"x{ending}", data)))


def test_digests(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    a, b = write(tmp_path, "a", b"abc"), write(tmp_path, "b", b"abd")
    assert files.sha256(a).startswith("ba7816bf") and files.sha256(a) != files.sha256(b)
    assert files.sha256(tmp_path) not in (files.sha256(a), files.sha256(b))
    monkeypatch.setattr(files, "HASH_WHOLE", 2)
    monkeypatch.setattr(files, "_CHUNK", 0)
    assert files.sha256(a).startswith("head-tail-size:")
