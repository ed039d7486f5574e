"""What moves is told from what stands, whoever moves: people, a robot past walls, and scans with noise."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.data.grid import LETHAL, Grid
from outrider.data.scan import Scan
from outrider.errors import ConfigError
from outrider.mapping.inflation import Inflation
from outrider.mapping.layers import LayeredCostmap
from outrider.mapping.obstacles import Marking
from outrider.mapping.tracks import (
    CLUSTER,
    RADIUS,
    TRACK,
    VX,
    VY,
    C,
    P,
    Tracker,
    Tracking,
    V,
    X,
    Y,
    associated,
    clusters,
    fresh,
)
from outrider.typing import Floats

BEARINGS = np.linspace(-np.pi, np.pi, 360, endpoint=False)
PERIOD = 0.1
MARKING = Marking(mark=5.0, clear=9.0)


def cast(pose: Floats, discs: Floats, walls: Floats, rng: np.random.Generator) -> Scan:
    """Ranges to discs (n, 3) x, y, radius and to walls (m, 4) from, to: the textbook intersections."""
    a = pose[2] + BEARINGS
    d = np.column_stack([np.cos(a), np.sin(a)])
    r = np.full(len(a), np.inf)
    for x, y, radius in discs:
        o = np.array([x, y]) - pose[:2]
        along, off2 = d @ o, o @ o - (d @ o) ** 2
        near = along - np.sqrt(np.maximum(radius**2 - off2, 0.0))
        r = np.where((off2 < radius**2) & (near > 0.0), np.minimum(r, near), r)
    for x0, y0, x1, y1 in walls:
        e, w = np.array([x1 - x0, y1 - y0]), np.array([x0, y0]) - pose[:2]
        with np.errstate(divide="ignore", invalid="ignore"):
            cross = d[:, 0] * e[1] - d[:, 1] * e[0]
            t, s = (w[0] * e[1] - w[1] * e[0]) / cross, (w[0] * d[:, 1] - w[1] * d[:, 0]) / cross
        r = np.where((t > 0.0) & (s >= 0.0) & (s <= 1.0), np.minimum(r, t), r)
    r = np.where(r < 15.0, r + 0.02 * rng.standard_normal(len(r)), np.inf)
    return Scan(pose=pose, bearings=BEARINGS, ranges=r, reach=15.0)


def followed(poses: Floats, people, walls: Floats, seed: int = 0, spread: float = 0.0):
    """A tracker and its costmap along poses (n, 3); people(t) gives discs (n, 3); the discs that it found, each time.
    spread : standard deviations of the robot's own error, m and, a tenth of it, rad."""
    rng = np.random.default_rng(seed)
    ground = Grid(cells=np.zeros((300, 300), np.uint8), resolution=0.1, origin=np.array([-15.0, -15.0]))
    costs, tracker, found = LayeredCostmap(ground, inflation=Inflation(inscribed=0.3), marking=MARKING), Tracker(), []
    for k, pose in enumerate(poses):
        t = PERIOD * k
        scan = cast(pose, people(t), walls, rng)
        thought = pose + spread * rng.standard_normal(3) * [1.0, 1.0, 0.1]
        left = tracker.look(t, replace(scan, pose=thought), costs.passed)
        costs.update([left], pose=thought)
        found.append(tracker.discs(t))
    return tracker, costs, found


def straight(n: int, v: tuple[float, float] = (0.0, 0.0), turn: float = 0.0) -> Floats:
    t = PERIOD * np.arange(n)
    return np.column_stack([v[0] * t, v[1] * t, turn * t])


NOTHING = np.empty((0, 4))
ROOM = np.array([[-9.0, -3.0, 12.0, -3.0], [12.0, -3.0, 12.0, 3.0], [12.0, 3.0, -9.0, 3.0], [3.0, -3.0, 3.0, -1.5],
                 [6.0, 3.0, 6.0, 1.0], [6.0, 1.0, 6.6, 1.0]])  # fmt: skip
POSTS = np.array([[2.0, 1.5, 0.1], [4.5, -1.5, 0.3], [5.0, 2.0, 0.15], [7.0, -2.0, 0.05], [8.0, 1.8, 0.25]])


@pytest.mark.compiled
@pytest.mark.parametrize(("x", "y", "vx", "vy"), [(4.0, -3.0, 0.0, 1.4), (7.0, 0.5, -1.4, 0.0), (-2.0, 2.0, 1.0, -0.5)])
def test_a_walker_is_found_with_place_radius_and_velocity(x: float, y: float, vx: float, vy: float) -> None:
    def walker(t: float) -> Floats:
        return np.array([[x + vx * t, y + vy * t, 0.3]])

    *_, found = followed(straight(30, (0.8, 0.0)), walker, NOTHING)
    known = [k for k, d in enumerate(found) if len(d)]
    assert known[0] <= 8 and known == list(range(known[0], 30))  # 0.8 s, and then always
    errors = []
    for k in range(12, 30):
        assert len(found[k]) == 1
        errors.append(found[k][0] - [*walker(PERIOD * k)[0], vx, vy])
    error = np.abs(np.array(errors))
    assert error[:, :2].max() < 0.12
    assert (np.array(errors)[:, 2] > -0.05).all() and error[:, 2].max() < 0.2  # the margin is 0.1
    assert error[:, 3:].mean() < 0.15 and error[:, 3:].max() < 0.5


@pytest.mark.compiled
def test_who_moves_leaves_no_trace_in_the_costmap() -> None:
    _, costs, found = followed(straight(40), lambda t: np.array([[6.0 - 1.4 * t, 1.5, 0.3]]), NOTHING)
    seen = costs.costmap.cells == LETHAL
    behind = seen[160:172, 165:195].sum()  # where it was from the 8th scan on
    assert len(found[-1]) == 1 and behind == 0


@pytest.mark.compiled
@pytest.mark.parametrize("turn", [0.0, 0.6])
@pytest.mark.parametrize("seed", range(3))
def test_walls_and_posts_stand_however_the_robot_moves(turn: float, seed: int) -> None:
    """Past doors, corners and posts, some hidden by others, with 2 cm and 0.1 degrees of error of the robot's own."""
    poses = straight(80, (1.0, 0.0), turn)
    *_, found = followed(poses, lambda t: POSTS, ROOM, seed, spread=0.02)
    assert sum(len(d) for d in found) == 0


@pytest.mark.compiled
def test_who_stops_stands_in_the_costmap_and_who_goes_on_moves_again() -> None:
    def walker(t: float) -> Floats:
        gone = 1.4 * min(t, 2.0) + 1.4 * max(t - 5.0, 0.0)
        return np.array([[4.0, -3.0 + gone, 0.3]])

    _, costs, found = followed(straight(50), walker, NOTHING)
    moving = [bool(len(d)) for d in found]
    assert moving[18] and not any(moving[30:]) and sum(np.diff(np.array(moving).astype(int)) != 0) == 2
    x, y, _ = walker(4.9)[0]
    rows, cols = np.nonzero(costs.costmap.cells == LETHAL)
    middle = costs.origin + 0.1 * (np.column_stack([cols, rows]) + 0.5)
    assert len(middle) and (np.hypot(*(middle - [x, y]).T) < 0.45).all()
    *_, found = followed(straight(65), walker, NOTHING)
    assert len(found[-1]) == 1


@pytest.mark.compiled
@pytest.mark.parametrize("bearing", [0.0, 0.8, 1.6, 2.4, 3.1])
def test_who_stood_and_sets_off_is_known_to_soon_and_until_then_where_to(bearing: float) -> None:
    """0.4 s after he does, whichever way; while he stands, by the way he came."""
    way = np.array([np.cos(bearing), np.sin(bearing)])

    def walker(t: float) -> Floats:
        gone = 1.4 * min(t, 2.0) + 1.4 * max(t - 5.0, 0.0)
        return np.array([[*([3.5, 0.5] + (gone - 2.8) * way), 0.3]])

    tracker, _, found = followed(straight(50), walker, NOTHING)
    ((*_, vx, vy),) = tracker.standing()
    assert np.dot([vx, vy], way) > 0.95
    *_, found = followed(straight(60), walker, NOTHING)
    known = [k for k, d in enumerate(found) if len(d) and k > 50]
    assert known[0] <= 54
    assert not any(len(d) for d in found[30:51])


def test_the_filter_is_the_kalman_filter_of_the_book() -> None:
    """A constant-velocity model with white acceleration, one axis at a time, against F P F' + Q and the Joseph form."""
    tracker, s, dt, r = Tracker(), Tracking(), 0.1, 0.01
    cov = np.array([[0.04, 0.03], [0.03, 0.5]])
    x = np.array([1.0, 0.7])
    tracker._all = np.zeros((1, TRACK))
    tracker._all[0, [X, Y, VX, VY, P, C, V, RADIUS]] = [1.0, 2.0, 0.7, -0.4, cov[0, 0], cov[0, 1], cov[1, 1], 1.0]
    tracker._time = 0.0
    tracker._predict(dt)
    tracker._correct(dt, np.array([0]), np.array([[1.2, 1.9, 0.3, r]]), lambda p: np.ones(len(p), np.bool_))
    F, G, H = np.array([[1.0, dt], [0.0, 1.0]]), np.array([[0.5 * dt * dt], [dt]]), np.array([[1.0, 0.0]])
    x, cov = F @ x, F @ cov @ F.T + s.acceleration**2 * G @ G.T
    K = cov @ H.T / (H @ cov @ H.T + r)
    A = np.eye(2) - K @ H
    x, cov = x + (K * (1.2 - x[0])).ravel(), A @ cov @ A.T + r * K @ K.T
    np.testing.assert_allclose(tracker._all[0, [X, VX]], x, rtol=1e-12)
    np.testing.assert_allclose(tracker._all[0, [P, C, V]], [cov[0, 0], cov[0, 1], cov[1, 1]], rtol=1e-12)


@given(st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5)), min_size=0, max_size=6), st.integers(0, 2**31))
@settings(max_examples=40)
def test_everybody_keeps_his_track(places: list[tuple[float, float]], seed: int) -> None:
    """Whoever is further from all others than the gate is wide is never taken for another."""
    rng = np.random.default_rng(seed)
    p = np.array([q for k, q in enumerate(places) if all(np.hypot(*np.subtract(q, o)) > 2.0 for o in places[:k])])
    z = np.column_stack([p.reshape(-1, 2), np.full((len(p), 2), 0.01)])
    assert z.shape[1] == CLUSTER
    order = rng.permutation(len(z))
    found = associated(fresh(0.0, z), z[order] + [0.05, 0.0, 0.0, 0.0], 13.8)
    assert len(found) == len(z) and (order == found).all()


def test_scans_without_a_word_and_with_things_around_the_back() -> None:
    s = Tracking()
    silent = Scan(pose=np.zeros(3), bearings=BEARINGS, ranges=np.full(360, np.nan), reach=15.0)
    assert len(clusters(silent, s)) == 0 and len(clusters(replace(silent, ranges=np.full(360, np.inf)), s)) == 0
    behind = cast(np.zeros(3), np.array([[-3.0, 0.0, 0.3]]), NOTHING, np.random.default_rng(0))
    (one,) = clusters(behind, s)
    np.testing.assert_allclose(one[:3], [-3.0, 0.0, 0.3], atol=0.06)


@pytest.mark.parametrize("wrong", [{"gap": 0.0}, {"stops": 0.5}, {"scans": 0}, {"forget": np.inf}])
def test_settings_that_cannot_follow_anything(wrong: dict[str, float]) -> None:
    with pytest.raises(ConfigError, match="tracking"):
        Tracking(**wrong)


def test_who_is_hidden_while_moving_is_remembered_and_who_left_is_not() -> None:
    """Somebody walks at 1 m/s behind a wall for two seconds: his disc goes on. He who is in plain sight no more is
    forgotten after a second."""
    poses = straight(60)
    wall = np.array([[2.0, -0.5, 2.0, 0.5]])

    def walks(t: float) -> Floats:
        return np.array([[4.0, -2.5 + t, 0.3]])

    _, _, found = followed(poses, walks, wall)
    hidden = [k for k in range(60) if abs(-2.5 + PERIOD * k) < 0.6]
    assert len(hidden) > 10
    for k in hidden:
        assert len(found[k]) == 1
        assert np.hypot(*(found[k][0, :2] - [4.0, -2.5 + PERIOD * k])) < found[k][0, 2] + 0.3  # it touches him

    def vanishes(t: float) -> Floats:
        return walks(t) if t < 1.5 else np.array([[9.0, 9.0, 0.3]])

    _, _, gone = followed(straight(30), vanishes, np.empty((0, 4)))
    assert len(gone[14]) == 1
    assert len(gone[-1]) == 0
