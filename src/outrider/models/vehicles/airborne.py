"""What flying vehicles share: the head of their state, attitude algebra on it, and how they stand on the ground.

Landing gear is a critically damped spring: a vehicle that touches the ground with rotors that do not carry it comes to
rest there within a few tenths of a second, level with the ground, and from then on does not move by a single bit.
"""

from math import atan2, cos, hypot, sin, sqrt
from typing import Final

import numpy as np

from outrider._kernel import kernel
from outrider.models.vehicles.base import ROW_F, ROW_P, ROW_Q, ROW_V, ROW_W
from outrider.models.vehicles.terrain import height_at, plane_quat
from outrider.typing import Floats

X_P: Final = 0
X_Q: Final = 3
X_V: Final = 7
X_W: Final = 10  # body rate
X_A: Final = 13  # acceleration, site frame
X_MODE: Final = 16
X_OWN: Final = 17

UNPLACED: Final = 0.0  # not yet compared with the ground
FLYING: Final = 1.0
TOUCHING: Final = 2.0
RESTING: Final = 3.0

_NEAR = 0.02  # m above the ground a vehicle starts on it
_GEAR = 30.0  # 1/s, natural frequency of the landing gear
_SCRUB = 0.1  # s, in which sliding and leaning fade
_AT_REST = 1e-7  # m, m/s and rad below which a landed vehicle does not move at all

Triple = tuple[float, float, float]


def start_in_air(width: int, p: Floats, yaw: float) -> Floats:
    """A level state at rest, zeros but for the pose."""
    x = np.zeros(width)
    x[X_P : X_P + 3] = p
    x[X_Q + 2], x[X_Q + 3] = sin(0.5 * yaw), cos(0.5 * yaw)
    return x


@kernel
def in_body(x: Floats, a: float, b: float, c: float) -> Triple:
    """R' (a, b, c)."""
    return _turned(-x[X_Q], -x[X_Q + 1], -x[X_Q + 2], x[X_Q + 3], a, b, c)


@kernel
def in_world(x: Floats, a: float, b: float, c: float) -> Triple:
    """R (a, b, c)."""
    return _turned(x[X_Q], x[X_Q + 1], x[X_Q + 2], x[X_Q + 3], a, b, c)


@kernel
def _turned(x: float, y: float, z: float, w: float, a: float, b: float, c: float) -> Triple:
    """v + 2 w (u x v) + 2 u x (u x v), with u = (x y z), as in `outrider.core.rotations.rotate`."""
    tx, ty, tz = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return a + w * tx + y * tz - z * ty, b + w * ty + z * tx - x * tz, c + w * tz + x * ty - y * tx


@kernel
def lean_towards(x: Floats, a: float, b: float, c: float) -> tuple[float, float]:
    """(phi_x, phi_y) [rad]: the shortest rotation vector, in the body, that turns body z into direction (a, b, c)."""
    a, b, c = in_body(x, a, b, c)
    sine = hypot(a, b)
    if sine < 1e-12 * abs(c):
        return (0.0, 0.0) if c > 0.0 else (np.pi, 0.0)
    scale = atan2(sine, c) / sine
    return -b * scale, a * scale


@kernel
def spin(x: Floats, bx: float, by: float, bz: float, h: float) -> None:
    """Turn for a step while the body rate goes linearly from a to b:  q <- q Exp(h (a + b)/2 + h^2 a x b / 12)."""
    ax, ay, az = x[X_W], x[X_W + 1], x[X_W + 2]
    c = h * h / 12.0
    px = 0.5 * h * (ax + bx) + c * (ay * bz - az * by)
    py = 0.5 * h * (ay + by) + c * (az * bx - ax * bz)
    pz = 0.5 * h * (az + bz) + c * (ax * by - ay * bx)
    x[X_W], x[X_W + 1], x[X_W + 2] = bx, by, bz
    t = sqrt(px * px + py * py + pz * pz)
    if t == 0.0:
        return
    scale = sin(0.5 * t) / t
    bx, by, bz, bw = px * scale, py * scale, pz * scale, cos(0.5 * t)
    ax, ay, az, aw = x[X_Q], x[X_Q + 1], x[X_Q + 2], x[X_Q + 3]
    put_quat(
        x,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


@kernel
def glide(x: Floats, i: int, a: float, h: float) -> None:
    """Move along axis i for a step while its acceleration goes linearly from x[X_A + i] to a."""
    a0 = x[X_A + i]
    x[X_P + i] += h * (x[X_V + i] + h / 6.0 * (2.0 * a0 + a))
    x[X_V + i] += 0.5 * h * (a0 + a)
    x[X_A + i] = a


@kernel
def put_quat(x: Floats, a: float, b: float, c: float, d: float) -> None:
    """The attitude of x is (a, b, c, d), normalized."""
    scale = 1.0 / sqrt(a * a + b * b + c * c + d * d)
    x[X_Q], x[X_Q + 1], x[X_Q + 2], x[X_Q + 3] = a * scale, b * scale, c * scale, d * scale


@kernel
def write_row(x: Floats, gravity: float, out: Floats, k: int) -> None:
    """Row k but for its actuators;  f = R' (a - g)."""
    for i in range(3):
        out[k, ROW_P + i], out[k, ROW_V + i], out[k, ROW_W + i] = x[X_P + i], x[X_V + i], x[X_W + i]
    for i in range(4):
        out[k, ROW_Q + i] = x[X_Q + i]
    out[k, ROW_F], out[k, ROW_F + 1], out[k, ROW_F + 2] = in_body(x, x[X_A], x[X_A + 1], x[X_A + 2] + gravity)


@kernel
def place(x: Floats, ground: Floats) -> None:
    """A new state stands on the ground, level with it, or is in the air: its mode afterwards."""
    floor = height_at(ground, x[X_P], x[X_P + 1])
    if x[X_P + 2] > floor + _NEAR:
        x[X_MODE] = FLYING
        return
    x[X_P + 2], x[X_MODE] = floor, RESTING
    qx, qy, qw = plane_quat(ground)
    s, c = x[X_Q + 2], x[X_Q + 3]
    put_quat(x, qx * c + qy * s, qy * c - qx * s, qw * s, qw * c)


@kernel
def touches(x: Floats, ground: Floats) -> bool:
    """Whether a flying body has come down to the ground."""
    below = x[X_P + 2] <= height_at(ground, x[X_P], x[X_P + 1])
    return x[X_MODE] == FLYING and below and x[X_V + 2] < height_at(ground, x[X_V], x[X_V + 1])


@kernel
def settle(x: Floats, ground: Floats, h: float) -> None:
    """One step on the ground:  z'' = -n^2 (z - ground) - 2 n z'  while sliding and leaning fade; all implicit."""
    if x[X_MODE] == RESTING:
        return
    sink = x[X_P + 2] - height_at(ground, x[X_P], x[X_P + 1])
    pull = _GEAR * _GEAR * (sink + h * (x[X_V + 2] + h / 3.0 * x[X_A + 2]))
    damp = 2.0 * _GEAR * (x[X_V + 2] + 0.5 * h * x[X_A + 2])
    glide(x, 2, -(pull + damp) / (1.0 + _GEAR * h * (1.0 + _GEAR * h / 6.0)), h)
    for i in range(2):
        glide(x, i, -(x[X_V + i] + 0.5 * h * x[X_A + i]) / (_SCRUB + 0.5 * h), h)
    phi_x, phi_y = lean_towards(x, -ground[0, 0], -ground[0, 1], 1.0)
    spin(x, phi_x / _SCRUB, phi_y / _SCRUB, x[X_W + 2] * (1.0 - h / _SCRUB), h)
    most = max(abs(sink), abs(phi_x), abs(phi_y))
    for i in range(3):
        most = max(most, abs(x[X_V + i]), abs(x[X_W + i]))
    if most < _AT_REST:
        x[X_MODE] = RESTING
        x[X_P + 2] = height_at(ground, x[X_P], x[X_P + 1])
        for i in range(3):
            x[X_V + i] = x[X_W + i] = x[X_A + i] = 0.0
