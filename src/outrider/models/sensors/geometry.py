"""Small vectors for the sensor kernels, and the Jacobian rows that several sensors share.

A vector is a tuple of three floats: the compiler keeps it in registers and nothing is allocated. The functions that
end in `_row` *add* to a row of D, which `clear` has zeroed. Symbols: l lever arm, w rate, u = R' v body velocity, a a
direction in the world, b one in the body; d(R) = R [dth]x.
"""

from typing import TypeAlias

from outrider._kernel import kernel
from outrider.models.kinematics import K_P, K_R, K_V, K_W, T_P, T_SIZE, T_TH, T_V, T_W
from outrider.models.sensors.layout import LEVER, MOUNT
from outrider.typing import Floats

Vector: TypeAlias = tuple[float, float, float]


@kernel
def clear(D: Floats, m: int) -> None:
    """D[:m] = 0."""
    for i in range(m):
        for j in range(T_SIZE):
            D[i, j] = 0.0


@kernel
def triple(x: Floats, first: int) -> Vector:
    """Three components in a row."""
    return x[first], x[first + 1], x[first + 2]


@kernel
def dot(a: Vector, b: Vector) -> float:
    """a' b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a: Vector, b: Vector) -> Vector:
    """a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def mix(s: float, a: Vector, t: float, b: Vector) -> Vector:
    """s a + t b."""
    return s * a[0] + t * b[0], s * a[1] + t * b[1], s * a[2] + t * b[2]


@kernel
def put(D: Floats, row: int, block: int, scale: float, a: Vector) -> None:
    """D[row, block:block+3] += scale a."""
    D[row, block] += scale * a[0]
    D[row, block + 1] += scale * a[1]
    D[row, block + 2] += scale * a[2]


@kernel
def in_world(k: Floats, b: Vector) -> Vector:
    """R b."""
    return dot(triple(k, K_R), b), dot(triple(k, K_R + 3), b), dot(triple(k, K_R + 6), b)


@kernel
def in_body(k: Floats, a: Vector) -> Vector:
    """R' a."""
    x, y, z = triple(k, K_R), triple(k, K_R + 3), triple(k, K_R + 6)
    return (
        x[0] * a[0] + y[0] * a[1] + z[0] * a[2],
        x[1] * a[0] + y[1] * a[1] + z[1] * a[2],
        x[2] * a[0] + y[2] * a[1] + z[2] * a[2],
    )


@kernel
def is_rotation(q: Floats) -> bool:
    """Whether q[0:4] can be made a unit quaternion: finite and not zero."""
    n2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]
    return 1e-6 < n2 < 1e6


@kernel
def turned(q: Floats, a: Vector) -> Vector:
    """R(q) a for a quaternion q[0:4] of any length: recorded ones are rarely unit to the last digit."""
    u = (q[0], q[1], q[2])
    t = cross(u, a)
    scale = 2.0 / (dot(u, u) + q[3] * q[3])
    return mix(1.0, a, scale, mix(q[3], t, 1.0, cross(u, t)))


@kernel
def sensor_axis(theta: Floats, j: int) -> Vector:
    """The sensor's axis j in the body frame: column j of R_body_sensor."""
    return theta[MOUNT + j], theta[MOUNT + 3 + j], theta[MOUNT + 6 + j]


@kernel
def in_mount(theta: Floats, s: Vector) -> Vector:
    """R_body_sensor s: from sensor to body axes."""
    return dot(triple(theta, MOUNT), s), dot(triple(theta, MOUNT + 3), s), dot(triple(theta, MOUNT + 6), s)


@kernel
def point(k: Floats, theta: Floats, i: int) -> float:
    """Component i of the sensor's place in the world, p + R l."""
    return k[K_P + i] + dot(triple(k, K_R + 3 * i), triple(theta, LEVER))


@kernel
def point_row(k: Floats, theta: Floats, i: int, D: Floats, row: int) -> None:
    """Derivative of `point`: e_i by position, l x R' e_i by attitude."""
    D[row, T_P + i] += 1.0
    put(D, row, T_TH, 1.0, cross(triple(theta, LEVER), triple(k, K_R + 3 * i)))


@kernel
def velocity_row(k: Floats, theta: Floats, b: Vector, scale: float, D: Floats, row: int) -> float:
    """scale b' (R' v + w x l), the sensor's velocity along b;  b x u by attitude, R b by velocity, l x b by rate."""
    u, w, l = in_body(k, triple(k, K_V)), triple(k, K_W), triple(theta, LEVER)
    put(D, row, T_TH, scale, cross(b, u))
    put(D, row, T_V, scale, in_world(k, b))
    put(D, row, T_W, scale, cross(l, b))
    return scale * (dot(b, u) + dot(b, cross(w, l)))


@kernel
def target_from_origin(k: Floats, target: Vector) -> Vector:
    """r = R' (target - p): a place in the world as the body origin sees it."""
    return in_body(k, mix(1.0, target, -1.0, triple(k, K_P)))


@kernel
def target_row(k: Floats, r: Vector, g: Vector, D: Floats, row: int) -> None:
    """Derivative of g' r, g fixed in the body and r from `target_from_origin`: -R g by position, g x r by attitude."""
    put(D, row, T_P, -1.0, in_world(k, g))
    put(D, row, T_TH, 1.0, cross(g, r))
