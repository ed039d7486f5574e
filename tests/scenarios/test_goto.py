"""A mission `goto` of a scenario file: goals in turn, each with what became of it; limits come from the vehicle."""

import json
from dataclasses import replace
from math import pi, tan
from pathlib import Path

import numpy as np
import pytest
from yard import YARD

from outrider.data.driving import Steering
from outrider.errors import ConfigError, ExitCode
from outrider.models.vehicles import Differential, Mecanum, Multirotor, Steered
from outrider.models.wheels import mecanum_rectangle
from outrider.scenarios.driving import DrivePart, drive_limits, goal_poses
from outrider.scenarios.files import load_scenario
from outrider.scenarios.runs import run_scenario

GOTO = YARD.replace("duration_s: 3\n", "duration_s: 60\n").replace(
    "{type: schedule, t_s: [0], u: [[0.5, 0, 0.1]]}",
    "{type: goto, goals: [[1, 2], {x: 3, y: 2, yaw_deg: 0}, [90, 0]], hold_s: 0.5}",
)


@pytest.mark.compiled
def test_goals_are_visited_in_turn_and_the_summary_says_how(tmp_path: Path) -> None:
    path = tmp_path / "yard.yaml"
    path.write_text(GOTO)
    told = {"team.rover.mission.goals": [[1, 2], {"x": 3, "y": 2, "yaw_deg": 0}]}
    done, summary = run_scenario(*load_scenario(str(path), told)[:1], tmp_path / "run", report=False)
    goals = summary["robots"]["rover"]["goals"]
    assert [g["outcome"] for g in goals] == ["arrived", "arrived"] and done.exit_code is ExitCode.OK
    assert all(g["error_m"] <= g["of_estimate_m"] + g["of_control_m"] + 1e-9 for g in goals)
    assert max(g["of_control_m"] for g in goals) < 0.06
    end = done.run.truth["rover"].trajectory()
    assert abs(end.yaw[-1]) < 0.1
    assert [n.text.split(",")[0] for n in done.run.notes] == ["goal 1 of 2 at (1", "goal 2 of 2 at (3"]
    assert json.loads((tmp_path / "run" / "summary.json").read_text())["robots"]["rover"]["goals"] == goals
    command = done.run.log.streams["command"]
    assert len(command) == len(done.run.log.streams["estimate"]) and not command.z[-1].any()


@pytest.mark.compiled
def test_a_goal_in_a_wall_is_named_and_the_next_one_visited(tmp_path: Path) -> None:
    path = tmp_path / "yard.yaml"
    path.write_text(GOTO.replace("{type: open_field, side: 60}", "{type: amr_bend}").replace("x: 1, ", ""))
    told = {"team.rover.mission.goals": [[3.5, 5], [0, 1.5]], "team.rover.mission.drive.driver.patience_s": 1.0}
    done, summary = run_scenario(*load_scenario(str(path), told)[:1], tmp_path / "run", report=False)
    first, second = summary["robots"]["rover"]["goals"]
    assert first["outcome"] == "unreachable" and "cannot stand at the goal" in first["reason"]
    assert second["outcome"] == "arrived" and done.exit_code is ExitCode.FAILED_CHECK


def test_what_the_wheels_can_do_bounds_what_is_asked() -> None:
    section, wheels = DrivePart(), mecanum_rectangle(0.25, 0.2)
    mecanum = Mecanum(wheels=wheels)
    limits = drive_limits(section, mecanum)
    top = 0.9 * mecanum.drive.top_speed
    assert limits.steering is Steering.HOLONOMIC and limits.rim_speed == top
    for twist in ((0.3, 0.2, 0.4), (-0.1, 0.4, -0.9)):  # the octahedron of four mecanum wheels
        rims = np.abs(limits.rims @ twist).max()
        assert rims == pytest.approx(abs(twist[0]) + abs(twist[1]) + 0.45 * abs(twist[2]))
    eight = Mecanum(wheels=tuple((x, y, a) for k in (0.15, 0.45) for x, y, a in mecanum_rectangle(k, 0.25)))
    assert drive_limits(section, eight).rims.shape == (8, 3)
    two = drive_limits(section, Differential(track=0.6))
    assert two.steering is Steering.DIFFERENTIAL and np.abs(two.rims @ [1.0, 0.0, 1.0]).max() == pytest.approx(1.3)
    car = drive_limits(section, Steered(wheel_base=0.8))
    assert car.steering is Steering.CAR and car.min_radius == pytest.approx(0.8 / tan(0.6))
    both = drive_limits(section, Steered(wheel_base=0.8, rear=-0.4, both_axles=True))
    assert both.min_radius == pytest.approx(0.4 / tan(0.6))


@pytest.mark.parametrize(
    ("vehicle", "words"),
    [
        (Multirotor(), "a multirotor does not drive on the ground"),
        (Differential(axle=0.2), "an axle 0.2 m ahead"),
        (Steered(rear=-0.4), "a rear axle -0.4 m ahead"),
    ],
)
def test_vehicles_that_cannot(vehicle: Multirotor | Differential | Steered, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        drive_limits(DrivePart(), vehicle)


def test_headings_may_be_left_out() -> None:
    poses = goal_poses([[1.0, 2.0], [3.0, 4.0, 1.5 * pi]])
    np.testing.assert_allclose(poses, [[1.0, 2.0, np.nan], [3.0, 4.0, -0.5 * pi]])
    with pytest.raises(ConfigError, match="not finite"):
        goal_poses([[np.inf, 0.0]])


def test_a_fast_section_is_still_bounded_by_the_motors() -> None:
    slow = replace(Differential().drive, max_rpm=1000.0)
    limits = drive_limits(DrivePart(forward=3.0), Differential(drive=slow))
    assert limits.excess(np.array([0.9 * slow.top_speed, 0.0, 0.0])) == pytest.approx(1.0)
