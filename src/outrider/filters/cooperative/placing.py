"""Where a robot starts: its pose from what it has seen, and from who has seen it, on the way that its odometry tells.

A place in the robot's own frame that is known in the world (a landmark that it sees, another robot that it sees or that
sees it) is a pair of points. Two pairs give a pose; what most pairs agree on is kept (RANSAC, Fischler and Bolles 1981)
and refined by least squares. If a second pose explains nearly as much, as mirrored landmarks or misread barcodes can
make it, the robot has to wait for more.
"""

from typing import Final, NamedTuple

import numpy as np

from outrider.core.angles import wrap
from outrider.typing import Bools, Floats, Ints

WINDOW: Final = 30.0  # s, over which odometry is trusted
EVERY: Final = 0.5  # s, between two attempts
FEWEST: Final = 6  # pairs that agree
SHARE: Final = 0.6  # of all pairs in the window
RIVAL: Final = 0.7  # of the best pose's pairs: with so many another pose is as likely
APART: Final = 1.0  # m, at least, between the world places of those that agree
MOST: Final = 60  # pairs that are looked at
GATE: Final = 3.0  # sigma
DRIFT: Final = 0.05  # m per m driven, of odometry within the window
CAUTION: Final = 4.0  # times the variance: records of one window are not independent, nor are partners
LEAST: Final = (0.05**2, 0.05**2, 0.03**2)  # m^2, m^2, rad^2
LARGEST: Final = (0.5, 0.15)  # m, rad: deviations of a pose that is known


class Pairs(NamedTuple):
    """Places in the world and as the robot sees them. t : (n,) s, not decreasing;  own : (n, 2) in the frame of its
    odometry;  world : (n, 2);  var : (n,) m^2;  row : (n,) of the sighting"""

    t: Floats
    own: Floats
    world: Floats
    var: Floats
    row: Ints


class Placement(NamedTuple):
    """Pose (x, y, heading) at t and its covariance; rows of the sightings that told it."""

    t: float
    pose: Floats
    P: Floats
    rows: Ints


def place(pairs: Pairs, way_t: Floats, way: Floats, after: float = -np.inf) -> Placement | None:
    """The first pose after a time [s] that enough of the pairs agree on; None if there is none.

    way : (k, 3) poses at way_t (k,) in the frame of the odometry
    """
    last, driven_by = after, _driven(way)
    for k, now in enumerate(pairs.t.tolist()):
        if now < last + EVERY or (k + 1 < pairs.t.size and pairs.t[k + 1] == now):
            continue
        last = now
        rows = np.flatnonzero((pairs.t > now - WINDOW) & (pairs.t <= now))[-MOST:]
        if rows.size < FEWEST:
            continue
        here = np.array([np.interp(now, way_t, way[:, i]) for i in range(3)])
        driven = np.interp(now, way_t, driven_by) - np.interp(pairs.t[rows], way_t, driven_by)
        var = pairs.var[rows] + (DRIFT * driven) ** 2
        found = _agreed(_seen_from(here, pairs.own[rows]), pairs.world[rows], var)
        if found is not None:
            pose, P, inside = found
            return Placement(now, pose, P, pairs.row[rows[inside]])
    return None


def _driven(way: Floats) -> Floats:
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(way[:, :2], axis=0).T))])


def _seen_from(pose: Floats, p: Floats) -> Floats:
    """(n, 2) places in the body at a pose."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    d = p - pose[:2]
    return np.column_stack([c * d[:, 0] + s * d[:, 1], c * d[:, 1] - s * d[:, 0]])


def _agreed(own: Floats, world: Floats, var: Floats) -> tuple[Floats, Floats, Bools] | None:
    """Pose, covariance, and who agrees."""
    poses = _candidates(own, world, var)
    if not len(poses):
        return None
    good = _misses(poses, own, world) < GATE**2 * var
    count = good.sum(axis=1)
    best = int(np.argmax(count))
    if count[best] < max(FEWEST, SHARE * len(own)) or _rivalled(poses, count, best):
        return None
    pose, inside, covariance = poses[best], good[best], np.eye(3)
    for _ in range(4):
        pose, covariance = _refined(pose, own[inside], world[inside], var[inside])
        inside = _misses(pose[None], own, world)[0] < GATE**2 * var
    spread = np.ptp(world[inside], axis=0).max(initial=0.0)
    sd = np.sqrt(np.diag(covariance))
    if inside.sum() < FEWEST or spread < APART or max(sd[:2]) > LARGEST[0] or sd[2] > LARGEST[1]:
        return None
    return pose, covariance * CAUTION + np.diag(LEAST), inside


def _candidates(own: Floats, world: Floats, var: Floats) -> Floats:
    """(h, 3) poses by every two pairs whose distances fit."""
    i, j = np.triu_indices(len(own), 1)
    a, b = own[j] - own[i], world[j] - world[i]
    far = np.hypot(*b.T)
    fits = (far > 0.5) & (np.abs(np.hypot(*a.T) - far) < GATE * np.sqrt(var[i] + var[j]))
    i, a, b = i[fits], a[fits], b[fits]
    turn = np.arctan2(b[:, 1], b[:, 0]) - np.arctan2(a[:, 1], a[:, 0])
    c, s = np.cos(turn), np.sin(turn)
    x = world[i, 0] - c * own[i, 0] + s * own[i, 1]
    y = world[i, 1] - s * own[i, 0] - c * own[i, 1]
    return np.column_stack([x, y, turn])


def _misses(poses: Floats, own: Floats, world: Floats) -> Floats:
    """(h, n) squared distances of what each pose makes of the robot's places to those in the world."""
    x, y, turn = poses.T[:, :, None]
    c, s = np.cos(turn), np.sin(turn)
    e_x = world[:, 0] - x - c * own[:, 0] + s * own[:, 1]
    e_y = world[:, 1] - y - s * own[:, 0] - c * own[:, 1]
    return np.asarray(e_x**2 + e_y**2, np.float64)


def _rivalled(poses: Floats, count: Ints, best: int) -> bool:
    """Whether a pose elsewhere explains nearly as many."""
    d = poses - poses[best]
    elsewhere = (np.hypot(d[:, 0], d[:, 1]) > 2.0) | (np.abs(np.sin(0.5 * d[:, 2])) > 0.3)
    return bool((count[elsewhere] >= RIVAL * count[best]).any())


def _refined(pose: Floats, own: Floats, world: Floats, var: Floats) -> tuple[Floats, Floats]:
    """One step of least squares, and the covariance."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    J = np.zeros((len(own), 2, 3))
    J[:, 0, 0] = J[:, 1, 1] = 1.0
    J[:, 0, 2], J[:, 1, 2] = -s * own[:, 0] - c * own[:, 1], c * own[:, 0] - s * own[:, 1]
    weighted = J / var[:, None, None]
    information = np.einsum("nij,nik->jk", weighted, J) + 1e-9 * np.eye(3)
    P = np.linalg.inv(information)
    made = np.column_stack([c * own[:, 0] - s * own[:, 1], s * own[:, 0] + c * own[:, 1]]) + pose[:2]
    step = P @ np.einsum("nij,ni->j", weighted, world - made)
    return np.array([pose[0] + step[0], pose[1] + step[1], wrap(float(pose[2] + step[2]))]), P
