"""MovingAI maps of the recordings, and how a length is compared with the one that their file prints."""

from math import floor, log10
from pathlib import Path

from outrider.io.moving_ai import MovingAiCase, read_moving_ai_map, read_moving_ai_scenarios
from outrider.planning.astar import AStar

# whether the file prints six digits of a length, or all of them
CITY = ("hog2/maps/cities/Berlin_0_256.map", "hog2/scenarios/cities/Berlin_0_256.map.scen", False)
ROOMS = ("hog2/maps/rooms/8room_000.map", "hog2/scenarios/rooms/8room_000.map.scen", True)
ARENA = ("pathfinding-rs/benches/arena.map", "pathfinding-rs/benches/arena.map.scen", True)


def misses(root: Path, files: tuple[str, str, bool], planner: AStar, every: int) -> list[tuple[MovingAiCase, float]]:
    """Scenarios whose length is not the printed one, to 1e-6 or to half of the last digit that is printed.

    Lengths of six digits were added up in single precision: 294.7645019 is printed as 294.764.
    """
    grid, six_digits = read_moving_ai_map(root / files[0]), files[2]
    wrong: list[tuple[MovingAiCase, float]] = []
    for case in read_moving_ai_scenarios(root / files[1])[::every]:
        path = planner.plan(grid, *case.points(grid))
        last = 10.0 ** (floor(log10(case.length)) - 5) if six_digits and case.length > 0.0 else 0.0
        if abs(path.length - case.length) > max(1e-6, 0.51 * last):
            wrong.append((case, path.length))
    return wrong
