"""A drawing through the whole job: the files, their agreement, the findings; and bad input through the command."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from outrider.cli.app import app
from outrider.data.grid import LETHAL, UNKNOWN
from outrider.errors import ExitCode, OutputExistsError, UsageError
from outrider.io.map_server import read_map
from outrider.io.route_graphs import read_route_graph
from outrider.io.sites import read_site
from outrider.workflows.map_site import map_site

pytestmark = pytest.mark.compiled  # cells by the hundred thousand
DATA = Path(os.environ.get("OUTRIDER_DATA", Path(__file__).resolve().parents[3] / "shared" / "data"))
YARD = """\
name: yard
anchor: {lat_deg: 52.5, lon_deg: 13.4, alt_m: 40, heading_deg: 10}
roads:
  - {name: main, line: [[0, 0], [8, 0]], width: 3}
buildings:
  - {name: hut, area: [[3, 1.2], [5, 1.2], [5, 3], [3, 3]]}
keep_out:
  - {name: pit, area: [[6, -1.5], [7, -1.5], [7, -0.8], [6, -0.8]]}
routes:
  nodes: {a: [0.5, 0], b: [7.5, 0], c: [4, 2]}
  ways:
    - {way: [a, b]}
docks:
  - {name: charger, at: [1, 0.5], heading_deg: 90}
"""


def drawing(tmp_path, text=YARD):
    path = tmp_path / "yard.yaml"
    path.write_text(text)
    return path


def test_every_file_tells_the_same(tmp_path):
    done, summary = map_site(drawing(tmp_path), tmp_path / "map", resolution=0.25)
    there = tmp_path / "map"
    assert sorted(summary_files(there)) == sorted(p.name for p in there.iterdir())
    m = read_map(there / "map.yaml")
    assert (m.grid.cells == done.grid.cells).all()
    assert m.anchor == done.anchor
    barred = read_map(there / "keep_out.yaml").grid
    assert (barred.cells == 100).sum() == 4 * 3
    assert (done.costmap.cells[barred.cells == 100] == LETHAL).all()
    assert read_route_graph(there / "routes.geojson").names == ("a", "b", "c")
    assert read_site(there / "site.yaml").name == "yard"
    assert done.exit_code == ExitCode.OK
    assert summary["map"]["cells"]["free"] == (done.grid.cells == 0).sum()
    assert summary["routes"] == {"nodes": 3, "edges": 2, "length_m": 7.0}
    with Image.open(there / "costmap.png") as picture:
        assert picture.width > 800
    page = (there / "report.html").read_text()
    assert "https://" not in page.replace("https://www.w3.org", "")
    for word in ("Keep-out", "Data volume", "charger", summary["source"]["sha256"]):
        assert word in page


def summary_files(folder):
    return json.loads((folder / "summary.json").read_text())["files"]


def test_the_data_volume_is_what_the_files_have(tmp_path):
    _, summary = map_site(drawing(tmp_path), tmp_path / "map", resolution=0.25, report=False)
    v = summary["volume"]
    assert v["drawing_bytes"] == (tmp_path / "map" / "site.yaml").stat().st_size
    assert v["map_bytes"] == (tmp_path / "map" / "map.pgm").stat().st_size
    assert v["ground_m2"] == pytest.approx(24.0 - 0.6)
    assert v["outline_m"] == pytest.approx(7.6)
    assert v["dense_points"] == pytest.approx((23.4 + 3.0 * 7.6) / 0.05**2, abs=1)
    assert v["dense_to_drawing"] == pytest.approx(16 * v["dense_points"] / v["drawing_bytes"], rel=1e-4)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("{way: [a, b]}", "{way: [a, b, c]}", "the way b - c is blocked at (5.12, 1.38) m: too near to something"),
        ("at: [1, 0.5]", "at: [4, 2]", "the dock charger at (4.00, 2.00) m is taken"),
        ("at: [1, 0.5]", "at: [1, 4]", "the dock charger at (1.00, 4.00) m is not on a road"),
        ("[7, -0.8], [6, -0.8]", "[7, -0.2], [6, -0.2]", "too near to something"),
    ],
)
def test_what_cannot_be_driven_on_is_said(tmp_path, old, new, said):
    assert old in YARD
    done, summary = map_site(drawing(tmp_path, YARD.replace(old, new)), tmp_path / "map", resolution=0.25, report=False)
    assert done.exit_code == ExitCode.FAILED_CHECK
    assert any(said in line for line in summary["blocked"]), summary["blocked"]


def test_a_map_and_an_image_become_maps_again(tmp_path):
    map_site(drawing(tmp_path), tmp_path / "first", resolution=0.25, report=False)
    done, _ = map_site(tmp_path / "first" / "map.yaml", tmp_path / "second", report=False)
    first, second = (read_map(tmp_path / n / "map.yaml") for n in ("first", "second"))
    assert (first.grid.cells == second.grid.cells).all()
    assert first.anchor == second.anchor == done.anchor
    points = tmp_path / "points.yaml"
    rows = first.grid.cells.shape[0]
    points.write_text(f"points: [{{pixel: [0, {rows}], metres: [5, 6]}}, {{pixel: [10, {rows}], metres: [5, 8]}}]")
    third, summary = map_site(tmp_path / "first" / "map.pgm", tmp_path / "third", control_points=points, report=True)
    assert third.heading == pytest.approx(np.pi / 2)
    assert third.grid.resolution == pytest.approx(0.2)
    assert (read_map(tmp_path / "third" / "map.yaml").grid.cells == first.grid.cells).all()
    assert summary["fit"]["rmse_m"] < 1e-9


def test_what_contradicts_itself_is_refused_and_nothing_is_written(tmp_path):
    image, points = tmp_path / "m.png", tmp_path / "p.yaml"
    Image.fromarray(np.zeros((4, 4), np.uint8)).save(image)
    points.write_text("points: [{pixel: [0, 0], metres: [0, 0]}, {pixel: [1, 1], metres: [1, 1]}]")
    yard = drawing(tmp_path)
    for source, options, said in (
        (image, {}, "does not say where it is"),
        (image, {"control_points": points, "resolution": 0.1}, "its own resolution"),
        (yard, {"control_points": points}, "lay an image on the ground"),
    ):
        with pytest.raises(UsageError, match=said):
            map_site(source, tmp_path / "out", **options)
        assert not (tmp_path / "out").exists()
    map_site(yard, tmp_path / "out", resolution=0.5, report=False)
    with pytest.raises(OutputExistsError, match="earlier result"):
        map_site(yard, tmp_path / "out", resolution=0.5, report=False)
    map_site(yard, tmp_path / "out", resolution=0.5, report=False, force=True)


def invoke(*words):
    return CliRunner().invoke(app, ["map", *map(str, words)], standalone_mode=False)


def test_the_command_prints_json_or_a_summary(tmp_path, capsys):
    yard = drawing(tmp_path)
    out = invoke(yard, "-o", tmp_path / "map", "--resolution", "0.25", "--json", "-q", "--no-report")
    assert out.exception is None
    summary = json.loads(out.stdout)
    assert summary["schema"] == "outrider.map/1"
    assert summary["folder"] == str(tmp_path / "map")
    again = invoke(yard, "-o", tmp_path / "map", "--force", "--resolution", "0.25", "--no-report")
    assert "yard: mapped" in again.stdout
    assert "times as large" in again.stdout
    assert (
        invoke(
            yard, "-o", tmp_path / "wide", "--robot-radius", "2", "--resolution", "0.25", "--no-report", "-q"
        ).return_value
        == 1
    )


@pytest.mark.parametrize("name", ["depot.yaml", "warehouse.yaml"])
@pytest.mark.compiled
def test_maps_of_nav2(tmp_path, name):
    if not (DATA / "nav2").is_dir():
        pytest.skip(f"no recordings at {DATA}")
    source = DATA / "nav2" / "nav2_bringup" / "maps" / name
    done, _ = map_site(source, tmp_path / "map", report=False)
    assert (read_map(tmp_path / "map" / "map.yaml").grid.cells == read_map(source).grid.cells).all()
    taken = done.grid.cells == 100
    assert (done.costmap.cells[taken] == LETHAL).all()
    assert set(np.unique(done.costmap.cells[done.grid.cells == UNKNOWN]).tolist()) <= {253, UNKNOWN}
