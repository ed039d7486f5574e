"""The online follower: what is late, damaged, stamped wrongly or off by a jump."""

from collections import Counter

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from outrider.errors import ConfigError, UsageError
from outrider.eval import average_bounds, chi_square
from outrider.filters.following import FollowerFilter, Following, Outcome, RelativeFilter, separation
from outrider.models.motion.following import STEP, FollowerModel, lag_step
from outrider.models.vehicles import ROW_P, ROW_V, Multirotor
from outrider.sim.world import Ground

MODEL = FollowerModel(lag=0.5, lag_z=0.5, acceleration=0.3, acceleration_z=0.1)
WINDY = FollowerModel(lag=0.5, lag_z=0.5, acceleration=0.3, acceleration_z=0.1, wind=0.02)
R = np.full(3, 0.15**2)


def drone(seed: int, seconds: float = 20.0, wind=(0.0, 0.0, 0.0), model: FollowerModel = MODEL, dt: float = 0.1):
    """(t, truth (n, 6), commands (n, 3)) of a drone with the model's own noise; commands change every second."""
    rng, n = np.random.default_rng(seed), round(seconds / dt)
    c, theta = np.zeros((3, STEP)), model.theta()
    lag_step(dt, theta, c)
    roots = [np.linalg.cholesky(np.array([[q[4], q[5]], [q[5], q[6]]])) for q in c]
    U = np.repeat(rng.uniform(-2.0, 2.0, (round(seconds) + 1, 3)), round(1.0 / dt), axis=0)[:n]
    X = np.zeros((n + 1, 6))
    for k in range(n):
        for i in range(3):
            p, v = X[k, i], X[k, 3 + i]
            pull = U[k, i] + wind[i]
            e = roots[i] @ rng.normal(size=2)
            X[k + 1, i] = p + c[i, 0] * v + c[i, 2] * pull + e[0]
            X[k + 1, 3 + i] = c[i, 1] * v + c[i, 3] * pull + e[1]
    return np.arange(n + 1) * dt, X, U, rng


def fly(f: FollowerFilter, late: float, seed: int = 0, seconds: float = 12.0, **keywords):
    """Feed a filter in the order of arrival: commands at once, fixes of every second `late`; returns the belief."""
    t, X, U, rng = drone(seed, seconds, **keywords)
    noise = rng.normal(size=(t.size, 3)) * 0.15
    waiting = []
    for k in range(t.size - 1):
        if k % 10 == 0:
            f.add_command(t[k], U[k])
            waiting.append((t[k], X[k, :3] + noise[k]))
        while waiting and waiting[0][0] + late <= t[k] + 1e-9:
            f.add_fix(*waiting.pop(0), R, now=t[k])
    return f.belief(t[-1]), X[-1]


def test_a_late_fix_gives_the_numbers_of_one_in_time():
    in_time = FollowerFilter(WINDY, Following(wind=0.3))
    want, _ = fly(in_time, 0.0)
    for late in (0.3, 1.7, 3.0):
        f = FollowerFilter(WINDY, Following(wind=0.3))
        got, _ = fly(f, late, seconds=12.0)
        for t, z in missing(late):
            f.add_fix(t, z, R)
        got = f.belief(want.t)
        np.testing.assert_allclose(got.x, want.x, atol=1e-9)
        np.testing.assert_allclose(got.P, want.P, atol=1e-9)


def missing(late: float):
    """The fixes of `fly` that are still on their way at its end."""
    t, X, _, rng = drone(0, 12.0)
    noise = rng.normal(size=(t.size, 3)) * 0.15
    rows = range(0, t.size - 1, 10)
    return [(t[k], X[k, :3] + noise[k]) for k in rows if t[k] + late > t[-2] + 1e-9]


def test_any_order_of_arrival_gives_the_same():
    rng, records = np.random.default_rng(4), []
    t, X, U, noise = drone(1, 4.0)
    for k in range(0, t.size - 1, 5):
        records += [("u", t[k], U[k]), ("z", t[k], X[k, :3] + 0.15 * noise.normal(size=3))]
        records += [("v", t[k] + 0.02, X[k, 3:] + 0.05 * noise.normal(size=3))]
    ends = []
    for shuffled in (False, True):
        f = FollowerFilter(MODEL)
        order = [0, 1] + [
            2 + int(i) for i in (rng.permutation(len(records) - 2) if shuffled else range(len(records) - 2))
        ]
        for i in order:
            kind, when, value = records[i]
            if kind == "u":
                f.add_command(when, value)
            else:
                (f.add_fix if kind == "z" else f.add_velocity)(when, value, R)
        ends.append(f.belief(4.2))
    np.testing.assert_allclose(ends[1].x, ends[0].x, atol=1e-9)
    np.testing.assert_allclose(ends[1].P, ends[0].P, atol=1e-9)


def test_agrees_with_filterpy():
    c = np.zeros((3, STEP))
    lag_step(1.0, MODEL.theta(), c)
    k = KalmanFilter(6, 3, 3)
    k.F, k.B, k.Q, k.H, k.R = np.eye(6), np.zeros((6, 3)), np.zeros((6, 6)), np.eye(6)[:3], np.diag(R)
    for i in range(3):
        k.F[i, 3 + i], k.F[3 + i, 3 + i], k.B[i, i], k.B[3 + i, i] = c[i, 0], c[i, 1], c[i, 2], c[i, 3]
        k.Q[i, i], k.Q[3 + i, 3 + i], k.Q[i, 3 + i], k.Q[3 + i, i] = c[i, 4], c[i, 6], c[i, 5], c[i, 5]
    t, X, U, rng = drone(2)
    k.x, k.P = np.concatenate([X[0, :3], np.zeros(3)])[:, None], np.diag([*R, 4.0, 4.0, 4.0])
    f = FollowerFilter(MODEL, Following(velocity=2.0))
    f.add_command(0.0, U[0])
    f.add_fix(0.0, X[0, :3], R)
    for row in range(10, t.size - 1, 10):
        z = X[row, :3] + 0.15 * rng.normal(size=3)
        k.predict(U[row - 1][:, None])
        k.update(z[:, None])
        assert f.add_fix(t[row], z, R).outcome is Outcome.USED
        f.add_command(t[row], U[row])
    b = f.belief(t[row])
    np.testing.assert_allclose(b.x, k.x.ravel(), atol=1e-10)
    np.testing.assert_allclose(b.P, k.P, atol=1e-10)


@pytest.mark.compiled
def test_is_honest_and_the_wrong_model_is_not():
    """Errors against covariances over 60 flights; with a lag taken for half as long, or wind without a state, not."""

    def nees(model: FollowerModel, settings: Following, **truth) -> float:
        sums = []
        for seed in range(60):
            b, x = fly(FollowerFilter(model, settings), 0.3, seed, **truth)
            sums.append(chi_square(b.x[:6] - x, b.P[:6, :6]))
        return float(np.mean(sums))

    low, high = average_bounds(6, 60, probability=0.999)
    calm, wind = Following(velocity=1.0), Following(velocity=1.0, wind=0.5)
    assert low < nees(MODEL, calm) < high
    assert low < nees(WINDY, wind, wind=(0.3, -0.2, 0.0), seconds=20.0) < high
    assert nees(MODEL, calm, wind=(0.8, 0.0, 0.0)) > high
    wrong = FollowerModel(lag=1.5, lag_z=0.5, acceleration=0.3, acceleration_z=0.1)
    assert nees(wrong, calm) > high


def test_same_input_same_bits():
    a, b = (fly(FollowerFilter(MODEL), 0.4)[0] for _ in range(2))
    np.testing.assert_array_equal(a.x, b.x)
    np.testing.assert_array_equal(a.P, b.P)


def running() -> FollowerFilter:
    """A filter of a hovering drone at the origin, at 6 s."""
    f = FollowerFilter(MODEL)
    for t in range(7):
        f.add_fix(float(t), np.zeros(3), R)
    return f


@pytest.mark.parametrize(
    ("t", "z", "r", "said"),
    [
        (6.5, (np.nan, 0, 0), R, Outcome.NOT_FINITE),
        (6.5, (0, 0, 0), (0.1, -0.1, 0.1), Outcome.NOT_FINITE),
        (6.5, (0, 0, 0), (np.nan, 0.1, 0.1), Outcome.NOT_FINITE),
        (np.inf, (0, 0, 0), R, Outcome.NOT_FINITE),
        (6.7, (0, 0, 0), R, Outcome.FUTURE),
        (0.5, (0, 0, 0), R, Outcome.TOO_OLD),
        (6.0, (0, 0, 0), R, Outcome.REPEATED),
        (6.5, (50.0, 0, 0), R, Outcome.GATED),
    ],
)
def test_bad_records_are_named_and_change_nothing(t, z, r, said):
    f = running()
    before = f.belief(8.0)
    fused = f.add_fix(t, np.array(z, float), np.array(r, float), now=6.5)
    assert fused.outcome is said and not said.good and len(said.value) > 10
    np.testing.assert_array_equal(f.belief(8.0).P, before.P if said is not Outcome.GATED else f.belief(8.0).P)
    np.testing.assert_allclose(f.belief(8.0).x, before.x, atol=1e-12)


def test_a_receiver_that_repeats_itself_tells_nothing_new():
    f = FollowerFilter(MODEL)
    assert f.add_fix(0.0, np.zeros(3), R).outcome is Outcome.STARTED
    for _ in range(3):
        assert f.add_fix(0.0, np.zeros(3), R).outcome is Outcome.REPEATED
    np.testing.assert_allclose(np.diag(f.belief(0.0).P)[:3], R)
    height = np.array([np.inf, np.inf, 0.01])
    assert f.add_fix(0.0, np.zeros(3), height).outcome is Outcome.USED
    assert f.add_fix(0.0, np.zeros(3), height).outcome is Outcome.REPEATED


def test_a_clock_that_is_ahead_is_named_however_often():
    f = running()
    said = {f.add_fix(t + 0.4, np.zeros(3), R, now=t).outcome for t in (7.0, 8.0, 9.0)}
    assert said == {Outcome.FUTURE}


def test_a_consistent_jump_is_reacquired_and_scattered_ones_are_not():
    f = running()
    there = np.array([50.0, 0.0, 0.0])
    said = [f.add_fix(6.0 + k, there + 0.1 * k, R).outcome for k in (1, 2, 3, 4)]
    assert said == [Outcome.GATED, Outcome.GATED, Outcome.REACQUIRED, Outcome.USED]
    np.testing.assert_allclose(f.belief(10.0).p, there, atol=1.0)
    f, rng = running(), np.random.default_rng(1)
    said = {f.add_fix(7.0 + k, rng.uniform(-80.0, 80.0, 3), R).outcome for k in range(6)}
    assert said == {Outcome.GATED}
    assert f.add_fix(13.0, np.zeros(3), R).outcome is Outcome.USED


def test_one_outlier_among_good_fixes_is_forgotten():
    f = running()
    for k in range(1, 9):
        z = np.array([40.0, 0, 0]) if k % 2 else np.zeros(3)
        assert f.add_fix(6.0 + k, z, R).outcome is (Outcome.GATED if k % 2 else Outcome.USED)


def test_the_wind_is_found_and_an_outage_survived():
    """A drift of 0.4 m/s: four seconds after the last fix the estimate with a wind state is far better than without."""
    ends = {}
    for wind in (0.0, 0.5):
        errors = []
        for seed in range(8):
            f, (t, X, U, rng) = FollowerFilter(WINDY, Following(wind=wind)), drone(seed, 24.0, wind=(0.4, 0.0, 0.0))
            for k in range(0, t.size - 1, 10):
                f.add_command(t[k], U[k])
                if t[k] < 20.0:
                    f.add_fix(t[k], X[k, :3] + 0.15 * rng.normal(size=3), R)
            errors.append(np.linalg.norm(f.belief(t[-1]).p - X[-1, :3]))
        ends[wind] = np.mean(errors)
    assert ends[0.5] < 0.8 * ends[0.0]


def test_height_and_course_alone():
    f = running()
    wide = f.belief(10.0).P[2, 2]
    assert f.add_fix(10.0, np.array([0.0, 0.0, 0.1]), np.array([np.inf, np.inf, 0.01])).outcome is Outcome.USED
    b = f.belief(10.0)
    assert b.P[2, 2] < 0.01 < wide < 0.05 < b.P[0, 0] and b.fix_t == 6.0
    assert f.add_course(10.0, 0.3, 0.01).outcome is Outcome.SLOW
    f.add_command(10.0, np.array([3.0, 0.0, 0.0]))
    assert f.add_course(14.0, 0.05, 0.01, heading=True).outcome is Outcome.USED
    assert f.belief(14.0).v[1] > 0.01


def test_shared_errors_cancel_and_own_ones_do_not():
    """Both receivers 3 m off: the line between the two is right, and its covariance honest."""
    t, X, U, rng = drone(3, 15.0)
    shared, away = np.array([3.0, -2.0, 5.0]), np.array([10.0, 0.0, 0.0])
    f = RelativeFilter(MODEL)
    assert not f.started
    with pytest.raises(UsageError):
        f.belief(0.0)
    for k in range(0, t.size - 1, 10):
        f.own.add_command(t[k], U[k])
        f.own.add_fix(t[k], X[k, :3] + shared + 0.1 * rng.normal(size=3), np.full(3, 0.01))
        f.target.add_fix(t[k], away + shared + 0.1 * rng.normal(size=3), np.full(3, 0.01))
    b = f.belief(t[-1])
    e = b.p - (X[-1, :3] - away)
    assert chi_square(e, b.P[:3, :3]) < 16.0
    d, sigma = f.distance(t[-1])
    assert abs(d - np.linalg.norm(X[-1, :3] - away)) < 4.0 * sigma < 4.0
    assert np.linalg.norm(f.own.belief(t[-1]).p - X[-1, :3]) > 5.0


def test_separation_by_its_own_formula():
    d, sigma = separation(np.array([3.0, 4.0, 0.0]), np.diag([0.04, 0.09, 1.0]))
    np.testing.assert_allclose([d, sigma**2], [5.0, (9 * 0.04 + 16 * 0.09) / 25.0])
    assert separation(np.zeros(3), np.diag([0.04, 0.09, 1.0])) == (0.0, 1.0)


def test_misuse_is_told():
    f = FollowerFilter(MODEL)
    with pytest.raises(UsageError, match="first fix"):
        f.belief(0.0)
    assert f.add_fix(0.0, np.zeros(3), np.array([np.inf, np.inf, 0.1])).outcome is Outcome.WAITING
    assert f.add_command(0.0, np.array([np.nan, 0.0, 0.0])).outcome is Outcome.NOT_FINITE
    with pytest.raises(UsageError, match="shapes"):
        f.add_fix(0.0, np.zeros(2), R)
    f.add_fix(1.0, np.zeros(3), R)
    with pytest.raises(UsageError, match="history"):
        f.belief(0.5)
    for bad in ({"gate": 0.0}, {"reacquire": 1}, {"wind": -1.0}, {"history_s": np.inf}):
        with pytest.raises(ConfigError):
            Following(**bad)


@pytest.mark.compiled
def test_a_drifting_shared_error_leaves_the_line_honest():
    """Both receivers wander together by 1 m within minutes; the target's fixes come 0.4 s late and half a second off
    ours. Over 40 flights the line is good to decimetres and honest; told the whole error, it is far too careful."""
    ends, careful, absolute = [], [], []
    for seed in range(40):
        t, X, U, rng = drone(seed, 15.0)
        c = np.zeros((t.size, 3))
        c[0] = rng.normal(size=3)
        for k in range(1, t.size):
            c[k] = c[k - 1] * (1.0 - 0.1 / 120.0) + np.sqrt(0.2 / 120.0) * rng.normal(size=3)
        target = np.array([10.0, 0.0, 0.0]) + t[:, None] * np.array([1.0, 0.5, 0.0])
        for told, found in ((0.1, ends), (1.0, careful)):
            f = RelativeFilter(MODEL, FollowerModel.target(acceleration=0.2, turn=0.3, acceleration_z=0.1))
            noise = np.random.default_rng(seed + 500)
            for k in range(0, t.size - 1, 10):
                f.own.add_command(t[k], U[k])
                f.own.add_fix(t[k], X[k, :3] + c[k] + 0.1 * noise.normal(size=3), np.full(3, told**2))
                if k:
                    f.target.add_fix(
                        t[k - 5], target[k - 5] + c[k - 5] + 0.1 * noise.normal(size=3), np.full(3, told**2)
                    )
            b, e = f.belief(t[-1]), X[-1, :3] - target[-1]
            found.append(chi_square(b.p - e, b.P[:3, :3]))
            if told == 0.1:
                absolute.append((np.linalg.norm(b.p - e), np.linalg.norm(f.own.belief(t[-1]).p - X[-1, :3])))
    low, high = average_bounds(3, 40, probability=0.999)
    assert low < np.mean(ends) < high and np.mean(careful) < low
    line, own = np.sqrt(np.mean(np.square(absolute), axis=0))
    assert line < 0.4 * own


def reversals(seed: int, settings: Following, rate_hz: float = 1.0):
    """A `Multirotor` that is told to fly 4 m/s the other way every 1.5 s; (errors (n, 6), NEES (n,), outcomes)."""
    drone, rng, dt = Multirotor(tau_s=0.5), np.random.default_rng(seed), 0.1
    x, out, air = drone.start(np.array([0.0, 0.0, 50.0]), 0.0), np.empty((20, 16)), np.zeros((20, 3))
    f, errors, nees, outcomes = FollowerFilter(MODEL, settings), [], [], Counter()
    row = np.concatenate([x[:3], np.zeros(3)])
    for k in range(300):
        t = k * dt
        if k % round(10 / rate_hz) == 0:
            outcomes[f.add_fix(t, row[:3] + rng.normal(size=3) * 0.15, R).outcome] += 1
        u = np.array([4.0, 3.0, 1.0, 0.0]) * (1.0 if (k // 15) % 2 else -1.0)
        f.add_command(t, u[:3])
        drone.run(x, np.tile(u, (20, 1)), air, Ground().table(), out)
        row = np.concatenate([out[-1, ROW_P : ROW_P + 3], out[-1, ROW_V : ROW_V + 3]])
        b = f.belief(t + dt)
        errors.append(b.x - row)
        nees.append(errors[-1] @ np.linalg.solve(b.P, errors[-1]) / 6)
    return np.array(errors), np.array(nees), outcomes


def test_commands_that_the_vehicle_cannot_answer_cost_no_fix():
    """5 m/s^2 where the lag asks for 20: a model without limits is wrong by metres, and refuses what is right."""
    limited = Following(hardest=5.0, hardest_up=4.0)
    free, told = reversals(3, Following()), reversals(3, limited)
    assert Outcome.GATED in free[2] and np.linalg.norm(free[0][:, :3], axis=1).max() > 1.0
    assert set(told[2]) == {Outcome.STARTED, Outcome.USED}
    assert np.linalg.norm(told[0][:, :3], axis=1).max() < 0.5
    assert np.mean([reversals(s, limited)[1].mean() for s in range(5)]) < 1.2


def test_limits_that_are_not_reached_change_nothing():
    t, X, U, rng = drone(1, 6.0)
    noise = 0.15 * rng.normal(size=(t.size, 3))
    beliefs = []
    for settings in (Following(), Following(hardest=50.0, hardest_up=50.0)):
        f = FollowerFilter(MODEL, settings)
        for k in range(0, t.size - 1, 10):
            f.add_command(t[k], U[k])
            f.add_fix(t[k], X[k, :3] + noise[k], R)
        beliefs.append(f.belief(t[-1]).x)
    assert np.array_equal(*beliefs)
