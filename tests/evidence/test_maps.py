"""Random ways through real buildings, driven in the simulator by a robot on its own estimate: docs/evidence/maps.md."""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import map_drives
from outrider.data.grid import LETHAL, Grid
from outrider.io.map_server import read_map
from outrider.team.errand import Visit
from published import publish

pytestmark = [pytest.mark.evidence, pytest.mark.compiled]
NAV2, WILLOW = "nav2/nav2_bringup/maps", "ros-navigation/navfn/test/willow_costmap.pgm"
MAPS, PAIRS, SEED = ("depot", "warehouse", "willow"), 100, 8
HEADER = ("map", "pairs", "arrived", "named instead", "goal error, mean / worst", "room, least", "driven", "touched")
TEXT = (
    "100 random pairs of start and goal on each of three recorded maps (start, heading and noise by the number of the "
    "pair), driven closed loop: a round differential robot of 0.22 m radius, up to 1 m/s, with a lidar of 180 beams at "
    "5 Hz, wheel and gyro rates, and positions of a total station to 1 cm at 5 Hz. It drives on its own estimate; "
    "errors are those of its true position. A place is drawn where the robot stands with 0.1 m to spare; a pair is "
    "feasible if a way for its radius joins them on the map. Feasible ones must all arrive, the others must be named."
)


def building(root: Path, name: str) -> Grid:
    """The drawn map; what its grey 205 says stays unknown. Of willow there is a costmap: taken is what is lethal."""
    if name != "willow":
        return read_map(root / NAV2 / f"{name}.yaml", keep_unknown=True).grid
    cells = np.asarray(Image.open(root / WILLOW))[::-1]
    return Grid(cells=np.where(cells == LETHAL, 100, 0).astype(np.uint8), resolution=0.05, origin=np.zeros(2))


@pytest.fixture(scope="module")
def rows() -> Iterator[dict[str, tuple[object, ...]]]:
    out: dict[str, tuple[object, ...]] = {}
    yield out
    if set(out) == set(MAPS):
        publish("maps", "Driven through real buildings", TEXT, HEADER, [out[name] for name in MAPS])


def row(name: str, grid: Grid, drives: list[map_drives.Drive]) -> tuple[object, ...]:
    """Of the table."""
    there = [d for d in drives if d.visit is Visit.ARRIVED]
    error, room = [100 * d.error for d in there], min(d.room for d in drives)
    why = "; ".join(f"{n}: {reason}" for reason, n in Counter(d.reason for d in drives if d not in there).items())
    size = f"{name}, {grid.cells.shape[1]} x {grid.cells.shape[0]} cells of {grid.resolution:g} m"
    way = f"{sum(d.driven for d in drives) / 1000:.2f} km in {sum(d.seconds for d in drives) / 60:.0f} min"
    off = f"{np.mean(error):.1f} / {max(error):.1f} cm"
    return size, len(drives), len(there), why or "none", off, f"{room:.3f} m", way, sum(d.room <= 0.0 for d in drives)


@pytest.mark.parametrize("name", MAPS)
def test_every_feasible_pair_is_driven_and_every_other_one_named(
    recordings: Path, rows: dict[str, tuple[object, ...]], name: str
) -> None:
    grid = building(recordings, name)
    ends, joined = map_drives.pairs(grid, PAIRS, SEED)
    drives = [map_drives.drive(grid, *pair, seed=k) for k, pair in enumerate(ends)]
    rows[name] = row(name, grid, drives)
    for k, (drive, feasible) in enumerate(zip(drives, joined, strict=True)):
        assert drive.visit is (Visit.ARRIVED if feasible else Visit.UNREACHABLE), (k, drive)
        assert drive.room > 0.0, (k, drive)
        assert drive.error < 0.10 if feasible else drive.reason, (k, drive)
