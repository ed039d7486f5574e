"""The page of a simulation: everything in one file, and the picture where things are."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from yard import YARD

from outrider.io.config import read_yaml
from outrider.plot.stage import Window, outline, stage
from outrider.scenarios.build import build
from outrider.scenarios.files import parse_scenario
from outrider.scenarios.runs import run_scenario
from outrider.sim.world import Wall, World

SHED = Wall(name="shed", outline=np.array([[2.0, 1.0], [6.0, 1.0], [6.0, 4.0], [2.0, 4.0]]))
BEAM = Wall(name="beam", outline=np.array([[-4.0, -4.0], [-2.0, -4.0], [-2.0, 4.0], [-4.0, 4.0]]), low=8.0, high=9.0)


def shoelace(path: str) -> float:
    rings = [np.array([p.split() for p in ring.strip("Z").split("L")], float) for ring in path.split("M")[1:]]
    return sum(0.5 * abs(np.sum(r[:, 0] * np.roll(r[:, 1], -1) - r[:, 1] * np.roll(r[:, 0], -1))) for r in rings)


@pytest.mark.compiled
def test_the_outline_is_what_covers_the_ground() -> None:
    window = Window(-10.0, -10.0, 10.0, 10.0)
    assert abs(shoelace(outline(World(name="yard", walls=(SHED, BEAM)), window)) - 28.0) < 0.6
    assert outline(World(name="field"), window) == ""


def test_the_page_needs_nothing_else_and_moves_what_was_there(tmp_path: Path) -> None:
    (tmp_path / "yard.yaml").write_text(YARD.replace("name: yard", 'name: "</script><b>yard"'))
    scenario = parse_scenario(read_yaml(tmp_path / "yard.yaml"))
    done, summary = run_scenario(scenario, tmp_path / "run")
    page = (tmp_path / "run" / "report.html").read_text()
    assert "report.html" in json.loads((tmp_path / "run" / "summary.json").read_text())["files"]
    assert not re.search(r"(src|href)=\"(?!#)|url\((?!#)|@import|https?://", page)
    assert page.count("</script>") == 1 and "The time is over" in page and summary["log"]["sha256"] in page
    data = json.loads(re.search(r"const d = (\{.*\});", page)[1])  # type: ignore[index]
    (rover,) = data["robots"]
    truth = done.run.truth["rover"]
    moved = np.hypot(rover["x"][-1] - rover["x"][0], rover["y"][-1] - rover["y"][0])
    assert abs(moved - np.linalg.norm(truth.p[-1] - truth.p[0])) < 0.02
    assert rover["y"][-1] < rover["y"][0] and data["t"][-1] == 3.0  # north is up, y counts down


def test_movers_walk_through_the_picture(tmp_path: Path) -> None:
    data = read_yaml(_written(tmp_path))
    data["world"]["movers"] = [{"name": "dog", "points": [[5, 5], [8, 5]], "speed": 1.5}]
    picture, moving = stage(build(parse_scenario(data)).run())
    (dog,) = moving["movers"]
    assert dog["x"][-1] - dog["x"][0] == 3.0 and "<title>dog</title>" in picture


def _written(tmp_path: Path) -> Path:
    path = tmp_path / "yard.yaml"
    path.write_text(YARD)
    return path


def test_the_picture_holds_rounds_and_the_alerts_that_somebody_had_a_way_to(tmp_path: Path) -> None:
    run = build(parse_scenario(read_yaml(_written(tmp_path)))).run()
    alert = {"alert": 1, "north_m": 3.0, "sigma_m": 1.0, "state": "observed", "text": "it was observed", "way_m": 9.0}
    far, lost = {**alert, "east_m": 70.0}, {**alert, "east_m": 9e5, "way_m": None}
    told = {"passages": [], "zones": [], "alerts": [far, lost], "robots": {"rover": {"stops": [[0, 0], [-40, 0]]}}}
    wide = float(re.search(r'viewBox="0 0 ([\d.]+)', stage(run, mission=told)[0])[1])  # type: ignore[index]
    assert 110.0 < wide < 200.0
