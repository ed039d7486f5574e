"""Missions `patrol` and `station` of a scenario file: what cannot be is named, and every alert ends."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from outrider.cli import main
from outrider.errors import ConfigError, ExitCode
from outrider.scenarios.build import Cast, build
from outrider.scenarios.files import load_scenario
from outrider.team.patrol import Patrol
from outrider.team.station import Station

SITE = """
name: yard
anchor: {lat_deg: 52.514, lon_deg: 13.35}
roads:
  - {line: [[-3, 0], [23, 0]], width: 6}
  - {line: [[20, 0], [20, 20]], width: 2}
obstacles:
  - {area: [[4, 3.5], [9, 3.5], [9, 8], [4, 8]]}
keep_out:
  - {area: [[-3, 2], [1, 2], [1, 3], [-3, 3]]}
routes:
  nodes: {west: [0, 0], east: [20, 0], north: [20, 20]}
  ways: [{way: [west, east], width: 6}, {way: [east, north], width: 2}]
docks:
  - {name: bay, at: [2, -1.5], heading_deg: 90}
"""
RUN = """
name: guarded
duration_s: 40
world:
  place: {type: site, file: yard.yaml}
team:
  base:
    start: {x: 10, y: 10, z: 5}
    mission:
      type: station
      file: alerts.jsonl
  r1:
    vehicle: {type: mecanum, radius: 0.45, height: 0.6}
    start: {x: 3}
    sensors: [{type: imu, rate_hz: 20}, {type: body_twist, name: wheels, rate_hz: 10, rolling: false},
      {type: gnss_receiver}, {type: lidar, rate_hz: 5, beams: 120, max_range: 10}]
    mission: {type: patrol, stops: [west, [15, 1]], dock: bay, period_s: 0.2}
"""
ALERTS = (
    {"id": 1, "lat_deg": 52.514, "lon_deg": 13.35013, "hold_s": 4, "source": "fence"},  # 8.8 m east
    {"id": 2, "at": [60, 60], "t_s": 1},
    {"id": 3, "at": [15, 0], "t_s": 2, "sigma": 0.5, "source": "gate"},
    {"id": 4, "at": [15.2, 0], "t_s": 3},
    {"cancel": 3, "t_s": 12},
    {"id": 5, "at": [14, 1], "t_s": 13, "patience_s": 1},
    {"lat_deg": 13.35, "lon_deg": 52.514},
)


def folder(tmp_path: Path, run: str = RUN, site: str = SITE) -> Path:
    (tmp_path / "yard.yaml").write_text(site)
    (tmp_path / "alerts.jsonl").write_text("".join(json.dumps(a) + "\n" for a in ALERTS))
    (tmp_path / "guarded.yaml").write_text(run)
    return tmp_path / "guarded.yaml"


def made(path: Path, **given: Any) -> Cast:
    return build(*load_scenario(str(path), given))


def test_names_of_the_drawing_become_places_and_its_narrow_ways_passages(tmp_path: Path) -> None:
    cast = made(folder(tmp_path))
    robot = next(r.agent for r in cast.team if isinstance(r.agent, Patrol))
    assert robot.stops[:, :2].tolist() == [[0, 0], [15, 1]] and np.isnan(robot.stops[:, 2]).all()
    assert robot.dock == pytest.approx([2, -1.5, np.pi / 2]) and robot.station == "base"
    (passage,) = robot.passages
    assert (passage.min(axis=0).tolist(), passage.max(axis=0).tolist()) == ([19.0, 3.0], [21.0, 20.0])
    station = next(r.agent for r in cast.team if isinstance(r.agent, Station))
    at = station.costmap.cell_of(np.array([[-1.0, 2.5], [10.0, 0.0], [6.0, 6.0], [10.0, 15.0]]))
    assert [int(station.costmap.cells[tuple(c)]) for c in at] == [254, 0, 254, 255]  # barred, road, taken, unknown


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("stops: [west,", "stops: [wset,", "team.r1.mission: stops: there is no node 'wset' (did you mean 'west'?)"),
        ("[15, 1]]", "[15]]", "[15.0] is no place"),
        ("[15, 1]]", "[6, 5]]", "team.r1.mission: stop 2: at (6, 5) the ground is taken (a place where it can stand)"),
        ("[15, 1]]", "[2500, 1]]", "stop 2: at (2500, 1) nothing is drawn"),
        ("start: {x: 3}", "start: {x: 500, y: 500}", "start: at (500, 500) nothing is drawn"),
        ("dock: bay", "dock: bya", "dock: there is no dock 'bya' (did you mean 'bay'?)"),
        ("file: alerts.jsonl", "file: alert.jsonl", "no alerts can be read: No such file or directory (make it first"),
        ("file: alerts.jsonl", "far: 1", "near 2 m, far 1 m"),
        ("file: alerts.jsonl", "alerts: [{at: [1, 2]}, {sigma: 2}]", "alerts.1: says nowhere where it is"),
        ("file: alerts.jsonl", "alerts: [{at: [1, .nan]}]", "guarded.yaml:11: team.base.mission.alerts.0.at.1"),
        ("file: yard.yaml}", "file: yrad.yaml}", "yrad.yaml"),
        ("file: yard.yaml}", "file: yard.yaml, drawing: {}}", "one of file and drawing"),
        ("type: patrol, stops: [west, [15, 1]], dock: bay", "type: still", "no robot to send"),
        ("{type: lidar, rate_hz: 5,", "{type: lidar, mount: [1, 0, 0, 0], rate_hz: 5,", "tilted or upside down"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_one_line_with_its_place(tmp_path: Path, old: str, new: str, says: str) -> None:
    assert old in RUN
    run = RUN.replace(old, new)
    path = folder(tmp_path, run.replace(", period_s: 0.2", "") if "still" in new else run)
    with pytest.raises(ConfigError) as e:
        made(path)
    assert says in str(e.value) and "\n" not in str(e.value)


def test_a_second_station_and_a_station_on_wheels_are_refused(tmp_path: Path) -> None:
    path = folder(tmp_path, RUN.replace("  r1:", "  other: {mission: {type: station}}\n  r1:"))
    with pytest.raises(ConfigError, match="base and other are stations"):
        made(path)
    path = folder(tmp_path, RUN.replace("    start: {x: 10", "    vehicle: {type: mecanum}\n    start: {x: 10"))
    with pytest.raises(ConfigError, match="a station stands"):
        made(path)


@pytest.mark.compiled
def test_every_alert_of_a_file_ends_in_a_state_with_a_name(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = folder(tmp_path)
    code = main(["run", str(path), "-o", str(tmp_path / "out"), "--no-report"])
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    mission = summary["mission"]
    one, two, three, four, five = mission["alerts"]
    assert [a["state"] for a in (one, two, three, four, five)] == [
        "observed", "unreachable", "cancelled", "duplicate", "timed_out",
    ]  # fmt: skip
    assert code == ExitCode.FAILED_CHECK  # two of them in vain
    assert one["robot"] == "r1" and one["source"] == "fence" and one["there_s"] < 9.0
    assert one["driven_m"] == pytest.approx(one["way_m"], abs=1.0)
    assert three["sent_s"] > one["ended_s"] - 1.0  # a second alert waits for the only robot there is
    assert mission["bad_lines"] == 1 and any("alerts.jsonl:7: " in n["text"] for n in summary["notes"])
    told = capsys.readouterr().out
    assert summary["outcome"]["text"].endswith("; 2 alerts in vain")
    assert "no robot can reach a place with a view of it" in told and "1 line of alerts could not be used" in told
    assert "it was observed" in told and "nobody arrived in time" in told


@pytest.mark.compiled
def test_a_robot_whose_lidar_falls_silent_stops_and_hands_its_alert_back(tmp_path: Path) -> None:
    fault = "faults: [{type: faulty, sensor: scan, start_s: 6, end_s: 16, how: silent}]"
    alerts = "alerts: [{t_s: 2, at: [19, 0], hold_s: 2}]"
    run = RUN.replace("file: alerts.jsonl", alerts).replace(
        "    mission: {type: patrol,", f"    {fault}\n    mission: {{type: patrol,"
    )
    done = made(folder(tmp_path, run.replace("blind_s: 5", "")), duration_s=40.0).run()
    notes = [n.text for n in done.notes if n.robot == "r1"]
    (blind,) = [k for k, text in enumerate(notes) if "it stands: it does not see" in text]
    assert "order 0: the robot did not see" in notes[blind] and "no scan for" in notes[blind]
    p, t = done.truth["r1"].p, (done.truth["r1"].t - done.monitor.start) * 1e-9
    still = p[(t > 9.0) & (t < 16.0)]
    assert np.ptp(still, axis=0).max() < 0.05  # it stood as long as it was blind
    assert any("it was observed" in text for text in notes[blind + 1 :])  # then it was sent once more
