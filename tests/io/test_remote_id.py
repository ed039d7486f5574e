"""Open Drone ID: every position is decoded, no code for "unknown" becomes a number."""

from pathlib import Path

import numpy as np
import other_logs as made
import pytest
from flight_logs import write
from hypothesis import given
from hypothesis import strategies as st

from outrider.data import Altitude, EventLog, Fix, Kind, Verdict
from outrider.errors import DataError, UsageError
from outrider.filters.screen import screen
from outrider.io import read_log
from outrider.io.robots import of_robot, robots_of


def read(folder: Path, data: bytes) -> EventLog:
    return read_log(write(folder, "a.pcap", data))


CARRIERS = {
    "beacon": lambda p: made.pcap([made.beacon(x) for x in p]),
    "beacon, ns, big endian": lambda p: made.pcap([made.beacon(x) for x in p], nano=True, order=">"),
    "beacon, pcapng": lambda p: made.pcapng([made.beacon(x) for x in p]),
    "beacon, pcapng, big endian": lambda p: made.pcapng([made.beacon(x) for x in p], order=">"),
    "NAN": lambda p: made.pcap([made.nan(x) for x in p]),
    "NAN with filters": lambda p: made.pcap([made.nan(x, filters=True) for x in p]),
    "Bluetooth 5": lambda p: made.pcap([made.bluetooth(x, extended=True) for x in p], link=251),
    "Bluetooth 5, radio header": lambda p: made.pcap(
        [bytes(10) + made.bluetooth(x, extended=True) for x in p], link=256
    ),
}


@pytest.mark.parametrize("carrier", CARRIERS)
def test_every_carrier_gives_the_same_flight(tmp_path: Path, carrier: str) -> None:
    log = read(tmp_path, CARRIERS[carrier](made.drone_flight()))
    s, v, b, o = (log.streams[n] for n in ("position", "velocity", "baro", "operator"))
    assert len(s) == len(v) == len(b) == len(o) == 20 and not log.notes
    np.testing.assert_allclose(np.degrees(s.z[0, :2]), [45.5, -122.9], rtol=0, atol=1e-7)
    assert s.z[0, 2] == 120 and s.altitude is Altitude.ELLIPSOID and set(s.extra["fix"]) == {Fix.UNKNOWN.value}
    np.testing.assert_allclose(v.z[:, :3], np.tile([4.0, 0.0, 0.5], (20, 1)), atol=1e-12)
    np.testing.assert_array_equal(s.t_arrival - s.t, 200_000_000)
    np.testing.assert_allclose(s.var[0], [(3 / 2.4477) ** 2] * 2 + [(10 / 1.96) ** 2], rtol=1e-6)
    np.testing.assert_allclose(np.degrees([o.extra["lat"][0], o.extra["lon"][0]]), [45.4, -122.8], atol=1e-7)
    assert np.isnan(o.extra["alt"]).all()


def test_bluetooth_4_sends_one_message_at_a_time(tmp_path: Path) -> None:
    single = [m for p in made.drone_flight(5) for m in (p[3:28], p[28:53])]
    log = read(tmp_path, made.pcap([made.bluetooth(m, extended=False) for m in single], link=251, step=0.5))
    assert len(log.streams["position"]) == 5 and set(log.streams["velocity"].z[:, 0]) == {4.0}


def test_unknown_is_never_a_number(tmp_path: Path) -> None:
    log = read(tmp_path, made.pcap([made.beacon(made.pack(made.location(), made.system())) for _ in range(3)]))
    s = log.streams["position"]
    assert np.isnan(s.z).all() and np.isnan(s.extra["height"]).all() and np.isnan(s.var).all()
    assert set(screen(s)) == {int(Verdict.NO_FIX)}
    assert "velocity" not in log.streams and "baro" not in log.streams
    assert np.isnan(log.streams["operator"].extra["lat"]).all()


@given(
    direction=st.integers(0, 359), speed=st.sampled_from([0.0, 0.25, 12.5, 63.75, 64.5, 200.25]),
    climb=st.sampled_from([-62.0, -0.5, 0.0, 3.5, 62.0]), alt=st.sampled_from([-999.5, 0.0, 120.5, 31_000.0]),
)  # fmt: skip
def test_values_survive(tmp_path_factory: pytest.TempPathFactory, direction, speed, climb, alt) -> None:
    message = made.location((-33.5, 151.2), direction, speed, climb, alt)
    log = read(tmp_path_factory.mktemp("x"), made.pcap([made.beacon(made.pack(message))]))
    angle = np.radians(direction)
    expected = [speed * np.sin(angle), speed * np.cos(angle), climb]
    np.testing.assert_allclose(log.streams["velocity"].z[0], expected, atol=1e-9)
    np.testing.assert_allclose(np.degrees(log.streams["position"].z[0, :2]), [-33.5, 151.2], atol=1e-7)
    assert log.streams["position"].z[0, 2] == alt == log.streams["baro"].z[0, 0]


def test_what_is_known_of_a_velocity(tmp_path: Path) -> None:
    def velocity(**told: float) -> np.ndarray:
        message = made.pack(made.location((1.0, 1.0), **told))
        return read(tmp_path, made.pcap([made.beacon(message)])).streams["velocity"].z[0]

    np.testing.assert_array_equal(velocity(climb=1.0), [np.nan, np.nan, 1.0])
    np.testing.assert_array_equal(velocity(speed=3.0, climb=1.0), [np.nan, np.nan, 1.0])  # no direction
    np.testing.assert_array_equal(velocity(speed=0.0), [0.0, 0.0, np.nan])  # at rest there is none


def test_several_drones_are_several_robots(tmp_path: Path) -> None:
    frames: list[bytes] = []
    for k in range(6):
        for name, sender in ((b"AAA1", b"\2\0\0\0\0\1"), (b"BBB2", b"\2\0\0\0\0\2")):
            place = (45.5 + (name == b"BBB2"), -122.9 + 1e-5 * k)
            frames.append(made.beacon(made.pack(made.basic_id(name), made.location(place)), sender))
    log = read(tmp_path, made.pcap(frames, step=0.5))
    assert robots_of(log) == ("AAA1", "BBB2") and set(log.streams) == {"AAA1/position", "BBB2/position"}
    with pytest.raises(UsageError, match=r"holds 2 robots.*--robot AAA1 or BBB2"):
        of_robot(log, None)
    own = of_robot(log, "BBB2")
    assert set(own.streams) == {"BBB2/position"} and np.degrees(own.streams["BBB2/position"].z[0, 0]) > 46


def test_a_drone_with_a_wrong_clock_gets_the_stamps_of_the_capture(tmp_path: Path) -> None:
    packs = [made.pack(made.location((1.0, 1.0), tenths=0)) for _ in range(5)]
    log = read(tmp_path, made.pcap([made.beacon(p) for p in packs]))
    np.testing.assert_array_equal(log.streams["position"].t, (made.UNIX + np.arange(5)) * 10**9)
    assert any("stamps are those of the capture" in n for n in log.notes)


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (made.pcap([b"\0" * 60], link=1), "no Wi-Fi or Bluetooth packets .link types 1"),
        (made.pcap([made.beacon(b"")[:50]]), "none of its 1 packets is of Open Drone ID"),
        (made.pcap([]), "no Wi-Fi or Bluetooth"),
    ],
)
def test_captures_of_something_else_say_so(tmp_path: Path, data: bytes, says: str) -> None:
    with pytest.raises(DataError, match=says):
        read(tmp_path, data)


@pytest.mark.parametrize(
    ("name", "positions"),
    [("odid_wifi_bcn_sample.pcap", 21), ("odid_wifi_sample.pcap", 31), ("odid_bt5_lr_sample.pcapng", 0)],
)  # fmt: skip
def test_recorded_captures(recordings: Path, name: str, positions: int) -> None:
    log = read_log(recordings / "remoteid" / name)
    s = log.streams["position"]
    known = np.isfinite(s.z[:, 0])
    assert known.sum() == positions and (np.isfinite(s.z[:, 1]) == known).all()
    np.testing.assert_allclose(np.degrees(s.z[known, :2]), np.tile([45.546, -122.969], (positions, 1)), atol=0.01)
    assert not any((np.abs(v.z[:, :2]) > 60).any() for v in log.of(Kind.GNSS_VELOCITY))
    assert len(s) >= 21


def test_the_recorded_bytes_hold_the_positions(recordings: Path) -> None:
    """Found by their pattern alone: type, then a latitude and a longitude in Oregon."""
    for name in ("odid_wifi_bcn_sample.pcap", "odid_wifi_sample.pcap"):
        path = recordings / "remoteid" / name
        data, seen = path.read_bytes(), set[tuple[int, int]]()
        for i in range(len(data) - 24):
            lat, lon = (int.from_bytes(data[i + k : i + k + 4], "little", signed=True) for k in (5, 9))
            if data[i] >> 4 == 1 and 455_000_000 < lat < 456_000_000 and -1_230_000_000 < lon < -1_229_000_000:
                seen.add((lat, lon))
        ours = np.round(np.degrees(read_log(path).streams["position"].z[:, :2]) * 1e7).astype(int)
        assert {tuple(p) for p in ours.tolist()} == seen
