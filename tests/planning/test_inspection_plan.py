"""Inspection: points on surfaces against exact areas, sight, ways against dense sampling, whole plans."""

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.core.solids import box, capsule, distance
from outrider.errors import ConfigError
from outrider.planning.inspection import Body, Camera, Half, Pace, Places, Task, halves, inspect, seen, surface
from outrider.planning.inspection.surface import Surface
from outrider.planning.inspection.timing import TimedPath, timed
from outrider.planning.inspection.tours import tour_length, two_opt

BOX = box((0.0, 0.0, 3.0), (4.0, 3.0, 2.0))


@pytest.mark.compiled
def test_areas_are_those_of_the_formulas():
    boxes, round_one = np.array([BOX]), np.array([capsule((0, 0, 0), (0, 0, 3), 1.0)])
    for table, exact in ((boxes, 2 * (12 + 8 + 6)), (round_one, 2 * np.pi * 3 + 4 * np.pi)):
        s = surface(table, 200.0, np.random.default_rng(1))
        assert len(s) * s.area == pytest.approx(exact, rel=0.03)


def test_points_lie_on_the_union_and_normals_look_out():
    table = np.array([BOX, box((1.5, 0.0, 3.5), (3.0, 2.0, 2.0))])
    s = surface(table, 3.0, np.random.default_rng(2))
    assert len(s) > 50
    assert np.allclose(np.linalg.norm(s.normal, axis=1), 1.0)
    for p, n in zip(s.p, s.normal, strict=True):
        assert distance(table, *p)[0] == pytest.approx(0.0, abs=1e-5)
        assert distance(table, *(p + 0.01 * n))[0] > 0.0


def test_halves_are_what_looks_down_and_up():
    parts = halves(np.array([BOX]), 10.0)
    assert (parts[Half.LOWER].normal[:, 2] < 0.0).all() and (parts[Half.UPPER].normal[:, 2] >= 0.0).all()
    assert np.allclose(parts[Half.LOWER].p[:, 2], 2.0)  # the sides look neither up nor down


def test_sight_ends_at_walls_at_far_and_at_a_slant():
    wall = box((0.0, 2.0, 1.0), (2.0, 0.2, 2.0))
    up = np.array([[0.0, 0.0, 1.0]])
    camera = Camera(near=0.5, far=4.0, half_angle=0.5, incidence=1.0)

    def sees(eye, p, gaze=None, normal=up):
        on = Surface(p=np.array([p], float), normal=normal, area=1.0)
        return bool(seen(np.array([wall]), camera, np.array([eye], float), gaze, on)[0, 0])

    assert sees((0, 0, 3), (0, 0, 0))
    assert not sees((0, 0, 4.1), (0, 0, 0)) and not sees((0, 0, 0.4), (0, 0, 0))
    assert not sees((2.5, 0, 1), (0, 0, 0))  # 68 degrees off the normal
    assert not sees((0, 1, 1.5), (0, 3, 0), normal=np.array([[0.0, -1.0, 0.0]]))  # behind the wall
    assert sees((0, 0, 3), (0, 0, 0), np.array([[0.0, 0.0, -1.0]]))
    assert not sees((0, 0, 3), (0, 0, 0), np.array([[1.0, 0.0, 0.0]]))  # looks elsewhere


@given(st.integers(0, 10_000))
@settings(max_examples=10)
def test_a_way_is_free_where_every_point_of_it_is(seed):
    rng = np.random.default_rng(seed)
    table = np.array([BOX])
    body = Body(radius=0.4, height=0.3, margin=0.2)
    a, b = rng.uniform(-4, 4, (2, 5, 3)) + np.array([0.0, 0.0, 3.0])
    places = Places(table, body, np.array([[9.0, 0, 0], [9.0, 1, 0]]), 2.0)
    ok = places.passable(a, b)
    for i in range(5):
        line = a[i] + np.linspace(0, 1, 200)[:, None] * (b[i] - a[i])
        room = places.clearance(line).min()
        if abs(room - 0.2) > 0.05:
            assert bool(ok[i]) == (room > 0.2)


@given(st.integers(0, 10_000))
@settings(max_examples=15)
def test_two_opt_keeps_the_places_and_the_first_and_ends_near_the_best(seed):
    p = np.random.default_rng(seed).uniform(0, 10, (6, 2))
    way = np.linalg.norm(p[:, None] - p[None], axis=2)
    tour = np.arange(6)
    before = tour_length(way, tour)
    two_opt(way, tour)
    assert tour[0] == 0 and sorted(tour.tolist()) == list(range(6))
    best = min(tour_length(way, np.array([0, *rest])) for rest in permutations(range(1, 6)))
    assert best - 1e-9 <= tour_length(way, tour) <= min(before + 1e-9, 1.5 * best)


def test_a_timed_path_keeps_its_speed_its_room_and_its_ends():
    table, body, pace = np.array([BOX]), Body(radius=0.3, height=0.2, margin=0.2), Pace(speed=0.8, along=0.4)
    corners = np.array([[-4.0, -3, 2.5], [-4, 3, 2.5], [4, 3, 2.5]])
    path = timed(table, body, corners, pace)
    assert np.allclose(path.p[[0, -1]], corners[[0, -1]]) and np.allclose(path.v[[0, -1]], 0.0)
    assert np.linalg.norm(path.v, axis=1).max() <= 0.8 + 1e-9
    assert (np.diff(path.t) > 0).all()
    assert path.length < 14.0  # the corner is rounded
    speed = np.linalg.norm(path.v, axis=1)
    assert (np.abs(np.diff(speed**2)) <= 2 * 0.4 * np.linalg.norm(np.diff(path.p, axis=0), axis=1) + 1e-9).all()


@pytest.mark.compiled
@pytest.mark.parametrize("half", [Half.LOWER, Half.UPPER])
def test_a_box_is_seen_from_a_path_that_keeps_off_it(half):
    table = np.array([BOX])
    flies = half is Half.UPPER
    task = Task(
        body=Body(radius=0.35, height=0.3, margin=0.4), camera=Camera(far=5.0, incidence=1.2, half_angle=0.7),
        pace=Pace(speed=1.0), start=(0.0, -6.0, 2.0 if flies else 0.0), flies=flies, duration_s=120.0,
    )  # fmt: skip
    on = halves(table, 8.0)[half]
    plan = inspect(table, on, task)
    assert plan.coverage > 0.9
    assert plan.coverage <= plan.reachable.mean() + 0.05
    assert plan.clearance >= 0.4
    assert plan.path.duration <= 120.0
    again = inspect(table, on, task)
    assert np.array_equal(plan.path.p, again.path.p) and np.array_equal(plan.pictures.gaze, again.pictures.gaze)


def test_what_cannot_be_planned_says_why():
    table, on = np.array([BOX]), halves(np.array([BOX]), 4.0)[Half.LOWER]
    body, near = Body(radius=0.35, height=0.3), Camera(far=0.6)

    def task(start, camera=Camera()):
        return Task(body=body, camera=camera, pace=Pace(), start=start, flies=False, duration_s=30.0, spacing=3.0)

    with pytest.raises(ConfigError, match="of room"):
        inspect(table, on, task((0.0, 0.0, 3.0)))
    with pytest.raises(ConfigError, match="nothing can be seen"):
        inspect(table, on, task((0.0, -4.0, 0.0), near))
    with pytest.raises(ConfigError, match="sees nothing"):
        Camera(near=2.0, far=1.0)


def test_a_path_asked_for_one_time_is_where_it_is_among_many(rng):
    t = np.concatenate([[0.0], np.cumsum(rng.uniform(0.1, 1.0, 30))])
    path = TimedPath(t=t, p=rng.normal(size=(31, 3)), v=rng.normal(size=(31, 3)))
    asked = np.concatenate([t, rng.uniform(-1.0, t[-1] + 1.0, 50)])
    for whole, one in zip(
        path.at(asked), zip(*(path.at(asked[k : k + 1]) for k in range(asked.size)), strict=True), strict=True
    ):
        np.testing.assert_array_equal(np.concatenate(one), whole)
