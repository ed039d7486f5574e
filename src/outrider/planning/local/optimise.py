"""Levenberg-Marquardt on a band that keeps its time steps near the wanted one."""

from math import inf
from typing import Final

from outrider._kernel import kernel
from outrider.core.angles import wrap
from outrider.planning.local.banded import BAND, factor, solve
from outrider.planning.local.normal import assemble, stiffness
from outrider.planning.local.problem import KNOT, Problem, Work
from outrider.typing import Floats

SHORTEST: Final = 0.25  # of its time a step may keep in one iteration
FURTHEST: Final = 1.0  # m that a knot moves in one iteration
TURNED: Final = 0.5  # rad
FEWEST: Final = 4  # knots


@kernel
def resize(w: Work, n: int, dt: float) -> int:
    """Sample the band w.z anew at equal steps if they are not near dt; returns the number of knots."""
    z, trial, span = w.z[0], w.z[1], w.z[0, n - 1, 3]
    if 1.25 * span >= dt * (n - 1) >= 0.85 * span:
        return n
    m = min(max(int(span / dt + 0.5) + 1, FEWEST), z.shape[0])
    if m == n:
        return n
    j = 0
    for i in range(m):
        t = span * i / (m - 1)
        while j < n - 2 and z[j + 1, 3] < t:
            j += 1
        s = min((t - z[j, 3]) / (z[j + 1, 3] - z[j, 3]), 1.0)
        trial[i, 0] = z[j, 0] + s * (z[j + 1, 0] - z[j, 0])
        trial[i, 1] = z[j, 1] + s * (z[j + 1, 1] - z[j, 1])
        trial[i, 2] = wrap(z[j, 2] + s * wrap(z[j + 1, 2] - z[j, 2]))
        trial[i, 3] = t
    for i in range(m):
        for k in range(KNOT):
            z[i, k] = trial[i, k]
    return m


@kernel
def moved(z: Floats, n: int, dx: Floats, out: Floats) -> None:
    """out <- z + a dx, with the largest a <= 1 that keeps SHORTEST of every time step and moves no knot too far."""
    a = 1.0
    for i in range(1, n):
        j = KNOT * i
        T, change = z[i, 3] - z[i - 1, 3], dx[j + 3] - dx[j - 1]
        if a * change < (SHORTEST - 1.0) * T:
            a = (SHORTEST - 1.0) * T / change
        most = max(abs(dx[j]) / FURTHEST, abs(dx[j + 1]) / FURTHEST, abs(dx[j + 2]) / TURNED)
        if a * most > 1.0:
            a = 1.0 / most
    for i in range(n):
        for k in range(KNOT):
            out[i, k] = z[i, k] + a * dx[KNOT * i + k]
        out[i, 2] = wrap(out[i, 2])


@kernel
def descend(n: int, p: Problem, w: Work, iterations: int, tolerance: float) -> tuple[float, int]:
    """Minimise from w.z on; returns cost and iterations used. Ends when an iteration gains less than `tolerance`."""
    size, z, trial = KNOT * n, w.z[0], w.z[1]
    normal, normal_trial, D, L = w.M[0], w.M[1], w.M[2], w.M[3]
    b, b_trial, dx = w.b[0], w.b[1], w.b[2]
    cost, damping = assemble(z, n, p, w.u, w.s, normal, b), 1e-2
    stiffness(z, n, p, w.u, w.s, D, w.b[3])
    gain, used = inf, 0
    while used < iterations:
        used += 1
        for j in range(size + BAND):
            dx[j] = b[j]
            for m in range(BAND):
                L[j, m] = normal[j, m] + damping * D[j, m]
            L[j, 0] += 1e-2 * damping * (normal[j, 0] + 1e-3)
        new = inf
        if factor(L, size):
            solve(L, size, dx)
            moved(z, n, dx, trial)
            new = assemble(trial, n, p, w.u, w.s, normal_trial, b_trial)
        if not new < cost:
            damping *= 8.0
            if damping > 1e5:
                break
            continue
        gain = (cost - new) / cost
        z, trial, normal, normal_trial, b, b_trial = trial, z, normal_trial, normal, b_trial, b
        stiffness(z, n, p, w.u, w.s, D, w.b[3])
        cost, damping = new, max(damping * 0.2, 1e-6)
        if gain < tolerance:
            break
    for i in range(n):
        for m in range(KNOT):
            w.z[0, i, m] = z[i, m]
    return cost, used


def optimise(n: int, p: Problem, w: Work, passes: int, iterations: int, tolerance: float) -> tuple[int, float, int]:
    """Resize and descend, in turn; returns knots, cost, iterations. The band is w.z.

    No kernel: what calls a kernel is compiled together with it once more.
    """
    used, cost = 0, 0.0
    for k in range(passes):
        before, n = n, resize(w, n, p.dt)
        if k > 0 and n == before:
            break
        cost, more = descend(n, p, w, iterations, tolerance)
        used += more
    return n, cost, used
