"""Fig. 2 of swarm2023: along curves of the trail it keeps nearer to the path than by the line of sight, at a price."""

import numpy as np
import pytest

from outrider.scenarios.trail_lines import Guide, Way, fly_trail, target_path


def rmse(way: Way, guide: Guide, seeds: int = 3) -> float:
    return float(np.mean([fly_trail(way, guide, s).rmse for s in range(seeds)]))


@pytest.mark.parametrize("way", list(Way))
def test_curves_keep_nearer_to_the_path_than_the_line_of_sight(way: Way) -> None:
    los = rmse(way, Guide.LOS)
    assert rmse(way, Guide.CURVE_2) < los
    assert rmse(way, Guide.CURVE_3) < los


def test_in_wind_the_pieces_are_the_best() -> None:
    by = {guide: rmse(Way.WIND, guide, 1) for guide in Guide}
    assert min(by, key=lambda g: by[g]) is Guide.PIECES


def test_the_same_seed_gives_the_same_flight() -> None:
    a, b = (fly_trail(Way.RANDOM, Guide.CURVE_3, 5) for _ in range(2))
    np.testing.assert_array_equal(a.own, b.own)
    assert a.micros > 0.0


def test_the_turn_is_by_90_degrees() -> None:
    q = target_path(Way.TURN, 0, speed=2.0, seconds=60.0)
    np.testing.assert_allclose(np.diff(q, axis=0)[[5, -5], :2] / 0.1, [[0.0, 2.0], [-2.0, 0.0]], atol=1e-6)
