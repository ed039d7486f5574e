"""Maps and scenarios of the MovingAI benchmarks: N. Sturtevant, "Benchmarks for grid-based pathfinding", 2012.

Their cells are counted from the upper left corner; ours from the lower left, see `MovingAiCase.points`.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

import numpy as np

from outrider.data.grid import FREE, LETHAL, Costmap
from outrider.errors import DataError
from outrider.io.files import ensure_readable
from outrider.typing import Floats

_PASSABLE: Final = ".GS"  # S: swamp, passable from ordinary ground
_BLOCKED: Final = "@OTW"
_FIELDS: Final = 9
_LARGEST: Final = 1 << 28  # cells


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class MovingAiCase:
    """One line of a scenario: column and row, from the upper left, of both ends, and the optimal length in cells."""

    size: tuple[int, int]  # columns, rows
    start: tuple[int, int]
    goal: tuple[int, int]
    length: float

    def points(self, costmap: Costmap) -> tuple[Floats, Floats]:
        """(2,) m each: the middles of start and goal."""
        rows = costmap.cells.shape[0]
        start, goal = (costmap.centre_of(np.array([rows - 1 - y, x])) for x, y in (self.start, self.goal))
        return start, goal


def read_moving_ai_map(path: Path, *, resolution: float = 1.0) -> Costmap:
    """A .map file as a costmap of free and taken cells.

    DataError : no such file, no such format, or rows that are not as the header says.
    """
    lines = _lines(path)
    head: dict[str, str] = {}
    for i, line in enumerate(lines[:4]):
        key, _, value = line.strip().partition(" ")
        head[key] = value.strip()
        if key == "map":
            return Costmap(cells=_cells(path, lines[i + 1 :], i + 2, head), resolution=resolution, origin=np.zeros(2))
    fix = "the first lines are: type octile, height N, width N, map"
    raise DataError("no MovingAI map: there is no line 'map' among the first four", where=str(path), fix=fix)


def _cells(path: Path, lines: list[str], first: int, head: dict[str, str]) -> np.ndarray:
    try:
        rows, cols = int(head["height"]), int(head["width"])
    except (KeyError, ValueError):
        raise DataError("height or width is missing or no number", where=str(path)) from None
    if rows < 1 or cols < 1 or rows * cols > _LARGEST:
        raise DataError(f"{cols} x {rows} cells", where=str(path), fix=f"from 1 to {_LARGEST} cells")
    if len(lines) < rows:
        raise DataError(f"{len(lines)} rows instead of {rows}: the file is cut short", where=str(path))
    table = np.full(256, 255, np.uint8)
    table[[ord(c) for c in _PASSABLE]], table[[ord(c) for c in _BLOCKED]] = FREE, LETHAL
    cells = np.empty((rows, cols), np.uint8)
    for i, line in enumerate(lines[:rows]):
        codes = np.frombuffer(line.encode("latin-1", "replace"), np.uint8)
        where = f"{path}:{first + i}"
        if codes.size != cols:
            raise DataError(f"{codes.size} cells instead of {cols}", where=where)
        cells[rows - 1 - i] = table[codes]
        if (cells[rows - 1 - i] == 255).any():
            wrong = line[int((cells[rows - 1 - i] == 255).argmax())]
            raise DataError(f"{wrong!r} is no cell", where=where, fix=f"one of {_PASSABLE + _BLOCKED}")
    return cells


def read_moving_ai_scenarios(path: Path) -> list[MovingAiCase]:
    """All lines of a .scen file.

    DataError : no such file, no such format, or a line that is not as it should be.
    """
    lines = _lines(path)
    if not lines or not lines[0].startswith("version"):
        raise DataError("no MovingAI scenarios: the first line is not 'version'", where=str(path))
    return [_case(line, f"{path}:{i}") for i, line in enumerate(lines[1:], start=2) if line.strip()]


def _case(line: str, where: str) -> MovingAiCase:
    fields = line.split()
    try:
        if len(fields) != _FIELDS:
            raise ValueError
        cols, rows, x, y, to_x, to_y = (int(f) for f in fields[2:8])
        length = float(fields[8])
    except ValueError:
        said = "bucket, map, width, height, start x, y, goal x, y, length"
        raise DataError(f"{line.strip()[:60]!r} is no scenario", where=where, fix=f"nine fields: {said}") from None
    if not all(0 <= a < cols and 0 <= b < rows for a, b in ((x, y), (to_x, to_y))) or not 0.0 <= length < np.inf:
        raise DataError(f"an end outside {cols} x {rows} cells, or a length of {length:g}", where=where)
    return MovingAiCase(size=(cols, rows), start=(x, y), goal=(to_x, to_y), length=length)


def _lines(path: Path) -> list[str]:
    return ensure_readable(path).read_text(encoding="latin-1").splitlines()
