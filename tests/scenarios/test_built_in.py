"""The built-in scenarios do what their first sentence says."""

import pytest

from outrider.errors import ConfigError
from outrider.scenarios.build import build
from outrider.scenarios.files import load_scenario
from outrider.scenarios.registry import find_scenario, scenario, scenarios
from outrider.sim.engine import Ending, Simulation


def ran(name: str, **given: object) -> Simulation:
    return build(*load_scenario(name, given)).run()


@pytest.mark.compiled
@pytest.mark.parametrize("site", ["amr_passage", "amr_bend"])
def test_the_patrol_reaches_its_last_waypoint(site: str) -> None:
    done = ran("patrol", site=site)
    assert done.ending is Ending.GOAL and done.notes[-1].text.endswith("of 6 reached")


@pytest.mark.compiled
def test_the_tour_stays_clear_of_the_airliner() -> None:
    done = ran("airliner-tour")
    near = done.monitor.clearances
    assert done.ending is Ending.TIME and min(near["ugv"].distance, near["uav"].distance) > 0.3
    assert done.monitor.separations["uav", "ugv"].distance > 0.3
    seen = {name: len(done.log.streams[name]) for name in ("ugv/camera_up", "uav/camera_down", "ugv/lidar")}
    assert min(seen.values()) > 20, seen


@pytest.mark.compiled
def test_the_wind_carries_the_drone_off_its_lanes() -> None:
    calm, windy = ran("follow-field", wind=0.0).truth["drone"], ran("follow-field").truth["drone"]
    assert abs(calm.p[-1, 0] + 20.0) < 2.0 < abs(windy.p[-1, 0] - calm.p[-1, 0])


@pytest.mark.compiled  # inflates the maps of its robots
def test_every_scenario_can_be_built_and_says_what_it_is() -> None:
    for name, known in scenarios().items():
        cast = build(*load_scenario(name))
        assert cast.team and known.tags and known.about.endswith(".") and find_scenario(name) is known


def test_a_name_is_given_once() -> None:
    from outrider.scenarios.ground import patrol

    with pytest.raises(ConfigError, match="two scenarios"):
        scenario("patrol")(patrol)
