"""A drawn site as cells: roads are free, buildings and obstacles are taken, the rest is unknown.

amr2025, "Navigation map generation", figs. 7 and 8: only the topology of the roads and the sizes that matter are kept.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, final

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from outrider.data.grid import LETHAL, UNKNOWN, Grid
from outrider.data.site import Shape, ShapeKind, Site
from outrider.errors import ConfigError, DataError
from outrider.mapping.raster import covered
from outrider.mapping.zones import Zones
from outrider.typing import Bools, Floats

LARGEST: Final = 1 << 27  # cells: what is written can be read
FINEST: Final = 1e-6  # m
_HAIR: Final = 1e-6  # m: what is drawn along the boundary of cells covers those on its own side only


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Drawn:
    """What became of a site. `lengths` of roads, `areas` in m2, for the report."""

    grid: Grid
    zones: Zones
    road_area: float
    taken_area: float
    outline_length: float


def draw(site: Site, resolution: float, *, margin: float = 2.0, open_ground: bool = False) -> Drawn:
    """Rasterise a site at `resolution` [m], with `margin` [m] around everything.

    A cell is free if roads cover it whole, taken if a building, an obstacle or a closed gate reaches into it, and
    unknown otherwise (or free as well, with `open_ground`); what is taken stands over roads. A keep-out zone bars every
    cell that it reaches into. Corners of the map are at whole multiples of the resolution.

    Raises ConfigError for a resolution that makes no map, or too large a one.
    """
    if not FINEST <= resolution < np.inf or not 0.0 <= margin < np.inf:
        what = f"resolution {resolution:g} m, margin {margin:g} m"
        raise ConfigError(what, where=site.name, fix=f"a resolution of {FINEST:g} m or more, a margin of zero or more")
    low, high = site.extent
    first, last = np.floor((low - margin) / resolution + 1e-9), np.ceil((high + margin) / resolution - 1e-9)
    cols, rows = np.maximum(last - first, 1.0).tolist()
    if resolution > float((high - low).min(initial=np.inf)) > 0.0:
        wide, tall = (high - low).tolist()
        what = f"cells of {resolution:g} m are larger than the site, {wide:.0f} x {tall:.0f} m"
        raise ConfigError(what, where=site.name, fix="a resolution well below the width of the roads, such as 0.05 m")
    if rows * cols > LARGEST:
        wide, tall = (last - first) * resolution
        what = f"{wide:.0f} x {tall:.0f} m are {rows * cols / 1e6:,.0f} million cells of {resolution:g} m"
        fix = f"a resolution of {resolution * np.sqrt(rows * cols / LARGEST):.2g} m or more; is a shape far away?"
        raise ConfigError(what, where=site.name, fix=fix)
    origin, shape = first * resolution, (int(rows), int(cols))

    def cells(geometry: BaseGeometry, *, whole: bool) -> Bools:
        return _cells(geometry, origin, resolution, shape, whole=whole)

    roads = _union(site.of(ShapeKind.ROAD))
    closed = [g for g in site.of(ShapeKind.GATE) if not g.open]
    taken = _union([*site.of(ShapeKind.BUILDING, ShapeKind.OBSTACLE), *closed])
    values = np.full(shape, 0 if open_ground else UNKNOWN, np.uint8)
    values[cells(roads, whole=True)] = 0
    values[cells(taken, whole=False)] = 100
    grid = Grid(cells=values, resolution=resolution, origin=origin)
    barred = cells(_union(site.of(ShapeKind.KEEP_OUT)), whole=False)
    zones = Zones(
        on=grid,
        keep_out=np.where(barred, LETHAL, 0).astype(np.uint8),
        speed=_areas(site.of(ShapeKind.SPEED)),
        one_way=_areas(site.of(ShapeKind.ONE_WAY)),
    )
    return Drawn(
        grid=grid,
        zones=zones,
        road_area=float(roads.difference(taken).area),
        taken_area=float(taken.area),
        outline_length=float(taken.length),
    )


def geometry_of(shape: Shape) -> BaseGeometry:
    """What a shape covers. Lines end flat, and turn round; a disc is drawn from 64 corners around it."""
    if shape.area:
        covered_ground = shapely.Polygon(shape.points, [*shape.holes])
        if not covered_ground.is_valid:
            why = shapely.is_valid_reason(covered_ground).replace("[", " at (").replace("]", ") m")
            raise DataError(f"is no area: {why}", where=shape.title, fix="holes lie inside, apart from one another")
        return covered_ground
    if len(shape.points) == 1:
        around = shape.width / 2 / np.cos(np.pi / 64)  # no part of the disc is left out
        return shapely.Point(shape.points[0]).buffer(around, quad_segs=16)
    return shapely.LineString(shape.points).buffer(0.5 * shape.width, cap_style="flat", quad_segs=16)


def _union(shapes: Sequence[Shape]) -> BaseGeometry:
    return shapely.union_all([geometry_of(s) for s in shapes])


def _areas(shapes: Sequence[Shape]) -> tuple[Shape, ...]:
    """Lines with a width as areas."""
    out: list[Shape] = []
    for s in shapes:
        for part in _polygons(geometry_of(s)):
            rings = [np.array(r.coords)[:-1, :2] for r in (part.exterior, *part.interiors)]
            out.append(replace(s, points=rings[0], holes=tuple(rings[1:]), area=True))
    return tuple(out)


def _polygons(geometry: BaseGeometry) -> list[Any]:
    return [g for g in shapely.get_parts(geometry).tolist() if g.geom_type == "Polygon" and not g.is_empty]


def _cells(geometry: BaseGeometry, origin: Floats, resolution: float, shape: tuple[int, int], *, whole: bool) -> Bools:
    grown = geometry.buffer(_HAIR if whole else -_HAIR, join_style="mitre")
    rings = [np.asarray(r.coords)[:-1, :2] for p in _polygons(grown) for r in (p.exterior, *p.interiors)]
    if not rings:
        return np.zeros(shape, np.bool_)
    starts = np.cumsum([0, *(len(r) for r in rings)])
    points = np.ascontiguousarray((np.concatenate(rings) - origin) / resolution, np.float64)
    return covered(points, starts.astype(np.int64), shape, whole=whole)
