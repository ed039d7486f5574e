"""Pure pursuit; windings, clusters and polylines around things; Dubins; bands to start from; covers of footprints."""

from dataclasses import replace

import numpy as np
import pytest
from bases import BASES, BOX, CAR, DIFFERENTIAL, MECANUM, drive, situation, teb
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import Polygon

from outrider.data.driving import LocalOutcome
from outrider.data.footprint import Footprint
from outrider.data.surroundings import DistanceField, Surroundings
from outrider.planning.local.bands import along, resumed
from outrider.planning.local.cover import cover
from outrider.planning.local.dubins import dubins
from outrider.planning.local.guide import cut, near, remaining
from outrider.planning.local.pursuit import Pursuit
from outrider.planning.local.ways import (
    AISLE,
    DEPTH,
    THIN,
    blocked,
    join,
    obstacles_near,
    same,
    signature,
    ways,
)

ELL = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 3.0]])


@pytest.mark.compiled
@pytest.mark.parametrize("base", ["differential", "mecanum"])
def test_pursuit_follows_a_bent_path_to_its_end(base: str) -> None:
    planner = Pursuit(limits=BASES[base], footprint=BOX)
    plans, poses, _ = drive(planner, situation((4.0, 3.0, 1.57), path=ELL), 30.0)
    assert plans[-1].outcome is LocalOutcome.ARRIVED
    off = np.minimum(np.abs(poses[:, 1]) + (poses[:, 0] > 4.0) * 9.0, np.abs(poses[:, 0] - 4.0))
    assert off.max() < 0.35
    assert max(planner.limits.excess(p.twist) for p in plans) <= 1.0 + 1e-9


@pytest.mark.compiled
def test_pursuit_waits_before_what_stands_on_its_path_and_says_so() -> None:
    discs = np.array([[2.5, 0.0, 0.3, 0.0, 0.0]])
    start = situation((5.0, 0.0, 0.0), surroundings=Surroundings(discs=discs))
    plans, poses, least = drive(Pursuit(limits=replace(DIFFERENTIAL, backward=0.0), footprint=BOX), start, 12.0)
    assert least > 0.0
    assert poses[-1, 0] > 1.0
    assert plans[-1].outcome is LocalOutcome.REPLAN
    assert "touches obstacle 0 at (2.50, 0.00)" in plans[-1].reason


def test_windings_are_whole_numbers_apart_and_invariant_under_deformation(rng: np.random.Generator) -> None:
    post = np.array([[2.0, 0.0, 0.1, 0.0, 0.0]])
    above, below = (np.array([[0.0, 0.0], [2.0, s], [4.0, 0.0]]) for s in (1.0, -1.0))
    gap = float((signature(above, post) - signature(below, post))[0])
    assert abs(gap) == pytest.approx(1.0)
    t = np.linspace(0.0, 1.0, 40)
    for _ in range(20):
        wild = np.column_stack([4.0 * t, np.sin(np.pi * t) * rng.uniform(0.3, 3.0)])
        wild[1:-1, 0] += rng.uniform(-0.2, 0.2)
        assert same(signature(wild, post), signature(above, post))
        assert not same(signature(wild, post), signature(below, post))


def test_things_that_nothing_fits_between_are_one(rng: np.random.Generator) -> None:
    discs = np.zeros((60, 5))
    discs[:, :2], discs[:, 2] = rng.uniform(0.0, 10.0, (60, 2)), 0.1
    from scipy.sparse.csgraph import connected_components

    apart = np.hypot(*(discs[:, None, :2] - discs[None, :, :2]).T) - 0.2
    count, labels = connected_components(apart < 0.6, directed=False)
    mine = np.empty(60, np.int64)
    assert join(discs, 0.6, mine) == count
    for k in range(count):
        assert len(set(mine[labels == k])) == 1
    assert len(set(mine)) == count


def test_both_sides_of_a_post_and_all_sides_of_two() -> None:
    straight = np.array([[0.0, 0.0], [6.0, 0.0]])
    post = np.array([[3.0, 0.1, 0.2, 0.0, 0.0]])
    assert len(ways(straight, post, 0.3, 0.1, 4)) == 2
    two = np.vstack([post, [[3.0, 2.0, 0.2, 0.0, 0.0]]])
    found = ways(straight, two, 0.3, 0.1, 4)
    assert len(found) >= 2
    marks = [signature(way, two) for way in found]
    assert not any(same(marks[i], marks[j]) for i in range(len(marks)) for j in range(i))
    lengths = [np.hypot(*np.diff(way, axis=0).T).sum() for way in found]
    assert lengths == sorted(lengths)
    assert len(ways(straight, post[:0], 0.3, 0.1, 4)) == 1


def plain_ways(guide, discs, inscribed: float, gap: float, most: int) -> list[np.ndarray]:
    """The search in words of a list: the shortest polyline first, around what blocks it on both sides."""
    labels = np.empty(len(discs), np.int64)
    join(discs, 2.0 * inscribed, labels)
    open_, out = [(0.0, guide, 0)], []
    while open_ and len(out) < most:
        open_.sort(key=lambda way: way[0])
        _, path, depth = open_.pop(0)
        piece, which, _ = blocked(path, discs, inscribed)
        if which < 0 and not any(same(signature(path, discs), signature(other, discs)) for other in out):
            out.append(path)
        for side in (1.0, -1.0) if which >= 0 and depth < DEPTH else ():
            group, a, b = discs[labels == labels[which]], path[piece], path[piece + 1]
            n = side * np.array([a[1] - b[1], b[0] - a[0]]) / max(np.hypot(*(b - a)), 1e-6)
            k = int(np.argmax((group[:, :2] - a) @ n + group[:, 2]))
            corner = group[k, :2] + n * (group[k, 2] + inscribed + gap)
            if min(np.hypot(*(corner - a)), np.hypot(*(corner - b))) > 1e-3:
                around = np.insert(path, piece + 1, corner, axis=0)
                open_.append((np.hypot(*np.diff(around, axis=0).T).sum(), around, depth + 1))
    return out


@pytest.mark.parametrize("seed", range(12))
def test_the_ways_of_a_plain_search(seed: int) -> None:
    rng = np.random.default_rng(seed)
    discs = np.zeros((rng.integers(0, 14), 5))
    discs[:, :2], discs[:, 2] = (
        rng.uniform((0.5, -1.5), (5.5, 1.5), (len(discs), 2)),
        rng.uniform(0.05, 0.3, len(discs)),
    )
    guide = np.array([[0.0, 0.0], [2.0, rng.uniform(-0.5, 0.5)], [6.0, 0.0]])
    mine, plain = (search(guide, discs, 0.3, 0.15, 4) for search in (ways, plain_ways))
    assert len(mine) == len(plain)
    for a, b in zip(mine, plain, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-9)


def test_one_point_stands_for_every_square_of_the_map(rng: np.random.Generator) -> None:
    taken = rng.random((90, 110)) < 0.1
    field = DistanceField(distances=np.where(taken, 0.0, 1.0), resolution=0.1, origin=np.array([-3.0, -2.0]))
    guide = np.array([[1.0, 1.0], [2.0, 1.5]])
    inside = np.zeros_like(taken)
    low, high = guide.min(axis=0) - AISLE, guide.max(axis=0) + AISLE
    (c0, r0), (c1, r1) = (
        cells.astype(int) for cells in (np.floor((low - field.origin) / 0.1), np.ceil((high - field.origin) / 0.1))
    )
    inside[max(r0, 0) : r1, max(c0, 0) : c1] = True
    row, col = np.nonzero(taken & inside)
    k = int(THIN / 0.1)
    _, first = np.unique(np.stack([row // k, col // k]), axis=1, return_index=True)
    expected = np.column_stack([-3.0 + 0.1 * (col[first] + 0.5), -2.0 + 0.1 * (row[first] + 0.5)])
    near = ((expected >= low) & (expected <= high)).all(axis=1)
    expected = expected[near]
    middle = np.hypot(*(expected - guide.mean(axis=0)).T)
    expected = expected[np.sort(np.argsort(middle, kind="stable")[:120])]
    np.testing.assert_allclose(obstacles_near(guide, np.empty((0, 5)), field, 1.0)[:, :2], expected)


@given(goal=st.tuples(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(-3.0, 3.0)))
@settings(max_examples=100)
def test_dubins_arrives_and_bends_no_more_than_its_radius(goal: tuple[float, float, float]) -> None:
    z = dubins(np.zeros(3), np.array(goal), 1.2, 0.05)
    np.testing.assert_allclose(z[-1, :2], goal[:2], atol=1e-6)
    assert abs(np.sin(0.5 * (z[-1, 2] - goal[2]))) < 1e-6
    d = np.diff(z, axis=0)
    length = np.hypot(d[:, 0], d[:, 1])
    assert (np.abs(d[:, 2]) * 1.2 <= length * 1.01 + 1e-9).all()
    assert length.sum() >= np.hypot(*goal[:2]) - 1e-9


def test_dubins_of_the_book() -> None:
    """Half a turn to the side: two quarter circles make pi r."""
    z = dubins(np.zeros(3), np.array([0.0, 2.0, np.pi]), 1.0, 0.01)
    assert np.hypot(*np.diff(z[:, :2], axis=0).T).sum() == pytest.approx(np.pi, rel=1e-4)


@pytest.mark.parametrize("limits", [DIFFERENTIAL, MECANUM, CAR])
def test_a_first_band_keeps_the_limits_nearly(limits) -> None:
    z = along(ELL, situation((4.0, 3.0, 1.57)), limits, 0.2, 240)
    d, T = np.diff(z[:, :3], axis=0), np.diff(z[:, 3])
    assert (T > 0.0).all()
    m = z[:-1, 2] + 0.5 * d[:, 2]
    ux = (np.cos(m) * d[:, 0] + np.sin(m) * d[:, 1]) / T
    uy = (np.cos(m) * d[:, 1] - np.sin(m) * d[:, 0]) / T
    for u in np.column_stack([ux, uy if limits is MECANUM else 0.0 * uy, d[:, 2] / T]):
        assert limits.excess(u) < 1.15
    np.testing.assert_allclose(z[-1, :3], [4.0, 3.0, 1.57])


def test_a_band_is_taken_up_where_the_robot_is() -> None:
    now = situation((2.0, 0.0, 0.0))
    z = along(np.array([[0.0, 0.0], [2.0, 0.0]]), now, MECANUM, 0.2, 240)
    later = replace(now, pose=np.array([0.01, 0.02, 0.0]), time=0.1)
    out = resumed(z, 0.1, later)
    assert out is not None
    np.testing.assert_allclose(out[0], [0.01, 0.02, 0.0, 0.0])
    assert out[-1, 3] == pytest.approx(z[-1, 3] - 0.1)
    assert resumed(z, 0.1, replace(later, pose=np.array([0.0, 2.0, 0.0]))) is None
    assert resumed(z, 99.0, later) is None
    assert resumed(z, 0.1, replace(later, goal=np.array([2.0, 2.0, 0.0]))) is None


def test_what_is_left_of_a_path_and_how_far_it_is_looked_at() -> None:
    np.testing.assert_allclose(remaining(ELL, np.array([1.0, 0.5])), [[1.0, 0.0], [4.0, 0.0], [4.0, 3.0]])
    part, goes_on = cut(ELL, 5.0)
    assert goes_on
    np.testing.assert_allclose(part[-1], [4.0, 1.0])
    here = near(situation((4.0, 3.0, 0.0), path=ELL), 6.0)
    assert here.through
    np.testing.assert_allclose(here.goal, [4.0, 2.0, 0.5 * np.pi], atol=1e-9)


@pytest.mark.parametrize(
    "footprint", [BOX, Footprint.circle(0.4), Footprint.capsule(0.5, 0.2, 0.3), Footprint.rectangle(0.4, 1.1)]
)
def test_the_discs_hold_the_footprint(footprint: Footprint) -> None:
    from shapely import LineString, Point, union_all

    p = footprint.outline
    bare = Point(p[0]) if len(p) == 1 else LineString(p) if len(p) == 2 else Polygon(p)
    discs = union_all([Point(x, y).buffer(r * 1.0001, 256) for x, y, r in cover(footprint)])
    assert discs.covers(bare.buffer(footprint.radius) if len(p) < 3 else bare)


@pytest.mark.compiled
def test_long_paths_are_driven_in_pieces() -> None:
    path = np.array([[0.0, 0.0], [8.0, 0.0], [8.0, 8.0]])
    plans, poses, _ = drive(teb(DIFFERENTIAL, reach=4.0), situation((8.0, 8.0, 1.57), path=path), 40.0)
    assert plans[-1].outcome is LocalOutcome.ARRIVED
    assert 0.1 * len(plans) < 16.0 / 0.8 * 1.25
    assert poses[:, 0].max() < 8.6
