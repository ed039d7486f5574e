"""Rotations in space: quaternions (x y z w, Hamilton, unit), matrices, rotation vectors, roll-pitch-yaw.

Kernels work on one rotation and write into their last argument, which may be the same array as an input. They take
unit quaternions as given; `quat_normalize` makes them so. The functions in the plural, from `outrider.core.attitudes`,
do the same to whole arrays.

Symbols: phi is a rotation vector [rad], S = [phi]x its skew matrix, t = |phi|. Right Jacobian Jr:
Exp(phi + d) = Exp(phi) Exp(Jr(phi) d). Source: J. Sola, "Quaternion kinematics for the error-state Kalman filter"
(arXiv 1711.02508) and "A micro Lie theory" (arXiv 1812.01537).
"""

from math import atan2, cos, hypot, sin, sqrt

import numpy as np

from outrider._kernel import kernel
from outrider.core.attitudes import GIMBAL
from outrider.core.attitudes import matrices_to_quats as matrices_to_quats
from outrider.core.attitudes import quats_conjugate as quats_conjugate
from outrider.core.attitudes import quats_exp as quats_exp
from outrider.core.attitudes import quats_log as quats_log
from outrider.core.attitudes import quats_multiply as quats_multiply
from outrider.core.attitudes import quats_to_matrices as quats_to_matrices
from outrider.core.attitudes import quats_to_rpy as quats_to_rpy
from outrider.core.attitudes import rpy_to_quats as rpy_to_quats
from outrider.core.attitudes import slerp as slerp
from outrider.typing import Floats

# Below this t^2 the closed forms of the Jacobians lose digits by cancellation and their series, cut at t^10, are exact.
SERIES = 0.09
# Below this t^2 sin(t)/t and its like are exact to the second term.
_TINY = 1e-8


@kernel
def skew(v: Floats, S: Floats) -> None:
    """S (3, 3) = [v]x, so that S a = v x a."""
    x, y, z = v[0], v[1], v[2]
    S[0, 0] = S[1, 1] = S[2, 2] = 0.0
    S[0, 1], S[0, 2], S[1, 2] = -z, y, -x
    S[1, 0], S[2, 0], S[2, 1] = z, -y, x


@kernel
def quat_multiply(a: Floats, b: Floats, out: Floats) -> None:
    """out = a (x) b: first b, then a;  R(out) = R(a) R(b)."""
    ax, ay, az, aw = a[0], a[1], a[2], a[3]
    bx, by, bz, bw = b[0], b[1], b[2], b[3]
    out[0] = aw * bx + ax * bw + ay * bz - az * by
    out[1] = aw * by - ax * bz + ay * bw + az * bx
    out[2] = aw * bz + ax * by - ay * bx + az * bw
    out[3] = aw * bw - ax * bx - ay * by - az * bz


@kernel
def quat_conjugate(q: Floats, out: Floats) -> None:
    """out = q*, the inverse rotation of a unit quaternion."""
    out[0], out[1], out[2], out[3] = -q[0], -q[1], -q[2], q[3]


@kernel
def quat_normalize(q: Floats) -> None:
    """q <- q / |q| in place; the zero quaternion has no direction and becomes NaN."""
    norm = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    scale = 1.0 / norm if norm > 0.0 else np.nan
    for i in range(4):
        q[i] *= scale


@kernel
def _log_of(x: float, y: float, z: float, w: float) -> tuple[float, float, float]:
    """Rotation vector of the quaternion (x y z w) or its negative: both give the same one, even at t = pi."""
    if w < 0.0 or (w == 0.0 and (x < 0.0 or (x == 0.0 and (y < 0.0 or (y == 0.0 and z < 0.0))))):
        x, y, z, w = -x, -y, -z, -w
    n2 = x * x + y * y + z * z
    if n2 == 0.0 and w == 0.0:
        return np.nan, np.nan, np.nan
    if n2 < _TINY * w * w:
        r2 = n2 / (w * w)
        scale = 2.0 / w * (1.0 - r2 / 3.0 + r2 * r2 / 5.0)
    else:
        n = sqrt(n2)
        scale = 2.0 * atan2(n, w) / n
    return x * scale, y * scale, z * scale


@kernel
def _quat_of(R: Floats) -> tuple[float, float, float, float]:
    """Unit quaternion of R with w >= 0, from its largest component, which is never below 1/2 (Shepperd)."""
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    if trace >= max(R[0, 0], R[1, 1], R[2, 2]):
        x, y, z, w = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], 1.0 + trace
    elif R[0, 0] >= R[1, 1] and R[0, 0] >= R[2, 2]:
        x, y, z = 1.0 + 2.0 * R[0, 0] - trace, R[0, 1] + R[1, 0], R[0, 2] + R[2, 0]
        w = R[2, 1] - R[1, 2]
    elif R[1, 1] >= R[2, 2]:
        x, y, z = R[0, 1] + R[1, 0], 1.0 + 2.0 * R[1, 1] - trace, R[1, 2] + R[2, 1]
        w = R[0, 2] - R[2, 0]
    else:
        x, y, z = R[0, 2] + R[2, 0], R[1, 2] + R[2, 1], 1.0 + 2.0 * R[2, 2] - trace
        w = R[1, 0] - R[0, 1]
    scale = 1.0 / sqrt(x * x + y * y + z * z + w * w)
    if w < 0.0:
        scale = -scale
    return x * scale, y * scale, z * scale, w * scale


@kernel
def quat_exp(phi: Floats, q: Floats) -> None:
    """q = Exp(phi) = [phi/t sin(t/2), cos(t/2)]."""
    t2 = squared(phi)
    if t2 < _TINY:
        scale, w = 0.5 - t2 / 48.0, 1.0 - t2 / 8.0 + t2 * t2 / 384.0
    else:
        t = sqrt(t2)
        scale, w = sin(0.5 * t) / t, cos(0.5 * t)
    q[0], q[1], q[2], q[3] = phi[0] * scale, phi[1] * scale, phi[2] * scale, w


@kernel
def quat_log(q: Floats, phi: Floats) -> None:
    """phi = Log(q), |phi| <= pi: the short way round, the same for q and -q, whatever the length of q."""
    phi[0], phi[1], phi[2] = _log_of(q[0], q[1], q[2], q[3])


@kernel
def matrix_from_quat(q: Floats, R: Floats) -> None:
    """R (3, 3) of a unit quaternion."""
    x, y, z, w = q[0], q[1], q[2], q[3]
    R[0, 0], R[0, 1], R[0, 2] = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
    R[1, 0], R[1, 1], R[1, 2] = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)
    R[2, 0], R[2, 1], R[2, 2] = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)


@kernel
def quat_from_matrix(R: Floats, q: Floats) -> None:
    """q of R (3, 3), unit and with w >= 0; a slightly skewed R is tolerated."""
    q[0], q[1], q[2], q[3] = _quat_of(R)


@kernel
def _turned(x: float, y: float, z: float, w: float, v: Floats, out: Floats) -> None:
    """out = v + 2 w (u x v) + 2 u x (u x v), with u = (x y z)."""
    a, b, c = v[0], v[1], v[2]
    tx, ty, tz = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    out[0] = a + w * tx + y * tz - z * ty
    out[1] = b + w * ty + z * tx - x * tz
    out[2] = c + w * tz + x * ty - y * tx


@kernel
def rotate(q: Floats, v: Floats, out: Floats) -> None:
    """out = R(q) v."""
    _turned(q[0], q[1], q[2], q[3], v, out)


@kernel
def rotate_inverse(q: Floats, v: Floats, out: Floats) -> None:
    """out = R(q)' v."""
    _turned(-q[0], -q[1], -q[2], q[3], v, out)


@kernel
def skew_block(x: float, y: float, z: float, a: float, b: float, c: float, out: Floats, i: int, j: int) -> None:
    """out[i:i+3, j:j+3] = a I + b S + c S^2 with S = [(x, y, z)]x;  S^2 = phi phi' - t^2 I."""
    xx, yy, zz = c * x * x, c * y * y, c * z * z
    out[i, j], out[i, j + 1], out[i, j + 2] = a - (yy + zz), c * x * y - b * z, c * x * z + b * y
    i += 1
    out[i, j], out[i, j + 1], out[i, j + 2] = c * x * y + b * z, a - (xx + zz), c * y * z - b * x
    i += 1
    out[i, j], out[i, j + 1], out[i, j + 2] = c * x * z - b * y, c * y * z + b * x, a - (xx + yy)


@kernel
def skew_polynomial(phi: Floats, a: float, b: float, c: float, out: Floats) -> None:
    """out (3, 3) = a I + b S + c S^2, the shape of every function of a rotation vector."""
    skew_block(phi[0], phi[1], phi[2], a, b, c, out, 0, 0)


@kernel
def squared(phi: Floats) -> float:
    """t^2 = phi' phi of a rotation vector."""
    return phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2]


@kernel
def sines(t2: float) -> tuple[float, float, float]:
    """(sin t / t,  (1 - cos t) / t^2,  (t - sin t) / t^3) from t^2, without cancellation for any t."""
    if t2 < SERIES:
        b = t2 * (1 / 720 - t2 * (1 / 40320 - t2 * (1 / 3628800 - t2 / 479001600)))
        b = 0.5 - t2 * (1 / 24 - b)
        c = t2 * (1 / 5040 - t2 * (1 / 362880 - t2 * (1 / 39916800 - t2 / 6227020800)))
        c = 1 / 6 - t2 * (1 / 120 - c)
        return 1.0 - t2 * c, b, c
    t = sqrt(t2)
    half = sin(0.5 * t)
    return sin(t) / t, 2.0 * half * half / t2, (t - sin(t)) / (t2 * t)


@kernel
def cotangent(t2: float) -> float:
    """(1 - t/2 cot(t/2)) / t^2 from t^2: the last coefficient of the inverse Jacobians, finite for t < 2 pi."""
    if t2 < SERIES:
        tail = t2 * (1 / 1209600 + t2 * (1 / 47900160 + t2 * (691 / 1307674368000)))
        return 1 / 12 + t2 * (1 / 720 + t2 * (1 / 30240 + tail))
    half = 0.5 * sqrt(t2)
    return (1.0 - half * cos(half) / sin(half)) / t2


@kernel
def so3_exp(phi: Floats, R: Floats) -> None:
    """R (3, 3) = Exp(phi) = I + sin t / t S + (1 - cos t) / t^2 S^2."""
    s, c, _ = sines(squared(phi))
    skew_polynomial(phi, 1.0, s, c, R)


@kernel
def so3_log(R: Floats, phi: Floats) -> None:
    """phi = Log(R), |phi| <= pi; through the quaternion, so it stays exact near pi."""
    x, y, z, w = _quat_of(R)
    phi[0], phi[1], phi[2] = _log_of(x, y, z, w)


@kernel
def right_jacobian(phi: Floats, J: Floats) -> None:
    """J (3, 3) = Jr(phi) = I - (1 - cos t)/t^2 S + (t - sin t)/t^3 S^2."""
    _, b, c = sines(squared(phi))
    skew_polynomial(phi, 1.0, -b, c, J)


@kernel
def right_jacobian_inverse(phi: Floats, J: Floats) -> None:
    """J (3, 3) = Jr(phi)^-1 = I + S/2 + (1 - t/2 cot(t/2))/t^2 S^2;  t < 2 pi."""
    skew_polynomial(phi, 1.0, 0.5, cotangent(squared(phi)), J)


@kernel
def left_jacobian(phi: Floats, J: Floats) -> None:
    """J (3, 3) = Jl(phi) = Jr(-phi): Exp(phi + d) = Exp(Jl d) Exp(phi)."""
    _, b, c = sines(squared(phi))
    skew_polynomial(phi, 1.0, b, c, J)


@kernel
def left_jacobian_inverse(phi: Floats, J: Floats) -> None:
    """J (3, 3) = Jl(phi)^-1 = Jr(-phi)^-1;  t < 2 pi."""
    skew_polynomial(phi, 1.0, -0.5, cotangent(squared(phi)), J)


@kernel
def yaw_of(q: Floats) -> float:
    """Heading [rad] of the body's x axis, counter-clockwise from the world's x axis."""
    return atan2(2.0 * (q[3] * q[2] + q[0] * q[1]), 1.0 - 2.0 * (q[1] * q[1] + q[2] * q[2]))


@kernel
def quat_from_rpy(roll: float, pitch: float, yaw: float, q: Floats) -> None:
    """q = Rz(yaw) Ry(pitch) Rx(roll), angles in rad (the order of ROS and of aviation)."""
    cr, sr = cos(0.5 * roll), sin(0.5 * roll)
    cp, sp = cos(0.5 * pitch), sin(0.5 * pitch)
    cy, sy = cos(0.5 * yaw), sin(0.5 * yaw)
    q[0] = sr * cp * cy - cr * sp * sy
    q[1] = cr * sp * cy + sr * cp * sy
    q[2] = cr * cp * sy - sr * sp * cy
    q[3] = cr * cp * cy + sr * sp * sy


@kernel
def rpy_from_quat(q: Floats, rpy: Floats) -> None:
    """(roll, pitch, yaw) [rad] of a unit quaternion; nose straight up or down: roll is zero, yaw takes the rest."""
    x, y, z, w = q[0], q[1], q[2], q[3]
    R00, R10, R20 = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)
    cos_pitch = hypot(R00, R10)
    rpy[1] = atan2(-R20, cos_pitch)
    if cos_pitch < GIMBAL:
        rpy[0], rpy[2] = 0.0, atan2(2.0 * (w * z - x * y), 1.0 - 2.0 * (x * x + z * z))
    else:
        rpy[0], rpy[2] = atan2(2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)), atan2(R10, R00)
