"""NMEA and UBX: what other programs wrote is read as they meant it."""

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from flight_logs import write

import gnss_logs as made
from outrider.data import Altitude, EventLog, Fix, Kind
from outrider.errors import DataError
from outrider.io import read_log


def read(folder: Path, data: bytes | str) -> EventLog:
    return read_log(write(folder, "a.log", data.encode() if isinstance(data, str) else data))


def check_walk(log: EventLog, position: str, velocity: str) -> None:
    """The walk is where it was, when it was, as fast as it was."""
    s, v = log.streams[position], log.streams[velocity]
    expected = np.radians([made.place(k) for k in range(made.N)])
    np.testing.assert_allclose(s.z[:, :2], expected, rtol=0, atol=2e-9)
    np.testing.assert_allclose(s.z[:, 2], made.ALT)
    assert s.altitude is Altitude.MSL and set(s.extra["fix"]) == {Fix.FIXED.value}
    np.testing.assert_allclose(s.extra["alt_ellipsoid"], made.ALT + made.GEOID)
    assert np.abs(s.t - made.begin_ns() - np.arange(made.N) * 10**9).max() <= 1000
    np.testing.assert_allclose(v.z[:, :2], np.tile([made.EAST, made.NORTH], (made.N, 1)), atol=1e-4)


def test_sentences_over_midnight(tmp_path: Path) -> None:
    log = read(tmp_path, made.nmea())
    check_walk(log, "GGA", "RMC#velocity")
    np.testing.assert_allclose(log.streams["GGA"].var[0], [0.01**2, 0.02**2, 0.03**2])  # east, north, up
    assert any("20 of 20 RMC repeat GGA" in n for n in log.notes)


def test_messages(tmp_path: Path) -> None:
    log = read(tmp_path, made.ubx())
    check_walk(log, "NAV-PVT", "NAV-PVT#velocity")
    s = log.streams["NAV-PVT"]
    np.testing.assert_allclose(s.var[0], [0.014**2, 0.014**2, 0.02**2])
    assert s.extra["satellites"][0] == 17 and s.extra["pdop"][0] == pytest.approx(1.2)
    assert log.streams["NAV-PVT#velocity"].z[0, 2] == 0 and log.streams["NAV-PVT#velocity"].var[0, 0] == 0.05**2


def test_a_mixed_log_counts_a_solution_once(tmp_path: Path) -> None:
    log = read(tmp_path, made.mixed())
    assert set(log.streams) == {"NAV-PVT", "NAV-PVT#velocity"}
    check_walk(log, "NAV-PVT", "NAV-PVT#velocity")
    assert any("20 of 20 GGA repeat NAV-PVT" in n for n in log.notes)
    assert any(f"{5 * made.N} bytes are neither" in n for n in log.notes)


def test_what_only_nmea_says_fills_the_gaps_of_ubx(tmp_path: Path) -> None:
    log = read(tmp_path, b"".join(made.pvt(k) if k % 2 else made.nmea_epoch(k).encode() for k in range(made.N)))
    assert len(log.streams["NAV-PVT"]) == len(log.streams["GGA"]) == made.N // 2
    gaps = np.diff(np.sort(np.concatenate([log.streams["NAV-PVT"].t, log.streams["GGA"].t])))
    assert np.abs(gaps - 10**9).max() <= 1000


@pytest.mark.parametrize(
    ("quality", "fix"),
    [(0, Fix.NONE), (1, Fix.SINGLE), (2, Fix.DGNSS), (4, Fix.FIXED), (5, Fix.FLOAT), (6, Fix.NONE), (8, Fix.UNKNOWN)],
)
def test_qualities(tmp_path: Path, quality: int, fix: Fix) -> None:
    log = read(tmp_path, made.nmea_epoch(0) + "".join(made.nmea_epoch(k, quality) for k in range(1, 9)))
    s = log.streams["GGA"]
    assert set(s.extra["fix"][1:]) == {fix.value} and len(s) == 9
    assert np.isnan(s.z[1:, :2]).all() == (quality == 0)  # a blank is never a coordinate


def test_without_a_date_the_stamps_say_so(tmp_path: Path) -> None:
    log = read(tmp_path, "".join(made.nmea_epoch(k, names=("GGA",)) for k in range(made.N)))
    assert any("no sentence gives the date" in n for n in log.notes)
    np.testing.assert_array_equal(np.diff(log.streams["GGA"].t), 10**9)  # over midnight, too


def test_a_date_that_comes_late_or_with_another_sentence(tmp_path: Path) -> None:
    late = "".join(made.nmea_epoch(k, names=("GGA",)) for k in range(5))
    late += "".join(made.nmea_epoch(k, names=("GGA", "ZDA")) for k in range(5, made.N))
    s = read(tmp_path, late).streams["GGA"]
    np.testing.assert_array_equal(s.t, made.begin_ns() + np.arange(made.N) * 10**9)


def test_two_days_apart(tmp_path: Path) -> None:
    day = 86_400
    s = read(tmp_path, made.nmea_epoch(0, names=("GGA", "RMC")) + made.nmea_epoch(2 * day, names=("GGA", "RMC")))
    np.testing.assert_array_equal(s.streams["GGA"].t, made.begin_ns() + np.array([0, 2 * day * 10**9]))


def test_headings_of_two_antennas(tmp_path: Path) -> None:
    log = read(tmp_path, "".join(made.nmea_epoch(k, names=("GGA", "HDT")) for k in range(3)))
    np.testing.assert_allclose(log.streams["HDT"].z[:, 0], 0.0, atol=1e-12)  # east
    flags = {"gnssFixOK": 1, "relPosValid": 1, "relPosHeadingValid": 1, "carrSoln": 2}
    for moving in (0, 1):
        rel = made.ubx_message("NAV-RELPOSNED", version=1, iTOW=round(made.week_and_tow(3)[1] * 1000),
                               relPosHeading=180.0, accHeading=0.5, isMoving=moving, **flags)  # fmt: skip
        log = read(tmp_path, made.pvt(3) + rel)
        assert ("NAV-RELPOSNED" in log.streams) == bool(moving)
    s = log.streams["NAV-RELPOSNED"]
    assert s.kind is Kind.HEADING and s.z[0, 0] == pytest.approx(-np.pi / 2)
    assert s.var[0, 0] == pytest.approx(np.radians(0.5) ** 2, rel=1e-4) and s.t[0] == made.begin_ns() + 3 * 10**9


def test_high_precision_takes_week_and_fix_from_its_neighbours(tmp_path: Path) -> None:
    from pyubx2 import UBXReader

    tow = round(made.week_and_tow(5)[1] * 1000)
    high = made.ubx_message("NAV-HPPOSLLH", iTOW=tow, lat=47.4, lon=8.5, height=548_000, hMSL=500_000, hAcc=9.0,
                            vAcc=12.0, _HPlat=0.3e-7, _HPlon=0.0, _HPhMSL=0.2)  # fmt: skip
    log = read(tmp_path, made.pvt(0) + high + made.pvt(5))
    s = log.streams["NAV-HPPOSLLH"]
    assert s.t[0] == made.begin_ns() + 5 * 10**9 and s.extra["fix"][0] == Fix.FIXED.value
    theirs = UBXReader.parse(high)
    assert 47.4 < theirs.lat < 47.4 + 4e-8 and np.degrees(s.z[0, 0]) == pytest.approx(theirs.lat, abs=1e-12)
    assert s.z[0, 2] == pytest.approx(500.0002, abs=1e-9) and s.extra["hacc"][0] == pytest.approx(0.009)
    assert len(log.streams["NAV-PVT"]) == 1
    with pytest.raises(DataError, match="without a date"):
        read(tmp_path, high)


@pytest.mark.parametrize(
    ("fields", "fix"),
    [
        ({"fixType": 0}, Fix.NONE), ({"fixType": 2}, Fix.NONE), ({"fixType": 5}, Fix.NONE),
        ({"gnssFixOk": 0}, Fix.NONE),
        ({"invalidLlh": 1}, Fix.NONE), ({"carrSoln": 1}, Fix.FLOAT), ({"carrSoln": 0}, Fix.SINGLE),
        ({"carrSoln": 0, "diffSoln": 1}, Fix.DGNSS),
    ],
)  # fmt: skip
def test_fix_types(tmp_path: Path, fields: dict[str, int], fix: Fix) -> None:
    log = read(tmp_path, made.pvt(0) + made.pvt(1, **fields))
    assert log.streams["NAV-PVT"].extra["fix"].tolist() == [Fix.FIXED.value, fix.value]


def test_a_wrong_checksum_and_a_cut_are_counted(tmp_path: Path) -> None:
    data = bytearray(made.nmea() + made.ubx())
    data[40] ^= 1
    log = read(tmp_path, bytes(data[:-7]))
    assert any("2 sentences or messages are damaged" in n for n in log.notes)


def test_published_examples(tmp_path: Path) -> None:
    """u-blox 8 protocol specification: GGA, RMC and GST as printed there, with their checksums."""
    printed = (
        "$GPRMC,083559.00,A,4717.11437,N,00833.91522,E,0.004,77.52,091202,,,A*57\r\n"
        "$GPGGA,092725.00,4717.11399,N,00833.91590,E,1,08,1.01,499.6,M,48.0,M,,*5B\r\n"
    )
    s = read(tmp_path, printed).streams["GGA"]
    np.testing.assert_allclose(np.degrees(s.z[0, :2]), [47.2852332, 8.5652650], rtol=0, atol=1e-7)
    assert s.z[0, 2] == 499.6 and s.extra["hdop"][0] == 1.01 and np.isnan(s.var).all()
    assert s.t[0] == int(datetime(2002, 12, 9, 9, 27, 25, tzinfo=UTC).timestamp()) * 10**9


def test_pyubx2_and_pynmeagps_read_the_same(tmp_path: Path) -> None:
    """Independent parsers of the same bytes."""
    from pynmeagps import NMEAReader
    from pyubx2 import UBXReader

    ours = read(tmp_path, made.ubx()).streams["NAV-PVT"].z
    one = len(made.ubx()) // made.N
    theirs = [UBXReader.parse(made.ubx()[k * one : (k + 1) * one]) for k in range(made.N)]
    np.testing.assert_allclose(np.degrees(ours[:, :2]), [(m.lat, m.lon) for m in theirs], rtol=0, atol=1e-12)
    ours = read(tmp_path, made.nmea()).streams["GGA"].z
    parsed = [NMEAReader.parse(line) for line in made.nmea().splitlines(keepends=True)]
    told = [(m.lat, m.lon) for m in parsed if m.msgID == "GGA"]
    np.testing.assert_allclose(np.degrees(ours[:, :2]), told, rtol=0, atol=1e-9)


def test_the_recorded_mixed_log(recordings: Path) -> None:
    from pyubx2 import UBX_PROTOCOL, UBXReader

    path = recordings / "pyubx2" / "tests" / "pygpsdata-MIXED.log"
    s = read_log(path).streams["NAV-PVT"]
    with path.open("rb") as f:
        theirs = [m for _, m in UBXReader(f, protfilter=UBX_PROTOCOL, quitonerror=0) if m.identity == "NAV-PVT"]
    np.testing.assert_allclose(np.degrees(s.z[:, :2]), [(m.lat, m.lon) for m in theirs], rtol=0, atol=1e-12)
    np.testing.assert_allclose(s.extra["hacc"], [m.hAcc * 1e-3 for m in theirs])
