"""Distances in the plane against shapely, and upright shapes against solids."""

import numpy as np
import pytest
import shapely

from outrider.core import flat, solids


def star(rng: np.random.Generator) -> np.ndarray:
    """A polygon that does not cross itself, either way round."""
    n = int(rng.integers(4, 12))
    turn = (np.arange(n) + rng.uniform(0.0, 0.9, n)) * (2.0 * np.pi / n)
    outline = np.column_stack([np.cos(turn), np.sin(turn)]) * rng.uniform(0.5, 3.0, (n, 1))
    return np.ascontiguousarray(outline[::-1] if rng.random() < 0.5 else outline)


def test_polygons(rng) -> None:
    sides = []
    for _ in range(40):
        outline = star(rng)
        packed = np.vstack([rng.normal(size=(5, 2)), outline, rng.normal(size=(3, 2))])  # between other polygons
        shape = shapely.Polygon(outline)
        for x, y in rng.uniform(-3, 3, (15, 2)):
            here = shapely.Point(x, y)
            sign = -1.0 if shape.contains(here) else 1.0
            sides.append(sign)
            d = flat.polygon_distance(packed, 5, len(outline), x, y)
            assert d == pytest.approx(sign * shape.exterior.distance(here), abs=1e-12)
    assert 50 < sides.count(-1.0) < 550


def occupied_squares(occupied: np.ndarray, west: float, south: float, side: float) -> shapely.Geometry:
    rows, cols = np.nonzero(occupied)
    x, y = west + np.arange(occupied.shape[1] + 1) * side, south + np.arange(occupied.shape[0] + 1) * side
    return shapely.union_all(shapely.box(x[cols], y[rows], x[cols + 1], y[rows + 1]))  # neighbours share their edges


@pytest.mark.parametrize("share", [0.02, 0.3, 0.9, 1.0])
def test_grids(share: float, rng) -> None:
    for _ in range(6):
        rows, cols = rng.integers(3, 25, 2)
        occupied = rng.random((rows, cols)) < share
        occupied[rng.integers(rows), rng.integers(cols)] = True
        west, south, side = rng.uniform(-5, 5), rng.uniform(-5, 5), rng.uniform(0.05, 2.0)
        shape, run = occupied_squares(occupied, west, south, side), flat.runs(occupied)
        size = side * np.array([cols, rows])
        for x, y in [west, south] + rng.uniform(-0.3, 1.3, (30, 2)) * size:
            here = shapely.Point(x, y)
            sign = -1.0 if shape.contains(here) else 1.0
            expected = sign * shape.boundary.distance(here)
            assert flat.grid_distance(occupied, run, west, south, side, x, y) == pytest.approx(expected, abs=1e-9)


def test_an_empty_grid_is_infinitely_far() -> None:
    free = np.zeros((4, 5), np.bool_)
    assert flat.grid_distance(free, flat.runs(free), 0.0, 0.0, 1.0, 2.5, 2.5) == np.inf
    assert flat.upright(np.inf, 0.0, 2.0, 5.0) == np.inf
    assert (flat.free_squares(free) == 255).all()


def test_free_squares_are_free_and_as_large_as_can_be(rng) -> None:
    occupied = rng.random((30, 40)) < 0.03
    free = flat.free_squares(occupied)
    padded = np.pad(occupied, 40)
    for row in range(30):
        for col in range(40):
            n = int(free[row, col])
            at = padded[row + 40 - n : row + 41 + n, col + 40 - n : col + 41 + n]
            assert at.any()
            assert n == 0 or not at[1:-1, 1:-1].any()


def test_an_upright_rectangle_is_a_box(rng) -> None:
    centre, size = np.array([1.0, -2.0, 1.5]), np.array([2.0, 1.0, 3.0])
    corners = centre[:2] + 0.5 * size[:2] * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    for x, y, z in centre + rng.uniform(-3, 3, (200, 3)):
        d = flat.upright(flat.polygon_distance(corners, 0, 4, x, y), 0.0, 3.0, z)
        assert d == pytest.approx(solids.distance(solids.box(centre, size)[None], x, y, z)[0], abs=1e-12)
