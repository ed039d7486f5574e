"""Telemetry logs: units, frames, the two clocks, several vehicles, damage, and truth kept apart."""

from pathlib import Path

import numpy as np
import pytest
from flight_logs import ALT, BOOT, DOWN, EAST, LAT, LON, NORTH, UNIX, place, tlog, write

from outrider.core.geodesy import geodetic_to_enu
from outrider.data import Fix, Kind
from outrider.errors import DataError
from outrider.io.mavlink import read_sim_truth, read_tlog

G = 9.80665


def test_units_and_frames(tmp_path: Path) -> None:
    log = read_tlog(write(tmp_path, "f.tlog", tlog()), robot="copter")
    assert {s.robot for s in log} == {"copter"}
    np.testing.assert_allclose(log.streams["RAW_IMU"].z[0], [0.01, -0.02, -0.5, 0.102 * G, -0.025 * G, G], atol=1e-9)
    np.testing.assert_allclose(log.streams["RAW_IMU#mag"].z[0], [200, -50, -400])
    gps = log.streams["GPS_RAW_INT"]
    lat, lon, alt = place(5)
    np.testing.assert_allclose(gps.z[1, :2], np.radians([lat, lon]), rtol=0, atol=2e-9)
    assert gps.z[1, 2] == pytest.approx(alt) and gps.extra["fix"][0] == Fix.FIXED.value
    np.testing.assert_allclose(gps.var[0], [0.25, 0.25, 0.64])
    assert gps.extra["hdop"][0] == 0.9 and gps.extra["alt_ellipsoid"][0] == pytest.approx(ALT + 47)
    velocity = log.streams["GPS_RAW_INT#velocity"].z[0]
    np.testing.assert_allclose(velocity[:2], [EAST, NORTH], atol=1e-3)
    assert np.isnan(velocity[2])  # the message has no vertical velocity
    assert log.streams["SCALED_PRESSURE"].z[0, 0] == pytest.approx(500, abs=2)


def test_the_estimate_and_when_the_autopilot_disowns_it(tmp_path: Path) -> None:
    s = read_tlog(write(tmp_path, "f.tlog", tlog())).streams["autopilot"]
    np.testing.assert_allclose(s.z[3, 3:7] * np.sign(s.z[3, 6]), [0, 0, 0, 1], atol=1e-6)  # yaw 90 degrees: east
    np.testing.assert_allclose(s.z[3, 7:], [EAST, NORTH, -DOWN])
    np.testing.assert_array_equal(s.extra["valid"], np.arange(len(s)) < 10)  # flags drop "absolute position" halfway
    enu = geodetic_to_enu(s.extra["lat"], s.extra["lon"], s.extra["alt"], *np.radians([LAT, LON]), ALT)
    np.testing.assert_allclose(s.z[:, :3], enu, atol=1e-6)


def test_stamps_count_from_boot_and_arrivals_follow(tmp_path: Path) -> None:
    log = read_tlog(write(tmp_path, "f.tlog", tlog(latency=4000)))
    imu = log.streams["RAW_IMU"]
    assert imu.t[0] == BOOT * 1000 and set(np.diff(imu.t)) == {20_000_000}
    assert (imu.t_arrival >= imu.t).all() and (imu.t_arrival - imu.t).max() < 1_000_000  # constant latency cancels
    status = log.streams["ekf_status"]  # has no stamp of its own
    np.testing.assert_allclose(status.t, imu.t[::5], atol=1_000_000)


def test_a_receiver_without_time_is_stamped_by_its_arrival(tmp_path: Path) -> None:
    gps = read_tlog(write(tmp_path, "f.tlog", tlog(gps_stamp=False))).streams["GPS_RAW_INT"]
    np.testing.assert_allclose(gps.t, BOOT * 1000 + np.arange(len(gps)) * 100_000_000, atol=1_000_000)


def test_the_clock_runs_on_across_a_reboot(tmp_path: Path) -> None:
    both = tlog(boot=60_000_000) + tlog(boot=1_000_000, start=30_000_000)
    log = read_tlog(write(tmp_path, "f.tlog", both))
    t = log.streams["RAW_IMU"].t
    assert (np.diff(t) > 0).all() and t[100] - t[0] == pytest.approx(30e9, abs=1e7)
    assert any("rebooted 1 times" in n for n in log.notes)


def test_two_vehicles_in_one_log(tmp_path: Path) -> None:
    log = read_tlog(write(tmp_path, "f.tlog", tlog(system=1) + tlog(system=7)), robot="uav")
    assert log.streams["RAW_IMU"].robot == "uav" and log.streams["sys7/RAW_IMU"].robot == "uav_7"


def test_truth_is_read_apart_and_never_part_of_the_log(tmp_path: Path) -> None:
    path = write(tmp_path, "f.tlog", tlog())
    truth, log = read_sim_truth(path), read_tlog(path)
    assert not any("SIM" in s.name for s in log)
    np.testing.assert_allclose(truth.v[0], [EAST, NORTH, -DOWN])
    np.testing.assert_allclose(truth.p[-1, :2], np.array([EAST, NORTH]) * 1.9, rtol=5e-3)
    assert abs(truth.yaw[0]) < 1e-6 and truth.datum is not None
    with pytest.raises(DataError, match="SIM_STATE"):
        read_sim_truth(write(tmp_path, "g.tlog", tlog()[:60]))


def test_a_wrong_checksum_is_counted_and_its_message_left_out(tmp_path: Path) -> None:
    data = bytearray(tlog())
    data[8 + 10 + 8 + 3] ^= 0x40  # in the first message's payload, past the arrival time and the frame's head
    log = read_tlog(write(tmp_path, "f.tlog", bytes(data)))
    assert log.streams["RAW_IMU"].malformed == 1 and len(log.streams["RAW_IMU"]) == 99
    assert any("1 damaged RAW_IMU" in n for n in log.notes)


def test_garbage_between_frames_costs_nothing_else(tmp_path: Path) -> None:
    data = tlog()
    log = read_tlog(write(tmp_path, "f.tlog", data + b"\xfd\x00garbage\xfe" * 20 + data))
    assert len(log.streams["RAW_IMU"]) == 200 and any("belong to no message" in n for n in log.notes)


def test_truncation_is_noted(tmp_path: Path) -> None:
    log = read_tlog(write(tmp_path, "f.tlog", tlog()[:-5]))
    assert any("truncated" in n for n in log.notes) and len(log.streams["RAW_IMU"]) == 99


def test_columns_equal_what_pymavlink_decodes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The columnar decoder against the library's own, message by message."""
    monkeypatch.setenv("MAVLINK20", "1")
    from pymavlink.dialects.v20 import ardupilotmega as m

    from outrider.io._tlog import scan

    data = tlog()
    table = scan(data, ("GPS_RAW_INT",)).vehicles[1]["GPS_RAW_INT"]
    parser, seen, i = m.MAVLink(None), [], 0
    while i < len(data):
        size = 8 + 10 + data[i + 9] + 2
        seen += [x for x in parser.parse_buffer(data[i + 8 : i + size]) or [] if x.get_type() == "GPS_RAW_INT"]
        i += size
    assert len(seen) == len(table) and table.arrival[0] == UNIX + 4000
    for name in seen[0].fieldnames:
        np.testing.assert_array_equal(table.cells[name], [getattr(x, name) for x in seen])


def test_a_real_flight_through_a_gnss_outage(recordings: Path) -> None:
    path = recordings / "autopilot" / "copter_gps_outage_wind.tlog"
    log, truth = read_tlog(path), read_sim_truth(path)
    assert log.streams["RAW_IMU"].rate == pytest.approx(50, rel=0.01) and not log.notes
    s, v = log.streams["autopilot"], log.streams["GPS_RAW_INT#velocity"]
    assert truth.datum is not None
    place = [s.extra[c] for c in ("lat", "lon", "alt")]
    p = geodetic_to_enu(*place, truth.datum.lat, truth.datum.lon, truth.datum.alt)
    true = np.column_stack([np.interp(s.t, truth.t, truth.p[:, k]) for k in range(3)])
    off, valid = np.linalg.norm(p - true, axis=1), s.extra["valid"] > 0
    assert off[valid].max() < 1.0 and np.nanmax(off[~valid]) > 10  # the frozen position is disowned
    moving = (v.t > 47e9) & (v.t < 82e9) & (v.extra["fix"] > 0)  # without a fix the receiver repeats its last stamp
    east, north = (np.interp(v.t[moving], truth.t, truth.v[:, k]) for k in range(2))
    assert np.sqrt(np.mean((v.z[moving, 0] - east) ** 2 + (v.z[moving, 1] - north) ** 2)) < 0.15
    assert log.of(Kind.STATUS)[0].name == "ekf_status"
