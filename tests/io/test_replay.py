"""EKF2 replay files: the order of the columns, the delay, and EKF2's own answer."""

from pathlib import Path

import numpy as np
import pytest
from flight_logs import BOOT, DOWN, EAST, NORTH, place, replay, write

from outrider.core.geodesy import geodetic_to_enu
from outrider.errors import DataError
from outrider.io.replay import GPS_DELAY, read_change_indication, read_replay

E7 = np.radians(1e-7)


def test_longitude_stands_before_latitude(tmp_path: Path) -> None:
    log = read_replay(write(tmp_path, "r.csv", replay()), robot="iris")
    assert {s.robot for s in log} == {"iris"}
    gps, (lat, lon, alt) = log.streams["gps"], place(5)
    np.testing.assert_allclose(gps.z[1, :2], np.radians([lat, lon]), rtol=0, atol=1e-9)
    assert gps.z[1, 2] == pytest.approx(alt)
    np.testing.assert_allclose(log.streams["gps#velocity"].z[0], [EAST, NORTH, -DOWN])
    np.testing.assert_allclose(log.streams["imu"].z[0], [0.01, -0.02, -0.5, 1.0, -0.25, 9.81])
    np.testing.assert_allclose(log.streams["mag"].z[0], [0.2, -0.05, -0.4])
    assert log.streams["imu"].t[0] == BOOT * 1000
    np.testing.assert_array_equal(gps.t_arrival - gps.t, GPS_DELAY)


def test_damaged_rows_are_counted_where_they_belong(tmp_path: Path) -> None:
    bad = b"1,imu,1,2,three,4,5,6\n2,imu,1,2\nnoise\n3,sonar,1\n99999999999999999999,baro,1\n\n"
    log = read_replay(write(tmp_path, "r.csv", replay() + bad))
    assert log.streams["imu"].malformed == 2 and log.streams["baro"].malformed == 1
    assert any("2 rows name no known sensor" in n for n in log.notes)


def test_what_dates_from_before_the_clock_begins_is_left_out_and_told(tmp_path: Path) -> None:
    rows = "".join(
        f"{us},imu,0,0,-9.8,0,0,0\n{us},gps,1000,76000000,450000000,0,0,0\n" for us in range(50_000, 600_000, 50_000)
    )
    log = read_replay(write(tmp_path, "r.csv", rows.encode()))
    gps = log.streams["gps"]
    assert len(log.streams["imu"]) == 11 and len(gps) == len(log.streams["gps#velocity"]) == 9  # at 50 and 100 ms
    assert gps.t[0] == 40_000_000 and gps.t_arrival[0] == 150_000_000
    assert any("2 of 11 records of gps date from before the clock begins" in n for n in log.notes)


def test_what_is_no_state_file_says_so(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="24 states"):
        read_change_indication(write(tmp_path, "c.csv", replay()))


@pytest.mark.parametrize("name", ["iris_gps", "ekf_gsf_reset"])
def test_a_recorded_flight_agrees_with_ekf2(recordings: Path, name: str) -> None:
    folder = recordings / "px4-ecl" / "test"
    log = read_replay(folder / "replay_data" / f"{name}.csv")
    ekf = read_change_indication(folder / "change_indication" / f"{name}.csv")
    assert ekf.valid[10:].all() and not ekf.valid[0]
    gps, v = log.streams["gps"], log.streams["gps#velocity"]
    late = gps.t > 12e9
    answer = np.column_stack([np.interp(v.t[late], ekf.t, ekf.v[:, k]) for k in range(3)])
    assert np.sqrt(np.mean((answer - v.z[late]) ** 2, axis=0)).max() < 0.13
    p = geodetic_to_enu(*gps.z.T, *gps.z[0])
    answer = np.column_stack([np.interp(gps.t[late], ekf.t, ekf.p[:, k]) for k in range(2)])
    off = (answer - p[late, :2]) - (answer - p[late, :2])[0]
    assert np.abs(off).max() < 1.5  # swapped columns would be off by the length of the flight


def test_flow_turns_about_forward_and_left(tmp_path: Path) -> None:
    path = tmp_path / "flow.csv"
    rows = [f"{us},imu,0,0,-9.8,0,0,0\n{us},flow,0.3,0.2,0,0,100" for us in range(10_000, 200_000, 10_000)]
    path.write_text("\n".join(rows) + "\n")
    np.testing.assert_allclose(read_replay(path).streams["flow"].z, np.tile([0.3, -0.2], (19, 1)))
