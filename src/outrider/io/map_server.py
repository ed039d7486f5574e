"""Maps as the map servers of ROS 1 and Nav2 keep them: an image, and a YAML file that says what its greys mean.

The two servers differ at the boundaries, so each reads by its own rules (`Dialect`). Beside the usual keys the YAML may
hold `outrider: {anchor: ...}`, which the servers pass over: where on the Earth the map lies.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from math import degrees, radians
from pathlib import Path
from typing import Annotated, Any, Final, Literal, final

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from outrider.data.grid import UNKNOWN, Grid
from outrider.data.site import Anchor
from outrider.data.trajectory import Datum
from outrider.errors import DataError
from outrider.io.checked import Flag, Number, Whole, fault_at, validated
from outrider.io.config import read_yaml, yaml_text
from outrider.io.files import replacing
from outrider.io.images import brightness, has_alpha, read_image, write_pgm, write_png
from outrider.mapping.turned import levelled
from outrider.typing import Floats

FREE_GREY, TAKEN_GREY, UNKNOWN_GREY = 254, 0, 205  # as both servers save them
THRESHOLDS: Final = (0.65, 0.196)  # occupied and free, with which these greys read back as they were
Mode = Literal["trinary", "scale", "raw"]


class Dialect(Enum):
    """Whose rules a map is read by."""

    NAV2 = "occupied from the threshold on, free up to it; any transparency is unknown"
    ROS1 = "occupied above the threshold, free below it; transparency is averaged in (trinary)"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Map:
    """A map that was read.

    grid : its cells; where `heading` is not 0, in a frame of its own that has the site's origin: see `level`;
    heading : rad, of the grid's columns, counter-clockwise from the site's x axis, about the grid's corner;
    anchor : where it lies on the Earth, if the file tells;  notes : what is worth a warning.
    """

    grid: Grid
    heading: float = 0.0
    mode: Mode = "trinary"
    anchor: Anchor | None = None
    notes: tuple[str, ...] = ()

    @property
    def level(self) -> Grid:
        """The cells in the site's frame: the grid itself, or, where it is turned, what `levelled` makes of it."""
        return levelled(self.grid, self.heading) if self.heading else self.grid


class AnchorSection(BaseModel):
    """Where the origin of a site's frame is."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    lat_deg: Annotated[Number, Field(ge=-90, le=90, allow_inf_nan=False)]
    lon_deg: Annotated[Number, Field(ge=-180, le=360, allow_inf_nan=False)]
    alt_m: Annotated[Number, Field(allow_inf_nan=False)] = 0.0
    heading_deg: Annotated[Number, Field(allow_inf_nan=False)] = 0.0
    """Of the x axis, counter-clockwise from east."""

    def anchor(self) -> Anchor:
        """As the noun."""
        datum = Datum(lat=radians(self.lat_deg), lon=radians(self.lon_deg), alt=self.alt_m)
        return Anchor(datum=datum, heading=radians(self.heading_deg))


class OwnSection(BaseModel):
    """What only we read."""

    anchor: AnchorSection | None = None


class MapSection(BaseModel):
    """The YAML of a map; keys that we do not know are for somebody else."""

    image: Annotated[str, Field(min_length=1)]
    resolution: Annotated[Number, Field(gt=0, allow_inf_nan=False)]
    origin: Annotated[list[Annotated[Number, Field(allow_inf_nan=False)]], Field(min_length=3, max_length=3)]
    negate: Flag | Whole = 0
    occupied_thresh: Annotated[Number, Field(ge=0, le=1)] = THRESHOLDS[0]
    free_thresh: Annotated[Number, Field(ge=0, le=1)] = THRESHOLDS[1]
    mode: Mode = "trinary"
    outrider: OwnSection = OwnSection()


def read_map(path: Path, dialect: Dialect = Dialect.NAV2, *, keep_unknown: bool = False) -> Map:
    """Read a map by its YAML file.

    Savers write the unknown as grey 205, which is 0.196 occupied: with a `free_thresh` above that it comes back as free
    ground. That is read as written, with a note, unless `keep_unknown`.

    Raises ConfigError for a YAML file without a sense, DataError for an image that cannot be read.
    """
    said = validated(MapSection, read_yaml(path), str(path))
    if not said.free_thresh < said.occupied_thresh:
        what = f"is not below occupied_thresh {said.occupied_thresh:g}, is {said.free_thresh:g}"
        raise fault_at(("free_thresh",), what, str(path), "usual: occupied_thresh 0.65, free_thresh 0.196")
    pixels = read_image(path.parent / said.image)
    cells = interpret(pixels, said.mode, said.occupied_thresh, said.free_thresh, bool(said.negate), dialect)
    notes: list[str] = []
    trapped = np.zeros(cells.shape, np.bool_)
    if said.mode == "trinary" and not said.negate and cells.size:
        trapped = (brightness(pixels) == UNKNOWN_GREY) & (cells == 0)
    if trapped.any():
        share = 100.0 * float(trapped.mean())
        what = f"grey 205, which savers write for the unknown, reads as free ({share:.0f} % of the map)"
        notes.append(f"{what}: free_thresh is {said.free_thresh:g}; with 0.196 it stays unknown")
        if keep_unknown:
            cells[trapped] = UNKNOWN
            notes = [f"{what} by free_thresh {said.free_thresh:g}; kept unknown"]
    x, y, heading = (float(v) for v in said.origin)
    grid = Grid(cells=cells[::-1].copy(), resolution=float(said.resolution), origin=np.array([x, y]))
    place = said.outrider.anchor
    return Map(grid=grid, heading=heading, mode=said.mode, anchor=place.anchor() if place else None, notes=tuple(notes))


def interpret(
    pixels: NDArray[np.uint8], mode: Mode, occupied: float, free: float, negate: bool, dialect: Dialect
) -> NDArray[np.uint8]:
    """(rows, cols) cells 0..100 and 255 of an image (rows, cols, channels), both top row first.

    p = (255 - g) / 255 is how occupied a grey g is; see `Dialect` for the boundaries.
    """
    nav2, clear = dialect is Dialect.NAV2, np.zeros(pixels.shape[:2], np.bool_)
    grey = brightness(pixels, with_alpha=mode == "trinary" and not nav2)
    if mode == "raw":
        if negate and not nav2:
            grey = 255.0 - grey
        raw = np.round(grey) if nav2 else np.trunc(grey)
        return np.where((raw <= 100) | (not nav2), raw, UNKNOWN).astype(np.uint8)
    p = (grey if negate else 255.0 - grey) / 255.0
    taken, empty = (p >= occupied, p <= free) if nav2 else (p > occupied, p < free)
    ratio = (p - free) / (occupied - free)
    if mode == "trinary":
        between = np.full(p.shape, float(UNKNOWN))
    else:
        between = np.rint(100.0 * ratio) if nav2 else np.trunc(1.0 + 98.0 * ratio)
    if has_alpha(pixels):
        clear = pixels[:, :, -1] < 255 if nav2 else (pixels[:, :, -1] == 0) & (mode == "scale")
    if not nav2:
        between = np.where(clear, UNKNOWN, between)
    cells = np.where(taken, 100.0, np.where(empty, 0.0, between))
    return np.where(clear & nav2, UNKNOWN, cells).astype(np.uint8)


def write_map(
    grid: Grid,
    path: Path,
    *,
    mode: Mode = "trinary",
    heading: float = 0.0,
    anchor: Anchor | None = None,
    dialect: Dialect = Dialect.NAV2,
    force: bool = False,
) -> None:
    """Write a map: `path` is its YAML file, the image stands beside it (PGM; PNG for `scale`: unknown is transparent).

    It reads back as the same cells by `dialect` (trinary and raw by both). Raises DataError for cells that the mode
    cannot hold: trinary has 0, 100 and unknown only.
    """
    occupied, free = THRESHOLDS
    levels = _levels(mode, dialect)
    if missing := set(np.unique(grid.cells).tolist()) - set(levels):
        value = min(missing)
        raise DataError(f"a cell of {value} cannot be written in mode {mode}", where=str(path), fix="mode raw")
    table = np.zeros((256, 2), np.uint8)
    for value, pixel in levels.items():
        table[value] = pixel
    pixels = table[grid.cells[::-1]]
    image = path.with_suffix(".png" if mode == "scale" else ".pgm")
    x, y = grid.origin.tolist()
    document: dict[str, Any] = {
        "image": image.name,
        "mode": mode,
        "resolution": grid.resolution,
        "origin": [x, y, heading],
        "negate": 0,
        "occupied_thresh": occupied,
        "free_thresh": free,
    }
    if anchor is not None:
        document["outrider"] = {"anchor": anchor_dict(anchor)}
    with replacing(image, force=force) as part:
        if mode == "scale":
            write_png(part, pixels)
        else:
            write_pgm(part, pixels[:, :, 0])
    with replacing(path, force=force) as part:
        part.write_text(yaml_text(document), encoding="utf-8")


def _levels(mode: Mode, dialect: Dialect) -> Mapping[int, tuple[int, int]]:
    """Grey and opacity for every value that a mode can hold: those that `interpret` reads back as it."""
    occupied, free = THRESHOLDS
    if mode == "trinary":
        return {0: (FREE_GREY, 255), 100: (TAKEN_GREY, 255), UNKNOWN: (UNKNOWN_GREY, 255)}
    greys = np.arange(256, dtype=np.uint8)
    read = interpret(greys[None, :, None], mode, occupied, free, False, dialect)[0]
    found = {int(value): (int(grey), 255) for grey, value in enumerate(read)}
    if mode == "scale":
        found |= {0: (FREE_GREY, 255), 100: (TAKEN_GREY, 255), UNKNOWN: (UNKNOWN_GREY, 0)}
    else:
        found[UNKNOWN] = (UNKNOWN, 255)
    return found


def anchor_dict(anchor: Anchor) -> dict[str, float]:
    """An anchor with the keys of a file."""
    d = anchor.datum
    return {
        "lat_deg": written_deg(d.lat),
        "lon_deg": written_deg(d.lon),
        "alt_m": d.alt,
        "heading_deg": written_deg(anchor.heading),
    }


def written_deg(angle: float) -> float:
    """An angle [rad] in degrees as somebody would have written it: 12 decimals, so 52.5 stays 52.5."""
    return round(degrees(angle), 12)


def corners(m: Map) -> Floats:
    """(4, 2) m, site frame: the outer corners of a map, counter-clockwise from its origin."""
    rows, cols = m.grid.cells.shape
    c, s = np.cos(m.heading), np.sin(m.heading)
    box = np.array([[0.0, 0.0], [cols, 0.0], [cols, rows], [0.0, rows]]) * m.grid.resolution
    return m.grid.origin + box @ np.array([[c, s], [-s, c]])
