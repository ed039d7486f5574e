"""The world that robots are put into, and what can be asked about it."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike

from outrider.data import Datum, Grid
from outrider.sim.truth import SITE, STANDARD_GRAVITY
from outrider.sim.world.check import check
from outrider.sim.world.ground import Ground
from outrider.sim.world.parts import Body, Fence, Mover, Solids, Wall
from outrider.sim.world.scene import Scene, clearances, scan_column, scans, scene, sights
from outrider.sim.world.wind import Wind
from outrider.typing import Bools, Floats, Ints

GRID = "grid"
Column: TypeAlias = tuple[Floats, float, float]
"""An upright cylinder under way: feet (n, 3) m, radius [m], height [m]."""


@final
@dataclass(frozen=True, kw_only=True)
class World:
    """Ground, walls, solids, an occupancy grid as high as `grid_height` [m], known objects, movers, wind and a fence.

    Site frame ENU [m]; times are seconds since the start of the run. Objects are places with a name: what they are made
    of is among the solids. The ground is no obstacle to clearance and sight, but a lidar that tilts sees it.
    """

    name: str
    datum: Datum = SITE
    gravity: float = STANDARD_GRAVITY
    grid: Grid | None = None
    grid_height: float = 2.0
    walls: tuple[Wall, ...] = ()
    solids: Solids = field(default_factory=Solids)
    objects: Mapping[str, Body] = field(default_factory=dict)
    movers: tuple[Mover, ...] = ()
    wind: Wind = field(default_factory=Wind)
    ground: Ground = field(default_factory=Ground)
    fence: Fence | None = None

    @cached_property
    def scene(self) -> Scene:
        """The arrays that the kernels work on."""
        slope = np.array(self.ground.slope)
        return scene(self.solids, self.walls, self.movers, self.grid, self.grid_height, slope)

    @cached_property
    def things(self) -> tuple[str, ...]:
        """Names in the order in which the scene numbers things."""
        walls, movers = (wall.name for wall in self.walls), (mover.name for mover in self.movers)
        return (*self.solids.names, *walls, *movers, GRID)

    def clearance(self, p: Floats, t_s: ArrayLike = 0.0) -> Floats:
        """(n,) signed distance [m] of points p (n, 3) from the nearest thing at times t_s (n,) or one; inf: nothing."""
        return self._near(p, t_s)[0]

    def nearest(self, p: Floats, t_s: ArrayLike = 0.0) -> tuple[str, ...]:
        """Names of the things that `clearance` is measured from; "" in an empty world."""
        return tuple(self.things[k] if k >= 0 else "" for k in self._near(p, t_s)[1])

    def _near(self, p: Floats, t_s: ArrayLike) -> tuple[Floats, Ints]:
        n = p.shape[0]
        out, which = np.empty(n), np.empty(n, np.int64)
        clearances(self.scene, np.ascontiguousarray(p), _times(t_s, n), out, which)
        return out, which

    def sees(self, a: Floats, b: Floats, t_s: ArrayLike = 0.0) -> Bools:
        """(n,) whether nothing stands between points a (n, 3) and b (n, 3); the same from b to a."""
        n = a.shape[0]
        out = np.empty(n, np.bool_)
        sights(self.scene, np.ascontiguousarray(a), np.ascontiguousarray(b), _times(t_s, n), out)
        return out

    def scan(
        self,
        origin: Floats,
        q: Floats,
        angles: Floats,
        max_range: float,
        t_s: ArrayLike = 0.0,
        others: Iterable[Column] = (),
    ) -> Floats:
        """Ranges (k,) [m] of a 2-D lidar, or (n, k) of n scans; inf: nothing within `max_range`, 0: inside a thing.

        origin (3,) or (n, 3) and q (4,) or (n, 4), R_site_sensor;  angles (k,) rad, from the sensor's x towards its y;
        others : what is no part of the world and stands in the way all the same.
        """
        o, attitude = np.atleast_2d(origin), np.atleast_2d(q)
        n = o.shape[0]
        out = np.empty((n, angles.size))
        poses = np.ascontiguousarray(o, np.float64), np.ascontiguousarray(attitude, np.float64)
        beams, scratch = np.ascontiguousarray(angles), np.empty(3)
        scans(self.scene, *poses, beams, float(max_range), _times(t_s, n), scratch, out)
        for feet, radius, height in others:
            scan_column(*poses, beams, float(max_range), np.ascontiguousarray(feet), radius, height, scratch, out)
        return out[0] if origin.ndim == 1 else out

    def validate(self) -> None:
        """Everything is possible: `ConfigError` that names the part and what is wrong with it, otherwise."""
        check(self)


def _times(t_s: ArrayLike, n: int) -> Floats:
    times = np.asarray(t_s, np.float64)
    return np.ascontiguousarray(times if times.shape == (n,) else np.broadcast_to(times, (n,)))
