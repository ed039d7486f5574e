"""What moves around a robot: clusters of a lidar's returns, each followed by a Kalman filter of constant velocity.

A cluster moves if its velocity is beyond doubt and if it stands where beams have passed before: what a robot merely
sees from another side as it drives never stands on ground that was seen to be free.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import cos, hypot, pi, sin, sqrt
from typing import Any, Final, NamedTuple, final

import numpy as np

from outrider._kernel import kernel
from outrider.data.scan import Scan
from outrider.errors import ConfigError
from outrider.typing import Bools, Floats, Ints

CLUSTER: Final = 4  # x, y, radius [m] of a disc, variance of its place [m^2]
# Columns of what is followed: place and velocity; variance of the place, covariance, variance of the velocity, for
# both axes; unit vector along which it last moved, 0 if it never did; radius [m]; when it was seen [s]; scans in a row
# that speak against what it is taken for; 1 if it moves.
X, Y, VX, VY, P, C, V, EAST, NORTH, RADIUS, SEEN, STREAK, MOVING = range(13)
TRACK: Final = 13

FEWEST: Final = 3  # returns of a thing that is followed
UNKNOWN_SPEED: Final = 1.5  # m/s, standard deviation of the velocity of what was just seen
ABOUT: Final = ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.0, -1.0))  # in the direction of motion: not behind


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Tracking:
    """gap : m between neighbouring returns of one thing, and `reach` : m up to which things are followed;  widest : m,
    what is wider never moves;  sigma : m, of a cluster's place;  acceleration : m/s^2, white, of what is followed;
    gate : squared distance, in standard deviations, within which a cluster may be the one of a track;  starts, stops :
    m/s above which something moves and below which it stands again, both for `scans` in a row;  sure : standard
    deviations that the velocity is from rest;  forget : s without a return where it should be in sight, and
    `remember` : s while something nearer hides what moves;  margin : m around what moves.
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
    remember: float = 3.0
    margin: float = 0.1

    def __post_init__(self) -> None:
        numbers = (self.gap, self.reach, self.widest, self.sigma, self.acceleration, self.gate, self.sure, self.forget)
        ordered = 0.0 < self.stops <= self.starts and self.forget <= self.remember < np.inf
        if not all(0.0 < x < np.inf for x in numbers) or not ordered or self.scans < 1:
            fix = "all positive, `stops` no more than `starts`, `forget` no more than `remember`"
            raise ConfigError("impossible numbers", where="tracking", fix=fix)


class Rules(NamedTuple):
    """The numbers of `Tracking`, as kernels take them."""

    gap: float
    reach: float
    widest: float
    sigma: float
    acceleration: float
    gate: float
    starts: float
    stops: float
    scans: int
    sure: float


@final
class Tracker:
    """Follows what moves, scan by scan."""

    def __init__(self, settings: Tracking = Tracking()) -> None:
        s = self._settings = settings
        self._rules = Rules(*(getattr(s, name) for name in Rules._fields))
        self._time, self._all = -np.inf, np.empty((0, TRACK))

    def look(self, t_s: float, scan: Scan, passed: Callable[[Floats], Bools]) -> Scan:
        """Take in a scan of time t_s [s]; what is left of it for a map of things that stand.

        passed : through which of the places (m, 2) beams have passed before this scan.
        """
        s = self._settings
        z = clusters(scan, s)
        self._predict(t_s)
        track = associated(self._all, z, s.gate)
        self._correct(t_s, track, z, passed)
        self._all = np.concatenate([self._all[self._known(t_s, scan)], fresh(t_s, z[track < 0])])
        return self._without_moving(scan)

    def discs(self, t_s: float) -> Floats:
        """(n, 5) x, y, radius [m], v_x, v_y [m/s] of what moves, carried to t_s."""
        a = self._all[self._all[:, MOVING] > 0.0]
        ahead = max(t_s - self._time, 0.0) if len(a) else 0.0
        out = a[:, [X, Y, RADIUS, VX, VY]]
        out[:, :2] += ahead * out[:, 3:]
        out[:, 2] += self._settings.margin
        return out

    def standing(self) -> Floats:
        """(n, 5) x, y, radius [m] of what is followed and does not move, and the unit vector of its last motion."""
        return self._all[self._all[:, MOVING] == 0.0][:, [X, Y, RADIUS, EAST, NORTH]]

    def _predict(self, t_s: float) -> None:
        dt = max(t_s - self._time, 0.0) if len(self._all) else 0.0
        self._time = t_s
        predict(self._all, dt, self._settings.acceleration)

    def _correct(self, t_s: float, track: Ints, z: Floats, passed: Callable[[Floats], Bools]) -> None:
        """track (m,) : the row of what each cluster is of, -1 for none."""
        places = np.empty((len(z), len(ABOUT), 2))
        correct(self._all, track, z, t_s, self._settings.gap, places)
        open_ = passed(places.reshape(-1, 2)).reshape(-1, len(ABOUT)).all(axis=1)
        judge(self._all, track, open_.view(np.uint8), self._rules)

    def _known(self, t_s: float, scan: Scan) -> Bools:
        """(n,) which are not forgotten: seen a moment ago, or on the move and hidden."""
        s, out = self._settings, np.empty(len(self._all), np.uint8)
        x, y, heading = scan.pose.tolist()
        remembered(x, y, heading, scan.bearings, scan.ranges, scan.blind, self._all, t_s, s.forget, s.remember, out)
        return out.view(np.bool_)

    def _without_moving(self, scan: Scan) -> Scan:
        """The scan, with no word from beams that end at something that moves."""
        discs, ranges = self.discs(self._time), np.empty(len(scan.ranges))
        if not len(discs):
            return scan
        x, y, heading = scan.pose.tolist()
        gap = self._settings.gap
        left = silence(x, y, heading, scan.bearings, scan.ranges, scan.blind, discs, gap, ranges)
        return replace(scan, ranges=ranges) if left else scan


def fresh(t_s: float, z: Floats) -> Floats:
    """(m, TRACK) one row for each of the clusters z (m, CLUSTER), of unknown velocity."""
    out = np.zeros((len(z), TRACK))
    out[:, [X, Y, RADIUS, P]] = z
    out[:, V], out[:, SEEN] = UNKNOWN_SPEED**2, t_s
    return out


def associated(tracks: Floats, z: Floats, gate: float) -> Ints:
    """(m,) the row of the track that each cluster is of, -1 for none: the least sum of squared distances, none beyond
    the gate."""
    from scipy.optimize import linear_sum_assignment  # slow to import

    out = np.full(len(z), -1)
    if len(tracks) and len(z):
        d2 = np.empty((len(tracks), len(z)))
        distances(tracks, z, gate, d2)
        row, col = linear_sum_assignment(d2)
        near = d2[row, col] < gate
        out[col[near]] = row[near]
    return out


def clusters(scan: Scan, s: Tracking) -> Floats:
    """(m, CLUSTER) discs behind neighbouring returns: as wide as they look, touched by the nearest of them."""
    n = len(scan.ranges)
    hit, p, out = np.empty(n, np.int64), np.empty((n, 3)), np.empty((n // FEWEST, CLUSTER))
    x, y, heading = scan.pose.tolist()
    far = min(scan.reach, s.reach)
    m = group(x, y, heading, scan.bearings, scan.ranges, scan.blind, far, s.gap, s.widest, s.sigma, hit, p, out)
    return out[:m]


@kernel
def group(
    x: float, y: float, heading: float, bearings: Floats, ranges: Floats, blind: float, far: float, gap: float,
    widest: float, sigma: float, hit: Ints, p: Floats, out: Floats,
) -> int:  # fmt: skip
    """`clusters`; returns how many.  hit (n), p (n, 3) x, y, range of every return: scratch."""
    n, k = ranges.size, 0
    for i in range(n):
        r = ranges[i]
        if blind <= r < far:
            hit[k], p[k, 2] = i, r
            p[k, 0], p[k, 1] = x + r * cos(heading + bearings[i]), y + r * sin(heading + bearings[i])
            k += 1
    if k < FEWEST:
        return 0
    step = abs(bearings[n - 1] - bearings[0]) / (n - 1)
    whole = step * n > 2.0 * pi - 0.5 * step and hit[0] + n - hit[k - 1] <= 2
    joined = whole and not hypot(p[0, 0] - p[k - 1, 0], p[0, 1] - p[k - 1, 1]) > gap + 1.5 * p[0, 2] * step
    begin = 1 if joined else 0  # no thing goes over the end
    while 0 < begin < k and not begins(hit, p, begin, gap, step):
        begin += 1
    m, first = 0, begin
    for i in range(begin + 1, begin + k + 1 if begin < k else 0):
        if i == begin + k or (i % k > 0 and begins(hit, p, i % k, gap, step)):
            m += disc(x, y, ranges, hit, p, k, first, i, step, gap, widest, sigma, out[m])
            first = i
    return m


@kernel
def begins(hit: Ints, p: Floats, i: int, gap: float, step: float) -> bool:
    """Whether a return is not of the thing of the one before."""
    away = gap + 1.5 * step * min(p[i, 2], p[i - 1, 2])
    return hypot(p[i, 0] - p[i - 1, 0], p[i, 1] - p[i - 1, 1]) > away or hit[i] - hit[i - 1] > 2


@kernel
def disc(
    x: float, y: float, ranges: Floats, hit: Ints, p: Floats, k: int, first: int, end: int, step: float, gap: float,
    widest: float, sigma: float, out: Floats,
) -> bool:  # fmt: skip
    """out (CLUSTER) <- the disc behind the returns first..end, counted round k of them; False for none.

    Too few or too wide is none; half hidden by something nearer, its place is uncertain.
    """
    if end - first < FEWEST:
        return False
    total, nearest = 0.0, np.inf
    for i in range(first, end):
        total += p[i % k, 2]
        nearest = min(nearest, p[i % k, 2])
    a, b, n = first % k, (end - 1) % k, ranges.size
    spacing = step * (total / (end - first))
    width = hypot(p[b, 0] - p[a, 0], p[b, 1] - p[a, 1]) + spacing
    dx, dy = 0.5 * (p[a, 0] + p[b, 0]) - x, 0.5 * (p[a, 1] + p[b, 1]) - y
    away = hypot(dx, dy)
    if width > widest or away == 0.0:
        return False
    out[2] = 0.5 * width
    out[0], out[1] = x + (nearest + out[2]) * dx / away, y + (nearest + out[2]) * dy / away
    hidden = ranges[(hit[a] - 1) % n] < p[a, 2] - gap or ranges[(hit[b] + 1) % n] < p[b, 2] - gap
    s = 5.0 * sigma if hidden else sigma
    out[3] = s * s + spacing * spacing / 12.0
    return True


@kernel
def predict(tracks: Floats, dt: float, acceleration: float) -> None:
    """Carry all on by dt [s] at constant velocity, with white noise of acceleration [m/s^2]."""
    q = acceleration * acceleration
    for i in range(tracks.shape[0]):
        a = tracks[i]
        a[X] += dt * a[VX]
        a[Y] += dt * a[VY]
        a[P] += 2.0 * dt * a[C] + dt * dt * a[V] + 0.25 * q * dt**4
        a[C] += dt * a[V] + 0.5 * q * dt**3
        a[V] += q * dt * dt


@kernel
def distances(tracks: Floats, z: Floats, gate: float, d2: Floats) -> None:
    """d2 (n, m) <- squared distances between tracks and clusters in standard deviations, `gate` at the most."""
    for i in range(tracks.shape[0]):
        for j in range(z.shape[0]):
            dx, dy = tracks[i, X] - z[j, 0], tracks[i, Y] - z[j, 1]
            d2[i, j] = min((dx * dx + dy * dy) / (tracks[i, P] + z[j, 3]), gate)


@kernel
def correct(tracks: Floats, track: Ints, z: Floats, t: float, gap: float, places: Floats) -> None:
    """The Kalman step of what was seen; places (m, ABOUT, 2) <- where beams pass about a cluster that moves."""
    for j in range(z.shape[0]):
        for k in range(places.shape[1]):
            places[j, k, 0], places[j, k, 1] = z[j, 0], z[j, 1]
        if track[j] < 0:
            continue
        a = tracks[track[j]]
        total = a[P] + z[j, 3]
        gain, faster = a[P] / total, a[C] / total
        dx, dy = z[j, 0] - a[X], z[j, 1] - a[Y]
        a[X] += gain * dx
        a[Y] += gain * dy
        a[VX] += faster * dx
        a[VY] += faster * dy
        a[P], a[C], a[V] = (1.0 - gain) * a[P], (1.0 - gain) * a[C], a[V] - a[C] * faster
        a[RADIUS] += 0.3 * (z[j, 2] - a[RADIUS])
        a[SEEN] = t
        speed = max(hypot(a[VX], a[VY]), 1e-9)
        east, north = gap * a[VX] / speed, gap * a[VY] / speed
        for k in range(places.shape[1]):
            along, beside = ABOUT[k]
            places[j, k, 0] += along * east - beside * north
            places[j, k, 1] += along * north + beside * east


@kernel
def judge(tracks: Floats, track: Ints, open_: Any, s: Rules) -> None:
    """What those that were seen are taken for from now on. `open_` (m,) : whether beams pass about the cluster."""
    for j in range(track.size):
        if track[j] < 0:
            continue
        a = tracks[track[j]]
        speed, moves = hypot(a[VX], a[VY]), a[MOVING] > 0.0
        goes = open_[j] and speed > s.starts and speed > s.sure * sqrt(a[V])
        if moves and speed > s.starts:
            a[EAST], a[NORTH] = a[VX] / max(speed, 1e-9), a[VY] / max(speed, 1e-9)
        against = speed < s.stops if moves else goes
        a[STREAK] = a[STREAK] + 1.0 if against else 0.0
        if a[STREAK] >= s.scans:
            a[MOVING], a[STREAK] = 1.0 - a[MOVING], 0.0


@kernel
def remembered(
    x: float, y: float, heading: float, bearings: Floats, ranges: Floats, blind: float, tracks: Floats, t: float,
    forget: float, remember: float, out: Any,
) -> None:  # fmt: skip
    """out (n,) <- whether each was seen within `forget`, or moves, was seen within `remember`, and every beam towards
    it ends before it comes there."""
    for k in range(tracks.shape[0]):
        a = tracks[k]
        out[k] = t - a[SEEN] <= forget
        if out[k] or a[MOVING] == 0.0 or t - a[SEEN] > remember:
            continue
        dx, dy = a[X] - x, a[Y] - y
        away = hypot(dx, dy)
        cover, through = 0, 0
        for i in range(ranges.size):
            c, s = cos(heading + bearings[i]), sin(heading + bearings[i])
            if c * dx + s * dy > 0.0 and abs(c * dy - s * dx) < a[RADIUS]:
                cover += blind <= ranges[i] < away - a[RADIUS]
                through += ranges[i] >= away - a[RADIUS]
        out[k] = cover > 0 and through == 0


@kernel
def silence(
    x: float, y: float, heading: float, bearings: Floats, ranges: Floats, blind: float, discs: Floats, gap: float,
    out: Floats,
) -> bool:  # fmt: skip
    """out (n,) <- ranges, NaN where a beam ends within `gap` of a disc; whether any beam still says something."""
    left = False
    for i in range(ranges.size):
        r = out[i] = ranges[i]
        if blind <= r < np.inf:
            px, py = x + r * cos(heading + bearings[i]), y + r * sin(heading + bearings[i])
            for k in range(discs.shape[0]):
                if hypot(px - discs[k, 0], py - discs[k, 1]) - discs[k, 2] < gap:
                    out[i] = np.nan
        left = left or out[i] >= blind
    return left
