"""Folders of a team as the UTIAS data sets have them: what is read, what is refused, and that nothing is lost."""

from pathlib import Path

import numpy as np
import pytest

from outrider.data import Kind
from outrider.errors import DataError
from outrider.io.mrclam import write_mrclam
from outrider.io.registry import detect, read_log
from outrider.sim.barcodes import BarcodeTeam, barcode_log

HEAD = "# UTIAS Multi-Robot Cooperative Localization and Mapping Dataset\n# Data Format:\n# Time [s]\n"
FILES = {
    "Barcodes.dat": "# Subject #    Barcode #\n  1 \t   5\n  2 \t  14\n  6 \t  18\n",
    "Landmark_Groundtruth.dat": "# x y\n  6 \t 1.88032539 \t -5.57229508 \t 0.00001974 \t 0.00004067\n",
    "Robot1_Odometry.dat": HEAD + "1248272273.972 \t  0.086 \t -0.398\n1248272274.013 \t  0.000 \t  0.000\n",
    "Robot1_Measurement.dat": HEAD + "1248272276.038 \t  18 \t  2.148 \t  0.025\n1248272276.038 \t 14 \t 3.4 \t-0.5\n"
    "1248272276.727 \t  90 \t  3.387 \t  0.006\n",
    "Robot1_Groundtruth.dat": HEAD + "1248272272.841 \t 1.29812900 \t 1.88315210 \t 2.82870000\n",
    "Robot2_Odometry.dat": HEAD + "1248272275.001 \t  0.067 \t  0.000\n",
    "Robot2_Measurement.dat": HEAD + "1248272277.000 \t  5 \t  1.000 \t  0.100\n",
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    return tmp_path


def test_numbers_stand_where_the_format_says(folder: Path) -> None:
    assert detect(folder) == "mrclam folder"
    log = read_log(folder)
    assert log.ids == {"robot1": 1, "robot2": 2} and log.beacons == {6.0: (1.88032539, -5.57229508, 0.0)}
    odometry = log.streams["robot1/odometry"]
    assert odometry.kind is Kind.TWIST and odometry.robot == "robot1"
    assert odometry.t.tolist() == [1248272273972000000, 1248272274013000000]
    np.testing.assert_array_equal(odometry.z[:, [0, 1, 5]], [[0.086, 0.0, -0.398], [0.0, 0.0, 0.0]])
    seen = log.streams["robot1/measurement"]
    assert seen.kind is Kind.RANGE_BEARING
    np.testing.assert_array_equal(seen.z, [[6, 2.148, 0.025], [2, 3.4, -0.5], [-90, 3.387, 0.006]])
    truth = log.streams["robot1/groundtruth"]
    assert truth.kind is Kind.ESTIMATE  # which is never fused
    np.testing.assert_allclose(truth.z[0, :3], [1.298129, 1.8831521, 0.0])
    np.testing.assert_allclose(2.0 * np.arctan2(truth.z[0, 5], truth.z[0, 6]), 2.8287)


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_damaged_lines_are_counted_and_the_others_read(folder: Path, end: str) -> None:
    lines = [
        "# a",
        "1248272276.038 18 2.148 0.025",
        "1248272276.1 18 2.1",
        "x 18 2 0",
        "1248272276.2 18 2.2 0.1 # x",
        "",
    ]
    (folder / "Robot1_Measurement.dat").write_bytes(end.join(lines).encode())
    log = read_log(folder)
    s = log.streams["robot1/measurement"]
    assert s.malformed == 2 and s.z[:, 1].tolist() == [2.148, 2.2]
    assert any("2 lines of Robot1_Measurement.dat" in n for n in log.notes)


def test_numbers_that_are_none_are_kept_apart(folder: Path) -> None:
    (folder / "Robot1_Measurement.dat").write_text("1248272276.038 18 nan 0.025\nnan 18 1.0 0.0\n")
    s = read_log(folder).streams["robot1/measurement"]
    assert s.malformed == 1 and len(s) == 1 and np.isnan(s.z[0, 1])


@pytest.mark.parametrize(
    ("name", "text", "what"),
    [
        ("Barcodes.dat", "1 5\n2 5\n", "barcode 5 belongs to two subjects"),
        ("Barcodes.dat", "# nothing\n", "holds no barcode"),
        ("Barcodes.dat", "1 five\n", "line 1: cannot be read: '1 five'"),
        ("Landmark_Groundtruth.dat", "6 1.0\n", "line 1: cannot be read"),
        ("Landmark_Groundtruth.dat", "1 1.0 2.0 0 0\n", "subject 1 is a robot and a landmark"),
        ("Robot1_Odometry.dat", "", "the file is empty"),
    ],
)
def test_faults_are_one_line(folder: Path, name: str, text: str, what: str) -> None:
    (folder / name).write_text(text)
    with pytest.raises(DataError) as e:
        read_log(folder)
    assert what in str(e.value) and "\n" not in str(e.value)


def test_without_barcodes_nobody_is_known(folder: Path) -> None:
    (folder / "Barcodes.dat").unlink()
    with pytest.raises(DataError, match=r"has no Barcodes\.dat"):
        read_log(folder)


def test_a_folder_may_be_inside_another(folder: Path, tmp_path: Path) -> None:
    """As archives unpack, with what macOS leaves beside it."""
    inner = tmp_path / "outer" / "MRCLAM_Dataset7"
    inner.mkdir(parents=True)
    for name, text in FILES.items():
        (inner / name).write_text(text)
    (inner.parent / "__MACOSX").mkdir()
    (inner.parent / "readme.txt").write_text("hello")
    assert detect(inner.parent) == "mrclam folder"
    assert read_log(inner.parent).ids == read_log(folder).ids
    (inner.parent / "MRCLAM_Dataset6").mkdir()
    with pytest.raises(DataError, match="is a directory"):  # which of the two?
        detect(inner.parent)


def test_an_archive_is_to_be_unpacked(folder: Path) -> None:
    (folder / "MRCLAM_Dataset6.zip").write_bytes(b"PK\x03\x04" + bytes(100))
    with pytest.raises(DataError, match="is a zip archive"):
        detect(folder / "MRCLAM_Dataset6.zip")


def test_without_landmarks_it_says_so(folder: Path) -> None:
    (folder / "Landmark_Groundtruth.dat").unlink()
    log = read_log(folder)
    assert log.beacons == {} and any("no landmark is known" in n for n in log.notes)
    assert log.streams["robot1/measurement"].z[0, 0] == 6


def test_a_simulated_log_comes_back(tmp_path: Path) -> None:
    log, truth = barcode_log(BarcodeTeam(robots=2, landmarks=4, duration_s=20.0), 3)
    write_mrclam(log, truth, tmp_path)
    back = read_log(tmp_path)
    assert back.ids == log.ids and back.beacons.keys() == log.beacons.keys()
    for name, s in log.streams.items():
        np.testing.assert_array_equal(back.streams[name].t, s.t)
        unknown = s.z[:, 0] < 0 if s.kind is Kind.RANGE_BEARING else np.zeros(len(s), bool)
        np.testing.assert_allclose(back.streams[name].z[~unknown], s.z[~unknown], atol=1e-9)
        if unknown.any():
            assert (back.streams[name].z[unknown, 0] < 0).all()
    for name, path in truth.items():
        np.testing.assert_allclose(back.streams[f"{name}/groundtruth"].z[:, :2], path.p[:, :2], atol=1e-8)
