"""The inspection in closed loop: a drone that lands and leaves again, bad descriptions."""

import numpy as np
import pytest

from outrider.errors import ConfigError
from outrider.guidance.flight import Phase
from outrider.scenarios.build import build
from outrider.scenarios.files import load_scenario
from outrider.scenarios.inspected import inspection
from outrider.scenarios.sharing import sharing

SHORT = {"duration": 40.0, "team.ugv.mission.density": 1.0, "team.uav.mission.density": 1.0}


def cast_of(**given):
    return build(load_scenario("aircraft-inspection", SHORT | given)[0])


@pytest.mark.compiled
def test_the_drone_returns_lands_on_the_pad_and_leaves_again():
    cast = cast_of(endurance=14.0, charge=4.0, duration_s=85.0)
    run = cast.run()
    assert run.hit is None, run.sentence
    done = inspection(cast, run)
    assert done is not None
    landings = done["robots"]["uav"]["landings"]
    assert landings and landings[0]["off_m"] < 0.3
    told = [n.text for n in run.notes if n.robot == "uav"]
    assert any("battery at" in text for text in told)
    assert sum(text.startswith(Phase.CLIMB.value) for text in told) >= 2
    shared = sharing(cast, run)
    assert shared is not None
    for name, r in done["robots"].items():
        assert shared["robots"][name]["position_m"] < 0.3 and shared["robots"][name]["nees_per_dof"] < 2.5
        assert 0.0 < r["coverage"]["achieved"] <= r["coverage"]["reachable"] + 0.05
    assert all(c.distance > 0.1 for c in run.monitor.clearances.values())


@pytest.mark.compiled
def test_without_its_camera_the_drone_breaks_off_and_says_so():
    blind = {"team.uav.faults": [{"type": "faulty", "sensor": "camera_down", "start_s": 15.0, "end_s": 1e4}]}
    cast = cast_of(endurance=12.0, duration_s=85.0, **blind)
    run = cast.run()
    told = [n.text for n in run.notes if n.robot == "uav"]
    assert any(text.startswith(Phase.ABORT.value) and "out of sight" in text for text in told)
    assert not any(text.startswith("it stands on the pad: it touched") for text in told)
    assert run.hit is None


@pytest.mark.parametrize(
    ("given", "what"),
    [
        ({"world.place": {"type": "open_field"}}, "nothing to inspect"),
        ({"team.uav.mission.method": "none"}, "one for all"),
        ({"team.ugv.pad": None}, "pad"),
        ({"team.uav.sensors": []}, "cannot tell where it is"),
        ({"team.ugv.mission.margin": 30.0}, "of room"),
    ],
)
def test_what_cannot_be_is_named(given, what):
    with pytest.raises(ConfigError, match=what):
        cast_of(**given)


@pytest.mark.compiled
def test_the_same_seed_gives_the_same_bits():
    ends = [cast_of(duration_s=6.0).run().truth["uav"].p[-1] for _ in range(2)]
    assert np.array_equal(*ends)
