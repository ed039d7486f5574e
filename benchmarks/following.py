"""A follower's filters, a second a step: fix and direction of flight; beside filterpy with our models, compiled."""

from functools import cache

import numpy as np

from benchmarks.table import Row, Side
from outrider._kernel import kernel
from outrider.filters.following import steps
from outrider.filters.following.ensemble import run_ensemble
from outrider.filters.following.gaussian import sigma_update, tangent_update
from outrider.filters.following.records import Log, Seen, Track, workspace
from outrider.models.motion.following import STEP, FollowerModel, lag_step

SIGMA, HEADING, ROBOTS = 0.15, 0.1, 1000
R = np.array([SIGMA**2] * 3)


@cache
def problem(events):
    """(u, z, step): a drone that weaves at 2 m/s, its fixes and headings."""
    rng, c = np.random.default_rng(7), np.zeros((3, STEP))
    lag_step(1.0, FollowerModel(acceleration=0.3, acceleration_z=0.2).theta(), c)
    t = np.arange(events)
    u = np.column_stack([2.0 * np.cos(0.2 * t), 2.0 * np.sin(0.2 * t), 0.1 * np.cos(t)])
    x, z = start()[0], np.zeros((events, 6))
    for k in range(events):
        move(x, u[k], c, x)
        z[k, :3] = x[:3] + SIGMA * rng.normal(size=3)
        z[k, 3] = np.arctan2(x[4], x[3]) + HEADING * rng.normal()
    return u, z, c


def start():
    """(x, P) at the start of the weave."""
    return np.array([0.0, 0.0, 0.0, 2.0, 0.0, 0.0]), np.diag([0.02] * 3 + [0.1] * 3)


@kernel
def move(x, u, c, out):
    """The process, for filterpy."""
    for i in range(3):
        p, v = x[i], x[3 + i]
        out[i] = p + c[i, 0] * v + c[i, 2] * u[i]
        out[3 + i] = c[i, 1] * v + c[i, 3] * u[i]


@kernel
def see(x, out):
    """Fix and direction, for filterpy."""
    for i in range(3):
        out[i] = x[i]
    out[3] = np.arctan2(x[4], x[3])


@kernel
def loop(x, P, U, Z, c, r, kind, unscented, s):
    """All steps in one compiled call; kind 0: no direction."""
    for k in range(Z.shape[0]):
        steps.predict(x, P, U[k], c)
        steps.update(x, P, 0, Z[k], r, 1e12)
        if kind == 1:
            if unscented:
                sigma_update(x, P, kind, 1.0, Z[k], r, s)
            else:
                tangent_update(x, P, kind, 1.0, Z[k], r, s)


def gaussian(kind, unscented):
    """Ours, extended or unscented."""

    def run(events):
        (u, z, c), (x, P) = problem(events), start()
        loop(x, P, u, z, c, np.array([*R, HEADING**2, 1.0, 1.0]), int(kind), unscented, workspace(6))
        return np.concatenate([x, np.diag(P)])

    return run


def ensemble(square_root):
    """Ours, 900 members, its moments after every step included."""

    def run(events):
        (u, z, c), (x, P) = problem(events), start()
        r = np.tile([*R, HEADING**2, 1.0, 1.0], (events, 1))
        kinds = np.full(events, int(Seen.ANGLE), np.int64)
        log = Log(np.zeros(events, np.int64), u, kinds, z, r, c[None].copy(), np.ones(1), 0.5)
        shapes = ((events, 6), (events, 6, 6), (events, 6), (events, 6, 6), (events,))
        out = Track(*(np.zeros(s) for s in shapes))
        run_ensemble(log, x, P, np.random.default_rng(3), square_root, out, workspace(6, 900))
        return np.concatenate([x, np.diag(P)])

    return run


def _q(c):
    Q = np.diag(np.concatenate([c[:, 4], c[:, 6]]))
    for i in range(3):
        Q[i, 3 + i] = Q[3 + i, i] = c[i, 5]
    return Q


def filterpy_ekf(kind):
    """ExtendedKalmanFilter: fix, then direction, as we do."""
    from filterpy.kalman import ExtendedKalmanFilter

    def run(events):
        (u, z, c), (x, P) = problem(events), start()
        f = ExtendedKalmanFilter(6, 3)
        f.x, f.P, f.Q, f.B = x, P, _q(c), np.zeros((6, 3))
        for i in range(3):
            f.F[i, 3 + i], f.F[3 + i, 3 + i], f.B[i, i], f.B[3 + i, i] = c[i, 0], c[i, 1], c[i, 2], c[i, 3]
        H, one = np.eye(6)[:3], np.zeros((1, 6))
        for k in range(events):
            f.predict(u[k])
            f.dim_z = 3
            f.update(z[k, :3], lambda x: H, lambda x: H @ x, R=np.diag(R))
            if kind:
                f.dim_z, square = 1, f.x[3] ** 2 + f.x[4] ** 2
                one[0, 3:5] = -f.x[4] / square, f.x[3] / square
                e = z[k, 3] - np.arctan2(f.x[4], f.x[3])
                e = np.array([(e + np.pi) % (2.0 * np.pi) - np.pi])
                f.update(e, lambda x: one, lambda x: np.zeros(1), R=np.array([[HEADING**2]]))
        return np.concatenate([f.x, np.diag(f.P)])

    return run


def filterpy_ukf(events):
    """UnscentedKalmanFilter with the cubature points; fix and direction in one update."""
    from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

    (u, z, c), (x, P) = problem(events), start()
    f = UnscentedKalmanFilter(6, 4, 1.0, sensed, moved, MerweScaledSigmaPoints(6, 1.0, 0.0, 0.0), residual_z=apart)
    f.x, f.P, f.Q, f.R = x, P, _q(c), np.diag([*R, HEADING**2])
    for k in range(events):
        f.predict(u=u[k], c=c)
        f.update(near(z[k, :4], f.x))
    return np.concatenate([f.x, np.diag(f.P)])


def filterpy_enkf(events):
    """EnsembleKalmanFilter with 900 members."""
    from filterpy.kalman import EnsembleKalmanFilter

    (u, z, c), (x, P) = problem(events), start()
    now = [u[0]]
    f = EnsembleKalmanFilter(x, P, 4, 1.0, 900, sensed, lambda x, dt: moved(x, dt, now[0], c))
    f.Q, f.R = _q(c), np.diag([*R, HEADING**2])
    for k in range(events):
        now[0] = u[k]
        f.predict()
        f.update(near(z[k, :4], f.x))
    return np.concatenate([f.x, np.diag(f.P)])


def moved(x, dt, u, c):
    """The process as filterpy wants it."""
    out = np.empty(6)
    move(x, u, c, out)
    return out


def sensed(x):
    """The measurement as filterpy wants it."""
    out = np.empty(4)
    see(x, out)
    return out


def apart(a, b):
    """a - b, the angle wrapped."""
    e = a - b
    e[3] = (e[3] + np.pi) % (2.0 * np.pi) - np.pi
    return e


def near(z, x):
    """z with its angle on the sheet of the estimate's."""
    course = np.arctan2(x[4], x[3])
    return np.array([*z[:3], course + (z[3] - course + np.pi) % (2.0 * np.pi) - np.pi])


def many(events):
    """A thousand followers with wind states: every step all rows are predicted and fused."""
    c, nis = np.zeros((3, STEP)), np.zeros(ROBOTS)
    lag_step(0.1, FollowerModel(wind=0.02).theta(), c)
    X, P = np.zeros((ROBOTS, 9)), np.tile(0.1 * np.eye(9), (ROBOTS, 1, 1))
    U, Z, r = np.ones((ROBOTS, 3)), np.zeros((ROBOTS, 3)), np.full((ROBOTS, 3), SIGMA**2)
    for _ in range(max(1, events // ROBOTS)):
        steps.predict_rows(X, P, U, c)
        steps.update_rows(X, P, 0, Z, r, 1e12, nis)
    return X[0]


def rows():
    """Rows of this module."""
    name = "follower, 6 states"
    return [
        Row(f"{name}, EKF, fix", Side("ours", gaussian(0, False), 20_000), [Side("filterpy", filterpy_ekf(0), 300)],
            target=0.5),
        Row(f"{name}, EKF, fix and direction", Side("ours", gaussian(1, False), 20_000),
            [Side("filterpy", filterpy_ekf(1), 300)], target=0.5),
        Row(f"{name}, UKF, fix and direction", Side("ours", gaussian(1, True), 20_000),
            [Side("filterpy", filterpy_ukf, 100)], target=1.5, tolerance=0.05),
        Row(f"{name}, EnKF of 900, fix and direction", Side("ours", ensemble(False), 200),
            [Side("filterpy", filterpy_enkf, 10)], target=200.0, tolerance=None),
        Row(f"{name}, EnKF of 900, square root", Side("ours", ensemble(True), 200), [], target=200.0, tolerance=None),
        Row("1000 followers with wind states, fix (per robot)", Side("ours", many, 20_000), [], target=None,
            tolerance=None),
    ]  # fmt: skip
