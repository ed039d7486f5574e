"""A run in which a follower broke its protective distance says so, in every place, and does not end with 0."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from outrider.cli import main
from outrider.errors import ExitCode
from outrider.scenarios.files import load_scenario
from outrider.scenarios.followed import apart
from outrider.scenarios.runs import Done, run_scenario

HOMECOMING = {
    "target": "reverse", "team.follower.mission.approach": 0.0, "team.follower.mission.target_turn_deg": 90.0,
    "gnss_hz": 1.0, "latency_s": 0.3, "zone": 10.0, "duration_s": 20.0,
}  # fmt: skip


@cache
def reversal(folder: Path) -> tuple[Done, str]:
    """A target that comes back although nobody told the follower that it may."""
    done, _ = run_scenario(load_scenario("follow-leader", HOMECOMING)[0], folder / "near", command="x")
    return done, (folder / "near" / "report.html").read_text()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("near")


@pytest.mark.compiled
def test_outcome_summary_card_and_exit_code_say_when_and_how_deep(folder: Path) -> None:
    done, page = reversal(folder)
    s, d = apart(done.run, "follower", "target")
    least, when = d.min(), s[d.argmin()]
    assert least < 3.0
    (breach,) = done.breaches
    assert (breach.least, breach.at_s) == (least, when)
    assert breach.since_s == pytest.approx(s[d < 3.0][0])
    assert breach.inside_s == pytest.approx((d < 3.0).sum() * (s[1] - s[0]))
    assert done.exit_code == ExitCode.FAILED_CHECK
    told = f"{least:.3g} m between centres after {when:.1f} s, {3.0 - least:.3g} m too near at worst"
    assert told in done.sentence
    summary = json.loads((folder / "near" / "summary.json").read_text())
    assert summary["outcome"] == {"code": "too_near", "text": done.sentence}
    pursuit = summary["pursuit"]["follower"]
    assert (pursuit["least_m"], pursuit["broke_danger"]) == (least, True)
    assert pursuit["least_between_hulls_m"] == summary["separations"][0]["distance_m"] < least
    assert "verdict error" in page and "between centres, at least" in page and "hull to hull, at least" in page
    assert told in page


@pytest.mark.compiled
def test_the_command_ends_with_1_and_tells_hulls_from_centres(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sets = [w for key, value in HOMECOMING.items() for w in ("--set", f"{key}={value}")]
    assert main(["run", "follow-leader", *sets, "-o", str(tmp_path / "o"), "--no-report"]) == 1
    told = " ".join(capsys.readouterr().out.split())
    assert "broke its protective distance of 3 m behind target" in told
    assert "m between centres (" in told and "hull to hull)" in told


@pytest.mark.compiled
def test_the_papers_law_says_that_nothing_keeps_its_distance() -> None:
    from outrider.scenarios.build import build
    from outrider.scenarios.followed import breaches

    cast = build(*load_scenario("swarm2023-rendezvous", {"preset": "paper"}))
    (breach,) = breaches(cast, cast.run())
    assert not breach.guarded
    assert "its law flies without a safety filter" in breach.sentence


def test_who_keeps_its_distance_is_not_named() -> None:
    from outrider.scenarios.build import build
    from outrider.scenarios.followed import breaches

    cast = build(*load_scenario("follow-leader", {"target": "hover", "duration_s": 2.0}))
    run = cast.run()
    assert breaches(cast, run) == []
    assert np.isfinite(apart(run, "follower", "target")[1]).all()
