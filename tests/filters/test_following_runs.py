"""Three filters on the same flights: equal where the problem is linear, close where it is not, honest, repeatable."""

import numpy as np
import pytest

from outrider.data.belief import Gaussian
from outrider.errors import UsageError
from outrider.eval import average_bounds, chi_square
from outrider.filters import ukf
from outrider.filters.following import steps
from outrider.filters.following.gaussian import sigma_update, tangent_update
from outrider.filters.following.records import Log, Seen, workspace
from outrider.filters.following.runs import EKF, ENKF, UKF, Kind, run, smoothed
from outrider.models.motion.following import STEP, STILL_AIR, WINDY, FollowerModel, lag_step

MODEL = FollowerModel(acceleration=0.3, acceleration_z=0.2, wind=0.05, wind_z=0.05)


def flight(seed: int, n: int = 6, events: int = 30, kind: Seen = Seen.ANGLE, model: FollowerModel = MODEL):
    """(log, truth (E, n), x0, P0): a drone with the model's own noise that weaves, fixes and headings each second."""
    rng, C = np.random.default_rng(seed), np.zeros((1, 3, STEP))
    lag_step(1.0, model.theta(), C[0])
    P0 = np.diag([0.02] * 3 + [0.1] * 3 + [0.04] * 3)[:n, :n]
    x0 = np.concatenate([np.zeros(3), [2.0, 0.0, 0.0], np.zeros(3)])[:n]
    truth, x = np.zeros((events, n)), x0 + np.sqrt(np.diag(P0)) * rng.normal(size=n)
    Q = np.zeros((n, n))
    steps.predict(np.zeros(n), Q, np.zeros(3), C[0])
    root = np.linalg.cholesky(Q)
    t = np.arange(events)
    u = np.column_stack([2.0 * np.cos(0.2 * t), 2.0 * np.sin(0.2 * t), 0.2 * np.cos(t)])
    z, r = np.zeros((events, 6)), np.tile([0.02, 0.02, 0.03, 0.01, 0.01, 0.02], (events, 1))
    for k in range(events):
        steps.predict(x, np.zeros((n, n)), u[k], C[0])
        x += root @ rng.normal(size=n)
        truth[k] = x
        air = x[3:5] - (x[6:8] if n == 9 else 0.0)
        z[k, :3] = x[:3] + np.sqrt(r[k, :3]) * rng.normal(size=3)
        z[k, 3] = np.arctan2(air[1], air[0]) + 0.1 * rng.normal()
        if kind in (Seen.COSINES, Seen.PRINTED):
            z[k, 3:] = [*(air / np.linalg.norm(air)), np.linalg.norm(air)] + 0.1 * rng.normal(size=3)
    kinds = np.full(events, int(kind), np.int64)
    log = Log(np.zeros(events, np.int64), u, kinds, z, r, C, np.ones(1), 0.5)
    return log, truth, x0, P0


@pytest.mark.parametrize("n", [6, 9])
def test_linear_problems_have_one_answer(n):
    """Both, and the general filter that sends all its sigma points through process and fixes."""
    log, _, x0, P0 = flight(1, n, events=12, kind=Seen.NOTHING)
    a, b = run(EKF, log, x0, P0), run(UKF, log, x0, P0)
    np.testing.assert_allclose(b.x, a.x, atol=1e-9)
    np.testing.assert_allclose(b.P, a.P, atol=1e-9)
    Q, belief = np.zeros((n, n)), Gaussian(x0, P0, WINDY if n == 9 else STILL_AIR)
    steps.predict(np.zeros(n), Q, np.zeros(3), log.C[0])
    for k in range(12):

        def moved(x, dt, k=k):
            y = x.copy()
            steps.predict(y, np.zeros((n, n)), log.u[k], log.C[0])
            return y

        belief = ukf.predict(belief, moved, 1.0, Q).belief
        belief = ukf.update(belief, lambda x, k=k: log.z[k, :3] - x[:3], log.r[k, :3]).belief
        np.testing.assert_allclose(b.x[k], belief.x, atol=1e-9)
        np.testing.assert_allclose(b.P[k], belief.P, atol=1e-9)


@pytest.mark.compiled
def test_the_ensemble_is_within_a_millimetre_where_it_is_linear():
    """Mean over 40 flights of the difference of RMSE; and fewer members cost more."""
    differences = {ENKF: [], Kind("root", members=900, square_root=True): [], Kind("few", members=30): []}
    for seed in range(40):
        log, truth, x0, P0 = flight(seed, kind=Seen.NOTHING)
        best = rmse(run(EKF, log, x0, P0), truth)
        for kind, found in differences.items():
            found.append(rmse(run(kind, log, x0, P0, np.random.default_rng(seed)), truth) - best)
    stochastic, root, few = (float(np.mean(d)) for d in differences.values())
    assert abs(stochastic) < 1e-3 and abs(root) < 1e-3
    assert few > 2e-3


def rmse(track, truth) -> float:
    return float(np.sqrt(((track.x[:, :3] - truth[:, :3]) ** 2).sum(axis=1).mean()))


@pytest.mark.compiled
@pytest.mark.parametrize("n", [6, 9])
def test_filters_are_honest_and_with_too_little_noise_they_are_not(n):
    kinds = (EKF, UKF, Kind("EnKF", members=300), Kind("root", members=300, square_root=True))
    low, high = average_bounds(n, 80, probability=0.999, tests=8)
    for kind in kinds:
        ends = []
        for seed in range(80):
            log, truth, x0, P0 = flight(seed, n, events=12)
            track = run(kind, log, x0, P0, np.random.default_rng(seed + 1000))
            ends.append(chi_square(truth[-1] - track.x[-1], track.P[-1]))
        assert low < np.mean(ends) < high, (kind.name, np.mean(ends), low, high)
    ends = []
    for seed in range(80):
        log, truth, x0, P0 = flight(seed, n, events=12)
        log.C[0][:, 4:10] *= 0.1
        track = run(EKF, log, x0, P0)
        ends.append(chi_square(truth[-1] - track.x[-1], track.P[-1]))
    assert np.mean(ends) > high


@pytest.mark.parametrize("kind", [Seen.ANGLE, Seen.COSINES, Seen.PRINTED])
@pytest.mark.parametrize("n", [6, 9])
def test_directions_are_those_of_the_general_filters(n, kind):
    """Sigma points against the general unscented filter; Jacobians against differences."""
    rng = np.random.default_rng(n + kind)
    A = rng.normal(size=(n, n))
    x, P = rng.normal(size=n), 0.02 * (A @ A.T + np.eye(n))
    x[3:5] = 1.5, -2.0
    m, dt, z, r = int(kind), 0.8, np.zeros(6), np.full(6, 0.02)

    def h(y):
        v = y[3:5] - (y[6:8] if n == 9 else 0.0)
        speed = np.hypot(*v)
        return np.array([np.arctan2(v[1], v[0])] if m == 1 else [*(v / speed), speed * dt])[:m]

    z[3 : 3 + m] = h(x) + 0.05
    want = ukf.update(Gaussian(x, P, WINDY if n == 9 else STILL_AIR), lambda y: z[3 : 3 + m] - h(y), r[:m])
    x1, P1 = x.copy(), P.copy()
    sigma_update(x1, P1, m, dt, z, r, workspace(n))
    np.testing.assert_allclose(x1, want.belief.x, atol=1e-9)
    np.testing.assert_allclose(P1, want.belief.P, atol=1e-9)
    H = np.column_stack([(h(x + 1e-6 * e) - h(x - 1e-6 * e)) / 2e-6 for e in np.eye(n)])
    S = H @ P @ H.T + np.diag(r[:m])
    K = P @ H.T @ np.linalg.inv(S)
    x2, P2 = x.copy(), P.copy()
    likelihood = tangent_update(x2, P2, m, dt, z, r, workspace(n))
    np.testing.assert_allclose(x2, x + K @ np.full(m, 0.05), atol=1e-8)
    np.testing.assert_allclose(P2, P - K @ S @ K.T, atol=1e-8)
    nis = np.full(m, 0.05) @ np.linalg.solve(S, np.full(m, 0.05))
    np.testing.assert_allclose(likelihood, -0.5 * (nis + np.log(np.linalg.det(2 * np.pi * S))), atol=1e-7)


def test_members_follow_their_moments():
    """One update of an ensemble is the Kalman update of its own sample moments, but for chance."""
    log, _, x0, P0 = flight(3, 6, events=1, kind=Seen.NOTHING)
    for root in (False, True):
        track = run(Kind("e", members=50, square_root=root), log, x0, P0, np.random.default_rng(1))
        x, P = track.xp[0].copy(), track.Pp[0].copy()
        nis, det = steps.update(x, P, 0, log.z[0], log.r[0], np.inf)
        np.testing.assert_allclose(track.x[0], x, atol=0.02)
        if root:
            np.testing.assert_allclose(track.P[0][:3, :3], P[:3, :3], rtol=0.12, atol=1e-4)
        np.testing.assert_allclose(track.likelihood[0], -0.5 * (nis + np.log(det) + 3 * np.log(2 * np.pi)), atol=0.15)


def test_same_seed_same_bits():
    log, _, x0, P0 = flight(2, 9, events=4)
    kind = Kind("EnKF", members=20)
    a, b, c = (run(kind, log, x0, P0, np.random.default_rng(seed)) for seed in (5, 5, 6))
    np.testing.assert_array_equal(a.x, b.x)
    assert np.abs(a.x - c.x).max() > 1e-6
    with pytest.raises(UsageError, match="generator"):
        run(kind, log, x0, P0)


def test_smoothing_helps_and_ends_where_the_filter_does():
    better = []
    for seed in range(10):
        log, truth, x0, P0 = flight(seed, 6, kind=Seen.NOTHING)
        track = run(EKF, log, x0, P0)
        back = smoothed(log, track)
        np.testing.assert_array_equal(back.x[-1], track.x[-1])
        better.append(rmse(back, truth) / rmse(track, truth))
    assert np.mean(better) < 0.9
