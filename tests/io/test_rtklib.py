"""RTKLIB solutions: time, order of deviations, coordinates, cut files."""

from pathlib import Path

import numpy as np
import pymap3d
import pytest
from flight_logs import write

import gnss_logs as made
from outrider.data import Altitude, Fix, Kind
from outrider.errors import DataError
from outrider.io import detect, read_log


@pytest.mark.parametrize("dated", [False, True])
def test_gps_time_becomes_utc_and_deviations_are_turned(tmp_path: Path, dated: bool) -> None:
    log = read_log(write(tmp_path, "a.pos", made.pos(dated=dated)))
    s = log.streams["solution"]
    np.testing.assert_array_equal(s.t, made.begin_ns() + np.arange(made.N) * 10**9)
    np.testing.assert_allclose(np.degrees(s.z[:, :2]), [made.place(k) for k in range(made.N)], rtol=0, atol=1e-9)
    np.testing.assert_allclose(s.var[0], [0.01**2, 0.02**2, 0.03**2])  # east, north, up
    assert s.altitude is Altitude.ELLIPSOID and set(s.extra["fix"]) == {Fix.FIXED.value} and not log.notes
    assert s.extra["ratio"][0] == 40 and s.extra["satellites"][0] == 12


@pytest.mark.parametrize(("date", "lead"), [("2016/12/31", 17), ("2017/01/02", 18), ("1999/06/01", 13)])
def test_leap_seconds_of_the_day(tmp_path: Path, date: str, lead: int) -> None:
    data = made.pos(dated=True).decode().replace("2024/05/02", date).splitlines()
    t = read_log(write(tmp_path, "a.pos", "\n".join(data).encode())).streams["solution"].t
    stamped = np.datetime64(date.replace("/", "-") + "T00:00:08").astype("datetime64[s]").astype(np.int64)
    assert t[0] == (int(stamped) - lead) * 10**9


def test_earth_centred_and_baseline(tmp_path: Path) -> None:
    text = made.pos("x-ecef(m) y-ecef(m) z-ecef(m)").decode()
    lat, lon = made.place(0)
    xyz = " ".join(f"{v:.4f}" for v in pymap3d.geodetic2ecef(lat, lon, made.ALT + made.GEOID))
    head, row = text.splitlines()[:3], text.splitlines()[3].split()
    log = read_log(write(tmp_path, "a.pos", "\n".join([*head, " ".join([*row[:2], xyz, *row[5:]])]).encode()))
    np.testing.assert_allclose(log.streams["solution"].z[0, :2], np.radians([lat, lon]), rtol=0, atol=1e-10)
    assert log.streams["solution"].z[0, 2] == pytest.approx(made.ALT + made.GEOID, abs=1e-3)
    line = " ".join([*row[:2], "1.5 2.5 -0.5", *row[5:]])
    head[2] = head[2].replace("x-ecef(m) y-ecef(m) z-ecef(m)", "e-baseline(m)  n-baseline(m)  u-baseline(m)")
    s = read_log(write(tmp_path, "b.pos", "\n".join([*head, line]).encode())).streams["solution"]
    assert s.kind is Kind.POSITION and s.z[0].tolist() == [1.5, 2.5, -0.5]


def test_degrees_minutes_seconds_and_geodetic_height(tmp_path: Path) -> None:
    head = "% (lat/lon/height=WGS84/geodetic,Q=1:fix)\n%  UTC  latitude(d'\") longitude(d'\") height(m) Q ns\n"
    row = "2024/05/01 12:00:00.000 -33 30 36.0 151 12 0.0 10.0 5 7\n"
    s = read_log(write(tmp_path, "a.pos", (head + row).encode())).streams["solution"]
    np.testing.assert_allclose(np.degrees(s.z[0, :2]), [-33.51, 151.2], rtol=0, atol=1e-12)
    assert s.altitude is Altitude.MSL and s.t[0] == 1_714_564_800 * 10**9 and np.isnan(s.var).all()


def test_a_cut_line_is_left_out_and_counted(tmp_path: Path) -> None:
    log = read_log(write(tmp_path, "a.pos", made.pos()[:-30]))
    assert len(log.streams["solution"]) == made.N - 1 == len(log) and log.streams["solution"].malformed == 1
    assert any("1 lines could not be read" in n for n in log.notes)


def test_found_by_content_and_refused_without_a_header(tmp_path: Path) -> None:
    assert detect(write(tmp_path, "a.txt", made.pos())) == "rtklib solution"
    rows = b"\n".join(made.pos().splitlines()[3:])
    with pytest.raises(DataError, match="no line says what its columns are"):
        read_log(write(tmp_path, "b.pos", rows))


@pytest.mark.parametrize("name", ["demo5_b34f_f.pos", "py_0315f.pos"])
def test_recorded_solutions(recordings: Path, name: str) -> None:
    path = recordings / "rtklib-py" / "data" / "u-blox" / name
    s = read_log(path).streams["solution"]
    lines = [line for line in path.read_text().splitlines() if not line.startswith("%")]
    rows = np.array([line.split()[2:] for line in lines], float)
    np.testing.assert_allclose(np.degrees(s.z[:, :2]), rows[:, :2], rtol=0, atol=1e-12)
    np.testing.assert_allclose(s.var, rows[:, [6, 5, 7]] ** 2)
    assert (s.extra["fix"] == Fix.FIXED.value).sum() == (rows[:, 3] == 1).sum()
    assert len(s) == 4521 and s.rate == pytest.approx(1.0)
