"""The cost of a timed elastic band: one function per term, residual and derivatives together.

The cost is a sum of squares r^2. Every term has the form `term(v, theta, a, g) -> r`: v are its variables, theta and a
its parameters, and g becomes dr/dv. Limits are one-sided: r = 0 while they are kept. Residuals are shares of a limit,
so that one weight serves all bases. By the registry `TERMS` tests find the terms and compare g with finite differences.

Source: amr2025 (19)-(22), after Roesmann et al. (2012, 2017); where ours differ, the docstring says so.
"""

from collections.abc import Callable, Mapping
from math import sqrt
from typing import Final, NamedTuple

from outrider._kernel import inlined
from outrider.typing import Floats

CREEP: Final = 0.02  # of top speed


@inlined
def duration(v: Floats, theta: Floats, a: float, g: Floats) -> float:
    """v = t_k, t_k+1.  r = T = t_k+1 - t_k, so that steps are equal and their sum is short."""
    g[0], g[1] = -1.0, 1.0
    return v[1] - v[0]


@inlined
def evenness(v: Floats, theta: Floats, a: float, g: Floats) -> float:
    """v = t_k-1, t_k, t_k+1;  a = 1 / wanted step.  r = a times the difference of two steps.

    Not in the usual form. Steps that are free to shrink do so, one after the other, to where every derivative is
    large; this costs nothing once they are equal.
    """
    g[0], g[1], g[2] = a, -2.0 * a, a
    return a * (v[0] - 2.0 * v[1] + v[2])


@inlined
def velocity(v: Floats, theta: Floats, a: float, g: Floats) -> float:
    """v = u, the twist of a step;  theta = row of `DriveLimits.rows`;  a = share of the limits to use.

    r = how far theta[:3] u is outside (a low, a high). For mecanum wheels the rows make the exact octahedron.
    """
    y = theta[0] * v[0] + theta[1] * v[1] + theta[2] * v[2]
    low, high = a * theta[3], a * theta[4]
    side = 1.0 if y > high else -1.0 if y < low else 0.0
    g[0], g[1], g[2] = side * theta[0], side * theta[1], side * theta[2]
    return y - high if side > 0.0 else low - y if side < 0.0 else 0.0


@inlined
def acceleration(v: Floats, theta: Floats, a: float, g: Floats) -> float:
    """v = du/dt;  theta = an axis in shares of its limit (3,);  a = share to use.  r = |theta v| - a if positive."""
    y = theta[0] * v[0] + theta[1] * v[1] + theta[2] * v[2]
    side = 1.0 if y > a else -1.0 if y < -a else 0.0
    g[0], g[1], g[2] = side * theta[0], side * theta[1], side * theta[2]
    return side * y - a if side != 0.0 else 0.0


@inlined
def slip(v: Floats, theta: Floats, a: float, g: Floats) -> float:
    """v = u;  a = 1 / top speed.  r = a u_y / sqrt(CREEP + a |u_x|): both poses on one circular arc, for bases that do
    not go sideways.

    On a chord the mean heading is the chord's, so u_y in that frame is the usual non-holonomic residual over T. Squared
    and over time, r is the way gone aside: without the root going aside would be the cheaper the slower it is done.
    """
    s = 1.0 / (CREEP + a * abs(v[0]))
    root = sqrt(s)
    g[0], g[1], g[2] = -0.5 * a * a * (1.0 if v[0] >= 0.0 else -1.0) * v[1] * s * root, a * root, 0.0
    return a * v[1] * root


@inlined
def turning_radius(v: Floats, theta: Floats, a: float, g: Floats) -> float:
    """v = u;  theta[0] = smallest radius;  a = 1 / top speed.  r = a (theta |w| - |u_x|) if positive.

    Without the division by w of the usual form: no pole on a straight line.
    """
    r = a * (theta[0] * abs(v[2]) - abs(v[0]))
    if r <= 0.0:
        g[0], g[1], g[2] = 0.0, 0.0, 0.0
        return 0.0
    g[0], g[1], g[2] = -a if v[0] >= 0.0 else a, 0.0, a * theta[0] if v[2] >= 0.0 else -a * theta[0]
    return r


@inlined
def backward(v: Floats, theta: Floats, a: float, g: Floats) -> float:
    """v = u;  a = 1 / top speed.  r = -a u_x if positive: prefer to drive forward."""
    g[0], g[1], g[2] = -a if v[0] < 0.0 else 0.0, 0.0, 0.0
    return -a * v[0] if v[0] < 0.0 else 0.0


@inlined
def turning(v: Floats, theta: Floats, a: float, g: Floats) -> float:
    """v = u;  a = 1 / top turn rate.  r = a w: what nothing else decides is driven without turning.

    Not in the usual form. Below the limits a turn and back costs no time, and rounding errors would choose.
    """
    g[0], g[1], g[2] = 0.0, 0.0, a
    return a * v[2]


@inlined
def obstacle(v: Floats, theta: Floats, a: float, g: Floats) -> float:
    """v = x, y, t of a disc of the body;  theta = x, y, reach, v_x, v_y, horizon of an obstacle;  a = 1 / wanted gap.

    r = a (reach - |c - o(t)|) if positive, o(t) = o + v min(t, horizon). The gradient runs through the time, too: a
    band may let somebody pass.
    """
    on = v[2] < theta[5]
    t = v[2] if on else theta[5]
    dx, dy = v[0] - theta[0] - theta[3] * t, v[1] - theta[1] - theta[4] * t
    d2 = dx * dx + dy * dy
    if d2 >= theta[2] * theta[2]:
        g[0], g[1], g[2] = 0.0, 0.0, 0.0
        return 0.0
    d = sqrt(d2)
    nx, ny = (dx / d, dy / d) if d > 1e-9 else (0.0, 1.0)
    g[0], g[1] = -a * nx, -a * ny
    g[2] = a * (nx * theta[3] + ny * theta[4]) if on else 0.0
    return a * (theta[2] - d)


@inlined
def passing(v: Floats, theta: Floats, a: float, g: Floats) -> float:
    """v = x, y of a disc of the body, and its velocity u_x, u_y in any frame;  theta = x, y, reach of what may set off,
    slowest speed;  a = 1 / seconds from when it sets off until the robot stands.

    r = |u| / most - 1 if positive, most = a (|c - o| - reach), but no less than the slowest: the robot is only as fast
    as it can stop within the gap that there is.
    """
    dx, dy = v[0] - theta[0], v[1] - theta[1]
    d, u = sqrt(dx * dx + dy * dy), sqrt(v[2] * v[2] + v[3] * v[3])
    most = a * (d - theta[2])
    slow = most < theta[3]
    most = theta[3] if slow else most
    if u <= most:
        g[0], g[1], g[2], g[3] = 0.0, 0.0, 0.0, 0.0
        return 0.0
    f, h = 0.0 if slow else a * u / (most * most * d), 1.0 / (u * most)
    g[0], g[1], g[2], g[3] = -f * dx, -f * dy, h * v[2], h * v[3]
    return u / most - 1.0


@inlined
def mapped(v: Floats, theta: Floats, a: float, g: Floats, field: Floats) -> float:
    """v = x, y of a disc of the body;  theta = west, south, resolution, reach;  a = 1 / wanted gap;  field: distances.

    r = a (reach - d(x, y)) if positive, d bilinear between the centres of cells and constant beyond them.
    """
    rows, cols = field.shape
    px, py = (v[0] - theta[0]) / theta[2] - 0.5, (v[1] - theta[1]) / theta[2] - 0.5
    x, y = min(max(px, 0.0), cols - 1.0), min(max(py, 0.0), rows - 1.0)
    col, row = min(int(x), max(cols - 2, 0)), min(int(y), max(rows - 2, 0))
    right, up = min(col + 1, cols - 1), min(row + 1, rows - 1)
    s, t = x - col, y - row
    p, q, b, c = field[row, col], field[row, right], field[up, col], field[up, right]
    d = (1.0 - t) * ((1.0 - s) * p + s * q) + t * ((1.0 - s) * b + s * c)
    if d >= theta[3]:
        g[0], g[1] = 0.0, 0.0
        return 0.0
    g[0] = -a * ((1.0 - t) * (q - p) + t * (c - b)) / theta[2] if x == px else 0.0
    g[1] = -a * ((1.0 - s) * (b - p) + s * (c - q)) / theta[2] if y == py else 0.0
    return a * (theta[3] - d)


class Term(NamedTuple):
    """A term, how many variables it has, and parameters (theta, a) with which it is not zero everywhere."""

    residual: Callable[..., float]
    size: int
    theta: tuple[float, ...]
    a: float


TERMS: Final[Mapping[str, Term]] = {
    "duration": Term(duration, 2, (), 1.0),
    "evenness": Term(evenness, 3, (), 3.0),
    "velocity": Term(velocity, 3, (1.2, -0.8, 0.5, -0.4, 0.9), 0.98),
    "acceleration": Term(acceleration, 3, (1.5, 0.2, -0.3), 0.9),
    "slip": Term(slip, 3, (), 2.0),
    "turning_radius": Term(turning_radius, 3, (1.3,), 0.7),
    "backward": Term(backward, 3, (), 1.5),
    "turning": Term(turning, 3, (), 0.8),
    "obstacle": Term(obstacle, 3, (0.1, -0.2, 1.5, 0.3, -0.4, 0.5), 2.0),
    "passing": Term(passing, 4, (0.1, -0.2, 0.3, 0.4), 1.1),
    "mapped": Term(mapped, 2, (-1.6, -1.4, 0.4, 1.1), 1.3),
}
