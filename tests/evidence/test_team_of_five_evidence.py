"""Five robots in files of the UTIAS format: what cooperation is worth where landmarks are many, few, or one robot's.

OUTRIDER_SEEDS is the number of seeds (8).
"""

import os
from pathlib import Path

import numpy as np
import pytest

from outrider.data.team_run import TeamRun
from outrider.io.mrclam import write_mrclam
from outrider.io.registry import read_log
from outrider.sim.barcodes import BarcodeTeam, barcode_log
from outrider.workflows.config import FuseConfig, TeamSection
from outrider.workflows.team import fuse_team_log
from published import publish

pytestmark = pytest.mark.evidence

SEEDS = range(1, 1 + int(os.environ.get("OUTRIDER_SEEDS", "8")))
SLOW = 1 if len(SEEDS) > 3 else 0  # seeds of `distributed`, which takes minutes
SET_UPS = {
    "15 landmarks, all robots see them": BarcodeTeam(),
    "3 of 15 landmarks can be seen": BarcodeTeam(shown=3),
    "only robot 1 sees landmarks": BarcodeTeam(seers=1),
    "robot 3 misreads every barcode": BarcodeTeam(liar=3),
}
FULL, SCARCE, ONE, LIAR = SET_UPS


def run(folder: Path, team: BarcodeTeam, seed: int, cooperation: str) -> TeamRun:
    log, truth = barcode_log(team, seed)
    write_mrclam(log, truth, folder)
    return fuse_team_log(read_log(folder), FuseConfig(team=TeamSection.model_validate({"cooperation": cooperation})))


def robots(r: TeamRun) -> list[float]:
    return [s.score.rmse for s in r.robots if s.score is not None]


def spread(values: list[float], form: str = "{:.3f}") -> str:
    mean, low, high = (form.format(v) for v in (np.mean(values), min(values), max(values)))
    return f"{mean} ({low} to {high})"


def row(what: str, runs: list[TeamRun], bound: str, good: bool) -> tuple[str, ...]:
    scores, alone = [r.score for r in runs if r.score], [r.alone for r in runs if r.alone]
    assert len(scores) == len(alone) == len(runs)
    return (
        what, f"{len(runs)}", spread([s.rmse for s in scores]), spread([s.rmse for s in alone]),
        f"{max(max(robots(r)) for r in runs):.3f}", f"{max(s.largest for s in scores):.2f}",
        spread([s.nees for s in scores], "{:.2f}"), f"{np.mean([s.inside for s in scores]):.0%}",
        f"{max((x.started - r.start) * 1e-9 for r in runs for x in r.robots):.0f}",
        f"{np.mean([r.wall_seconds for r in runs]):.0f}", bound, "" if not bound else "kept" if good else "MISSED",
    )  # fmt: skip


def gains(runs: list[TeamRun]) -> list[float]:
    return [1.0 - r.score.rmse / r.alone.rmse for r in runs if r.score and r.alone]


def test_five_robots_in_a_room(tmp_path: Path) -> None:
    done = {
        name: [run(tmp_path / f"{k}-{seed}", team, seed, "joint") for seed in SEEDS]
        for k, (name, team) in enumerate(SET_UPS.items())
    }
    apart = [run(tmp_path / f"d-{seed}", SET_UPS[ONE], seed, "distributed") for seed in list(SEEDS)[:SLOW]]
    gained, blind = gains(done[SCARCE]), [max(robots(r)) for r in done[ONE]]
    everybody = all(len(r.robots) == 5 and not r.absent for runs in (*done.values(), apart) for r in runs)
    others = [max(s.score.rmse for s in r.robots if s.score and s.name != "robot3") for r in done[LIAR]]
    rows = [
        row(f"joint; {FULL}", done[FULL], "", True),
        row(f"joint; {SCARCE}", done[SCARCE], f"gain >= 25 %: {spread(gained, '{:.0%}')}", min(gained) >= 0.25),
        row(f"joint; {ONE}", done[ONE], f"each robot < 0.30 m: {spread(blind)}", max(blind) < 0.30),
        *(row(f"distributed; {ONE}", [r], "each robot < 0.30 m", max(robots(r)) < 0.30) for r in apart),
        row(f"joint; {LIAR}", done[LIAR], f"the other four < 0.10 m: {spread(others)}", max(others) < 0.10),
    ]
    publish(
        "team-of-five", "Five robots in files of the UTIAS format",
        f"Simulated folders (`outrider.sim.barcodes`), seeds {SEEDS[0]} to {SEEDS[-1]}: 15 m x 8 m, 15 "
        f"landmarks, 15 minutes, odometry at 67 Hz with scales, curvature and walks, range 0.12 m, bearing 0.5 "
        f"deg, reach 6 m, 63 deg of view, 1 % of barcodes misread, logs that start at different times; written "
        f"as text files, read and fused as `outrider fuse FOLDER` does, starts and noise found from the data. "
        f"Errors are against ground truth, over all robots together from each one's start on: means over seeds "
        f"(least to most). Alone: the same robots from the same starts without exchange; robots that see no "
        f"landmark then have odometry only. NEES is per degree of freedom of position and heading; in band: "
        f"share of the time inside its 95 % band.",
        ("set-up", "seeds", "RMSE [m]", "alone [m]", "worst robot [m]", "largest [m]", "NEES", "in band",
         "last start [s]", "wall [s]", "bound", ""),
        rows,
    )  # fmt: skip
    assert everybody
    assert min(gained) >= 0.25
    assert max(blind) < 0.30
    assert all(0.7 < r.score.nees < 1.3 for name in (FULL, SCARCE, ONE) for r in done[name] if r.score)
    assert max(others) < 0.10 and all(max(robots(r)) < 0.30 for r in apart)
