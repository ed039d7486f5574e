"""ArduPilot on-board logs: what the format says, by a log written from it byte by byte."""

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from flight_logs import BOOT, DOWN, EAST, NORTH, Dataflash, dataflash, place, write

from outrider.data import Altitude, Fix, Kind
from outrider.errors import DataError
from outrider.io.dataflash import read_dataflash


def test_units_frames_and_instances(tmp_path: Path) -> None:
    log = read_dataflash(write(tmp_path, "1.BIN", dataflash()), robot="rover")
    assert {s.robot for s in log} == {"rover"} and not any("SIM" in s.name for s in log)
    for name in ("IMU", "IMU_1"):
        np.testing.assert_allclose(log.streams[name].z[0], [0.01, -0.02, -0.5, 1, -0.25, 9.81], atol=1e-6)
    assert log.streams["IMU"].t[0] == BOOT * 1000
    np.testing.assert_allclose(log.streams["MAG"].z[0], [200, -50, -400])
    baro = log.streams["BARO"]
    assert baro.altitude is Altitude.PRESSURE and baro.z[0, 0] == pytest.approx(500, abs=2)


def test_gnss_takes_its_accuracy_and_its_time_from_the_record_beside(tmp_path: Path) -> None:
    log = read_dataflash(write(tmp_path, "1.BIN", dataflash()))
    gps, velocity = log.streams["GPS"], log.streams["GPS#velocity"]
    lat, lon, alt = place(5)
    np.testing.assert_allclose(gps.z[1, :2], np.radians([lat, lon]), rtol=0, atol=2e-9)
    assert gps.z[1, 2] == pytest.approx(alt, abs=0.01) and gps.extra["fix"][0] == Fix.FIXED.value
    np.testing.assert_allclose(gps.var[0], [0.25, 0.25, 0.64])
    np.testing.assert_allclose(velocity.z[0], [EAST, NORTH, -DOWN], atol=1e-5)
    np.testing.assert_allclose(velocity.var[0], 0.04)
    np.testing.assert_array_equal(gps.t_arrival - gps.t, 60_000_000)
    assert gps.extra["utc"][0] == pytest.approx(315_964_800 - 18 + 2280 * 604_800 + 345_600)


def test_the_first_cores_answer(tmp_path: Path) -> None:
    s = read_dataflash(write(tmp_path, "1.BIN", dataflash())).streams["autopilot"]
    assert s.kind is Kind.ESTIMATE
    np.testing.assert_allclose(s.z[3, 3:7] * np.sign(s.z[3, 6]), [0, 0, 0, 1], atol=1e-6)
    np.testing.assert_allclose(s.z[3, 7:], [EAST, NORTH, -DOWN])
    np.testing.assert_array_equal(s.extra["valid"], np.arange(len(s)) < 10)


def test_pymavlink_reads_the_same_log(tmp_path: Path) -> None:
    """The test's own writer is no oracle for the reader: pymavlink reads the file too, and agrees."""
    from pymavlink.DFReader import DFReader_binary

    path = write(tmp_path, "1.BIN", dataflash())
    theirs, rows = DFReader_binary(str(path), zero_time_base=True), []
    while (m := theirs.recv_match(type=["GPS"])) is not None:
        rows.append((m.Lat, m.Lng, m.Alt))
    theirs.filehandle.close()
    ours = read_dataflash(path).streams["GPS"].z
    np.testing.assert_allclose(np.column_stack([np.degrees(ours[:, :2]), ours[:, 2]]), rows, rtol=0, atol=1e-9)


def test_garbage_is_stepped_over(tmp_path: Path) -> None:
    data = dataflash()
    log = read_dataflash(write(tmp_path, "1.BIN", data + b"\xa3\x95\x01\x00" * 200 + data))
    assert len(log.streams["IMU"]) == 200 and any("belong to no record" in n for n in log.notes)


def test_a_record_that_claims_no_length_does_not_hang(tmp_path: Path) -> None:
    log = Dataflash()
    log.format("BAD", "Q", "TimeUS", kind=0xF0, length=1)
    with pytest.raises(DataError, match="no sensor record"):
        read_dataflash(write(tmp_path, "1.BIN", bytes(log.out) + b"\xa3\x95\xf0" * 50))


def test_gps_weeks_become_utc(tmp_path: Path) -> None:
    path = tmp_path / "flight.bin"
    path.write_bytes(dataflash())
    utc = next(s.extra["utc"] for s in read_dataflash(path) if s.kind is Kind.GNSS)
    # week 2280 began on Sunday 2023-09-17; four days later, less the 18 leap seconds since 1980
    assert utc[0] == datetime(2023, 9, 20, 23, 59, 42, tzinfo=UTC).timestamp()


def test_flow_turns_about_forward_and_left(tmp_path: Path) -> None:
    path, log = tmp_path / "flight.bin", Dataflash()
    log.format("OF", "QBffff", "TimeUS,Qual,flowX,flowY,bodyX,bodyY")
    for k in range(20):
        log.put("OF", 1_000_000 + 50_000 * k, 200, 0.3, 0.2, 0.0, 0.0)
    path.write_bytes(bytes(log.out))
    (flow,) = read_dataflash(path).streams.values()
    np.testing.assert_allclose(flow.z, np.tile([0.3, -0.2], (20, 1)), atol=1e-6)  # right becomes left
