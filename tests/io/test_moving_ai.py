"""MovingAI files: what is read, and what is refused."""

from pathlib import Path

import pytest

from outrider.data.grid import FREE, LETHAL
from outrider.errors import DataError
from outrider.io.moving_ai import read_moving_ai_map, read_moving_ai_scenarios
from outrider.planning.astar import AStar

MAP = "type octile\nheight 3\nwidth 4\nmap\n..@.\nGT.S\n...O\n"
SCENARIOS = "version 1\n0\ta.map\t4\t3\t0\t0\t2\t1\t4\n0\ta.map\t4\t3\t1\t0\t0\t2\t3.00000000\n\n"


def written(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text)
    return path


def test_rows_are_turned_over_and_lengths_are_optimal(tmp_path: Path) -> None:
    grid = read_moving_ai_map(written(tmp_path, "a.map", MAP))
    assert (grid.cells[2] == [FREE, FREE, LETHAL, FREE]).all()
    assert (grid.cells[0] == [FREE, FREE, FREE, LETHAL]).all()
    assert (grid.cells[1] == [FREE, LETHAL, FREE, FREE]).all()
    for case in read_moving_ai_scenarios(written(tmp_path, "a.scen", SCENARIOS)):
        start, goal = case.points(grid)
        path = AStar().plan(grid, start, goal)
        assert path.length == pytest.approx({(2, 1): 5.0, (0, 2): 3.0}[case.goal])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "empty"),
        ("a\nb\n", "no line 'map'"),
        ("type octile\nheight 3\nwidth x\nmap\n", "height or width"),
        ("type octile\nheight 0\nwidth 4\nmap\n", "4 x 0 cells"),
        ("type octile\nheight 99999999\nwidth 99999999\nmap\n", "cells"),
        (MAP.replace("...O\n", ""), "2 rows instead of 3"),
        (MAP.replace("...O", "...."), None),
        (MAP.replace("...O", "..O"), "a.map:7: 3 cells instead of 4"),
        (MAP.replace("GT.S", "GT?S"), r"a.map:6: '\?' is no cell"),
    ],
)
def test_maps_that_are_none(tmp_path: Path, text: str, said: str | None) -> None:
    path = written(tmp_path, "a.map", text)
    if said is None:
        assert read_moving_ai_map(path).cells.shape == (3, 4)
        return
    with pytest.raises(DataError, match=said):
        read_moving_ai_map(path)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("0 a 1 1\n", "first line is not 'version'"),
        (SCENARIOS + "0\ta.map\t4\t3\n", "a.scen:5: .* is no scenario"),
        (SCENARIOS + "0 a.map 4 3 4 0 0 2 3.0\n", "outside 4 x 3"),
        (SCENARIOS + "0 a.map 4 3 0 0 0 2 nan\n", "length of nan"),
    ],
)
def test_scenarios_that_are_none(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(DataError, match=said):
        read_moving_ai_scenarios(written(tmp_path, "a.scen", text))


def test_no_such_file(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"b\.map"):
        read_moving_ai_map(tmp_path / "b.map")
