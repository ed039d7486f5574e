"""MovingAI maps of the recordings, and how a length is compared with the one that their file prints."""

from pathlib import Path

from outrider.io.moving_ai import MovingAiCase, read_moving_ai_map, read_moving_ai_scenarios
from outrider.planning.astar import AStar

# how the file prints a length: fixed decimals, or six digits
CITY = ("hog2/maps/cities/Berlin_0_256.map", "hog2/scenarios/cities/Berlin_0_256.map.scen", ".8f")
ROOMS = ("hog2/maps/rooms/8room_000.map", "hog2/scenarios/rooms/8room_000.map.scen", ".6g")
ARENA = ("pathfinding-rs/benches/arena.map", "pathfinding-rs/benches/arena.map.scen", ".6g")


def misses(root: Path, files: tuple[str, str, str], planner: AStar, every: int) -> list[tuple[MovingAiCase, float]]:
    """Scenarios whose length is not the printed one, to 1e-6 or to the last digit that is printed."""
    grid, form = read_moving_ai_map(root / files[0]), files[2]
    wrong: list[tuple[MovingAiCase, float]] = []
    for case in read_moving_ai_scenarios(root / files[1])[::every]:
        path = planner.plan(grid, *case.points(grid))
        if abs(path.length - case.length) > 1e-6 and f"{path.length:{form}}" != f"{case.length:{form}}":
            wrong.append((case, path.length))
    return wrong
