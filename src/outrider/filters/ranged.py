"""Where a robot starts, by ranges alone: three or more beacons that are not in line, heard within a moment."""

from typing import Final

import numpy as np

from outrider.data import Verdict
from outrider.filters.engine import Filter, Queue
from outrider.models.sensors import Sensor
from outrider.models.sensors.layout import OWN
from outrider.typing import Floats

MOMENT: Final = 1.0  # s in which a robot is taken to stand: what it moves goes into the residuals
LEAST: Final = 3  # beacons
IN_LINE: Final = 0.05  # ratio of the spreads of the beacons' places across and along
STARTS: Final = 8  # directions from the middle of the beacons in which the search begins
ROUNDS: Final = 30
COSTLY: Final = 0.5  # m: residuals beyond this count less and less (Cauchy)
FLOOR: Final = 0.3  # m, of a range: multipath does not average out within a moment
SURER: Final = 3.0  # times the deviation that the ranges tell: the search has fitted its own noise


def position_by_ranges(f: Filter, q: Queue) -> tuple[float, Floats, Floats, str] | None:
    """Time, position, variance of the first moment in which enough beacons were heard; None if there is none.

    A robust fit of (x, y) at the height 0 of the site frame by Gauss-Newton from all round. The deviation is one figure
    for both axes, the larger of the two: a small array of beacons tells the distance well and the direction badly.
    """
    t, r, places = heard(f, q)
    begin = 0
    while begin < t.size:
        rows = np.arange(begin, int(np.searchsorted(t, t[begin] + MOMENT)))
        if spread_out(places[rows]):
            fits = [descended(p, places[rows], r[rows]) for p in round_about(places[rows], r[rows])]
            p = min(fits, key=lambda p: cost(p, places[rows], r[rows]))
            sd, names = deviation(p, places[rows]), np.unique(places[rows], axis=0).shape[0]
            text = f"position from the ranges of the first {MOMENT:g} s to {names} beacons"
            return float(t[begin]), np.array([*p, 0.0]), np.array([sd**2, sd**2, 1.0]), text
        begin = int(np.searchsorted(t, t[begin] + MOMENT))
    return None


def heard(f: Filter, q: Queue) -> tuple[Floats, Floats, Floats]:
    """Ranges in order of time: t (n,) s, r (n,) m, places of their beacons (n, 3) m."""
    found: list[tuple[Floats, Floats, Floats]] = [(np.zeros(0), np.zeros(0), np.zeros((0, 3)))]
    for channel, part in zip(f.channels, q.parts, strict=True):
        if channel.sensor not in (Sensor.RANGE, Sensor.RANGE_BEARING) or channel.scored:
            continue
        good = part.flag == Verdict.USED
        n, place = int(good.sum()), channel.theta[OWN : OWN + 3]
        t = np.asarray((part.t[good] - q.t0) * 1e-9, np.float64)
        found.append((t, part.z[good, 1], np.tile(place, (n, 1))))
    t, r, places = (np.concatenate(column) for column in zip(*found, strict=True))
    order = np.argsort(t, kind="stable")
    return t[order], r[order], places[order]


def spread_out(places: Floats) -> bool:
    """Whether the beacons can tell a place: enough of them, and not in line."""
    xy = np.unique(places[:, :2], axis=0)
    if len(xy) < LEAST:
        return False
    s = np.linalg.svd(xy - xy.mean(axis=0), compute_uv=False)
    return bool(s[1] > IN_LINE * s[0])


def round_about(places: Floats, r: Floats) -> Floats:
    """(STARTS, 2) places at the usual range from the middle of the beacons."""
    way = np.arange(0.0, STARTS, dtype=np.float64) * (2 * np.pi / STARTS)
    return places[:, :2].mean(axis=0) + np.median(r) * np.column_stack([np.cos(way), np.sin(way)])


def descended(p: Floats, places: Floats, r: Floats) -> Floats:
    """Gauss-Newton with Cauchy weights; a step is no longer than the usual range."""
    for _ in range(ROUNDS):
        far, J = seen(p, places)
        e = r - far
        w = 1.0 / (1.0 + (e / COSTLY) ** 2)
        step = np.linalg.solve(J.T @ (w[:, None] * J) + 1e-9 * np.eye(2), J.T @ (w * e))
        p = p + step * min(1.0, float(np.median(r)) / max(float(np.linalg.norm(step)), 1e-9))
    return p


def seen(p: Floats, places: Floats) -> tuple[Floats, Floats]:
    """(n,) distances from the place p on the ground, and their Jacobian (n, 2)."""
    to = np.array([*p, 0.0]) - places
    far = np.maximum(np.linalg.norm(to, axis=1), 1e-3)
    return far, to[:, :2] / far[:, None]


def cost(p: Floats, places: Floats, r: Floats) -> float:
    """Cauchy's."""
    return float(np.log1p(((r - seen(p, places)[0]) / COSTLY) ** 2).sum())


def deviation(p: Floats, places: Floats) -> float:
    """Of the position [m], in its worse direction, by one range to each beacon."""
    _, J = seen(p, np.unique(places, axis=0))
    return SURER * FLOOR / max(float(np.linalg.svd(J, compute_uv=False)[-1]), 1e-3)


__all__ = ["position_by_ranges"]
