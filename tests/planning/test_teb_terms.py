"""Derivatives of every term of the band's cost, and of all of them together, against finite differences."""

import numpy as np
import pytest
from bases import BASES, situation, teb
from scipy.linalg import solveh_banded

from outrider.planning.local.banded import BAND, factor, solve
from outrider.planning.local.normal import assemble
from outrider.planning.local.problem import KNOT, workspace
from outrider.planning.local.terms import TERMS
from outrider.safety.clearance import around

FIELD = np.random.default_rng(3).uniform(0.0, 1.5, (8, 9))


def residual(name: str, v: np.ndarray) -> tuple[float, np.ndarray]:
    term, g = TERMS[name], np.full(12, np.nan)
    more = (FIELD,) if name == "mapped" else ()
    return term.residual(v, np.array(term.theta), term.a, g, *more), g[: term.size]


@pytest.mark.parametrize("name", TERMS)
def test_a_term_and_its_derivatives(name: str) -> None:
    rng, h, active = np.random.default_rng(7), 1e-6, 0
    for _ in range(60):
        v = rng.uniform(-1.5, 1.5, TERMS[name].size)
        r, g = residual(name, v)
        numeric = np.array([residual(name, v + h * e)[0] - residual(name, v - h * e)[0] for e in np.eye(v.size)]) / (
            2 * h
        )
        active += bool(np.abs(g).max() > 0.0)
        assert np.isfinite(r)
        np.testing.assert_allclose(g, numeric, atol=2e-7)
    assert active > 5


def everything(base: str):
    """A problem in which every term is active, and a crooked band."""
    rng, n = np.random.default_rng(1), 8
    now = situation((2.0, 1.0, 0.5), pose=(0.0, 0.0, 0.2), twist=np.array([0.1, 0.0, 0.05]))
    p = teb(BASES[base])._problem(now, around(now.surroundings, 1.2))
    p = p._replace(
        west=-0.5, south=-1.0, obstacles=np.array([[0.5, 0.4, 0.2, 0.1, -0.2], [1.5, 0.2, 0.1, 0.0, 0.0]]), horizon=1.2,
        wary=np.array([[0.9, 0.9, 0.1, 0.0, 0.0], [1.2, 0.1, 0.2, 0.0, 0.0]]),
        field=np.abs(rng.normal(size=(30, 30))) * 0.5, resolution=0.1,
    )  # fmt: skip
    z = np.zeros((n, KNOT))
    z[:, :3] = np.linspace(now.pose, now.goal, n) + rng.normal(size=(n, 3)) * [0.1, 0.1, 0.3]
    z[1:, 3] = np.cumsum(rng.uniform(0.15, 0.4, n - 1))
    return z, p


@pytest.mark.parametrize("base", BASES)
def test_the_gradient_of_the_whole_cost(base: str) -> None:
    z, p = everything(base)
    n, w = len(z), workspace(len(z))
    assemble(z, n, p, w.u, w.s, w.M[0], w.b[0])
    gradient, numeric, h = -2.0 * w.b[0, : KNOT * n], np.zeros(KNOT * n), 1e-6
    free = [i for i in range(KNOT, KNOT * n) if not KNOT * (n - 1) <= i < KNOT * n - 1]
    for i in free:
        d = np.zeros_like(z)
        d.flat[i] = h
        ends = [assemble(z + side * d, n, p, w.u, w.s, w.M[1], w.b[1]) for side in (1.0, -1.0)]
        numeric[i] = (ends[0] - ends[1]) / (2.0 * h)
    np.testing.assert_allclose(gradient, numeric, atol=2e-7 * np.abs(numeric).max())


def test_the_normal_matrix_is_that_of_the_residuals() -> None:
    """B is J' W J: positive semi-definite, and identity for what is given."""
    z, p = everything("car")
    n, w = len(z), workspace(len(z))
    assemble(z, n, p, w.u, w.s, w.M[0], w.b[0])
    A = dense(w.M[0], KNOT * n)
    assert np.linalg.eigvalsh(A).min() > -1e-9 * np.abs(A).max()
    given = [0, 1, 2, 3, KNOT * n - 4, KNOT * n - 3, KNOT * n - 2]
    assert (A[given] == np.eye(KNOT * n)[given]).all()


def dense(B: np.ndarray, n: int) -> np.ndarray:
    A = np.zeros((n, n))
    for j in range(n):
        for k in range(min(BAND, n - j)):
            A[j + k, j] = A[j, j + k] = B[j, k]
    return A


def test_banded_systems_are_solved_as_lapack_does(rng: np.random.Generator) -> None:
    n = 40
    B = np.zeros((n + BAND, BAND))
    B[:n] = rng.normal(size=(n, BAND))
    for j in range(n):
        B[j, max(n - j, 1) :] = 0.0
    B[:n, 0] = 30.0
    x = np.zeros(n + BAND)
    x[:n] = b = rng.normal(size=n)
    expected = solveh_banded(B[:n].T.copy(), b, lower=True)
    assert factor(B, n)
    solve(B, n, x)
    np.testing.assert_allclose(x[:n], expected, rtol=1e-10, atol=1e-12)


def test_a_matrix_that_is_not_positive_definite_is_refused() -> None:
    B = np.zeros((3 + BAND, BAND))
    B[:3, 0] = 1.0, -1.0, 1.0
    assert not factor(B, 3)
