"""Inflation against the published table and SciPy's exact distances, and windows against the whole."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import distance_transform_edt

from outrider.data.grid import LETHAL, UNKNOWN
from outrider.errors import ConfigError
from outrider.mapping.inflation import CHUNK, WIDEST, Inflater, Inflation

TABLE = {  # planners' regression table for an inscribed radius of 0.3 m
    3.0: {0.0: 254, 0.05: 253, 0.35: 216, 0.5: 138, 0.75: 65, 1.0: 30, 1.5: 6, 2.0: 1},
    10.0: {0.35: 152, 0.5: 34, 0.75: 2, 1.0: 0},
}


def scattered(seed, shape, share=0.02, unknown=0.0):
    rng = np.random.default_rng(seed)
    cells = np.where(rng.random(shape) < share, LETHAL, rng.integers(0, 30, shape))
    return np.where(rng.random(shape) < unknown, UNKNOWN, cells).astype(np.uint8)


def inflated(cells, inflation, resolution=0.05, box=None, out=None):
    out = np.zeros_like(cells) if out is None else out
    Inflater(inflation, resolution, cells.shape)(cells, out, box)
    return out


def by_scipy(cells, inflation, resolution=0.05):
    """nav2's formula on SciPy's transform."""
    d = distance_transform_edt(cells != LETHAL) * resolution
    graded = np.floor(252 * np.exp(-inflation.factor * (d - inflation.inscribed)))
    cost = np.where(d <= inflation.radius + 1e-9, graded, 0)
    cost = np.where(d <= inflation.inscribed + 1e-9, 253, cost)
    cost = np.where(d == 0, 254, cost)
    least = 1 if inflation.into_unknown else 253
    return np.where(cells == UNKNOWN, np.where(cost >= least, cost, UNKNOWN), np.maximum(cells, cost))


@pytest.mark.parametrize("factor", TABLE)
def test_the_published_table_to_the_unit(factor):
    inflation = Inflation(inscribed=0.3, radius=2.5, factor=factor)
    d = np.array(list(TABLE[factor]))
    assert inflation.cost(d).tolist() == list(TABLE[factor].values())
    cells = np.zeros((1, 60), np.uint8)
    cells[0, 0] = LETHAL
    made = inflated(cells, inflation)[0]
    assert [int(made[round(x / 0.05)]) for x in d] == list(TABLE[factor].values())


def test_a_cost_tells_its_distance():
    inflation = Inflation(inscribed=0.3, radius=2.5, factor=3.0)
    for cost in (1, 30, 138, 252):
        d = inflation.distance(cost)
        assert inflation.cost(np.array([d - 1e-6]))[0] == min(cost, 252) or cost == 252
        assert inflation.cost(np.array([d + 1e-3]))[0] == cost - 1


@pytest.mark.parametrize("into_unknown", [False, True])
def test_equals_scipy_on_a_large_map(into_unknown):
    shape = (90, 2 * CHUNK + 37) if into_unknown else (37, CHUNK)
    inflation = Inflation(inscribed=0.2, radius=0.83, factor=3.0, into_unknown=into_unknown)
    cells = scattered(3, shape, 0.004, unknown=0.2)
    assert (inflated(cells, inflation) == by_scipy(cells, inflation)).all()


@settings(derandomize=True, max_examples=25)
@given(
    seed=st.integers(0, 10**6), rows=st.integers(1, 24), cols=st.integers(1, 24), share=st.floats(0.0, 0.4),
    radius=st.floats(0.0, 0.6), inscribed=st.floats(0.0, 1.0), factor=st.floats(0.0, 12.0),
)  # fmt: skip
def test_equals_scipy(seed, rows, cols, share, radius, inscribed, factor):
    inflation = Inflation(inscribed=inscribed * radius, radius=radius, factor=factor)
    cells = scattered(seed, (rows, cols), share, 0.2)
    if (cells == LETHAL).any():
        assert (inflated(cells, inflation) == by_scipy(cells, inflation)).all()
    else:
        assert (inflated(cells, inflation) == cells).all()


@settings(derandomize=True, max_examples=20)
@given(seed=st.integers(0, 10**6), box=st.tuples(*[st.integers(0, 30)] * 4), radius=st.floats(0.0, 0.5))
def test_a_window_equals_the_whole(seed, box, radius):
    cells = scattered(seed, (30, 30), 0.03)
    inflation = Inflation(inscribed=0.4 * radius, radius=radius, factor=3.0)
    whole = inflated(cells, inflation)
    r0, r1, c0, c1 = *sorted(box[:2]), *sorted(box[2:])
    out = np.full_like(cells, 7)
    inflated(cells, inflation, box=(r0, r1, c0, c1), out=out)
    assert (out[r0:r1, c0:c1] == whole[r0:r1, c0:c1]).all()
    out[r0:r1, c0:c1] = 7
    assert (out == 7).all()


@pytest.mark.compiled
def test_the_widest_radius_does_not_overflow():
    cells = np.zeros((2 * WIDEST + 5, 2 * WIDEST + 5), np.uint8)
    cells[WIDEST, 3] = cells[0, 0] = LETHAL
    inflation = Inflation(inscribed=0.2, radius=WIDEST * 0.05, factor=0.3)
    assert (inflated(cells, inflation) == by_scipy(cells, inflation)).all()


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ({"inscribed": 0.6, "radius": 0.5}, "less than the inscribed radius"),
        ({"inscribed": -0.1}, "inscribed is -0.1"),
        ({"inscribed": 0.1, "factor": np.nan}, "factor is nan"),
        ({"inscribed": 0.1, "radius": np.inf}, "radius is inf"),
    ],
)
def test_settings_without_a_sense_are_refused(fault, said):
    with pytest.raises(ConfigError, match=said):
        Inflation(**fault)


def test_a_radius_of_too_many_cells_is_refused():
    with pytest.raises(ConfigError, match="200 cells of"):
        Inflation(inscribed=0.1, radius=2.0).reach(0.01)
