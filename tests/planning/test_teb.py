"""The timed elastic band: against closed forms, against IPOPT on the same cost, and driven."""

from dataclasses import replace
from itertools import groupby

import casadi as ca
import numpy as np
import pytest
from bases import BASES, BOX, CAR, DIFFERENTIAL, MECANUM, drive, scattered, situation, teb, walls

from outrider.data.driving import DriveLimits, LocalOutcome, Situation, Steering
from outrider.data.surroundings import Surroundings
from outrider.errors import ConfigError, DataError
from outrider.planning.local.optimise import optimise
from outrider.planning.local.teb import TebSettings
from outrider.safety.clearance import around, body_of, clash

pytestmark = pytest.mark.compiled


def twists(band: np.ndarray) -> np.ndarray:
    """(n - 1, 3) of the steps of a band."""
    d, T = np.diff(band[:, :3], axis=0), np.diff(band[:, 3])
    d[:, 2] = (d[:, 2] + np.pi) % (2.0 * np.pi) - np.pi
    m = band[:-1, 2] + 0.5 * d[:, 2]
    c, s = np.cos(m), np.sin(m)
    return np.column_stack([c * d[:, 0] + s * d[:, 1], c * d[:, 1] - s * d[:, 0], d[:, 2]]) / T[:, None]


@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize("span", [1.0, 3.0, 7.0])
def test_a_free_straight_run_takes_the_time_of_the_trapezoid(base: str, span: float) -> None:
    limits = BASES[base]
    v, a = limits.forward, limits.acceleration
    trapezoid = span / v + v / a if span > v * v / a else 2.0 * np.sqrt(span / a)
    plan = teb(limits).plan(situation((span, 0.0, 0.0)))
    assert plan.duration == pytest.approx(trapezoid, rel=0.05)
    assert np.abs(plan.band[:, 1]).max() < 1e-6


def test_a_run_driven_takes_that_time_too() -> None:
    plans, poses, _ = drive(teb(DIFFERENTIAL), situation((5.0, 0.0, 0.0)), 20.0)
    assert plans[-1].outcome is LocalOutcome.ARRIVED
    assert 0.1 * len(plans) == pytest.approx(5.0 / 0.8 + 0.8 / 0.6, rel=0.1)
    assert np.hypot(*(poses[-1, :2] - [5.0, 0.0])) < 0.03


@pytest.mark.parametrize("base", BASES)
def test_mirrored_surroundings_make_a_mirrored_band(base: str) -> None:
    discs = np.array([[2.0, 0.3, 0.2, 0.0, 0.0], [4.0, -0.6, 0.3, 0.0, 0.1]])
    flip = np.array([1.0, -1.0, 1.0, 1.0, -1.0])
    one = teb(BASES[base]).plan(situation((6.0, 0.4, 0.2), surroundings=Surroundings(discs=discs)))
    other = teb(BASES[base]).plan(situation((6.0, -0.4, -0.2), surroundings=Surroundings(discs=discs * flip)))
    np.testing.assert_allclose(one.band, other.band * [1.0, -1.0, -1.0, 1.0], atol=1e-5)
    np.testing.assert_allclose(one.twist, other.twist * [1.0, -1.0, -1.0], atol=1e-5)


def test_mecanum_strafes_to_a_goal_beside_it_without_turning() -> None:
    plans, poses, _ = drive(teb(MECANUM), situation((0.0, 2.0, 0.0)), 15.0)
    assert plans[-1].outcome is LocalOutcome.ARRIVED
    assert np.abs(poses[:, 2]).max() < 1e-3
    assert np.abs(poses[:, 0]).max() < 1e-3
    assert 0.1 * len(plans) == pytest.approx(2.0 / 0.8 + 0.8 / 0.5, rel=0.15)


@pytest.mark.parametrize("goal", [(3.0, 2.0, 0.0), (2.0, -3.0, 1.0), (-1.0, 2.0, 3.0)])
def test_no_wheel_of_a_mecanum_base_is_asked_for_more_than_it_turns(goal: tuple[float, float, float]) -> None:
    """|u_x| + |u_y| + L |w_z| <= V, exactly for commands and within the softness of the band for plans."""
    plans, _, _ = drive(teb(MECANUM), situation(goal), 20.0)
    u = np.array([p.twist for p in plans])
    assert (np.abs(u[:, 0]) + np.abs(u[:, 1]) + 0.7 * np.abs(u[:, 2])).max() <= 0.8 + 1e-9
    u = twists(plans[0].band)
    assert (np.abs(u[:, 0]) + np.abs(u[:, 1]) + 0.7 * np.abs(u[:, 2])).max() <= 0.8 * 1.06


@pytest.mark.parametrize("goal", [(4.0, 3.0, 1.5), (1.0, 1.0, 0.0), (2.0, 2.0, 3.0), (4.0, -2.0, -1.0)])
def test_a_car_never_turns_tighter_than_it_can(goal: tuple[float, float, float]) -> None:
    plans, _, _ = drive(teb(CAR), situation(goal), 25.0)
    assert plans[-1].outcome is LocalOutcome.ARRIVED
    for plan in plans:
        assert abs(plan.twist[2]) * CAR.min_radius <= abs(plan.twist[0]) + 1e-9
    u = twists(plans[0].band)
    fast = np.abs(u[:, 2]) > 0.05
    assert (np.abs(u[fast, 0]) >= 0.97 * CAR.min_radius * np.abs(u[fast, 2])).all()


@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize(("seed", "count"), [(0, 10), (1, 25), (2, 50), (3, 50)])
def test_forests_are_crossed_without_touching_a_tree(base: str, seed: int, count: int) -> None:
    planner = teb(BASES[base])
    plans, poses, least = drive(
        planner, situation((8.0, 0.0, 0.0), surroundings=Surroundings(discs=scattered(seed, count))), 40.0
    )
    assert plans[-1].outcome is LocalOutcome.ARRIVED
    assert least > 0.0
    u = np.array([[0.0, 0.0, 0.0], *(p.twist for p in plans)])
    limits = planner.limits
    rates = np.array([limits.acceleration, limits.acceleration, limits.turn_acceleration])
    assert (np.abs(np.diff(u[:-1], axis=0)) <= 0.1 * rates + 1e-9).all()
    assert max(limits.excess(x) for x in u) <= 1.0 + 1e-9
    assert np.hypot(*(poses[-1, :2] - [8.0, 0.0])) < 0.03


def test_a_wall_in_the_map_is_driven_around() -> None:
    field = walls((1.5, -1.0, 1.8, 1.0))
    plans, _, least = drive(teb(DIFFERENTIAL), situation((4.0, 0.0, 0.0), surroundings=Surroundings(field=field)), 30.0)
    assert plans[-1].outcome is LocalOutcome.ARRIVED
    assert least > 0.0


STANDS = np.array([[3.0, 0.0, 0.3, 0.0, 0.0]])


@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize("aside", [0.05, 0.4, 0.9])
def test_who_may_set_off_is_passed_no_faster_than_it_can_stop_within_the_gap(base: str, aside: float) -> None:
    """Somebody stands on open ground beside the way: |u| <= gap / t, up to the softness of the band."""
    planner, discs = teb(BASES[base]), STANDS + np.array([0.0, aside, 0.0, 0.0, 0.0])
    now = situation((6.0, 0.0, 0.0), surroundings=Surroundings(discs=discs, wary=discs))
    plans, poses, least = drive(planner, now, 40.0)
    assert plans[-1].outcome is LocalOutcome.ARRIVED
    assert least > 0.25
    limits, here = planner.limits, around(now.surroundings, 1.0)
    t = planner.settings.notice + 0.5 * limits.forward / limits.deceleration
    for pose, plan in zip(poses[1:], plans, strict=False):
        gap = clash(np.array([[*pose, 0.0]]), body_of(planner.footprint), here).room
        assert np.hypot(*plan.twist[:2]) <= gap / t + 0.1 * limits.forward


@pytest.mark.parametrize("base", BASES)
def test_in_a_narrow_lane_it_passes_slowly_who_may_set_off(base: str) -> None:
    """Walls leave 0.7 m beside him to a robot 0.45 m wide: 0.12 m on either side."""
    planner = teb(BASES[base])
    field = walls((1.0, 1.0, 5.0, 1.2), (1.0, -4.0, 5.0, -0.3))
    around_him = Surroundings(discs=STANDS, wary=STANDS, field=field)
    now = situation((6.0, 0.7, 0.0), pose=(0.0, 0.7, 0.0), surroundings=around_him)
    plans, poses, least = drive(planner, now, 25.0)
    assert plans[-1].outcome is LocalOutcome.ARRIVED
    assert least > 0.02
    v = np.array([np.hypot(*p.twist[:2]) for p in plans[:-1]])
    assert v[np.abs(poses[1:, 0] - 3.0) < 0.2].max() < 2.0 * planner.settings.slowest


def test_somebody_who_crosses_is_let_past_or_passed() -> None:
    for speed in (-1.4, -0.7, 0.5, 1.4):
        discs = np.array([[3.0, -3.0 * np.sign(speed), 0.3, 0.0, speed]])
        plans, _, least = drive(
            teb(DIFFERENTIAL), situation((6.0, 0.0, 0.0), surroundings=Surroundings(discs=discs)), 30.0
        )
        assert plans[-1].outcome is LocalOutcome.ARRIVED
        assert least > 0.0


def test_obstacles_that_jitter_do_not_change_the_side() -> None:
    """Straight on to an obstacle: either side is as good, and the first choice is kept."""
    discs = np.array([[3.0, 0.0, 0.3, 0.0, 0.0]])
    start = situation((6.0, 0.0, 0.0), surroundings=Surroundings(discs=discs))
    for seed in range(3):
        plans, _poses, least = drive(teb(DIFFERENTIAL), start, 20.0, jitter=0.04, seed=seed)
        assert plans[-1].outcome is LocalOutcome.ARRIVED
        assert not any(p.switched for p in plans)
        assert least > 0.0
        assert sum(p.classes > 1 for p in plans) > 3  # the other side was looked at


def test_a_way_that_closes_is_left_for_another() -> None:
    """The current side turns out blocked: hysteresis does not hold what is not free."""
    two = np.array([[3.0, -0.1, 0.3, 0.0, 0.0]])
    planner = teb(DIFFERENTIAL)
    first = planner.plan(situation((6.0, 0.0, 0.0), surroundings=Surroundings(discs=two)))
    side = np.sign(first.band[np.argmin(np.abs(first.band[:, 0] - 3.0)), 1])
    y = side * np.linspace(0.2, 4.0, 12)
    closed = np.vstack([two, np.column_stack([np.full(12, 3.0), y, np.full(12, 0.25), np.zeros((12, 2))])])
    now = replace(situation((6.0, 0.0, 0.0), surroundings=Surroundings(discs=closed)), time=0.1)
    then = planner.plan(now, first)
    assert then.switched
    assert then.conflict is None
    assert np.sign(then.band[np.argmin(np.abs(then.band[:, 0] - 3.0)), 1]) == -side


def test_a_room_without_a_door_ends_with_a_reason() -> None:
    """The robot stops, says which pose touches what, and asks for another path; it touches nothing."""
    field = walls((-2.0, -2.0, 2.0, -1.8), (-2.0, 1.8, 2.0, 2.0), (-2.0, -2.0, -1.8, 2.0), (1.8, -2.0, 2.0, 2.0))
    plans, _, least = drive(teb(DIFFERENTIAL), situation((5.0, 0.0, 0.0), surroundings=Surroundings(field=field)), 12.0)
    assert least > 0.0
    assert LocalOutcome.ARRIVED not in {p.outcome for p in plans}
    named = [p for p in plans if p.outcome is not LocalOutcome.DRIVE]
    assert named
    assert all(p.conflict is not None for p in named)
    assert "touches an occupied cell at (" in named[-1].reason
    backs = [len(list(run)) for what, run in groupby(p.outcome for p in plans) if what is LocalOutcome.BACK_OUT]
    assert 0.09 * 0.1 * backs[0] == pytest.approx(0.5, abs=0.05)  # out, not a twitch


@pytest.mark.parametrize("base", ["differential", "mecanum"])
def test_who_came_too_near_is_left_at_once(base: str) -> None:
    """A body of 0.6 m by 0.45 m that stands 5 mm from somebody: away from him, on its way or back."""
    for side in (-1.0, 1.0):
        discs = np.array([[side * (0.3 + 0.3 + 0.005), 0.0, 0.3, 0.0, 0.0]])
        plan = teb(BASES[base]).plan(situation((4.0, 0.0, 0.0), surroundings=Surroundings(discs=discs)))
        assert plan.outcome is LocalOutcome.DRIVE
        assert -side * plan.twist[0] > 0.02


def test_something_that_appears_within_the_stopping_distance_stops_the_robot() -> None:
    """Controlled: never the last velocity, never more than the base can brake."""
    planner = teb(DIFFERENTIAL)
    wall = np.column_stack([np.full(41, 0.6), np.linspace(-4.0, 4.0, 41), np.full(41, 0.15), np.zeros((41, 2))])
    now = situation((6.0, 0.0, 0.0), surroundings=Surroundings(discs=wall), twist=np.array([0.8, 0.0, 0.0]))
    plan = planner.plan(now)
    assert plan.outcome is LocalOutcome.STOP
    assert plan.conflict is not None
    assert plan.conflict.obstacle >= 0
    assert plan.twist[0] == pytest.approx(0.8 - 0.06)


def test_the_same_question_has_the_same_answer_to_the_bit() -> None:
    now = situation((8.0, 0.0, 0.0), surroundings=Surroundings(discs=scattered(5, 30)))
    planner = teb(MECANUM)
    one = planner.plan(now)
    planner.plan(situation((1.0, 1.0, 1.0)))
    two = planner.plan(now)
    assert one.band.tobytes() == two.band.tobytes()
    assert one.twist.tobytes() == two.twist.tobytes()


def hinge(x: ca.SX) -> ca.SX:
    return ca.fmax(x, 0.0)


def same_cost(p, z: ca.SX, n: int) -> ca.SX:
    """The cost of `normal.assemble`, written down again for differential and holonomic bases among still points."""
    w, cost, u = p.weights, 0.0, []
    for i in range(n - 1):
        T, turned = z[i + 1, 3] - z[i, 3], z[i + 1, 2] - z[i, 2]
        m = 0.5 * (z[i, 2] + z[i + 1, 2])
        dx, dy = z[i + 1, 0] - z[i, 0], z[i + 1, 1] - z[i, 1]
        u.append((ca.vertcat(ca.cos(m) * dx + ca.sin(m) * dy, ca.cos(m) * dy - ca.sin(m) * dx, turned)) / T)
        cost += w.duration / p.dt * T**2
        if i > 0:
            cost += p.dt * w.evenness * ((z[i + 1, 3] - 2 * z[i, 3] + z[i - 1, 3]) / p.dt) ** 2
        for row in p.rows:
            y = row[0] * u[-1][0] + row[1] * u[-1][1] + row[2] * u[-1][2]
            cost += p.dt * w.velocity * (hinge(y - p.share * row[4]) + hinge(p.share * row[3] - y)) ** 2
        cost += p.dt * w.turning * (p.rows[1, 2] * u[-1][2]) ** 2
        if not p.holonomic:
            creep = 0.02 + ca.fabs(u[-1][0]) / p.top
            cost += (
                p.dt * w.slip * (u[-1][1] / p.top) ** 2 / creep + p.dt * w.backward * (hinge(-u[-1][0]) / p.top) ** 2
            )
    u = [ca.DM(p.rates[3]), *u, ca.DM.zeros(3)]
    for k in range(n):
        tau = z[min(k + 1, n - 1), 3] - z[max(k - 1, 0), 3]
        for axis in range(3):
            y = 2.0 / tau * sum(p.rates[axis, q] * (u[k + 1][q] - u[k][q]) for q in range(3))
            cost += p.dt * w.acceleration * hinge(ca.fabs(y) - p.share) ** 2
    for i in range(1, n):
        tau = 0.5 * (z[min(i + 1, n - 1), 3] - z[i - 1, 3])
        c, s = ca.cos(z[i, 2]), ca.sin(z[i, 2])
        for bx, by, r in p.discs:
            x, y = z[i, 0] + c * bx - s * by, z[i, 1] + s * bx + c * by
            for ox, oy, radius, _, _ in p.obstacles:
                d = ca.sqrt((x - ox) ** 2 + (y - oy) ** 2)
                cost += w.obstacle * tau * (hinge(p.gap + radius + r - d) / p.gap) ** 2
    return cost


CASES = {
    "straight": (DIFFERENTIAL, (1.5, 0.0, 0.0), ()),
    "past a post": (DIFFERENTIAL, (2.0, 0.1, 0.1), ((1.0, -0.35, 0.1),)),
    "between two": (DIFFERENTIAL, (2.4, 0.0, 0.3), ((1.0, 0.45, 0.1), (1.6, -0.5, 0.1))),
    "strafing": (MECANUM, (0.2, 1.2, 0.0), ((-0.3, 0.6, 0.1),)),
    "turning": (MECANUM, (1.0, 1.0, 0.6), ()),
}


@pytest.mark.parametrize("case", CASES)
def test_the_optimum_is_the_one_that_ipopt_finds(case: str) -> None:
    """Cost, and every knot, of the same cost function from the same start."""
    limits, goal, posts = CASES[case]
    discs = np.array([[*post, 0.0, 0.0] for post in posts]).reshape(-1, 5)
    now = situation(goal, surroundings=Surroundings(discs=discs))
    planner = teb(limits, step=0.25)
    p = planner._problem(now, around(now.surroundings, 4.0))
    start = planner.plan(now).band
    n = len(start)
    planner._work.z[0, :n] = start
    m, cost, _ = optimise(n, p, planner._work, 1, 3000, 1e-15)
    assert m == n
    z = ca.SX.sym("z", n, 4)
    flat, ours = ca.vec(z), planner._work.z[0, :n].copy()
    fixed = [0, n, 2 * n, 3 * n, n - 1, 2 * n - 1, 3 * n - 1]
    x0 = start.T.ravel()
    low, high = np.full(4 * n, -np.inf), np.full(4 * n, np.inf)
    low[fixed] = high[fixed] = x0[fixed]
    options = {"ipopt.print_level": 0, "print_time": False, "ipopt.tol": 1e-10, "ipopt.max_iter": 2000}
    solver = ca.nlpsol("s", "ipopt", {"x": flat, "f": same_cost(p, z, n)}, options)
    answer = solver(x0=x0, lbx=low, ubx=high)
    theirs = np.array(answer["x"]).reshape(4, n).T
    at_ours = ca.Function("f", [flat], [same_cost(p, z, n)])(ours.T.ravel())
    assert float(at_ours) == pytest.approx(cost, rel=1e-9)  # it is the same function
    assert cost == pytest.approx(float(answer["f"]), rel=1e-3)
    assert ours[-1, 3] == pytest.approx(theirs[-1, 3], rel=5e-3)
    np.testing.assert_allclose(ours[:, :2], theirs[:, :2], atol=0.02)


@pytest.mark.parametrize(
    "wrong", [{"forward": 0.0}, {"turn": np.nan}, {"sideways": 0.1}, {"backward": -1.0}, {"rim_speed": 0.0}]
)
def test_limits_with_which_nothing_moves(wrong: dict) -> None:
    good = {"forward": 1.0, "turn": 1.0, "acceleration": 1.0, "turn_acceleration": 1.0}
    with pytest.raises(ConfigError, match="drive limits"):
        DriveLimits(steering=Steering.DIFFERENTIAL, **(good | wrong))


def test_a_pose_that_is_not_finite_is_refused() -> None:
    with pytest.raises(DataError, match="pose"):
        situation((1.0, 0.0, 0.0), pose=(np.nan, 0.0, 0.0))
    with pytest.raises(DataError, match="disc 1"):
        Surroundings(discs=np.array([[1.0, 0.0, 0.1, 0.0, 0.0], [np.nan, 0.0, 0.1, 0.0, 0.0]]))
    with pytest.raises(ConfigError, match="teb"):
        TebSettings(gap=0.0)
    assert isinstance(situation((0.0, 0.0, 0.0)), Situation)
    assert BOX.inscribed == pytest.approx(0.225)
