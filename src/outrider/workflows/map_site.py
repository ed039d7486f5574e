"""A drawing, a map or an image becomes a map for robots: cells, routes, zones, a picture, a report, in one folder."""

import platform
import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib.metadata import version
from math import degrees
from pathlib import Path
from typing import Any, Final, final

import numpy as np

from outrider import __version__
from outrider.data.grid import INSCRIBED, LETHAL, UNKNOWN, Costmap, Grid
from outrider.data.routes import RouteGraph
from outrider.data.site import Anchor, ShapeKind, Site
from outrider.errors import ExitCode, OutriderError, UsageError
from outrider.io import folders
from outrider.io.config import read_yaml
from outrider.io.files import as_text, sha256
from outrider.io.map_server import Map, anchor_dict, read_map, write_map
from outrider.io.route_graphs import write_route_graph
from outrider.io.sites import YAML_ENDINGS, read_site, site_text
from outrider.mapping.georeference import Georeference
from outrider.mapping.inflation import WIDEST, Inflation
from outrider.mapping.layers import LayeredCostmap
from outrider.mapping.raster import crossed
from outrider.mapping.sites import Drawn, draw

SCHEMA: Final = "outrider.map/1"
SUMMARY, REPORT, PICTURE, MAP, ROUTES = "summary.json", "report.html", "costmap.png", "map.yaml", "routes.geojson"
KEEP_OUT, SITE = "keep_out.yaml", "site.yaml"
IMAGES: Final = (".pgm", ".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")
RESOLUTION: Final = 0.05  # m
SLOPE: Final = 3.0  # 1/m: a gentle potential over the width of a road steers better than a thin skin
REACH: Final = 1.2  # m beyond the robot's radius, in which cost falls to 7 of 252
VOXEL, WALL, POINT = 0.05, 3.0, 16  # m, m, bytes: the dense lidar map that a drawing is compared with

Progress = Callable[[str, float], None]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Mapped:
    """What was made. `site`, `drawn` : of a drawing;  `fit` : of an image;  `heading` : of the grid, rad;
    `blocked` : routes and docks that the robot cannot use, and why."""

    source: Path
    grid: Grid
    costmap: Costmap
    heading: float = 0.0
    site: Site | None = None
    drawn: Drawn | None = None
    fit: Georeference | None = None
    anchor: Anchor | None = None
    notes: tuple[str, ...] = ()
    blocked: tuple[str, ...] = ()

    @property
    def exit_code(self) -> ExitCode:
        """Whether everything that was drawn to be driven on can be."""
        return ExitCode.FAILED_CHECK if self.blocked else ExitCode.OK


def ensure_free(folder: Path, *, force: bool = False) -> None:
    """Refuse a folder that holds anything but an earlier map, and that only without `force`."""
    folders.ensure_free(folder, SUMMARY, SCHEMA, force=force)


def map_site(
    source: Path,
    output: Path,
    *,
    control_points: Path | None = None,
    resolution: float | None = None,
    radius: float = 0.3,
    force: bool = False,
    report: bool = True,
    command: str = "",
    progress: Progress | None = None,
) -> tuple[Mapped, dict[str, Any]]:
    """Make a map of `source` in the folder `output`, complete or not at all; gives it, and its summary.

    source : a drawing (YAML in metres, GeoJSON), the YAML of a map, or an image with `control_points`;
    resolution : m, of a drawing (default 0.05);  radius : of the robot [m], for costs and for what it fits through.
    """
    tell = progress or _silent
    tell("drawing", 0.0)
    done = _read(source, control_points, resolution, radius)
    with folders.result_folder(output, SUMMARY, SCHEMA, force=force) as part:
        tell("writing", 0.0)
        _write(done, part)
        document = summarise(done, part, radius)
        tell("picture", 0.0)
        from outrider.plot.site import site_figure, write_map_report  # imports matplotlib
        from outrider.plot.style import save_png

        save_png(site_figure(done.costmap, done.site, heading=done.heading), part / PICTURE)
        if report:
            text = site_text(done.site) if done.site is not None else ""
            figure = site_figure(done.costmap, done.site, heading=done.heading)
            write_map_report(figure, document, part / REPORT, drawing=text, command=command)
        folders.write_marker(part, SUMMARY, document)
    return done, document


def _read(source: Path, control_points: Path | None, resolution: float | None, radius: float) -> Mapped:
    is_image = source.suffix.lower() in IMAGES
    if is_image and control_points is None:
        fix = "--control-points FILE says where some of its pixels are; or name the YAML file of the map"
        raise UsageError("an image alone does not say where it is", where=as_text(source), fix=fix)
    if control_points is not None and not is_image:
        raise UsageError("control points lay an image on the ground", where="--control-points", fix="name an image")
    is_map = source.suffix.lower() in YAML_ENDINGS and "image" in read_yaml(source)
    if (is_image or is_map) and resolution is not None:
        raise UsageError("an image has its own resolution", where="--resolution", fix="leave it out")
    if control_points is not None:
        from outrider.io.control_points import read_referenced

        there, fit = read_referenced(source, control_points)
        return replace(_of_map(source, there, radius), fit=fit)
    if is_map:
        return _of_map(source, read_map(source), radius)
    site = read_site(source)
    try:
        drawn = draw(site, RESOLUTION if resolution is None else resolution)
    except OutriderError as e:
        raise type(e)(e.what, where=as_text(source), fix=e.fix) from None
    layers = LayeredCostmap(drawn.grid, inflation=_inflation(drawn.grid, radius), keep_out=drawn.zones.keep_out)
    done = Mapped(
        source=source, grid=drawn.grid, costmap=layers.costmap, site=site, drawn=drawn, anchor=site.anchor,
        notes=site.notes,
    )  # fmt: skip
    return replace(done, blocked=tuple(_blocked(done)))


def _inflation(grid: Grid, radius: float) -> Inflation:
    """Costs that reach as far as they should, or as far as cells so small allow."""
    widest = max(radius, min(radius + REACH, WIDEST * grid.resolution))
    return Inflation(inscribed=radius, radius=widest, factor=SLOPE)


def _of_map(source: Path, there: Map, radius: float) -> Mapped:
    layers = LayeredCostmap(there.grid, inflation=_inflation(there.grid, radius))
    return Mapped(
        source=source, grid=there.grid, costmap=layers.costmap, heading=there.heading, anchor=there.anchor,
        notes=there.notes,
    )  # fmt: skip


def _blocked(done: Mapped) -> list[str]:
    """Routes and docks on which a robot of that radius would touch something, or would leave what was drawn."""
    assert done.site is not None
    cells, out = done.costmap.cells, list[str]()
    words = {LETHAL: "taken or a keep-out zone", INSCRIBED: "too near to something", UNKNOWN: "not on a road"}
    graph = done.site.routes
    for a, b in [] if graph is None else sorted({(min(e), max(e)) for e in graph.edges.tolist()}):
        assert graph is not None
        rows, cols = crossed(graph.nodes[a], graph.nodes[b], done.grid)
        bad = np.flatnonzero(cells[rows, cols] >= INSCRIBED)
        if bad.size:
            k = int(bad[0])
            x, y = done.grid.centre_of(np.array([rows[k], cols[k]])).tolist()
            why = words[int(cells[rows[k], cols[k]])]
            out.append(f"the way {graph.names[a]} - {graph.names[b]} is blocked at ({x:.2f}, {y:.2f}) m: {why}")
    for dock in done.site.docks:
        cost = int(cells[tuple(done.costmap.cell_of(dock.pose[:2]))])
        if cost in (LETHAL, UNKNOWN):
            x, y = dock.pose[:2].tolist()
            out.append(f"the dock {dock.name} at ({x:.2f}, {y:.2f}) m is {words[cost]}")
    return out


def _write(done: Mapped, part: Path) -> None:
    trinary = bool(np.isin(done.grid.cells, (0, 100, UNKNOWN)).all())
    write_map(done.grid, part / MAP, mode="trinary" if trinary else "raw", heading=done.heading, anchor=done.anchor)
    if done.site is None or done.drawn is None:
        return
    (part / SITE).write_text(site_text(done.site), encoding="utf-8")
    if done.site.routes is not None:
        write_route_graph(done.site.routes, part / ROUTES)
    if done.site.of(ShapeKind.KEEP_OUT):
        mask = np.where(done.drawn.zones.keep_out != 0, 100, 0).astype(np.uint8)
        write_map(replace(done.grid, cells=mask), part / KEEP_OUT, anchor=done.anchor)


def summarise(done: Mapped, part: Path, radius: float) -> dict[str, Any]:
    """What scripts read; schema `outrider.map/1`."""
    rows, cols = done.grid.cells.shape
    counts = {
        name: int(np.sum(done.grid.cells == v)) for name, v in (("free", 0), ("taken", 100), ("unknown", UNKNOWN))
    }
    site, d = done.site, done.anchor.datum if done.anchor else None
    shapes = {k.value: len(site.of(k)) for k in ShapeKind if site.of(k)} if site is not None else {}
    graph = site.routes if site is not None else None
    return {
        "schema": SCHEMA,
        "name": site.name if site is not None else done.source.stem,
        "source": {"path": as_text(done.source), "sha256": sha256(done.source), "bytes": done.source.stat().st_size},
        "map": {
            "resolution_m": done.grid.resolution, "columns": cols, "rows": rows,
            "origin_m": done.grid.origin.tolist(), "heading_deg": degrees(done.heading), "cells": counts,
        },
        "anchor": anchor_dict(done.anchor) if done.anchor is not None and d is not None else None,
        "shapes": shapes,
        "routes": _about_routes(graph) if graph is not None else None,
        "docks": [x.name for x in site.docks] if site is not None else [],
        "robot_radius_m": radius,
        "fit": _about_fit(done.fit) if done.fit is not None else None,
        "volume": _volume(done, part),
        "notes": list(done.notes),
        "blocked": list(done.blocked),
        "versions": {"outrider": __version__, "numpy": version("numpy"), "python": platform.python_version()},
    }  # fmt: skip


def _about_routes(graph: RouteGraph) -> dict[str, Any]:
    ways = {(min(e), max(e)): float(x) for e, x in zip(graph.edges.tolist(), graph.lengths, strict=True)}
    return {"nodes": len(graph.names), "edges": len(graph.edges), "length_m": sum(ways.values())}


def _about_fit(fit: Georeference) -> dict[str, Any]:
    return {
        "resolution_m": fit.resolution,
        "heading_deg": degrees(fit.heading),
        "rmse_m": fit.rmse,
        "residuals_m": fit.residuals.tolist(),
        "suspects": [k + 1 for k in fit.suspects],
    }


def _volume(done: Mapped, part: Path) -> dict[str, Any]:
    """Bytes of the drawing and of what was made of it, beside a dense lidar map of the same site.

    That is a reckoning: a point of 16 bytes (x, y, z, intensity) in every 5 cm square of drivable ground and of walls
    3 m high. The area of a map that was not drawn is that of its free cells, its walls are the sides of taken ones.
    """
    area = float(np.sum(done.grid.cells == 0)) * done.grid.resolution**2
    taken = done.grid.cells == 100
    sides = int(np.sum(taken[1:] != taken[:-1]) + np.sum(taken[:, 1:] != taken[:, :-1]))
    outline = (
        0.79 * sides * done.grid.resolution
    )  # the sides of cells are longer than what they follow, pi / 4 on average
    if done.drawn is not None:
        area, outline = done.drawn.road_area, done.drawn.outline_length
    points = (area + outline * WALL) / VOXEL**2
    drawing = len(site_text(done.site).encode()) if done.site is not None else None
    packed = len(zlib.compress(np.ascontiguousarray(done.grid.cells).tobytes(), 6))
    dense = points * POINT
    return {
        "drawing_bytes": drawing,
        "map_bytes": (part / MAP).with_suffix(".pgm").stat().st_size,
        "map_packed_bytes": packed,
        "dense_points": round(points),
        "dense_bytes": round(dense),
        "dense_to_drawing": dense / drawing if drawing else None,
        "dense_to_map": dense / packed,
        "ground_m2": area,
        "outline_m": outline,
    }


def _silent(what: str, share: float) -> None:
    pass
