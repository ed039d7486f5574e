"""A follower behind a target in closed loop: few seeds of what tests/evidence does with a thousand."""

from dataclasses import replace

import numpy as np
import pytest

from outrider.errors import ConfigError
from outrider.safety.admissible import Fixes
from outrider.safety.separation import Separation
from outrider.scenarios.chase import Chase, Law, Runs
from outrider.scenarios.chase_steps import C_DISTANCE, C_LEAST, C_SET
from outrider.sim.targets import Behaviour

LIKE = Separation(distance=3.0, lag_s=1.0, acceleration=5.0, speed=2.5, other_lag_s=1.0)


def test_the_same_seed_gives_the_same_bits() -> None:
    runs = Runs(Chase(separation=LIKE, seconds=6.0))
    first, other, again = (runs.run(Behaviour.STOP, seed) for seed in (3, 4, 3))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


@pytest.mark.compiled
@pytest.mark.parametrize("behaviour", [b for b in Behaviour if b is not Behaviour.REVERSE])
def test_the_distance_holds_whatever_the_target_does(behaviour: Behaviour) -> None:
    runs = Runs(Chase(separation=LIKE))
    for seed in range(10):
        run = runs.run(behaviour, seed)
        assert run[:, C_LEAST].min() >= 3.0
        assert (run[:, C_DISTANCE] <= run[:, C_SET] + 0.25).any()


@pytest.mark.compiled
def test_a_target_that_comes_back_is_given_room_or_refused() -> None:
    back = replace(LIKE, approach=2.0)
    runs = Runs(Chase(separation=back))
    assert min(runs.run(Behaviour.REVERSE, seed)[:, C_LEAST].min() for seed in range(10)) >= 3.0
    with pytest.raises(ConfigError, match="it takes"):
        Chase(separation=back, most=5.5)


@pytest.mark.compiled
def test_the_law_of_the_paper_enters_its_danger_zone_and_the_filter_is_what_keeps_out() -> None:
    zones = Runs(Chase(separation=LIKE, law=Law.ZONES))
    bare = Runs(Chase(separation=LIKE, law=Law.UNGUARDED))
    assert max(zones.run(Behaviour.TURN, seed)[:, C_LEAST].min() for seed in range(10)) < 3.0
    assert min(bare.run(Behaviour.SILENT, seed)[:, C_LEAST].min() for seed in range(10)) < 3.0


def test_a_rate_that_is_no_whole_number_of_periods_is_refused() -> None:
    with pytest.raises(ConfigError, match="a multiple of"):
        Chase(separation=LIKE, fixes=Fixes(rate_hz=3.0))
    with pytest.raises(ConfigError, match="latency_s"):
        Chase(separation=LIKE, fixes=Fixes(latency_s=0.25))
