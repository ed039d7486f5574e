"""Footprints against cells, with shapely as the judge."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from shapely import LineString, Point, Polygon, box

from outrider.data.footprint import Footprint
from outrider.data.grid import LETHAL, UNKNOWN, Costmap
from outrider.errors import DataError
from outrider.mapping.inflation import Inflater, Inflation
from outrider.mapping.outlines import FootprintCheck, Stand, stamp, touches

SHAPES = {
    "disc": Footprint.circle(0.31),
    "capsule": Footprint.capsule(0.4, 0.2, 0.15),
    "rectangle": Footprint.rectangle(0.9, 0.5, ahead=0.1),
    "thin": Footprint.rectangle(1.4, 0.04),
    "round corners": Footprint(np.array([[-0.3, -0.2], [0.3, -0.2], [0.5, 0.0], [0.3, 0.2], [-0.3, 0.2]]), 0.05),
}
POSES = {"x": st.floats(0.9, 1.3), "y": st.floats(0.9, 1.3), "heading": st.floats(-3.2, 3.2)}


def body(footprint, pose):
    p = footprint.at(np.array(pose))
    shape = Point(p[0]) if len(p) == 1 else LineString(p) if len(p) == 2 else Polygon(p)
    return shape, footprint.radius


def costmap(cells, resolution=0.1):
    return Costmap(cells=cells, resolution=resolution, origin=np.zeros(2))


@pytest.mark.parametrize("name", SHAPES)
@settings(derandomize=True, max_examples=40)
@given(**POSES, bx=st.floats(0.0, 2.0), by=st.floats(0.0, 2.0), side=st.sampled_from([0.0, 0.05, 0.4]))
def test_touches_is_what_shapely_says(name, x, y, heading, bx, by, side):
    shape, radius = body(SHAPES[name], (x, y, heading))
    gap = shape.distance(box(bx, by, bx + side, by + side) if side else Point(bx, by)) - radius
    assume(abs(gap) > 1e-9)
    placed = SHAPES[name].at(np.array([x, y, heading]))
    assert touches(placed, radius, bx, by, bx + side, by + side) == (gap < 0.0)


@pytest.mark.parametrize("name", SHAPES)
@settings(derandomize=True, max_examples=25)
@given(**POSES, seed=st.integers(0, 10**6))
def test_stands_where_no_taken_cell_is_covered(name, x, y, heading, seed):
    cells = np.where(np.random.default_rng(seed).random((22, 22)) < 0.02, LETHAL, 0).astype(np.uint8)
    shape, radius = body(SHAPES[name], (x, y, heading))
    gaps = {
        (r, c): shape.distance(box(c * 0.1, r * 0.1, (c + 1) * 0.1, (r + 1) * 0.1)) - radius
        for r, c in np.argwhere(cells == LETHAL).tolist()
    }
    assume(all(abs(g) > 1e-9 for g in gaps.values()))
    check = FootprintCheck(SHAPES[name], resolution=0.1)
    stand, cell = check(costmap(cells), np.array([x, y, heading]))
    assert stand == (Stand.TAKEN if any(g < 0 for g in gaps.values()) else Stand.CLEAR)
    if stand == Stand.TAKEN:
        assert gaps[tuple(cell.tolist())] < 0.0


@settings(derandomize=True, max_examples=40)
@given(x=st.floats(1.5, 3.0), y=st.floats(1.5, 3.0), heading=st.floats(-3.2, 3.2), seed=st.integers(0, 10**6))
def test_low_cost_answers_as_the_whole_check_does(x, y, heading, seed):
    cells = np.where(np.random.default_rng(seed).random((45, 45)) < 0.002, LETHAL, 0).astype(np.uint8)
    inflation = Inflation(inscribed=0.25, radius=1.2, factor=3.0)
    out = np.empty_like(cells)
    Inflater(inflation, 0.1, cells.shape)(cells, out)
    quick = FootprintCheck(SHAPES["rectangle"], resolution=0.1, inflation=inflation, unknown_blocks=False)
    assert quick.safe_below > 0
    slow = FootprintCheck(SHAPES["rectangle"], resolution=0.1)
    pose = np.array([x, y, heading])
    assert quick(costmap(out), pose)[0] == slow(costmap(out), pose)[0]


def test_inscribed_cost_is_not_safe_for_a_long_robot():
    """Beyond the inscribed radius its cost is below 253, and its nose is in the wall all the same."""
    cells = np.zeros((40, 40), np.uint8)
    cells[:, 25] = LETHAL
    inflation, out = Inflation(inscribed=0.2, radius=0.6, factor=3.0), np.empty_like(cells)
    Inflater(inflation, 0.1, cells.shape)(cells, out)
    check = FootprintCheck(Footprint.rectangle(1.0, 0.4), resolution=0.1, inflation=inflation)
    assert out[20, 21] < 253
    assert check(costmap(out), np.array([2.15, 2.05, 0.0]))[0] == Stand.TAKEN
    assert check(costmap(out), np.array([2.15, 2.05, np.pi / 2]))[0] == Stand.CLEAR


def test_unknown_ground_and_the_edge_have_their_names():
    cells = np.zeros((20, 20), np.uint8)
    cells[10, 12] = UNKNOWN
    here = np.array([1.05, 1.05, 0.0])
    wary, bold = (FootprintCheck(Footprint.circle(0.3), resolution=0.1, unknown_blocks=b) for b in (True, False))
    assert wary(costmap(cells), here)[0] == Stand.UNKNOWN
    assert wary(costmap(cells), here)[1].tolist() == [10, 12]
    assert bold(costmap(cells), here)[0] == Stand.CLEAR
    for x in (0.25, 1.75, -5.0, 1e12):
        assert bold(costmap(cells), np.array([x, 1.05, 0.0]))[0] == Stand.OUTSIDE
    with pytest.raises(DataError, match="not finite"):
        bold(costmap(cells), np.array([np.nan, 1.0, 0.0]))


def test_a_stamp_covers_what_it_touches_or_whose_middle_it_covers():
    outline = SHAPES["rectangle"].at(np.array([1.0, 1.1, 0.4]))
    whole, middles = np.zeros((22, 22), np.uint8), np.zeros((22, 22), np.uint8)
    stamp(whole, 0.0, 0.0, 0.1, outline, 0.0, 0.5, 9)
    stamp(middles, 0.0, 0.0, 0.1, outline, 0.0, 0.0, 9)
    shape = Polygon(outline)
    for r in range(22):
        for c in range(22):
            square = box(c * 0.1, r * 0.1, (c + 1) * 0.1, (r + 1) * 0.1)
            assert (whole[r, c] == 9) == shape.intersects(square)
            assert (middles[r, c] == 9) == shape.contains(square.centroid)
