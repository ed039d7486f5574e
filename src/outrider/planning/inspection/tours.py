"""Which places to visit, in what order, within a length: greedy by what a metre shows, and 2-opt."""

import numpy as np

from outrider._kernel import kernel
from outrider.planning.inspection.places import Places
from outrider.typing import Bools, Floats, Ints

SHORT = 1.0  # m that count as driven for a place on the way


@kernel
def two_opt(way: Floats, tour: Ints) -> bool:
    """Turn round a stretch of the tour (k,) wherever that makes it shorter; it keeps its first place. Whether any."""
    n, better = tour.size, False
    again = True
    while again:
        again = False
        for i in range(1, n - 1):
            for j in range(i + 1, n):
                a, b, c = tour[i - 1], tour[i], tour[j]
                gain = way[a, b] - way[a, c]
                if j + 1 < n:
                    gain += way[c, tour[j + 1]] - way[b, tour[j + 1]]
                if gain > 1e-9:
                    u, v = i, j
                    while u < v:
                        tour[u], tour[v] = tour[v], tour[u]
                        u, v = u + 1, v - 1
                    again = better = True
    return better


def tour_length(way: Floats, tour: Ints) -> float:
    """m."""
    return float(way[tour[:-1], tour[1:]].sum())


def choose_tour(places: Places, shown: Bools, length: float, *, times: int = 1, least: float = 1.0) -> Ints:
    """Places to visit, from place 0 on, at most `length` [m] long.

    shown : (places, points) what can be seen from where;  times : from how many places each point should be seen.
    Each step adds the place that shows the most that is still wanted for the metres that it adds, what is seen on the
    way included, until none shows `least` points; then 2-opt shortens the tour.
    """
    tour, shows, way = np.zeros(1, np.int64), shown.astype(np.float32), places.way
    while True:
        wanted = np.maximum(times - shown[places.route(tour)].sum(axis=0), 0) / times
        gain = shows @ wanted.astype(np.float32)
        longer, where = _insertions(way, tour)
        longer[tour] = np.inf
        possible = (gain >= least) & (tour_length(way, tour) + longer <= length)
        if not possible.any():
            return tour
        score = np.where(possible, gain / (longer + SHORT), -1.0)
        best = int(np.argmax(score))
        tour = np.ascontiguousarray(np.insert(tour, where[best] + 1, best))
        two_opt(way, tour)


def _insertions(way: Floats, tour: Ints) -> tuple[Floats, Ints]:
    """For every place: how much longer the tour gets by it at best [m], and after which of its stops."""
    detour = way[tour]
    longer = detour.copy()
    longer[:-1] += detour[1:] - way[tour[:-1], tour[1:]][:, None]
    where = longer.argmin(axis=0).astype(np.int64)
    return longer[where, np.arange(way.shape[0])], where
