"""Association, alignment and errors against formulas written independently."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.core.rotations import quats_to_matrices, rpy_to_quats
from outrider.data import Trajectory
from outrider.errors import DataError
from outrider.eval import (
    Alignment,
    Similarity,
    align,
    associate,
    compare,
    heading_errors,
    pose_errors,
    position_errors,
    relative_errors,
    statistics,
    velocity_errors,
)

T0 = 1_750_000_000_000_000_000


def winding(n: int = 200, rate: float = 10.0, start: float = 0.0) -> Trajectory:
    """A helix of 5 m radius, with exact velocities and level attitude along it."""
    s = start + np.arange(n) / rate
    p = np.column_stack([5 * np.cos(0.4 * s), 5 * np.sin(0.4 * s), 0.3 * s])
    v = np.column_stack([-2 * np.sin(0.4 * s), 2 * np.cos(0.4 * s), np.full(n, 0.3)])
    yaw = np.arctan2(v[:, 1], v[:, 0])
    q = rpy_to_quats(np.column_stack([np.zeros(n), np.zeros(n), yaw]))
    return Trajectory(t=T0 + np.rint(s * 1e9).astype(np.int64), p=p, q=q, v=v, name="helix")


def noisy(x: Trajectory, sigma: float = 0.3, seed: int = 0) -> Trajectory:
    return replace(x, p=x.p + np.random.default_rng(seed).normal(0, sigma, x.p.shape))


# Association


def test_equal_stamps_are_taken_as_they_are():
    truth = winding()
    pairs = associate(noisy(truth), truth, max_gap_s=0.01)  # a hit is no gap, however coarse the estimate
    assert len(pairs) == len(truth) and not any(pairs.lost.values())
    np.testing.assert_array_equal(pairs.estimate.p, noisy(truth).p)


def test_between_stamps_the_estimate_is_interpolated():
    fine, coarse = winding(191, 100.0, start=0.05), winding(40, 10.0)
    pairs = associate(coarse, fine)
    assert len(pairs) == 191
    np.testing.assert_allclose(pairs.estimate.p, fine.p, atol=2e-3)
    np.testing.assert_allclose(pairs.estimate.v, fine.v, atol=1e-3)
    np.testing.assert_allclose(heading_errors(pairs), 0.0, atol=1e-6)  # constant turn: SLERP is exact


def test_every_loss_has_its_reason():
    reference = winding(100, 10.0)
    reference = replace(reference, valid=np.arange(100) != 50)
    reference.p[51] = np.nan
    estimate = winding(100, 10.0, start=1.05)  # ends at 10.95
    keep = np.ones(100, np.bool_)
    keep[20:40] = False  # 3.05 .. 5.00 missing: 3.0 to 5.0 lie in the gap
    estimate = Trajectory(t=estimate.t[keep], p=estimate.p[keep], q=estimate.q[keep], valid=np.arange(80) != 79)
    pairs = associate(estimate, replace(reference, t=reference.t + 2_000_000_000), max_gap_s=0.5)
    assert pairs.lost == {
        "reference not finite": 1,
        "reference declared invalid": 1,
        "before the estimate": 0,
        "after the estimate": 10,
        "in a gap longer than 0.5 s": 21,
        "estimate declared invalid": 1,
        "estimate not finite": 0,
    }
    assert len(pairs) + sum(pairs.lost.values()) == 100


def test_nothing_is_extrapolated():
    truth = winding(100)
    pairs = associate(winding(50, start=3.0), truth)
    assert pairs.reference.t[0] >= T0 + 3_000_000_000 and pairs.reference.t[-1] <= T0 + 7_900_000_000
    assert pairs.lost["before the estimate"] == 30 and pairs.lost["after the estimate"] == 20


def test_unknown_headings_stay_unknown():
    truth = winding(50)
    q = truth.q.copy()
    q[10:20] = np.nan
    pairs = associate(replace(truth, q=q), winding(40, 10.0, start=0.05))
    assert np.array_equal(np.isnan(heading_errors(pairs)), (np.arange(40) >= 9) & (np.arange(40) < 20))
    assert statistics(heading_errors(pairs)).n == 29


@settings(max_examples=30, derandomize=True)
@given(st.lists(st.integers(0, 4_000), min_size=1, max_size=30, unique=True), st.integers(1, 1500))
def test_association_never_invents(stamps, gap_ms):
    truth = winding(40)
    t = np.sort(np.array(stamps, np.int64)) * 1_000_000
    estimate = Trajectory(t=T0 + t, p=np.column_stack([t * 1e-9] * 3), q=np.tile([0.0, 0, 0, 1], (t.size, 1)))
    pairs = associate(estimate, truth, max_gap_s=gap_ms * 1e-3)
    assert len(pairs) + sum(pairs.lost.values()) == 40
    for k, at in enumerate((pairs.reference.t - T0).tolist()):
        before, after = t[t <= at].max(), t[t >= at].min()  # raises if extrapolated
        assert after - before <= gap_ms * 1_000_000
        np.testing.assert_allclose(pairs.estimate.p[k], at * 1e-9, atol=1e-12)


# Alignment


def umeyama(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """R, t of Umeyama (1991), eqs. 38-42, without scale; written from the paper."""
    mx, my = x.mean(0), y.mean(0)
    cov = sum(np.outer(b - my, a - mx) for a, b in zip(x, y, strict=True)) / len(x)
    U, _, Vt = np.linalg.svd(cov)
    S = np.eye(x.shape[1])
    if np.linalg.det(U) * np.linalg.det(Vt) < 0:
        S[-1, -1] = -1
    R = U @ S @ Vt
    return R, my - R @ mx


def test_full_alignment_is_umeyamas():
    truth = winding()
    turn = quats_to_matrices(rpy_to_quats(np.array([0.3, -1.1, 2.5])))
    estimate = Similarity(R=turn, p=np.array([10.0, -4.0, 3.0])).apply(noisy(truth))
    pairs, motion = align(associate(estimate, truth), Alignment.SE3)
    R, t = umeyama(estimate.p, truth.p)
    np.testing.assert_allclose(motion.R, R, atol=1e-9)
    np.testing.assert_allclose(motion.p, t, atol=1e-9)
    ate = np.sqrt(np.mean(np.sum((estimate.p @ R.T + t - truth.p) ** 2, axis=1)))
    assert statistics(position_errors(pairs)).rmse == pytest.approx(ate, rel=1e-9)


def test_planar_alignment_is_umeyamas_in_the_plane():
    truth = winding()
    turn = quats_to_matrices(rpy_to_quats(np.array([0.0, 0.0, 2.5])))
    estimate = Similarity(R=turn, p=np.array([10.0, -4.0, 3.0])).apply(noisy(truth))
    R, t = umeyama(estimate.p[:, :2], truth.p[:, :2])
    for how in (Alignment.SE2, Alignment.YAW):
        pairs, motion = align(associate(estimate, truth), how)
        np.testing.assert_allclose(motion.R[:2, :2], R, atol=1e-9)
        np.testing.assert_allclose(motion.p[:2], t, atol=1e-9)
        height = position_errors(pairs)[:, 2].mean()
        assert height == pytest.approx(3.0 if how is Alignment.SE2 else 0.0, abs=0.1)


def test_alignment_of_a_mirrored_path_is_still_a_rotation():
    flat = winding(60)
    mirrored = replace(flat, p=flat.p * [1.0, 1.0, -1.0])
    _, motion = align(associate(mirrored, flat), Alignment.SE3)
    assert np.linalg.det(motion.R) == pytest.approx(1.0)


def test_alignment_takes_attitude_velocity_and_covariance_along():
    truth = replace(winding(), P=np.tile(np.diag([1.0, 4.0, 9.0, 0.1, 0.2, 0.3]), (200, 1, 1)))
    turn = Similarity(R=quats_to_matrices(rpy_to_quats(np.array([0.0, 0.0, np.pi / 2]))), p=np.array([1.0, 2.0, 3.0]))
    moved = turn.apply(truth)
    np.testing.assert_allclose(np.diag(moved.P[0]), [4.0, 1.0, 9.0, 0.1, 0.2, 0.3])
    pairs, _ = align(associate(moved, truth), Alignment.SE3)
    np.testing.assert_allclose(pose_errors(pairs), 0.0, atol=1e-7)
    np.testing.assert_allclose(velocity_errors(pairs), 0.0, atol=1e-9)


def test_two_points_fix_no_alignment():
    with pytest.raises(DataError, match="do not fix"):
        align(associate(winding(2), winding(2)), Alignment.SE2)


# Errors


def test_statistics_by_hand():
    s = statistics(np.array([3.0, -4.0, np.nan, 0.0, 5.0]))
    assert (s.n, s.mean, s.median, s.max) == (4, 3.0, 3.5, 5.0)
    assert s.rmse == pytest.approx((50 / 4) ** 0.5) and s.p95 == pytest.approx(4.85)
    assert statistics(np.array([[3.0, 4.0], [0.0, 0.0]])).rmse == pytest.approx(12.5**0.5)
    assert statistics(np.full(3, np.nan)).n == 0


def test_heading_errors_cross_the_seam():
    truth = winding(80)
    n, yaw = 80, truth.yaw
    q = rpy_to_quats(np.column_stack([np.zeros(n), np.zeros(n), yaw + 0.2]))
    np.testing.assert_allclose(heading_errors(associate(replace(truth, q=q), truth)), 0.2, atol=1e-12)


def test_pose_errors_are_those_of_the_covariance():
    truth, n = winding(30), 30
    phi = np.array([0.02, -0.03, 0.05])
    R = quats_to_matrices(truth.q)
    angle = np.linalg.norm(phi)
    a = np.array([[0, -phi[2], phi[1]], [phi[2], 0, -phi[0]], [-phi[1], phi[0], 0]]) / angle
    step = np.eye(3) + np.sin(angle) * a + (1 - np.cos(angle)) * a @ a  # Rodrigues
    e = pose_errors(associate(truth, replace(truth, p=truth.p + np.array([1.0, 2.0, 3.0]), q=_quats(R @ step))))
    np.testing.assert_allclose(e, [[1, 2, 3, *phi]] * n, atol=1e-9)


def _quats(R: np.ndarray) -> np.ndarray:
    w = 0.5 * np.sqrt(1 + R[:, 0, 0] + R[:, 1, 1] + R[:, 2, 2])
    xyz = np.column_stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]])
    return np.column_stack([xyz / (4 * w[:, None]), w])


def test_relative_error_sees_drift_and_not_where_or_which_way():
    truth = winding(200)
    moved = Similarity(R=quats_to_matrices(rpy_to_quats(np.array([0.2, 0.1, 1.0]))), p=np.array([9.0, 9.0, 9.0])).apply(
        truth
    )
    p, angle = relative_errors(associate(moved, truth), 5.0)
    assert len(p) == 150
    np.testing.assert_allclose(p, 0.0, atol=1e-9)
    np.testing.assert_allclose(angle, 0.0, atol=1e-7)
    grown = replace(truth, p=truth.p * [1.1, 1.1, 1.0])  # a scale error: 10 % of the chord
    p, _ = relative_errors(associate(grown, truth), 5.0)
    chord = np.linalg.norm(truth.p[50:, :2] - truth.p[:-50, :2], axis=1)
    np.testing.assert_allclose(np.linalg.norm(p, axis=1), 0.1 * chord, atol=1e-9)


# Comparison

OFF = np.array([3.0, 4.0, 0.0])


def test_comparison_hides_no_constant_offset():
    truth = winding()
    off = compare(replace(truth, p=truth.p + OFF), truth)
    assert off.position_2d.rmse == pytest.approx(5.0) and off.relative.rmse == pytest.approx(0.0, abs=1e-9)
    aligned = compare(replace(truth, p=truth.p + OFF), truth, alignment=Alignment.SE2)
    assert aligned.position_2d.rmse == pytest.approx(0.0, abs=1e-9)


def test_comparison_is_plain_json():
    truth = winding()
    told = compare(replace(truth, v=np.zeros((0, 3))), truth).as_dict()
    plain = json.loads(json.dumps(told, allow_nan=False))
    assert plain["schema"] == "outrider.comparison/2" and plain["alignment"] == "none"
    assert plain["velocity"]["n"] == 0 and plain["velocity"]["rmse"] is None and plain["nees"] is None
    assert plain["matched"] == plain["of"] == 200 and plain["lost"] == {}


def test_comparison_weighs_errors_by_the_covariance():
    truth, rng = winding(400), np.random.default_rng(0)
    L = np.array([[0.5, 0.0], [0.3, 0.2]])
    p = truth.p.copy()
    p[:, :2] += rng.standard_normal((400, 2)) @ L.T
    P = np.zeros((400, 6, 6))
    P[:] = np.eye(6)
    P[:, :2, :2] = L @ L.T
    honest = compare(replace(truth, p=p, P=P), truth)
    assert honest.nees == pytest.approx(1.0, abs=0.15) and honest.coverage == pytest.approx(0.95, abs=0.03)
    boastful = compare(replace(truth, p=p, P=P / 9), truth)
    assert boastful.nees == pytest.approx(9 * honest.nees) and boastful.coverage < 0.6


def test_different_clocks_are_named():
    with pytest.raises(DataError, match=r"200 after the estimate.*same clock"):
        compare(winding(), replace(winding(), t=winding().t + 10**15))
    with pytest.raises(DataError, match="without poses"):
        compare(winding(0), winding())
