"""The layers of a costmap: their order, their windows, and what happens when something is missing."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from outrider.data.footprint import Footprint
from outrider.data.grid import FREE, INSCRIBED, LETHAL, UNKNOWN, Grid
from outrider.data.scan import Scan
from outrider.errors import ConfigError, DataError
from outrider.mapping.inflation import Inflater, Inflation
from outrider.mapping.layers import LayeredCostmap, Unknown, static_costs
from outrider.mapping.obstacles import Marking

INFLATION = Inflation(inscribed=0.15, radius=0.35, factor=4.0)
MARKING = Marking(mark=1.5, clear=2.0)
RES = 0.1


def ground(value=0, shape=(30, 40)):
    return Grid(cells=np.full(shape, value, np.uint8), resolution=RES, origin=np.array([-1.0, 2.0]))


def layered(g=None, **options):
    return LayeredCostmap(g or ground(), inflation=INFLATION, marking=MARKING, **options)


def scan(x, y, heading=0.0, ranges=(np.inf,), bearings=None):
    angles = np.linspace(-1.5, 1.5, len(ranges)) if bearings is None else np.array(bearings)
    return Scan(pose=np.array([x, y, heading]), bearings=angles, ranges=np.array(ranges, float), reach=3.0)


def cost_at(layers, x, y):
    m = layers.costmap
    return int(m.cells[tuple(m.cell_of(np.array([x, y])))])


def random_scan(rng):
    ranges = np.where(rng.random(15) < 0.3, np.inf, rng.uniform(0.05, 3.0, 15))
    ranges[rng.random(15) < 0.1] = np.nan
    ranges[0] = 0.4
    return scan(*rng.uniform([-1.5, 1.5], [3.5, 5.5]), rng.uniform(-3, 3), ranges)


def test_values_of_a_drawn_map():
    g = Grid(cells=np.array([[0, 30, 64, 65, 100, 255]], np.uint8), resolution=1.0, origin=np.zeros(2))
    assert static_costs(g).tolist() == [[0, 0, 0, 254, 254, 255]]
    assert static_costs(g, Unknown.FREE)[0, 5] == FREE
    assert static_costs(g, Unknown.TAKEN)[0, 5] == LETHAL
    assert static_costs(g, scale=True).tolist() == [[0, 116, 248, 254, 254, 255]]


def test_layers_are_joined_by_their_maximum_and_scans_do_not_clear_what_is_drawn():
    g = ground()
    g.cells[10, 20] = 100  # at 1.05, 3.05
    layers = layered(g)
    layers.update([scan(0.05, 3.05, ranges=[np.inf], bearings=[0.0])], pose=np.array([0.05, 3.05, 0.0]))
    assert cost_at(layers, 1.05, 3.05) == LETHAL
    assert cost_at(layers, 1.15, 3.05) == INSCRIBED
    layers.update([scan(0.05, 3.05, ranges=[0.5], bearings=[0.0])])
    assert cost_at(layers, 0.55, 3.05) == LETHAL
    layers.update([scan(0.05, 3.05, ranges=[np.inf], bearings=[0.0])])
    assert cost_at(layers, 0.55, 3.05) == 0


def test_unknown_ground_is_known_once_it_was_seen():
    layers = layered(ground(UNKNOWN))
    assert (layers.costmap.cells == UNKNOWN).all()
    layers.update([scan(0.05, 3.05, ranges=[0.5], bearings=[0.0])])
    assert cost_at(layers, 0.25, 3.05) < INSCRIBED
    assert cost_at(layers, 0.55, 3.05) == LETHAL
    assert cost_at(layers, 0.65, 3.05) == INSCRIBED  # unknown, but so near that it is surely not free
    assert cost_at(layers, 0.85, 3.05) == UNKNOWN


def test_the_robot_does_not_see_itself():
    body = Footprint.rectangle(0.6, 0.4)
    pose = np.array([0.5, 3.5, 0.3])
    hits = scan(*pose[:2], 0.3, ranges=[0.12, 0.2, 0.9], bearings=[0.0, 1.0, 2.0])
    layers = layered(footprint=body)
    layers.update([hits], pose=pose)
    assert np.sum(layers.costmap.cells == LETHAL) == 1
    blind = layered()
    blind.update([hits], pose=pose)
    assert np.sum(blind.costmap.cells == LETHAL) == 3


def test_other_robots_stand_where_they_are_now():
    layers, disc = layered(), Footprint.circle(0.2)
    layers.update(others=[(disc, np.array([0.5, 3.5, 0.0]))])
    assert cost_at(layers, 0.5, 3.5) == LETHAL
    layers.update(others=[(disc, np.array([1.5, 4.0, 0.0]))])
    assert cost_at(layers, 0.5, 3.5) == 0
    assert cost_at(layers, 1.5, 4.0) == LETHAL
    layers.update()
    assert (layers.costmap.cells == 0).all()


def test_zones_bar_also_unknown_ground_and_are_needed_where_promised():
    keep_out = np.zeros((30, 40), np.uint8)
    keep_out[12, 10] = 1
    layers = layered(ground(UNKNOWN), keep_out=keep_out, zones_needed=True)
    assert np.argwhere(layers.costmap.cells == LETHAL).tolist() == [[12, 10]]
    layers.replace_zones(None)  # lost: nobody knows where one may go
    assert (layers.costmap.cells == LETHAL).all()
    layers.replace_zones(np.zeros((30, 40), np.uint8))
    assert (layers.costmap.cells == UNKNOWN).all()
    assert (layered(zones_needed=True).costmap.cells == LETHAL).all()


@settings(derandomize=True, max_examples=12)
@given(seed=st.integers(0, 10**6), window=st.sampled_from([None, 1.2, 2.0]))
def test_an_update_equals_a_rebuild(seed, window):
    """Everything moves at random: the robot, the others, what the lidar sees."""
    rng = np.random.default_rng(seed)
    g = ground()
    g.cells[rng.random(g.cells.shape) < 0.02] = 100
    g.cells[rng.random(g.cells.shape) < 0.1] = UNKNOWN
    layers = layered(
        g, window=window, footprint=Footprint.rectangle(0.5, 0.3), keep_out=(rng.random(g.cells.shape) < 0.01) * 1
    )
    body = Footprint.capsule(0.2, 0.2, 0.15)
    for _ in range(4):
        pose = np.array([*rng.uniform([-1.5, 1.5], [3.5, 5.5]), rng.uniform(-3, 3)])
        others = [(body, rng.uniform([-2.0, 1.0, -3.0], [4.0, 6.0, 3.0])) for _ in range(rng.integers(0, 3))]
        layers.update([random_scan(rng) for _ in range(rng.integers(0, 3))], pose=pose, others=others)
        told = layers.costmap.cells.copy()
        layers.rebuild()
        assert (told == layers.costmap.cells).all()


@settings(derandomize=True, max_examples=10)
@given(seed=st.integers(0, 10**6), x=st.floats(-1.5, 3.5), y=st.floats(1.5, 5.5))
def test_a_window_shows_what_the_whole_map_shows(seed, x, y):
    """Cost comes in over the window's edges from what stands beyond them."""
    rng = np.random.default_rng(seed)
    g = ground()
    g.cells[rng.random(g.cells.shape) < 0.03] = 100
    whole, part = layered(g).costmap, layered(g, window=1.0)
    part.update(pose=np.array([x, y, 0.0]))
    seen = part.costmap
    assert seen.cells.shape == (10, 10)
    middle = seen.centre_of(np.array([5, 5]))
    assert np.abs(middle - [x, y]).max() <= RES
    for row in range(10):
        for col in range(10):
            r, c = whole.cell_of(seen.centre_of(np.array([row, col])))
            if 0 <= r < 30 and 0 <= c < 40:
                assert seen.cells[row, col] == whole.cells[r, c]
            else:
                assert seen.cells[row, col] in (UNKNOWN, INSCRIBED)


def test_a_window_remembers_what_it_saw_as_it_moves():
    layers = layered(window=2.0)
    layers.update([scan(0.55, 3.55, ranges=[0.5], bearings=[0.0])], pose=np.array([0.5, 3.5, 0.0]))
    layers.update(pose=np.array([0.83, 3.31, 0.0]))
    assert cost_at(layers, 1.05, 3.55) == LETHAL
    layers.update(pose=np.array([3.0, 3.31, 0.0]))
    layers.update(pose=np.array([0.5, 3.5, 0.0]))  # it was out of sight: forgotten
    assert not (layers.costmap.cells == LETHAL).any()


def test_in_doubt_nothing_changes_and_somebody_is_told():
    layers = layered(window=2.0)
    with pytest.raises(DataError, match="nowhere yet"):
        _ = layers.costmap
    with pytest.raises(DataError, match="needs the robot's pose"):
        layers.update()
    here = np.array([0.5, 3.5, 0.0])
    layers.update([scan(0.5, 3.5, ranges=[0.5])], pose=here)
    before = layers.costmap.cells
    with pytest.raises(DataError, match="no beam of scan 0 can be used"):
        layers.update([scan(0.5, 3.5, ranges=[np.nan, np.nan])], pose=here)
    with pytest.raises(DataError, match="pose of the robot"):
        layers.update(pose=np.array([np.nan, 0.0, 0.0]))
    with pytest.raises(DataError, match="pose of the other robot"):
        layers.update(pose=here, others=[(Footprint.circle(0.2), np.array([0.0, np.inf, 0.0]))])
    assert (layers.costmap.cells == before).all()
    with pytest.raises(ConfigError, match="zones of"):
        layers.replace_zones(np.zeros((3, 3), np.uint8))
    with pytest.raises(ConfigError, match="window"):
        layered(window=-1.0)
    with pytest.raises(ConfigError, match="smaller window"):
        layered(window=1e6)


def test_the_costmap_is_the_inflated_ground():
    g = ground()
    g.cells[3:5, 7:9] = 100
    expected = np.empty_like(g.cells)
    Inflater(INFLATION, RES, g.cells.shape)(static_costs(g), expected)
    assert (layered(g).costmap.cells == expected).all()
