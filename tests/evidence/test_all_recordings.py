"""Every recording through the doctor: how long, what was found, how well the position is known; one page of all."""

from pathlib import Path

import pytest
from test_openings import ANSFL, LOGS, MAPPED

from outrider.data import EventLog
from outrider.errors import OutriderError
from outrider.io.map_server import read_map
from outrider.io.moving_ai import read_moving_ai_map
from outrider.io.registry import read_log
from outrider.workflows.config import FuseConfig
from outrider.workflows.doctor.visit import visit
from outrider.workflows.summary import figures

pytestmark = pytest.mark.evidence

PAGE = Path(__file__).resolve().parents[2] / "docs" / "evidence" / "all-recordings.md"
STATIC = "uwb-outdoor/Static_measurements/LOS/height_100.0cm"
ANCHOR = """time: {column: timestamp}
streams: {uwb: {kind: RANGE, columns: {beacon: anchor_id, range: Distance}}}
"""
FURTHER = (
    *((f"ansfl-quad/Horizontal/path_4/IMU_{k}.csv", ANSFL) for k in ("2", "3", "4", "avg")),
    *((f"ansfl-quad/Horizontal/path_7/IMU_{k}.csv", ANSFL) for k in "1234"),
    *((f"ansfl-quad/StraightLine/path_1/IMU_{k}.csv", ANSFL) for k in "234"),
)
GRIDS = ("nav2/nav2_bringup/maps/depot.yaml", "nav2/nav2_bringup/maps/warehouse.yaml",
         "ros-navigation/costmap_2d/test/TenByTen.yaml", "hog2/maps/cities/Berlin_0_256.map",
         "hog2/maps/rooms/8room_000.map", "pathfinding-rs/benches/arena.map")  # fmt: skip
HEAD = """# Every recording

Written by `make evidence` (`pytest -m evidence tests/evidence/test_all_recordings.py`): each recording as
`outrider doctor LOG` sees it, with nothing configured (tables and arrays with a mapping that says what their columns
are). A remark is no fault and is not listed. The deviation is the estimate's own at the end; how far it is from truth
stands in [recordings](recordings.md), how the logs open in [formats](formats.md).

| recording | s | sources, with their rates | outcome | faults found | m travelled | position to |
|---|---|---|---|---|---|---|
"""


def sources(log: EventLog) -> str:
    return ", ".join(
        s.name + (f" {s.rate:.3g} Hz" if s.rate == s.rate else "") for s in sorted(log, key=lambda s: s.name)
    )


def row(name: str, log: EventLog) -> str:
    if len({s.robot for s in log}) > 1:
        return f"| {name} | {log.duration:.1f} | {sources(log)} | several robots: one at a time | | | |"
    try:
        seen = visit(log, FuseConfig())
    except OutriderError as e:
        return f"| {name} | {log.duration:.1f} | {sources(log)} | refused: {e.what} | | | |"
    faults = "; ".join(f"{f.code}: {f.text}" for f in seen.findings if f.severity != "info").replace("|", "/")
    f = figures(seen.run)
    if not f:
        return f"| {name} | {log.duration:.1f} | {sources(log)} | no estimate | {faults or 'none'} | | |"
    to = f["deviation"].get("horizontal_m", {}).get("end", float("nan"))
    outcome = seen.run.outcome.name.lower().replace("_", " ")
    way = f"{f['distance_m']:.3g} | {to:.2g} m"
    return f"| {name} | {log.duration:.1f} | {sources(log)} | {outcome} | {faults or 'none'} | {way} |"


def test_the_table_of_all(recordings: Path, tmp_path: Path) -> None:
    lines = [row(name, read_log(recordings / name)) for name in LOGS]
    for name, mapping in (*MAPPED, *FURTHER):
        (tmp_path / "m.yaml").write_text(mapping, encoding="utf-8")
        lines.append(row(f"{name}, with a mapping", read_log(recordings / name, mapping=tmp_path / "m.yaml")))
    (tmp_path / "m.yaml").write_text(ANCHOR, encoding="utf-8")
    still = [read_log(f, mapping=tmp_path / "m.yaml") for f in sorted((recordings / STATIC).glob("*.csv"))]
    assert len(still) == 30
    whole, count = sum(log.duration for log in still), sum(len(log) for log in still)
    what = f"{len(still)} files, {count} ranges to one anchor"
    lines.append(f"| {STATIC}/*.csv, with a mapping | {whole:.1f} | {what} | one range is no place | | | |")
    lines += ["", "| map | cells | free |", "|---|---|---|"]
    for name in GRIDS:
        path = recordings / name
        cells = read_map(path).grid.cells if name.endswith("yaml") else read_moving_ai_map(path).cells
        lines.append(f"| {name} | {cells.shape[1]} x {cells.shape[0]} | {(cells == 0).mean():.0%} |")
    PAGE.write_text(HEAD + "\n".join([*lines, ""]), encoding="utf-8")
    assert "nan" not in "\n".join(lines)
    rows = sum(line.startswith("| ") for line in lines)
    assert rows == len(LOGS) + len(MAPPED) + len(FURTHER) + len(GRIDS) + 2  # the still ranges, the heading of the maps
