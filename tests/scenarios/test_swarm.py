"""Swarms in the compiled loop: nobody too near, nobody stuck, the same bits again; and what goes wrong is seen."""

from dataclasses import replace

import numpy as np
import pytest

from outrider.errors import ConfigError
from outrider.guidance.avoidance import Avoidance
from outrider.guidance.formation import Column, join, leave, merge, split
from outrider.scenarios.swarm import Flown, Sky, Task, fly_swarm, spacing_errors
from outrider.scenarios.swarm_runs import changes
from outrider.scenarios.swarm_state import T_AHEAD, T_LINE, in_units_of
from outrider.scenarios.swarm_tasks import circle, column, convoy, crossed, crossing, doorway, head_on, rounded

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


@pytest.mark.compiled
def test_a_column_follows_round_bends_and_stops_with_its_leader() -> None:
    f = fly_swarm(column(12, 240.0, 2), 2, until_there=False, sky=Sky(radio=40.0))
    assert f.least.min() >= 1.5 and f.violations == 0
    e = spacing_errors(f)[120:, 1:]
    assert np.isfinite(e).all() and np.sqrt((e**2).mean(axis=0)).max() < 0.6
    assert f.track[-1, 0, 1] > 20.0  # it has been round a bend


@pytest.mark.compiled
def test_what_disturbs_the_first_followers_is_less_at_every_next_one() -> None:
    task = column(14, 180.0, 0)
    pace = np.zeros(1800)
    pace[900:1200], pace[1350:1550], pace[1550:] = 3.0, 3.0, 1.2  # once they have closed up
    f = fly_swarm(replace(task, pace=pace), 0, until_there=False, sky=CALM, every=1)
    e = spacing_errors(f)[900:, 1:]
    for norm in (np.abs(e).max(axis=0), np.linalg.norm(e, axis=0)):
        assert (norm[1:] <= norm[:-1]).all()
    assert np.abs(e[:, 0]).max() > 0.5  # something has been disturbed


@pytest.mark.compiled
def test_a_drone_without_a_radio_leaves_the_column_and_joins_it_again_as_the_last() -> None:
    f = fly_swarm(column(12, 200.0, 1, silent=((3, 40.0, 58.0),)), 1, until_there=False, sky=Sky(radio=40.0))
    up, ahead = f.track[:, 3, 2], f.track[:, :, 5]
    assert f.violations == 0 and up.max() > 34.0  # it has climbed out of the way
    assert ahead[78, 4] == 3 and ahead[110, 4] == 2  # who followed it closes up
    assert ahead[110, 3] == -1 and ahead[-1, 3] == 11  # and it is the last in the end
    assert abs(up[-1] - 30.0) < 0.5 and not f.aside.any()


@pytest.mark.compiled
def test_strangers_cross_a_column_and_everybody_gets_there() -> None:
    f = fly_swarm(crossed(17, 130.0, 2), 2, until_there=False, sky=Sky(radio=40.0))
    assert f.violations == 0 and f.there[-5:].all()
    assert f.ranks[1:12, 2:4].sum() > 0 and f.ranks[-5:, 2:4].sum() > 0  # both made way
    e = spacing_errors(f)
    assert np.isfinite(e[-1, 1:12]).all() and np.abs(e[-1, 1:12]).max() < 2.0  # and the column is one again


@pytest.mark.compiled
@pytest.mark.parametrize(("n", "seed"), [(9, 1), (13, 2)])
def test_a_convoy_flies_the_order_that_the_functions_on_orders_say(n: int, seed: int) -> None:
    """One joins, two leave, the rear half splits off and merges again; nobody is told the order."""
    f = fly_swarm(convoy(n, 240.0, seed), seed, until_there=False, sky=Sky(radio=40.0))
    assert f.violations == 0 and f.least.min() >= 1.5 and not f.aside.any()
    half = n // 2
    order = Column(tuple(map(str, range(1, n - 1))), "0")
    order = leave(leave(join(order, str(n - 1)), "2"), str(half + 2))
    front, rear = split(order, str(half + 1), str(half))  # who leads the second part follows nobody
    front = leave(front, str(half))
    lanes = f.track[:, :, T_LINE].astype(int)
    apart = np.flatnonzero((lanes[:, half:] == 1).sum(axis=1) == len(rear.order) + 1)
    assert apart.size
    row = f.track[apart[len(apart) // 2], :, T_AHEAD].astype(int)
    for part in (front, rear):
        assert [row[int(d)] for d in part.order] == [int(part.ahead(d)) for d in part.order]
    whole = merge(front, Column((str(half), *rear.order), "nobody"))
    last = f.track[-1, :, T_AHEAD].astype(int)
    assert [last[int(d)] for d in whole.order] == [int(whole.ahead(d)) for d in whole.order]
    assert last[2] == last[half + 2] == -1 and f.there[2] and f.there[half + 2]
    assert np.nanmax(np.abs(spacing_errors(f)[-20:, 1:])) < 1.5  # it has closed up
    assert f.track[:, int(rear.order[-1]), 1].min() < -19.0 < -1.0 < f.track[:, 1, 1].min()  # only the rear: the lane
    said = [c["text"] for c in changes(f)]
    for word in ("leaves", "splits off", "merges, behind", "joins, behind"):
        assert any(word in t for t in said)


def test_arc_lengths_of_two_trails_are_compared_where_they_can_be() -> None:
    fork = 100.0
    assert in_units_of(0, 90.0, np.inf, fork, 0, 95.0, np.inf) == 95.0
    assert in_units_of(0, 90.0, np.inf, fork, 1, 130.0, np.inf) == 130.0  # it comes to the fork yet
    assert in_units_of(0, 120.0, np.inf, fork, 1, 130.0, np.inf) == -np.inf  # it has passed it
    assert in_units_of(1, 130.0, np.inf, fork, 0, 140.0, np.inf) == -np.inf
    assert in_units_of(1, 130.0, np.inf, fork, 0, 140.0, 6.0) == 146.0  # who has merged knows
    assert in_units_of(0, 140.0, 6.0, fork, 1, 138.0, np.inf) == 132.0


@pytest.mark.compiled
@pytest.mark.parametrize("task", [circle, crossing])
def test_a_drone_without_a_radio_gets_out_of_the_way_and_comes_back(task) -> None:
    silent = np.full((16, 1, 2), np.inf)
    silent[3, 0] = 5.0, 25.0
    f = fly_swarm(replace(task(16), silent=silent), 1)
    good(f)
    assert f.track[:, 3, 2].max() > 35.0 and abs(f.track[-1, 3, 2] - 30.0) < 1.0


def test_a_rounded_way_is_closed_even_and_no_tighter_than_its_bends() -> None:
    p = rounded(np.array([[0.0, 0.0], [60.0, 0.0], [60.0, 40.0], [0.0, 40.0]]), 10.0)
    step = np.hypot(*(np.roll(p, -1, axis=0) - p).T)
    assert step.max() < 1.6
    assert step.sum() == pytest.approx(200.0 - 8.0 * 10.0 + 2.0 * np.pi * 10.0, rel=1e-3)
    assert p.min() > -1e-9 and p[:, 0].max() < 60.0 + 1e-9 and p[:, 1].max() < 40.0 + 1e-9
