"""Robots that correct one another: against one filter written out in plain algebra, and by laws of their own."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import block_diag

from outrider.core.manifold import retract
from outrider.data import Gaussian, Verdict
from outrider.errors import ConfigError, DataError
from outrider.filters.cooperative import RELATIVE, Member, Method, Shared, Source, TeamEstimate, fuse_team
from outrider.filters.cooperative.meeting import sight
from outrider.filters.cooperative.robot import FALSE_ALARM, Filter, Records, gates
from outrider.models import sensors as s
from outrider.models.motion import LAYOUTS, DriftingRover, EulerBody, LaggedFollower, Motion, PlanarRobot, StrapdownIns
from outrider.models.sensors import Sensor, SensorModel
from outrider.typing import Floats

INF = float("inf")
STEP, SIGMA = 0.1, 0.1  # s, m
MODEL = LaggedFollower(acceleration=0.3)
FOLLOWER = LAYOUTS[Motion.FOLLOWER]
FIX = s.Position(sigma=0.5)
PLACE_ONLY = np.array([SIGMA] * 3 + [INF] * 3)
NO_RECORDS = Records(t=np.zeros(0), source=np.zeros(0, np.int64), z=np.zeros((0, 8)), r=np.zeros((0, 8)))


def random_walks(rng: np.random.Generator, robots: int, n: int) -> Floats:
    """(robots, n, 6) place and velocity of points, drawn from the filter's own model."""
    x, out = rng.normal(size=(robots, 6)), np.zeros((robots, n, 6))
    q = 0.3**2
    Q = q * np.array([[STEP**3 / 3, STEP**2 / 2], [STEP**2 / 2, STEP]])
    L = np.linalg.cholesky(Q)
    for k in range(n):
        out[:, k] = x
        w = rng.normal(size=(robots, 3, 2)) @ L.T
        x = np.hstack([x[:, :3] + STEP * x[:, 3:] + w[..., 0], x[:, 3:] + w[..., 1]])
    return out


def points(
    rng: np.random.Generator,
    robots: int = 2,
    n: int = 40,
    every: int = 5,
    fixes: tuple[int, ...] = (),
    truth: Floats | None = None,
) -> tuple[list[Member], list[Source], Floats]:
    """A team without attitudes, whose every model is linear: fixes for `fixes` (all), relative places between all."""
    truth = random_walks(rng, robots, n) if truth is None else truth
    t = STEP * np.arange(1, n)
    P = np.diag([1.0] * 3 + [0.3] * 3)
    members, sources = [], []
    for i in range(robots):
        x = truth[i, 0] + rng.normal(size=6) * np.sqrt(np.diag(P))
        members.append(Member(name=f"r{i}", motion=Motion.FOLLOWER, model=MODEL, belief=Gaussian(x, P, FOLLOWER)))
        if i in fixes or not fixes:
            sources.append(
                Source(robot=f"r{i}", sensor=FIX, t=t, z=truth[i, 1:, :3] + rng.normal(size=(n - 1, 3)) * 0.5)
            )
    for i, j in permutations(range(robots), 2):
        k = np.arange(1 + (i + 2 * j) % every, n, every)
        z = np.zeros((k.size, 8))
        z[:, 1:4], z[:, 7] = truth[j, k, :3] - truth[i, k, :3] + rng.normal(size=(k.size, 3)) * SIGMA, 1.0
        sources.append(
            Source(robot=f"r{i}", partner=f"r{j}", sensor=s.RelativePose(), sigmas=PLACE_ONLY, t=STEP * k, z=z)
        )
    return members, sources, truth


def fused(team: tuple[list[Member], list[Source], Floats], method: Method, t: Floats, **more: object) -> TeamEstimate:
    return fuse_team(team[0], team[1], method, t, start=0.0, **more)  # type: ignore[arg-type]


def by_hand(team: tuple[list[Member], list[Source], Floats], times: Floats) -> tuple[Floats, Floats]:
    """The joint Kalman filter in dense algebra, all records of one time in one update."""
    members, sources, _ = team
    N = len(members)
    x, P = np.concatenate([m.belief.x for m in members]), block_diag(*[m.belief.P for m in members])
    F1 = np.block([[np.eye(3), STEP * np.eye(3)], [np.zeros((3, 3)), np.eye(3)]])
    Q1 = 0.09 * np.kron([[STEP**3 / 3, STEP**2 / 2], [STEP**2 / 2, STEP]], np.eye(3))
    F, Q = np.kron(np.eye(N), F1), np.kron(np.eye(N), Q1)
    for now in times:
        x, P = F @ x, F @ P @ F.T + Q
        rows, z, r = [], [], []
        for source in sources:
            for k in np.flatnonzero(np.abs(source.t - now) < 1e-9):
                H = np.zeros((3, 6 * N))
                i = int(source.robot[1:])
                H[:, 6 * i : 6 * i + 3] = np.eye(3) * (-1.0 if source.partner else 1.0)
                if source.partner:
                    j = int(source.partner[1:])
                    H[:, 6 * j : 6 * j + 3] = np.eye(3)
                rows.append(H)
                z.append(source.z[k, 1:4] if source.partner else source.z[k])
                r += [SIGMA**2 if source.partner else 0.25] * 3
        H, y = np.vstack(rows), np.concatenate(z)
        K = np.linalg.solve(H @ P @ H.T + np.diag(r), H @ P).T
        x, P = x + K @ (y - H @ x), P - K @ H @ P
    return x, P


def test_joint_filter_is_the_one_filter_over_everybody(rng: np.random.Generator) -> None:
    team = points(rng, 3, 12)
    times = STEP * np.arange(1, 12)
    done = fused(team, Method.JOINT, times[-1:])
    x, P = by_hand(team, times)
    for i in range(3):
        np.testing.assert_allclose(done.x[f"r{i}"][-1], x[6 * i : 6 * i + 6], atol=1e-9)
        np.testing.assert_allclose(done.P[f"r{i}"][-1], P[6 * i : 6 * i + 6, 6 * i : 6 * i + 6], atol=1e-9)


@settings(max_examples=8)
@given(seed=st.integers(0, 2**32 - 1), every=st.integers(1, 12), first=st.booleans())
def test_two_distributed_robots_are_one_filter_whenever_they_have_met(seed: int, every: int, first: bool) -> None:
    """Mean and covariance, to rounding, also if one of the two never sees a fix of its own."""
    team = points(np.random.default_rng(seed), 2, 30, every, fixes=(0,) if first else ())
    met = np.unique(np.concatenate([source.t for source in team[1] if source.partner]))
    joint, apart = fused(team, Method.JOINT, met), fused(team, Method.DISTRIBUTED, met)
    np.testing.assert_allclose(apart.x["r0"], fused(team, Method.FACTORED, met).x["r0"], atol=1e-9)
    for name in ("r0", "r1"):
        np.testing.assert_allclose(apart.x[name], joint.x[name], atol=1e-8)
        np.testing.assert_allclose(apart.P[name], joint.P[name], atol=1e-9)


def test_what_robots_share_from_the_start_is_used_by_both_filters(rng: np.random.Generator) -> None:
    team = points(rng, 2, 30)
    shared = [Shared(one="r1", one_block="position", two="r0", two_block="position", covariance=0.8 * np.eye(3))]
    t = np.array([2.6, 2.7, 2.8, 2.9])
    met = t[np.isin(np.round(t, 6), np.round(np.concatenate([q.t for q in team[1] if q.partner]), 6))]
    joint, apart = (fused(team, m, met, shared=shared) for m in (Method.JOINT, Method.DISTRIBUTED))
    plain = fused(team, Method.JOINT, met)
    assert met.size and np.abs(joint.x["r0"] - plain.x["r0"]).max() > 1e-5
    np.testing.assert_allclose(apart.x["r0"], joint.x["r0"], atol=1e-8)
    np.testing.assert_allclose(apart.P["r1"], joint.P["r1"], atol=1e-9)


def errors(method: Method, seeds: range, robots: int, fixes: tuple[int, ...]) -> tuple[float, float]:
    """RMSE of places [m] and NEES per degree of freedom over seeds, robots and the second half of the time."""
    t = STEP * np.arange(30, 60)
    squares, nees = [], []
    for seed in seeds:
        team = points(np.random.default_rng(seed), robots, 60, 5, fixes)
        done = fused(team, method, t)
        for i in range(robots):
            e = done.x[f"r{i}"] - team[2][i, 30:60]
            squares.append(np.sum(e[:, :3] ** 2, axis=1))
            P = done.P[f"r{i}"]
            nees.append(np.einsum("ni,ni->n", e, np.linalg.solve(P, e[..., None])[..., 0]) / 6.0)
    return float(np.sqrt(np.mean(squares))), float(np.mean(nees))


@pytest.mark.compiled
def test_what_each_method_costs_and_whether_it_knows() -> None:
    """Four robots of which one has fixes: exact at one end, fooled at the other; only the safe ones may be believed."""
    found = {m: errors(m, range(12), 4, (0,)) for m in Method if m.shares}
    assert found[Method.JOINT][1] == pytest.approx(1.0, abs=0.15)
    assert found[Method.NAIVE][1] > 1.5
    assert found[Method.FACTORED][1] > 1.5  # third parties: what Luft et al. approximate is not safe here
    for safe in (Method.CI, Method.SPLIT_CI, Method.DISTRIBUTED):
        assert found[safe][1] < 1.1
        assert found[Method.JOINT][0] < found[safe][0] < 1.6 * found[Method.JOINT][0]


# ---------------------------------------------------------------------------------------- any robot, any sensor

MODELS = {
    Motion.PLANAR: PlanarRobot(), Motion.STRAPDOWN: StrapdownIns(), Motion.DRIFTING: DriftingRover(),
    Motion.EULER: EulerBody(), Motion.FOLLOWER: MODEL,
}  # fmt: skip
LOOKING: dict[Sensor, SensorModel] = {
    Sensor.RELATIVE_POSE: s.RelativePose(), Sensor.RANGE: s.Range(beacon=(0.0, 0.0, 0.0)),
    Sensor.BEARING: s.Bearing(beacon=(0.0, 0.0, 0.0)), Sensor.RANGE_BEARING: s.RangeBearing(beacon=(0.0, 0.0, 0.0)),
}  # fmt: skip


def alone(motion: Motion, rng: np.random.Generator, place: Floats) -> Filter:
    """A robot somewhere, without records."""
    layout = LAYOUTS[motion]
    x = layout.zeros()
    retract(x, 0.4 * rng.normal(size=layout.error_size), layout.table)
    x[layout.state("position")] += place[: 2 if "heading" in layout else 3]
    belief = Gaussian(x, 0.01 * np.eye(layout.error_size), layout)
    member = Member(name="r", motion=motion, model=MODELS[motion], belief=belief)
    return Filter([member], [], NO_RECORDS, np.zeros(0), 0.0, gate=gates(FALSE_ALARM))


@pytest.mark.parametrize("sensor", RELATIVE, ids=lambda c: c.name)
@pytest.mark.parametrize("seen", sorted(MODELS), ids=lambda m: m.name)
@pytest.mark.parametrize("looks", [Motion.PLANAR, Motion.EULER, Motion.STRAPDOWN], ids=lambda m: m.name)
def test_relative_jacobians_are_derivatives_for_both(
    sensor: Sensor, looks: Motion, seen: Motion, rng: np.random.Generator
) -> None:
    i, j = alone(looks, rng, np.zeros(3)), alone(seen, rng, np.array([4.0, 3.0, 2.0]))
    theta, z, r = LOOKING[sensor].theta(), np.array([0.0, 3.0, 2.0, 1.0, 0.3, -0.1, 0.2, 0.9]), np.ones(8)
    at = sight(i, j, int(sensor), theta, z, r)
    for robot, H in ((i, at.H_i), (j, at.H_j)):
        numeric = np.zeros_like(H)
        for c in range(H.shape[1]):
            ends = []
            for step in (1e-6, -1e-6):
                before, d = robot.belief.x.copy(), np.zeros(H.shape[1])
                d[c] = step
                retract(robot.belief.x, d, robot.group.table)
                ends.append(sight(i, j, int(sensor), theta, z, r).y)
                robot.belief.x[...] = before
            numeric[:, c] = (ends[1] - ends[0]) / 2e-6
        np.testing.assert_allclose(H, numeric, atol=2e-6)


@pytest.mark.compiled
def test_a_drone_and_a_rover_with_production_models(rng: np.random.Generator) -> None:
    """A strapdown filter that stands in the air above a planar robot: only its partner tells it where it is."""
    up, rover = np.array([1.0, 2.0, 3.0]), LAYOUTS[Motion.PLANAR]
    ins, t = LAYOUTS[Motion.STRAPDOWN], 0.05 * np.arange(1, 200)
    x_i, x_j = ins.zeros(), rover.zeros()
    x_i[ins.state("position")] = up + np.array([0.5, -0.4, 0.0])
    P_i, P_j = np.diag(np.full(ins.error_size, 1e-6)), np.diag(np.full(rover.error_size, 1e-6))
    P_i[ins.error("position"), ins.error("position")] = np.eye(3)
    members = [
        Member(name="drone", motion=Motion.STRAPDOWN, model=StrapdownIns(), belief=Gaussian(x_i, P_i, ins)),
        Member(name="rover", motion=Motion.PLANAR, model=PlanarRobot(), belief=Gaussian(x_j, P_j, rover)),
    ]
    imu = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, StrapdownIns().gravity], (t.size, 1))
    seen = np.column_stack(
        [
            np.zeros(t.size),
            np.tile(up, (t.size, 1)) + 0.1 * rng.normal(size=(t.size, 3)),
            np.zeros((t.size, 3)),
            np.ones(t.size),
        ]
    )
    sources = [
        Source(robot="drone", sensor=None, t=t, z=imu),
        Source(robot="rover", sensor=s.ZeroVelocity(), t=t, z=np.zeros((t.size, 3))),
        Source(robot="rover", sensor=s.Gyro(), t=t, z=np.zeros((t.size, 3))),
        Source(
            robot="rover", partner="drone", sensor=s.RelativePose(sigma_position=0.1), sigmas=PLACE_ONLY, t=t, z=seen
        ),
    ]
    joint, apart = (fuse_team(members, sources, m, t[-1:], start=0.0) for m in (Method.JOINT, Method.DISTRIBUTED))
    here = ins.state("position")
    assert np.linalg.norm(joint.x["drone"][-1, here] - up) < 0.1
    np.testing.assert_allclose(apart.x["drone"][-1, here], joint.x["drone"][-1, here], atol=1e-3)
    np.testing.assert_allclose(apart.P["drone"][-1], joint.P["drone"][-1], rtol=1e-2, atol=1e-6)


# ---------------------------------------------------------------------------------------- what must not happen


@pytest.mark.parametrize("method", [m for m in Method if m.shares], ids=lambda m: m.name)
def test_a_wild_record_of_a_partner_is_refused_by_name(method: Method, rng: np.random.Generator) -> None:
    team = points(rng, 2, 30)
    clean = fused(team, method, np.array([2.9]))
    wild = replace(team[1][2], t=np.array([2.05]), z=np.array([[0.0, 90.0, 0, 0, 0, 0, 0, 1.0]]))
    done = fused((team[0], [*team[1], wild], team[2]), method, np.array([2.9]))
    assert done.verdict[done.source == 4].tolist() == [Verdict.GATED]
    np.testing.assert_allclose(done.x["r0"], clean.x["r0"], atol=1e-6)
    if method is Method.JOINT:
        swallowed = fused((team[0], [*team[1], wild], team[2]), method, np.array([2.9]), false_alarm=0.0)
        assert swallowed.counts() == {Verdict.USED: swallowed.verdict.size}
        assert np.abs(swallowed.x["r0"] - clean.x["r0"]).max() > 0.1


@pytest.mark.parametrize("method", list(Method), ids=lambda m: m.name)
def test_records_that_are_not_numbers_change_nothing(method: Method, rng: np.random.Generator) -> None:
    team = points(rng, 2, 20)
    bad = [replace(q, t=q.t[:1] + 0.02, z=np.full((1, q.z.shape[1]), np.nan)) for q in team[1]]
    done = fused((team[0], [*team[1], *bad], team[2]), method, np.array([1.9]))
    clean = fused(team, method, np.array([1.9]))
    assert np.isfinite(done.x["r0"]).all() and Verdict.NOT_OBSERVING in done.counts()
    np.testing.assert_allclose(done.x["r1"], clean.x["r1"], atol=1e-6)


def test_a_robot_alone_ignores_the_others(rng: np.random.Generator) -> None:
    team = points(rng, 2, 20)
    only = fused((team[0][:1], team[1][:1], team[2]), Method.LOCAL, np.array([1.9]))
    both = fused(team, Method.LOCAL, np.array([1.9]))
    np.testing.assert_array_equal(only.x["r0"], both.x["r0"])
    less = fused(
        (team[0], [replace(team[1][0], navigation=False), *team[1][1:]], team[2]), Method.NONE, np.array([1.9])
    )
    assert not np.allclose(less.x["r0"], both.x["r0"]) and np.array_equal(less.x["r1"], both.x["r1"])


@pytest.mark.parametrize("method", [Method.JOINT, Method.DISTRIBUTED, Method.SPLIT_CI], ids=lambda m: m.name)
def test_a_considered_state_keeps_value_and_variance(method: Method, rng: np.random.Generator) -> None:
    team = points(rng, 2, 20)
    held = [replace(team[0][0], consider=("velocity",)), team[0][1]]
    done = fused((held, team[1], team[2]), method, np.array([1.9]))
    grown = np.diag(held[0].belief.P)[3] + 0.09 * 1.9
    np.testing.assert_allclose(done.x["r0"][-1, 3:], held[0].belief.x[3:], atol=1e-12)
    np.testing.assert_allclose(np.diag(done.P["r0"][-1])[3:], grown, rtol=0.35 if method is Method.SPLIT_CI else 1e-9)


def test_bad_teams_are_refused_in_words(rng: np.random.Generator) -> None:
    members, sources, truth = points(rng, 2, 10)
    relative = sources[2]
    wrong = Gaussian(members[0].belief.x, -np.eye(6), FOLLOWER)
    for change, error, words in (
        (([], sources), ConfigError, "a name of its own"),
        (([members[0], members[0]], sources), ConfigError, "a name of its own"),
        ((members, [replace(relative, partner="r7")]), ConfigError, "no robot 'r7'"),
        ((members, [replace(relative, robot="r9")]), ConfigError, "no robot 'r9'"),
        ((members, [replace(relative, partner="r0")]), ConfigError, "cannot measure itself"),
        ((members, [replace(relative, sensor=FIX)]), ConfigError, "does not look at robots"),
        ((members, [replace(relative, t=relative.t[::-1])]), DataError, "run backwards"),
        ((members, [replace(relative, z=relative.z[1:])]), DataError, "records of shape"),
        (([replace(members[0], belief=wrong), members[1]], sources), DataError, "not positive definite"),
        (([replace(members[0], motion=Motion.PLANAR), members[1]], sources), ConfigError, "not one of planar"),
    ):
        with pytest.raises(error, match=words):
            fused((*change, truth), Method.JOINT, np.array([0.5]))
    stranger = Shared(one="r0", one_block="position", two="x", two_block="position", covariance=np.eye(3))
    with pytest.raises(ConfigError, match="no robot 'x'"):
        fused((members, sources, truth), Method.JOINT, np.array([0.5]), shared=[stranger])


@pytest.mark.parametrize("method", [Method.JOINT, Method.DISTRIBUTED])
def test_a_robot_that_starts_later_rests_until_then(method: Method, rng: np.random.Generator) -> None:
    """Until its start the others go on as if it were not there; from then on as a team that begins with it."""
    members, sources, _ = points(rng, 2, 40, 3)
    late, times = 20 * STEP, STEP * np.arange(1, 40)
    team = ([members[0], replace(members[1], start=late)], sources)
    done = fuse_team(*team, method, times, start=0.0)
    alone = fuse_team(members[:1], sources[:1], Method.LOCAL, times, start=0.0)
    before = times < late - 1e-9
    np.testing.assert_allclose(done.x["r0"][before], alone.x["r0"][before], atol=1e-12)
    np.testing.assert_array_equal(done.x["r1"][before], np.tile(members[1].belief.x, (before.sum(), 1)))
    told = [s for s in sources if s.robot == "r1" or s.partner]
    early = sum(int((s.t < late - 1e-9).sum()) for s in told)
    assert done.counts()[Verdict.NOT_ALIGNED] == early
    first = replace(members[0], belief=Gaussian(alone.x["r0"][before][-1], alone.P["r0"][before][-1], FOLLOWER))
    rest = [replace(s, t=s.t[s.t > late - 1e-9], z=s.z[s.t > late - 1e-9]) for s in sources]
    # r0's belief is moved on to the start of the other by hand
    x, dt, F = first.belief.x, STEP, np.block([[np.eye(3), STEP * np.eye(3)], [np.zeros((3, 3)), np.eye(3)]])
    Q = 0.09 * np.kron([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]], np.eye(3))
    moved = Gaussian(F @ x, F @ first.belief.P @ F.T + Q, FOLLOWER)
    again = fuse_team([replace(first, belief=moved), members[1]], rest, method, times[-1:], start=late)
    for name in ("r0", "r1"):
        np.testing.assert_allclose(done.x[name][-1], again.x[name][-1], atol=1e-9)
        np.testing.assert_allclose(done.P[name][-1], again.P[name][-1], atol=1e-9)
