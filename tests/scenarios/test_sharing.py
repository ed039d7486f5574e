"""What a run says of the estimates that its robots share."""

import numpy as np
import pytest

from outrider.errors import ConfigError
from outrider.scenarios.build import build
from outrider.scenarios.files import load_scenario
from outrider.scenarios.sharing import sharing

pytestmark = pytest.mark.compiled


def told(seconds=20.0, **given):
    cast = build(*load_scenario("airliner-tour", {"duration_s": seconds, **given}))
    return sharing(cast, cast.run())


def test_robots_pairs_and_sensors_agree_with_themselves():
    """Correct models: NEES and NIS about 1. In 30 s there are few independent errors, so the bounds are wide."""
    done = told(30.0)
    for row in (*done["robots"].values(), *done["pairs"]):
        assert 0.3 < row["nees_per_dof"] < 2.5 and row["in_band"] > 0.5
    assert [p["robots"] for p in done["pairs"]] == [["ugv", "uav"]]
    by = {(x["robot"], x["kind"]): x for x in done["sensors"]}
    for key in (("uav", "Baro"), ("uav", "GnssPosition"), ("ugv", "Twist"), ("uav", "RelativePose")):
        assert by[key]["nis_per_dof"] == pytest.approx(1.0, abs=0.2) and by[key]["in_bound"] > 0.9
    assert by["uav", "GnssPosition"]["worth_in_1_s"] == pytest.approx(0.7 / np.sqrt(10.0), rel=0.01)
    assert done["unobserved"] == [] and done["ablation"] is None


def test_each_sensor_is_left_out_in_turn():
    done = told(20.0, ablate=True)
    left_out = {(a["robot"], a["sensor"]): a["robots"] for a in done["ablation"]}
    assert set(left_out) == {(x["robot"], x["sensor"]) for x in done["sensors"]}
    own = done["robots"]["uav"]["position_m"]
    assert left_out["uav", "gnss_velocity"]["uav"]["position_m"] > 1.1 * own


def test_a_radio_that_loses_everything_leaves_everybody_alone():
    deaf, alone = told(15.0, method="distributed", loss=1.0), told(15.0, method="local")
    for name, r in alone["robots"].items():
        assert deaf["robots"][name]["position_m"] == pytest.approx(r["position_m"], abs=1e-9)
    assert deaf["exchange"]["lost"] == {"chance": deaf["exchange"]["telegrams"]}
    assert alone["exchange"] is None and "exchange" not in alone["without"]


def test_what_nothing_measures_is_named():
    """The error of a gyro about the vertical shows in nothing if there is no gyro."""
    given = {"team.ugv.faults": [{"type": "faulty", "sensor": "imu", "start_s": 0.0, "end_s": 1e4}]}
    assert any(text.startswith("gyro_bias of ugv") for text in told(15.0, **given)["unobserved"])


def test_a_team_that_estimates_by_itself_is_refused():
    with pytest.raises(ConfigError, match="estimate by themselves"):
        build(*load_scenario("patrol", {"cooperation.method": "joint"}))
