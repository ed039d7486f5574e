"""Clearpath Husky outdoors, 395 s and 359 m: a compass that is wrong, wheels that are too large, a GPS that wanders."""

from pathlib import Path

import numpy as np
import pytest
from evidence_table import Table

from recorded import FIXES, HUSKY, UPSTREAM_END, husky, outages, unused

pytestmark = pytest.mark.evidence
NAME = Path(HUSKY).name
COMMAND = f"outrider fuse {NAME} --mount imu_link=0,0,0,90,0,-90"


def test_the_compass_is_named_and_the_path_holds(recordings: Path, table: Table):
    run = husky(recordings)
    (conflict,) = [f for f in run.findings if f.code == "heading-conflict"]
    table.add("husky", NAME, "heading conflict named", conflict.text.split(": ", 1)[1], "named", COMMAND)
    assert conflict.source.startswith("/imu/data")
    assert "not fused" in conflict.text
    assert not [f for f in run.findings if f.severity == "error"]


def test_fixes_it_has_not_seen(recordings: Path, table: Table):
    run = husky(recordings, withhold={FIXES: 5})
    score = unused(run)
    command = f"{COMMAND} --withhold {FIXES}=5"
    table.add("husky", NAME, "GPS at 0.5 Hz: RMSE on the unused fixes", f"{score.rmse:.2f} m", "<= 2.1 m", command)
    table.add("husky", NAME, "the same: NIS/dof", f"{score.nis_per_dof:.2f}", "0.3 to 1.3", command)
    table.add("husky", NAME, "the same: inside 95 % ellipses", f"{100 * score.coverage:.1f} %", "90 to 99.5 %", command)
    assert score.e.shape[0] > 700
    assert score.rmse <= 2.1
    assert 0.3 <= score.nis_per_dof <= 1.3
    assert 0.90 <= score.coverage <= 0.995


@pytest.mark.parametrize(("length", "bound"), [(60.0, 3.1), (120.0, 5.8)])
def test_outages(recordings: Path, table: Table, length: float, bound: float):
    score, pooled = outages(recordings, length)
    assert score.rmse.size > 20
    command = f"{COMMAND} -c outage.yaml"  # outages_s: {/fix: [[60, 120]]}, then [[70, 130]] and so on
    name = f"{length:.0f} s outages, {score.rmse.size} windows"
    spread = f"mean {score.rmse.mean():.2f}, worst {score.rmse.max():.1f}"
    table.add("outages", NAME, f"{name}: median RMSE", f"{score.median:.2f} m ({spread})", f"<= {bound} m", command)
    table.add(
        "outages", NAME, f"{name}: NIS/dof of all unused fixes", f"{pooled.nis_per_dof:.2f}", "0.3 to 1.3", command
    )
    table.add(
        "outages", NAME, f"{name}: inside 95 % ellipses", f"{100 * pooled.coverage:.1f} %", "90 to 99.5 %", command
    )
    assert score.median <= bound
    assert 0.3 <= pooled.nis_per_dof <= 1.3
    assert 0.90 <= pooled.coverage <= 0.995


def test_the_upstream_profile_ends_where_upstream_says(recordings: Path, table: Table):
    run = husky(recordings, preset="robot_localization")
    end = run.fused.pose.p[-1, :2]
    off = float(np.hypot(*(end - UPSTREAM_END)))
    x, y = UPSTREAM_END
    where = f"({x}, {y})"
    command = f"{COMMAND} --preset robot_localization"
    table.add("husky", NAME, f"upstream profile, no GPS: end to {where}", f"{off:.2f} m", "<= 1.05 m", command)
    assert off <= 1.05
