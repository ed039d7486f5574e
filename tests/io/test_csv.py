"""Any CSV by a mapping: units, frames, selection, damage, and faults that say where."""

from pathlib import Path

import numpy as np
import pytest
from flight_logs import ALT, BOOT, CSV_MAPPING, N, place, table, write
from hypothesis import given
from hypothesis import strategies as st

from outrider.data import Altitude, EventLog, Fix
from outrider.errors import ConfigError, DataError
from outrider.io.csv import CsvMapping, read_csv
from outrider.io.stamps import seconds_text, to_nanoseconds


def read(folder: Path, rows: str, mapping: str) -> EventLog:
    return read_csv(write(folder, "a.csv", rows.encode()), write(folder, "m.yaml", mapping.encode()))


def test_units_frames_and_rows_of_one_sensor(tmp_path: Path) -> None:
    log = read_csv(write(tmp_path, "a.csv", table()), write(tmp_path, "m.yaml", CSV_MAPPING.encode()))
    imu, fix = log.streams["imu"], log.streams["fix"]
    assert len(imu) == N and len(fix) == N // 5 and imu.t[0] == BOOT * 1000
    np.testing.assert_allclose(imu.z, np.tile([0.01, -0.02, -0.5, 1, -0.25, 9.81], (N, 1)), atol=1e-12)
    lat, lon, _ = place(0)
    np.testing.assert_allclose(fix.z[0], [np.radians(lat), np.radians(lon), ALT])
    np.testing.assert_allclose(fix.var[0], [0.25, 0.25, 0.64])
    assert fix.altitude is Altitude.MSL and set(fix.extra["fix"]) == {Fix.SINGLE.value}


HEADING = """
time: {column: t}
streams: {compass: {kind: HEADING, frame: ned, columns: {heading: azimuth}, units: {heading: deg}}}
"""


def test_an_azimuth_becomes_a_heading(tmp_path: Path) -> None:
    s = read(tmp_path, "t,azimuth\n1.5,90\n2.5,0\n", HEADING).streams["compass"]
    np.testing.assert_allclose(s.z[:, 0], [0, np.pi / 2], atol=1e-12)
    assert s.t.tolist() == [1_500_000_000, 2_500_000_000]


POSE = """
time: {column: t, unit: ms, offset_s: 1.0}
streams:
  pose: {kind: POSE, frame: ned, columns: {x: n, y: e, z: d, yaw: yaw}, sigma: [1, 1, 1, 0.1, 0.1, 0.1]}
  velocity: {kind: GNSS_VELOCITY, frame: ned, columns: {v_north: vn, v_east: ve, v_up: vd}, sigma: [sv, sv, sv]}
"""


def test_north_east_down_and_yaw(tmp_path: Path) -> None:
    log = read(tmp_path, "t,n,e,d,yaw,vn,ve,vd,sv\n100,1,2,3,1.5707963267948966,4,5,6,0.5\n", POSE)
    pose, velocity = log.streams["pose"], log.streams["velocity"]
    np.testing.assert_allclose(pose.z[0, :3], [2, 1, -3])
    np.testing.assert_allclose(np.abs(pose.z[0, 3:]), [0, 0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(pose.var[0], [1, 1, 1, 0.01, 0.01, 0.01])
    np.testing.assert_allclose(velocity.z[0], [5, 4, -6])
    np.testing.assert_allclose(velocity.var[0], 0.25)
    assert pose.t[0] == 1_100_000_000


def test_blanks_broken_cells_and_ragged_rows(tmp_path: Path) -> None:
    rows = "t,azimuth\n1,90\n2,\n3,nan\n4,ninety\n5,45,7\n6\nsix,3\n7,10\n8,1"
    log = read(tmp_path, rows, HEADING)
    s = log.streams["compass"]
    assert s.t.tolist() == [10**9, 7 * 10**9, 8 * 10**9] and s.malformed == 1
    assert any("2 rows have too many or too few" in n for n in log.notes)
    assert any("1 rows have no readable stamp" in n for n in log.notes)


def test_iso_times_and_gps_time(tmp_path: Path) -> None:
    iso = HEADING.replace("{column: t}", "{column: t, unit: iso}")
    s = read(tmp_path, "t,azimuth\n2024-05-01T12:00:00.250Z,0\n2024-05-01T14:00:01+02:00,0\n", iso).streams["compass"]
    assert s.t.tolist() == [1_714_564_800_250_000_000, 1_714_564_801_000_000_000]
    gps = HEADING.replace("{column: t}", "{column: t, epoch: gps}")
    assert read(tmp_path, "t,azimuth\n1398600018.5,0\n", gps).streams["compass"].t[0] == 1_714_564_800_500_000_000


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_every_end_of_line(tmp_path: Path, end: str) -> None:
    s = read(tmp_path, end.join(["t,azimuth", "1,90", "2,0", ""]), HEADING).streams["compass"]
    assert s.t.tolist() == [10**9, 2 * 10**9]


def test_a_commented_header_and_a_file_without_one(tmp_path: Path) -> None:
    assert len(read(tmp_path, "# made by x\n#t,azimuth\n1,90\n2,80\n", HEADING).streams["compass"]) == 2
    assert len(read(tmp_path, "1,90\n2,80\n", HEADING + "names: [t, azimuth]").streams["compass"]) == 2


@pytest.mark.parametrize(
    ("mapping", "says"),
    [
        (HEADING.replace("azimuth}", "azimut}"), "no column 'azimut'.*did you mean 'azimuth'"),
        (HEADING.replace("HEADING", "HEDING"), "streams.compass.kind.*did you mean 'HEADING'"),
        (HEADING.replace("heading: deg", "heading: degrees"), "streams.compass.units.*no unit 'degrees'"),
        (HEADING.replace("heading: azimuth", "head: azimuth"), "streams.compass: HEADING has no column 'head'"),
        (
            HEADING.replace("frame: ned", "farme: ned"),
            "m.yaml:.*streams.compass.farme: unknown key .did you mean 'frame'",
        ),
        (HEADING.replace("{column: t}", "{unit: s}"), "time.column: is missing"),
        (HEADING.replace("frame: ned", "sigma: [1, 2]"), "needs 1 standard deviation, got 2"),
        ("{", "not YAML"),
        ("3", "no mapping of keys to values"),
    ],
)
def test_faults_of_the_mapping_name_their_place(tmp_path: Path, mapping: str, says: str) -> None:
    with pytest.raises(ConfigError, match=says) as e:
        read(tmp_path, "t,azimuth\n1,90\n", mapping)
    assert "\n" not in str(e.value)


def test_no_usable_row_is_no_log(tmp_path: Path) -> None:
    for rows in ("t,azimuth\n", "t,azimuth\nx,y\n"):
        with pytest.raises(DataError):
            read(tmp_path, rows, HEADING)


def test_the_mapping_has_a_schema() -> None:
    schema = CsvMapping.model_json_schema()
    assert set(schema["required"]) == {"streams"} and schema["additionalProperties"] is False


@given(st.integers(-(2**61), 2**61))
def test_stamps_survive_text_to_the_nanosecond(t: int) -> None:
    back, good = to_nanoseconds([seconds_text(t)], "s")
    assert good[0] and back[0] == t


@given(st.text("0123456789.eE+-:TZ naif_é", max_size=20), st.sampled_from(["s", "ns", "iso"]))
def test_any_text_is_a_stamp_or_is_not(text: str, unit: str) -> None:
    t, good = to_nanoseconds([text], unit)
    assert good[0] or t[0] == 0


def test_a_recorded_rostopic_dump(recordings: Path, tmp_path: Path) -> None:
    mapping = """
time: {column: field.header.stamp, unit: ns, arrival: time}
streams:
  rtk:
    kind: GNSS
    columns: {lat: field.latitude, lon: field.longitude, alt: field.altitude}
    units: {lat: deg, lon: deg}
    altitude: ELLIPSOID
    extra: {fix: field.status.status}
    values: {fix: {-1: 0, 0: 1, 1: 2, 2: 5}}
"""
    case = recordings / "uwb-outdoor" / "Dynamic_measurements" / "LOS" / "Trajectory_A" / "Case_1"
    log = read_csv(case / "gnss.csv", write(tmp_path, "m.yaml", mapping.encode()))
    s = log.streams["rtk"]
    assert s.t[0] == 1_734_501_485_500_326_730 and (s.t_arrival > s.t).all() and not log.notes
    assert s.rate == pytest.approx(8, rel=0.1)
