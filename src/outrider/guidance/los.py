"""The guidance of swarm2023: a line of sight and a speed that depends on the distance. Baselines, see `pursuit`."""

from math import atan, atan2, cos, hypot, pi, sin

from outrider._kernel import kernel
from outrider.typing import Floats


@kernel
def line_of_sight(p: Floats, q: Floats, speed: float, out: Floats) -> None:
    """out (3,) <- a level velocity from p towards q: the course is atan2(dy, dx).  swarm2023 (1)-(3), repaired.

    Over the target there is no course: it hovers.
    """
    dx, dy = q[0] - p[0], q[1] - p[1]
    there = dx == 0.0 and dy == 0.0
    course = atan2(dy, dx)
    out[0], out[1], out[2] = (0.0, 0.0, 0.0) if there else (speed * cos(course), speed * sin(course), 0.0)


@kernel
def line_of_sight_printed(p: Floats, q: Floats, speed: float, out: Floats) -> None:
    """As printed, which does not lead to the target: atan(dx / dy) with v_x = v cos.  swarm2023 (1)-(3).

    The axes are swapped and the quadrant is lost. Kept for comparison.
    """
    dx, dy = q[0] - p[0], q[1] - p[1]
    course = atan(dx / dy) if dy != 0.0 else 0.5 * pi if dx > 0.0 else -0.5 * pi
    out[0], out[1], out[2] = speed * cos(course), speed * sin(course), 0.0


@kernel
def zone_speed(distance: float, R_d: float, v_target: float, v_most: float) -> float:
    """Speed along the line of sight [m/s]: through (R_d/2, 0), (R_d, v_target), (3 R_d/2, v_most).  swarm2023 (38).

    Continuous: the lower branch as printed (1.5 R_d instead of 0.5) jumps at R_d. Its equilibrium is R_d itself, so
    noise and delay put the follower inside.
    """
    if distance >= R_d:
        v = v_most + (v_most - v_target) / (0.5 * R_d) * (distance - 1.5 * R_d)
    else:
        v = v_target / (0.5 * R_d) * (distance - 0.5 * R_d)
    return min(max(v, 0.0), v_most)


@kernel
def zone_speed_printed(distance: float, R_d: float, v_target: float, v_most: float) -> float:
    """As printed, with a jump from v_target to a dead stop at R_d.  swarm2023 (38)."""
    if distance >= R_d:
        return zone_speed(distance, R_d, v_target, v_most)
    return min(max(v_target / (0.5 * R_d) * (distance - 1.5 * R_d), 0.0), v_most)


@kernel
def separation(p: Floats, q: Floats) -> float:
    """The distance in space [m].  swarm2023 (37)"""
    return hypot(hypot(q[0] - p[0], q[1] - p[1]), q[2] - p[2])
