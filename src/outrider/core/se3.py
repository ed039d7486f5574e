"""Rigid motions of space. Pose: (x y z, qx qy qz qw) of b in a; tangent xi: (rho [m], phi [rad]), translation first.

Exp(xi) = (Jl(phi) rho, Exp(phi)). Jacobians as in `outrider.core.rotations`: Exp(xi + d) = Exp(xi) Exp(Jr d) =
Exp(Jl d) Exp(xi). Outputs come last and may be an input. Source: J. Sola, "A micro Lie theory" (arXiv 1812.01537),
appendix D. Its long block Q(rho, phi) is written here as what it is, the derivative of the rotation's Jacobian along
rho: with Jl(phi) = I + b S + c S^2, S = [phi]x, P = [rho]x and m = phi' rho,

    Q = b P + c (S P + P S) + m (b' S + c' S^2),   b' = (db/dt)/t,   c' = (dc/dt)/t.
"""

from math import cos, sin, sqrt

from outrider._kernel import kernel
from outrider.core.rotations import (
    SERIES,
    cotangent,
    matrix_from_quat,
    quat_conjugate,
    quat_exp,
    quat_log,
    quat_multiply,
    rotate,
    rotate_inverse,
    sines,
    skew_polynomial,
    squared,
)
from outrider.typing import Floats


@kernel
def _apply(x: float, y: float, z: float, b: float, c: float, v: Floats, out: Floats) -> None:
    """out (3,) = (I + b S + c S^2) v, with S = [(x y z)]x."""
    v0, v1, v2 = v[0], v[1], v[2]
    a0, a1, a2 = y * v2 - z * v1, z * v0 - x * v2, x * v1 - y * v0
    out[0] = v0 + b * a0 + c * (y * a2 - z * a1)
    out[1] = v1 + b * a1 + c * (z * a0 - x * a2)
    out[2] = v2 + b * a2 + c * (x * a1 - y * a0)


@kernel
def exp(xi: Floats, pose: Floats) -> None:
    """pose (7,) = Exp(xi): fly the screw of twist xi (6,) for one unit of time."""
    _, b, c = sines(squared(xi[3:6]))
    quat_exp(xi[3:6], pose[3:7])
    _apply(xi[3], xi[4], xi[5], b, c, xi[0:3], pose[0:3])


@kernel
def log(pose: Floats, xi: Floats) -> None:
    """xi (6,) = Log(pose), |phi| <= pi: rho = Jl(phi)^-1 p."""
    quat_log(pose[3:7], xi[3:6])
    _apply(xi[3], xi[4], xi[5], -0.5, cotangent(squared(xi[3:6])), pose[0:3], xi[0:3])


@kernel
def act(pose: Floats, p: Floats, out: Floats) -> None:
    """out (3,) = p_a, the point p_b seen from a."""
    rotate(pose[3:7], p, out)
    for i in range(3):
        out[i] += pose[i]


@kernel
def compose(a: Floats, b: Floats, out: Floats) -> None:
    """out (7,) = a b: first b, then a."""
    x, y, z = a[0], a[1], a[2]
    rotate(a[3:7], b[0:3], out[0:3])
    quat_multiply(a[3:7], b[3:7], out[3:7])
    out[0] += x
    out[1] += y
    out[2] += z


@kernel
def inverse(a: Floats, out: Floats) -> None:
    """out (7,) = a^-1."""
    rotate_inverse(a[3:7], a[0:3], out[0:3])
    quat_conjugate(a[3:7], out[3:7])
    for i in range(3):
        out[i] = -out[i]


@kernel
def adjoint(pose: Floats, A: Floats) -> None:
    """A (6, 6) with pose Exp(xi) = Exp(A xi) pose:  [[R, [p]x R], [0, R]]."""
    R = A[3:6, 3:6]
    matrix_from_quat(pose[3:7], R)
    x, y, z = pose[0], pose[1], pose[2]
    for j in range(3):
        A[0, j], A[1, j], A[2, j] = R[0, j], R[1, j], R[2, j]
        A[3, j], A[4, j], A[5, j] = 0.0, 0.0, 0.0
        A[0, 3 + j] = y * R[2, j] - z * R[1, j]
        A[1, 3 + j] = z * R[0, j] - x * R[2, j]
        A[2, 3 + j] = x * R[1, j] - y * R[0, j]


@kernel
def _blocks(xi: Floats, b: float, c: float, db: float, dc: float, J: Floats) -> None:
    """J (6, 6) = [[N, Q], [0, N]]:  N = I + b S + c S^2,  Q = b P + c (S P + P S) + m (db S + dc S^2)."""
    rho, phi, Q = xi[0:3], xi[3:6], J[0:3, 3:6]
    skew_polynomial(phi, 1.0, b, c, J[0:3, 0:3])
    skew_polynomial(phi, 1.0, b, c, J[3:6, 3:6])
    m = phi[0] * rho[0] + phi[1] * rho[1] + phi[2] * rho[2]
    skew_polynomial(phi, -2.0 * m * c, m * db, m * dc, Q)  # S P + P S = phi rho' + rho phi' - 2 m I
    for i in range(3):
        for j in range(3):
            Q[i, j] += c * (phi[i] * rho[j] + rho[i] * phi[j])
            J[3 + i, j] = 0.0
    x, y, z = b * rho[0], b * rho[1], b * rho[2]
    Q[0, 1] -= z
    Q[0, 2] += y
    Q[1, 0] += z
    Q[1, 2] -= x
    Q[2, 0] -= y
    Q[2, 1] += x


@kernel
def _sine_slopes(t2: float) -> tuple[float, float, float, float]:
    """b, c of `sines` and b', c' = (d/dt)/t of them, from t^2."""
    a, b, c = sines(t2)
    if t2 < SERIES:
        db = t2 * (1 / 6720 - t2 * (1 / 453600 - t2 * (1 / 47900160 - t2 / 7264857600)))
        db = -1 / 12 + t2 * (1 / 180 - db)
        dc = t2 * (1 / 60480 - t2 * (1 / 4989600 - t2 * (1 / 622702080 - t2 / 108972864000)))
        dc = -1 / 60 + t2 * (1 / 1260 - dc)
        return b, c, db, dc
    return b, c, (a - 2.0 * b) / t2, (b - 3.0 * c) / t2


@kernel
def _cotangent_slope(t2: float) -> float:
    """(dg/dt)/t of g = `cotangent`, from t^2."""
    if t2 < SERIES:
        tail = 1 / 5987520 + t2 * (691 / 130767436800)
        return 1 / 360 + t2 * (1 / 7560 + t2 * (1 / 201600 + t2 * tail))
    t = sqrt(t2)
    s, c = sin(0.5 * t), cos(0.5 * t)
    return (0.25 / (s * s) + 0.5 * c / (s * t) - 2.0 / t2) / t2


@kernel
def left_jacobian(xi: Floats, J: Floats) -> None:
    """J (6, 6) = Jl(xi)."""
    b, c, db, dc = _sine_slopes(squared(xi[3:6]))
    _blocks(xi, b, c, db, dc, J)


@kernel
def right_jacobian(xi: Floats, J: Floats) -> None:
    """J (6, 6) = Jr(xi) = Jl(-xi): odd powers change sign."""
    b, c, db, dc = _sine_slopes(squared(xi[3:6]))
    _blocks(xi, -b, c, -db, dc, J)


@kernel
def left_jacobian_inverse(xi: Floats, J: Floats) -> None:
    """J (6, 6) = Jl(xi)^-1, whose block is the derivative of the rotation's inverse along rho;  |phi| < 2 pi."""
    t2 = squared(xi[3:6])
    _blocks(xi, -0.5, cotangent(t2), 0.0, _cotangent_slope(t2), J)


@kernel
def right_jacobian_inverse(xi: Floats, J: Floats) -> None:
    """J (6, 6) = Jr(xi)^-1;  |phi| < 2 pi."""
    t2 = squared(xi[3:6])
    _blocks(xi, 0.5, cotangent(t2), 0.0, _cotangent_slope(t2), J)
