"""Alignment of an estimate onto a reference. Off by default: a georeferenced error must not be aligned away."""

from dataclasses import dataclass, replace
from enum import Enum
from typing import final

import numpy as np

from outrider.core.rotations import matrices_to_quats, quats_multiply
from outrider.data import Trajectory
from outrider.errors import DataError
from outrider.eval.associate import Association
from outrider.typing import Floats


class Alignment(Enum):
    """Which motion may be taken out before errors are counted; the value says it."""

    NONE = "none"
    YAW = "yaw and translation"
    SE2 = "yaw and horizontal translation"
    SE3 = "rotation and translation"
    SIM3 = "rotation, translation and scale"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Similarity:
    """x' = scale R x + p;  R (3, 3), p (3,) m."""

    R: Floats
    p: Floats
    scale: float = 1.0

    def apply(self, x: Trajectory) -> Trajectory:
        """The trajectory moved as a whole: positions, attitudes, velocities; covariances of position rotate."""
        unturned = bool(np.array_equal(self.R, np.eye(3)))
        q = x.q if unturned else quats_multiply(matrices_to_quats(self.R), x.q)
        T = np.eye(6)
        M = T[:3, :3] = self.scale * self.R  # the attitude's error is in the body and stays
        return replace(x, p=x.p @ M.T + self.p, q=q, v=x.v @ M.T, P=T @ x.P @ T.T)


def align(pairs: Association, how: Alignment) -> tuple[Association, Similarity]:
    """Least-squares fit of the estimate onto the reference by position (Umeyama 1991; scale only on request).

    Raises DataError where positions do not fix it: fewer than three, all in one place, or in one line for a rotation
    in space.
    """
    if how is Alignment.NONE:
        return pairs, Similarity(R=np.eye(3), p=np.zeros(3))
    if len(pairs) < 3:
        raise DataError(f"{len(pairs)} common stamps do not fix an alignment", fix="compare without alignment")
    x, y = pairs.estimate.p - (mean := pairs.estimate.p.mean(axis=0)), pairs.reference.p
    y = y - (target := y.mean(axis=0))
    planar = how in (Alignment.SE2, Alignment.YAW)
    _ensure_fixed(x, y, planar=planar)
    R = _rotation(x, y, planar=planar)
    scale = float(np.sum(y * (x @ R.T)) / np.sum(x * x)) if how is Alignment.SIM3 else 1.0
    p = target - scale * R @ mean
    if how is Alignment.SE2:
        p[2] = 0.0
    motion = Similarity(R=R, p=p, scale=scale)
    return replace(pairs, estimate=motion.apply(pairs.estimate)), motion


def _ensure_fixed(x: Floats, y: Floats, *, planar: bool) -> None:
    """Refuse positions, already centred, that leave the rotation open."""
    axes = 2 if planar else 3
    needed = 1 if planar else 2
    for points in (x, y):
        spread = np.linalg.svd(points[:, :axes], compute_uv=False)
        if not spread[needed - 1] > 1e-6 * max(float(spread[0]), 1e-6):
            what = "stand in one place" if needed == 1 or not spread[0] > 1e-9 else "lie on one line"
            raise DataError(f"the positions {what}: they do not fix an alignment", fix="compare without alignment")


def _rotation(x: Floats, y: Floats, *, planar: bool) -> Floats:
    """R (3, 3) that minimises sum |y - R x|^2 over all rotations, or over those about the vertical."""
    if planar:
        sine, cosine = np.sum(x[:, 0] * y[:, 1] - x[:, 1] * y[:, 0]), np.sum(x[:, :2] * y[:, :2])
        a = np.arctan2(sine, cosine)
        return np.array([[np.cos(a), -np.sin(a), 0.0], [np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]])
    U, _, Vt = np.linalg.svd(y.T @ x)
    return U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
