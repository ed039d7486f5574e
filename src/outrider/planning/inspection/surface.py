"""Points spread evenly over the surface of solids, each with its outward normal."""

from dataclasses import dataclass
from math import pi
from typing import Any, Final, final

import numpy as np
from numpy.random import Generator

from outrider._kernel import kernel
from outrider.core.solids import cast, distance, gradient
from outrider.errors import ConfigError
from outrider.typing import Bools, Floats

INSIDE: Final = 1e-5  # m within which a point of one solid counts as on the surface of all


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Surface:
    """p : (n, 3) m;  normal : (n, 3) outwards;  area : m^2 that each point stands for."""

    p: Floats
    normal: Floats
    area: float

    def __len__(self) -> int:
        return len(self.p)

    def select(self, rows: Any) -> "Surface":
        """Some of the points."""
        return Surface(p=self.p[rows], normal=self.normal[rows], area=self.area)


@kernel
def touch(table: Floats, k: int, o: Floats, d: Floats, reach: float, p: Floats, normal: Floats, on: Bools) -> None:
    """Where lines from o (n, 3) along d (n, 3) enter solid k: p, normal (n, 3), and whether that is on the union."""
    one = table[k : k + 1]
    for i in range(o.shape[0]):
        t = cast(one, o[i, 0], o[i, 1], o[i, 2], d[i, 0], d[i, 1], d[i, 2], reach)
        on[i] = t < reach
        if on[i]:
            for c in range(3):
                p[i, c] = o[i, c] + t * d[i, c]
            gradient(one, p[i, 0], p[i, 1], p[i, 2], normal[i])
            near, _ = distance(table, p[i, 0], p[i, 1], p[i, 2])
            on[i] = near > -INSIDE


def surface(table: Floats, density: float, rng: Generator) -> Surface:
    """About `density` points per m^2 of the union of the solids (m, COLUMNS), evenly by area.

    Lines that are uniform in direction and place enter a convex body uniformly over its surface, and a share of
    A / (4 pi R^2) of those through a ball around it does (Cauchy).
    """
    if not density > 0.0:
        raise ConfigError(f"{density:g} points per m^2", where="surface", fix="more than none")
    made: list[tuple[Floats, Floats]] = []
    for k in range(len(table)):
        centre, radius = table[k, 19:22], 1.001 * float(table[k, 22])
        n = round(density * 4.0 * pi * radius**2)
        d, aside = rng.standard_normal((2, n, 3))
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        aside -= (aside * d).sum(axis=1, keepdims=True) * d
        aside *= radius * np.sqrt(rng.random((n, 1))) / np.linalg.norm(aside, axis=1, keepdims=True)
        p, normal, on = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros(n, np.bool_)
        touch(table, k, centre + aside - radius * d, d, 2.0 * radius, p, normal, on)
        made.append((p[on], normal[on]))
    rows = [np.concatenate([m[c] for m in made]) if made else np.zeros((0, 3)) for c in range(2)]
    return Surface(p=rows[0], normal=rows[1], area=1.0 / density)
