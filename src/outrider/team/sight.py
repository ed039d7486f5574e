"""What a driver knows of the ground around its robot: a costmap of what stands, and what moves."""

from collections.abc import Sequence
from typing import Final, final

import numpy as np

from outrider.data.grid import LETHAL, UNKNOWN, Costmap
from outrider.data.scan import Scan
from outrider.data.surroundings import DistanceField, Surroundings
from outrider.errors import DataError
from outrider.mapping.layers import LayeredCostmap, Other
from outrider.mapping.tracks import Tracker, Tracking
from outrider.team.navigator import Fused
from outrider.typing import Floats

ALONE: Final = 0.4  # m of open ground about what stands alone
AHEAD: Final = (0.4, 0.8)  # m that who goes on the way he came has gone by the time that he is known to move
RING: Final = np.column_stack([f(np.arange(8) * np.pi / 4) for f in (np.cos, np.sin)])


@final
class Sight:
    """`look` every period; then ask what surrounds the robot.

    window : m, side of the square around the robot in which obstacles are seen;  stale_s : s without a scan after which
    it is blind;  sigma : m, standard deviation of its position above which it does not know where it is.
    """

    def __init__(
        self, costmap: LayeredCostmap, *, sees: bool = True, window: float = 12.0, stale_s: float = 1.0,
        sigma: float = 1.0, tracking: Tracking = Tracking(),
    ) -> None:  # fmt: skip
        self._map, self._tracker, self._sees = costmap, Tracker(tracking), sees
        self._window, self._stale_s, self._sigma = window, stale_s, sigma
        self._seen_s = -np.inf

    @property
    def costmap(self) -> Costmap:
        """What stands now, and what it costs to drive near it."""
        return self._map.costmap

    def look(self, t_s: float, here: Fused, scans: Sequence[Scan], others: Sequence[Other]) -> str:
        """Enter what came in; why the robot is blind, or nothing."""
        pose = np.array([here.p[0], here.p[1], here.heading])
        if not all(np.isfinite(x).all() for x in (pose, here.v, here.w, here.P)):
            return "the estimate is not finite"
        worst = float(np.sqrt(np.linalg.eigvalsh(here.P[:2, :2])[-1]))
        if not worst <= self._sigma:
            return f"the position is known to {worst:.1f} m only"
        try:
            standing = [self._tracker.look(t_s - scan.age, scan, self._map.passed) for scan in scans]
            self._map.update(standing, pose=pose, others=others)
        except DataError as e:
            return str(e)
        if scans or self._seen_s == -np.inf:  # the first scan is due
            self._seen_s = t_s
        late = t_s - self._seen_s
        return f"no scan for {late:.1f} s" if self._sees and late > self._stale_s else ""

    def surroundings(self, t_s: float, p: Floats, told: Floats) -> Surroundings:
        """What moves, seen and `told` (n, 5), and distances to what is taken in the window around p (2,)."""
        m, half = self.costmap, int(0.5 * self._window / self._map.resolution)
        row, col = (int(v) for v in m.cell_of(p))
        r0, c0 = max(row - half, 0), max(col - half, 0)
        cells = m.cells[r0 : row + half + 1, c0 : col + half + 1]
        taken = np.where((cells == LETHAL) | (cells == UNKNOWN), cells, 0).astype(np.uint8)
        corner = m.origin + np.array([c0, r0]) * m.resolution
        field = DistanceField.of(Costmap(cells=taken, resolution=m.resolution, origin=corner))
        return Surroundings(discs=np.vstack([self._tracker.discs(t_s), told]), wary=self._wary(), field=field)

    def _wary(self) -> Floats:
        """(m, 5) what stands alone and is not drawn: it may be somebody, who may set off.

        Who was seen to walk is taken to go on that way, so there are more places before him than behind.
        """
        discs = self._tracker.standing()
        edge = discs[:, None, :2] + discs[:, None, 2:3] * RING
        drawn = self._map.drawn(edge.reshape(-1, 2)).reshape(-1, len(RING)).any(axis=1)
        beside = self._map.taken((edge + ALONE * RING).reshape(-1, 2)).reshape(-1, len(RING)).any(axis=1)
        alone = discs[~(drawn | beside)]
        walked = alone[alone[:, 3:].any(axis=1)]
        way = np.column_stack([walked[:, 3:], np.zeros((len(walked), 3))])
        out = np.vstack([alone, *(walked + d * way for d in AHEAD)])
        out[:, 3:] = 0.0
        return out
