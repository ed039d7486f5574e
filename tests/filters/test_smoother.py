"""The smoother: batch least squares on a linear problem, better than the filter on a nonlinear one."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import chdtri
from test_attitude import LAYOUT, P0, SEEDS, SIGHT, Q, R, jacobian_of_sight, jacobian_of_turn, seen, turned

from outrider.core.manifold import local, retract
from outrider.data.belief import Gaussian, StateLayout
from outrider.errors import DataError
from outrider.filters import ekf, smoother


def record(belief, steps):
    """Run (predict, update) callables and keep what the smoother needs."""
    rows = []
    for predict, update in steps:
        prior, F = predict(belief)
        belief = update(prior)
        rows.append((belief.x, belief.P, prior.x, prior.P, F))
    return [np.array(column) for column in zip(*rows, strict=True)]


@settings(max_examples=10, derandomize=True)
@given(seed=st.integers(0, 10_000), n=st.integers(1, 4), m=st.integers(1, 2), steps=st.integers(2, 8))
def test_smoother_is_batch_least_squares(seed, n, m, steps):
    """One big weighted least-squares problem over all states at once."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, n))
    F, P, Qn = np.eye(n) + 0.3 * rng.normal(size=(n, n)), A @ A.T + 0.5 * np.eye(n), 0.3 * np.eye(n)
    H, r, zs, x0 = rng.normal(size=(m, n)), rng.uniform(0.2, 1, m), rng.normal(size=(steps, m)), rng.normal(size=n)
    layout = StateLayout(("s", n, "m"))

    def step(z):
        return (
            lambda b: (ekf.predict(b, F @ b.x, F, Qn), F),
            lambda b: ekf.update(b, z - H @ b.x, H, r).belief,
        )

    x, P_, xp, Pp, Fs = record(Gaussian(x0, P, layout), [step(z) for z in zs])
    got = smoother.smooth(x, P_, xp, Pp, Fs, layout.table)

    # rows: the prediction of the first state, then x[k] - F x[k-1] = w, then z = H x + v
    rows, rhs = [], []
    for k in range(steps):
        row = np.zeros((n, steps * n))
        row[:, k * n : (k + 1) * n] = np.eye(n)
        if k:
            row[:, (k - 1) * n : k * n] = -F
        root = np.linalg.cholesky(Qn if k else F @ P @ F.T + Qn)
        rows.append(np.linalg.solve(root, row))
        rhs.append(np.linalg.solve(root, np.zeros(n) if k else F @ x0))
        row = np.zeros((m, steps * n))
        row[:, k * n : (k + 1) * n] = H
        rows.append(row / np.sqrt(r)[:, None])
        rhs.append(zs[k] / np.sqrt(r))
    J, b = np.concatenate(rows), np.concatenate(rhs)
    solution = np.linalg.lstsq(J, b, rcond=None)[0].reshape(steps, n)
    covariance = np.linalg.inv(J.T @ J)
    np.testing.assert_allclose(got.x, solution, atol=1e-9 * max(1, np.abs(solution).max()))
    for k in range(steps):
        block = covariance[k * n : (k + 1) * n, k * n : (k + 1) * n]
        np.testing.assert_allclose(got.P[k], block, atol=1e-9 * max(1, np.abs(block).max()))


def attitude_run(seed, steps=10):
    """Filter record and truth of the attitude problem, sights only every third step."""
    rng = np.random.default_rng(seed)
    truth = LAYOUT.zeros()
    start = truth.copy()
    retract(start, -rng.normal(size=6) * np.sqrt(np.diag(P0)), LAYOUT.table)
    truths, rows, b = [], [], Gaussian(start, P0, LAYOUT)
    for k in range(steps):
        rate = 0.4 * rng.normal(size=3)
        truth = turned(truth, rate)
        retract(truth, rng.normal(size=6) * np.sqrt(np.diag(Q)), LAYOUT.table)
        truths.append(truth.copy())
        F = jacobian_of_turn(b.x, rate)
        prior = b = ekf.predict(b, turned(b.x, rate), F, Q)
        if k % 3 == 2:
            z = seen(truth) + SIGHT * rng.normal(size=6)
            # iterated: with 0.3 rad to begin with, the single update is too confident (NEES 8.4 of 6)
            b = ekf.iterate(b, lambda x, z=z: (z - seen(x), jacobian_of_sight(x)), R).belief
        rows.append((b.x, b.P, prior.x, prior.P, F))
    return truths, [np.array(column) for column in zip(*rows, strict=True)]


def errors(truths, x):
    out = np.zeros((len(truths), 6))
    for e, truth, estimate in zip(out, truths, x, strict=True):
        local(truth, estimate, LAYOUT.table, e)
    return out


def test_smoothing_attitudes_reduces_the_error_and_stays_consistent():
    seeds, filtered, smoothed, nees = SEEDS, [], [], []
    for seed in range(seeds):
        truths, columns = attitude_run(seed)
        got = smoother.smooth(*columns, LAYOUT.table)
        before, after = errors(truths, columns[0]), errors(truths, got.x)
        filtered.append(before[:-1])
        smoothed.append(after[:-1])
        nees.append(after[3] @ np.linalg.solve(got.P[3], after[3]))
        np.testing.assert_allclose(got.x[-1], columns[0][-1])  # the last step has nothing more to learn
        assert np.array_equal(got.P, np.swapaxes(got.P, 1, 2))
    assert np.sqrt(np.mean(np.square(smoothed))) < 0.6 * np.sqrt(np.mean(np.square(filtered)))
    assert chdtri(6 * seeds, 1 - 0.0005) < sum(nees) < chdtri(6 * seeds, 0.0005)


def test_input_is_left_alone_and_singular_predictions_are_named():
    _, columns = attitude_run(1)
    before = [c.copy() for c in columns]
    smoother.smooth(*columns, LAYOUT.table)
    assert all(np.array_equal(a, b) for a, b in zip(before, columns, strict=True))
    columns[3][4] = 0.0
    with pytest.raises(DataError, match=r"step 4: the predicted covariance is not positive definite \(give"):
        smoother.smooth(*columns, LAYOUT.table)
