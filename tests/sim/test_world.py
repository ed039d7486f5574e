"""A world's questions against shapely and sampling, its wind, its ground, and what is refused."""

from dataclasses import replace
from math import inf

import numpy as np
import pytest
import shapely
from numpy.testing import assert_allclose

from outrider.core.attitudes import rpy_to_quats
from outrider.core.solids import box, capsule
from outrider.data import Grid
from outrider.errors import ConfigError
from outrider.sim.places import parked_airliner
from outrider.sim.world import Body, Fence, Ground, Mover, Patch, Solids, Wall, Wind, World

LEVEL = np.array([0.0, 0.0, 0.0, 1.0])
TRIANGLE = np.array([[2.0, 2.0], [6.0, 2.5], [3.0, 5.0]])


def busy(rng: np.random.Generator) -> World:
    """Something of everything."""
    cells = np.where(rng.random((40, 60)) < 0.02, 100, 0).astype(np.uint8)
    cells[30, 50] = 100
    return World(
        name="busy",
        grid=Grid(cells=cells, resolution=0.25, origin=np.array([-8.0, -9.0])),
        walls=(Wall(name="shed", outline=TRIANGLE), Wall(name="kiosk", outline=TRIANGLE[::-1] - [9.0, 0.0], high=2.5)),
        movers=(Mover.along("walker", [(-5.0, -5.0), (5.0, -5.0), (5.0, 5.0)], 1.0, start_s=2.0),),
        solids=Solids.of(("mast", capsule([0, 4, 0], [0, 4, 6], 0.2)), ("crate", box([-1, -3, 0.5], [1, 2, 1]))),
    )


def flat_shape(world: World, t: float) -> shapely.Geometry:
    """The world at a height of 0.5 m, by another library."""
    rows, cols = np.nonzero(world.grid.occupied)
    x, y = np.array([cols, rows]) * world.grid.resolution + world.grid.origin[:, None]
    cells = shapely.union_all(shapely.box(x, y, x + world.grid.resolution, y + world.grid.resolution))
    walls = [shapely.Polygon(w.outline) for w in world.walls]
    discs = [shapely.Point(m.at(t)[:2]).buffer(m.radius, quad_segs=4000) for m in world.movers]
    mast, crate = shapely.Point(0, 4).buffer(0.2, quad_segs=4000), shapely.box(-1.5, -4, -0.5, -2)
    return shapely.union_all([cells, *walls, *discs, mast, crate])


def test_scans_against_shapely(rng) -> None:
    angles, reach, hits = np.linspace(-np.pi, np.pi, 24, endpoint=False) + 0.01, 9.0, 0
    for _ in range(5):
        world, t, yaw = busy(rng), rng.uniform(0.0, 25.0), rng.uniform(-3, 3)
        shape, o = flat_shape(world, t), np.array([*rng.uniform(-8, 7, 2), 0.5])
        ranges = world.scan(o, rpy_to_quats(np.array([[0.0, 0.0, yaw]]))[0], angles, reach, t)
        for angle, found in zip(angles + yaw, ranges, strict=True):
            beam = shapely.LineString([o[:2], o[:2] + reach * np.array([np.cos(angle), np.sin(angle)])])
            met = beam.intersection(shape)
            expected = inf if met.is_empty else shapely.Point(o[:2]).distance(met)
            assert found == pytest.approx(expected, abs=1e-6)
            hits += found < inf
    assert 40 < hits < 110


def test_clearance_against_shapely_and_by_name(rng) -> None:
    for _ in range(5):
        world, t = busy(rng), rng.uniform(0.0, 25.0)
        shape, p = flat_shape(world, t), np.column_stack([rng.uniform(-9, 8, (30, 2)), np.full(30, 0.5)])
        for d, name, here in zip(world.clearance(p, t), world.nearest(p, t), p, strict=True):
            point = shapely.Point(here[:2])
            if d > 0.0:
                assert d == pytest.approx(shape.distance(point), abs=1e-6)
            else:
                assert shape.contains(point)
            assert name in ("mast", "crate", "shed", "kiosk", "walker", "grid")
    near = np.array([[0.0, 4.5, 5.0], [-1.0, -3.0, 1.3], [3.0, 3.0, 3.5], [-5.0, -5.0, 1.8], [4.5, -1.4, 2.1]])
    assert world.nearest(near) == ("mast", "crate", "shed", "walker", "grid")
    assert_allclose(world.clearance(near)[:4], [0.3, 0.3, 0.5, 0.05])


def test_clearance_changes_no_faster_than_the_way(rng) -> None:
    world = busy(rng)
    p = rng.uniform([-9, -10, -1], [8, 6, 7], (200, 3))
    step = rng.normal(size=p.shape) * rng.uniform(0.01, 2.0, (200, 1))
    change = np.abs(world.clearance(p + step) - world.clearance(p))
    assert (change <= np.linalg.norm(step, axis=1) + 1e-12).all()


@pytest.mark.parametrize("name", ["busy", "airliner"])
def test_sight_is_mutual_and_means_free_space_between(name: str, rng) -> None:
    world, box_ = (busy(rng), 8.0) if name == "busy" else (parked_airliner(), 20.0)
    a, b = (rng.uniform([-box_, -box_, 0.1], [box_, box_ + 15.0, 6.0], (80, 3)) for _ in range(2))
    seen = world.sees(a, b, 7.0)
    assert (seen == world.sees(b, a, 7.0)).all()
    assert 10 < seen.sum() < 70
    way = np.linspace(0.0, 1.0, 200)[:, None]
    least = np.array([world.clearance(p + way * (q - p), 7.0).min() for p, q in zip(a, b, strict=True)])
    assert (least[seen] > 0.0).all()
    assert (least[~seen] < 0.005 * np.linalg.norm(b - a, axis=1)[~seen]).all()
    assert world.sees(a[:5], a[:5]).tolist() == (world.clearance(a[:5]) > 0.0).tolist()


def test_one_scan_and_many_are_the_same_bits(rng) -> None:
    world, angles = busy(rng), np.linspace(-1.0, 1.0, 7)
    o, q, t = rng.uniform([-6, -6, 1], [6, 6, 13], (9, 3)), rng.normal(size=(9, 4)), rng.uniform(0, 30, 9)
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    many = world.scan(o, q, angles, 20.0, t)
    assert many.shape == (9, 7)
    assert np.isfinite(many).any()
    for row, *pose in zip(many, o, q, t, strict=True):
        assert (world.scan(pose[0], pose[1], angles, 20.0, pose[2]) == row).all()


def test_a_tilted_lidar_meets_the_ground() -> None:
    q = rpy_to_quats(np.array([[0.0, 0.2, 0.0]]))[0]  # nose down
    ranges = World(name="bare").scan(np.array([0.0, 0.0, 2.0]), q, np.array([0.0, np.pi, 0.5 * np.pi]), 50.0)
    assert_allclose(ranges, [2.0 / np.sin(0.2), inf, inf])
    hill = World(name="hill", ground=Ground(slope=(0.1, 0.0)))
    assert hill.scan(np.array([0.0, 0.0, 2.0]), LEVEL, np.zeros(1), 50.0)[0] == pytest.approx(20.0)


def test_an_empty_world() -> None:
    p, bare = np.zeros((2, 3)), World(name="bare")
    bare.validate()
    assert bare.clearance(p).tolist() == [inf, inf]
    assert bare.nearest(p) == ("", "")
    assert bare.sees(p, p + 1.0).all()


def test_movers_keep_to_their_script() -> None:
    walker = Mover.along("walker", [(0.0, 0.0), (4.0, 0.0), (4.0, 3.0)], 2.0, start_s=1.0)
    assert walker.t_s.tolist() == [1.0, 3.0, 4.5]
    world = World(name="street", movers=(walker, Mover.along("post", [(9.0, 9.0)], 1.0)))
    world.validate()
    at = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 4.5, 99.0])
    feet = np.array([[0, 0], [0, 0], [2, 0], [4, 0], [4, 2], [4, 3], [4, 3]], float)
    assert_allclose(walker.at(at)[:, :2], feet)
    p = np.column_stack([feet[:, 0], feet[:, 1] + 1.0, np.full(7, 1.0)])
    assert_allclose(world.clearance(p, at), 0.7)
    assert set(world.nearest(p, at)) == {"walker"}


def test_fence() -> None:
    square = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]])
    fence = Fence(polygon=square, floor=1.0, ceiling=6.0)
    p = np.array([[5.0, 5.0, 3.0], [9.5, 5.0, 3.0], [5.0, 5.0, 7.5], [13.0, 5.0, 10.0], [5.0, 5.0, 0.0]])
    assert_allclose(fence.margin(p), [2.0, 0.5, -1.5, -5.0, -1.0])
    assert Fence(polygon=square).margin(p)[0] == 5.0


def test_ground_table() -> None:
    patches = (
        Patch(centre=(1.0, 2.0), radius=3.0, longitudinal=0.2, lateral=0.1),
        Patch(centre=(4.0, 5.0), radius=6.0, lateral=0.3),
    )
    ground = Ground(slope=(0.01, -0.02), longitudinal=0.03, lateral=0.04, patches=patches)
    expected = [[0.01, -0.02, 0.03, 0.04, 2], [1, 2, 3, 0.2, 0.1], [4, 5, 6, 0, 0.3]]
    assert ground.table().tolist() == expected
    assert_allclose(ground.height(np.array([[10.0, 5.0], [0.0, 1.0]])), [0.0, -0.02])


def test_objects_know_their_features() -> None:
    q = rpy_to_quats(np.array([[0.0, 0.0, 0.5 * np.pi]]))[0]
    body = Body(p=np.array([1.0, 2.0, 0.0]), q=q, features={"hook": np.array([3.0, 0.0, 1.0])})
    assert_allclose(body.feature("hook"), [1.0, 5.0, 1.0], atol=1e-15)
    with pytest.raises(ConfigError, match="hook"):
        body.feature("eye")


BOW = np.array([[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 2.0]])
WALKER = Mover.along("walker", [(0.0, 0.0), (1.0, 0.0)], 1.0)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"gravity": -9.8}, "gravity"),
        ({"walls": (Wall(name="a", outline=TRIANGLE[:2]),)}, "wall 'a'.*three"),
        ({"walls": (Wall(name="a", outline=TRIANGLE * np.nan),)}, "wall 'a'"),
        ({"walls": (Wall(name="a", outline=BOW),)}, "wall 'a'.*crosses"),
        ({"walls": (Wall(name="a", outline=TRIANGLE[[0, 0, 1, 2]]),)}, "wall 'a'.*touches"),
        ({"walls": (Wall(name="a", outline=TRIANGLE, low=3.0),)}, "wall 'a'.*3 m up to 3 m"),
        ({"walls": (Wall(name="a", outline=TRIANGLE, high=inf),)}, "wall 'a'"),
        ({"walls": (Wall(name="a", outline=TRIANGLE), Wall(name="a", outline=TRIANGLE + 9))}, "'a'.*taken"),
        ({"walls": (Wall(name="grid", outline=TRIANGLE),)}, "'grid'.*reserved"),
        ({"solids": Solids(table=np.zeros((1, 24)), names=())}, "solids.*1 rows and 0 names"),
        ({"movers": (replace(WALKER, t_s=np.array([1.0, 1.0])),)}, "mover 'walker'.*time"),
        ({"movers": (replace(WALKER, t_s=np.array([1.0])),)}, "mover 'walker'.*positions"),
        ({"movers": (replace(WALKER, radius=0.0),)}, "mover 'walker'.*radius"),
        ({"objects": {"x": Body(p=np.zeros(3), q=np.ones(4))}}, "object 'x'.*quaternion"),
        ({"wind": Wind(sigma=(1.0, 1.0, -1.0))}, "wind.*sigma"),
        ({"wind": Wind(length=(1.0, 0.0, 1.0))}, "wind.*length"),
        ({"wind": Wind(airspeed=0.0)}, "wind.*airspeed"),
        ({"ground": Ground(slope=(0.0, np.nan))}, "ground.*slope"),
        ({"ground": Ground(lateral=1.0)}, "ground.*slips"),
        ({"ground": Ground(patches=(Patch(centre=(1.0, 2.0), radius=0.0),))}, "patch.*radius"),
        ({"ground": Ground(patches=(Patch(centre=(1.0, 2.0), radius=1.0, longitudinal=-0.1),))}, "patch.*slips"),
        ({"fence": Fence(polygon=TRIANGLE, floor=5.0, ceiling=5.0)}, "fence.*lower"),
        ({"fence": Fence(polygon=BOW)}, "fence.*crosses"),
        (
            {"grid_height": inf, "grid": Grid(cells=np.zeros((2, 2), np.uint8), resolution=1.0, origin=np.zeros(2))},
            "grid",
        ),
    ],
)
def test_impossible_worlds_are_named(wrong: dict, words: str) -> None:
    with pytest.raises(ConfigError, match=f"world 'odd', .*{words}") as fault:
        World(name="odd", **wrong).validate()
    assert "\n" not in str(fault.value)


def test_a_mover_needs_a_speed() -> None:
    with pytest.raises(ConfigError, match=r"walker.*speed"):
        Mover.along("walker", [(0.0, 0.0), (1.0, 0.0)], 0.0)
