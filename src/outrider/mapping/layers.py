"""A costmap in layers: what was drawn, what the lidar sees, the other robots, the zones, and cost around all of it."""

from collections.abc import Iterable, Sequence
from enum import Enum
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from outrider._kernel import kernel
from outrider.data.footprint import Footprint
from outrider.data.grid import FREE, LETHAL, OCCUPIED, UNKNOWN, Costmap, Grid
from outrider.data.scan import Scan
from outrider.errors import ConfigError, DataError
from outrider.mapping.inflation import Inflater, Inflation
from outrider.mapping.obstacles import NEVER, TWICE, Box, Marking, look_up, observe
from outrider.mapping.outlines import stamp
from outrider.typing import Floats

Cells = NDArray[np.uint8]
Other = tuple[Footprint, Floats]
"""Another robot: its footprint, and its pose (3,), east, north [m] and heading [rad]."""

_LARGEST: Final = 1 << 28  # cells of a costmap


class Unknown(Enum):
    """What a cell is that the map does not know."""

    KEEP = "unknown, for the planner to decide"
    FREE = "free: drive there, with an eye on the lidar"
    TAKEN = "taken: drive only on what was drawn or seen"


_COST_OF_UNKNOWN: Final = {Unknown.KEEP: UNKNOWN, Unknown.FREE: FREE, Unknown.TAKEN: LETHAL}


def static_costs(grid: Grid, unknown: Unknown = Unknown.KEEP, *, scale: bool = False) -> Cells:
    """(rows, cols) costs of a drawn map: `LETHAL` where it is occupied, else 0; with `scale` 252 x percent / 65."""
    value = np.arange(256)
    graded = value * 252 // OCCUPIED if scale else np.zeros(256, np.int64)
    cost = np.where(value >= OCCUPIED, LETHAL, graded)
    return np.where(value > 100, _COST_OF_UNKNOWN[unknown], cost).astype(np.uint8)[grid.cells]


@final
class LayeredCostmap:
    """A costmap that follows the lidar: `update` with what came in, then read `costmap`.

    ground : the drawn map;  inflation : cost around everything taken;  marking : how far scans are trusted;
    footprint : of the robot itself, under which nothing that a scan says stays;  window : side [m] of a square around
    the robot that moves with it, None for the whole ground;  unknown : what unknown ground is.
    zones : the cells that may not be entered, on the grid of `ground` (`zones.keep_out`); with `zones_needed` the whole
    map is taken as long as there are none: a robot that does not know its limits stands still.
    least : (rows, cols) what cells cost at least, and ways : in which they may be left (see `Costmap`), of the whole
    ground only.

    Layers are joined by their maximum, in this order: drawn map, obstacles, other robots, zones; then inflated. What
    is drawn is never cleared by a scan; what is unknown is known once it was seen. Only what changed is computed, and
    it equals a full update. Raises ConfigError for a setting that makes no sense.
    """

    def __init__(
        self,
        ground: Grid,
        *,
        inflation: Inflation,
        marking: Marking | None = None,
        footprint: Footprint | None = None,
        window: float | None = None,
        unknown: Unknown = Unknown.KEEP,
        scale: bool = False,
        keep_out: Cells | None = None,
        zones_needed: bool = False,
        least: Cells | None = None,
        ways: Cells | None = None,
    ) -> None:
        self._ground, self._marking, self._footprint = ground, marking or Marking(), footprint
        self._drawn, self._beyond = static_costs(ground, unknown, scale=scale), _COST_OF_UNKNOWN[unknown]
        self._rolling, self._ways = window is not None, ways
        if self._rolling and (least is not None or ways is not None):
            raise ConfigError("a moving window with graded ground", where="costmap", fix="leave out window")
        if least is not None:
            np.maximum(self._drawn, least, out=self._drawn)
        self._margin = inflation.reach(ground.resolution) if self._rolling else 0
        self._shape = _shape(ground, window, self._margin)
        self._inflater = Inflater(inflation, ground.resolution, self._shape)
        self._corner = None if self._rolling else np.zeros(2, np.int64)  # row, column of the ground
        self._static, self._seen, self._keep = (np.full(self._shape, UNKNOWN, np.uint8) for _ in range(3))
        self._held = np.full(self._shape, NEVER, np.uint8)
        self._base, self._out = np.empty(self._shape, np.uint8), np.empty(self._shape, np.uint8)
        self._others: list[tuple[Box, Floats, float]] = []
        self._needed = zones_needed
        self.replace_zones(keep_out)

    @property
    def _whole(self) -> Box:
        return 0, self._shape[0], 0, self._shape[1]

    @property
    def resolution(self) -> float:
        """Side of a cell [m]."""
        return self._ground.resolution

    @property
    def origin(self) -> Floats:
        """(2,) m, site frame: the south-western corner of all cells that are kept, margin included."""
        corner = np.zeros(2, np.int64) if self._corner is None else self._corner
        return self._ground.origin + corner[::-1] * self.resolution

    @property
    def costmap(self) -> Costmap:
        """What stands now. Of a whole map it is the live one, which the next update changes; of a window a copy."""
        if self._corner is None:
            raise DataError("the window is nowhere yet", where="costmap", fix="update with the robot's pose first")
        m = self._margin
        rows, cols = self._shape
        cells = self._out[m : rows - m, m : cols - m].copy() if self._rolling else self._out
        origin = self.origin + m * self.resolution
        return Costmap(cells=cells, resolution=self.resolution, origin=origin, ways=self._ways)

    def update(self, scans: Sequence[Scan] = (), *, pose: Floats | None = None, others: Iterable[Other] = ()) -> None:
        """Enter scans, in the order of their time, where the robot is (pose (3,)), and where the others are now.

        Raises DataError for a pose that is not finite, a scan of which no beam can be used, or a window without a pose:
        nothing has changed then, and a robot that moves should stop.
        """
        others = list(others)
        _refuse_unusable(scans, pose, others)
        boxes = self._move(pose)
        origin = self.origin
        boxes += [observe(self._seen, self.resolution, origin, scan, self._marking, self._held) for scan in scans]
        if self._footprint is not None and pose is not None:
            boxes.append(self._stand(self._footprint, pose))
        boxes += [box for box, *_ in self._others]
        self._others = [self._placed(*other) for other in others]
        boxes += [box for box, *_ in self._others]
        self._refresh(boxes)

    def passed(self, points: Floats) -> NDArray[np.bool_]:
        """(n,) whether beams pass where the points (n, 2) m are, as a rule: it was hit twice at most."""
        return self._at(self._held, points, NEVER) <= TWICE

    def drawn(self, points: Floats) -> NDArray[np.bool_]:
        """(n,) whether the points (n, 2) m lie on what the drawn map says is taken."""
        return self._at(self._static, points) == LETHAL

    def taken(self, points: Floats) -> NDArray[np.bool_]:
        """(n,) whether the points (n, 2) m lie on what stands now."""
        return self._at(self._out, points) == LETHAL

    def _at(self, cells: Cells, points: Floats, beyond: int = UNKNOWN) -> Cells:
        """(n,) the cells in which points lie, `beyond` outside of them."""
        out, (west, south) = np.empty(len(points), np.uint8), self.origin.tolist()
        look_up(cells, west, south, self.resolution, np.ascontiguousarray(points), beyond, out)
        return out

    def replace_zones(self, keep_out: Cells | None) -> None:
        """Other cells that may not be entered (not 0), on the grid of the ground; None where the zones were lost."""
        if keep_out is not None and keep_out.shape != self._ground.cells.shape:
            what = f"zones of {keep_out.shape} cells on a map of {self._ground.cells.shape}"
            raise ConfigError(what, where="costmap", fix="draw both on one grid")
        self._zones = None if keep_out is None else np.where(keep_out != 0, LETHAL, FREE).astype(np.uint8)
        if self._corner is not None:
            self._draw_ground()
            self._refresh([self._whole])

    def rebuild(self) -> None:
        """Compute every cell anew; changes nothing that `update` did right."""
        self._refresh([self._whole])

    def _move(self, pose: Floats | None) -> list[Box]:
        """Shift the window so that the robot is in its middle; the whole of it has then changed."""
        if not self._rolling:
            return []
        if pose is None:
            raise DataError("a moving window needs the robot's pose", where="costmap")
        middle = np.array(self._shape) // 2
        corner = self._ground.cell_of(pose[:2]) - middle
        if self._corner is not None and (corner == self._corner).all():
            return []
        kept, held = self._seen.copy(), self._held.copy()
        self._seen.fill(UNKNOWN)
        self._held.fill(NEVER)
        if self._corner is not None:
            _copy_overlap(kept, self._corner, self._seen, corner)
            _copy_overlap(held, self._corner, self._held, corner)
        self._corner = corner
        self._draw_ground()
        return [self._whole]

    def _draw_ground(self) -> None:
        """The drawn map and its zones, as far as they are in view."""
        assert self._corner is not None
        self._static.fill(self._beyond)
        inside, there = _overlap(self._ground.cells.shape, self._shape, self._corner)
        self._static[there] = self._drawn[inside]
        if self._zones is None:
            self._keep.fill(LETHAL if self._needed else FREE)
            return
        self._keep.fill(LETHAL)  # beyond the zones' map nobody knows what is allowed
        self._keep[there] = self._zones[inside]

    def _stand(self, footprint: Footprint, pose: Floats) -> Box:
        """Forget what scans say of the cells whose middle is under the robot; one that it only touches may stop it."""
        box, placed, radius = self._placed(footprint, pose)
        west, south = self.origin.tolist()
        stamp(self._seen, west, south, self.resolution, placed, radius, 0.0, FREE)
        return box

    def _placed(self, footprint: Footprint, pose: Floats) -> tuple[Box, Floats, float]:
        """A robot's outline and its radius, in the box of cells that it may touch."""
        placed, radius = footprint.at(pose), footprint.radius
        p, beyond = (placed - self.origin) / self.resolution, radius / self.resolution
        corners = np.clip([p.min(axis=0) - beyond, p.max(axis=0) + beyond + 1.0], -1e9, 1e9)
        (c0, r0), (c1, r1) = corners.astype(int).tolist()
        return _within((r0 - 1, r1, c0 - 1, c1), self._shape), placed, radius  # astype rounds towards zero

    def _refresh(self, boxes: list[Box]) -> None:
        """Join the layers in every box, then inflate as far as that reaches."""
        if self._whole in boxes:
            boxes = [self._whole]
        west, south = self.origin.tolist()
        for r0, r1, c0, c1 in boxes:
            join(self._static, self._seen, self._keep, self._base, r0, r1, c0, c1)
        for _, outline, radius in self._others:
            stamp(self._base, west, south, self.resolution, outline, radius, 0.5, LETHAL)
        k = self._inflater.reach
        for r0, r1, c0, c1 in boxes:
            if r0 < r1 and c0 < c1:
                self._inflater(self._base, self._out, _within((r0 - k, r1 + k, c0 - k, c1 + k), self._shape))


@kernel
def join(static: Any, seen: Any, keep: Any, base: Any, r0: int, r1: int, c0: int, c1: int) -> None:
    """Costs of the rows r0..r1 and columns c0..c1 from the drawn map, what was seen and where nobody may go."""
    lethal = np.uint8(LETHAL)
    for r in range(r0, r1):
        drawn, told, barred, made = static[r, c0:c1], seen[r, c0:c1], keep[r, c0:c1], base[r, c0:c1]
        for c in range(made.size):
            cost, s = drawn[c], told[c]
            known = (s != UNKNOWN) & ((cost == UNKNOWN) | (s > cost))
            cost = s if known else cost
            made[c] = lethal if barred[c] == lethal else cost


def _shape(ground: Grid, window: float | None, margin: int) -> tuple[int, int]:
    if window is None:
        rows, cols = ground.cells.shape
        return rows, cols
    if not 0.0 < window < np.inf:
        raise ConfigError(f"a window of {window:g} m", where="costmap", fix="more than zero")
    side = round(window / ground.resolution) + 2 * margin
    if side < 1 or side * side > _LARGEST:
        what = f"a window of {window:g} m has {side} x {side} cells of {ground.resolution:g} m"
        raise ConfigError(what, where="costmap", fix="a smaller window")
    return side, side


def _refuse_unusable(scans: Sequence[Scan], pose: Floats | None, others: Sequence[Other]) -> None:
    for who, p in [("robot", pose), *(("other robot", p) for _, p in others)]:
        if p is not None and (p.shape != (3,) or not np.isfinite(p).all()):
            raise DataError(f"the pose of the {who} is {p.tolist()}", where="costmap", fix="stop: position unknown")
    for k, scan in enumerate(scans):
        if not scan.usable.any():
            what = f"no beam of scan {k} can be used"
            raise DataError(what, where="costmap", fix="stop: is the lidar covered, or its driver at fault?")


def _within(box: Box, shape: tuple[int, int]) -> Box:
    r0, r1, c0, c1 = box
    rows, cols = shape
    r0, c0 = min(max(r0, 0), rows), min(max(c0, 0), cols)
    return r0, min(max(r1, r0), rows), c0, min(max(c1, c0), cols)


def _overlap(
    whole: tuple[int, ...], view: tuple[int, ...], corner: NDArray[np.int64]
) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """The cells of a map that a view at `corner` shows, and where they stand in the view."""
    inside: list[slice] = []
    there: list[slice] = []
    for size, seen, first in zip(whole, view, corner.tolist(), strict=True):
        start, end = min(max(first, 0), size), max(min(first + seen, size), 0)
        end = max(end, start)
        inside.append(slice(start, end))
        there.append(slice(start - first, end - first) if start < end else slice(0, 0))
    return (inside[0], inside[1]), (there[0], there[1])


def _copy_overlap(
    old: NDArray[Any], old_corner: NDArray[np.int64], new: NDArray[Any], corner: NDArray[np.int64]
) -> None:
    inside, there = _overlap(old.shape, new.shape, corner - old_corner)
    new[there] = old[inside]
