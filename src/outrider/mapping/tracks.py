"""What moves around a robot: clusters of a lidar's returns, each followed by a Kalman filter of constant velocity.

A cluster moves if its velocity is beyond doubt and if it stands where beams have passed before: what a robot merely
sees from another side as it drives never stands on ground that was seen to be free.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np

from outrider.data.scan import Scan
from outrider.errors import ConfigError
from outrider.typing import Bools, Floats, Ints

CLUSTER: Final = 4  # x, y, radius [m] of a disc, variance of its place [m^2]

FEWEST: Final = 3  # returns of a thing that is followed
ABOUT: Final = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])  # in the direction of motion: not behind


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Tracking:
    """gap : m between neighbouring returns of one thing, and `reach` : m up to which things are followed;  widest : m,
    what is wider never moves;  sigma : m, of a cluster's place;  acceleration : m/s^2, white, of what is followed;
    gate : squared distance, in standard deviations, within which a cluster may be the one of a track;  starts, stops :
    m/s above which something moves and below which it stands again, both for `scans` in a row;  sure : standard
    deviations that the velocity is from rest;  forget : s without a return;  margin : m around what moves.
    """

    gap: float = 0.25
    reach: float = 8.0
    widest: float = 1.3
    sigma: float = 0.05
    acceleration: float = 2.0
    gate: float = 13.8  # of two dimensions at 0.1 %
    starts: float = 0.4
    stops: float = 0.2
    scans: int = 2
    sure: float = 2.5
    forget: float = 1.0
    margin: float = 0.1

    def __post_init__(self) -> None:
        numbers = (self.gap, self.reach, self.widest, self.sigma, self.acceleration, self.gate, self.sure, self.forget)
        if not all(0.0 < x < np.inf for x in numbers) or not 0.0 < self.stops <= self.starts or self.scans < 1:
            raise ConfigError("impossible numbers", where="tracking", fix="all positive, `stops` no more than `starts`")


@final
@dataclass(slots=True)
class Tracks:
    """Rows of what is followed. x : (n, 4) place and velocity;  P : (n, 3) variance of the place, covariance, variance
    of the velocity, the same along both axes;  way : (n, 2) unit vector along which it last moved, 0 if it never did;
    radius : (n,) m;  seen : (n,) s;  streak : (n,) scans in a row that speak against what it is taken for;
    moving : (n,)."""

    x: Floats
    P: Floats
    way: Floats
    radius: Floats
    seen: Floats
    streak: Ints
    moving: Bools

    @classmethod
    def none(cls) -> "Tracks":
        """Nothing yet."""
        rows, way = np.zeros(0), np.zeros((0, 2))
        return cls(np.zeros((0, 4)), np.zeros((0, 3)), way, rows, rows, np.zeros(0, np.int64), np.zeros(0, np.bool_))

    def kept(self, rows: Bools) -> "Tracks":
        """Some of them."""
        return Tracks(*(getattr(self, name)[rows] for name in self.__slots__))

    def with_new(self, t_s: float, z: Floats) -> "Tracks":
        """And one for each of the clusters z (m, CLUSTER), of unknown velocity."""
        m = len(z)
        P = np.column_stack([z[:, 3], np.zeros(m), np.full(m, 1.5**2)])
        return Tracks(
            x=np.vstack([self.x, np.column_stack([z[:, :2], np.zeros((m, 2))])]),
            P=np.vstack([self.P, P]),
            way=np.vstack([self.way, np.zeros((m, 2))]),
            radius=np.concatenate([self.radius, z[:, 2]]),
            seen=np.concatenate([self.seen, np.full(m, t_s)]),
            streak=np.concatenate([self.streak, np.zeros(m, np.int64)]),
            moving=np.concatenate([self.moving, np.zeros(m, np.bool_)]),
        )


@final
class Tracker:
    """Follows what moves, scan by scan."""

    def __init__(self, settings: Tracking = Tracking()) -> None:
        self._settings, self._time, self._all = settings, -np.inf, Tracks.none()

    def look(self, t_s: float, scan: Scan, passed: Callable[[Floats], Bools]) -> Scan:
        """Take in a scan of time t_s [s]; what is left of it for a map of things that stand.

        passed : through which of the places (m, 2) beams have passed before this scan.
        """
        s = self._settings
        z = clusters(scan, s)
        self._predict(t_s)
        track, cluster = associated(self._all, z, s.gate)
        self._correct(t_s, track, z[cluster], passed)
        fresh = np.ones(len(z), np.bool_)
        fresh[cluster] = False
        self._all = self._all.kept(t_s - self._all.seen <= s.forget).with_new(t_s, z[fresh])
        return self._without_moving(scan)

    def discs(self, t_s: float) -> Floats:
        """(n, 5) x, y, radius [m], v_x, v_y [m/s] of what moves, carried to t_s."""
        a = self._all.kept(self._all.moving)
        ahead = max(t_s - self._time, 0.0) if len(a.x) else 0.0
        return np.column_stack([a.x[:, :2] + ahead * a.x[:, 2:], a.radius + self._settings.margin, a.x[:, 2:]])

    def standing(self) -> Floats:
        """(n, 5) x, y, radius [m] of what is followed and does not move, and its unit vector `Tracks.way`."""
        a = self._all.kept(~self._all.moving)
        return np.column_stack([a.x[:, :2], a.radius, a.way])

    def _predict(self, t_s: float) -> None:
        dt = max(t_s - self._time, 0.0) if len(self._all.x) else 0.0
        self._time = t_s
        x, (p, c, v) = self._all.x, self._all.P.T
        q = self._settings.acceleration**2
        x[:, :2] += dt * x[:, 2:]
        p += 2.0 * dt * c + dt * dt * v + 0.25 * q * dt**4
        c += dt * v + 0.5 * q * dt**3
        v += q * dt * dt

    def _correct(self, t_s: float, row: Ints, z: Floats, passed: Callable[[Floats], Bools]) -> None:
        """The Kalman step of the tracks that were seen, and what they are taken for from now on."""
        a, s = self._all, self._settings
        p, c, v = a.P[row].T
        innovation, k = z[:, :2] - a.x[row, :2], p / (p + z[:, 3])
        a.x[row] += np.column_stack([k[:, None] * innovation, (c / (p + z[:, 3]))[:, None] * innovation])
        a.P[row] = np.column_stack([(1.0 - k) * p, (1.0 - k) * c, v - c * c / (p + z[:, 3])])
        a.radius[row] += 0.3 * (z[:, 2] - a.radius[row])
        a.seen[row] = t_s
        speed, moving = np.hypot(a.x[row, 2], a.x[row, 3]), a.moving[row]
        way = a.x[row, 2:] / np.maximum(speed, 1e-9)[:, None]
        beside = np.column_stack([-way[:, 1], way[:, 0]])
        about = ABOUT[:, :1] * way[:, None] + ABOUT[:, 1:] * beside[:, None]
        open_ = passed((z[:, None, :2] + s.gap * about).reshape(-1, 2)).reshape(-1, len(ABOUT)).all(axis=1)
        goes = open_ & (speed > s.starts) & (speed > s.sure * np.sqrt(a.P[row, 2]))
        streak = np.where(np.where(moving, speed < s.stops, goes), a.streak[row] + 1, 0)
        turns = streak >= s.scans
        a.way[row] = np.where((moving & (speed > s.starts))[:, None], way, a.way[row])
        a.moving[row], a.streak[row] = moving ^ turns, np.where(turns, 0, streak)

    def _without_moving(self, scan: Scan) -> Scan:
        """The scan, with no word from beams that end at something that moves."""
        discs = self.discs(self._time)
        if not len(discs):
            return scan
        angle = scan.pose[2] + scan.bearings
        hit = np.isfinite(scan.ranges) & (scan.ranges >= scan.blind)
        r = np.where(hit, scan.ranges, 0.0)
        p = scan.pose[:2] + r[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
        gap = np.hypot(p[:, None, 0] - discs[:, 0], p[:, None, 1] - discs[:, 1]) - discs[:, 2]
        on = hit & (gap.min(axis=1) < self._settings.gap)
        return scan if not (scan.usable & ~on).any() else replace(scan, ranges=np.where(on, np.nan, scan.ranges))


def clusters(scan: Scan, s: Tracking) -> Floats:
    """(m, CLUSTER) discs behind neighbouring returns: as wide as they look, touched by the nearest of them."""
    hit = np.flatnonzero((scan.ranges >= scan.blind) & (scan.ranges < min(scan.reach, s.reach)))
    if not len(hit):
        return np.empty((0, CLUSTER))
    r, angle = scan.ranges[hit], scan.pose[2] + scan.bearings[hit]
    p = scan.pose[:2] + r[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    step = abs(float(scan.bearings[-1] - scan.bearings[0])) / max(len(scan.bearings) - 1, 1)
    apart = _apart(hit, p, r, step, s.gap)
    n, full = len(scan.bearings), step * len(scan.bearings) > 2.0 * np.pi - 0.5 * step
    if full and apart.any() and hit[0] + n - hit[-1] <= 2:  # around the back
        apart[0] = bool(np.hypot(*(p[0] - p[-1])) > s.gap + 1.5 * r[0] * step)
    first = np.flatnonzero(apart)
    if not len(first):
        return np.empty((0, CLUSTER))
    order = np.arange(first[0], first[0] + len(hit)) % len(hit)  # no cluster goes over the end
    parts = np.split(order, (first - first[0])[1:])
    out = [_disc(scan, p, r, hit, part, step, s) for part in parts if len(part) >= FEWEST]
    return np.array([row for row in out if row is not None]).reshape(-1, CLUSTER)


def _apart(hit: Ints, p: Floats, r: Floats, step: float, gap: float) -> Bools:
    """(n,) whether a return is not of the thing of the one before."""
    far = np.hypot(*np.diff(p, axis=0).T) > gap + 1.5 * step * np.minimum(r[1:], r[:-1])
    return np.concatenate([[True], far | (np.diff(hit) > 2)])


def _disc(scan: Scan, p: Floats, r: Floats, hit: Ints, part: Ints, step: float, s: Tracking) -> list[float] | None:
    """The disc behind one cluster; None if it is too wide. Half hidden by something nearer, its place is uncertain."""
    a, b = p[part[0]], p[part[-1]]
    spacing = step * float(r[part].mean())
    width = float(np.hypot(*(b - a))) + spacing
    if width > s.widest:
        return None
    seen = 0.5 * (a + b) - scan.pose[:2]
    away, radius = seen / float(np.hypot(*seen)), 0.5 * width
    centre = scan.pose[:2] + (float(r[part].min()) + radius) * away
    n = len(scan.ranges)
    beside = scan.ranges[[(hit[part[0]] - 1) % n, (hit[part[-1]] + 1) % n]]
    hidden = bool((beside < r[part[[0, -1]]] - s.gap).any())
    sigma = 5.0 * s.sigma if hidden else s.sigma
    return [*centre, radius, sigma**2 + spacing**2 / 12.0]


def associated(tracks: Tracks, z: Floats, gate: float) -> tuple[Ints, Ints]:
    """Rows of tracks and of clusters that belong together: the least sum of squared distances, none beyond the gate."""
    from scipy.optimize import linear_sum_assignment  # slow to import

    gap = ((tracks.x[:, None, :2] - z[None, :, :2]) ** 2).sum(axis=2)
    d2 = gap / (tracks.P[:, 0, None] + z[None, :, 3])
    row, col = linear_sum_assignment(np.minimum(d2, gate))
    near = d2[row, col] < gate
    return row[near], col[near]
