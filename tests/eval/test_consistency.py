"""Chi-square bounds against Monte Carlo, and tests that pass for honest filters and fail for the others."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.errors import UsageError
from outrider.eval import average_bounds, average_test, chi_square, effective_samples, ellipse_coverage, family_level


def drawn(n: int, d: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Errors and the covariances they were drawn from, all different."""
    rng = np.random.default_rng(seed)
    L = np.tril(rng.normal(size=(n, d, d))) + 2 * np.eye(d)
    return np.einsum("nij,nj->ni", L, rng.standard_normal((n, d))), L @ np.swapaxes(L, 1, 2)


def test_chi_square_by_hand_and_broadcast():
    e, P = drawn(20, 3)
    by_hand = [x @ np.linalg.inv(S) @ x for x, S in zip(e, P, strict=True)]
    np.testing.assert_allclose(chi_square(e, P), by_hand, rtol=1e-9)
    np.testing.assert_allclose(chi_square(e.reshape(4, 5, 3), P[0]).ravel(), chi_square(e, P[:1]), rtol=1e-12)
    assert chi_square(np.array([3.0]), np.array([[4.0]])) == pytest.approx(2.25)


def test_covariances_that_are_none_give_nan():
    e, P = drawn(5, 2)
    P[0], P[1], P[2] = 0.0, -np.eye(2), np.nan
    e[3] = np.inf
    assert np.isnan(chi_square(e, P)).tolist() == [True, True, True, True, False]


@pytest.mark.parametrize(("dof", "n"), [(1, 10), (3, 50), (7, 5)])
def test_bounds_hold_for_as_many_as_they_say(dof, n):
    means = np.random.default_rng(1).chisquare(dof, (20_000, n)).mean(axis=1)
    low, high = average_bounds(dof, n, probability=0.95)
    assert np.mean(means < low) == pytest.approx(0.025, abs=0.005)
    assert np.mean(means > high) == pytest.approx(0.025, abs=0.005)


@pytest.mark.parametrize("method", ["sidak", "bonferroni"])
def test_a_family_holds_together(method):
    means = np.random.default_rng(2).chisquare(3, (5_000, 20, 8)).mean(axis=2)
    low, high = average_bounds(3, 8, probability=0.9, tests=20, method=method)
    together = np.mean(np.all((means >= low) & (means <= high), axis=1))
    assert 0.885 <= together <= 0.92
    alone = average_bounds(3, 8, probability=0.9)
    assert np.mean(np.all((means >= alone[0]) & (means <= alone[1]), axis=1)) < 0.3


@settings(max_examples=50, derandomize=True)
@given(st.integers(1, 30), st.integers(1, 500), st.floats(0.5, 0.9999), st.integers(1, 1000))
def test_bounds_enclose_the_expectation_and_widen_with_the_family(dof, n, probability, tests):
    one = average_bounds(dof, n, probability=probability)
    low, high = average_bounds(dof, n, probability=probability, tests=tests)
    assert low <= one[0] <= dof * 1.05 and one[1] <= high
    assert one[1] >= dof * 0.95
    assert family_level(probability, tests, "bonferroni") >= family_level(probability, tests) - 1e-12


def test_honest_passes_and_both_kinds_of_liar_fail():
    e, P = drawn(100, 4)
    assert average_test(chi_square(e, P), 4).inside
    boastful, timid = average_test(chi_square(e, P / 2), 4), average_test(chi_square(e, P * 2), 4)
    assert not boastful.inside and str(boastful).startswith("over-confident")
    assert not timid.inside and str(timid).startswith("over-cautious")


def test_correlated_values_are_worth_fewer():
    rng, keep, n = np.random.default_rng(3), 0.9, 20_000
    x = rng.standard_normal(n)
    for k in range(1, n):
        x[k] = keep * x[k - 1] + np.sqrt(1 - keep**2) * x[k]
    assert effective_samples(x) / n == pytest.approx((1 - keep) / (1 + keep), rel=0.25)
    assert effective_samples(rng.standard_normal(n)) / n == pytest.approx(1.0, abs=0.1)
    assert effective_samples(np.ones(10)) == 10.0


def test_an_average_over_time_needs_the_effective_number():
    """Honest but slow errors: bounds for independent samples cry wolf, those for effective ones rarely do."""
    naive = aware = 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        x = rng.standard_normal(600)
        for k in range(1, 600):
            x[k] = 0.9 * x[k - 1] + np.sqrt(1 - 0.81) * x[k]
        naive += not average_test(x**2, 1, probability=0.99).inside
        aware += not average_test(x**2, 1, probability=0.99, independent=False).inside
    assert naive > 15 and aware <= 6


def test_ellipses_cover_their_share():
    e, P = drawn(4_000, 2)
    assert ellipse_coverage(e, P) == pytest.approx(0.95, abs=0.01)
    assert ellipse_coverage(e, P, 0.5) == pytest.approx(0.5, abs=0.03)
    assert ellipse_coverage(e, P / 4) < 0.6
    assert np.isnan(ellipse_coverage(e[:2], np.zeros((2, 2, 2))))


def test_impossible_questions_are_refused():
    with pytest.raises(UsageError, match="no finite value"):
        average_test(np.array([np.nan]), 2)
    with pytest.raises(UsageError, match="sidak or bonferroni"):
        family_level(0.9, 2, "holm")
    with pytest.raises(UsageError, match="probability"):
        average_bounds(1, 1, probability=1.0)
