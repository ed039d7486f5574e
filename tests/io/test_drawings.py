"""Drawings of sites, in metres and in degrees; route graphs; control points; and what can be wrong in them."""

import json
from math import degrees, radians
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from outrider.core.geodesy import enu_to_geodetic
from outrider.data.routes import RouteGraph
from outrider.data.site import ShapeKind
from outrider.errors import ConfigError, DataError, UsageError
from outrider.io.config import read_yaml
from outrider.io.control_points import read_referenced
from outrider.io.route_graphs import read_route_graph, write_route_graph
from outrider.io.sites import parse_site, read_site, site_text

LAT, LON = 52.514, 13.35
YARD = """\
name: yard
anchor: {lat_deg: 52.514, lon_deg: 13.35, alt_m: 78.0, heading_deg: 12}
roads:
  - {name: main, line: [[0, 0], [40, 0]], width: 6}
  - {area: [[10, 3], [20, 3], [20, 12], [10, 12]], holes: [[[12, 5], [14, 5], [14, 7]]]}
obstacles:
  - {disc: [30, 1, 0.2]}
gates:
  - {line: [[5, -3], [5, 3]], width: 0.2, open: true}
speed_zones:
  - {area: [[0, -3], [8, -3], [8, 3], [0, 3]], speed: 0.7}
one_way:
  - {area: [[0, -3], [8, -3], [8, 3], [0, 3]], heading_deg: 90}
routes:
  nodes: {a: [1, 0], b: [20, 0], c: [39, 0]}
  ways:
    - {way: [a, b, c], width: 6}
    - {way: [c, b], both: false, speed: 1.2}
docks:
  - {name: charger, at: [15, 10], heading_deg: -90}
"""


def written(tmp_path, text, name="yard.yaml"):
    path = tmp_path / name
    path.write_text(text if isinstance(text, str) else json.dumps(text))
    return path


def lon_lat(*points):
    lat, lon, _ = enu_to_geodetic(np.array([[*p, 0.0] for p in points]), radians(LAT), radians(LON), 0.0)
    return np.degrees(np.column_stack([lon, lat])).tolist()


def feature(geometry, coordinates, /, **properties):
    return {"type": "Feature", "properties": properties, "geometry": {"type": geometry, "coordinates": coordinates}}


def collection(*features, **more):
    return {"type": "FeatureCollection", "features": list(features), **more}


HERE = feature("Point", [LON, LAT], kind="anchor")
ROAD = feature("LineString", lon_lat((0, 0), (40, 0)), highway="service", width="5.5 m", name="main")


def test_a_drawing_in_metres(tmp_path):
    site = read_site(written(tmp_path, YARD))
    assert [s.kind for s in site.shapes] == [
        ShapeKind.ROAD, ShapeKind.ROAD, ShapeKind.OBSTACLE, ShapeKind.GATE, ShapeKind.SPEED, ShapeKind.ONE_WAY
    ]  # fmt: skip
    assert site.shapes[2].width == 0.4
    assert site.routes is not None
    told = {
        tuple(e): (s, w)
        for e, s, w in zip(site.routes.edges.tolist(), site.routes.speed, site.routes.width, strict=True)
    }
    assert told == {(0, 1): (np.inf, 6), (1, 0): (np.inf, 6), (1, 2): (np.inf, 6), (2, 1): (1.2, 6)}
    assert site.docks[0].pose.tolist() == [15.0, 10.0, radians(-90)]
    assert site.anchor is not None
    assert site.anchor.heading == radians(12)


def test_a_site_is_written_as_it_was_read(tmp_path):
    site = read_site(written(tmp_path, YARD))
    text = site_text(site)
    again = read_site(written(tmp_path, text, "again.yaml"))
    assert site_text(again) == text
    for mine, theirs in zip(site.shapes, again.shapes, strict=True):
        assert mine.kind is theirs.kind
        assert (mine.points == theirs.points).all()
        assert (mine.width, mine.speed, mine.open, mine.area) == (theirs.width, theirs.speed, theirs.open, theirs.area)
    assert site.routes is not None
    assert again.routes is not None
    assert (site.routes.edges == again.routes.edges).all()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("width: 6}\n  -", "width: -6}\n  -", "yard.yaml:4: roads.0.width: should be more than 0"),
        ("width: 6}\n  -", "}\n  -", "yard.yaml:4: roads.0: road 'main' is a line without a width"),
        ("[40, 0]]", "[40, .nan]]", "yard.yaml:4: roads.0.line.1.1: should be a finite number"),
        ("line: [[0, 0], [40, 0]], ", "", "says nowhere what it covers"),
        ("disc: [30, 1, 0.2]", "disc: [30, 1, 0.2], line: [[0, 0], [1, 1]]", "is drawn as line and disc"),
        ("disc: [30, 1, 0.2]", "disc: [30, 1, 0]", "yard.yaml:7: obstacles.0: obstacle is 0 m wide"),
        ("[20, 12], [10, 12]]", "[10, 12], [20, 12]]", "yard.yaml:5: roads.1: road crosses itself at (15.00, 7.50) m"),
        (", speed: 0.7", "", "yard.yaml:11: speed_zones.0: speed is a speed zone that says no speed"),
        ("heading_deg: 90}", "}", "does not say which way"),
        ("[a, b, c], width", "[a, d, c], width", "yard.yaml:17: routes.ways.0: there is no node 'd'"),
        ("[a, b, c], width", "[a, a, c], width", "leads from a node to itself"),
        ("gates:", "gate:", "yard.yaml:8: gate: unknown key (did you mean 'gates'?)"),
        ("docks:\n", "docks:\n  - {name: charger, at: [1, 0]}\n", "docks.1: is a second dock 'charger'"),
        ("lat_deg: 52.514", "lat_deg: 152.5", "yard.yaml:2: anchor.lat_deg: should be 90 or less"),
    ],
)
def test_a_fault_in_metres_is_named_with_its_line(tmp_path, old, new, said):
    assert old in YARD
    with pytest.raises(ConfigError) as e:
        read_site(written(tmp_path, YARD.replace(old, new, 1)))
    assert said in str(e.value)
    assert "\n" not in str(e.value)


def test_another_ending_is_no_drawing(tmp_path):
    with pytest.raises(UsageError, match="no drawing"):
        read_site(written(tmp_path, "x", "yard.dxf"))


def test_degrees_become_metres_about_the_anchor(tmp_path):
    hall = [*lon_lat((10, 3), (20, 3), (20, 12), (10, 12), (10, 3))]
    path = written(
        tmp_path, collection(HERE, ROAD, feature("Polygon", [hall], building="yes", name="hall")), "s.geojson"
    )
    site = read_site(path)
    road, building = site.shapes
    assert road.width == 5.5
    assert road.points == pytest.approx(np.array([[0, 0], [40, 0]]), abs=1e-6)
    assert building.points == pytest.approx(np.array([[10, 3], [20, 3], [20, 12], [10, 12]]), abs=1e-6)
    assert site.routes is not None
    assert site.routes.lengths.tolist() == pytest.approx([40.0, 40.0], abs=1e-6)


def test_a_turned_anchor_turns_the_axes(tmp_path):
    here = feature("Point", [LON, LAT], kind="anchor", heading_deg=90)
    lane = feature("Polygon", [lon_lat((0, 0), (9, 0), (9, 9), (0, 0))], kind="one_way", heading_deg=90)
    dock = feature("Point", lon_lat((0, 5))[0], kind="dock", name="d", heading_deg=180)
    site = read_site(written(tmp_path, collection(here, ROAD, lane, dock), "s.geojson"))
    assert site.shapes[0].points == pytest.approx(np.array([[0, 0], [0, -40]]), abs=1e-6)
    assert site.shapes[1].heading == pytest.approx(0.0)
    assert site.docks[0].pose == pytest.approx([5.0, 0.0, np.pi / 2], abs=1e-6)


def test_without_an_anchor_the_middle_is_the_origin(tmp_path):
    site = read_site(written(tmp_path, collection(ROAD), "s.geojson"))
    assert site.anchor is not None
    assert site.shapes[0].points == pytest.approx(np.array([[-20, 0], [20, 0]]), abs=0.1)
    assert degrees(site.anchor.datum.lat) == pytest.approx(LAT, abs=1e-5)


def test_an_extract_of_openstreetmap(tmp_path):
    def way(*points, **tags):
        return feature("LineString", lon_lat(*points), **tags)

    extract = collection(
        HERE,
        way((0, 0), (50, 0), highway="residential", maxspeed="30", name="A"),
        way((50, 0), (50, 40), highway="service", oneway="yes", maxspeed="10 mph"),
        way((0, 9), (9, 9), highway="steps", width=2),
        way((60, 0), (60, 9), barrier="fence"),
        feature("Point", lon_lat((48, 0))[0], barrier="lift_gate", access="yes"),
        feature("Point", lon_lat((30, 3))[0], barrier="bollard"),
        feature("MultiPolygon", [[lon_lat((5, 5), (8, 5), (8, 8), (5, 5))]], building="garage"),
        feature("Polygon", [lon_lat((70, 0), (80, 0), (80, 9), (70, 0))], landuse="grass"),
    )
    site = read_site(written(tmp_path, extract, "osm.geojson"))
    kinds = [s.kind.value for s in site.shapes]
    assert kinds == ["road", "road", "obstacle", "obstacle", "gate", "obstacle", "building"]
    assert [s.width for s in site.shapes[:4]] == [5.5, 4.0, 2.0, 0.3]
    assert site.shapes[4].open
    assert site.routes is not None
    speeds = {tuple(e): s for e, s in zip(site.routes.edges.tolist(), site.routes.speed, strict=True)}
    assert speeds == pytest.approx({(0, 1): 30 / 3.6, (1, 0): 30 / 3.6, (1, 2): 4.4704})  # they share a node
    said = " | ".join(site.notes)
    assert "a residential without a width is taken as 5.5 m wide" in said
    assert "landuse=grass" in said
    assert "there are no routes" in said


SWAPPED = [c[::-1] for c in lon_lat((0, 0), (40, 0))]


@pytest.mark.parametrize(
    ("features", "said"),
    [
        ([feature("LineString", [[13.3, 152.5], [13.4, 152.6]], kind="road", width=4)], "feature 1"),
        (
            [feature("LineString", [[-33.8, 151.2], [-33.9, 151.2]], kind="road", width=4, name="x")],
            "feature 1 'x': has latitude and longitude swapped: [-33.8, 151.2] (write [longitude, latitude])",
        ),
        ([HERE, feature("LineString", SWAPPED, highway="service")], "feature 2: has latitude and longitude swapped"),
        (
            [ROAD, ROAD, feature("LineString", SWAPPED, highway="service")],
            "feature 3: has latitude and longitude swapped, unlike the rest",
        ),
        ([ROAD, ROAD, feature("Point", [13.35, 51.5], barrier="bollard")], "feature 3: is 113 km away from the rest"),
        ([feature("LineString", [[391000, 5819000], [391100, 5819000]], kind="road", width=4)], "are no degrees"),
        (
            [HERE, feature("Polygon", [lon_lat((0, 0), (4, 4), (4, 0), (0, 4), (0, 0))], building="yes", name="bow")],
            "feature 2 'bow': building 'bow' crosses itself at (2.00, 2.00) m",
        ),
        ([feature("LineString", lon_lat((0, 0), (9, 0)), kind="road", width=-3)], "road is -3 m wide"),
        ([feature("LineString", lon_lat((0, 0), (9, 0)), kind="road", width="wide")], "width is 'wide'"),
        ([feature("LineString", lon_lat((0, 0), (9, 0)), kind="rood", width=3)], "there is no kind 'rood'"),
        ([feature("LineString", [["a", 1], [2, 3]], kind="road", width=3)], "make no sense"),
        ([feature("LineString", [[None, 1], [2, 3]], kind="road", width=3)], "make no sense"),
        ([feature("LineString", [[float("nan"), 1], [2, 3]], kind="road", width=3)], "not finite"),
        (
            [feature("Point", [13.35, 52.514], kind="anchor"), ROAD, feature("Point", [13.35, 52.514], kind="anchor")],
            "features 1 and 3 are all anchors",
        ),
        ([ROAD, *(feature("Point", [13.35, 52.514], kind="dock", name="d") for _ in "12")], "there are two docks 'd'"),
        ([feature("Polygon", [], building="yes")], "feature 1"),
        ([feature("GeometryCollection", [], building="yes")], "is a GeometryCollection"),
        ([feature("Point", [1, 2], landuse="grass")], "nothing in it is part of a site"),
    ],
)
def test_a_fault_in_degrees_is_named_with_its_feature(tmp_path, features, said):
    with pytest.raises(DataError) as e:
        read_site(written(tmp_path, collection(*features), "s.geojson"))
    assert said in str(e.value)
    assert "s.geojson" in str(e.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('{"type": "FeatureCollection",\n "features": [}', "s.geojson:2: is no JSON"),
        ("[1, 2]", "no JSON object"),
        ('{"type": "Topology"}', "no GeoJSON feature collection"),
        ('{"type": "FeatureCollection", "features": [{"type": "Feature", "geometry": null}]}', "has no geometry"),
        ("[" * 100_000, "s.geojson"),
    ],
)
def test_what_is_no_geojson_is_refused(tmp_path, text, said):
    with pytest.raises(DataError) as e:
        read_site(written(tmp_path, text, "s.geojson"))
    assert said in str(e.value)


def test_other_coordinates_than_wgs84_are_refused(tmp_path):
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::3857"}}
    with pytest.raises(DataError, match="EPSG::3857"):
        read_site(written(tmp_path, collection(ROAD, crs=crs), "s.geojson"))
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}}
    assert read_site(written(tmp_path, collection(ROAD, crs=crs), "s.geojson")).shapes


def graph():
    return RouteGraph(
        names=("gate", "yard", "hall Ä"),
        nodes=np.array([[0.1, 1 / 3], [10.0, -2.0], [7.0, 1e-9]]),
        edges=np.array([[0, 1], [1, 0], [1, 2]]),
        speed=np.array([1.5, np.inf, 0.7]),
        width=np.array([np.inf, np.inf, 2.4]),
    )


def test_route_graph_round_trip_to_the_bit(tmp_path):
    path = tmp_path / "routes.geojson"
    write_route_graph(graph(), path)
    again = read_route_graph(path)
    assert again.names == graph().names
    for name in ("nodes", "edges", "speed", "width"):
        assert (getattr(again, name) == getattr(graph(), name)).all()


def test_a_route_graph_is_what_nav2_route_wants(tmp_path):
    path = tmp_path / "routes.geojson"
    write_route_graph(graph(), path)
    features = json.loads(path.read_text())["features"]
    nodes = [f for f in features if f["geometry"]["type"] == "Point"]
    edges = [f for f in features if f["geometry"]["type"] == "MultiLineString"]
    assert [f["properties"]["id"] for f in nodes] == [0, 1, 2]
    assert all(f["properties"]["frame"] == "map" for f in nodes)
    assert len({f["properties"]["id"] for f in features}) == len(features)
    assert [(f["properties"]["startid"], f["properties"]["endid"]) for f in edges] == [(0, 1), (1, 0), (1, 2)]
    assert edges[0]["properties"]["metadata"] == {"abs_speed_limit": 1.5}


def test_a_graph_as_nav2_ships_it(tmp_path):
    """Plain lines, an edge that is there twice, ids that are no rows, a crs that does not matter in metres."""
    text = collection(
        feature("Point", [0.5, 1.5], id=7),
        feature("Point", [4.5, 1.5], id=3),
        feature("LineString", [[0.5, 1.5], [4.5, 1.5]], id=100, startid=7, endid=3),
        feature("LineString", [[0.5, 1.5], [4.5, 1.5]], id=100, startid=7, endid=3),
        crs={"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::3857"}},
    )
    read = read_route_graph(written(tmp_path, text, "g.geojson"))
    assert read.names == ("7", "3")
    assert read.edges.tolist() == [[0, 1]]


@pytest.mark.parametrize(
    ("bad", "said"),
    [
        (feature("LineString", [[0, 0], [1, 1]], id=9, startid=0, endid=5), "feature 2: leads to node 5"),
        (feature("LineString", [[0, 0], [1, 1]], id=9, startid="a", endid=0), "no whole number `startid`"),
        (feature("Point", [1.0, float("inf")], id=4), "not finite"),
        (feature("Point", [1.0, 2.0]), "no whole number `id`"),
        (feature("Point", [1.0, 2.0], id=1, metadata={"name": "0"}), "two nodes have one name"),
        (
            feature("LineString", [[0, 0], [1, 1]], id=9, startid=0, endid=0, metadata={"abs_speed_limit": -1}),
            "abs_speed_limit is -1",
        ),
    ],
)
def test_a_graph_without_a_sense_is_refused(tmp_path, bad, said):
    with pytest.raises(DataError) as e:
        read_route_graph(written(tmp_path, collection(feature("Point", [0.0, 0.0], id=0), bad), "g.geojson"))
    assert said in str(e.value)


def points_file(tmp_path, *lines, name="points.yaml"):
    return written(tmp_path, "points:\n" + "".join(f"  - {{{line}}}\n" for line in lines), name)


def test_an_image_is_laid_on_the_ground(tmp_path):
    """0.2 m per pixel, turned by 30 degrees: from degrees, from metres."""
    image = tmp_path / "plan.png"
    Image.fromarray(np.full((40, 60), 254, np.uint8)).save(image)
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    told = [(0, 40), (60, 40), (60, 0), (0, 0)]
    metres = [0.2 * np.array([c * u - s * (40 - v), s * u + c * (40 - v)]) for u, v in told]
    degrees_ = lon_lat(*metres)
    by_metres = [f"pixel: [{u}, {v}], metres: [{x:.9f}, {y:.9f}]" for (u, v), (x, y) in zip(told, metres, strict=True)]
    by_degrees = [
        f"pixel: [{u}, {v}], lon_deg: {x:.12f}, lat_deg: {y:.12f}"
        for (u, v), (x, y) in zip(told, degrees_, strict=True)
    ]
    for lines in (by_metres, by_degrees):
        there, found = read_referenced(image, points_file(tmp_path, *lines))
        assert found.resolution == pytest.approx(0.2, rel=1e-5)
        assert there.heading == pytest.approx(np.pi / 6, abs=1e-5)
        assert there.grid.origin == pytest.approx([0.0, 0.0], abs=1e-3)
        assert found.rmse < 1e-3
    assert there.anchor is not None


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (["pixel: [0, 0], metres: [0, 0]"], "points"),
        (["pixel: [0, 0], metres: [0, 0]", "pixel: [99, 0], metres: [9, 0]"], "points.yaml:3: points.1: pixel"),
        (["pixel: [0, 0], metres: [0, 0]", "pixel: [5, 0], lat_deg: 3"], "does not say where it is"),
        (["pixel: [0, 0], metres: [0, 0]", "pixel: [5, 0], metres: [0, 0]"], "all control points are in one place"),
        (["pixel: [0, 0], metres: [0, 0]", "pixel: [5, .nan], metres: [0, 0]"], "finite"),
    ],
)
def test_control_points_without_a_sense_are_refused(tmp_path, lines, said):
    image = tmp_path / "plan.png"
    Image.fromarray(np.full((40, 60), 254, np.uint8)).save(image)
    with pytest.raises(ConfigError) as e:
        read_referenced(image, points_file(tmp_path, *lines))
    assert said in str(e.value)


def test_the_drawing_of_the_example_is_valid():
    path = Path(__file__).resolve().parents[2] / "examples" / "06_map_a_site.yaml"
    assert parse_site(read_yaml(path), str(path)).name == "depot"
