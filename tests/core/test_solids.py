"""Signed distances of solids against hulls and balls computed elsewhere, and the laws that every distance obeys."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import nnls
from scipy.spatial import ConvexHull

from outrider.core import solids
from outrider.core.attitudes import quats_to_matrices
from outrider.errors import ConfigError
from outrider.sim.places import airliner


def rotation(rng: np.random.Generator) -> np.ndarray:
    q = rng.normal(size=(1, 4))
    return quats_to_matrices(q / np.linalg.norm(q))[0]


def plate(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A row and its eight corners, written down independently."""
    R, at = rotation(rng), rng.uniform(-2, 2, 3)
    span, root, tip, thick, thin = rng.uniform(0.1, 3.0, 5)
    back = rng.uniform(-2.0, 2.0)
    row = solids.plate(at, R[:, 0], R[:, 1], span=span, chords=(root, tip), back=back, thickness=(thick, thin))
    own = [[x, 0.0, z] for x in (0.0, -root) for z in (-thick / 2, thick / 2)]
    own += [[-back - x, span, z] for x in (0.0, tip) for z in (-thin / 2, thin / 2)]
    return row, at + np.array(own) @ R.T


def box(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    R, at, size = rotation(rng), rng.uniform(-2, 2, 3), rng.uniform(0.1, 3.0, 3)
    corners = np.array(np.meshgrid(*[[-0.5, 0.5]] * 3)).reshape(3, 8).T * size
    return solids.box(at, size, R), at + corners @ R.T


def outside_by_hull(p: np.ndarray, corners: np.ndarray) -> float:
    """Distance from the hull of points: the best convex combination, by non-negative least squares."""
    heavy = 1e4
    A = np.vstack([corners.T - p[:, None], np.full(len(corners), heavy)])
    weights, _ = nnls(A, np.array([0.0, 0.0, 0.0, heavy]))
    return float(np.linalg.norm((corners.T - p[:, None]) @ (weights / weights.sum())))


@pytest.mark.parametrize("make", [plate, box])
def test_polyhedra_against_their_hulls(make, rng) -> None:
    sides = []
    for _ in range(25):
        row, corners = make(rng)
        faces = ConvexHull(corners).equations
        for p in np.vstack([rng.uniform(-4, 4, (20, 3)), rng.dirichlet(np.ones(8), 20) @ corners]):
            depth = (faces[:, :3] @ p + faces[:, 3]).max()  # exact inside, a lower bound outside
            expected = depth if depth < 0.0 else outside_by_hull(p, corners)
            assert solids.distance(row[None], *p) == (pytest.approx(expected, abs=2e-7), 0)
            sides.append(depth < 0.0)
    assert 100 < sum(sides) < len(sides) - 100


def test_tapered_capsules_are_unions_of_balls(rng) -> None:
    s = np.linspace(0.0, 1.0, 20001)[:, None]
    sides = []
    for _ in range(30):
        a, b = rng.uniform(-2, 2, (2, 3))
        r_a, r_b = rng.uniform(0.1, 1.0, 2)
        if np.linalg.norm(b - a) <= abs(r_a - r_b):
            continue
        row = solids.tapered(a, b, r_a, r_b)[None]
        for p in np.vstack([rng.uniform(-4, 4, (10, 3)), a + rng.uniform(0, 1, (10, 1)) * (b - a)]):
            balls = np.linalg.norm(p - a - s * (b - a), axis=1) - (r_a + s[:, 0] * (r_b - r_a))
            d, _ = solids.distance(row, *p)
            sides.append(d < 0.0)
            assert (d < 0.0) == (balls.min() < 0.0)
            if d >= 0.0:
                assert d == pytest.approx(balls.min(), abs=1e-6)
            else:  # no deeper than the surface of the largest ball around that is all within
                assert d <= balls.min() + 1e-9
    assert 50 < sum(sides) < len(sides) - 50


def test_cylinders_against_a_prism_of_many_sides(rng) -> None:
    turn = np.linspace(0.0, 2.0 * np.pi, 1440, endpoint=False)
    ring = np.column_stack([np.cos(turn), np.sin(turn)])
    for _ in range(6):
        radius, height = rng.uniform(0.3, 2.0, 2)
        own = np.vstack([np.column_stack([radius * ring, np.full(1440, z)]) for z in (0.0, height)])
        R, at = rotation(rng), rng.uniform(-1, 1, 3)
        row = solids.cylinder(at, at + height * R[:, 2], radius)[None]
        for u in rng.uniform(-3, 3, (10, 3)):
            d, _ = solids.distance(row, *(at + R @ u))
            side, level = np.hypot(u[0], u[1]) - radius, max(-u[2], u[2] - height)
            if max(side, level) < 0.0:
                assert d == pytest.approx(max(side, level), abs=1e-9)
            else:
                assert d == pytest.approx(outside_by_hull(u, own), abs=1e-5)


@pytest.fixture(scope="module")
def aircraft() -> np.ndarray:
    return airliner(sharklets=True).table


def around(rng: np.random.Generator, n: int) -> np.ndarray:
    """Points in and about the airliner."""
    return rng.uniform([-42.0, -20.0, -1.0], [4.0, 20.0, 14.0], (n, 3))


def distances(table: np.ndarray, p: np.ndarray) -> np.ndarray:
    return np.array([solids.distance(table, *row)[0] for row in p])


def test_no_distance_changes_faster_than_the_way(rng, aircraft) -> None:
    p = around(rng, 400)
    step = rng.normal(size=p.shape) * rng.uniform(0.001, 3.0, (400, 1))
    change = np.abs(distances(aircraft, p + step) - distances(aircraft, p))
    assert (change <= np.linalg.norm(step, axis=1) * (1.0 + 1e-9)).all()
    assert (change > 0.8 * np.linalg.norm(step, axis=1)).any()  # the bound is used


def test_the_gradient_is_a_unit_vector_towards_the_surface(rng, aircraft) -> None:
    g, outside = np.empty(3), 0
    for p in around(rng, 200):
        d, _ = solids.distance(aircraft, *p)
        solids.gradient(aircraft, *p, g)
        assert np.linalg.norm(g) == pytest.approx(1.0, abs=1e-6)
        if d > 0.0:
            outside += 1
            assert distances(aircraft, (p - d * g)[None])[0] == pytest.approx(0.0, abs=1e-6)
    assert outside > 150


def test_a_beam_ends_where_the_distance_is_zero_and_not_later(rng, aircraft) -> None:
    hits = 0
    for o in around(rng, 150):
        aim = around(rng, 1)[0] * [1.0, 0.3, 0.6]
        d = (aim - o) / np.linalg.norm(aim - o)
        t = solids.cast(aircraft, *o, *d, 60.0)
        if distances(aircraft, o[None])[0] <= 0.0:
            assert t == 0.0
            continue
        way = np.linspace(0.0, min(t, 60.0) - 1e-6, 150)
        assert (distances(aircraft, o + way[:, None] * d) > 0.0).all()
        if t < np.inf:
            hits += 1
            assert distances(aircraft, (o + t * d)[None])[0] == pytest.approx(0.0, abs=2e-9)
            assert solids.cast(aircraft, *o, *d, t - 1e-6) == np.inf
    assert 40 < hits < 140


def test_the_nearest_of_many_is_the_nearest_of_all_taken_singly(rng, aircraft) -> None:
    for p in around(rng, 60):
        each = [solids.distance_one(aircraft, k, *p) for k in range(len(aircraft))]
        assert solids.distance(aircraft, *p) == (min(each), int(np.argmin(each)))


def test_carried_solids_keep_their_distances(rng, aircraft) -> None:
    R, at = rotation(rng), rng.uniform(-100, 100, 3)
    p = around(rng, 100)
    assert_allclose(distances(solids.moved(aircraft, at, R), at + p @ R.T), distances(aircraft, p), rtol=0, atol=1e-11)


def test_extent_is_what_a_far_observer_measures(rng) -> None:
    """Seen from far away along an axis, the distance is the way to the outermost point."""
    rows = [plate(rng)[0], box(rng)[0], solids.tapered([0, 0, 0], [1, 2, 0.5], 0.7, 0.2)]
    rows.append(solids.cylinder([0, 0, 0], [0.3, -1.0, 2.0], 0.8))
    far = 1e7
    for row in rows:
        for axis in range(3):
            for sign, bound in ((-1.0, 0), (1.0, 1)):
                p = np.zeros(3)
                p[axis] = sign * far
                reach = far - solids.distance(row[None], *p)[0]
                assert sign * solids.extent(row[None])[bound, axis] == pytest.approx(reach, abs=1e-5)
    assert_allclose(solids.extent(np.array(rows))[0], np.min([solids.extent(r[None])[0] for r in rows], axis=0))
    assert np.isnan(solids.extent(np.zeros((0, solids.COLUMNS)))).all()


def test_nothing_is_infinitely_far() -> None:
    nothing, g = np.zeros((0, solids.COLUMNS)), np.ones(3)
    assert solids.distance(nothing, 0.0, 0.0, 0.0) == (np.inf, -1)
    assert solids.cast(nothing, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 10.0) == np.inf
    solids.gradient(nothing, 0.0, 0.0, 0.0, g)
    assert (g == 0.0).all()


def test_impossible_solids_are_refused() -> None:
    for make in (
        lambda: solids.capsule([0, 0, 0], [0, 0, 1], -0.1),
        lambda: solids.tapered([0, 0, 0], [0, 0, 0.5], 1.0, 0.4),
        lambda: solids.box([0, 0, 0], [1, 0, 1]),
        lambda: solids.box([0, np.nan, 0], [1, 1, 1]),
        lambda: solids.cylinder([1, 1, 1], [1, 1, 1], 0.5),
        lambda: solids.plate([0, 0, 0], [1, 0, 0], [1, 0, 0], span=1, chords=(1, 1), back=0, thickness=(1, 1)),
        lambda: solids.plate([0, 0, 0], [1, 0, 0], [0, 1, 0], span=1, chords=(1, 1), back=0, thickness=(1, -1)),
    ):
        with pytest.raises(ConfigError):
            make()
