"""Which trials of a campaign no other beats in both of two values, where less or more is better."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from outrider.plot.campaign import pareto_figure, undominated


@given(st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)), min_size=1, max_size=20))
def test_undominated_against_every_pair(rows: list[tuple[int, int]]) -> None:
    costs = np.array(rows, float)
    found = {tuple(c) for c in costs[undominated(costs)]}
    best = {tuple(a) for a in costs if not any((b <= a).all() and (b < a).any() for b in costs)}
    assert found == best


def test_of_distances_more_is_better() -> None:
    error, apart = np.array([1.0, 2.0, 3.0]), np.array([3.0, 4.0, 2.0])
    ax = pareto_figure(error, apart, "estimate.rmse_m", "separations.a-b.distance_m").axes[0]
    assert np.asarray(ax.lines[1].get_xdata()).tolist() == [1.0, 2.0]
    assert "less is better" in ax.get_xlabel() and "more is better" in ax.get_ylabel()
