"""Rigid alignment of an estimate onto a reference. Off by default: a georeferenced error must not be aligned away."""

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
    """Which rigid motion may be taken out before errors are counted; the value says it."""

    NONE = "none"
    SE2 = "yaw and horizontal translation"
    YAW = "yaw and translation"
    SE3 = "rotation and translation"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Rigid:
    """x' = R x + p;  R (3, 3), p (3,) m."""

    R: Floats
    p: Floats

    def apply(self, x: Trajectory) -> Trajectory:
        """The trajectory moved as a whole: positions, attitudes, velocities; covariances of position rotate."""
        unturned = bool(np.array_equal(self.R, np.eye(3)))
        q = x.q if unturned else quats_multiply(matrices_to_quats(self.R), x.q)
        T = np.eye(6)
        T[:3, :3] = self.R  # the attitude's error is in the body and stays
        return replace(x, p=x.p @ self.R.T + self.p, q=q, v=x.v @ self.R.T, P=T @ x.P @ T.T)


def align(pairs: Association, how: Alignment) -> tuple[Association, Rigid]:
    """Least-squares fit of the estimate onto the reference by position (Umeyama 1991, without scale)."""
    if how is Alignment.NONE:
        return pairs, Rigid(R=np.eye(3), p=np.zeros(3))
    if len(pairs) < 3:
        raise DataError(f"{len(pairs)} common stamps do not fix an alignment", fix="compare without alignment")
    x, y = pairs.estimate.p, pairs.reference.p
    R = _rotation(x - x.mean(axis=0), y - y.mean(axis=0), planar=how is not Alignment.SE3)
    p = y.mean(axis=0) - R @ x.mean(axis=0)
    if how is Alignment.SE2:
        p[2] = 0.0
    motion = Rigid(R=R, p=p)
    return replace(pairs, estimate=motion.apply(pairs.estimate)), motion


def _rotation(x: Floats, y: Floats, *, planar: bool) -> Floats:
    """R (3, 3) that minimises sum |y - R x|^2 over all rotations, or over those about the vertical."""
    if planar:
        sine, cosine = np.sum(x[:, 0] * y[:, 1] - x[:, 1] * y[:, 0]), np.sum(x[:, :2] * y[:, :2])
        a = np.arctan2(sine, cosine)
        return np.array([[np.cos(a), -np.sin(a), 0.0], [np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]])
    U, _, Vt = np.linalg.svd(y.T @ x)
    return U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
