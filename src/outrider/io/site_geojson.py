"""Sites drawn in degrees: GeoJSON from QGIS or geojson.io, and extracts of OpenStreetMap.

What a feature is stands in its property `outrider` or `kind` (the words of `ShapeKind`, and route, node, dock, anchor);
without one OpenStreetMap's tags tell: highway, building, barrier, natural, amenity=parking.
"""

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from math import cos, inf, isfinite, radians, sin
from pathlib import Path
from typing import Any, Final, cast, final

import numpy as np

from outrider.core.angles import wrap
from outrider.core.geodesy import geodetic_to_enu
from outrider.data.routes import RouteGraph
from outrider.data.site import Anchor, Dock, Shape, ShapeKind, Site
from outrider.data.trajectory import Datum
from outrider.errors import DataError
from outrider.io.checked import validated
from outrider.io.geojson import features_of, located, read_json
from outrider.io.map_server import AnchorSection
from outrider.io.sites import graph_of
from outrider.typing import Floats

WIDTHS: Final = {  # m: OpenStreetMap's roads that say no width
    "motorway": 11.0, "trunk": 9.0, "primary": 7.0, "secondary": 6.5, "tertiary": 6.0, "unclassified": 5.5,
    "residential": 5.5, "living_street": 5.0, "service": 4.0, "track": 3.0, "pedestrian": 4.0, "cycleway": 2.5,
    "footway": 2.0, "path": 1.5, "bridleway": 2.0,
}  # fmt: skip
ROAD, LANE, WALL, POST = 4.0, 3.0, 0.3, 0.3  # m: other roads, one lane, walls and fences, bollards and trees
GATES: Final = ("gate", "lift_gate", "swing_gate", "sliding_gate", "entrance")
FARTHEST: Final = 50_000.0  # m from the anchor: no site is as large
_SAME: Final = 0.02  # m: nodes nearer to each other are one
_WGS84: Final = ("CRS84", "EPSG::4326", "EPSG:4326", "OGC:CRS84")
_LINES, _AREAS = ("LineString", "MultiLineString"), ("Polygon", "MultiPolygon")


@final
@dataclass(frozen=True, slots=True)
class _Drawn:
    """A feature, in degrees. kind : as in files;  parts : rings, lines or points, each (n, 2) longitude, latitude."""

    index: int
    kind: str
    name: str
    geometry: str
    parts: list[list[Floats]]
    told: Mapping[str, Any] = field(default_factory=dict)


def read_geojson_site(path: Path) -> Site:
    """Read a drawing in WGS84 degrees as metres about its anchor, or about its middle if it has none.

    Raises DataError, with the feature, for coordinates that are no degrees, that are swapped, or that are far away, and
    for shapes that make no sense.
    """
    document = read_json(path)
    _require_degrees(document, path)
    drawn, ignored = _classified(path)
    if not drawn:
        fix = 'give features a property "kind": road, building, ... or OpenStreetMap\'s tags'
        raise DataError("nothing in it is part of a site", where=str(path), fix=fix)
    anchor = _anchor(document, drawn, path)
    _require_near(drawn, anchor, path)
    notes: list[str] = []
    shapes = [s for d in drawn for s in _shapes(d, anchor, path, notes)]
    if ignored:
        listed = ", ".join(f"{n} x {kind}" for kind, n in ignored.most_common(5))
        notes.append(f"{sum(ignored.values())} features are no part of a map and left out: {listed}")
    docks = _docks(drawn, anchor, path)
    routes, guessed = _routes(drawn, anchor)
    notes += guessed
    name = str(document.get("name") or path.stem)
    merged = [f"{what} ({n} times)" if n > 1 else what for what, n in Counter(notes).items()]
    return Site(name=name, shapes=tuple(shapes), routes=routes, docks=docks, anchor=anchor, notes=tuple(merged))


def to_metres(lon_lat_deg: Floats, anchor: Anchor) -> Floats:
    """(n, 2) m, site frame, of rows of longitude, latitude in degrees."""
    d, (lon, lat) = anchor.datum, np.radians(lon_lat_deg.T)
    enu = geodetic_to_enu(lat, lon, np.full(lat.shape, d.alt), d.lat, d.lon, d.alt)[:, :2]
    c, s = cos(anchor.heading), sin(anchor.heading)
    return np.ascontiguousarray(enu @ np.array([[c, -s], [s, c]]))


def _require_degrees(document: Mapping[str, Any], path: Path) -> None:
    crs = document.get("crs")
    named: Any = crs.get("properties", {}) if isinstance(crs, Mapping) else {}
    name = str(named.get("name", "")) if isinstance(named, Mapping) else ""
    if name and not name.endswith(_WGS84):
        raise DataError(f"has coordinates of {name}", where=str(path), fix="export it as WGS84, EPSG:4326")


def _classified(path: Path) -> tuple[list[_Drawn], Counter[str]]:
    drawn: list[_Drawn] = []
    ignored: Counter[str] = Counter()
    for k, feature in enumerate(features_of(path)):
        told = cast("Mapping[str, Any]", feature["properties"])
        name = str(told.get("name") or told.get("ref") or "")
        geometry = cast("dict[str, Any]", feature["geometry"])
        kind = _kind(told, str(geometry["type"]))
        if kind is None:
            word = told.get("outrider", told.get("kind"))
            if isinstance(word, str) and word:
                known = ", ".join([*(s.value for s in ShapeKind), "route", "node", "dock", "anchor"])
                raise DataError(f"there is no kind '{word}'", where=f"{path}: feature {k + 1}", fix=f"one of: {known}")
            ignored[_about(told)] += 1
            continue
        with located(path, k, name):
            parts = _parts(geometry)
            if not parts or not all(parts):
                raise DataError("has no coordinates")
            for ring in (r for part in parts for r in part):
                _require_lon_lat(ring)
        drawn.append(_Drawn(k, kind, name, geometry["type"], parts, told))
    return drawn, ignored


def _kind(told: Mapping[str, Any], geometry: str) -> str | None:
    """The word for what a feature is, None for what is no part of a map."""
    word = told.get("outrider", told.get("kind"))
    if isinstance(word, str) and word:
        known = {*(s.value for s in ShapeKind), "route", "node", "dock", "anchor"}
        return word if word in known else None
    highway, barrier = told.get("highway"), told.get("barrier")
    if highway == "steps":
        return "obstacle"
    if highway and geometry not in ("Point", "MultiPoint") and highway not in ("proposed", "construction"):
        return "road"
    if told.get("building") not in (None, "no"):
        return "building"
    if barrier:
        return "gate" if barrier in GATES else "obstacle"
    if told.get("natural") in ("tree", "water", "wood", "cliff") or told.get("waterway"):
        return "obstacle"
    return "road" if told.get("amenity") == "parking" and geometry in _AREAS else None


def _about(told: Mapping[str, Any]) -> str:
    return next(
        (f"{k}={told[k]}" for k in ("landuse", "leisure", "natural", "highway", "power") if k in told), "untold"
    )


def _parts(geometry: Mapping[str, Any]) -> list[list[Floats]]:
    """Rings, lines or points of a geometry, one list per part of a multiple one."""
    kind, c = str(geometry["type"]), geometry["coordinates"]
    if kind == "Point":
        return [[_array([c])]]
    if kind in ("LineString", "MultiPoint"):
        return [[_array(c)]] if kind == "LineString" else [[_array([p])] for p in c]
    if kind == "MultiLineString":
        return [[_array(line)] for line in c]
    return [[_opened(_array(r)) for r in part] for part in ([c] if kind == "Polygon" else c)]


def _array(rows: Any) -> Floats:
    if not rows:
        raise DataError("has no coordinates")
    out = np.array([[float(v) for v in row[:2]] for row in rows], np.float64)
    if out.shape[1:] != (2,):
        raise ValueError
    return out


def _opened(ring: Floats) -> Floats:
    """A ring without its first corner repeated at its end."""
    return ring[:-1] if len(ring) > 1 and (ring[0] == ring[-1]).all() else ring


def _require_lon_lat(p: Floats) -> None:
    if not np.isfinite(p).all():
        raise DataError("has a coordinate that is not finite")
    lon, lat = p.T
    far = np.flatnonzero(np.abs(lat) > 90.0)
    if far.size and (np.abs(lon) <= 90.0).all() and (np.abs(lat) <= 180.0).all():
        x, y = p[far[0]]
        raise DataError(f"has latitude and longitude swapped: [{x:g}, {y:g}]", fix="write [longitude, latitude]")
    if far.size or (np.abs(lon) > 360.0).any():
        x, y = p[far[0] if far.size else int(np.argmax(np.abs(lon)))]
        fix = "export as WGS84; for metres draw in YAML"
        raise DataError(f"has coordinates that are no degrees: [{x:g}, {y:g}]", fix=fix)


def _anchor(document: Mapping[str, Any], drawn: list[_Drawn], path: Path) -> Anchor:
    """As the file tells, else the middle of everything, to a millionth of a degree."""
    own = document.get("outrider")
    if isinstance(own, Mapping) and isinstance(cast("Mapping[str, Any]", own).get("anchor"), Mapping):
        return validated(AnchorSection, cast("Mapping[str, Any]", own)["anchor"], str(path)).anchor()
    told = [d for d in drawn if d.kind == "anchor"]
    if len(told) > 1:
        which = " and ".join(str(d.index + 1) for d in told)
        raise DataError(f"features {which} are all anchors", where=str(path), fix="keep the one that is (0, 0)")
    for d in told:
        lon, lat = d.parts[0][0][0].tolist()
        with located(path, d.index, d.name):
            alt, heading = _number(d.told, "alt_m") or 0.0, _number(d.told, "heading_deg") or 0.0
        return Anchor(datum=Datum(lat=radians(lat), lon=radians(lon), alt=alt), heading=radians(heading))
    rows = np.concatenate([ring for d in drawn for part in d.parts for ring in part])
    lon, lat = np.round(0.5 * (rows.min(axis=0) + rows.max(axis=0)), 6).tolist()
    return Anchor(datum=Datum(lat=radians(lat), lon=radians(lon), alt=0.0))


def _require_near(drawn: list[_Drawn], anchor: Anchor, path: Path) -> None:
    """Refuse what is too far from the rest to be of one site; swapped coordinates mostly are."""
    told = any(d.kind == "anchor" for d in drawn)
    middles = np.array([np.concatenate([r for part in d.parts for r in part]).mean(axis=0) for d in drawn])
    centre = np.degrees([anchor.datum.lon, anchor.datum.lat]) if told else np.median(middles, axis=0)
    about = replace(anchor, datum=Datum(lat=radians(centre[1]), lon=radians(centre[0]), alt=0.0))
    away = np.linalg.norm(to_metres(middles, about), axis=1)
    for d, middle, gap in zip(drawn, middles, away.tolist(), strict=True):
        if gap > FARTHEST:
            where = f"{path}: feature {d.index + 1}" + (f" '{d.name}'" if d.name else "")
            swapped = middle[None, ::-1]
            if abs(swapped[0, 1]) <= 90.0 and np.linalg.norm(to_metres(swapped, about)) <= FARTHEST:
                fix = "write [longitude, latitude]"
                raise DataError("has latitude and longitude swapped, unlike the rest", where=where, fix=fix)
            what = f"is {gap / 1000:.0f} km away from the {'anchor' if told else 'rest'}"
            raise DataError(what, where=where, fix="is it misplaced, or of another site?")


def _shapes(d: _Drawn, anchor: Anchor, path: Path, notes: list[str]) -> Iterator[Shape]:
    if d.kind not in {s.value for s in ShapeKind}:
        return
    kind, area = ShapeKind(d.kind), d.geometry in _AREAS
    with located(path, d.index, d.name):
        speed, heading = _number(d.told, "speed"), _number(d.told, "heading_deg")
        if kind is ShapeKind.ONE_WAY and heading is None:
            raise DataError("does not say which way", fix="property heading_deg: counter-clockwise from east")
        width = 0.0 if area else _width(d, notes)
        is_open = d.told.get("open") in (True, "yes", "true", 1) or d.told.get("access") in ("yes", "permissive")
        for part in d.parts:
            rings = [to_metres(r, anchor) for r in part]
            yield Shape(
                kind=kind,
                points=rings[0],
                area=area,
                width=width,
                holes=tuple(rings[1:]),
                name=d.name,
                speed=inf if speed is None or kind is not ShapeKind.SPEED else speed,
                heading=float(wrap(radians(heading or 0.0) - anchor.heading)),
                open=is_open,
            )


def _width(d: _Drawn, notes: list[str]) -> float:
    """As told, else by OpenStreetMap's class, which is said."""
    told = _number(d.told, "width")
    if told is not None:
        return told
    if d.kind == "road":
        lanes, highway = _number(d.told, "lanes"), str(d.told.get("highway", ""))
        width = LANE * lanes if lanes else WIDTHS.get(highway.removesuffix("_link"), ROAD)
        notes.append(f"a {highway or 'road'} without a width is taken as {width:g} m wide")
        return width
    return POST if d.geometry in ("Point", "MultiPoint") else WALL


def _number(told: Mapping[str, Any], key: str) -> float | None:
    """A property as a number, if it is there: 3.5, "3.5" or "3.5 m"."""
    value = told.get(key)
    if value is None or value == "":
        return None
    found = re.fullmatch(r"\s*(-?\d+(?:\.\d+)?)\s*(?:m|m/s)?\s*", str(value)) if not isinstance(value, bool) else None
    number = float(value) if isinstance(value, (int, float)) else float(found[1]) if found else inf
    if (found is None and not isinstance(value, (int, float))) or not isfinite(number):
        raise DataError(f"{key} is {value!r}", fix=f"write {key}: 3.5")
    return number


def _max_speed(told: Mapping[str, Any]) -> float | None:
    """m/s: our `speed`, else OpenStreetMap's `maxspeed` in km/h or mph."""
    if (own := _number(told, "speed")) is not None:
        return own
    found = re.fullmatch(r"(\d+(?:\.\d+)?)\s*(mph|km/h)?", str(told.get("maxspeed", "")))
    return float(found[1]) * (0.44704 if found[2] == "mph" else 1.0 / 3.6) if found else None


def _dock(d: _Drawn, anchor: Anchor, path: Path) -> Dock:
    with located(path, d.index, d.name):
        x, y = to_metres(d.parts[0][0][:1], anchor)[0].tolist()
        heading = float(wrap(radians(_number(d.told, "heading_deg") or 0.0) - anchor.heading))
    return Dock(name=d.name or f"dock {d.index + 1}", pose=np.array([x, y, heading]))


def _docks(drawn: list[_Drawn], anchor: Anchor, path: Path) -> tuple[Dock, ...]:
    docks = tuple(_dock(d, anchor, path) for d in drawn if d.kind == "dock")
    twice = [name for name, n in Counter(d.name for d in docks).items() if n > 1]
    if twice:
        raise DataError(f"there are two docks '{twice[0]}'", where=str(path), fix="give each a name of its own")
    return docks


def _routes(drawn: list[_Drawn], anchor: Anchor) -> tuple[RouteGraph | None, list[str]]:
    """The graph of the route features; without any, of the middles of the roads."""
    lines = [d for d in drawn if d.kind == "route" and d.geometry in _LINES]
    notes = [] if lines else ["there are no routes: the graph runs along the middles of the roads"]
    lines = lines or [d for d in drawn if d.kind == "road" and d.geometry in _LINES]
    if not lines:
        return None, []
    given = [(d.name, to_metres(d.parts[0][0], anchor)[0]) for d in drawn if d.kind == "node" and d.name]
    names: list[str] = []
    nodes: list[list[float]] = []
    rows: dict[tuple[int, int], int] = {}

    def node(p: Floats) -> int:
        key = (round(p[0] / _SAME), round(p[1] / _SAME))
        near = [rows[k] for i in (-1, 0, 1) for j in (-1, 0, 1) if (k := (key[0] + i, key[1] + j)) in rows]
        if near:
            return near[0]
        called = next((n for n, q in given if np.hypot(*(q - p)) < 0.5 and n not in names), f"n{len(names) + 1}")
        names.append(called)
        nodes.append(p.tolist())
        rows[key] = len(names) - 1
        return len(names) - 1

    ways: list[dict[str, Any]] = []
    for d in lines:
        one_way = str(d.told.get("oneway", "no"))
        for part in d.parts:
            way = [node(p) for p in to_metres(part[0], anchor)]
            way = [n for k, n in enumerate(way) if k == 0 or n != way[k - 1]]
            way = way[::-1] if one_way == "-1" else way
            both = one_way not in ("yes", "true", "1", "True", "-1")
            ways.append({"way": way, "both": both, "speed": _max_speed(d.told), "width": _number(d.told, "width")})
    return graph_of(names, nodes, ways), notes
