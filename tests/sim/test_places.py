"""The places are what their descriptions say."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from outrider.core import solids
from outrider.sim.places import (
    BEND_TARGETS,
    LEGS,
    LOOP_TARGETS,
    PASSAGE_TARGETS,
    amr_bend,
    amr_loop,
    amr_passage,
    city_block,
    open_field,
    parked_airliner,
)

PLACES = [open_field, parked_airliner, amr_passage, amr_bend, amr_loop, city_block]


@pytest.mark.parametrize("place", PLACES)
def test_every_place_is_possible_and_has_room_at_its_origin(place) -> None:
    world = place()
    world.validate()
    assert world.name
    assert world.clearance(np.array([[0.0, 0.0, 0.5]]))[0] > 0.9


@pytest.mark.parametrize(("sharklets", "span"), [(False, 34.1), (True, 35.8)])
def test_the_airliner_has_the_size_of_an_a320(sharklets: bool, span: float) -> None:
    """Measured from far away along each axis: the distance field ends where the aircraft does."""
    world, far = parked_airliner(sharklets=sharklets), 1e7
    eye = np.vstack([-far * np.eye(3), far * np.eye(3)])
    low, high = np.split((far - world.clearance(eye)) * [-1, -1, -1, 1, 1, 1], 2)
    assert_allclose(high - low, [span, 37.57, 11.76], rtol=0, atol=0.01)
    assert_allclose(low, [-0.5 * span, 1.0, 0.0], rtol=0, atol=0.001)
    assert_allclose(solids.extent(world.solids.table), [low, high], rtol=0, atol=1e-3)


def test_the_airliner_stands_on_three_legs_nose_towards_the_origin() -> None:
    """North-east-down of the paper: x is north, y is east. Legs 5.07 m and 17.71 m behind the nose at x = 1 m."""
    world = parked_airliner()
    body = world.objects["airliner"]
    feet, up = np.array([body.feature(name) for name in LEGS]), np.array([0.0, 0.0, 0.3])
    assert_allclose(feet, [[0, 6.07, 0], [3.795, 18.71, 0], [-3.795, 18.71, 0]], atol=1e-12)
    assert world.nearest(feet + up) == LEGS
    assert (world.clearance(feet + up) < 0.0).all()
    under, beside = np.array([[0.0, 12.0, 1.0]]), np.array([[0.0, 12.0, 3.75]])
    assert world.clearance(under)[0] == pytest.approx(0.775)  # between ground and belly
    assert world.clearance(beside)[0] == pytest.approx(-1.975)  # on the axis
    assert "fuselage" in world.nearest(np.vstack([under, beside]))


def test_the_airliner_is_symmetric(rng) -> None:
    world, p = parked_airliner(sharklets=True), rng.uniform([0, -1, 0], [20, 40, 13], (300, 3))
    assert_allclose(world.clearance(p), world.clearance(p * [-1, 1, 1]), rtol=0, atol=1e-12)


def test_wings_hide_what_stands_behind_them() -> None:
    world = parked_airliner()
    below, above = np.array([[9.0, 19.0, 0.5]]), np.array([[9.0, 19.0, 8.0]])
    assert not world.sees(below, above)[0]
    aside = np.array([12.0, 0.0, 0.0])
    assert world.sees(below + aside, above + aside)[0]
    assert not world.sees(np.array([[-6.0, 15.0, 3.5]]), np.array([[6.0, 15.0, 3.5]]))[0]  # through the fuselage


def test_the_open_field_ends_at_its_fence() -> None:
    fence = open_field(100.0, ceiling=30.0).fence
    assert fence is not None
    assert_allclose(fence.margin(np.array([[0, 0, 1], [60, 0, 1], [0, 0, 31.0]])), [29, -10, -1])


def tour(world, targets, spacing: float, room: float) -> float:
    """Length of the shortest way from the origin over all targets on a lattice, at least `room` from everything."""
    low = np.floor(world.grid.origin)
    cols, rows = ((world.grid.resolution * np.array(world.grid.cells.shape[::-1])) / spacing).astype(int) + 2
    u, v = np.meshgrid(np.arange(cols), np.arange(rows))
    p = np.column_stack([low[0] + u.ravel() * spacing, low[1] + v.ravel() * spacing, np.full(u.size, 0.5)])
    free = (world.clearance(p) > room).reshape(rows, cols)
    number, start, end, cost = np.arange(u.size).reshape(rows, cols), [], [], []
    for right, up in ((1, 0), (0, 1), (1, 1), (-1, 1), (2, 1), (1, 2), (-1, 2), (-2, 1)):  # a knight's moves too
        to, here = np.roll(number, (-up, -right), axis=(0, 1)), free & np.roll(free, (-up, -right), axis=(0, 1))
        here &= (u + right >= 0) & (u + right < cols) & (v + up < rows)
        (
            start.append(number[here]),
            end.append(to[here]),
            cost.append(np.full(here.sum(), spacing * np.hypot(right, up))),
        )
    edges = coo_array((np.concatenate(cost), (np.concatenate(start), np.concatenate(end))), shape=(u.size, u.size))
    stops = [int(np.argmin(np.hypot(p[:, 0] - x, p[:, 1] - y))) for x, y in [(0.0, 0.0), *targets]]
    ways = dijkstra(edges.tocsr(), directed=False, indices=stops[:-1])
    return float(sum(way[stop] for way, stop in zip(ways, stops[1:], strict=True)))


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("place", "targets", "printed"),
    [
        (amr_passage, PASSAGE_TARGETS, 90.1),
        (amr_bend, BEND_TARGETS, 46.44),
        (amr_loop, LOOP_TARGETS, 199.98),
    ],
)
def test_tours_are_about_as_long_as_printed(place, targets, printed: float) -> None:
    """amr2025, table 4, "expected length"; its maps are not published, so to a tenth."""
    world = place()
    assert (world.clearance(np.array([[x, y, 0.5] for x, y in targets])) > 0.9).all()
    assert tour(world, targets, 0.25, 0.6) == pytest.approx(printed, rel=0.1)


def test_the_passage_is_two_metres_wide_and_the_road_a_hundred_long() -> None:
    aisle = np.column_stack([np.linspace(-10.5, 8.5, 20), np.full(20, -7.0), np.full(20, 0.5)])
    assert_allclose(amr_passage().clearance(aisle), 1.0, atol=1e-9)
    up, along = np.array([0.0, 0.0, 0.70710678, 0.70710678]), np.array([0.0, np.pi])
    loop = amr_loop()
    assert loop.scan(np.array([-2.0, 0.0, 0.5]), up, along, 150.0).sum() == pytest.approx(102.0)
    cells = loop.grid.cell_of(np.array([wall.outline.mean(axis=0) for wall in loop.walls]))
    assert not loop.grid.occupied[tuple(cells.T)].any()  # on no map


def test_traffic_in_the_city_keeps_clear(rng) -> None:
    world = city_block()
    for mover in world.movers:
        rest = replace(world, movers=tuple(m for m in world.movers if m.name != mover.name))
        t = np.linspace(0.0, 90.0, 120)
        p = mover.at(t) + np.array([0.0, 0.0, 0.5 * mover.height])
        assert (rest.clearance(p, t) > mover.radius).all(), mover.name
        assert (world.fence.margin(p) > 0.0).all()
