"""`outrider swarm`: what it writes, prints and refuses."""

import json
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from conftest import Outrider
from outrider.io import read_log


@pytest.mark.compiled
def test_a_swap_into_a_folder(outrider: Outrider, tmp_path: Path) -> None:
    done = outrider("swarm", "circle", "--drones", 6, "--seed", 2, "--json")
    told, folder = json.loads(done.out), tmp_path / "swarm-circle"
    assert done.code == 0 and told["schema"] == "outrider.swarm/1" and told["outcome"]["code"] == "done"
    assert {p.name for p in folder.iterdir()} == {
        "summary.json", "swarm.png", "report.html", "run.mcap", "truth.parquet"
    }  # fmt: skip
    kept = json.loads((folder / "summary.json").read_text())
    assert kept["outcome"]["text"] == "nobody came too near, and all are where they should be"
    assert kept["there"] == 6 and kept["least_m"] >= 1.5 and kept["column"] is None
    assert sum(kept["decided_by"].values()) == pytest.approx(1.0)
    assert len(kept["each"]) == 6 and min(d["least_m"] for d in kept["each"]) == kept["least_m"]
    page = (folder / "report.html").read_text()
    assert page.count("<svg") == 2 and kept["outcome"]["text"][1:] in page and "keep right" not in page
    assert outrider("swarm", "circle").code == 2  # the folder is there
    log, truth = read_log(folder / "run.mcap"), pq.read_table(folder / "truth.parquet").to_pydict()
    own = log.streams["/drone_4/estimate"]
    drone, t = np.array(truth["drone"]), np.array(truth["t_ns"])
    p = np.column_stack([truth["east_m"], truth["north_m"], truth["up_m"]])[drone == 4]
    assert (own.t == t[drone == 4]).all()
    off = np.linalg.norm(own.z[:, :3] - p, axis=1)
    assert 0.01 < np.sqrt((off**2).mean()) == pytest.approx(kept["each"][4]["error_m"], rel=1e-6)
    assert set(truth["decided_by"]) <= set(kept["decided_by"])


@pytest.mark.compiled
def test_a_column_that_nobody_follows_has_a_report(outrider: Outrider, tmp_path: Path) -> None:
    done = outrider("swarm", "column", "--drones", 2, "--duration", 120, "--silent", "1,2,90")
    assert done.code == 0 and "1 out of the column" in done.out and "gaps" not in done.out
    assert "out of the column" in (tmp_path / "swarm-column" / "report.html").read_text()


@pytest.mark.compiled
def test_a_swap_that_is_cut_short_says_who_is_not_there(outrider: Outrider, tmp_path: Path) -> None:
    done = outrider("swarm", "circle", "--drones", 6, "--duration", 4, "--no-report", "--output", "short")
    kept = json.loads((tmp_path / "short" / "summary.json").read_text())
    assert done.code == 1 and kept["duration_s"] == 4.0 and "6 of 6 drones did not get to their goals" in done.out
    assert not (tmp_path / "short" / "report.html").exists()


@pytest.mark.compiled
def test_a_column_says_how_well_it_keeps_its_gaps(outrider: Outrider, tmp_path: Path) -> None:
    done = outrider("swarm", "column", "--drones", 5, "--duration", 150, "--silent", "2,70,90", "--output", "c")
    assert done.code == 0 and "at the first follower" in done.out
    kept = json.loads((tmp_path / "c" / "summary.json").read_text())
    assert "at the end; 1 out of the column for up to" in kept["outcome"]["text"]  # the silent one, and nobody else
    rms = kept["column"]["rms_m"]  # of the followers that never left, and were not behind one that did
    assert len(rms) == 4 and rms[0] < 0.8 and kept["duration_s"] == 150.0 and kept["violations"] == 0


@pytest.mark.compiled
def test_a_violation_is_a_failed_check(outrider: Outrider) -> None:
    done = outrider("swarm", "circle", "--drones", 8, "--loss", 0.999, "--quiet")
    assert done.code == 1 and "nearer than 1.5 m" in done.out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("ring",), "there are: circle"),
        (("circle", "--drones", 1), "from 2 to 1000"),
        (("doorway", "--drones", 7), "an even number"),
        (("column", "--duration", 10), "120 s or more"),
        (("circle", "--duration", "0.05"), "one step of 0.1 s or more"),
        (("column", "--silent", "3,5"), "DRONE,FROM,TO"),
        (("column", "--silent", "99,5,9"), "DRONE,FROM,TO"),
        (("column", "--late", "5"), "from 0.1 to 1 s"),
        (("crossed", "--drones", 6), "a leader"),
        (("circle", "--silent", "3,5,9"), "leave it out"),
        (("convoy", "--drones", 7), "9 drones or more"),
        (("convoy", "--drones", 50, "--duration", 200), "4 s for each and 150 s more"),
        (("circle", "--loss", "1.5"), "share from 0"),
        (("circle", "--separation", "9"), "from 0.5 to 2.5"),
        (("column", "--drones", 1000, "--duration", 36000), "1000 drones for 36000 s may take"),
    ],
)
def test_what_is_refused(outrider: Outrider, tmp_path: Path, words: tuple[object, ...], said: str) -> None:
    done = outrider("swarm", *words)
    assert done.code == 2 and said in done.err and "Traceback" not in done.err
    assert not list(tmp_path.iterdir())
