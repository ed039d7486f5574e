"""Driven through a small building: rooms with doors, a pillar, and a room without a door."""

import numpy as np
import pytest

import map_drives
from outrider.data.grid import Grid
from outrider.team.errand import Visit

pytestmark = pytest.mark.compiled
SIDE = 0.05


def building() -> Grid:
    """12 m x 8 m: two rooms and a corridor, doors 0.9 m wide; the room in the north-east has none."""
    cells = np.zeros((160, 240), np.uint8)
    cells[[0, 1, -2, -1]], cells[:, [0, 1, -2, -1]] = 100, 100
    cells[90:92], cells[90:, 118:120] = 100, 100  # the corridor's wall, and one between the rooms
    cells[90:92, 50:68] = 0  # a door
    cells[:60, 118:120] = 100
    cells[20:38, 118:120] = 0
    cells[70:76, 160:166] = 100  # a pillar in the corridor
    return Grid(cells=cells, resolution=SIDE, origin=np.array([-2.0, 1.0]))


def test_every_pair_arrives_or_is_named() -> None:
    grid = building()
    ends, joined = map_drives.pairs(grid, 4, 8)
    assert joined.tolist() == [True, True, True, False]
    for k, (pair, feasible) in enumerate(zip(ends, joined, strict=True)):
        drive = map_drives.drive(grid, *pair, seed=k)
        assert drive.room > 0.0
        assert drive.visit is (Visit.ARRIVED if feasible else Visit.UNREACHABLE), drive
        assert drive.error < 0.10 if feasible else "nothing that the robot fits through" in drive.reason
