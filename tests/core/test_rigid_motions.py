"""SE(2) and SE(3): one list of laws for both groups; the matrix exponential is the independent oracle."""

from collections.abc import Callable
from math import pi
from types import ModuleType
from typing import Final, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.linalg import expm
from scipy.spatial.transform import Rotation
from scipy.special import factorial, zeta

from outrider.core import se2, se3
from outrider.typing import Floats


class Group(NamedTuple):
    """How to reach one group's kernels and its matrices."""

    kernels: ModuleType
    pose: int  # numbers in a pose
    n: int  # degrees of freedom; the last `turns` of them are the rotation
    turns: int
    hat: Callable[[Floats], Floats]
    matrix: Callable[[Floats], Floats]

    def call(self, name: str, *args: Floats) -> Floats:
        """What a kernel writes over rubbish."""
        shapes = {"log": (self.n,), "act": (self.n - self.turns,), "exp": (self.pose,), "compose": (self.pose,)}
        out = np.full(shapes.get(name, (self.pose,) if name == "inverse" else (self.n, self.n)), 1e9)
        getattr(self.kernels, name)(*args, out)
        return out


def hat2(xi: Floats) -> Floats:
    return np.array([[0.0, -xi[2], xi[0]], [xi[2], 0.0, xi[1]], [0.0, 0.0, 0.0]])


def hat3(xi: Floats) -> Floats:
    x, y, z = xi[3:]
    return np.array([[0.0, -z, y, xi[0]], [z, 0.0, -x, xi[1]], [-y, x, 0.0, xi[2]], [0.0, 0.0, 0.0, 0.0]])


def matrix2(pose: Floats) -> Floats:
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.array([[c, -s, pose[0]], [s, c, pose[1]], [0.0, 0.0, 1.0]])


def matrix3(pose: Floats) -> Floats:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.from_quat(pose[3:]).as_matrix(), pose[:3]
    return T


GROUPS: Final = {
    "SE(2)": Group(se2, 3, 3, 1, hat2, matrix2),
    "SE(3)": Group(se3, 7, 6, 3, hat3, matrix3),
}
groups = pytest.mark.parametrize("name", GROUPS)
relaxed = settings(derandomize=True, max_examples=40)

turns = st.one_of(
    st.sampled_from([0.0, 1e-200, 1e-9, 1e-4, 0.2999, 0.3001, pi - 1e-3, pi - 1e-8]),
    st.floats(0.0, pi - 1e-8),
    st.floats(-9.0, -0.01).map(lambda e: 10.0**e),
)
seeds = st.integers(0, 10_000)


def tangent(group: Group, seed: int, turn: float) -> Floats:
    """A random direction with the given angle of rotation and metres of translation."""
    xi = np.random.default_rng(seed).normal(size=group.n)
    part = xi[-group.turns :]
    xi[-group.turns :] = part / np.linalg.norm(part) * turn
    return xi


@groups
@relaxed
@given(seeds, turns)
def test_exp_is_the_matrix_exponential_and_log_undoes_it(name: str, seed: int, turn: float) -> None:
    group = GROUPS[name]
    xi = tangent(group, seed, turn)
    pose = group.call("exp", xi)
    assert_allclose(group.matrix(pose), expm(group.hat(xi)), rtol=0, atol=1e-13)
    assert_allclose(group.call("log", pose), xi, rtol=1e-13, atol=1e-14)


@groups
@relaxed
@given(seeds, turns, turns)
def test_group_laws(name: str, seed: int, turn: float, other: float) -> None:
    group = GROUPS[name]
    a, b = group.call("exp", tangent(group, seed, turn)), group.call("exp", tangent(group, seed + 1, other))
    T_a, T_b = group.matrix(a), group.matrix(b)
    p = np.arange(1.0, group.n - group.turns + 1)
    assert_allclose(group.matrix(group.call("compose", a, b)), T_a @ T_b, rtol=0, atol=1e-14)
    assert_allclose(group.matrix(group.call("inverse", a)), np.linalg.inv(T_a), rtol=0, atol=1e-14)
    assert_allclose(group.call("act", a, p), (T_a @ np.append(p, 1.0))[:-1], rtol=0, atol=1e-14)
    assert_allclose(group.call("log", group.call("compose", a, group.call("inverse", a))), 0.0, rtol=0, atol=1e-14)


@groups
@relaxed
@given(seeds, turns)
def test_the_adjoint_carries_a_tangent_across(name: str, seed: int, turn: float) -> None:
    group = GROUPS[name]
    pose, xi = group.call("exp", tangent(group, seed, turn)), tangent(group, seed + 1, 0.7)
    T = group.matrix(pose)
    across = group.call("adjoint", pose) @ xi
    assert_allclose(group.hat(across), T @ group.hat(xi) @ np.linalg.inv(T), rtol=0, atol=1e-13)


@groups
@relaxed
@given(seeds, turns)
def test_jacobians_against_finite_differences(name: str, seed: int, turn: float) -> None:
    group, h = GROUPS[name], 1e-6
    xi = tangent(group, seed, turn)
    right, left = group.call("right_jacobian", xi), group.call("left_jacobian", xi)
    here_inverse = np.linalg.inv(expm(group.hat(xi)))
    for i, d in enumerate(np.eye(group.n) * h):
        slope = (expm(group.hat(xi + d)) - expm(group.hat(xi - d))) / (2 * h)
        assert_allclose(group.hat(right[:, i]), here_inverse @ slope, rtol=0, atol=1e-8)
        assert_allclose(group.hat(left[:, i]), slope @ here_inverse, rtol=0, atol=1e-8)


@groups
@relaxed
@given(seeds, turns)
def test_jacobians_and_their_inverses(name: str, seed: int, turn: float) -> None:
    group = GROUPS[name]
    xi = tangent(group, seed, turn)
    right, left = group.call("right_jacobian", xi), group.call("left_jacobian", xi)
    assert_allclose(group.call("right_jacobian_inverse", xi) @ right, np.eye(group.n), rtol=0, atol=3e-14)
    assert_allclose(group.call("left_jacobian_inverse", xi) @ left, np.eye(group.n), rtol=0, atol=3e-14)
    assert_allclose(left, group.call("adjoint", group.call("exp", xi)) @ right, rtol=0, atol=3e-14)  # Jl = Ad Jr


@groups
@pytest.mark.parametrize("side", ["left_jacobian", "left_jacobian_inverse", "right_jacobian_inverse"])
def test_nothing_jumps_where_series_and_closed_form_meet(name: str, side: str) -> None:
    group = GROUPS[name]
    below, above = (group.call(side, tangent(group, 5, 0.3 * s)) for s in (1 - 1e-14, 1 + 1e-14))
    assert_allclose(below, above, rtol=0, atol=3e-14)


@pytest.mark.parametrize("t", [0.0, 1e-9, 1e-3, 0.1, 0.2, 0.29, 0.2999, 0.3001, 0.5, 2.0, 3.1])
def test_slopes_against_long_series(t: float) -> None:
    k, t2 = np.arange(1, 29), t * t
    terms = 2 * k * (-1.0) ** k * t2 ** (k - 1)
    expected = [np.sum(terms / factorial(2 * k + n)) for n in (2, 3)]
    assert_allclose(se3._sine_slopes(t2)[2:], expected, rtol=3e-12 if t > 0.3 else 1e-15)
    expected_g = np.sum(4 * k * zeta(2 * k + 2) / (2 * pi) ** (2 * k + 2) * t2 ** (k - 1))
    assert_allclose(se3._cotangent_slope(t2), expected_g, rtol=0, atol=1e-13 if t > 0.3 else 1e-15)


@groups
def test_outputs_may_be_inputs(name: str) -> None:
    group = GROUPS[name]
    a, b = group.call("exp", tangent(group, 1, 1.0)), group.call("exp", tangent(group, 2, 2.0))
    product, inverse = group.call("compose", a, b), group.call("inverse", a)
    for first, second in ((a.copy(), b), (a, b.copy())):
        out = first if first is not a else second
        group.kernels.compose(first, second, out)
        assert np.array_equal(out, product)
    group.kernels.inverse(a, a)
    assert np.array_equal(a, inverse)


def test_a_quarter_circle() -> None:
    """One metre of radius, a quarter turn to the left: it ends one ahead and one to the left."""
    pose = GROUPS["SE(2)"].call("exp", np.array([pi / 2, 0.0, pi / 2]))
    assert_allclose(pose, [1.0, 1.0, pi / 2], rtol=0, atol=1e-15)
