"""Plus and minus on a composite manifold, from the block table of a `StateLayout`.

Rows of the table: manifold code (0 vector, 1 angle, 2 rotation, 3 stretch), first index in the state, first index in
the error, error size.

A stretch, always behind the rows of its vector v and its scale s, says that v is known through a sensor that measures
w = v / (1 + s), and that the error of v is that of w:  v [+] = (w + dw) (1 + s + ds). In a row of it the third entry is
the place of s, in the state and in the error alike. w and s are flat coordinates in which that sensor is linear: with
v and s a linearised filter believes, whenever v changes, that it has learnt a little of s from what cannot tell it, and
always to the same side (odometry grew by a sixth in a few hundred metres).
"""

from math import atan2, cos, sin, sqrt

from outrider._kernel import inlined, kernel
from outrider.core.angles import wrap
from outrider.typing import Floats, Ints


@kernel
def retract(x: Floats, dx: Floats, table: Ints) -> None:
    """x <- x [+] dx in place: vectors add, angles add and wrap, rotations multiply on the right by Exp(dx)."""
    for b in range(table.shape[0]):
        code, i, k, size = int(table[b, 0]), int(table[b, 1]), int(table[b, 2]), int(table[b, 3])
        if code == 0:
            for j in range(size):
                x[i + j] += dx[k + j]
        elif code == 1:
            x[i] = wrap(x[i] + dx[k])
        elif code == 2:
            rotate_right(x, i, dx[k], dx[k + 1], dx[k + 2])
        else:
            stretch(x, i, k, size, dx)


@inlined
def stretch(x: Floats, i: int, k: int, size: int, dx: Floats) -> None:
    """x[i:i+size], to which dx was added as it stands, as it has to be; x[k] is the new scale."""
    new, old = 1.0 + x[k], 1.0 + x[k] - dx[k]
    for j in range(i, i + size):
        x[j] = ((x[j] - dx[j]) / old + dx[j]) * new


@kernel
def rotate_right(x: Floats, i: int, a: float, b: float, c: float) -> None:
    """x[i:i+4] <- x[i:i+4] (x) Exp((a, b, c)), normalised: the quaternion of a state turned in its own body frame."""
    angle2 = a * a + b * b + c * c
    if angle2 > 1e-8:
        angle = sqrt(angle2)
        s, w = sin(0.5 * angle) / angle, cos(0.5 * angle)
    else:  # sin(h)/2h and cos(h) to fourth order
        s, w = 0.5 - angle2 / 48.0, 1.0 - angle2 / 8.0
    ex, ey, ez = s * a, s * b, s * c
    qx, qy, qz, qw = x[i], x[i + 1], x[i + 2], x[i + 3]
    rx = qw * ex + qx * w + qy * ez - qz * ey
    ry = qw * ey - qx * ez + qy * w + qz * ex
    rz = qw * ez + qx * ey - qy * ex + qz * w
    rw = qw * w - qx * ex - qy * ey - qz * ez
    n = 1.0 / sqrt(rx * rx + ry * ry + rz * rz + rw * rw)
    x[i], x[i + 1], x[i + 2], x[i + 3] = rx * n, ry * n, rz * n, rw * n


@kernel
def local(x1: Floats, x0: Floats, table: Ints, dx: Floats) -> None:
    """dx <- x1 [-] x0, so that x0 [+] dx = x1."""
    for b in range(table.shape[0]):
        code, i, k, size = int(table[b, 0]), int(table[b, 1]), int(table[b, 2]), int(table[b, 3])
        if code == 0:
            for j in range(size):
                dx[k + j] = x1[i + j] - x0[i + j]
        elif code == 1:
            dx[k] = wrap(x1[i] - x0[i])
        elif code == 2:
            _quat_difference(x1[i : i + 4], x0[i : i + 4], dx[k : k + 3])
        else:
            for j in range(i, i + size):
                dx[j] = x1[j] / (1.0 + x1[k]) - x0[j] / (1.0 + x0[k])


@kernel
def _quat_difference(q1: Floats, q0: Floats, phi: Floats) -> None:
    """phi <- Log(q0^-1 q1)."""
    x0, y0, z0, w0 = -q0[0], -q0[1], -q0[2], q0[3]
    x1, y1, z1, w1 = q1[0], q1[1], q1[2], q1[3]
    x = w0 * x1 + x0 * w1 + y0 * z1 - z0 * y1
    y = w0 * y1 - x0 * z1 + y0 * w1 + z0 * x1
    z = w0 * z1 + x0 * y1 - y0 * x1 + z0 * w1
    w = w0 * w1 - x0 * x1 - y0 * y1 - z0 * z1
    if w < 0.0:  # the short way round
        x, y, z, w = -x, -y, -z, -w
    n2 = x * x + y * y + z * z
    n = sqrt(n2)
    s = 2.0 * atan2(n, w) / n if n2 > 1e-16 else 2.0
    phi[0], phi[1], phi[2] = s * x, s * y, s * z
