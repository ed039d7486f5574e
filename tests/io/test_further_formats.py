"""The formats that are no flight logs: told by content, cut and damaged without a surprise."""

import bz2
import gzip
from collections.abc import Callable
from pathlib import Path

import numpy as np
import other_logs
import pytest
from flight_logs import cuts, damages, write
from test_registry import attempt

import gnss_logs
from outrider.errors import DataError
from outrider.io import detect, read_log

FORMATS: dict[str, tuple[str, str, Callable[[], bytes]]] = {
    "nmea": ("gnss receiver", ".nmea", gnss_logs.nmea),
    "ubx": ("gnss receiver", ".ubx", gnss_logs.ubx),
    "mixed": ("gnss receiver", ".log", gnss_logs.mixed),
    "remote id": ("remote id", ".pcap", other_logs.remote_id),
    "carmen": ("carmen log", ".clf", other_logs.carmen),
    "carmen, packed": ("carmen log", ".clf.bz2", lambda: bz2.compress(other_logs.carmen())),
    "carmen, zipped": ("carmen log", ".clf.gz", lambda: gzip.compress(other_logs.carmen(), mtime=0)),
    "pos": ("rtklib solution", ".pos", gnss_logs.pos),
}


@pytest.mark.parametrize("name", FORMATS)
def test_the_content_tells_the_format(tmp_path: Path, name: str) -> None:
    told, ending, make = FORMATS[name]
    for wrong in (ending, "", ".txt", ".bag"):
        assert detect(write(tmp_path, f"log{wrong}", make())) == told
    log = read_log(write(tmp_path, f"log{ending}", make()), robot="r2")
    assert {s.robot for s in log} == {"r2"} and len(log.sha256) == 64 and len(log) > 0


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", FORMATS)
def test_no_damage_escapes_from_further_formats(tmp_path: Path, name: str, rng: np.random.Generator) -> None:
    _, ending, make = FORMATS[name]
    data = make()
    for broken in (*cuts(data, rng, 30), *damages(data, rng, 60)):
        attempt(write(tmp_path, f"x{ending}", broken))


@pytest.mark.parametrize("name", FORMATS)
def test_a_shorter_file_never_gives_more(tmp_path: Path, name: str) -> None:
    _, ending, make = FORMATS[name]
    data, last = make(), 0
    for k in range(1, 11):
        try:
            n = len(read_log(write(tmp_path, f"x{ending}", data[: len(data) * k // 10])))
        except DataError:
            n = 0
        assert n >= last
        last = n
    assert last == len(read_log(write(tmp_path, f"x{ending}", data)))


@pytest.mark.parametrize("name", FORMATS)
def test_progress_is_told(tmp_path: Path, name: str) -> None:
    _, ending, make = FORMATS[name]
    calls: list[tuple[int, int]] = []
    path = write(tmp_path, f"p{ending}", make())
    read_log(path, progress=lambda done, size: calls.append((done, size)))
    assert calls and all(0 <= done <= size for done, size in calls)


@pytest.mark.evidence
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", FORMATS)
def test_campaign_of_damage(tmp_path: Path, name: str) -> None:
    """The same, at length and with new random numbers every time."""
    _, ending, make = FORMATS[name]
    data, fresh = make(), np.random.default_rng()
    for broken in (*cuts(data, fresh, 100), *damages(data, fresh, 900)):
        attempt(write(tmp_path, f"x{ending}", broken))
