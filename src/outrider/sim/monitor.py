"""What the simulator watches over the agents' heads, against truth: collisions, separation, the fence, the ground.

A robot is an upright cylinder on its body origin. Against the world it is as many balls as its rim needs. The ground
is what robots stand on: only who flies collides with it, once it is aloft and unless it lands on purpose.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import combinations
from math import hypot, inf
from typing import TypeVar, final

import numpy as np

from outrider.errors import ConfigError
from outrider.sim.truth import Truth
from outrider.sim.world import World
from outrider.typing import Floats, Ints

K = TypeVar("K")

LOOKS_HZ = 20.0
RIM = 12  # balls around a flat hull
NEAR = 1.0  # m: from here on a hull counts with its shape
ALOFT = 0.3  # m over the ground: who flies and has been there has taken off
TOUCH = 0.005  # m over the ground: it touches
GROUND = "the ground"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Hull:
    """The cylinder of one robot [m]."""

    radius: float = 0.3
    height: float = 0.5

    def __post_init__(self) -> None:
        if not (self.radius > 0.0 and self.height > 0.0):
            raise ConfigError(f"a cylinder of {self.radius:g} m, {self.height:g} m high", where="size", fix="above 0 m")

    def balls(self) -> Floats:
        """(m, 3) centres, from the middle of the cylinder, of equal balls that fill it to its walls or to its ends."""
        slack, up = self.radius - self.height / 2, np.array([0.0, 0.0, 1.0])
        if slack <= 0.0:
            return np.linspace(slack, -slack, 5)[:, None] * up
        angles = np.linspace(0.0, 2 * np.pi, RIM, endpoint=False)
        rim = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(RIM)]) * slack
        return np.vstack([np.zeros((1, 3)), rim])


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Closest:
    """The closest a robot came to something. distance [m] between the surfaces;  t : ns;  what : its name."""

    robot: str
    what: str
    distance: float
    t: int


def _nobody(robot: str, t: int) -> bool:
    return False


@final
@dataclass(slots=True)
class Monitor:
    """Everything watched in one run; the closest moment is kept of each robot to the world, to
    each other robot, and to the fence (negative: outside). flyers : who must not touch the ground in flight."""

    world: World
    hulls: Mapping[str, Hull]
    start: int
    flyers: frozenset[str] = frozenset()
    clearances: dict[str, Closest] = field(default_factory=dict[str, Closest])
    separations: dict[tuple[str, str], Closest] = field(default_factory=dict[tuple[str, str], Closest])
    fences: dict[str, Closest] = field(default_factory=dict[str, Closest])
    _aloft: set[str] = field(default_factory=set[str])

    def look(self, team: Mapping[str, Truth], lands: Callable[[str, int], bool] = _nobody) -> Closest | None:
        """Watch one segment of everybody's truth; the first collision in it, if any.

        lands : whether a robot comes down on purpose at that time [ns]
        """
        hits: list[Closest] = []
        for name, truth in team.items():
            hits += self._against_world(truth)
            hits += self._against_ground(truth, lands) if name in self.flyers else []
            self._against_fence(truth)
        for a, b in combinations(sorted(team), 2):
            hits += self._against_another(team[a], team[b])
        return min(hits, key=lambda hit: hit.t, default=None)

    def clearance(self, truth: Truth) -> tuple[Ints, Floats]:
        """Stamps (n,) [ns] of looks along a truth, and the distances (n,) [m] of the robot to the world then."""
        rows = _looks(truth)
        return truth.t[rows], self._gaps(self.hulls[truth.robot], *self._seen(truth, rows))[0]

    def separation(self, a: Truth, b: Truth) -> tuple[Ints, Floats]:
        """Stamps (n,) [ns] of looks, and the distances (n,) [m] between two robots then."""
        one, two, rows = self.hulls[a.robot], self.hulls[b.robot], _looks(a)
        t = a.t[rows]
        d = _positions(b, t) - a.p[rows]
        sideways = np.hypot(d[:, 0], d[:, 1]) - one.radius - two.radius
        above = np.maximum(d[:, 2] - one.height, -d[:, 2] - two.height)
        both = (sideways > 0) & (above > 0)
        return t, np.where(both, np.hypot(sideways, above), np.maximum(sideways, above))

    def _seen(self, truth: Truth, rows: slice) -> tuple[Floats, Floats]:
        """The middles of a robot's hull (n, 3), and the seconds (n,) since the start."""
        middle = truth.p[rows] + np.array([0.0, 0.0, self.hulls[truth.robot].height / 2])
        return middle, np.asarray((truth.t[rows] - self.start) * 1e-9, np.float64)

    def _against_world(self, truth: Truth) -> list[Closest]:
        rows = _looks(truth)
        t = truth.t[rows]
        gap, what = self._gaps(self.hulls[truth.robot], *self._seen(truth, rows))
        if _farther(gap, self.clearances.get(truth.robot)):
            return []
        closest = [Closest(robot=truth.robot, what=what(k), distance=float(gap[k]), t=int(t[k])) for k in _telling(gap)]
        for one in closest:
            _keep(self.clearances, truth.robot, one)
        return [one for one in closest if one.distance < 0.0][:1]

    def _against_ground(self, truth: Truth, lands: Callable[[str, int], bool]) -> list[Closest]:
        """Where who was in the air touches the ground; a landing ends the flight instead."""
        name, height = truth.robot, truth.p[:, 2] - self.world.ground.height(truth.p)
        down = height <= TOUCH
        if name not in self._aloft:
            up = np.flatnonzero(height > ALOFT)
            if not up.size:
                return []
            self._aloft.add(name)
            down[: up[0]] = False
        if not down.any():
            return []
        k = int(np.argmax(down))
        if lands(name, int(truth.t[k])):
            self._aloft.discard(name)
            return []
        hit = Closest(robot=name, what=GROUND, distance=min(float(height[k]), 0.0), t=int(truth.t[k]))
        _keep(self.clearances, name, hit)
        return [hit]

    def _gaps(self, hull: Hull, centre: Floats, seconds: Floats) -> tuple[Floats, Callable[[int], str]]:
        """(n,) distances of the hull's surface, exact to the gaps between its balls where something is near, and what
        is nearest in a given row."""
        ball = min(hull.radius, hull.height / 2)
        gap = self.world.clearance(centre, seconds) - hypot(hull.radius, hull.height / 2)
        near = np.flatnonzero(gap < NEAR)
        if near.size:
            points = centre[near, None] + hull.balls()[None]
            m = points.shape[1]
            around = self.world.clearance(points.reshape(-1, 3), np.repeat(seconds[near], m)).reshape(-1, m) - ball
            gap[near] = around.min(axis=1)

        def what(k: int) -> str:
            if gap[k] >= NEAR:
                return self.world.nearest(centre[k : k + 1], seconds[k : k + 1])[0]
            places = centre[k] + hull.balls()
            at = int(np.argmin(self.world.clearance(places, seconds[k])))
            return self.world.nearest(places[at : at + 1], seconds[k : k + 1])[0]

        return gap, what

    def _against_another(self, a: Truth, b: Truth) -> list[Closest]:
        t, gap = self.separation(a, b)
        if _farther(gap, self.separations.get((a.robot, b.robot))):
            return []
        touching = np.flatnonzero(gap < -1e-3)[:1]  # one may stand on the other
        nearest, *hits = (
            Closest(robot=a.robot, what=b.robot, distance=float(gap[k]), t=int(t[k]))
            for k in (int(np.argmin(gap)), *touching.tolist())
        )
        _keep(self.separations, (a.robot, b.robot), nearest)
        return hits

    def _against_fence(self, truth: Truth) -> None:
        if self.world.fence is None:
            return
        rows = _looks(truth)
        t, margin = truth.t[rows], self.world.fence.margin(truth.p[rows])
        k = int(np.argmin(margin))
        _keep(
            self.fences, truth.robot, Closest(robot=truth.robot, what="fence", distance=float(margin[k]), t=int(t[k]))
        )


def _telling(gap: Floats) -> list[int]:
    """The rows worth naming: the closest, and the first collision."""
    first = np.flatnonzero(gap < 0.0)[:1]
    k = int(np.argmin(gap))
    return [] if gap[k] == inf else [*first.tolist(), k]


def _farther(gap: Floats, kept: Closest | None) -> bool:
    """Whether nothing touches and nothing is closer than it has been."""
    return kept is not None and float(gap.min()) >= max(kept.distance, 0.0)


def _keep(kept: dict[K, Closest], key: K, new: Closest) -> None:
    if key not in kept or new.distance < kept[key].distance:
        kept[key] = new


def _looks(truth: Truth) -> slice:
    """Rows at which one looks: evenly spaced, the last one among them."""
    every = max(1, round(1.0 / (LOOKS_HZ * truth.dt))) if len(truth) > 1 else 1
    return slice((len(truth) - 1) % every, None, every)


def _positions(truth: Truth, t: Ints) -> Floats:
    """(n, 3) positions at stamps within the truth, linear between rows."""
    looks = _looks(truth)
    if np.array_equal(truth.t[looks], t):  # those of another of the same steps
        return truth.p[looks]
    if (rows := truth.rows_at(t)) is not None:
        return truth.p[rows]
    return np.column_stack([np.interp(t - truth.t[0], truth.t - truth.t[0], truth.p[:, i]) for i in range(3)])
