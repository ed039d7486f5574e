"""swarm2023's law on its own flights: what it prints, and that it enters its own danger zone where ours does not."""

import numpy as np
import pytest

from outrider.campaign.papers.swarm2023_flights import Approach, approach, chased, fly, target_way
from outrider.errors import ConfigError

SEEDS = range(4)


def test_the_target_flies_at_its_speed_and_brakes_to_about_1_m_s_in_the_turn() -> None:
    speed = np.linalg.norm(np.diff(target_way("mission"), axis=0), axis=1) * 10.0
    assert np.median(speed) == pytest.approx(2.0, abs=0.01)
    turn = speed[600:800]
    assert 0.8 < turn.min() < 1.4  # swarm2023 4.3: "almost 1 m per second"


def test_the_fitted_rendezvous_has_the_printed_errors_and_time() -> None:
    """Table 2 prints 0.654 m for GPS, 0.652 m for the EKF, 12 s; the bands are those of four seeds and more."""
    done = [approach({"flight": "rendezvous"}, s) for s in SEEDS]
    for name, low, high in (("GPS_inside", 0.60, 0.71), ("EKF_inside", 0.60, 0.71), ("GPS_time", 9.0, 14.5)):
        assert low < np.mean([d[name] for d in done]) < high
    assert np.mean([d["honest_inside"] for d in done]) < 0.22  # its lateness told, its noise true


def test_without_latency_the_error_is_that_of_the_noise() -> None:
    done = [approach({"flight": "rendezvous", "latency": 0.0}, s)["GPS_inside"] for s in SEEDS]
    assert np.mean(done) == pytest.approx(0.15 * 3**0.5, abs=0.02)


def test_the_law_goes_inside_its_own_danger_zone_in_the_turn() -> None:
    least = [fly(Approach(flight="mission"), s).apart[100:].min() for s in SEEDS]
    assert max(least) < 3.0
    assert min(least) > 1.5


@pytest.mark.compiled
def test_the_vector_law_above_its_filter_does_not() -> None:
    for behaviour in ("straight", "turn", "stop"):
        assert all(chased({"law": "pursue", "behaviour": behaviour}, s)["least"] > 3.0 for s in SEEDS)
    assert all(chased({"law": "zones", "behaviour": "turn"}, s)["least"] < 3.0 for s in SEEDS)


def test_a_parameter_that_there_is_not_is_named() -> None:
    with pytest.raises(ConfigError, match="lateness"):
        approach({"lateness": 1.0}, 0)
