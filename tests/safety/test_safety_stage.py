"""The stage before the motors: limits, zones, debounce, and every input that may fail."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import Point, Polygon
from shapely.affinity import rotate, translate

from outrider.data.driving import DriveLimits, Steering
from outrider.data.footprint import Footprint
from outrider.data.surroundings import Surroundings
from outrider.errors import ConfigError
from outrider.models.wheels import WheelKinematics
from outrider.safety.clearance import around, body_of, clash, clash_ahead, room
from outrider.safety.monitor import AWAY, Action, Monitor, Zone, returns
from outrider.safety.stage import Inputs, Reason, SafetyStage, Scan, Watchdog
from outrider.safety.stopping import (
    brakeable,
    braking,
    moved,
    saturated,
    smoothed,
    stop,
    stopping_distance,
    stopping_time,
)

BOX = Footprint.rectangle(0.8, 0.5)
MECANUM = DriveLimits(
    steering=Steering.HOLONOMIC, forward=1.0, backward=1.0, sideways=1.0, turn=2.0, acceleration=0.5,
    deceleration=1.0, turn_acceleration=1.5, rims=WheelKinematics.rectangle(0.3, 0.2).inverse, rim_speed=1.0,
)  # fmt: skip
CAR = DriveLimits(
    steering=Steering.CAR, forward=2.0, backward=1.0, turn=1.0, acceleration=0.5, turn_acceleration=1.0, min_radius=1.5
)
NEAR = Zone("bumper", np.array([[-0.6, -0.4], [0.6, -0.4], [0.6, 0.4], [-0.6, 0.4]]))
WIDE = Zone("hall", np.array([[-2.0, -2.0], [2.0, -2.0], [2.0, 2.0], [-2.0, 2.0]]), share=0.4)
STAGE = SafetyStage(limits=MECANUM, monitor=Monitor(footprint=BOX, zones=(NEAR, WIDE)))
EMPTY = np.full(360, np.inf)
FORWARD = np.array([0.8, 0.0, 0.0])
twist = st.tuples(*(st.floats(-5.0, 5.0) for _ in range(3))).map(np.array)


def seen(at: float, ranges: np.ndarray = EMPTY, command: np.ndarray = FORWARD, **more) -> Inputs:
    scan = Scan(time=at, ranges=ranges, angle_min=-np.pi, angle_step=2.0 * np.pi / len(EMPTY), reach=20.0)
    good = Inputs(time=at, command=command, command_time=at, pose=np.zeros(3), pose_time=at, scan=scan)
    return replace(good, **more)


def run(inputs: list[Inputs], state=None):
    state, out = state or STAGE.start(0.0), []
    for x in inputs:
        state, answer = STAGE.step(state, x)
        out.append(answer)
    return state, out


def moving():
    """A robot that goes at the commanded 0.8 m/s."""
    state, out = run([seen(0.1 * k) for k in range(40)])
    np.testing.assert_allclose(out[-1].twist, FORWARD)
    assert out[-1].reason is Reason.NONE
    return state


def wall(distance: float) -> np.ndarray:
    """Straight ahead, half a metre wide to either side."""
    a = -np.pi + 2.0 * np.pi / 360 * np.arange(360)
    with np.errstate(divide="ignore", invalid="ignore"):
        r = np.where(np.abs(a) < 1.2, distance / np.cos(a), np.inf)
    return np.where(np.abs(r * np.sin(a)) < 0.5, r, np.inf)


@given(want=twist, last=twist, dt=st.floats(0.01, 0.2))
@settings(max_examples=200)
def test_commands_within_limits_and_changes_within_theirs(want: np.ndarray, last: np.ndarray, dt: float) -> None:
    for limits in (MECANUM, CAR):
        a, b = saturated(want, limits), saturated(last, limits)
        assert limits.excess(a) <= 1.0 + 1e-9
        c = smoothed(a, b, limits, dt)
        hard = np.array([max(limits.acceleration, limits.deceleration)] * 2 + [limits.turn_acceleration])
        assert (np.abs(c - b) <= hard * dt + 1e-9).all()
        assert limits.excess(c) <= 1.0 + 1e-9  # the velocity set is convex
    assert np.abs(saturated(want, MECANUM)) @ [1.0, 1.0, 0.5] <= 1.0 + 1e-9


@given(want=twist)
@settings(max_examples=100)
def test_saturation_keeps_the_direction(want: np.ndarray) -> None:
    out = saturated(want, MECANUM)
    np.testing.assert_allclose(np.cross(out, want), 0.0, atol=1e-9)
    assert out @ want >= 0.0


@given(pose=st.tuples(*(st.floats(-3.0, 3.0),) * 3).map(np.array), u=twist, reaction=st.floats(0.0, 0.3))
@settings(max_examples=60)
def test_the_way_to_rest_is_the_integral_of_the_twist(pose: np.ndarray, u: np.ndarray, reaction: float) -> None:
    u = saturated(u, MECANUM)
    z = braking(pose, u, MECANUM, reaction)
    T, h = stopping_time(u, MECANUM), 1e-3
    p, t = pose.copy(), 0.0
    while t < reaction + T:
        m = t + 0.5 * h
        share = 1.0 if m < reaction else max(1.0 - (m - reaction) / T, 0.0) if T > 0.0 else 0.0
        p = moved(p, share * u, np.array([h]))[0]
        t += h
    np.testing.assert_allclose(z[-1, :3], p, atol=4e-3)


def test_stopping_distance_of_the_book() -> None:
    assert stopping_distance(2.0, 1.0, 0.5) == 3.0
    z = braking(np.zeros(3), np.array([0.8, 0.0, 0.0]), MECANUM, 0.1)
    assert z[-1, 0] == pytest.approx(stopping_distance(0.8, 1.0, 0.1))


def test_a_stop_takes_what_braking_takes_and_no_more() -> None:
    u, cycles = np.array([0.8, 0.1, 0.1]), 0
    while np.abs(u).max() > 0.0:
        after = stop(u, MECANUM, 0.1)
        assert np.hypot(*(u - after)[:2]) <= 0.1 * 1.0 + 1e-9
        u, cycles = after, cycles + 1
    assert cycles == 9


@pytest.mark.parametrize(
    ("broken", "reason"),
    [
        ({"pose_time": 0.0}, Reason.NO_LOCALISATION),
        ({"pose": None}, Reason.NO_LOCALISATION),
        ({"pose": np.array([np.nan, 0.0, 0.0])}, Reason.BAD_POSE),
        ({"scan": None}, Reason.NO_SCAN),
        ({"command_time": 0.0}, Reason.NO_COMMAND),
        ({"command_time": 99.0}, Reason.NO_COMMAND),
        ({"command": None}, Reason.NO_COMMAND),
        ({"command": np.array([np.nan, 0.0, 0.0])}, Reason.BAD_COMMAND),
        ({"command": np.zeros(2)}, Reason.BAD_COMMAND),
        ({"time": 1.0}, Reason.CLOCK),
        ({"time": np.nan}, Reason.CLOCK),
    ],
)
def test_whatever_fails_ends_in_a_controlled_stop(broken: dict, reason: Reason) -> None:
    state, before = moving(), 0.8
    for k in range(40, 52):
        state, answer = STAGE.step(state, seen(0.1 * k, **broken))
        assert answer.reason is reason
        assert np.isfinite(answer.twist).all()
        assert before - 0.1 - 1e-9 <= answer.twist[0] < before or answer.twist[0] == before == 0.0
        before = float(answer.twist[0])
    assert before == 0.0
    assert state.count(reason) == 12


@pytest.mark.parametrize("ranges", [np.full(360, np.nan), np.empty(0), np.where(np.arange(360) < 300, np.nan, 5.0)])
def test_a_scan_that_says_nothing_stops_the_robot(ranges: np.ndarray) -> None:
    state, out = run([seen(4.0 + 0.1 * k, ranges) for k in range(12)], moving())
    assert {x.reason for x in out} == {Reason.BLIND}
    assert not out[-1].twist.any()
    assert state.count(Reason.BLIND) == 12


def test_a_scan_that_is_old_stops_the_robot() -> None:
    old = seen(3.9).scan
    _, out = run([seen(4.0 + 0.1 * k, scan=old) for k in range(16)], moving())
    assert out[3].reason is Reason.NONE
    assert out[-1].reason is Reason.NO_SCAN
    assert not out[-1].twist.any()


def test_some_invalid_beams_do_not_hide_a_wall() -> None:
    ranges = wall(0.55)
    ranges[::2] = np.nan
    _, out = run([seen(4.0 + 0.1 * k, ranges) for k in range(12)], moving())
    assert out[-1].reason is Reason.ZONE
    assert not out[-1].twist.any()


def test_a_zone_takes_force_and_loses_it_after_several_scans_in_a_row() -> None:
    """trigger 2, release 5: one ghost does nothing, one gap frees nothing."""
    turn = np.array([0.0, 0.0, 0.1])
    state, out = run([seen(4.0, wall(0.55), turn)], moving())
    assert state.watch.on == (False, False)
    state, out = run([seen(4.1, wall(0.55), turn)], state)
    assert out[-1].reason is Reason.ZONE
    assert out[-1].ruling is not None
    assert out[-1].ruling.zone == "bumper"
    assert out[-1].ruling.points >= 3
    state, out = run([seen(4.2 + 0.1 * k, command=turn) for k in range(6)], state)
    assert [x.reason is Reason.ZONE for x in out] == [True] * 4 + [False] * 2


def test_a_slow_zone_scales_the_command() -> None:
    side = np.where(np.abs(np.arange(360) - 270) < 5, 1.5, np.inf)  # 90 degrees to the left
    _, out = run([seen(4.0 + 0.1 * k, side) for k in range(30)], moving())
    assert out[-1].reason is Reason.SLOWED
    np.testing.assert_allclose(out[-1].twist, 0.4 * FORWARD)


def test_approach_keeps_what_the_brakes_can_do_and_never_touches() -> None:
    """Straight on to a wall: v t_r + v^2 / 2 b never exceeds the way that is left, and not much less is driven."""
    stage = replace(STAGE, monitor=Monitor(footprint=BOX, reaction=0.2))
    state, x, speeds = stage.start(0.0), 0.0, []
    for k in range(200):
        state, answer = stage.step(state, seen(0.1 * k, wall(4.0 - x)))
        speeds.append(float(answer.twist[0]))
        if answer.reason is Reason.APPROACHING:
            assert stopping_distance(speeds[-1], 1.0, 0.2) <= 3.6 - x + 1e-6
        x += 0.1 * float(answer.twist[0])
        assert x < 3.6
    assert x > 3.5
    assert state.count(Reason.APPROACHING) > 5 and state.times(Reason.APPROACHING) == 1
    assert speeds[-1] < 0.02


@given(soon=st.floats(0.0, 5.0), rest=st.floats(0.0, 5.0), reaction=st.floats(0.01, 1.0))
@settings(max_examples=100)
def test_what_can_be_braked_is_the_root_of_its_equation(soon: float, rest: float, reaction: float) -> None:
    s = brakeable(soon, rest, reaction)
    assert 0.0 <= s <= 1.0
    needed = s * reaction + 0.5 * s * s * rest
    assert needed == pytest.approx(soon, abs=1e-9) if s < 1.0 else needed <= soon + 1e-9


def test_time_to_collision_is_distance_by_speed() -> None:
    monitor, ahead = Monitor(footprint=BOX), np.array([1.0, 0.0, 0.0])
    assert monitor.time_to_collision(np.array([[1.2, 0.0]]), ahead, 2.0) == pytest.approx(0.8, abs=0.06)
    assert monitor.time_to_collision(np.array([[1.2, 0.3]]), ahead, 2.0) == np.inf
    assert monitor.time_to_collision(np.array([[1.2, 0.0]]), ahead, 0.5) == np.inf
    assert monitor.time_to_collision(np.array([[0.5, 0.0]]), np.zeros(3), 2.0) == np.inf
    assert Action.APPROACH.value == Reason.APPROACHING.value


@pytest.mark.parametrize(
    ("command", "allowed"),
    [((-0.5, 0.0, 0.0), True), ((0.5, 0.0, 0.0), False), ((0.5, 0.1, 0.0), False), ((0.0, 0.0, 0.5), False)],
)
@pytest.mark.parametrize("zones", [(), (NEAR,)])
def test_what_is_too_near_holds_no_motion_that_leads_away_from_it(
    command: tuple[float, float, float], allowed: bool, zones: tuple[Zone, ...]
) -> None:
    """A wall that cuts 1 cm off the front: forward never, turning never, back slowly."""
    stage = replace(STAGE, monitor=Monitor(footprint=BOX, zones=zones))
    state, out = stage.start(0.0), []
    for k in range(12):
        state, answer = stage.step(state, seen(0.1 * k, wall(0.39), np.array(command)))
        out.append(answer)
    assert out[-1].reason is (Reason.LEAVING if allowed else Reason.ZONE)
    np.testing.assert_allclose(out[-1].twist, AWAY * np.array(command) if allowed else np.zeros(3))
    assert not out[-1].reason.stops or not allowed


def test_the_scan_is_carried_to_where_the_robot_is_by_now() -> None:
    """The wall was 1.6 m away 0.4 s ago, at 0.8 m/s: 0.32 m are gone."""
    stage = replace(STAGE, monitor=Monitor(footprint=BOX))
    state = replace(moving(), watch=stage.start(0.0).watch)
    old = seen(4.0, wall(1.2)).scan
    _, late = stage.step(state, seen(4.4, scan=old))
    _, fresh = stage.step(replace(state, time=4.3), seen(4.4, wall(1.2 - 0.4 * 0.8)))
    assert late.ruling is not None and fresh.ruling is not None
    assert late.ruling.time_to_collision == pytest.approx(fresh.ruling.time_to_collision, abs=0.02)


def test_a_base_without_a_lidar_is_asked_for_no_scan() -> None:
    stage = replace(STAGE, monitor=None)
    state, answer = stage.step(stage.start(0.0), seen(0.1, scan=None))
    assert answer.reason is Reason.LIMITED and answer.twist[0] == pytest.approx(0.05)
    _, answer = stage.step(state, seen(0.2, scan=None, pose=None))
    assert answer.reason is Reason.NO_LOCALISATION


def test_who_stands_and_wants_to_stand_is_not_held_up() -> None:
    state, out = run([seen(0.1 * k, command=np.zeros(3), scan=None) for k in range(5)])
    assert out[-1].reason is Reason.NO_SCAN and state.count(Reason.NO_SCAN) == 0


def test_returns_of_a_mounted_lidar() -> None:
    """Backward at the rear: its first beam looks to the robot's rear."""
    ranges = np.array([2.0, np.nan, np.inf, 0.0, -1.0, 50.0])
    p = returns(ranges, 0.0, 0.5, 20.0, np.array([-0.3, 0.1, np.pi]))
    np.testing.assert_allclose(p, [[-2.3, 0.1]], atol=1e-12)


@given(
    x=st.floats(-3.0, 3.0),
    y=st.floats(-3.0, 3.0),
    h=st.floats(-3.0, 3.0),
    px=st.floats(-4.0, 4.0),
    r=st.floats(0.0, 1.0),
)
@settings(max_examples=100)
def test_room_is_the_distance_that_shapely_measures(x: float, y: float, h: float, px: float, r: float) -> None:
    shape = translate(rotate(Polygon(BOX.outline), h, origin=(0, 0), use_radians=True), x, y)
    discs = np.array([[px, 0.7, r, 0.0, 0.0]])
    mine = room(body_of(BOX), around(Surroundings(discs=discs), 1.0), x, y, h, 0.0)[0]
    p = Point(px, 0.7)
    signed = shape.exterior.distance(p) * (-1.0 if shape.contains(p) else 1.0) - r
    assert mine == pytest.approx(signed, abs=1e-9)


def test_a_moving_disc_is_met_where_it_will_be() -> None:
    """It crosses 2 m ahead in 2 s; the robot, 0.4 m long to the front, stands there from 1.6 s on."""
    z = np.column_stack([np.linspace(0.0, 3.0, 31), np.zeros(31), np.zeros(31), np.linspace(0.0, 3.0, 31)])
    discs = np.array([[2.0, -2.0, 0.1, 0.0, 1.0]])
    hit = clash(z, body_of(BOX), around(Surroundings(discs=discs), 5.0))
    assert not hit.free
    assert hit.time == pytest.approx(2.0 - 0.35, abs=0.06)
    assert clash(z, body_of(BOX), around(Surroundings(discs=discs * [1, 1, 1, 1, 0]), 5.0)).free


@pytest.mark.parametrize(
    ("heads", "free"),
    [(-1.0, True), (1.0, False), (-0.0001, False)],  # away, on into it, and never far enough
)
def test_what_is_too_near_at_the_start_does_not_count_while_the_room_grows(heads: float, free: bool) -> None:
    x = np.linspace(0.0, heads, 11)
    z = np.column_stack([x, np.zeros(11), np.zeros(11), np.linspace(0.0, 2.0, 11)])
    front = float(BOX.outline[:, 0].max())
    near = np.array([[front + 0.11, 0.0, 0.1, 0.0, 0.0]])  # 1 cm
    body = body_of(BOX)
    assert not clash(z, body, around(Surroundings(discs=near), 1.0), 0.02).free
    assert clash_ahead(z, body, around(Surroundings(discs=near), 1.0), 0.02).free is free
    far = np.vstack([near, [[float(BOX.outline[:, 0].min()) - 0.5, 0.0, 0.1, 0.0, 0.0]]])  # and one behind it
    behind = clash_ahead(z, body, around(Surroundings(discs=far), 1.0), 0.02)
    assert not behind.free
    if free:
        assert behind.obstacle == 1 and z[behind.knot, 0] == pytest.approx(-0.4, abs=0.1)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: Zone("z", np.zeros((2, 2))),
        lambda: Zone("z", NEAR.outline, share=1.0),
        lambda: Monitor(footprint=BOX, step=0.0),
        lambda: Watchdog(scan=np.inf),
    ],
)
def test_what_could_never_protect_is_refused(wrong) -> None:
    with pytest.raises(ConfigError):
        wrong()
