"""Distances to the nearest taken cell, against SciPy's exact transform."""

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from outrider.core.distances import distances


@pytest.mark.parametrize("share", [0.001, 0.02, 0.3, 0.98])
@pytest.mark.parametrize("shape", [(40, 31), (1, 25), (25, 1), (3, 60)])
def test_it_is_the_exact_transform(shape: tuple[int, int], share: float) -> None:
    rng = np.random.default_rng(int(1000 * share) + shape[0])
    taken = rng.random(shape) < share
    taken[rng.integers(shape[0]), rng.integers(shape[1])] = True
    np.testing.assert_allclose(distances(taken, 0.05), 0.05 * distance_transform_edt(~taken), rtol=1e-14)


def test_where_nothing_is_taken_nothing_is_near() -> None:
    assert (distances(np.zeros((3, 4), np.bool_), 1.0) == np.inf).all()
