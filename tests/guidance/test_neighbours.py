"""Neighbours by a hashed grid, against scipy's tree."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from outrider.errors import ConfigError, UsageError
from outrider.guidance.neighbours import NOBODY, Cells


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1), st.integers(1, 40), st.floats(0.5, 30.0), st.floats(0.5, 20.0))
def test_the_nearest_are_those_of_a_tree(seed: int, n: int, reach: float, side: float) -> None:
    p = np.random.default_rng(seed).uniform(-25.0, 25.0, (n, 2))
    got = Cells(n, side).near(p, reach, 5)
    d, ids = cKDTree(p).query(p, k=np.arange(1, 7), distance_upper_bound=reach)
    d, ids = d[:, 1:], np.where(np.isfinite(d[:, 1:]), ids[:, 1:], NOBODY)
    np.testing.assert_array_equal(got, ids)


def test_equal_distances_are_told_apart_by_number_and_heights_by_layers() -> None:
    p = np.array([[0.0, 0.0, 10.0], [3.0, 0.0, 10.0], [-3.0, 0.0, 10.0], [0.0, 3.0, 14.0]])
    assert Cells(4, 2.0).near(p, 5.0, 3, layer=3.0)[0].tolist() == [1, 2, NOBODY]
    assert Cells(4, 2.0).near(p, 5.0, 3)[0].tolist() == [1, 2, 3]
    assert Cells(4, 2.0).near(p, 5.0, 1)[3].tolist() == [0]


def test_all_in_one_place_and_far_away_from_home() -> None:
    p = np.full((6, 2), -1e6) + np.arange(6)[:, None] * 1e-3
    assert (Cells(6, 1.0).near(p, 1.0, 5) != NOBODY).all()
    assert Cells(0, 1.0).near(np.zeros((0, 2)), 1.0, 3).shape == (0, 3)


@pytest.mark.parametrize("side", [0.0, -1.0, np.nan, np.inf])
def test_cells_need_a_side(side: float) -> None:
    with pytest.raises(ConfigError):
        Cells(3, side)


def test_points_that_do_not_fit_are_refused() -> None:
    for p in (np.zeros((2, 2)), np.zeros(3), np.full((3, 2), np.nan)):
        with pytest.raises(UsageError, match="finite numbers"):
            Cells(3, 1.0).near(p, 1.0, 2)
