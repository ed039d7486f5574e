"""Beams against shapely in the plane, and against marched solids in space."""

from math import cos, inf, pi, sin

import numpy as np
import pytest
import shapely
from numpy.testing import assert_allclose
from test_flat import occupied_squares, star

from outrider.core import rays, solids
from outrider.core.flat import free_squares


def first(shape: shapely.Geometry, x: float, y: float, angle: float, reach: float) -> float:
    """Range by an independent library."""
    beam = shapely.LineString([(x, y), (x + reach * cos(angle), y + reach * sin(angle))])
    met = beam.intersection(shape)
    return inf if met.is_empty else shapely.Point(x, y).distance(met)


@pytest.mark.parametrize(("share", "least"), [(0.005, 10), (0.05, 60), (0.4, 60)])
def test_grids_against_shapely(share: float, least: int, rng) -> None:
    hits = 0
    for _ in range(6):
        rows, cols = rng.integers(20, 60, 2)
        occupied = rng.random((rows, cols)) < share
        occupied[rows // 2, cols // 2] = True
        west, south, side = rng.uniform(-5, 5), rng.uniform(-5, 5), rng.uniform(0.05, 0.5)
        shape, free = occupied_squares(occupied, west, south, side), free_squares(occupied)
        for x, y in [west, south] + rng.uniform(-0.2, 1.2, (40, 2)) * side * np.array([cols, rows]):
            angle, reach = rng.uniform(-pi, pi), side * rng.uniform(1.0, 60.0)
            expected = first(shape, x, y, angle, reach)
            hits += expected < inf
            beam = (x, y, 0.5, cos(angle), sin(angle), 0.0)
            assert rays.cast_grid(free, west, south, side, 2.0, *beam, reach) == pytest.approx(expected, abs=1e-9)
    assert hits > least


def test_along_the_axes_and_from_the_lines_between_cells() -> None:
    occupied = np.zeros((9, 9), np.bool_)
    occupied[0, :] = occupied[8, :] = occupied[:, 0] = occupied[:, 8] = True
    free = free_squares(occupied)
    for at in (4.0, 4.5):
        for k in range(4):
            d = (round(cos(k * pi / 2)), round(sin(k * pi / 2)))
            expected = 8.0 - at if sum(d) > 0 else at - 1.0
            assert rays.cast_grid(free, 0.0, 0.0, 1.0, 2.0, at, at, 1.0, *d, 0.0, 20.0) == expected


def test_no_beam_slips_between_two_cells_that_meet_at_a_corner() -> None:
    for mirrored in (False, True):
        occupied = np.array([[False, True, False], [True, False, False], [False, False, False]])
        free = free_squares(occupied[:, ::-1] if mirrored else occupied)
        start, d = ((2.5, 0.5), (-(0.5**0.5), 0.5**0.5)) if mirrored else ((0.5, 0.5), (0.5**0.5, 0.5**0.5))
        t = rays.cast_grid(free, 0.0, 0.0, 1.0, 2.0, *start, 1.0, *d, 0.0, 20.0)
        assert t == pytest.approx(0.5**0.5)


def test_large_empty_spaces_are_crossed_exactly(rng) -> None:
    occupied = np.zeros((700, 700), np.bool_)
    occupied[[3, 690, 350], [650, 20, 699]] = True
    free = free_squares(occupied)
    for row, col in np.argwhere(occupied):
        for _ in range(20):
            aim, o = np.array([col, row]) + rng.uniform(0.1, 0.9, 2), rng.uniform(300, 400, 2)
            d = (aim - o) / np.linalg.norm(aim - o)
            shape = shapely.box(col, row, col + 1, row + 1)
            expected = first(shape, *o, np.arctan2(d[1], d[0]), 1000.0)
            assert rays.cast_grid(free, 0.0, 0.0, 1.0, 1.0, *o, 0.5, *d, 0.0, 1000.0) == pytest.approx(
                expected, abs=1e-8
            )


def test_polygons_against_shapely(rng) -> None:
    hits = 0
    for _ in range(40):
        outline = star(rng)
        shape = shapely.Polygon(outline)
        for x, y in rng.uniform(-4, 4, (10, 2)):
            angle, reach = rng.uniform(-pi, pi), rng.uniform(0.5, 8.0)
            expected = first(shape, x, y, angle, reach)
            hits += 0.0 < expected < inf
            beam = (x, y, 0.5, cos(angle), sin(angle), 0.0)
            t = rays.cast_prism(outline, 0, len(outline), 0.0, 2.0, *beam, reach)
            assert t == pytest.approx(expected, abs=1e-9)
    assert hits > 50


def test_through_the_very_corner_of_a_polygon() -> None:
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    for turn in range(4):
        outline = np.ascontiguousarray(np.roll(square, turn, axis=0))
        t = rays.cast_prism(outline, 0, 4, 0.0, 2.0, -1.0, -1.0, 1.0, 0.5**0.5, 0.5**0.5, 0.0, 5.0)
        assert t == pytest.approx(2.0**0.5)


def test_upright_shapes_are_solids_in_space(rng) -> None:
    """A rectangle is a box, a column a cylinder, an occupied cell a box without a floor."""
    square = np.array([[-1.0, -0.5], [1.0, -0.5], [1.0, 0.5], [-1.0, 0.5]])
    box, deep = solids.box([0, 0, 1], [2, 1, 2])[None], solids.box([0.5, 0.5, -48.5], [1, 1, 100])[None]
    round_one = solids.cylinder([0, 0, 0], [0, 0, 2], 0.7)[None]
    free, hits = free_squares(np.pad(np.ones((1, 1), np.bool_), 2)), np.zeros(3)
    for _ in range(300):
        o = rng.uniform([-4, -4, -1], [4, 4, 4])
        aim = rng.uniform(-1, 1.5, 3) - o
        beam, reach = (*o, *(aim / np.linalg.norm(aim))), rng.uniform(2.0, 9.0)
        pairs = (
            (rays.cast_prism(square, 0, 4, 0.0, 2.0, *beam, reach), solids.cast(box, *beam, reach)),
            (rays.cast_column(0.0, 0.0, 0.7, 0.0, 2.0, *beam, reach), solids.cast(round_one, *beam, reach)),
            (rays.cast_grid(free, -2.0, -2.0, 1.0, 1.5, *beam, reach), solids.cast(deep, *beam, reach)),
        )
        for t, expected in pairs:
            assert t == pytest.approx(expected, abs=1e-7)
        hits += [0.0 < t < inf for t, _ in pairs]
    assert (hits > 50).all()


def test_straight_down() -> None:
    square, free = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]), free_squares(np.ones((1, 1), np.bool_))
    for x, expected in ((0.5, 3.0), (1.5, inf)):
        down = (x, 0.4, 5.0, 0.0, 0.0, -1.0)
        assert rays.cast_prism(square, 0, 4, 0.0, 2.0, *down, 9.0) == expected
        assert rays.cast_grid(free, 0.0, 0.0, 1.0, 2.0, *down, 9.0) == expected
        assert rays.cast_column(0.5, 0.5, 0.5, 0.0, 2.0, *down, 9.0) == expected
        assert rays.cast_ground(0.0, 0.0, *down, 9.0) == 5.0


def test_ground(rng) -> None:
    for _ in range(50):
        slope, o, d = rng.uniform(-0.2, 0.2, 2), rng.uniform([-5, -5, 4], [5, 5, 14]), rng.normal(size=3)
        d /= np.linalg.norm(d)
        t = rays.cast_ground(*slope, *o, *d, 50.0)
        normal = np.array([-slope[0], -slope[1], 1.0])
        if t < inf:
            assert_allclose(normal @ (o + t * d), 0.0, atol=1e-9)
        else:
            assert normal @ (o + 50.0 * d) > 0.0
    assert rays.cast_ground(0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, -1.0, 9.0) == inf  # nothing to meet from below
