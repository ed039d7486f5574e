"""Alerts from lines: what is right arrives, what is wrong is named with its line, and nothing stops."""

import json
import os
from math import radians
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.data.alerts import News
from outrider.data.site import Anchor
from outrider.data.trajectory import Datum
from outrider.errors import ConfigError
from outrider.io.alerts import LONGEST, AlertFile, AlertSection, agenda

S = 1_000_000_000
START = 1_750_000_000 * S  # 2025-06-15T15:06:40Z
HERE = Anchor(datum=Datum(lat=radians(52.514), lon=radians(13.35), alt=78.0))


def lines(tmp_path: Path, *said: object) -> tuple[Path, AlertFile]:
    path = tmp_path / "alerts.jsonl"
    path.write_text("".join(f"{one if isinstance(one, str) else json.dumps(one)}\n" for one in said))
    return path, AlertFile(path, start=START, anchor=HERE)


def append(path: Path, text: str) -> None:
    with path.open("a") as f:
        f.write(text)


def test_a_line_says_where_when_who_and_for_how_long(tmp_path: Path) -> None:
    full = {"id": 7, "at": [12, 3.5], "sigma": 2.5, "time": "2025-06-15T15:06:30Z", "source": "camera 4"}
    _, feed = lines(tmp_path, {**full, "patience_s": 90, "hold_s": 5}, "", {"at": [1.0, 2.0]}, {"cancel": 7})
    news = feed.due(START + 2 * S)
    a, b = news.raised
    assert (a.number, a.p.tolist(), a.sigma, a.source) == (7, [12.0, 3.5], 2.5, "camera 4")
    assert (a.t, a.patience_s, a.hold_s) == (START - 10 * S, 90.0, 5.0)
    assert (b.number, b.t, b.sigma, b.source) == (-1, START + 2 * S, 1.0, "")
    assert news.cancelled == (7,) and news.faults == ()
    assert feed.due(START + 3 * S) == News()


def test_degrees_become_metres_of_the_site(tmp_path: Path) -> None:
    # 111 km to a degree of latitude: WGS84's meridian at 52.5 N, 111 265 m (NGA tables); 67 865 m to one of longitude
    _, feed = lines(tmp_path, {"lat_deg": 52.515, "lon_deg": 13.351})
    (a,) = feed.due(START).raised
    assert a.p == pytest.approx([67.9, 111.3], abs=0.1)
    turned = Anchor(datum=HERE.datum, heading=radians(90.0))  # x runs north
    b = agenda([AlertSection(lat_deg=52.515, lon_deg=13.351)], start=START, anchor=turned).due(START).raised[0]
    assert b.p == pytest.approx([111.3, -67.9], abs=0.1)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ({"lat_deg": 13.35, "lon_deg": 52.514}, "lat_deg 13.35 and lon_deg 52.514 are swapped (lat_deg 52.514, lon"),
        ({"lat_deg": 48.0, "lon_deg": 13.35}, "is not on the site (the site is at 52.514, 13.350)"),
        ({"lat_deg": -52.514, "lon_deg": -166.65}, "is not on the site"),  # the other side of the Earth
        ({"lat_deg": 91.0, "lon_deg": 13.35}, "is not on the site"),
        ('{"at": [NaN, 3.5]}', "at.0: should be a finite number, is nan"),
        ('{"at": [1e999, 3.5]}', "at.0: should be a finite number, is inf"),
        ('{"at": ["12", 3.5]}', "at.0: should be a number, is '12' (write 12, without quotes)"),
        ({"at": [12.0]}, "at"),
        ({"at": [1e6, 0.0]}, "at: 1,000 km from the site's origin (metres of the site)"),
        ({"at": [12, 3], "sgima": 2}, "sgima: unknown key (did you mean 'sigma'?)"),
        ({"at": [12, 3], "sigma": -1}, "sigma: should be 0 or more, is -1"),
        ({"at": [12, 3], "patience_s": 0}, "patience_s: should be more than 0, is 0"),
        ({"source": "camera"}, "says nowhere where it is"),
        ({"lat_deg": 52.5}, "says nowhere where it is"),
        ({"at": [1, 2], "lat_deg": 52.5, "lon_deg": 13.3}, "has both at and lat_deg, lon_deg"),
        ({"at": [1, 2], "time": "noon"}, "time: cannot be 'noon' (now, or like 2026-05-01T14:30:00Z)"),
        ({"at": [1, 2], "time": "2025-06-15T15:06:40"}, "has no zone (end it with Z or +02:00)"),
        ({"at": [1, 2], "time": "2025-06-15T15:06:40Z", "t_s": 3}, "has both time and t_s"),
        ({"at": [1, 2], "cancel": 3}, "raises an alert and calls one off (a line for each)"),
        ({"cancel": -3}, "cancel: should be 0 or more, is -3"),
        ('{"at": [1, 2], "at": [3, 4]}', "at stands twice"),
        ("[1, 2]", "is no JSON object"),
        ("12, 3.5", "is no JSON: Extra data"),
        ("{'at': [1, 2]}", "is no JSON: Expecting property name"),
        ("[" * 100_00, "is no JSON: too deep"),
    ],
)
def test_a_line_of_no_use_is_named_and_the_others_arrive(tmp_path: Path, line: object, says: str) -> None:
    path, feed = lines(tmp_path, {"at": [1, 2]}, line, {"at": [3, 4]})
    news = feed.due(START)
    assert [a.p.tolist() for a in news.raised] == [[1.0, 2.0], [3.0, 4.0]]
    (fault,) = news.faults
    assert fault.startswith(f"{path}:2: ") and says in fault and "\n" not in fault


def test_without_an_anchor_degrees_are_refused(tmp_path: Path) -> None:
    path, _ = lines(tmp_path, {"lat_deg": 52.5, "lon_deg": 13.3})
    assert "no anchor" in AlertFile(path, start=START).due(START).faults[0]


def test_a_clock_that_is_ahead_loses_no_alert_and_a_schedule_waits(tmp_path: Path) -> None:
    _, feed = lines(tmp_path, {"at": [1, 2], "time": "2025-06-15T16:06:40Z"}, {"at": [3, 4], "t_s": 60.0})
    news = feed.due(START + S)
    assert [a.t for a in news.raised] == [START + S] and "3599.0 s ahead of the station's clock" in news.faults[0]
    assert feed.due(START + 59 * S) == News()
    (a,) = feed.due(START + 60 * S).raised
    assert (a.t, a.p.tolist()) == (START + 60 * S, [3.0, 4.0])


def test_a_file_that_grows_is_followed_line_by_line(tmp_path: Path) -> None:
    path, feed = lines(tmp_path)
    assert feed.due(START) == News()
    append(path, '{"at": [1, ')
    assert feed.due(START) == News()  # half a line
    append(path, '2]}\n{"at": [3, 4]}')
    assert [a.p[0] for a in feed.due(START).raised] == [1.0, 3.0]  # the last one is whole without its end
    append(path, "\n")
    assert feed.due(START) == News()
    append(path, 'oops\n{"at": [5, 6]}\n')
    news = feed.due(START)
    assert [a.p[0] for a in news.raised] == [5.0] and news.faults[0].startswith(f"{path}:3: ")
    path.write_text('{"at": [7, 8]}\n')  # begun anew
    news = feed.due(START)
    assert [a.p[0] for a in news.raised] == [7.0] and "read from its beginning" in news.notes[0]
    path.unlink()
    assert "No such file" in feed.due(START).faults[0]
    path.write_text('{"at": [9, 0]}\n')
    assert [a.p[0] for a in feed.due(START).raised] == [9.0]


def test_a_line_without_end_and_bytes_that_are_no_text_cost_one_line_each(tmp_path: Path) -> None:
    path, feed = lines(tmp_path)
    with path.open("ab") as f:
        f.write(b"x" * (LONGEST + 1))
    assert "more than 65536 bytes" in feed.due(START).faults[0]
    with path.open("ab") as f:
        f.write(b"x" * (LONGEST + 1))
    assert feed.due(START) == News()
    with path.open("ab") as f:
        f.write(b'x\n\xff\xfe{}\n{"at": [1, 2]}\n')
    news = feed.due(START)
    assert news.faults == (f"{path}:2: is no text in UTF-8",) and len(news.raised) == 1


def test_a_fifo_is_read_as_it_comes_and_outlives_its_writers(tmp_path: Path) -> None:
    path = tmp_path / "alerts"
    os.mkfifo(path)
    feed = AlertFile(path, start=START)
    assert feed.due(START) == News()  # nobody writes yet: nobody waits
    for east in (1.0, 2.0):
        writer = os.open(path, os.O_WRONLY)
        assert feed.due(START) == News()  # somebody is there, and silent
        os.write(writer, f'{{"at": [{east}, 0]}}\n'.encode())
        os.close(writer)
        assert [a.p[0] for a in feed.due(START).raised] == [east]
    assert feed.due(START) == News()
    feed.close()


def test_what_cannot_be_read_is_refused_at_once(tmp_path: Path) -> None:
    for path in (tmp_path / "none.jsonl", tmp_path):
        with pytest.raises(ConfigError, match="make it first"):
            AlertFile(path, start=START)


def test_a_scenario_lists_alerts_and_a_wrong_one_is_named() -> None:
    feed = agenda([AlertSection(at=[1.0, 2.0], t_s=5.0, id=3), AlertSection(cancel=3, t_s=9.0)], start=START)
    assert [len(feed.due(START + t * S).raised) for t in (4, 5, 6)] == [0, 1, 0]
    assert feed.due(START + 10 * S).cancelled == (3,)
    with pytest.raises(ConfigError, match=r"alerts\.1"):
        agenda([AlertSection(at=[1.0, 2.0]), AlertSection()], start=START)


@settings(max_examples=60)
@given(st.lists(st.binary(max_size=60).filter(lambda b: b"\n" not in b), max_size=6), st.integers(1, 50))
def test_no_bytes_stop_it_and_pieces_of_any_size_read_the_same(tmp_path_factory, said: list[bytes], size: int) -> None:
    path: Path = tmp_path_factory.mktemp("bytes") / "alerts.jsonl"
    whole = b"".join(line + b"\n" for line in [*said, b'{"at": [1, 2]}'])
    path.write_bytes(b"")
    feed, faults, raised = AlertFile(path, start=START), list[str](), 0
    for k in range(0, len(whole), size):
        with path.open("ab") as f:
            f.write(whole[k : k + size])
        news = feed.due(START)
        faults += news.faults
        raised += len(news.raised)
    path.write_bytes(whole)
    once = AlertFile(path, start=START).due(START)
    assert raised == len(once.raised) >= 1 and tuple(faults) == once.faults
    assert all(np.isfinite(a.p).all() for a in once.raised)
