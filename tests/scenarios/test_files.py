"""Scenario files: what is said is what is run; what cannot be is one line with its place and remedy."""

from pathlib import Path

import numpy as np
import pytest
from yard import YARD

from outrider.errors import ConfigError, ExitCode
from outrider.scenarios.build import build
from outrider.scenarios.files import load_scenario, resolved, scenario_text, schema, settings_of
from outrider.scenarios.parts import FAULTS, PLACES, SENSORS, VEHICLES
from outrider.scenarios.runs import rehearse
from outrider.sim.sensors import Clocked, Faulty, Wrong

FAULTY = {
    "type: imu, rate_hz: 20": ("type: imuu", r"sensors\.0: there is no 'imuu' .did you mean 'imu'\?"),
    "rate_hz: 20}": ("rate_hz: -20}", r"sensors\.0\.rate_hz: should be more than 0, is -20"),
    "rate_hz: 5}": ("rate_hz: 5, sigma_m: 1}", r"sensors\.2\.sigma_m: unknown key .did you mean 'sigma'\?"),
    "name: wheels": ("name: gnss", r"sensors\.2: a second sensor of the name 'gnss'"),
    "type: open_field": ("type: open_feld", r"world\.place: there is no 'open_feld' .did you mean 'open_field'\?"),
    "side: 60": ("side: sixty", r"place\.side: should be a number, is 'sixty'"),
    "type: differential": ("type: differental", r"vehicle: there is no 'differental' .did you mean 'differential'\?"),
    "step_s: 0.02": ("step_s: 0.2", r"team\.rover\.vehicle: Differential: lag_s of 0\.1 s is shorter than a step"),
    "lag_s: 0.1": ("lag: 0.1", r"vehicle\.drive\.lag: unknown key .did you mean 'lag_s'\?"),
    "u: [[0.5, 0, 0.1]]": ("u: [[0.5, 0]]", r"mission: 2 numbers in a row of u .give v_x, v_y, w_z"),
    "t_s: [0]": ("t_s: [0, 1]", r"mission: schedule: .*times for commands"),
    "type: schedule, t_s: [0], u: [[0.5, 0, 0.1]]": ("type: tour", r"mission\.waypoints: is missing"),
    "duration_s: 3": ("duration_s: 0", r"duration_s: should be more than 0, is 0"),
    "duration_s: 3\n": ("", r"duration_s: is missing .all keys here: name, about"),
    "yaw_deg: 90": ("yaw_deg: north", r"start\.yaw_deg: should be a number, is 'north'"),
    "x: 1,": ("x: 1, yaw: 1,", r"start: both yaw and yaw_deg are given"),
    "x: 1, ": ("x: .nan, ", r"start\.x: should be a number, is nan"),
    "rover:": ("ro ver:", r"team.*should match pattern"),
    "seed: 3": ("seed: -3", r"seed: should be 0 or more, is -3"),
}  # fmt: skip


@pytest.mark.parametrize("old", FAULTY)
def test_a_fault_is_one_line_with_its_place(tmp_path: Path, old: str) -> None:
    new, words = FAULTY[old]
    path = tmp_path / "yard.yaml"
    path.write_text(YARD.replace(old, new, 1))
    with pytest.raises(ConfigError, match=words) as caught:
        build(*load_scenario(str(path)))
    text = str(caught.value)
    assert text.startswith(f"{path}:") and "\n" not in text and caught.value.exit_code == ExitCode.USAGE


IMPOSSIBLE = {
    "fault of nothing": ("faults: [{type: faulty, sensor: gns, start_s: 1, end_s: 2}]", r"faults\.0: no sensor 'gns'"),
    "reversed fault": ("faults: [{type: faulty, sensor: gnss, start_s: 2, end_s: 1}]", r"it must end after it starts"),
    "spell of an imu": ("faults: [{type: spell, sensor: imu, start_s: 1, end_s: 2}]", r"something of a gnss_receiver"),
    "blind tour": (
        "sensors: []\n    mission: {type: tour, waypoints: [[1, 2]]}",
        r"mission: cannot tell where it is .give it a gnss",
    ),
    "waypoint": ("mission: {type: tour, waypoints: [[1, 2, 3, 4]]}", r"mission: a waypoint of 4 numbers"),
    "goal": ("mission: {type: goto, goals: [[1]]}", r"mission: a goal of 1 numbers .give east, north"),
    "no goals": ("mission: {type: goto, goals: []}", r"mission\.goals: should be 1 entry or more"),
    "slow goto": ("mission: {type: goto, goals: [[1, 2]], drive: {turn: 0}}", r"drive\.turn: should be more than 0"),
    "blind goto": ("sensors: []\n    mission: {type: goto, goals: [[1, 2]]}", r"mission: cannot tell where it is"),
    "two lidars": (
        "sensors: [{type: lidar}, {type: lidar, name: rear}, {type: gnss}]\n    mission: {type: goto, goals: [[1, 2]]}",
        r"mission: .*2 lidars .a robot that drives by itself looks with one",
    ),
    "track and vehicle": (
        "mission: {type: track, points: [[1, 2, 0], [3, 4, 0]]}",
        r"mission: a track carries its robot",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", IMPOSSIBLE)
def test_what_cannot_be_is_located(tmp_path: Path, case: str) -> None:
    lines, words = IMPOSSIBLE[case]
    text = YARD
    for key in ("sensors", "mission"):
        if f"{key}:" in lines:
            start = text.index(f"    {key}:")
            end = text.index("    mission:") if key == "sensors" else len(text)
            text = text[:start] + text[end:]
    path = tmp_path / "yard.yaml"
    path.write_text(f"{text}    {lines}\n")
    with pytest.raises(ConfigError, match=words) as caught:
        build(*load_scenario(str(path)))
    assert str(caught.value).startswith(f"{path}:") and "team.rover" in str(caught.value)


def test_wheels_without_full_rank_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "yard.yaml"
    wheels = "type: mecanum, wheels: [[0.4, 0, 0], [-0.4, 0, 0], [0.2, 0, 0]]"
    path.write_text(YARD.replace("type: differential", wheels))
    with pytest.raises(ConfigError, match=rf"{path}:\d+: team\.rover\.vehicle: .*cannot tell forward"):
        build(*load_scenario(str(path)))


def test_a_start_inside_a_wall_shows_in_a_rehearsal(tmp_path: Path) -> None:
    path = tmp_path / "yard.yaml"
    walls = "  walls: [{name: shed, outline: [[0, -1], [2, -1], [2, 1], [0, 1]]}]\nteam:"
    path.write_text(YARD.replace("team:", walls))
    with pytest.raises(ConfigError, match=r"yard\.yaml:\d+: team\.rover: starts 0\.50 m inside shed"):
        rehearse(*load_scenario(str(path)))


def test_angles_come_in_degrees_and_orientations_in_roll_pitch_yaw(tmp_path: Path) -> None:
    path = tmp_path / "yard.yaml"
    camera = "{type: robot_camera, half_angle_deg: 30, mount_rpy_deg: [0, -90, 0]}"
    path.write_text(YARD.replace("{type: gnss, rate_hz: 5}", camera))
    scenario, where = load_scenario(str(path))
    robot = build(scenario, where).team[0]
    looking = robot.sensors[2]
    assert looking.half_angle == np.radians(30.0) and robot.start[3] == 0.5 * np.pi
    np.testing.assert_allclose(looking.mount, [0.0, -np.sqrt(0.5), 0.0, np.sqrt(0.5)])
    np.testing.assert_allclose(robot.mounts["camera"][:3, :3] @ [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], atol=1e-12)


def test_faults_stand_around_their_sensors(tmp_path: Path) -> None:
    path = tmp_path / "yard.yaml"
    faults = (
        "    faults:\n      - {type: faulty, sensor: gnss, start_s: 1, end_s: 2, how: frozen}\n"
        "      - {type: clocked, sensor: gnss, offset_s: 0.5}\n"
    )
    path.write_text(YARD + faults)
    gnss = build(*load_scenario(str(path))).team[0].sensors[2]
    assert isinstance(gnss, Clocked) and isinstance(gnss.sensor, Faulty) and gnss.sensor.how is Wrong.FROZEN


def test_the_resolved_scenario_is_the_same_scenario(tmp_path: Path) -> None:
    first, second = tmp_path / "yard.yaml", tmp_path / "resolved.yaml"
    first.write_text(YARD)
    scenario, _ = load_scenario(str(first))
    second.write_text(scenario_text(scenario))
    again, _ = load_scenario(str(second))
    assert again == scenario and resolved(again) == resolved(scenario)


def test_values_of_the_command_line_stand_over_the_file(tmp_path: Path) -> None:
    path = tmp_path / "yard.yaml"
    path.write_text(YARD)
    told = ("seed=9", "team.rover.sensors.gnss.rate_hz=2", "team.rover.sensors.0.rate_hz=10", "world.wind.mean=[1,2,3]")
    scenario, _ = load_scenario(str(path), settings_of(told))
    rover = scenario.team["rover"]
    assert scenario.seed == 9 and scenario.world.wind.mean == (1.0, 2.0, 3.0)
    assert (rover.sensors[2].rate_hz, rover.sensors[0].rate_hz) == (2.0, 10.0)


@pytest.mark.parametrize(
    ("told", "words"),
    [
        ("seed", r"--set seed: cannot be understood .write a\.b=value"),
        ("seed=[", r"--set seed=\[: is not YAML"),
        ("seed.x=1", r"--set seed\.x: 'seed' holds nothing"),
        ("team.rover.sensors.gns.rate_hz=1", r"no item 'gns' .did you mean 'gnss'\?"),
        ("team.rover.speed=1", r"team\.rover\.speed: unknown key"),
        ("site=amr_lop", None),
    ],
)
def test_values_that_fit_nowhere(tmp_path: Path, told: str, words: str | None) -> None:
    path = tmp_path / "yard.yaml"
    path.write_text(YARD)
    name, words = ("patrol", r"--set site: should be 'amr_passage'") if words is None else (str(path), words)
    with pytest.raises(ConfigError, match=words):
        load_scenario(name, settings_of((told,)))


def test_an_unknown_name_gets_a_remedy() -> None:
    with pytest.raises(ConfigError, match=r"no scenario 'patrl' .did you mean 'patrol'\?"):
        load_scenario("patrl")


def test_the_schema_knows_every_type() -> None:
    whole = schema()
    world, robot = whole["$defs"]["WorldSection"]["properties"], whole["$defs"]["RobotSection"]["properties"]
    assert set(world["place"]["discriminator"]["mapping"]) == set(PLACES)
    assert set(robot["sensors"]["items"]["discriminator"]["mapping"]) == set(SENSORS)
    assert set(robot["faults"]["items"]["discriminator"]["mapping"]) == set(FAULTS)
    vehicle = next(one for one in robot["vehicle"]["anyOf"] if "discriminator" in one)
    assert set(vehicle["discriminator"]["mapping"]) == set(VEHICLES)
    assert "half_angle_deg" in whole["$defs"]["RobotCamera"]["properties"]


RELAY = (
    YARD.replace("team:\n  rover:\n", "team:\n  rover:\n    pad: {}\n    size: {radius: 0.5, height: 0.5}\n")
    + """
  scout:
    vehicle: {type: multirotor, step_s: 0.02}
    on: rover
    mission: {type: schedule, t_s: [0, 1], u: [[0, 0, 0, 0], [0, 0, 1, 0]]}
"""
)


def test_a_drone_starts_on_its_carrier_and_takes_off(tmp_path: Path) -> None:
    path = tmp_path / "yard.yaml"
    path.write_text(RELAY)
    cast = build(*load_scenario(str(path)))
    assert cast.team[1].start == (1.0, 0.0, 0.6, np.pi / 2)
    run = cast.run()
    assert [(n.robot, n.text) for n in run.notes] == [("scout", "it is in the air")]
    path.write_text(RELAY.replace("on: rover", "on: rowver"))
    with pytest.raises(ConfigError, match=r"team\.scout\.on: no robot 'rowver' with a pad .*did you mean 'rover'"):
        build(*load_scenario(str(path)))


def test_the_second_physics_is_chosen_in_the_file(tmp_path: Path) -> None:
    pytest.importorskip("mujoco", reason="the extra `physics` is not installed")
    path = tmp_path / "yard.yaml"
    path.write_text(YARD.replace("team:\n  rover:\n", "team:\n  rover:\n    physics: mujoco\n"))
    assert type(build(*load_scenario(str(path))).team[0].vehicle).__name__ == "MujocoRover"
    path.write_text(RELAY.replace("    on: rover\n", "    physics: mujoco\n"))
    with pytest.raises(ConfigError, match=r"team\.scout\.vehicle: physics 'mujoco' knows no multirotor"):
        build(*load_scenario(str(path)))


def test_an_item_goes_by_its_usual_name_too(tmp_path: Path) -> None:
    path = tmp_path / "yard.yaml"
    path.write_text(YARD.replace("{type: gnss, rate_hz: 5}", "{type: gnss_receiver, rate_hz: 5}"))
    for word in ("gnss", "gnss_receiver", "2"):
        scenario, _ = load_scenario(str(path), {f"team.rover.sensors.{word}.rate_hz": 1.0})
        assert scenario.team["rover"].sensors[2].rate_hz == 1.0


@pytest.mark.parametrize("rate", [".inf", "1e9"])
def test_no_sensor_is_that_fast(tmp_path: Path, rate: str) -> None:
    path = tmp_path / "yard.yaml"
    path.write_text(YARD.replace("{type: gnss, rate_hz: 5}", f"{{type: gnss, rate_hz: {rate}}}"))
    with pytest.raises(ConfigError, match=r"yard\.yaml:\d+: .*rate_hz: should be .*20000"):
        load_scenario(str(path))


def test_sizes_and_speeds_are_positive_and_of_this_world(tmp_path: Path) -> None:
    path = tmp_path / "yard.yaml"
    for old, new, words in (
        ("side: 60", "side: -60", r"world\.place\.side: should be more than 0"),
        ("type: differential,", "type: differential, radius: 1.0e+6,", r"vehicle\.radius: should be 10000 or less"),
    ):
        path.write_text(YARD.replace(old, new))
        with pytest.raises(ConfigError, match=words):
            load_scenario(str(path))
    with pytest.raises(ConfigError, match=r"--set speed: should be greater than 0, is -1"):
        load_scenario("patrol", {"speed": -1})
    with pytest.raises(ConfigError, match=r"--set minutes: should be within 1e\+12, is 1e\+300$"):
        load_scenario("site-fleet", {"minutes": 1e300})


@pytest.mark.parametrize(
    ("key", "meant"),
    [("spede", "'speed'"), ("gnss_rate", "'gnss_hz'"), ("tem.target", "'team'"), ("xyz", "target, danger")],
)
def test_an_unknown_setting_of_ours_gets_the_setting_that_was_meant(key: str, meant: str) -> None:
    with pytest.raises(ConfigError, match=rf"--set {key}: follow-leader has no setting of that name .*{meant}"):
        load_scenario("follow-leader", {key: 3})


UNREAL = {  # what is written instead -> what is said of it
    ("{type: imu,", "{type: imu, gyro_walk: 1,"): r"gyro_walk: unknown key",
    ("{type: imu,", "{type: imu, gyro_instability: -1,"): r"gyro_instability: should be 0 or more, is -1",
    ("{type: imu,", "{type: imu, instability_tau_s: 0,"): r"instability_tau_s: should be more than 0, is 0",
    ("{type: imu,", "{type: imu, gyro_range: -3,"): r"gyro_range: should be more than 0, is -3",
    ("{type: imu,", "{type: imu, misalignment_deg: .inf,"): r"should be a finite number, is inf",
    ("{type: imu,", "{type: imu, gyro_density: 1e300,"): r"gyro_density: should be within 1e\+12, is 1e\+300",
    ("{type: imu,", "{type: imu, mount: [0, 0, 0, 0],"): r"mount: is no rotation \(x, y, z, w of a length of 1;",
    ("{type: imu,", "{type: imu, mount: [1, 1, 1, 1],"): r"mount: is no rotation",
    ("{type: gnss, rate_hz: 5}", "{type: gnss, latency_s: .inf}"): r"latency_s: should be a finite number, is inf",
    ("{type: gnss, rate_hz: 5}", "{type: gnss, phase_s: 1e+11}"): r"phase_s: should be 1e\+09 or less",
    ("{type: gnss, rate_hz: 5}", "{type: gnss, phase_s: -1}"): r"phase_s: should be 0 or more",
    ("{type: gnss, rate_hz: 5}", "{type: gnss}\n      - {type: lidar, drop: 1.5}"): r"drop: should be 1 or less",
    ("{type: gnss, rate_hz: 5}", "{type: gnss}\n      - {type: lidar, field: -1}"): r"a field of -1 rad \(more than 0",
    ("{type: gnss, rate_hz: 5}", "{type: gnss}\n      - {type: uwb, blocked: 2}"): r"blocked: should be 1 or less",
    ("{type: gnss, rate_hz: 5}", "{type: gnss}\n    drift: {gnss_sigma: -1}"): r"gnss_sigma: should be 0 or more",
    ("{type: gnss, rate_hz: 5}", "{type: gnss}\n    drift: {gnss_tau_s: 0}"): r"gnss_tau_s: should be more than 0",
    ("{type: gnss, rate_hz: 5}", "{type: gnss}\n    size: {radius: 1, height: -1}"): r"a cylinder of 1 m, -1 m high",
    ("{type: gnss, rate_hz: 5}", "{type: gnss}\n      - {type: wheel_encoders}"): r"has 2 actuators \(`wheels`",
    ("{type: gnss, rate_hz: 5}", "{type: gnss}\n      - {type: steering_encoder, angle: 7}"): r"none of number 0 or 7",
}  # fmt: skip


@pytest.mark.parametrize("change", UNREAL)
def test_numbers_that_cannot_hold_are_refused(tmp_path: Path, change: tuple[str, str]) -> None:
    path = tmp_path / "yard.yaml"
    assert change[0] in YARD
    path.write_text(YARD.replace(*change))
    with pytest.raises(ConfigError, match=UNREAL[change]) as caught:
        rehearse(*load_scenario(str(path)))
    assert "\n" not in str(caught.value)


def test_what_has_no_end_may_be_infinite(tmp_path: Path) -> None:
    path = tmp_path / "yard.yaml"
    path.write_text(YARD.replace("{type: imu,", "{type: imu, gyro_range: .inf, accel_range: .inf,"))
    scenario, _ = load_scenario(str(path))
    assert scenario.team["rover"].sensors[0].gyro_range == np.inf
