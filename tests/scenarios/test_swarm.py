"""Swarms in the compiled loop: nobody too near, nobody stuck, the same bits again; and what goes wrong is seen."""

import numpy as np
import pytest

from outrider.errors import ConfigError
from outrider.guidance.avoidance import Avoidance
from outrider.scenarios.swarm import Flown, Sky, Task, fly_swarm
from outrider.scenarios.swarm_tasks import circle, crossing, doorway, head_on

CALM = Sky(noisy=False)


def good(f: Flown, separation: float = 1.5) -> None:
    assert f.there.all()
    assert f.least.min() >= separation and f.violations == 0 and f.in_walls == 0


@pytest.mark.compiled
@pytest.mark.parametrize("task", [circle, head_on, crossing, doorway])
@pytest.mark.parametrize("n", [2, 8, 16])
def test_swaps_end_without_a_violation(task, n: int) -> None:
    f = fly_swarm(task(n), 1)
    good(f)
    assert f.ranks.sum() == n * round(f.seconds / 0.1)
    assert f.error.max() < 0.6 and f.heard > 0


def test_two_that_mirror_each_other_exactly_pass() -> None:
    f = fly_swarm(head_on(2), 0, sky=CALM)
    good(f)
    x, y = f.track[:, :, 0], f.track[:, :, 1]
    np.testing.assert_allclose(x[:, 0], -x[:, 1], atol=1e-6)
    assert y[np.abs(x[:, 0]).argmin(), 0] < -0.5  # on the right


@pytest.mark.compiled
def test_the_same_seed_gives_the_same_bits_and_another_seed_others() -> None:
    a, b, c = fly_swarm(circle(8), 3), fly_swarm(circle(8), 3), fly_swarm(circle(8), 4)
    assert a.track.tobytes() == b.track.tobytes() and a.ranks.tobytes() == b.ranks.tobytes()
    assert a.least[0] != c.least[0]


@pytest.mark.compiled
def test_the_judge_sees_drones_that_do_not_heed_each_other() -> None:
    blind = Avoidance(separation=0.01, margin=0.0, comfort=0.0)
    f = fly_swarm(circle(8), 1, rules=blind)
    assert f.least.min() < 1.0
    deaf = fly_swarm(circle(8), 1, sky=Sky(loss=0.999))
    assert deaf.violations > 0


@pytest.mark.compiled
def test_a_wall_is_a_wall() -> None:
    start = np.array([[-10.0, 0.0, 30.0], [-40.0, 20.0, 30.0]])
    goal = np.array([[10.0, 0.0, 30.0], [-40.0, 20.0, 30.0]])
    task = Task(start=start, kind=np.zeros(2, np.int64), goals=goal[:, None], seconds=30.0,
                walls=np.array([[0.0, -30.0, 0.0, 30.0]]))  # fmt: skip
    f = fly_swarm(task, 1)
    assert not f.there[0] and f.track[:, 0, 0].max() < -0.75 and f.in_walls == 0


@pytest.mark.parametrize(("name", "value"), [("loss", 1.0), ("loss", -0.1), ("late_s", 5.0), ("fix_p", 0.0)])
def test_a_sky_that_cannot_be(name: str, value: float) -> None:
    with pytest.raises(ConfigError, match=name):
        Sky(**{name: value})
