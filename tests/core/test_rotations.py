"""SO(3): scipy's Rotation is the independent oracle; laws are drawn near identity, near pi and in between."""

from collections.abc import Callable
from math import pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation, Slerp
from scipy.special import factorial, zeta

from outrider.core import rotations as rot
from outrider.core.attitudes import quat_of_matrix
from outrider.typing import Floats

relaxed = settings(derandomize=True, max_examples=60)

unit = st.floats(-1.0, 1.0, allow_nan=False)
directions = st.tuples(unit, unit, unit).map(np.array).filter(lambda v: np.linalg.norm(v) > 1e-2)
angles = st.one_of(
    st.sampled_from([0.0, 1e-300, 1e-12, 1e-5, 0.99e-4, 1.01e-4, 0.2999, 0.3001, pi - 1e-3, pi - 1e-9, pi - 1e-15]),
    st.floats(0.0, pi - 1e-15),
    st.floats(-9.0, -0.01).map(lambda e: 10.0**e),
    st.floats(-12.0, -1.0).map(lambda e: pi - 10.0**e),
)


@st.composite
def vectors(draw: st.DrawFn) -> Floats:
    """Rotation vectors shorter than pi, with plenty at the two ends."""
    d = draw(directions)
    return d / np.linalg.norm(d) * draw(angles)


def filled(kernel: Callable[..., None], *args: object, shape: tuple[int, ...]) -> Floats:
    """What a kernel writes, starting from rubbish: an element it forgets stays rubbish."""
    out = np.full(shape, 1e9)
    kernel(*args, out)
    return out


def quat(phi: Floats) -> Floats:
    return filled(rot.quat_exp, phi, shape=(4,))


def matrix(phi: Floats) -> Floats:
    return filled(rot.so3_exp, phi, shape=(3, 3))


@relaxed
@given(vectors())
def test_exp_and_log_agree_with_scipy(phi: Floats) -> None:
    oracle = Rotation.from_rotvec(phi)
    q, R = quat(phi), matrix(phi)
    assert_allclose(q, oracle.as_quat(), rtol=0, atol=1e-15)
    assert_allclose(R, oracle.as_matrix(), rtol=0, atol=1e-15)
    assert_allclose(filled(rot.matrix_from_quat, q, shape=(3, 3)), R, rtol=0, atol=1e-15)
    assert_allclose(filled(rot.quat_from_matrix, R, shape=(4,)), q, rtol=0, atol=1e-15)


@relaxed
@given(vectors())
def test_log_undoes_exp_to_the_last_digits(phi: Floats) -> None:
    assert_allclose(filled(rot.quat_log, quat(phi), shape=(3,)), phi, rtol=1e-14, atol=2e-15)
    assert_allclose(filled(rot.so3_log, matrix(phi), shape=(3,)), phi, rtol=1e-14, atol=3e-15)


@relaxed
@given(vectors())
def test_a_quaternion_and_its_negative_are_one_rotation(phi: Floats) -> None:
    q = quat(phi)
    for a in (q, 3.0 * q, np.append(q[:3], 0.0) if np.linalg.norm(q[:3]) > 0.1 else q):
        logs = filled(rot.quat_log, a, shape=(3,)), filled(rot.quat_log, -a, shape=(3,))
        assert np.array_equal(*logs)
        assert np.linalg.norm(logs[0]) <= pi * (1 + 1e-15)


@pytest.mark.parametrize("axis", np.vstack((np.eye(3), -np.eye(3), [[0.6, -0.8, 0.0], [0.0, 0.6, 0.8]])))
def test_half_turns(axis: Floats) -> None:
    R = Rotation.from_rotvec(pi * axis).as_matrix()
    phi = filled(rot.so3_log, R, shape=(3,))
    assert_allclose(np.linalg.norm(phi), pi, rtol=1e-15)
    assert_allclose(matrix(phi), R, rtol=0, atol=1e-15)


def test_no_rotation_from_nothing() -> None:
    assert np.isnan(filled(rot.quat_log, np.zeros(4), shape=(3,))).all()
    q = np.zeros(4)
    rot.quat_normalize(q)
    assert np.isnan(q).all()


@relaxed
@given(vectors(), vectors(), vectors())
def test_group_laws(a: Floats, b: Floats, v: Floats) -> None:
    p, q = quat(a), quat(b)
    pq = filled(rot.quat_multiply, p, q, shape=(4,))
    assert_allclose(filled(rot.matrix_from_quat, pq, shape=(3, 3)), matrix(a) @ matrix(b), rtol=0, atol=2e-15)
    assert_allclose(filled(rot.rotate, p, v, shape=(3,)), matrix(a) @ v, rtol=0, atol=1e-14)
    assert_allclose(filled(rot.rotate_inverse, p, v, shape=(3,)), matrix(a).T @ v, rtol=0, atol=1e-14)
    assert_allclose(filled(rot.skew, a, shape=(3, 3)) @ v, np.cross(a, v), rtol=0, atol=1e-14)
    inverse = filled(rot.quat_conjugate, p, shape=(4,))
    assert_allclose(filled(rot.quat_multiply, p, inverse, shape=(4,)), [0, 0, 0, 1], rtol=0, atol=1e-15)
    assert_allclose(np.linalg.det(matrix(a)), 1.0, rtol=1e-14)


def test_outputs_may_be_inputs() -> None:
    p, q, v = quat(np.array([0.3, -1.0, 2.0])), quat(np.array([1.0, 0.1, -0.4])), np.array([1.0, 2.0, 3.0])
    expected = filled(rot.quat_multiply, p, q, shape=(4,)), filled(rot.rotate, p, v, shape=(3,))
    aliased = p.copy()
    rot.quat_multiply(aliased, q, aliased)
    rot.rotate(p, v, v)
    assert np.array_equal(aliased, expected[0])
    assert np.array_equal(v, expected[1])


@relaxed
@given(vectors())
def test_jacobians_against_finite_differences(phi: Floats) -> None:
    h = 1e-6
    right, left = filled(rot.right_jacobian, phi, shape=(3, 3)), filled(rot.left_jacobian, phi, shape=(3, 3))
    R = Rotation.from_rotvec(phi)
    for i, e in enumerate(np.eye(3) * h):
        ahead, behind = Rotation.from_rotvec(phi + e), Rotation.from_rotvec(phi - e)
        on_the_right = (R.inv() * ahead).as_rotvec() - (R.inv() * behind).as_rotvec()
        on_the_left = (ahead * R.inv()).as_rotvec() - (behind * R.inv()).as_rotvec()
        assert_allclose(right[:, i], on_the_right / (2 * h), rtol=0, atol=3e-9)
        assert_allclose(left[:, i], on_the_left / (2 * h), rtol=0, atol=3e-9)


@relaxed
@given(vectors())
def test_jacobians_and_their_inverses(phi: Floats) -> None:
    right, left = filled(rot.right_jacobian, phi, shape=(3, 3)), filled(rot.left_jacobian, phi, shape=(3, 3))
    assert_allclose(filled(rot.right_jacobian_inverse, phi, shape=(3, 3)) @ right, np.eye(3), rtol=0, atol=1e-14)
    assert_allclose(filled(rot.left_jacobian_inverse, phi, shape=(3, 3)) @ left, np.eye(3), rtol=0, atol=1e-14)
    assert_allclose(left, matrix(phi) @ right, rtol=0, atol=1e-14)  # Jl = Ad Jr
    assert_allclose(right @ phi, phi, rtol=0, atol=1e-14)


@pytest.mark.parametrize("t", [0.3, 1e-4])
@pytest.mark.parametrize("kernel", ["so3_exp", "right_jacobian", "right_jacobian_inverse", "left_jacobian", "quat_exp"])
def test_nothing_jumps_where_series_and_closed_form_meet(kernel: str, t: float) -> None:
    axis, shape = np.array([2.0, -1.0, 2.0]) / 3.0, (4,) if kernel == "quat_exp" else (3, 3)
    sides = [filled(getattr(rot, kernel), axis * t * s, shape=shape) for s in (1 - 1e-15, 1 + 1e-15)]
    assert_allclose(*sides, rtol=0, atol=1e-15)


@pytest.mark.parametrize("t", [0.0, 1e-9, 1e-3, 0.1, 0.2, 0.29, 0.2999, 0.3001, 0.5, 2.0, 3.1])
def test_coefficients_against_long_series(t: float) -> None:
    k, t2 = np.arange(30), t * t
    sign, power = (-1.0) ** k, t2**k
    expected = [np.sum(sign * power / factorial(2 * k + n)) for n in (1, 2, 3)]
    assert_allclose(rot.sines(t2), expected, rtol=2e-14 if t > 0.3 else 4e-16)
    expected_g = np.sum(2 * zeta(2 * k + 2) / (2 * pi) ** (2 * k + 2) * power)
    assert_allclose(rot.cotangent(t2), expected_g, rtol=1e-12 if t > 0.3 else 1e-15)


near_gimbal = st.sampled_from([-pi / 2, pi / 2, pi / 2 - 1e-6, 1e-6 - pi / 2])


@relaxed
@given(st.floats(-pi, pi), st.one_of(st.floats(-pi / 2, pi / 2), near_gimbal), st.floats(-pi, pi))
def test_roll_pitch_yaw(roll: float, pitch: float, yaw: float) -> None:
    q = filled(rot.quat_from_rpy, roll, pitch, yaw, shape=(4,))
    R = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()
    assert_allclose(filled(rot.matrix_from_quat, q, shape=(3, 3)), R, rtol=0, atol=1e-15)
    back = filled(rot.rpy_from_quat, q, shape=(3,))
    assert abs(back[1]) <= pi / 2
    assert_allclose(matrix_of_rpy(back), R, rtol=0, atol=2e-8 if abs(abs(pitch) - pi / 2) < 1e-7 else 1e-9)
    if abs(pitch) < 1.5:
        assert_allclose(np.exp(1j * back), np.exp(1j * np.array([roll, pitch, yaw])), rtol=0, atol=1e-13)
        assert_allclose(rot.yaw_of(q), back[2], rtol=0, atol=1e-14)


def matrix_of_rpy(rpy: Floats) -> Floats:
    return Rotation.from_euler("ZYX", rpy[::-1]).as_matrix()


def test_a_left_turn_is_positive() -> None:
    q = filled(rot.quat_from_rpy, 0.0, 0.0, pi / 2, shape=(4,))
    assert_allclose(filled(rot.rotate, q, np.array([1.0, 0.0, 0.0]), shape=(3,)), [0, 1, 0], rtol=0, atol=1e-15)
    assert rot.yaw_of(q) == pytest.approx(pi / 2)


def test_whole_arrays_equal_the_kernels_row_by_row(rng: np.random.Generator) -> None:
    phi = rng.normal(size=(40, 3)) * np.geomspace(1e-9, 1.5, 40)[:, None]
    rpy = rng.uniform(-1.5, 1.5, (40, 3))
    q, other = rot.quats_exp(phi), rot.rpy_to_quats(rpy)
    R = rot.quats_to_matrices(other)
    product, logs, back, rpys = (
        rot.quats_multiply(q, other),
        rot.quats_log(-q),
        rot.matrices_to_quats(R),
        rot.quats_to_rpy(other),
    )
    for i in range(40):
        assert_allclose(q[i], quat(phi[i]), rtol=0, atol=1e-15)
        assert_allclose(other[i], filled(rot.quat_from_rpy, *rpy[i], shape=(4,)), rtol=0, atol=1e-15)
        assert_allclose(R[i], filled(rot.matrix_from_quat, other[i], shape=(3, 3)), rtol=0, atol=1e-15)
        assert_allclose(product[i], filled(rot.quat_multiply, q[i], other[i], shape=(4,)), rtol=0, atol=1e-15)
        assert_allclose(logs[i], filled(rot.quat_log, -q[i], shape=(3,)), rtol=1e-13, atol=1e-16)
        assert_allclose(back[i], filled(rot.quat_from_matrix, R[i], shape=(4,)), rtol=0, atol=1e-15)
        assert_allclose(rpys[i], filled(rot.rpy_from_quat, other[i], shape=(3,)), rtol=0, atol=1e-14)
    assert_allclose(rot.quats_multiply(rot.quats_conjugate(q), q), np.tile([0, 0, 0, 1.0], (40, 1)), rtol=0, atol=1e-15)


@pytest.mark.parametrize("shape", [(), (2,), (2, 3)])
def test_any_leading_shape(shape: tuple[int, ...]) -> None:
    rpy = np.full((*shape, 3), 0.4)
    q = rot.rpy_to_quats(rpy)
    assert rot.quats_to_matrices(q).shape == (*shape, 3, 3)
    assert_allclose(rot.matrices_to_quats(rot.quats_to_matrices(q)), q)
    assert_allclose(rot.quats_to_rpy(q), rpy)
    assert_allclose(rot.quats_exp(rot.quats_log(q)), q)
    assert np.isnan(rot.quats_to_matrices(np.zeros((*shape, 4)))).all()


def test_arrays_know_the_hard_places() -> None:
    nose_up = rot.rpy_to_quats([0.3, pi / 2, 0.5])
    roll, pitch, yaw = rot.quats_to_rpy(nose_up)
    assert (roll, pitch) == (0.0, pytest.approx(pi / 2))
    assert yaw == pytest.approx(0.2)
    for axis in np.eye(3):
        assert_allclose(
            np.abs(rot.matrices_to_quats(Rotation.from_rotvec(pi * axis).as_matrix())[:3]), axis, rtol=0, atol=1e-15
        )
    assert_allclose(rot.quats_log([0.0, 0.0, 0.0, -2.0]), 0.0)


def test_slerp_agrees_with_scipy(rng: np.random.Generator) -> None:
    t0, q0 = np.array([0.0, 1.0, 1.5, 4.0]), Rotation.random(4, random_state=3).as_quat()
    t = np.sort(rng.uniform(0.0, 4.0, 50))
    q0[2] *= -1.0  # a sign flip must not send it the long way round
    expected = Slerp(t0, Rotation.from_quat(q0))(t).as_matrix()
    assert_allclose(rot.quats_to_matrices(rot.slerp(t, t0, q0)), expected, rtol=0, atol=1e-14)


def test_slerp_in_nanoseconds_holds_the_ends() -> None:
    start = 1_760_000_000_000_000_001
    q0 = rot.rpy_to_quats([[0, 0, 0.0], [0, 0, 1.0]])
    knots = np.array([start, start + 1000])
    yaw = rot.quats_to_rpy(rot.slerp(start + np.array([-5, 0, 250, 1000, 9999]), knots, q0))[:, 2]
    assert_allclose(yaw, [0, 0, 0.25, 1, 1], rtol=0, atol=1e-15)
    assert_allclose(rot.slerp([start, start], knots[:1], q0[:1]), q0[[0, 0]])
    assert np.isfinite(rot.slerp([start], [start, start, start], q0[[0, 1, 1]])).all()


def test_one_matrix_in_plain_numbers_is_the_same_to_the_last_bit(rng: np.random.Generator) -> None:
    q = rng.normal(size=(2000, 4))
    q[:100, 3] *= 1e-9
    R = np.concatenate(
        [rot.quats_to_matrices(q), [np.diag(d) for d in ([1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1])]]
    )
    np.testing.assert_array_equal([quat_of_matrix(one) for one in R], rot.matrices_to_quats(R))
    assert np.isnan(quat_of_matrix(np.full((3, 3), np.nan))).all()
