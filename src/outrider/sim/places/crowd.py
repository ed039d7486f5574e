"""People who cross a robot's way, walk along it, or stop in it, and look at nothing."""

from collections.abc import Sequence
from math import hypot

import numpy as np
from numpy.random import Generator

from outrider.sim.world import Mover
from outrider.typing import Floats

WALKING = 1.4  # m/s


def crowd(
    rng: Generator, way: Sequence[Sequence[float]], speed: float, count: int, *, side: float = 3.0, stops: float = 0.4
) -> tuple[Mover, ...]:
    """So many people who meet a robot that goes at `speed` [m/s] along the polyline `way` (n, 2) m from time 0 on.

    Half of them cross it, one in four comes along it, and one in four goes with it.
    Each is where the robot would be alone at about the same time, within two seconds. A share `stops` of them stands
    still for 3 to 8 s on the way; nobody starts within 3 m of the robot, stays near its way, or walks into another.
    side : m that they walk before and after, and as far again to leave, straight on.
    """
    line = np.array(way, np.float64)
    gone = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    out: list[Mover] = []
    while len(out) < count:
        s = rng.uniform(3.0, gone[-1] - 1.5)
        here = np.array([np.interp(s, gone, line[:, k]) for k in range(2)])
        k = int(np.searchsorted(gone, s, side="right")) - 1
        ahead = (line[k + 1] - line[k]) / hypot(*(line[k + 1] - line[k]))
        aside = np.array([-ahead[1], ahead[0]]) * rng.choice([-1.0, 1.0])
        kind, meets = rng.choice(4), s / speed + rng.uniform(-2.0, 2.0)
        if kind < 2:  # across, at a slant
            along = aside + rng.uniform(-0.3, 0.3) * ahead
        else:
            along = ahead if kind == 2 else -ahead
            here = here + rng.uniform(-0.6, 0.6) * aside
        person = _walk(f"person {len(out) + 1}", here, along / hypot(*along), meets, side, rng, stops=stops)
        if hypot(*(person.at(0.0)[:2] - line[0])) > 3.0 and not any(_meet(person, other) for other in out):
            out.append(person)
    return tuple(out)


def _walk(name: str, here: Floats, along: Floats, meets: float, reach: float, rng: Generator, *, stops: float) -> Mover:
    """Through `here` at time `meets`, from `reach` metres before to twice as far behind; perhaps with a rest there."""
    before = min(reach, WALKING * max(meets, 0.0))
    t = [meets - before / WALKING, meets]
    p = [here - before * along, here]
    if rng.random() < stops:
        t.append(t[-1] + rng.uniform(3.0, 8.0))
        p.append(here)
    t.append(t[-1] + 2.0 * reach / WALKING)
    p.append(here + 2.0 * reach * along)
    return Mover(name=name, t_s=np.array(t), p=np.column_stack([np.array(p), np.zeros(len(p))]), height=1.75)


def _meet(a: Mover, b: Mover) -> bool:
    """Whether two people ever touch, or pass through one another."""
    t = np.arange(0.0, max(a.t_s[-1], b.t_s[-1]) + 0.1, 0.1)
    return bool((np.linalg.norm(a.at(t) - b.at(t), axis=-1) < a.radius + b.radius + 0.1).any())
