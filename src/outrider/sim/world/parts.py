"""What stands in a world: walls, solids, known objects, things that move, the fence around it."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import final

import numpy as np
from numpy.typing import ArrayLike

from outrider.core.attitudes import quats_to_matrices
from outrider.core.flat import polygon_distance, upright
from outrider.core.solids import COLUMNS, moved
from outrider.errors import ConfigError
from outrider.typing import Floats


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Wall:
    """An upright prism: outline (n, 2) of its plan [m], either way round, between the heights `low` and `high` [m]."""

    name: str
    outline: Floats
    low: float = 0.0
    high: float = 3.0


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Solids:
    """Signed-distance solids: table (m, 24) of `core.solids` with a name for every row; parts may share one."""

    table: Floats = field(default_factory=lambda: np.zeros((0, COLUMNS)))
    names: tuple[str, ...] = ()

    @classmethod
    def of(cls, *parts: tuple[str, Floats]) -> "Solids":
        """From names and rows."""
        return cls(table=np.array([row for _, row in parts]).reshape(-1, COLUMNS), names=tuple(n for n, _ in parts))

    def moved(self, p: ArrayLike, q: ArrayLike) -> "Solids":
        """Carried by a pose from their own frame: p (3,) m, q (4,) x y z w."""
        R = quats_to_matrices(np.asarray(q, float)[None])[0]
        return Solids(table=moved(self.table, np.asarray(p, float), R), names=self.names)

    def __add__(self, other: "Solids") -> "Solids":
        return Solids(table=np.vstack([self.table, other.table]), names=self.names + other.names)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Body:
    """A known object: its pose p (3,) m, q (4,) x y z w in the site frame, and named points (3,) m in its own."""

    p: Floats
    q: Floats
    features: dict[str, Floats] = field(default_factory=dict)

    def feature(self, name: str) -> Floats:
        """(3,) m: a named point in the site frame. An unknown name: `ConfigError`."""
        if name not in self.features:
            raise ConfigError(f"no feature {name!r}", fix=f"one of {', '.join(self.features) or 'none'}")
        return self.p + quats_to_matrices(self.q[None])[0] @ self.features[name]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Mover:
    """An upright cylinder on a script: its foot is at p (m, 3) [m] at t_s (m,) [s since the start], straight between.

    Before the first and after the last stamp it stands. radius, height [m].
    """

    name: str
    t_s: Floats
    p: Floats
    radius: float = 0.3
    height: float = 1.75

    @classmethod
    def along(
        cls,
        name: str,
        points: Sequence[Sequence[float]],
        speed: float,
        *,
        start_s: float = 0.0,
        radius: float = 0.3,
        height: float = 1.75,
    ) -> "Mover":
        """Passes points (m, 2) or (m, 3) [m] at a constant speed [m/s] from `start_s` [s] on. Sized as a person."""
        if not speed > 0.0:
            raise ConfigError(
                f"a speed of {speed:g} m/s", where=name, fix="a positive speed; one that stands has one point"
            )
        p = np.zeros((len(points), 3))
        p[:, : len(points[0])] = points
        legs = np.linalg.norm(np.diff(p, axis=0), axis=1)
        t = start_s + np.concatenate([[0.0], np.cumsum(legs)]) / speed
        return cls(name=name, t_s=t, p=p, radius=radius, height=height)

    def at(self, t_s: ArrayLike) -> Floats:
        """(..., 3) m: where its foot is at times (...) [s]."""
        t = np.asarray(t_s, np.float64)
        return np.stack([np.interp(t, self.t_s, self.p[:, i]) for i in range(3)], axis=-1)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Fence:
    """Where robots may be: inside polygon (n, 2) [m], between floor and ceiling [m]."""

    polygon: Floats
    floor: float = -np.inf
    ceiling: float = np.inf

    def margin(self, p: Floats) -> Floats:
        """(n,) m: distance of points (n, 3) from the fence, negative once outside."""
        outline = np.ascontiguousarray(self.polygon)
        flat = [polygon_distance(outline, 0, len(outline), float(x), float(y)) for x, y in p[:, :2]]
        pairs = zip(flat, p[:, 2], strict=True)
        return np.array([-upright(d, self.floor, self.ceiling, float(z)) for d, z in pairs])
