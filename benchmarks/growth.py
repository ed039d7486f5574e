"""How cost grows with the work: CPU time at several sizes, and the exponent of the power law through them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import process_time
from typing import final

import numpy as np

REPETITIONS = 3


@final
@dataclass(frozen=True)
class Growth:
    """`make(n)` prepares the work of size n; what it returns is timed."""

    name: str
    unit: str
    sizes: Sequence[int]
    make: Callable[[int], Callable[[], object]]


@final
@dataclass(frozen=True)
class Grown:
    """seconds : the least of the repetitions, at every size."""

    growth: Growth
    seconds: Sequence[float]

    @property
    def exponent(self) -> float:
        """Of time ~ size ** exponent, by least squares in logarithms."""
        return float(np.polyfit(np.log(self.growth.sizes), np.log(self.seconds), 1)[0])


def grow(g: Growth) -> Grown:
    """Time one of them, after a run of its smallest size that compiles."""
    g.make(g.sizes[0])()
    return Grown(g, [_least(g.make(n)) for n in g.sizes])


def _least(work: Callable[[], object]) -> float:
    times = list[float]()
    for _ in range(REPETITIONS):
        begun = process_time()
        work()
        times.append(process_time() - begun)
    return min(times)


def all_growths() -> list[Growth]:
    """Log length, states, robots, cells, drones."""
    return [
        Growth("`fuse` of a drive", "s of log", (60, 120, 240, 480), _fused),
        Growth("EKF step", "states", (6, 12, 24, 48), _states),
        Growth("a team by radio, distributed", "robots", (10, 20, 40, 80), _team),
        Growth("cheapest way over weighted ground", "cells along a side", (250, 500, 1000, 2000), _path),
        Growth("avoidance of drones, a step", "drones", (125, 250, 500, 1000), _drones),
    ]


def _fused(seconds: int) -> Callable[[], object]:
    from outrider.sim import wheeled_log
    from outrider.workflows.config import FuseConfig
    from outrider.workflows.fuse import fuse

    log, _ = wheeled_log(3, duration_s=float(seconds))
    return lambda: fuse(log, FuseConfig(diagnose=False))


def _states(n: int) -> Callable[[], object]:
    from benchmarks._problems import measurements, selector
    from outrider.data.belief import Gaussian, StateLayout
    from outrider.filters import ekf

    layout = StateLayout(("x", n, ""))
    belief, z = Gaussian(np.zeros(n), np.eye(n), layout), measurements(3, 2000)
    H, r = selector(n, 3)
    F, Q, R = np.eye(n), 0.01 * np.eye(n), np.diag(r)

    def work() -> object:
        b = belief
        for row in z:
            b = ekf.predict(b, b.x, F, Q)
            b = ekf.update(b, row - H @ b.x, H, R).belief
        return b

    return work


def _team(robots: int) -> Callable[[], object]:
    from benchmarks.cooperation import together
    from outrider.filters.cooperative import Method

    run = together(robots, "swarm", Method.DISTRIBUTED)
    return lambda: run(robots)


def _path(side: int) -> Callable[[], object]:
    from scipy.ndimage import zoom

    from outrider.data.grid import Costmap
    from outrider.planning.astar import AStar

    rng, coarse = np.random.default_rng(0), side // 50
    height = zoom(rng.random((coarse + 4, coarse + 4)), 50, order=1)[:side, :side]
    cells = np.rint(200.0 * height).astype(np.uint8)
    costmap = Costmap(cells=cells, resolution=0.05, origin=np.zeros(2))
    planner, end = AStar(), 0.05 * side - 0.5
    return lambda: planner.plan(costmap, np.array([0.5, 0.5]), np.array([end, end]))


def _drones(n: int) -> Callable[[], object]:
    from outrider.guidance.avoidance import Avoidance, avoid_all
    from outrider.guidance.neighbours import Cells

    rng, side, most = np.random.default_rng(0), int(np.ceil(np.sqrt(n))), 10
    k = np.arange(n)
    p = 5.0 * np.column_stack([k % side, k // side]) + rng.uniform(-1.0, 1.0, (n, 2))
    v = 2.0 * rng.normal(size=(n, 2))
    cells, out, ranks, theta = Cells(n, 15.0), np.zeros((n, 2)), np.zeros(n, np.int64), Avoidance().theta()
    lines, ids, squared = np.zeros((2 * most, 3)), np.zeros(most, np.int64), np.zeros(most)

    def work() -> object:
        for _ in range(20):
            avoid_all(p, v, v, theta, 15.0, np.inf, cells.side, cells.first, cells.members, lines, ids, squared, out,
                      ranks)  # fmt: skip
        return out

    return work
