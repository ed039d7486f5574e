"""Points of an image whose places on the ground are known, and the map that the image becomes by them."""

from math import radians
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from outrider.core.geodesy import geodetic_to_enu
from outrider.data.grid import Grid
from outrider.data.site import Anchor
from outrider.data.trajectory import Datum
from outrider.errors import ConfigError, DataError
from outrider.io.checked import Flag, Number, fault_at, validated
from outrider.io.config import read_yaml
from outrider.io.images import read_image
from outrider.io.map_server import THRESHOLDS, AnchorSection, Dialect, Map, Mode, interpret
from outrider.mapping.georeference import Georeference, fit
from outrider.typing import Floats

Metres = Annotated[Number, Field(allow_inf_nan=False, ge=-1e9, le=1e9)]


class ControlPoint(BaseModel):
    """A point: `pixel`, column and row from the upper left corner; and where it is, in degrees or in metres."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    pixel: Annotated[list[Metres], Field(min_length=2, max_length=2)]
    lat_deg: Annotated[Number, Field(ge=-90, le=90)] | None = None
    lon_deg: Annotated[Number, Field(ge=-180, le=360)] | None = None
    metres: Annotated[list[Metres], Field(min_length=2, max_length=2)] | None = None


class ControlPoints(BaseModel):
    """The file: points, and how the image's greys are read."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    points: Annotated[list[ControlPoint], Field(min_length=2)]
    anchor: AnchorSection | None = None
    negate: Flag = False
    occupied_thresh: Annotated[Number, Field(ge=0, le=1)] = THRESHOLDS[0]
    free_thresh: Annotated[Number, Field(ge=0, le=1)] = THRESHOLDS[1]
    mode: Mode = "trinary"


def read_referenced(image: Path, points: Path) -> tuple[Map, Georeference]:
    """An image as a map, laid on the ground by a file of control points.

    Points in degrees are taken about `anchor`, or about the first of them; points in metres need none. Raises
    ConfigError or DataError with the point that is at fault.
    """
    said = validated(ControlPoints, read_yaml(points), str(points))
    if not said.free_thresh < said.occupied_thresh:
        raise fault_at(("free_thresh",), "is not below occupied_thresh", str(points))
    anchor, places = _places(said, points)
    pixels = read_image(image)
    rows, cols = pixels.shape[:2]
    told = np.array([p.pixel for p in said.points], np.float64)
    outside = np.flatnonzero((told < 0).any(axis=1) | (told > [cols, rows]).any(axis=1))
    if outside.size:
        k = int(outside[0])
        what = f"pixel {said.points[k].pixel} is outside the image of {cols} x {rows}"
        raise fault_at(("points", k), what, str(points), "column first, then row, from the upper left corner")
    try:
        found = fit(told, places, rows)
    except DataError as e:
        raise ConfigError(e.what, where=str(points), fix=e.fix) from None
    cells = interpret(pixels, said.mode, said.occupied_thresh, said.free_thresh, said.negate, Dialect.NAV2)
    grid = Grid(cells=cells[::-1].copy(), resolution=found.resolution, origin=found.origin)
    worst = [f"control point {k + 1} is {found.residuals[k]:.2f} m off: mistyped?" for k in found.suspects]
    there = Map(grid=grid, heading=found.heading, mode=said.mode, anchor=anchor, notes=tuple(worst))
    return there, found


def _places(said: ControlPoints, points: Path) -> tuple[Anchor | None, Floats]:
    anchor = said.anchor.anchor() if said.anchor else None
    out: list[list[float]] = []
    for k, p in enumerate(said.points):
        if (p.metres is None) == (p.lat_deg is None) or (p.lat_deg is None) != (p.lon_deg is None):
            fix = "lat_deg and lon_deg, or metres: [x, y]"
            raise fault_at(("points", k), "does not say where it is, or says it twice", str(points), fix)
        if p.metres is not None:
            out.append(list(p.metres))
            continue
        lat, lon = radians(p.lat_deg or 0.0), radians(p.lon_deg or 0.0)
        anchor = anchor or Anchor(datum=Datum(lat=lat, lon=lon, alt=0.0))
        d = anchor.datum
        east, north, _ = geodetic_to_enu(lat, lon, d.alt, d.lat, d.lon, d.alt).tolist()
        c, s = np.cos(anchor.heading), np.sin(anchor.heading)
        out.append([c * east + s * north, c * north - s * east])
    return anchor, np.array(out, np.float64)
