"""Maps of both map servers: what every grey means, the boundaries, the 205 trap, and round trips."""

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from outrider.data import Datum, Grid
from outrider.data.grid import UNKNOWN
from outrider.data.site import Anchor
from outrider.errors import ConfigError, DataError
from outrider.io.map_server import Dialect, corners, interpret, read_map, write_map

NAV2, ROS1 = Dialect.NAV2, Dialect.ROS1
DATA = Path(os.environ.get("OUTRIDER_DATA", Path(__file__).resolve().parents[3] / "shared" / "data"))


def meaning(grey, mode="trinary", occupied=0.65, free=0.196, negate=False, dialect=NAV2):
    return int(interpret(np.array(grey, np.uint8).reshape(1, 1, -1), mode, occupied, free, negate, dialect)[0, 0])


def saved(tmp_path, pixels, **keys):
    Image.fromarray(np.array(pixels, np.uint8)).save(tmp_path / "m.png")
    said = {"image": "m.png", "resolution": 0.1, "origin": "[1, 2, 0]", "negate": 0, **keys}
    path = tmp_path / "m.yaml"
    path.write_text("".join(f"{k}: {v}\n" for k, v in said.items()))
    return path


@pytest.mark.parametrize("dialect", Dialect)
def test_the_three_greys_of_the_savers_and_of_the_paper(dialect):
    assert [meaning(g, dialect=dialect) for g in (0, 205, 254)] == [100, UNKNOWN, 0]
    assert [meaning(g, dialect=dialect) for g in (0, 128, 255)] == [100, UNKNOWN, 0]
    assert [meaning(g, negate=True, dialect=dialect) for g in (0, 128, 255)] == [0, UNKNOWN, 100]


def test_a_grey_of_128_in_scale_mode_differs_between_the_servers():
    assert meaning(128, "scale") == 67
    assert meaning(128, "scale", dialect=ROS1) == 66


def test_the_boundaries_belong_to_nav2_and_not_to_ros1():
    """Grey 51 is exactly 0.8 occupied, 204 exactly 0.2."""
    assert [meaning(g, occupied=0.8, free=0.2) for g in (51, 204)] == [100, 0]
    assert [meaning(g, occupied=0.8, free=0.2, dialect=ROS1) for g in (51, 204)] == [UNKNOWN, UNKNOWN]


def test_the_205_trap():
    assert meaning(205, free=0.196) == UNKNOWN
    assert meaning(205, free=0.25) == 0


def test_raw():
    assert [meaning(g, "raw") for g in (0, 37, 100, 101, 255)] == [0, 37, 100, UNKNOWN, UNKNOWN]
    assert [meaning(g, "raw", dialect=ROS1) for g in (0, 37, 100, 101, 255)] == [0, 37, 100, 101, 255]
    assert meaning(255 - 37, "raw", negate=True, dialect=ROS1) == 37
    assert meaning(37, "raw", negate=True) == 37


def test_transparency():
    assert meaning([254, 254, 254, 128]) == UNKNOWN
    assert meaning([254, 254, 254, 255]) == 0
    assert meaning([0, 255], "scale", dialect=ROS1) == 100
    assert meaning([128, 0], "scale", dialect=ROS1) == UNKNOWN
    assert meaning([128, 255], "scale", dialect=ROS1) == 66
    assert meaning([254, 254, 254, 0], dialect=ROS1) == UNKNOWN  # 190.5 on average
    assert meaning([0, 90, 30]) == 100  # 40 on average


@settings(derandomize=True, max_examples=40)
@given(seed=st.integers(0, 10**6), rows=st.integers(1, 9), cols=st.integers(1, 9))
@pytest.mark.parametrize("dialect", Dialect)
@pytest.mark.parametrize("mode", ["trinary", "scale", "raw"])
def test_round_trip(tmp_path_factory, dialect, mode, seed, rows, cols):
    rng = np.random.default_rng(seed)
    values = [0, 100, UNKNOWN] if mode == "trinary" else [*range(101), UNKNOWN]
    if mode == "scale" and dialect is ROS1:
        values.remove(99)  # it never reads one, at the usual thresholds
    grid = Grid(
        cells=rng.choice(values, (rows, cols)).astype(np.uint8),
        resolution=float(rng.uniform(0.01, 2.0)),
        origin=rng.normal(0.0, 100.0, 2),
    )
    path = tmp_path_factory.mktemp("map") / "m.yaml"
    heading = float(rng.uniform(-3.0, 3.0))
    place = Anchor(datum=Datum(lat=0.9, lon=-0.2, alt=12.5), heading=0.3)
    write_map(grid, path, mode=mode, heading=heading, anchor=place, dialect=dialect)
    again = read_map(path, dialect)
    assert (again.grid.cells == grid.cells).all()
    assert again.grid.resolution == grid.resolution
    assert (again.grid.origin == grid.origin).all()
    assert (again.heading, again.mode, again.notes) == (heading, mode, ())
    assert again.anchor is not None
    assert again.anchor.datum.lat == pytest.approx(0.9, abs=1e-13)
    write_map(again.grid, path, mode=mode, heading=heading, dialect=dialect, force=True)
    assert (read_map(path, dialect).grid.cells == grid.cells).all()


def test_the_lowest_row_of_the_grid_is_the_last_of_the_image(tmp_path):
    m = read_map(saved(tmp_path, [[0, 254], [254, 254], [254, 254]]))
    assert m.grid.cells.tolist() == [[0, 0], [0, 0], [100, 0]]
    assert m.grid.centre_of(np.array([2, 0])) == pytest.approx([1.05, 2.25])


def test_the_trap_is_told_and_can_be_avoided(tmp_path):
    path = saved(tmp_path, [[205, 254], [0, 205]], free_thresh=0.25, occupied_thresh=0.65)
    m = read_map(path)
    assert m.grid.cells.tolist() == [[100, 0], [0, 0]]
    assert "205" in m.notes[0]
    assert "50 %" in m.notes[0]
    kept = read_map(path, keep_unknown=True)
    assert kept.grid.cells.tolist() == [[100, UNKNOWN], [UNKNOWN, 0]]
    assert "kept unknown" in kept.notes[0]


def test_a_turned_map_knows_its_corners(tmp_path):
    m = read_map(saved(tmp_path, np.zeros((3, 2)), origin="[1, 2, 1.5707963267948966]"))
    assert m.heading == np.pi / 2
    assert corners(m) == pytest.approx(np.array([[1, 2], [1, 2.2], [0.7, 2.2], [0.7, 2.0]]))


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"free_thresh": 0.7}, "m.yaml:5: free_thresh: is not below occupied_thresh"),
        ({"occupied_thresh": 1.5}, "should be 1 or less"),
        ({"resolution": -0.05}, "m.yaml:2: resolution: should be more than 0"),
        ({"resolution": ".nan"}, "resolution"),
        ({"origin": "[0, 0]"}, "origin"),
        ({"origin": "[0, .inf, 0]"}, "origin.1: should be a finite number"),
        ({"mode": "ternary"}, "did you mean 'trinary'"),
        ({"image": "''"}, "image"),
    ],
)
def test_maps_without_a_sense_are_refused_with_their_line(tmp_path, keys, said):
    with pytest.raises(ConfigError, match=said):
        read_map(saved(tmp_path, np.zeros((2, 2)), **keys))


def test_images_that_are_none_are_refused(tmp_path):
    path = saved(tmp_path, np.random.default_rng(1).integers(0, 255, (40, 40)))
    image = tmp_path / "m.png"
    whole = image.read_bytes()
    for raw, said in ((b"nothing", "no image"), (whole[: len(whole) // 2], "damaged"), (b"", "empty")):
        image.write_bytes(raw)
        with pytest.raises(DataError, match=said):
            read_map(path)
    for size in (b"12000 12000", b"100000 100000"):
        image.write_bytes(b"P5\n" + size + b"\n255\n")
        with pytest.raises(DataError, match="more than 134 million pixels"):
            read_map(path)
    image.unlink()
    with pytest.raises(DataError, match="no such file"):
        read_map(path)


def test_what_a_mode_cannot_hold_is_not_written(tmp_path):
    grid = Grid(cells=np.array([[50]], np.uint8), resolution=1.0, origin=np.zeros(2))
    with pytest.raises(DataError, match="a cell of 50 cannot be written in mode trinary"):
        write_map(grid, tmp_path / "m.yaml")
    assert list(tmp_path.iterdir()) == []


def test_maps_of_nav2_and_ros():
    """Their own files: sizes from the headers, and what the thresholds of each make of grey 205."""
    if not (DATA / "nav2").is_dir():
        pytest.skip(f"no recordings at {DATA}")
    maps = DATA / "nav2" / "nav2_bringup" / "maps"
    depot, warehouse = read_map(maps / "depot.yaml"), read_map(maps / "warehouse.yaml")
    ten = read_map(DATA / "ros-navigation" / "costmap_2d" / "test" / "TenByTen.yaml", ROS1)
    assert ten.grid.cells.shape == (10, 10)
    assert ten.grid.resolution == 1.0
    assert warehouse.grid.origin.tolist() == [-15.1, -25.0]
    for m in (depot, warehouse, ten):
        assert set(np.unique(m.grid.cells).tolist()) <= {0, 100, UNKNOWN}
    with Image.open(maps / "depot.pgm") as opened:
        image = np.asarray(opened)
    assert (depot.grid.cells[::-1] == 100).sum() == (image <= 89).sum()
    assert bool(depot.notes) == bool((image == 205).any())
    assert warehouse.notes == ()
