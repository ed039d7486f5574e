"""The problems both sides solve: models as kernels, and measurements drawn once."""

from functools import cache
from math import cos, sin, sqrt

import numpy as np

from outrider._kernel import kernel

DT = 0.01
BEACON = np.array([40.0, -25.0, 12.0])


@kernel
def planar(x, F):
    """7 states: x y heading, speed, yaw rate, gyro bias, wheel scale. F is an identity beforehand."""
    c, s, v = cos(x[2]), sin(x[2]), x[3]
    F[0, 2], F[0, 3], F[1, 2], F[1, 3], F[2, 4] = -v * s * DT, c * DT, v * c * DT, s * DT, DT
    x[0] += v * c * DT
    x[1] += v * s * DT
    x[2] += x[4] * DT


@kernel
def omnidirectional(x, F):
    """15 states as in robot_localization: position, roll pitch yaw, body velocity, body rates, body acceleration."""
    cr, sr, cp, sp, cy, sy = cos(x[3]), sin(x[3]), cos(x[4]), sin(x[4]), cos(x[5]), sin(x[5])
    F[0, 6], F[0, 7], F[0, 8] = cy * cp * DT, (cy * sp * sr - sy * cr) * DT, (cy * sp * cr + sy * sr) * DT
    F[1, 6], F[1, 7], F[1, 8] = sy * cp * DT, (sy * sp * sr + cy * cr) * DT, (sy * sp * cr - cy * sr) * DT
    F[2, 6], F[2, 7], F[2, 8] = -sp * DT, cp * sr * DT, cp * cr * DT
    a, b, c = x[6] + 0.5 * DT * x[12], x[7] + 0.5 * DT * x[13], x[8] + 0.5 * DT * x[14]
    dx = F[0, 6] * a + F[0, 7] * b + F[0, 8] * c
    dy = F[1, 6] * a + F[1, 7] * b + F[1, 8] * c
    F[0, 3], F[1, 3], F[2, 3] = F[0, 8] * b - F[0, 7] * c, F[1, 8] * b - F[1, 7] * c, F[2, 8] * b - F[2, 7] * c
    along = cp * a + sp * sr * b + sp * cr * c
    F[0, 4], F[1, 4] = cy * (-sp * a + cp * sr * b + cp * cr * c) * DT, sy * (-sp * a + cp * sr * b + cp * cr * c) * DT
    F[2, 4] = -along * DT
    F[0, 5], F[1, 5] = -dy, dx
    for i in range(3):
        for j in range(3):
            F[i, 12 + j] = 0.5 * DT * F[i, 6 + j]
        F[6 + i, 12 + i] = DT
    t, q, r = sp / cp, x[10], x[11]
    F[3, 9], F[3, 10], F[3, 11] = DT, sr * t * DT, cr * t * DT
    F[4, 10], F[4, 11] = cr * DT, -sr * DT
    F[5, 10], F[5, 11] = sr / cp * DT, cr / cp * DT
    u, w = sr * q + cr * r, cr * q - sr * r
    F[3, 3], F[3, 4] = 1.0 + w * t * DT, u / (cp * cp) * DT
    F[4, 3] = -u * DT
    F[5, 3], F[5, 4] = w / cp * DT, u * sp / (cp * cp) * DT
    x[0] += dx
    x[1] += dy
    x[2] += F[2, 6] * a + F[2, 7] * b + F[2, 8] * c
    x[3] += (x[9] + u * t) * DT
    x[4] += w * DT
    x[5] += u / cp * DT
    for i in range(3):
        x[6 + i] += x[12 + i] * DT


@kernel
def advance(x, F):
    """The model that goes with the number of states."""
    if x.size == 7:
        planar(x, F)
    else:
        omnidirectional(x, F)


@kernel
def glide(x, dt, out):
    """6 states: position and velocity with quadratic drag; out may be x."""
    drag = 1.0 - 0.02 * sqrt(x[3] * x[3] + x[4] * x[4] + x[5] * x[5]) * dt
    for i in range(3):
        out[i] = x[i] + x[3 + i] * dt
        out[3 + i] = x[3 + i] * drag


@kernel
def sense(x, beacon, out):
    """7 measurements of them: position, velocity and the range to a beacon."""
    for i in range(6):
        out[i] = x[i]
    a, b, c = x[0] - beacon[0], x[1] - beacon[1], x[2] - beacon[2]
    out[6] = sqrt(a * a + b * b + c * c)


@kernel
def glide_all(X, dt, out):
    """`glide` for all rows."""
    for i in range(X.shape[0]):
        glide(X[i], dt, out[i])


@kernel
def innovations(X, z, beacon, out):
    """z - `sense` for all rows."""
    for i in range(X.shape[0]):
        sense(X[i], beacon, out[i])
        for j in range(7):
            out[i, j] = z[j] - out[i, j]


def start(n):
    """(x, P, Q) of n states."""
    x = np.full(n, 0.05)
    return x, np.diag(np.linspace(0.5, 1.5, n)), np.diag(np.linspace(1e-4, 1e-3, n))


def selector(n, m):
    """(H, r): the first m states are measured."""
    return np.eye(n)[:m].copy(), np.linspace(0.02, 0.05, m)


@cache
def measurements(m, events, seed=1):
    """(events, m) small random numbers."""
    return 0.1 * np.random.default_rng(seed).standard_normal((events, m))


@cache
def sightings(events, seed=2):
    """(events, 7) what `sense` gives at a state near the origin, with noise."""
    z = np.zeros(7)
    sense(np.zeros(6), BEACON, z)
    return z + measurements(7, events, seed)


def summary(x, P):
    """What two filters must agree on: the mean and the whole covariance."""
    return np.concatenate([np.ravel(x), np.ravel(P)])
