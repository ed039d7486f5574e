"""PX4 logs: units, frames and spellings; what a damaged file gives."""

from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from flight_logs import ALT, BOOT, DOWN, EAST, LAT, LON, NORTH, Ulog, place, ulog, write

from outrider.core.geodesy import geodetic_to_enu
from outrider.data import Altitude, Fix, Kind
from outrider.errors import DataError
from outrider.io import ulog as ulog_module
from outrider.io.trajectories import read_trajectory
from outrider.io.ulog import _Source, read_ulog


@pytest.mark.parametrize("old", [False, True])
def test_both_spellings_give_the_same_flight(tmp_path: Path, old: bool) -> None:
    log = read_ulog(write(tmp_path, "flight.ulg", ulog(old=old)), robot="quad")
    imu, gps = log.streams["sensor_combined"], log.streams["vehicle_gps_position"]
    assert {s.robot for s in log} == {"quad"}
    np.testing.assert_allclose(imu.z[3], [0.01, -0.02, -0.5, 1.0, -0.25, 9.81], atol=1e-6)
    assert imu.t[0] == BOOT * 1000 and imu.rate == pytest.approx(50)
    lat, lon, alt = place(5)
    np.testing.assert_allclose(gps.z[1], [np.radians(lat), np.radians(lon), alt], rtol=0, atol=2e-3)
    np.testing.assert_allclose(gps.z[1, :2], np.radians([lat, lon]), rtol=0, atol=1e-9)
    np.testing.assert_allclose(gps.var[0], [0.25, 0.25, 0.64], rtol=1e-6)
    assert gps.altitude is Altitude.MSL and gps.extra["fix"][0] == Fix.SINGLE.value
    assert gps.extra["alt_ellipsoid"][0] == pytest.approx(ALT + 47.0)
    velocity = log.streams["vehicle_gps_position#velocity"]
    np.testing.assert_allclose(velocity.z[0], [EAST, NORTH, -DOWN])
    np.testing.assert_allclose(velocity.var[0], 0.04, rtol=1e-6)


def test_the_stated_delay_dates_gnss_back_and_keeps_the_arrival(tmp_path: Path) -> None:
    log = read_ulog(write(tmp_path, "flight.ulg", ulog()))
    gps = log.streams["vehicle_gps_position"]
    assert set(gps.t_arrival - gps.t) == {100_000_000}
    assert any("EKF2_GPS_DELAY" in n for n in log.notes) and any("lost data 1 times, 0.1 s" in n for n in log.notes)
    imu = log.streams["sensor_combined"]
    assert (imu.t == imu.t_arrival).all()


def test_the_autopilots_answer_is_in_a_true_tangent_plane(tmp_path: Path) -> None:
    """PX4 projects on a sphere; over the flight the answer must be what its latitudes say on the ellipsoid."""
    path = write(tmp_path, "flight.ulg", ulog())
    s = read_ulog(path).streams["ekf2"]
    assert s.kind is Kind.ESTIMATE and s.extra["valid"].all()
    np.testing.assert_allclose(s.z[4, 3:7] * np.sign(s.z[4, 6]), [0, 0, 0, 1], atol=1e-6)  # faces east: no turn in ENU
    np.testing.assert_allclose(s.z[4, 7:], [EAST, NORTH, -DOWN], atol=1e-6)
    np.testing.assert_allclose(s.extra["lat"][0], np.radians(LAT), atol=1e-15)
    enu = geodetic_to_enu(s.extra["lat"], s.extra["lon"], s.extra["alt"], np.radians(LAT), np.radians(LON), ALT)
    np.testing.assert_allclose(s.z[:, :3], enu, atol=1e-6)
    seconds = (s.t - s.t[0]) * 1e-9
    np.testing.assert_allclose(s.z[:, 0], EAST * seconds, rtol=4e-3, atol=1e-3)
    assert np.abs(s.z[-1, 0] / (EAST * seconds[-1]) - 1) > 1e-3  # the sphere is not the ellipsoid
    trajectory = read_trajectory(path)
    assert trajectory.datum is not None and trajectory.datum.altitude == "MSL"
    np.testing.assert_allclose(trajectory.p, s.z[:, :3], atol=1e-6)


def test_range_finder_says_which_records_count(tmp_path: Path) -> None:
    s = read_ulog(write(tmp_path, "flight.ulg", ulog())).streams["distance_sensor"]
    assert s.extra["valid"][0] == 0 and s.extra["valid"][1:].all() and s.z[1, 0] == pytest.approx(1.5)


def test_separate_gyroscope_and_accelerometer_are_paired(tmp_path: Path) -> None:
    log = Ulog()
    gyro = log.topic("sensor_gyro", "uint64_t timestamp;uint64_t timestamp_sample;float x;float y;float z")
    accel = log.topic("sensor_accel", "uint64_t timestamp;uint64_t timestamp_sample;float x;float y;float z")
    for k in range(20):
        gyro(5000 * k + 10_900, 5000 * k + 10_000, k, 0.0, 0.0)
        if k < 10:
            accel(5000 * k + 12_000, 5000 * k + 11_000, 0.0, 0.0, -k)
    s = read_ulog(write(tmp_path, "raw.ulg", log.bytes())).streams["sensor_gyro"]
    assert s.t[0] == 10_000_000 and s.t_arrival[0] == 10_900_000
    np.testing.assert_allclose(s.z[:10, 0], s.z[:10, 5])


def test_integrated_imu_becomes_rates(tmp_path: Path) -> None:
    log = Ulog()
    fields = "uint64_t timestamp;float[3] delta_angle;float[3] delta_velocity"
    imu = log.topic("vehicle_imu", f"{fields};uint32_t delta_angle_dt;uint32_t delta_velocity_dt")
    imu(1000, 0.01, 0.0, 0.0, 0.0, 0.0, -0.0981, 10_000, 10_000)
    s = read_ulog(write(tmp_path, "v.ulg", log.bytes())).streams["vehicle_imu"]
    np.testing.assert_allclose(s.z[0], [1.0, 0, 0, 0, 0, 9.81], atol=1e-6)


def test_zero_means_not_stated(tmp_path: Path) -> None:
    log = Ulog()
    gps = log.topic(
        "vehicle_gps_position", "uint64_t timestamp;int32_t lat;int32_t lon;int32_t alt;float eph;float epv"
    )
    gps(1000, 474_000_000, 85_000_000, 1000, 0.0, 0.0)
    s = read_ulog(write(tmp_path, "z.ulg", log.bytes())).streams["vehicle_gps_position"]
    assert np.isnan(s.var).all() and s.extra["fix"][0] == Fix.UNKNOWN.value


def test_a_truncated_log_gives_what_was_written_and_says_so(tmp_path: Path) -> None:
    whole = ulog()
    full = read_ulog(write(tmp_path, "a.ulg", whole))
    part = read_ulog(write(tmp_path, "b.ulg", whole[: len(whole) * 2 // 3]))
    assert 0 < len(part) < len(full) and any("truncated" in n for n in part.notes)
    assert not any("truncated" in n for n in full.notes)
    k = len(part.streams["sensor_combined"])
    np.testing.assert_array_equal(part.streams["sensor_combined"].z, full.streams["sensor_combined"].z[:k])


def test_a_log_without_sensors_says_so(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no sensor record"):
        read_ulog(write(tmp_path, "x.ulg", Ulog().bytes()))


def test_a_search_in_damaged_definitions_moves_on_and_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """pyulog steps back by the length a record claims; with less than that to read it could go round for ever."""
    source = _Source(BytesIO(bytes(50)), 50, None)
    source.seek(40)
    assert len(source.read(3)) == 3 and len(source.read(1000)) == 7 and source.cut
    assert source.seek(-2 - 1000, 1) == 41  # one byte after the record's beginning
    monkeypatch.setattr(ulog_module, "RESERVE", 100)
    spins = 0
    while source.seek(0) == 0 and source.read(50):
        spins += 1
        assert spins < 20


@pytest.mark.parametrize("name", ["6ba1abc7-b433-4029-b8f5-3b2bb12d3b6c", "esc_status_log"])
def test_real_logs(recordings: Path, name: str) -> None:
    log = read_ulog(recordings / "px4-ulog-rs" / "tests" / "fixtures" / f"{name}.ulg")
    gps, ekf = log.of(Kind.GNSS)[0], log.streams["ekf2"]
    assert log.of(Kind.IMU) and log.of(Kind.BARO) and log.of(Kind.MAG)
    force = np.linalg.norm(log.of(Kind.IMU)[0].z[:, 3:].mean(axis=0))
    assert 8 < force < 12
    lat, lon = (np.interp(gps.t_arrival, ekf.t, ekf.extra[c]) for c in ("lat", "lon"))
    inside = (gps.t_arrival >= ekf.t[0]) & (gps.t_arrival <= ekf.t[-1])
    apart = geodetic_to_enu(lat, lon, gps.z[:, 2], gps.z[0, 0], gps.z[0, 1], gps.z[0, 2])
    apart = apart - geodetic_to_enu(gps.z[:, 0], gps.z[:, 1], gps.z[:, 2], gps.z[0, 0], gps.z[0, 1], gps.z[0, 2])
    assert np.sqrt(np.mean(np.sum(apart[inside, :2] ** 2, axis=1))) < 1.0


def test_a_real_log_in_todays_spelling(recordings: Path) -> None:
    log = read_ulog(recordings / "pyulog" / "test" / "sample_px4_events.ulg")
    gps = log.streams["vehicle_gps_position"]
    assert np.degrees(gps.z[0, 0]) == pytest.approx(47.398, abs=1e-3)
    assert log.streams["sensor_combined"].rate == pytest.approx(250, rel=0.01)
