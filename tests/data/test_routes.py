"""The network of roads."""

import numpy as np
import pytest

from outrider.data.routes import RouteGraph
from outrider.errors import DataError

GOOD = {
    "names": ("gate", "yard"),
    "nodes": np.array([[0.0, 0.0], [3.0, 4.0]]),
    "edges": np.array([[0, 1], [1, 0]]),
    "speed": np.array([1.0, np.inf]),
    "width": np.array([2.0, np.inf]),
}


def test_an_edge_is_as_long_as_the_gap_between_its_nodes() -> None:
    assert RouteGraph(**GOOD).lengths.tolist() == [5.0, 5.0]


@pytest.mark.parametrize(
    "wrong",
    [{"names": ("gate", "gate")}, {"edges": np.array([[0, 2], [1, 0]])}, {"speed": np.ones(3)}, {"width": np.ones(1)}],
)
def test_what_is_no_graph(wrong: dict) -> None:
    with pytest.raises(DataError, match="route graph"):
        RouteGraph(**(GOOD | wrong))
