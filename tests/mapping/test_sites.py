"""Drawings as cells, with shapely as the judge; zones; georeferencing; and what drawings may not be."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from shapely import LineString, Polygon, box

from outrider.data.grid import UNKNOWN
from outrider.data.site import Dock, Shape, ShapeKind, Site
from outrider.errors import ConfigError, DataError
from outrider.mapping.georeference import fit
from outrider.mapping.raster import covered
from outrider.mapping.sites import draw

K = ShapeKind
SQUARE = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]])


def area(kind, points, **more):
    return Shape(kind=kind, points=np.array(points, float), area=True, **more)


def line(kind, points, width, **more):
    return Shape(kind=kind, points=np.array(points, float), width=width, **more)


def value(drawn, x, y):
    return int(drawn.grid.cells[tuple(drawn.grid.cell_of(np.array([x, y])))])


def star(seed, corners, reach=9.0):
    """A simple polygon about (10, 10), mostly not convex."""
    rng = np.random.default_rng(seed)
    angles = np.sort(rng.uniform(0.0, 2 * np.pi, corners))
    return 10.0 + (rng.uniform(1.0, reach, corners) * np.array([np.cos(angles), np.sin(angles)])).T


@settings(derandomize=True, max_examples=25)
@given(seed=st.integers(0, 10**6), corners=st.integers(3, 9), shift=st.floats(-12.0, 12.0))
def test_cells_of_a_polygon_are_those_that_shapely_names(seed, corners, shift):
    """Also where it sticks out of the grid."""
    ring = star(seed, corners) + shift
    shape = Polygon(ring)
    assume(shape.is_valid)
    some, whole = (covered(ring, np.array([0, corners]), (20, 24), whole=w) for w in (False, True))
    for row in range(20):
        for col in range(24):
            cell = box(col, row, col + 1, row + 1)
            inside = shape.intersection(cell).area
            if inside > 1e-9:
                assert some[row, col]
            elif shape.distance(cell) > 1e-9:
                assert not some[row, col]
            if inside < 1.0 - 1e-9:
                assert not whole[row, col]
            elif shape.boundary.distance(cell) > 1e-9:
                assert whole[row, col]


def test_holes_are_not_covered():
    hole = SQUARE * 0.4 + 3.0
    some = covered(np.concatenate([SQUARE, hole]), np.array([0, 4, 8]), (12, 12), whole=False)
    assert some[1, 1]
    assert not some[5, 5]


def test_roads_are_free_where_they_cover_cells_whole_and_what_is_taken_wins():
    site = Site(
        shapes=(
            line(K.ROAD, [[0, 0], [20, 0]], 4.0),
            line(K.ROAD, [[20, 0], [20, 12]], 4.0),
            area(K.BUILDING, [[5, 1], [9, 1], [9, 6], [5, 6]]),
            Shape(kind=K.OBSTACLE, points=np.array([[12.0, 0.0]]), width=0.5),
        )
    )
    drawn = draw(site, 0.5, margin=1.0)
    assert value(drawn, 2.2, 0.2) == 0
    assert value(drawn, 7.2, 1.2) == 100
    assert value(drawn, 7.2, 5.7) == 100
    assert value(drawn, 7.2, 6.2) == UNKNOWN  # along the wall: not taken
    assert value(drawn, 12.1, 0.1) == 100
    assert value(drawn, 2.2, 1.7) == 0  # along the kerb: still free
    assert value(drawn, 2.2, 2.2) == UNKNOWN
    assert np.allclose(drawn.grid.origin % 0.5, 0.0)
    assert drawn.taken_area == pytest.approx(20.0 + np.pi * 0.25**2, rel=1e-3)
    free = draw(site, 0.5, margin=1.0, open_ground=True)
    assert value(free, 2.2, 6.2) == 0
    assert value(free, 7.2, 5.7) == 100


def test_adjoining_roads_leave_no_seam():
    east, north = (area(K.ROAD, SQUARE + np.array(by)) for by in ([10.03, 0.0], [0.0, 10.0]))
    site = Site(shapes=(area(K.ROAD, SQUARE), east, north))
    drawn = draw(site, 0.2)
    assert value(drawn, 5.1, 9.9) == value(drawn, 5.1, 10.1) == 0
    assert value(drawn, 10.1, 5.0) == UNKNOWN  # there really is a gap of 3 cm


def test_a_disc_is_taken_whole():
    disc = Shape(kind=K.OBSTACLE, points=np.array([[3.03, 2.98]]), width=2.0)
    drawn = draw(Site(shapes=(disc,)), 0.1)
    around = np.linspace(0.0, 2 * np.pi, 500)
    assert all(value(drawn, 3.03 + 0.9999 * np.cos(a), 2.98 + 0.9999 * np.sin(a)) == 100 for a in around)


def test_gates_are_in_the_way_only_while_closed():
    road, way = line(K.ROAD, [[0, 0], [10, 0]], 4.0), [[5.0, -2.0], [5.0, 2.0]]
    for opened, expected in ((True, 0), (False, 100)):
        drawn = draw(Site(shapes=(road, line(K.GATE, way, 0.2, open=opened))), 0.1)
        assert value(drawn, 5.02, 0.0) == expected


def test_zones():
    site = Site(
        shapes=(
            line(K.ROAD, [[0, 0], [30, 0]], 6.0),
            area(K.KEEP_OUT, [[20, -1], [22, -1], [22, 1], [20, 1]]),
            area(K.SPEED, [[0, -3], [12, -3], [12, 3], [0, 3]], speed=1.5),
            area(K.SPEED, [[8, -3], [16, -3], [16, 3], [8, 3]], speed=0.5),
            line(K.ONE_WAY, [[0, 0], [10, 0]], 2.0, heading=0.0, name="east"),
        )
    )
    zones = draw(site, 0.25).zones
    assert [zones.speed_at(np.array([x, 0.1])) for x in (5.0, 10.0, 14.0, 18.0)] == [1.5, 0.5, 0.5, np.inf]
    assert zones.barred(np.array([21.0, 0.1]))
    assert zones.speed_at(np.array([21.0, 0.1])) == 0.0
    assert zones.speed_at(np.array([500.0, 0.0])) == 0.0  # off the map: no limits are known
    assert zones.slowest(np.array([[5.0, 0.0], [7.0, 0.0], [9.0, 0.0]])) == 0.5
    assert zones.slowest(np.empty((0, 2))) == 0.0
    against = zones.against(np.array([5.0, 0.0]), 3.0)
    assert against is not None
    assert against.name == "east"
    assert zones.against(np.array([5.0, 0.0]), 0.5) is None
    assert zones.against(np.array([5.0, 2.0]), 3.0) is None


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ({"points": [[0, 0], [4, 4], [4, 0], [0, 4]]}, r"crosses itself at \(2.00, 2.00\) m: edge 1 meets edge 3"),
        ({"points": [[0, 0], [4, 0], [4, 4], [2, 0], [0, 4]]}, "crosses itself"),
        ({"points": [[0, 0], [4, 0]]}, "has 2 corners"),
        ({"points": [[0, 0], [1, 1], [2, 2]]}, "one line"),
        ({"points": [[0, 0], [0, 0], [2, 2]]}, "one corner twice"),
        ({"points": [[0, 0], [np.nan, 0], [2, 2]]}, "point 2 is not finite"),
        ({"points": [[0, 0], [3, 0], [3, 3]], "speed": -1.0}, "allows -1 m/s"),
        ({"points": [[0, 0], [3, 0], [3, 3]], "heading": np.inf}, "heading"),
    ],
)
def test_areas_without_a_sense_are_named(fault, said):
    with pytest.raises(DataError, match=said) as e:
        area(K.BUILDING, fault.pop("points"), name="hall", **fault)
    assert "building 'hall'" in str(e.value)


@settings(derandomize=True, max_examples=150)
@given(seed=st.integers(0, 10**6), corners=st.integers(4, 8))
def test_a_polygon_is_refused_where_shapely_calls_it_invalid(seed, corners):
    ring = np.random.default_rng(seed).uniform(0.0, 10.0, (corners, 2))
    try:
        area(K.BUILDING, ring)
        accepted = True
    except DataError:
        accepted = False
    assert accepted == Polygon(ring).is_valid


@pytest.mark.parametrize("width", [0.0, -2.0, np.nan, np.inf])
def test_a_line_needs_a_width(width):
    with pytest.raises(DataError, match="wide"):
        line(K.ROAD, [[0, 0], [4, 0]], width)


def test_maps_that_make_no_sense_are_refused():
    far = Site(name="far", shapes=(line(K.ROAD, [[0, 0], [1e6, 1e6]], 4.0),))
    with pytest.raises(ConfigError, match=r"million cells of 0.05 m .*is a shape far away"):
        draw(far, 0.05)
    for resolution in (0.0, 1e-320, -1.0, np.nan, np.inf):
        with pytest.raises(ConfigError, match="resolution"):
            draw(far, resolution)
    with pytest.raises(DataError, match="nothing is drawn"):
        draw(Site(), 0.1)
    road = Site(name="road", shapes=(line(K.ROAD, [[0, 0], [30, 0]], 4.0),))
    with pytest.raises(ConfigError, match=r"cells of 1e\+09 m are larger than the site"):
        draw(road, 1e9)


def test_docks_and_widths_are_inside_the_map():
    road = line(K.ROAD, [[0, 0], [10, 0]], 6.0)
    low, high = Site(shapes=(road,), docks=(Dock(name="a", pose=np.array([20.0, -9.0, 0.0])),)).extent
    assert low.tolist() == [-3.0, -9.0]
    assert high.tolist() == [20.0, 3.0]
    assert LineString(road.points).buffer(3.0, cap_style="flat").within(box(*low, *high))


@settings(derandomize=True, max_examples=40)
@given(seed=st.integers(0, 10**6), scale=st.floats(0.01, 2.0), heading=st.floats(-3.1, 3.1), n=st.integers(2, 8))
def test_control_points_give_back_the_similarity(seed, scale, heading, n):
    rng = np.random.default_rng(seed)
    pixels, origin = rng.uniform(0.0, 500.0, (n, 2)), rng.uniform(-1e3, 1e3, 2)
    c, s = np.cos(heading), np.sin(heading)
    up = np.column_stack([pixels[:, 0], 400.0 - pixels[:, 1]])
    found = fit(pixels, origin + scale * up @ np.array([[c, s], [-s, c]]), 400)
    assert found.resolution == pytest.approx(scale, rel=1e-9)
    assert found.heading == pytest.approx(heading, abs=1e-9)
    assert found.origin == pytest.approx(origin, abs=1e-6)
    assert found.rmse < 1e-8
    assert found.suspects == []


def test_a_mistyped_control_point_is_pointed_at():
    rng = np.random.default_rng(3)
    pixels = np.array([[0.0, 0], [400, 0], [400, 300], [0, 300], [200, 40], [90, 210]])
    places = np.column_stack([pixels[:, 0], 300 - pixels[:, 1]]) * 0.1 + rng.normal(0.0, 0.02, (6, 2))
    assert fit(pixels, places, 300).suspects == []
    assert fit(pixels, places, 300).rmse < 0.05
    places[4] += [10.0, 0.0]
    assert fit(pixels, places, 300).suspects == [4]
    with pytest.raises(DataError, match="in one place"):
        fit(np.ones((3, 2)), places[:3], 300)
    with pytest.raises(DataError, match="1 control points"):
        fit(pixels[:1], places[:1], 300)


CORNERS = np.array([[0.0, 0.0], [520.0, 0.0], [520.0, 260.0], [0.0, 260.0]])


def on_ground(pixels, rows=260, resolution=0.1):
    return np.column_stack([pixels[:, 0], rows - pixels[:, 1]]) * resolution


def test_a_mistyped_control_point_is_the_one_that_is_named():
    for k in range(4):
        places = on_ground(CORNERS)
        places[k, 0] += 90.0
        assert fit(CORNERS, places, 260).suspects == [k]
    assert fit(CORNERS, on_ground(CORNERS) + 0.03 * np.array([[1, -1], [-1, 1], [1, 1], [-1, -1]]), 260).suspects == []


def test_a_mirrored_image_and_one_as_large_as_a_country_are_refused():
    with pytest.raises(DataError, match="mirrored"):
        fit(CORNERS, CORNERS * 0.1, 260)
    with pytest.raises(DataError, match="km high"):
        fit(CORNERS[:2], np.array([[0.0, 0.0], [5e6, 1e6]]), 260)


def test_a_hole_outside_its_area_is_named_with_its_place():
    hole = (np.array([[100.0, 100.0], [101.0, 100.0], [101.0, 101.0]]),)
    shed = area(K.BUILDING, SQUARE, holes=hole, name="shed")
    with pytest.raises(DataError, match=r"building 'shed'.*100 100"):
        draw(Site(shapes=(shed,)), 0.5)
