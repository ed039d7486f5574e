"""The benchmark compares like with like: both sides end with the same numbers."""

import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2]))  # the benchmarks stand beside the package, not in it

from benchmarks import _problems, filters, following, vehicles
from benchmarks.table import Row, Side, agree, cells, measure


@pytest.mark.parametrize("row", [*filters.rows(), *vehicles.rows(), *following.rows()], ids=lambda row: row.name)
def test_both_sides_agree(row):
    pytest.importorskip("filterpy", reason="filterpy is not installed (dependency group bench)")
    pytest.importorskip("stonesoup", reason="stonesoup is not installed (dependency group bench)")
    pytest.importorskip("mujoco", reason="mujoco is not installed (dependency group bench)")
    if row.tolerance is None:
        pytest.skip("another algorithm: only the times are compared")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the peers' own
        assert agree(row, events=8) <= row.tolerance


def test_a_peer_that_differs_is_refused():
    row = Row("x", Side("a", lambda n: np.zeros(1), 1), [Side("b", lambda n: np.full(1, 1e-6), 1)])
    with pytest.raises(AssertionError, match="results differ by 1e-06"):
        agree(row)


def test_times_are_per_event_and_ratios_are_ours_into_theirs():
    row = Row("sum", Side("ours", lambda n: np.zeros(1), 10), [Side("b", lambda n: np.zeros(1), 10)], target=1.0)
    timing = measure(row, 3)
    timing.times[:] = [[1.0, 2.0, 4.0], [10.0, 20.0, 20.0]]
    assert timing.median() == 2.0 and timing.best() == 1.0 and timing.ratio(1) == 10.0
    assert cells(timing)[1:3] == ["2 / 1", "1"]


def test_what_is_slow_is_timed_less(monkeypatch):
    clock = [0.0]

    def takes(seconds):
        def run(_events):
            clock[0] += seconds
            return np.zeros(1)

        return run

    monkeypatch.setattr("benchmarks.table.process_time", lambda: clock[0])
    row = Row("x", Side("ours", takes(2.0), 1), [Side("slow", takes(20.0), 1), Side("quick", takes(0.1), 1)])
    timing = measure(row, 9)
    assert [len(times) for times in timing.times] == [3, 1, 9]
    assert timing.ratio(1) == pytest.approx(10.0) and timing.ratio(2) == pytest.approx(0.05)


@pytest.mark.parametrize("n", [7, 15])
def test_jacobians_of_the_problems_are_right(n):
    """Central differences."""
    x0 = np.random.default_rng(4).normal(size=n) * 0.5

    def f(x):
        out = x.copy()
        _problems.advance(out, np.eye(n))
        return out

    F = np.eye(n)
    _problems.advance(x0.copy(), F)
    numeric = np.stack([(f(x0 + 1e-6 * e) - f(x0 - 1e-6 * e)) / 2e-6 for e in np.eye(n)], axis=1)
    np.testing.assert_allclose(F, numeric, atol=1e-8)
