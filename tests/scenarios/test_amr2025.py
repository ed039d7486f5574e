"""The scenarios of amr2025 at the size of a test: a drive against its truth, a turn, a receiver that degrades."""

import numpy as np
import pytest

from outrider.campaign.papers.amr2025_drives import drive, turn
from outrider.errors import DataError
from outrider.models.wheels import WheelKinematics
from outrider.scenarios.amr2025 import DEGRADED_S, STOPS_DEG, wheels
from outrider.scenarios.build import build
from outrider.scenarios.files import load_scenario


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("name", "goals", "far"),
    [("map2", [[0.0, 6.0]], 6.0), ("simulation", [[4.0, 0.0]], 4.0), ("map1", [[4.0, 0.2]], 4.0)],
)
def test_a_short_drive_is_measured(name: str, goals: list[list[float]], far: float) -> None:
    got = drive({"scenario": f"amr2025-{name}", "given": {"team.robot.mission.goals": goals}}, seed=0)
    assert got["goal_error"].shape == (1,) and got["goal_error"][0] < 0.1
    assert got["goal_error"][0] <= got["goal_estimate"][0] + got["goal_control"][0] + 1e-9
    assert got["length_planned"] == pytest.approx(far, abs=0.1) and 0.9 < got["length_driven"] / far < 1.1
    assert 0.8 < got["smc_driven"] <= 1.0 and got["speed_r"] > 0.9 and 0.0 < got["speed_mae"] <= got["speed_rmse"] < 0.1
    assert got["heading_mae"] < 2.0 and got["fused_end"] < 0.1 and got["local_end"] < 1.0
    assert got["rate_ratio"] == pytest.approx(2.0, abs=0.1)


@pytest.mark.compiled
def test_a_missed_goal_is_an_error_and_no_number() -> None:
    given = {"team.robot.mission.goals": [[3.5, 5.0]], "team.robot.mission.drive.driver.patience_s": 0.5}
    with pytest.raises(DataError, match=r"goal \[3.5, 5.0\]: .*cannot stand at the goal"):
        drive({"scenario": "amr2025-map2", "given": given}, seed=0)


@pytest.mark.compiled
def test_headings_are_measured_at_every_stop() -> None:
    error = turn({"scenario": "amr2025-heading"}, seed=0)["heading_error"]
    assert error.shape == (9,) and 0.0 < np.abs(error).mean() < 0.5
    run = build(*load_scenario("amr2025-heading", {"duration_s": 9.0})).run()
    yaw = np.degrees(run.truth["robot"].trajectory().yaw[-1])
    step = np.degrees(0.5 * 0.005)  # turned in one step of the vehicle: a command starts and ends with one
    assert yaw == pytest.approx(STOPS_DEG[0], abs=step)  # it has stopped where the paper's robot did


def test_eight_wheels_move_every_way_and_their_rollers_mirror() -> None:
    k = WheelKinematics(tuple((x, y, g) for x, y, g in wheels()))
    assert np.linalg.matrix_rank(k.inverse) == 3
    np.testing.assert_allclose(np.linalg.norm(k.forward, axis=1)[:2], 1.0 / np.sqrt(8.0))  # 0.354 per wheel
    np.testing.assert_allclose(
        k.inverse[[6, 7, 4, 5]], k.inverse[:4] * [1.0, -1.0, 1.0]
    )  # rear as front, sideways turned


def test_the_second_receiver_degrades_and_is_no_source() -> None:
    scenario, _ = load_scenario("amr2025-degraded")
    robot = scenario.team["robot"]
    plain = next(s for s in robot.sensors if s.name == "plain")
    assert plain.spells[0].start_s == DEGRADED_S and plain.spells[0].fix == "single"
    agent = build(scenario).team[0].agent
    names = {c.stream for c in agent.body.navigator._filter.channels}
    assert names == {"imu", "encoders", "gnss"}
