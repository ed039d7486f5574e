"""A rigid body under rotors: thrust and torque, linear drag against the air, Euler's equations, RK4.

theta begins with step, gravity, mass, inertia (3), drag (3), lag of the rotors; a row of `rotors` with x, y, spin,
thrust and torque coefficient. Each rotor answers with a lag, Omega(t) = goal + (Omega - goal) exp(-t / lag), so that
the stages of a step see its exact speed:  T = sum k_T Omega^2,  torque = sum (y T, -x T, -spin k_Q Omega^2).
"""

from math import exp
from typing import Final

from outrider._kernel import kernel
from outrider.models.vehicles.airborne import X_A, X_OWN, X_P, X_Q, X_V, X_W, in_body, in_world, put_quat
from outrider.models.vehicles.base import STILL
from outrider.typing import Floats

X_ROTORS: Final = X_OWN + 3  # after three integrals of the controller: speeds, then goals [rad/s]

Quadruple = tuple[float, float, float, float]
Triple = tuple[float, float, float]
Rates = tuple[float, ...]  # of q (4), v (3) and w (3)


@kernel
def wrench(x: Floats, rotors: Floats, keep: float) -> Quadruple:
    """Thrust [N] and torque (3) [N m] once the way of every rotor to its goal has shrunk by the factor `keep`."""
    n = rotors.shape[0]
    force, roll, pitch, yaw = 0.0, 0.0, 0.0, 0.0
    for i in range(n):
        goal = x[X_ROTORS + n + i]
        speed = goal + (x[X_ROTORS + i] - goal) * keep
        square = speed * speed
        thrust = rotors[i, 3] * square
        force += thrust
        roll += rotors[i, 1] * thrust
        pitch -= rotors[i, 0] * thrust
        yaw -= rotors[i, 2] * rotors[i, 4] * square
    return force, roll, pitch, yaw


@kernel
def rates(q: Quadruple, v: Triple, w: Triple, m: Quadruple, air: Triple, theta: Floats) -> Rates:
    """q' = q w / 2,  v' = R (T e_z - D R' (v - air)) / m - g e_z,  J w' = torque - w x J w."""
    x, y, z, s = q
    xx, yy, zz, xy, xz, yz, sx, sy, sz = x * x, y * y, z * z, x * y, x * z, y * z, s * x, s * y, s * z
    r00, r01, r02 = 1.0 - 2.0 * (yy + zz), 2.0 * (xy - sz), 2.0 * (xz + sy)
    r10, r11, r12 = 2.0 * (xy + sz), 1.0 - 2.0 * (xx + zz), 2.0 * (yz - sx)
    r20, r21, r22 = 2.0 * (xz - sy), 2.0 * (yz + sx), 1.0 - 2.0 * (xx + yy)
    e, n, u = v[0] - air[0], v[1] - air[1], v[2] - air[2]
    per = 1.0 / theta[2]
    f0 = -theta[6] * (r00 * e + r10 * n + r20 * u) * per
    f1 = -theta[7] * (r01 * e + r11 * n + r21 * u) * per
    f2 = (m[0] - theta[8] * (r02 * e + r12 * n + r22 * u)) * per
    j0, j1, j2 = theta[3], theta[4], theta[5]
    a, b, c = w
    return (
        0.5 * (s * a + y * c - z * b),
        0.5 * (s * b + z * a - x * c),
        0.5 * (s * c + x * b - y * a),
        -0.5 * (x * a + y * b + z * c),
        r00 * f0 + r01 * f1 + r02 * f2,
        r10 * f0 + r11 * f1 + r12 * f2,
        r20 * f0 + r21 * f1 + r22 * f2 - theta[1],
        (m[1] - (j2 - j1) * b * c) / j0,
        (m[2] - (j0 - j2) * c * a) / j1,
        (m[3] - (j1 - j0) * a * b) / j2,
    )


@kernel
def moved_by(q: Quadruple, v: Triple, w: Triple, k: Rates, h: float) -> tuple[Quadruple, Triple, Triple]:
    """(q, v, w) + h k."""
    return (
        (q[0] + h * k[0], q[1] + h * k[1], q[2] + h * k[2], q[3] + h * k[3]),
        (v[0] + h * k[4], v[1] + h * k[5], v[2] + h * k[6]),
        (w[0] + h * k[7], w[1] + h * k[8], w[2] + h * k[9]),
    )


@kernel
def rigid_step(x: Floats, air: Triple, theta: Floats, rotors: Floats) -> None:
    """One step of Runge and Kutta's fourth order over p, q, v, w; the rotors' speeds exactly; a at the end."""
    h, lag = theta[0], theta[9]
    keep = exp(-0.5 * h / lag)
    first, middle, last = wrench(x, rotors, 1.0), wrench(x, rotors, keep), wrench(x, rotors, keep * keep)
    q = (x[X_Q], x[X_Q + 1], x[X_Q + 2], x[X_Q + 3])
    v, w = (x[X_V], x[X_V + 1], x[X_V + 2]), (x[X_W], x[X_W + 1], x[X_W + 2])
    k1 = rates(q, v, w, first, air, theta)
    q2, v2, w2 = moved_by(q, v, w, k1, 0.5 * h)
    k2 = rates(q2, v2, w2, middle, air, theta)
    q3, v3, w3 = moved_by(q, v, w, k2, 0.5 * h)
    k3 = rates(q3, v3, w3, middle, air, theta)
    q4, v4, w4 = moved_by(q, v, w, k3, h)
    k4 = rates(q4, v4, w4, last, air, theta)
    c = h / 6.0
    for i in range(3):
        x[X_P + i] += c * (v[i] + 2.0 * (v2[i] + v3[i]) + v4[i])
    for i in range(3):
        x[X_V + i] += c * (k1[4 + i] + 2.0 * (k2[4 + i] + k3[4 + i]) + k4[4 + i])
        x[X_W + i] += c * (k1[7 + i] + 2.0 * (k2[7 + i] + k3[7 + i]) + k4[7 + i])
    for i in range(4):
        x[X_Q + i] += c * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i])
    put_quat(x, x[X_Q], x[X_Q + 1], x[X_Q + 2], x[X_Q + 3])
    spin_rotors(x, rotors.shape[0], keep * keep)
    accelerate(x, air, theta, rotors)


@kernel
def accelerate(x: Floats, air: Triple, theta: Floats, rotors: Floats) -> None:
    """Write the acceleration of the state as it is now."""
    per = 1.0 / theta[2]
    e, n, u = in_body(x, x[X_V] - air[0], x[X_V + 1] - air[1], x[X_V + 2] - air[2])
    force = wrench(x, rotors, 1.0)[0]
    a, b, c = -theta[6] * e * per, -theta[7] * n * per, (force - theta[8] * u) * per
    x[X_A], x[X_A + 1], x[X_A + 2] = in_world(x, a, b, c)
    x[X_A + 2] -= theta[1]


@kernel
def spin_rotors(x: Floats, n: int, keep: float) -> None:
    """Every rotor comes nearer to its goal by the factor `keep`."""
    for i in range(n):
        goal = x[X_ROTORS + n + i]
        speed = goal + (x[X_ROTORS + i] - goal) * keep
        x[X_ROTORS + i] = speed if abs(speed - goal) > STILL else goal
