"""
Planners beside one another
===========================

Planners beside one another on one map: cost, time, memory, and what planning again costs after a change.

The map is a yard of obstacles, inflated so that a planner keeps its distance. Jump points need ground that is all
alike: their row, and that of RRT*, count metres only. RRT* needs the package `ompl` and is left out without it.
"""

import importlib.util
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.ndimage import distance_transform_edt

from outrider.data.grid import INSCRIBED, LETHAL, Costmap, Grid
from outrider.planning.astar import AStar
from outrider.planning.dstar import DStarLite
from outrider.planning.refine import Refined, resample
from outrider.planning.sampling import SamplingPlanner
from outrider.plot.drives import Line, Site, sites_figure
from outrider.plot.style import save_png

SIDE, CELL = 400, 0.1  # cells, m


def yard(rng: np.random.Generator) -> Costmap:
    """Blocks of 1 m, dear ground around them."""
    taken = np.zeros((SIDE, SIDE), bool)
    for row, col in rng.integers(20, SIDE - 30, (SIDE * SIDE // 800, 2)):
        taken[row : row + 10, col : col + 10] = True
    away = distance_transform_edt(~taken) * CELL
    cost = np.where(away <= 0.3, INSCRIBED, 252 * np.exp(-3.0 * (away - 0.3)))
    return Costmap(cells=np.where(taken, LETHAL, cost).astype(np.uint8), resolution=CELL, origin=np.zeros(2))


def main() -> None:
    """Plan, block the way 3 m ahead of the robot, plan again."""
    graded = yard(np.random.default_rng(3))
    plain = replace(graded, cells=np.where(graded.cells >= INSCRIBED, graded.cells, 0).astype(np.uint8))
    start, goal = np.array([1.05, 1.05]), np.array([38.95, 38.95])
    astar, dijkstra, jumps, dstar = AStar(jumps=False), AStar(heuristic=False), AStar(jumps=True), DStarLite()
    planners = {
        "Dijkstra": (dijkstra, graded, lambda: dijkstra.workspace.bytes),
        "A*": (astar, graded, lambda: astar.workspace.bytes),
        "A*, shortened and smoothed": (Refined(planner=astar), graded, lambda: astar.workspace.bytes),
        "D* Lite": (dstar, graded, lambda: dstar.bytes),
        "A*, metres only": (astar, plain, lambda: astar.workspace.bytes),
        "jump points, metres only": (jumps, plain, lambda: jumps.workspace.bytes),
    }
    if importlib.util.find_spec("ompl"):
        planners["RRT* for 1 s, metres only"] = (SamplingPlanner(seconds=1.0), plain, lambda: 0)
    ways = list[Line]()
    table = Table(title=f"{SIDE} x {SIDE} cells")
    for title in ("planner", "cost [m]", "length [m]", "time [ms]", "again [ms]", "expanded", "again", "memory [MB]"):
        table.add_column(title, justify="right")
    for name, (planner, grid, memory) in planners.items():
        planner.plan(grid, start, goal)  # compiled; of D* Lite a fresh goal makes a fresh search
        planner.plan(grid, start, start)
        begun = perf_counter()
        path = planner.plan(grid, start, goal)
        first = perf_counter() - begun
        row, col = grid.cell_of(resample(path.points, CELL)[30])
        blocked = grid.cells.copy()
        blocked[row - 4 : row + 5, col - 4 : col + 5] = LETHAL
        begun = perf_counter()
        again = planner.plan(replace(grid, cells=blocked), start, goal)
        second = perf_counter() - begun
        ways.append(Line(name, path.points))
        held = f"{memory() / 2**20:.1f}" if memory() else "-"
        numbers = (f"{path.cost:.3f}", f"{path.length:.3f}", f"{first * 1e3:.1f}", f"{second * 1e3:.1f}")
        table.add_row(name, *numbers, str(path.expanded), str(again.expanded), held)
    there = Grid(cells=np.where(graded.cells >= LETHAL, 100, 0).astype(np.uint8), resolution=CELL, origin=np.zeros(2))
    figure = sites_figure([Site(title="from the lower left to the upper right", grid=there, lines=tuple(ways))])
    save_png(figure, Path("05_compare_planners.png"), dpi=170)
    Console(width=110).print(table, "finished")


if __name__ == "__main__":
    main()
