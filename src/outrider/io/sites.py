"""Drawings of sites: YAML in metres, and GeoJSON in degrees (`io.site_geojson`)."""

from collections.abc import Mapping, Sequence
from math import inf, isfinite, radians
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from outrider.data.routes import RouteGraph
from outrider.data.site import Dock, Shape, ShapeKind, Site
from outrider.errors import ConfigError, DataError, OutriderError, UsageError
from outrider.io.checked import Flag, Number, fault_at, validated
from outrider.io.config import read_yaml, yaml_text
from outrider.io.map_server import AnchorSection, anchor_dict, written_deg

YAML_ENDINGS: Final = (".yaml", ".yml")
JSON_ENDINGS: Final = (".geojson", ".json")
SECTIONS: Final = {
    "roads": ShapeKind.ROAD,
    "buildings": ShapeKind.BUILDING,
    "obstacles": ShapeKind.OBSTACLE,
    "gates": ShapeKind.GATE,
    "keep_out": ShapeKind.KEEP_OUT,
    "speed_zones": ShapeKind.SPEED,
    "one_way": ShapeKind.ONE_WAY,
}
Metres = Annotated[Number, Field(allow_inf_nan=False, ge=-1e9, le=1e9)]
Point = Annotated[list[Metres], Field(min_length=2, max_length=2)]
Above = Annotated[Number, Field(gt=0, le=1e9, allow_inf_nan=False)]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)


class ShapeSection(_Section):
    """An `area` (corners), a `line` with a `width`, or a `disc` (x, y, radius); metres."""

    name: str = ""
    area: Annotated[list[Point], Field(min_length=3)] | None = None
    holes: tuple[Annotated[list[Point], Field(min_length=3)], ...] = ()
    line: Annotated[list[Point], Field(min_length=2)] | None = None
    width: Above | None = None
    disc: Annotated[list[Metres], Field(min_length=3, max_length=3)] | None = None
    speed: Above | None = None
    """m/s allowed, of a speed zone."""
    heading_deg: Metres | None = None
    """Which way a one-way zone leads, counter-clockwise from the x axis."""
    open: Flag = False
    """Whether a gate is."""


class WaySection(_Section):
    """A chain of nodes that robots go along."""

    way: Annotated[list[str], Field(min_length=2)]
    both: Flag = True
    """Whether one may go back as well."""
    speed: Above | None = None
    width: Above | None = None


class RoutesSection(_Section):
    """The graph of ways for patrols and long legs."""

    nodes: dict[str, Point]
    ways: tuple[WaySection, ...] = ()


class DockSection(_Section):
    """Where a robot stops exactly."""

    name: Annotated[str, Field(min_length=1)]
    at: Point
    heading_deg: Metres = 0.0


class SiteSection(_Section):
    """A site as it is written down."""

    name: str = "site"
    anchor: AnchorSection | None = None
    roads: tuple[ShapeSection, ...] = ()
    buildings: tuple[ShapeSection, ...] = ()
    obstacles: tuple[ShapeSection, ...] = ()
    gates: tuple[ShapeSection, ...] = ()
    keep_out: tuple[ShapeSection, ...] = ()
    speed_zones: tuple[ShapeSection, ...] = ()
    one_way: tuple[ShapeSection, ...] = ()
    routes: RoutesSection | None = None
    docks: tuple[DockSection, ...] = ()


def read_site(path: Path) -> Site:
    """Read a drawing, YAML or GeoJSON by its ending.

    Raises ConfigError (YAML) or DataError (GeoJSON) with the line or the feature of the first fault, UsageError for
    another ending.
    """
    if path.suffix.lower() in JSON_ENDINGS:
        from outrider.io.site_geojson import read_geojson_site

        return read_geojson_site(path)
    if path.suffix.lower() not in YAML_ENDINGS:
        raise UsageError("is no drawing of a site", where=str(path), fix=".yaml in metres, or .geojson")
    return parse_site(read_yaml(path), str(path))


def parse_site(data: Mapping[str, object], where: str = "") -> Site:
    """A site from the keys of a YAML file; `where` is the file, in which faulty lines are looked up."""
    said = validated(SiteSection, data, where)
    shapes: list[Shape] = []
    for section, kind in SECTIONS.items():
        for k, one in enumerate(getattr(said, section)):
            try:
                shapes.append(_shape(kind, one))
            except DataError as e:
                raise fault_at((section, k), f"{e.where} {e.what}", where, e.fix) from None
    for k, d in enumerate(said.docks):
        if any(d.name == other.name for other in said.docks[:k]):
            raise fault_at(("docks", k), f"is a second dock '{d.name}'", where, "give each a name of its own")
    docks = tuple(Dock(name=d.name, pose=np.array([*d.at, radians(d.heading_deg)], float)) for d in said.docks)
    return Site(
        name=said.name,
        shapes=tuple(shapes),
        routes=_routes(said.routes, where) if said.routes is not None else None,
        docks=docks,
        anchor=said.anchor.anchor() if said.anchor else None,
    )


def schema() -> dict[str, Any]:
    """JSON schema of a drawing in metres, for editors."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **SiteSection.model_json_schema()}


def site_text(site: Site) -> str:
    """A site as YAML, which reads back as the same."""
    out: dict[str, Any] = {"name": site.name}
    if site.anchor is not None:
        out["anchor"] = anchor_dict(site.anchor)
    for section, kind in SECTIONS.items():
        if shapes := site.of(kind):
            out[section] = [_described(s) for s in shapes]
    if site.routes is not None:
        out["routes"] = _described_routes(site.routes)
    if site.docks:
        told = [(d.name, d.pose.tolist()) for d in site.docks]
        out["docks"] = [{"name": n, "at": p[:2], "heading_deg": written_deg(p[2])} for n, p in told]
    return yaml_text(out)


def graph_of(names: Sequence[str], nodes: Sequence[Sequence[float]], ways: Sequence[Mapping[str, Any]]) -> RouteGraph:
    """A graph from chains of node numbers: `way`, `both`, `speed`, `width`; said twice, the lower limit holds."""
    edges: dict[tuple[int, int], tuple[float, float]] = {}
    for w in ways:
        limits = (w["speed"] or inf, w["width"] or inf)
        for a, b in zip(w["way"][:-1], w["way"][1:], strict=True):
            for edge in [(a, b), (b, a)] if w["both"] else [(a, b)]:
                held = edges.get(edge, (inf, inf))
                edges[edge] = (min(held[0], limits[0]), min(held[1], limits[1]))
    told = np.array(list(edges.values()), np.float64).reshape(-1, 2)
    return RouteGraph(
        names=tuple(names),
        nodes=np.array(nodes, np.float64).reshape(-1, 2),
        edges=np.array(list(edges), np.int64).reshape(-1, 2),
        speed=told[:, 0].copy(),
        width=told[:, 1].copy(),
    )


def _shape(kind: ShapeKind, said: ShapeSection) -> Shape:
    ways = [w for w in ("area", "line", "disc") if getattr(said, w) is not None]
    unnamed = f"{kind.value.replace('_', '-')}{f' {said.name!r}' if said.name else ''}"
    if len(ways) != 1:
        what = f"is drawn as {' and '.join(ways)}" if ways else "says nowhere what it covers"
        raise DataError(what, where=unnamed, fix="one of: area, line with a width, disc")
    if kind is ShapeKind.ONE_WAY and said.heading_deg is None:
        raise DataError("does not say which way", where=unnamed, fix="heading_deg: counter-clockwise from the x axis")
    if said.line is not None and said.width is None:
        raise DataError("is a line without a width", where=unnamed, fix="width: metres")
    points = said.area or said.line or [(said.disc or [0.0, 0.0])[:2]]
    width = said.width or 0.0 if said.disc is None else 2.0 * said.disc[2]
    return Shape(
        kind=kind,
        points=np.array(points, np.float64),
        area=said.area is not None,
        width=width if said.area is None else 0.0,
        holes=tuple(np.array(h, np.float64) for h in said.holes),
        name=said.name,
        speed=inf if said.speed is None else said.speed,
        heading=radians(said.heading_deg or 0.0),
        open=said.open,
    )


def _routes(said: RoutesSection, where: str) -> RouteGraph:
    rows = {name: k for k, name in enumerate(said.nodes)}
    ways: list[dict[str, Any]] = []
    for k, w in enumerate(said.ways):
        if lost := [n for n in w.way if n not in rows]:
            raise fault_at(("routes", "ways", k), f"there is no node '{lost[0]}'", where, "name it under nodes")
        if len({*zip(w.way, w.way[1:], strict=False)} & {(n, n) for n in w.way}):
            raise fault_at(("routes", "ways", k), "leads from a node to itself", where)
        ways.append({**w.model_dump(), "way": [rows[n] for n in w.way]})
    try:
        return graph_of(list(rows), list(said.nodes.values()), ways)
    except OutriderError as e:
        raise ConfigError(e.what, where=where, fix=e.fix) from None


def _described(s: Shape) -> dict[str, Any]:
    out: dict[str, Any] = {"name": s.name} if s.name else {}
    if s.area:
        out["area"] = s.points.tolist()
        out |= {"holes": [h.tolist() for h in s.holes]} if s.holes else {}
    elif len(s.points) == 1:
        out["disc"] = [*s.points[0].tolist(), 0.5 * s.width]
    else:
        out |= {"line": s.points.tolist(), "width": s.width}
    out |= {"speed": s.speed} if isfinite(s.speed) else {}
    out |= {"heading_deg": written_deg(s.heading)} if s.kind is ShapeKind.ONE_WAY else {}
    return out | ({"open": True} if s.open else {})


def _described_routes(graph: RouteGraph) -> dict[str, Any]:
    nodes = {name: p.tolist() for name, p in zip(graph.names, graph.nodes, strict=True)}
    ways: list[dict[str, Any]] = []
    for (a, b), speed, width in zip(graph.edges.tolist(), graph.speed.tolist(), graph.width.tolist(), strict=True):
        limits = {k: v for k, v in (("speed", speed), ("width", width)) if isfinite(v)}
        ways.append({"way": [graph.names[a], graph.names[b]], "both": False, **limits})
    return {"nodes": nodes, "ways": ways}
