"""Plans over maps that others have made: every MovingAI scenario, and random ways through real buildings."""

from pathlib import Path

import numpy as np
import pytest
from evidence_table import Table
from PIL import Image
from scipy.ndimage import label

from moving_ai_cases import ARENA, CITY, ROOMS, misses
from outrider.data.grid import INSCRIBED, LETHAL, UNKNOWN, Costmap
from outrider.data.routes import PathOutcome
from outrider.io.moving_ai import read_moving_ai_scenarios
from outrider.mapping.inflation import Inflater, Inflation
from outrider.planning.astar import AStar
from outrider.planning.refine import Refined, cost_along
from outrider.planning.traversal import Traversal

pytestmark = [pytest.mark.evidence, pytest.mark.compiled]
INFLATION = Inflation(inscribed=0.25, radius=1.0, factor=4.0)
MAPS = {
    "depot": ("nav2/nav2_bringup/maps/depot.pgm", 0.05),
    "warehouse": ("nav2/nav2_bringup/maps/warehouse.pgm", 0.03),
}
WILLOW = "ros-navigation/navfn/test/willow_costmap.pgm"
PAIRS, BUDGET_S = 100, 2.0


@pytest.mark.parametrize("files", [CITY, ROOMS, ARENA], ids=["city", "rooms", "arena"])
def test_every_scenario_has_its_optimal_length(recordings: Path, table: Table, files: tuple[str, str, bool]) -> None:
    n = len(read_moving_ai_scenarios(recordings / files[1]))
    wrong = [misses(recordings, files, AStar(jumps=jumps), every=1) for jumps in (True, False)]
    name, what = Path(files[0]).name, "optimal lengths: jump points, queued cells"
    table.add("plans", name, what, f"{n - len(wrong[0])}, {n - len(wrong[1])} of {n}", "all")
    assert wrong == [[], []]


def building(root: Path, name: str) -> Costmap:
    """A map_server image, read as its YAML says (0 taken, 205 unknown, 254 free), and inflated."""
    if name == "willow":  # a costmap already: 50 is what navfn calls neutral
        cells = np.asarray(Image.open(root / WILLOW))[::-1]
        return Costmap(cells=np.where(cells == 50, 0, cells).astype(np.uint8), resolution=0.05, origin=np.zeros(2))
    file, side = MAPS[name]
    grey = np.asarray(Image.open(root / file))[::-1]
    drawn = np.where(grey == 0, LETHAL, np.where(grey == 205, UNKNOWN, 0)).astype(np.uint8)
    cells = np.empty_like(drawn)
    Inflater(INFLATION, side, drawn.shape)(drawn, cells)
    return Costmap(cells=cells, resolution=side, origin=np.zeros(2))


@pytest.mark.parametrize("name", [*MAPS, "willow"])
def test_random_ways_through_a_building(recordings: Path, table: Table, name: str) -> None:
    grid, rng, rules = building(recordings, name), np.random.default_rng(8), Traversal()
    free = grid.cells < INSCRIBED
    rooms, _ = label(free)
    cells = np.argwhere(free)
    planner = Refined(planner=AStar(), spacing=0.2)
    planner.plan(grid, *grid.centre_of(rng.choice(cells, 2)))  # compiled before the clock runs
    seconds, found = [], 0
    for start, goal in rng.choice(cells, (PAIRS, 2)):
        ends = grid.centre_of(start), grid.centre_of(goal)
        path, raw = planner.plan(grid, *ends, budget_s=BUDGET_S), AStar().plan(grid, *ends)
        joined = rooms[tuple(start)] == rooms[tuple(goal)]
        assert path.outcome is (PathOutcome.FOUND if joined else PathOutcome.NO_WAY)
        assert joined or path.suggestion is not None
        seconds.append(path.seconds)
        if joined:
            found += 1
            assert cost_along(grid, rules, path.points) < np.inf
            assert path.length <= raw.length * (1 + 1e-9)
            assert path.cost <= raw.cost * (1 + 1e-9)
    p95 = float(np.quantile(seconds, 0.95))
    size = f"{grid.cells.shape[1]} x {grid.cells.shape[0]} cells, {PAIRS} random pairs (seed 8), planned and smoothed"
    figure = f"{found} found, {PAIRS - found} named; p95 {p95 * 1e3:.0f} ms"
    table.add("plans", name, size, figure, f"budget {BUDGET_S * 1e3:g} ms, none exceeds it")
