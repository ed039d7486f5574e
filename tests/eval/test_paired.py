"""Intervals and tests over seeds: against SciPy's, by the coverage of simulated truths, and on what is degenerate."""

import subprocess
import sys
import warnings
from math import inf, isnan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.random import Generator
from scipy import stats

from outrider.errors import UsageError
from outrider.eval import bootstrap, corrected, paired, summary, wilcoxon

CASES = {"few": 5, "some": 12, "many": 60, "most": 300}


@pytest.mark.parametrize("n", CASES.values(), ids=CASES)
def test_against_scipy(n: int, rng: Generator) -> None:
    a, b = rng.normal(1.0, 0.3, n), rng.normal(1.1, 0.2, n)
    told = paired(a, b)
    test = stats.ttest_rel(a, b)
    interval = test.confidence_interval(0.95)
    np.testing.assert_allclose((told.p_t, told.low, told.high), (test.pvalue, interval.low, interval.high), rtol=1e-9)
    method = "exact" if n <= 50 else "asymptotic"
    assert told.p_wilcoxon == pytest.approx(stats.wilcoxon(a, b, method=method, correction=False).pvalue, rel=1e-9)
    mean = summary(a)
    assert (mean.n, mean.mean, mean.sd) == (n, pytest.approx(a.mean()), pytest.approx(a.std(ddof=1)))
    t = stats.t.interval(0.95, n - 1, a.mean(), stats.sem(a))
    np.testing.assert_allclose((mean.low, mean.high), t, rtol=1e-9)


def test_ties_are_exact_too(rng: Generator) -> None:
    """Every assignment of signs counted, which is what a permutation of the signs does."""
    d = rng.integers(-4, 6, 11).astype(float)
    d = d[d != 0]
    signs = stats.PermutationMethod(n_resamples=10_000_000)
    expected = stats.wilcoxon(d, method=signs).pvalue
    assert wilcoxon(d)[0] == pytest.approx(expected, rel=1e-12)


def test_many_ties_agree_with_the_normal_approximation(rng: Generator) -> None:
    d = rng.integers(-3, 5, 200).astype(float)
    assert wilcoxon(d)[0] == pytest.approx(stats.wilcoxon(d, method="asymptotic").pvalue, rel=1e-9)


def test_bootstrap_against_scipy(rng: Generator) -> None:
    """Both draw at random: agreement to a few per cent of the width, on a skewed sample."""
    d = rng.exponential(1.0, 40)
    ours = np.array(bootstrap(d, np.random.default_rng(1), resamples=20_000))
    theirs = stats.bootstrap((d,), np.mean, n_resamples=20_000, method="BCa", rng=np.random.default_rng(2))
    expected = np.array(theirs.confidence_interval)
    np.testing.assert_allclose(ours, expected, atol=0.04 * np.ptp(expected))
    assert expected[1] - d.mean() > d.mean() - expected[0], "the sample is skewed, so must be its interval"


@pytest.mark.parametrize(
    ("draw", "n"),
    [("normal", 8), ("normal", 40), ("uniform", 12), ("laplace", 30)],
    ids=lambda x: str(x),
)
def test_intervals_cover_the_truth(draw: str, n: int, rng: Generator) -> None:
    """Of 3000 campaigns with a shared noise and a known difference, 93 to 97 % contain it."""
    truth, hits, rounds = -0.3, 0, 3000
    for _ in range(rounds):
        shared = rng.normal(0.0, 5.0, n)
        noise = {"normal": rng.normal, "uniform": rng.uniform, "laplace": rng.laplace}[draw]
        told = paired(shared + truth, shared + noise(-1.0 if draw == "uniform" else 0.0, 1.0, n))
        hits += told.low <= truth <= told.high
    assert 0.93 <= hits / rounds <= 0.97


def test_bootstrap_covers_the_truth(rng: Generator) -> None:
    hits, rounds = 0, 1200
    for _ in range(rounds):
        low, high = bootstrap(rng.normal(2.0, 1.0, 60), rng, resamples=1000)
        hits += low <= 2.0 <= high
    assert 0.93 <= hits / rounds <= 0.97


def test_no_difference_is_found_as_rarely_as_promised(rng: Generator) -> None:
    """p below 5 % in 5 % of the campaigns without a difference, for both tests."""
    p = np.array(
        [(t.p_t, t.p_wilcoxon) for t in (paired(rng.normal(size=15), rng.normal(size=15)) for _ in range(2000))]
    )
    share = (p <= 0.05).mean(axis=0)
    assert ((share > 0.035) & (share < 0.065)).all(), share


def test_pairing_finds_what_single_runs_hide(rng: Generator) -> None:
    """5 mm of difference under 19 mm of common spread."""
    common = rng.normal(0.25, 0.019, 60)
    told = paired(common - 0.005 + rng.normal(0, 0.003, 60), common, rng=rng)
    assert told.p_t < 1e-6 and told.high < 0 and told.boot_high < 0 and told.wins > 0.8 and told.effect < -1
    assert stats.ttest_ind(common - 0.005, common).pvalue > 0.05


@given(
    st.lists(st.floats(-1e6, 1e6, allow_subnormal=False), min_size=2, max_size=30),
    st.floats(0.01, 100),
    st.floats(-1e3, 1e3),
)
def test_laws(values: list[float], scale: float, shift: float) -> None:
    """Exchanged, everything changes its sign; the unit and a common offset change nothing but the numbers' size."""
    b = np.array(values)
    a = b[::-1] + 1.0
    one, other = paired(a, b), paired(b, a)
    assert (one.mean, one.low, one.high) == pytest.approx((-other.mean, -other.high, -other.low), nan_ok=True)
    assert one.wins == pytest.approx(1 - other.wins) and one.p_wilcoxon == pytest.approx(other.p_wilcoxon)
    assert one.rank_effect == pytest.approx(-other.rank_effect)
    assert one.low <= one.mean <= one.high and 0 <= one.p_t <= 1 and 0 < one.p_wilcoxon <= 1
    inches = paired(scale * a, scale * b)
    assert inches.mean == pytest.approx(scale * one.mean, rel=1e-6, abs=1e-6 * scale)
    assert summary(b + shift).mean == pytest.approx(summary(b).mean + shift, rel=1e-9, abs=1e-6)


def test_too_little_to_say() -> None:
    for values, n in (([], 0), ([1.0], 1), ([float("nan"), inf, 2.0], 1)):
        s = summary(values)
        assert s.n == n and isnan(s.low) and isnan(s.sd) and s.lost == len(values) - n
    one = paired([1.0], [2.0])
    assert one.n == 1 and one.mean == -1.0 and isnan(one.p_t) and isnan(one.effect) and one.p_wilcoxon == 1.0
    none = paired([], [], rng=np.random.default_rng(0))
    assert none.n == 0 and isnan(none.mean) and isnan(none.wins) and isnan(none.boot_low)
    lost = paired([1.0, float("nan"), 3.0], [0.0, 1.0, inf])
    assert (lost.n, lost.lost) == (1, 2)


def test_the_same_and_the_constant() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        same = paired([1.0, 2.0, 3.0], [1.0, 2.0, 3.0], rng=np.random.default_rng(0))
        apart = paired([2.0] * 6, [1.0] * 6, rng=np.random.default_rng(0))
    assert (same.p_t, same.p_wilcoxon, same.wins, same.effect, same.boot_low) == (1.0, 1.0, 0.5, 0.0, 0.0)
    assert (apart.p_t, apart.wins, apart.effect, apart.low, apart.high) == (0.0, 0.0, inf, 1.0, 1.0)
    assert apart.p_wilcoxon == pytest.approx(2 / 2**6)


def test_the_same_generator_gives_the_same_bits() -> None:
    d = np.random.default_rng(0).normal(size=33)
    assert bootstrap(d, np.random.default_rng(5)) == bootstrap(d, np.random.default_rng(5))
    assert bootstrap(d, np.random.default_rng(5)) != bootstrap(d, np.random.default_rng(6))


def test_refusals() -> None:
    with pytest.raises(UsageError, match="3 values cannot be paired with 2"):
        paired([1, 2, 3], [1, 2])
    with pytest.raises(UsageError, match="confidence 95"):
        summary([1, 2], confidence=95)
    with pytest.raises(UsageError, match="holm, bonferroni or sidak"):
        corrected([0.1], "none")


def test_corrections() -> None:
    """Holm's worked example, and against what SciPy and the definitions say."""
    np.testing.assert_allclose(corrected([0.01, 0.04, 0.03, 0.005]), [0.03, 0.06, 0.06, 0.02])
    np.testing.assert_allclose(corrected([0.01, 0.4, np.nan], "bonferroni"), [0.02, 0.8, np.nan])
    np.testing.assert_allclose(corrected([0.01, 1.0], "sidak"), [1 - 0.99**2, 1.0])
    assert corrected([]).size == 0


@pytest.mark.parametrize("method", ["holm", "bonferroni", "sidak"])
def test_the_family_errs_as_rarely_as_one_test(method: str, rng: Generator) -> None:
    p = rng.uniform(size=(4000, 8))
    wrong = np.mean([(corrected(row, method) <= 0.05).any() for row in p])
    assert 0.035 < wrong < 0.062


@given(st.lists(st.floats(0, 1), min_size=1, max_size=12))
def test_corrections_keep_the_order(p: list[float]) -> None:
    holm, bonferroni = corrected(p), corrected(p, "bonferroni")
    assert (holm >= np.array(p)).all() and (holm <= bonferroni).all() and (holm <= 1).all()
    order = np.argsort(p, kind="stable")
    assert (np.diff(holm[order]) >= 0).all()


def test_light() -> None:
    """`scipy.stats` takes long to import and is not needed."""
    code = "import sys, outrider.eval; print('scipy.stats' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "False\n"
