"""Filters: one predict and one update, the models included."""

import numpy as np

from benchmarks import _peers as peers
from benchmarks._problems import (
    BEACON,
    DT,
    advance,
    glide,
    glide_all,
    innovations,
    measurements,
    omnidirectional,
    selector,
    sense,
    sightings,
    start,
    summary,
)
from benchmarks.table import Row, Side
from outrider._kernel import inlined, kernel
from outrider.data.belief import Gaussian, StateLayout
from outrider.filters import ekf, enkf, ukf


@inlined
def ekf_event(x, P, z, F, Q, H, r, keep, table, y, w):
    """Predict and update with measurements of the first states."""
    advance(x, F)
    ekf.propagate(P, F, Q, w)
    for k in range(z.size):
        y[k] = z[k] - x[k]
    nis = ekf.innovate(P, H, r, y, z.size, w)
    ekf.correct(x, P, keep, table, w)
    return nis


@kernel
def ekf_loop(x, P, Z, F, Q, H, r, keep, table, y, w):
    """All events in one compiled call."""
    for i in range(Z.shape[0]):
        ekf_event(x, P, Z[i], F, Q, H, r, keep, table, y, w)


def ekf_arguments(n, m):
    """(x, P) and, after the measurements, the rest."""
    (x, P, Q), (H, r) = start(n), selector(n, m)
    table = StateLayout(("s", n, "")).table
    return x, P, (np.eye(n), Q, H, r, np.ones(n), table, np.zeros(m), ekf.workspace(n, m))


def our_ekf(n, m):
    """Compiled loop."""

    def run(events):
        x, P, rest = ekf_arguments(n, m)
        ekf_loop(x, P, measurements(m, events), *rest)
        return summary(x, P)

    return run


def our_ekf_by_call(n, m):
    """One call from Python for each event."""

    def run(events):
        x, P, rest = ekf_arguments(n, m)
        for z in measurements(m, events):
            ekf_event(x, P, z, *rest)
        return summary(x, P)

    return run


@kernel
def ukf_loop(x, P, Z, Q, r, keep, table, beacon, seen, w):
    """13 sigma points through `glide`, drawn again, through `sense`."""
    for k in range(Z.shape[0]):
        ukf.draw(x, P, table, w)
        for i in range(w.X.shape[0]):
            glide(w.X[i], DT, w.X[i])
        ukf.recover(x, P, Q, table, w)
        ukf.draw(x, P, table, w)
        for i in range(w.X.shape[0]):
            sense(w.X[i], beacon, seen)
            for j in range(7):
                w.Y[i, j] = Z[k, j] - seen[j]
        ukf.innovate(r, 7, w)
        ukf.correct(x, P, r, 7, keep, table, w)


BODY = StateLayout(("position", 3, "m"), ("velocity", 3, "m/s"))
NOISE = np.linspace(0.02, 0.05, 7)


def our_ukf(events):
    """Compiled loop."""
    x, P, Q = start(6)
    w = ukf.workspace(6, 6, 7)
    ukf_loop(x, P, sightings(events), Q, NOISE, np.ones(6), BODY.table, BEACON, np.zeros(7), w)
    return summary(x, P)


def our_enkf(square_root):
    """The public functions, with models of all members at once, compiled."""

    def f(X, dt):
        out = np.empty_like(X)
        glide_all(X, dt, out)
        return out

    def run(events):
        rng = np.random.default_rng(3)
        x, P, Q = start(6)
        belief = enkf.sample(Gaussian(x, P, BODY), 900, rng)
        for z in sightings(events):

            def residual(X, z=z):
                out = np.empty((X.shape[0], 7))
                innovations(X, z, BEACON, out)
                return out

            belief = enkf.predict(belief, f, DT, Q, rng)
            if square_root:
                belief = enkf.update_square_root(belief, residual, NOISE).belief
            else:
                belief = enkf.update(belief, residual, NOISE, rng).belief
        moments, _ = enkf.moments(belief)
        return summary(moments.x, moments.P)

    return run


def ekf_row(n, m, target=None, stonesoup=False):
    """The compiled loop beside the peers."""
    others = [Side("filterpy", peers.filterpy_ekf(n, m), 500)]
    if n == 15:
        plain = getattr(omnidirectional, "py_func", omnidirectional)
        others.append(Side("filterpy, model in Python", peers.filterpy_ekf(n, m, plain), 500))
    if stonesoup:
        others.append(Side("stonesoup", peers.stonesoup_ekf(n, m), 40))
    return Row(f"EKF, {n} states, {m} measurements", Side("ours", our_ekf(n, m), 10_000), others, target)


def rows() -> list[Row]:
    """The filter rows of the table."""
    called = Side("ours", our_ekf_by_call(15, 6), 2000)
    return [
        ekf_row(7, 3, stonesoup=True),
        ekf_row(7, 6),
        ekf_row(15, 3),
        ekf_row(15, 6, target=1.5, stonesoup=True),
        Row(
            "EKF, 15 states, 6 measurements, a Python call an event",
            called,
            [Side("filterpy", peers.filterpy_ekf(15, 6), 500)],
        ),
        Row(
            "UKF, 6 states, 7 measurements",
            Side("ours", our_ukf, 10_000),
            [Side("filterpy", peers.filterpy_ukf, 100)],
            1.5,
        ),
        Row(
            "EnKF, 900 members, 6 states, 7 measurements",
            Side("ours", our_enkf(False), 100),
            [Side("filterpy", peers.filterpy_enkf, 10)],
            200.0,
            tolerance=None,
        ),
        Row("EnKF, the same, square root", Side("ours", our_enkf(True), 100), [], 200.0, tolerance=None),
    ]
