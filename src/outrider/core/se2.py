"""Rigid motions of the plane. Pose: (x, y, yaw) of b in a; tangent xi: (rho [m], theta [rad]), translation first.

Exp(xi) = (V(theta) rho, theta). Jacobians as in `outrider.core.rotations`: Exp(xi + d) = Exp(xi) Exp(Jr d) =
Exp(Jl d) Exp(xi). Outputs come last and may be an input. Source: J. Sola, "A micro Lie theory" (arXiv 1812.01537),
example 1 and appendix C.
"""

from math import cos, sin

from outrider._kernel import kernel
from outrider.core.angles import wrap
from outrider.core.rotations import cotangent, sines
from outrider.typing import Floats


@kernel
def exp(xi: Floats, pose: Floats) -> None:
    """pose (3,) = Exp(xi): drive the arc of twist xi (3,) for one unit of time."""
    theta = xi[2]
    s, b, _ = sines(theta * theta)
    pose[0], pose[1] = s * xi[0] - theta * b * xi[1], theta * b * xi[0] + s * xi[1]
    pose[2] = wrap(theta)


@kernel
def log(pose: Floats, xi: Floats) -> None:
    """xi (3,) = Log(pose), |theta| <= pi: rho = V(theta)^-1 p."""
    theta = wrap(pose[2])
    h, k = 1.0 - theta * theta * cotangent(theta * theta), 0.5 * theta
    xi[0], xi[1] = h * pose[0] + k * pose[1], h * pose[1] - k * pose[0]
    xi[2] = theta


@kernel
def act(pose: Floats, p: Floats, out: Floats) -> None:
    """out (2,) = p_a, the point p_b seen from a."""
    c, s = cos(pose[2]), sin(pose[2])
    out[0], out[1] = pose[0] + c * p[0] - s * p[1], pose[1] + s * p[0] + c * p[1]


@kernel
def compose(a: Floats, b: Floats, out: Floats) -> None:
    """out (3,) = a b: first b, then a."""
    yaw = wrap(a[2] + b[2])
    act(a, b, out)
    out[2] = yaw


@kernel
def inverse(a: Floats, out: Floats) -> None:
    """out (3,) = a^-1."""
    c, s = cos(a[2]), sin(a[2])
    out[0], out[1] = -c * a[0] - s * a[1], s * a[0] - c * a[1]
    out[2] = wrap(-a[2])


@kernel
def adjoint(pose: Floats, A: Floats) -> None:
    """A (3, 3) with pose Exp(xi) = Exp(A xi) pose:  [[R, (y, -x)'], [0, 1]]."""
    c, s = cos(pose[2]), sin(pose[2])
    A[0, 0], A[0, 1], A[0, 2] = c, -s, pose[1]
    A[1, 0], A[1, 1], A[1, 2] = s, c, -pose[0]
    A[2, 0], A[2, 1], A[2, 2] = 0.0, 0.0, 1.0


@kernel
def _jacobian(x: float, y: float, theta: float, J: Floats) -> None:
    """Jl of (x, y, theta); Jr is Jl of the negative."""
    s, b, c = sines(theta * theta)
    J[0, 0], J[0, 1], J[0, 2] = s, -theta * b, theta * c * x + b * y
    J[1, 0], J[1, 1], J[1, 2] = theta * b, s, theta * c * y - b * x
    J[2, 0], J[2, 1], J[2, 2] = 0.0, 0.0, 1.0


@kernel
def _jacobian_inverse(x: float, y: float, theta: float, J: Floats) -> None:
    """Jl^-1 of (x, y, theta): the block inverse [[V^-1, -V^-1 v], [0, 1]]."""
    t2 = theta * theta
    _, b, c = sines(t2)
    v, w = theta * c * x + b * y, theta * c * y - b * x
    h, k = 1.0 - t2 * cotangent(t2), 0.5 * theta
    J[0, 0], J[0, 1], J[0, 2] = h, k, -h * v - k * w
    J[1, 0], J[1, 1], J[1, 2] = -k, h, k * v - h * w
    J[2, 0], J[2, 1], J[2, 2] = 0.0, 0.0, 1.0


@kernel
def left_jacobian(xi: Floats, J: Floats) -> None:
    """J (3, 3) = Jl(xi)."""
    _jacobian(xi[0], xi[1], xi[2], J)


@kernel
def right_jacobian(xi: Floats, J: Floats) -> None:
    """J (3, 3) = Jr(xi) = Jl(-xi)."""
    _jacobian(-xi[0], -xi[1], -xi[2], J)


@kernel
def left_jacobian_inverse(xi: Floats, J: Floats) -> None:
    """J (3, 3) = Jl(xi)^-1;  |theta| < 2 pi."""
    _jacobian_inverse(xi[0], xi[1], xi[2], J)


@kernel
def right_jacobian_inverse(xi: Floats, J: Floats) -> None:
    """J (3, 3) = Jr(xi)^-1;  |theta| < 2 pi."""
    _jacobian_inverse(-xi[0], -xi[1], -xi[2], J)
