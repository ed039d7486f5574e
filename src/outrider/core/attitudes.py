"""Arrays of angles and attitudes in numpy: whole trajectories at once, any leading shape, nothing to compile.

Quaternions are x y z w, Hamilton, and are normalized on entry; a zero quaternion becomes NaN. One rotation at a time,
inside a filter: the kernels of `outrider.core.angles` and `outrider.core.rotations`, which offer these functions too.
What must load fast, without the compiler, imports them from here.
"""

from math import nan, pi, sqrt

import numpy as np
from numpy.typing import ArrayLike

from outrider.typing import Floats

# Below this cos(pitch) roll and yaw turn about the same axis: roll is set to zero.
GIMBAL = 1e-8
TURN = 2.0 * pi


def wrap_all(a: ArrayLike) -> Floats:
    """Angles [rad] of any shape folded into (-pi, pi]; NaN stays NaN and infinity becomes it.

    >>> wrap_all([0.3, -pi, 2 * pi]).tolist()
    [0.3, 3.141592653589793, 0.0]
    """
    angles = np.asarray(a, dtype=np.float64)
    angles = np.where(np.isfinite(angles), angles, np.nan)
    folded = angles - TURN * np.ceil((angles - pi) / TURN)
    folded = np.where(folded <= -pi, folded + TURN, folded)
    return np.where(folded > pi, folded - TURN, folded)


def _unit(q: ArrayLike) -> Floats:
    """q (..., 4) as float64, normalized; the zero quaternion becomes NaN."""
    array = np.asarray(q, dtype=np.float64)
    norm = np.sqrt(np.add.reduce(array * array, axis=-1, keepdims=True))
    return array / np.where(norm > 0.0, norm, np.nan)


def _parts(q: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    return q[..., 0], q[..., 1], q[..., 2], q[..., 3]


def quats_multiply(a: ArrayLike, b: ArrayLike) -> Floats:
    """a (x) b for arrays (..., 4) that broadcast."""
    ax, ay, az, aw = _parts(_unit(a))
    bx, by, bz, bw = _parts(_unit(b))
    x = aw * bx + ax * bw + ay * bz - az * by
    out = np.empty((*x.shape, 4))
    out[..., 0] = x
    out[..., 1] = aw * by - ax * bz + ay * bw + az * bx
    out[..., 2] = aw * bz + ax * by - ay * bx + az * bw
    out[..., 3] = aw * bw - ax * bx - ay * by - az * bz
    return out


def quats_conjugate(q: ArrayLike) -> Floats:
    """The inverse rotations of q (..., 4)."""
    return np.asarray(q, dtype=np.float64) * np.array([-1.0, -1.0, -1.0, 1.0])


def quats_exp(phi: ArrayLike) -> Floats:
    """Quaternions (..., 4) of rotation vectors (..., 3) [rad]."""
    vectors = np.asarray(phi, dtype=np.float64)
    half = 0.5 * np.sqrt(np.add.reduce(vectors * vectors, axis=-1, keepdims=True))
    return np.concatenate((0.5 * vectors * np.sinc(half / np.pi), np.cos(half)), axis=-1)


def quats_log(q: ArrayLike) -> Floats:
    """Rotation vectors (..., 3) [rad], |phi| <= pi, of quaternions (..., 4)."""
    array = _unit(q)
    array = np.where(array[..., 3:] < 0.0, -array, array)
    n = np.linalg.norm(array[..., :3], axis=-1, keepdims=True)
    scale = np.full_like(n, 2.0)
    np.divide(2.0 * np.arctan2(n, array[..., 3:]), n, out=scale, where=n > 0.0)
    return array[..., :3] * scale


def quats_to_matrices(q: ArrayLike) -> Floats:
    """Matrices (..., 3, 3) of quaternions (..., 4)."""
    x, y, z, w = _parts(_unit(q))
    return _table((
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    ))  # fmt: skip


def _table(rows: tuple[tuple[Floats, ...], ...]) -> Floats:
    """(..., n, n) of n rows of n arrays (...)."""
    out = np.empty((*rows[0][0].shape, len(rows), len(rows)))
    for i, row in enumerate(rows):
        for j, entry in enumerate(row):
            out[..., i, j] = entry
    return out


def matrices_to_quats(R: ArrayLike) -> Floats:
    """Quaternions (..., 4), w >= 0, of matrices (..., 3, 3): the row of 4 q q' with the largest diagonal."""
    M = np.asarray(R, dtype=np.float64)
    d0, d1, d2 = M[..., 0, 0], M[..., 1, 1], M[..., 2, 2]
    xy, xz, yz = M[..., 0, 1] + M[..., 1, 0], M[..., 0, 2] + M[..., 2, 0], M[..., 1, 2] + M[..., 2, 1]
    xw, yw, zw = M[..., 2, 1] - M[..., 1, 2], M[..., 0, 2] - M[..., 2, 0], M[..., 1, 0] - M[..., 0, 1]
    outer = _table((
        (1.0 + d0 - d1 - d2, xy, xz, xw),
        (xy, 1.0 - d0 + d1 - d2, yz, yw),
        (xz, yz, 1.0 - d0 - d1 + d2, zw),
        (xw, yw, zw, 1.0 + d0 + d1 + d2),
    ))  # fmt: skip
    largest = np.argmax(np.diagonal(outer, axis1=-2, axis2=-1), axis=-1)
    q = _unit(np.take_along_axis(outer, largest[..., None, None], axis=-2)[..., 0, :])
    return np.where(q[..., 3:] < 0.0, -q, q)


def quat_of_matrix(R: Floats) -> Floats:
    """Quaternion (4,), w >= 0, of one matrix (3, 3): `matrices_to_quats` in plain numbers, the same to the last bit."""
    (a, b, c), (d, e, f), (g, h, i) = R.tolist()
    xy, xz, yz, xw, yw, zw = b + d, c + g, f + h, h - f, c - g, d - b
    outer = (
        (1.0 + a - e - i, xy, xz, xw), (xy, 1.0 - a + e - i, yz, yw),
        (xz, yz, 1.0 - a - e + i, zw), (xw, yw, zw, 1.0 + a + e + i),
    )  # fmt: skip
    x, y, z, w = max((outer[k][k], -k, outer[k]) for k in range(4))[2]
    n = sqrt(x * x + y * y + z * z + w * w) or nan
    n = -n if w / n < 0.0 else n
    return np.array([x / n, y / n, z / n, w / n])


def rpy_to_quats(rpy: ArrayLike) -> Floats:
    """Quaternions (..., 4) of (roll, pitch, yaw) (..., 3) [rad]:  Rz(yaw) Ry(pitch) Rx(roll)."""
    half = 0.5 * np.moveaxis(np.asarray(rpy, dtype=np.float64), -1, 0)
    (cr, cp, cy), (sr, sp, sy) = np.cos(half), np.sin(half)
    x, y = sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy
    return np.stack((x, y, cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy), axis=-1)


def quats_to_rpy(q: ArrayLike) -> Floats:
    """(roll, pitch, yaw) (..., 3) [rad] of quaternions (..., 4); with the nose straight up or down roll is zero."""
    R = quats_to_matrices(q)
    cos_pitch = np.hypot(R[..., 0, 0], R[..., 1, 0])
    locked = cos_pitch < GIMBAL
    roll = np.where(locked, 0.0, np.arctan2(R[..., 2, 1], R[..., 2, 2]))
    yaw = np.where(locked, np.arctan2(-R[..., 0, 1], R[..., 1, 1]), np.arctan2(R[..., 1, 0], R[..., 0, 0]))
    return np.stack((roll, np.arctan2(-R[..., 2, 0], cos_pitch), yaw), axis=-1)


def slerp(t: ArrayLike, t0: ArrayLike, q0: ArrayLike) -> Floats:
    """Attitudes (n, 4) at times t (n,), at constant rate between q0 (m, 4) at the ascending times t0 (m,).

    Times share one unit (integer nanoseconds stay exact). Before the first and after the last, the end holds.

    >>> slerp([5], [0, 10], [[0, 0, 0, 1], [0, 0, 1, 0]]).round(6).tolist()
    [[0.0, 0.0, 0.707107, 0.707107]]
    """
    when, knots, q = np.asarray(t), np.asarray(t0), _unit(q0)
    if knots.size == 1:
        return np.repeat(q, when.size, axis=0)
    when = np.clip(when, knots[0], knots[-1])
    i = np.clip(np.searchsorted(knots, when, side="right") - 1, 0, knots.size - 2)
    span = (knots[i + 1] - knots[i]).astype(np.float64)
    part = (when - knots[i]) / np.where(span > 0.0, span, 1.0)
    step = quats_log(quats_multiply(quats_conjugate(q[i]), q[i + 1]))
    return quats_multiply(q[i], quats_exp(part[:, None] * step))
