"""Frames: attitudes one can check by hand, determinants, and there and back."""

import subprocess
import sys
from math import pi

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from outrider.core import frames
from outrider.core.rotations import quats_to_rpy

NED_TO_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
FRD_TO_FLU = np.diag([1.0, -1.0, -1.0])


def test_vectors() -> None:
    assert_array_equal(frames.ned_to_enu([1.0, 2.0, 3.0]), [2.0, 1.0, -3.0])
    assert_array_equal(frames.frd_to_flu([1.0, 2.0, 3.0]), [1.0, -2.0, -3.0])
    for change in (frames.ned_to_enu, frames.enu_to_ned, frames.frd_to_flu, frames.flu_to_frd):
        assert np.linalg.det(change(np.eye(3))) == pytest.approx(1.0)  # handedness survives


# azimuth, nose up, right wing down (all as a pilot says them, degrees) -> yaw, pitch, roll in ENU/FLU
ATTITUDES = {
    "level, facing north": ((0, 0, 0), (90, 0, 0)),
    "level, facing east": ((90, 0, 0), (0, 0, 0)),
    "level, facing south": ((180, 0, 0), (-90, 0, 0)),
    "level, facing west": ((-90, 0, 0), (180, 0, 0)),
    "nose up is a negative pitch in FLU": ((90, 10, 0), (0, -10, 0)),
    "right wing down is a positive roll in both": ((0, 0, 20), (90, 0, 20)),
    "all three": ((30, 10, 20), (60, -10, 20)),
}


@pytest.mark.parametrize("name", ATTITUDES)
def test_attitudes_checked_by_hand(name: str) -> None:
    ned, (yaw, pitch, roll) = ATTITUDES[name]
    q = frames.quat_ned_frd_to_enu_flu(Rotation.from_euler("ZYX", ned, degrees=True).as_quat())
    difference = quats_to_rpy(q) - np.radians([roll, pitch, yaw])
    assert_allclose(np.exp(1j * difference), 1.0, rtol=0, atol=1e-12)


def test_attitudes_against_matrices(rng: np.random.Generator) -> None:
    q = rng.normal(size=(5, 4, 4))
    q /= np.linalg.norm(q, axis=-1, keepdims=True)
    ours = frames.quat_ned_frd_to_enu_flu(q)
    expected = NED_TO_ENU @ Rotation.from_quat(q.reshape(-1, 4)).as_matrix() @ FRD_TO_FLU.T
    assert_allclose(Rotation.from_quat(ours.reshape(-1, 4)).as_matrix(), expected, rtol=0, atol=1e-14)
    assert_allclose(frames.quat_enu_flu_to_ned_frd(ours), q, rtol=0, atol=1e-15)


def test_covariances(rng: np.random.Generator) -> None:
    A = rng.normal(size=(6, 3, 3))
    P = A @ A.swapaxes(-1, -2)
    assert_allclose(frames.cov_ned_to_enu(P), NED_TO_ENU @ P @ NED_TO_ENU.T, rtol=1e-15)
    assert_allclose(frames.cov_frd_to_flu(P), FRD_TO_FLU @ P @ FRD_TO_FLU.T, rtol=1e-15)
    assert_array_equal(frames.cov_ned_to_enu(frames.cov_ned_to_enu(P)), P)


@pytest.mark.parametrize("shape", [(3,), (7, 3), (2, 5, 3), (0, 3)])
def test_there_and_back_in_any_shape(shape: tuple[int, ...], rng: np.random.Generator) -> None:
    v = rng.normal(size=shape)
    assert_array_equal(frames.enu_to_ned(frames.ned_to_enu(v)), v)
    assert_array_equal(frames.flu_to_frd(frames.frd_to_flu(v)), v)
    q = rng.normal(size=(*shape[:-1], 4))
    assert_array_equal(frames.xyzw_to_wxyz(frames.wxyz_to_xyzw(q)), q)


def test_where_w_stands() -> None:
    assert_array_equal(frames.wxyz_to_xyzw([1.0, 2.0, 3.0, 4.0]), [2.0, 3.0, 4.0, 1.0])
    assert_array_equal(frames.xyzw_to_wxyz([1.0, 2.0, 3.0, 4.0]), [4.0, 1.0, 2.0, 3.0])


@pytest.mark.parametrize(("azimuth", "heading"), [(0, 90), (90, 0), (180, -90), (270, 180), (359, 91), (-10, 100)])
def test_compass(azimuth: float, heading: float) -> None:
    assert_allclose(frames.heading_from_azimuth(np.radians(azimuth)), np.radians(heading), rtol=0, atol=1e-14)
    back = frames.azimuth_from_heading(np.radians([heading]))
    assert_allclose(np.exp(1j * back), np.exp(1j * np.radians(azimuth)), rtol=0, atol=1e-14)
    assert -pi < back[0] <= pi


def test_readers_of_logs_need_no_compiler() -> None:
    """These modules are imported by every command; the compiler takes a second to load."""
    code = "import sys, outrider.core.frames, outrider.core.geodesy, outrider.core.magnetism, outrider.core.sampling\n"
    subprocess.run([sys.executable, "-c", code + "sys.exit('numba' in sys.modules)"], check=True)
