"""Teams of more than two whose robots talk in pairs only: as good as one filter, whatever the way of the news."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_cooperation import fused, points

from outrider.data import Gaussian, Verdict
from outrider.filters.cooperative import Member, Method, Source, fuse_team
from outrider.filters.cooperative.fusion import TEAM
from outrider.filters.cooperative.gossip import News, Teammate
from outrider.filters.cooperative.ledger import Relative
from outrider.filters.cooperative.robot import FALSE_ALARM, Filter, Records, gates
from outrider.models import sensors as s
from outrider.models.motion import LAYOUTS, LaggedFollower, Motion
from outrider.models.sensors import Sensor
from outrider.typing import Floats

STEP, MODEL, LAYOUT = 0.1, LaggedFollower(acceleration=0.3), LAYOUTS[Motion.FOLLOWER]
FIX, SEEN = s.Position(sigma=0.5), s.RelativePose()
VARIANCES = np.array([0.01] * 3 + [np.inf] * 5)
GATE = gates(FALSE_ALARM)


def motions(rng: np.random.Generator, robots: int, n: int) -> Floats:
    """(robots, n, 6) drawn from the model."""
    x, out = rng.normal(size=(robots, 6)), np.zeros((robots, n, 6))
    L = np.linalg.cholesky(0.09 * np.array([[STEP**3 / 3, STEP**2 / 2], [STEP**2 / 2, STEP]]))
    for k in range(n):
        out[:, k] = x
        w = rng.normal(size=(robots, 3, 2)) @ L.T
        x = np.hstack([x[:, :3] + STEP * x[:, 3:] + w[..., 0], x[:, 3:] + w[..., 1]])
    return out


class Team:
    """Robots with fixes for some, each to be driven by hand."""

    def __init__(self, seed: int, robots: int, n: int, fixes: tuple[int, ...]) -> None:
        self.rng, self.now = np.random.default_rng(seed), 0.0
        self.truth = motions(self.rng, robots, n)
        P = np.diag([1.0] * 3 + [0.3] * 3)
        first = [Gaussian(x + self.rng.normal(size=6) * np.sqrt(np.diag(P)), P, LAYOUT) for x in self.truth[:, 0]]
        self.members = [
            Member(name=f"r{i}", motion=Motion.FOLLOWER, model=MODEL, belief=b) for i, b in enumerate(first)
        ]
        t: Floats = np.arange(1.0, n) * STEP
        self.mates = [Teammate(i, self._alone(i, t, i in fixes), self._all(), 0.0) for i in range(robots)]
        self.serial = 0

    def _all(self) -> Filter:
        none = Records(t=np.zeros(0), source=np.zeros(0, np.int64), z=np.zeros((0, 8)), r=np.zeros((0, 8)))
        return Filter(self.members, [], none, np.zeros(0), 0.0, gate=GATE)

    def _alone(self, i: int, t: Floats, fixed: bool) -> Filter:
        z, r = np.zeros((t.size, 8)), np.full((t.size, 8), np.inf)
        z[:, :3], r[:, :3] = self.truth[i, 1:, :3] + 0.5 * self.rng.normal(size=(t.size, 3)), 0.25
        k = slice(0, t.size if fixed else 0)
        records = Records(t=t[k], source=np.zeros(t[k].size, np.int64), z=z[k], r=r[k])
        sources = [Source(robot=f"r{i}", sensor=FIX, t=t, z=z[:, :3])] if fixed else []
        return Filter([self.members[i]], sources, records, np.zeros(0), 0.0, gate=GATE, carries=True)

    def sees(self, i: int, j: int, step: int) -> Relative:
        """Robot i measures robot j, and both make a node of it."""
        z = np.zeros(8)
        z[1:4], z[7] = self.truth[j, step, :3] - self.truth[i, step, :3] + 0.1 * self.rng.normal(size=3), 1.0
        self.serial += 1
        for m, partner in ((i, j), (j, i)):
            self.mates[m].own.run(step * STEP)
            self.mates[m].close(partner)
        return Relative(observer=i, observed=j, t=step * STEP, serial=self.serial, code=int(Sensor.RELATIVE_POSE),
                        theta=SEEN.theta(), z=z, r=VARIANCES)  # fmt: skip


def tell(sender: Teammate, receiver: Teammate) -> News:
    return sender.news(receiver.number)


@settings(max_examples=10)
@given(seed=st.integers(0, 2**32 - 1), data=st.data())
def test_news_may_come_in_any_order_and_twice(seed: int, data: st.DataObject) -> None:
    """Third robots hear of ten meetings by messages that are shuffled and doubled: the same ledger to 1e-9."""
    team = Team(seed, 4, 13, (0, 1))
    told: list[News] = []
    for step in range(1, 11):
        i, j = team.rng.permutation(3)[:2].tolist()
        record = team.sees(i, j, step)
        for a, b in ((i, j), (j, i)):
            team.mates[a].note(record)
            team.mates[a].hear(tell(team.mates[b], team.mates[a]))
        for a in (i, j):
            team.mates[a].settle()
        told += [tell(team.mates[i], team.mates[3]), tell(team.mates[j], team.mates[3])]
    ledgers = []
    for order in (range(len(told)), data.draw(st.permutations([*range(len(told)), *range(len(told))]))):
        late = Teammate(3, team.mates[3].own, team._all(), 0.0)
        for k in order:
            late.hear(told[k])
            late.settle()
        ledgers.append(late.ledger)
    np.testing.assert_array_equal(ledgers[0].node, ledgers[1].node)
    np.testing.assert_allclose(ledgers[1].joint.belief.x, ledgers[0].joint.belief.x, atol=1e-9)
    np.testing.assert_allclose(ledgers[1].joint.belief.P, ledgers[0].joint.belief.P, atol=1e-9)


def team_errors(robots: int, fixes: tuple[int, ...], seeds: range, every: int) -> dict[Method, tuple[float, float]]:
    """RMSE of places [m] and NEES per degree of freedom over seeds, robots and the second half of the time."""
    t, out = STEP * np.arange(30, 60), {}
    for method in (Method.JOINT, Method.DISTRIBUTED):
        squares, nees = [], []
        for seed in seeds:
            team = points(np.random.default_rng(seed), robots, 60, every, fixes)
            done = fused(team, method, t)
            for i in range(robots):
                e, P = done.x[f"r{i}"] - team[2][i, 30:60], done.P[f"r{i}"]
                squares.append(np.sum(e[:, :3] ** 2, axis=1))
                nees.append(np.einsum("ni,ni->n", e, np.linalg.solve(P, e[..., None])[..., 0]) / 6.0)
        out[method] = float(np.sqrt(np.mean(squares))), float(np.mean(nees))
    return out


@pytest.mark.compiled
@pytest.mark.parametrize(("robots", "fixes", "seeds"), [(4, (0,), range(6)), (4, (), range(12)), (8, (0,), range(1))])
def test_teams_that_meet_often_are_as_good_as_one_filter(robots: int, fixes: tuple[int, ...], seeds: range) -> None:
    found = team_errors(robots, fixes, seeds, 5)
    joint, ours = found[Method.JOINT], found[Method.DISTRIBUTED]
    assert ours[0] < 1.05 * joint[0]
    assert ours[1] == pytest.approx(joint[1], abs=0.08)  # as honest as the joint filter on the same draws


def test_gossip_brings_news_of_robots_that_one_never_meets() -> None:
    """A chain of three: the end that has no fixes hears from the other end by the one between."""
    team = Team(5, 3, 12, (0,))
    for step, i, j in ((2, 0, 1), (4, 1, 2), (6, 0, 1), (8, 1, 2)):
        record = team.sees(i, j, step)
        for m in (i, j):
            team.mates[m].note(record)
        news = tell(team.mates[i], team.mates[j]), tell(team.mates[j], team.mates[i])
        team.mates[j].hear(news[0])
        team.mates[i].hear(news[1])
        team.mates[i].settle()
        team.mates[j].settle()
    end = team.mates[2]
    assert end.ledger.node.tolist() == pytest.approx([0.6, 0.8, 0.8])
    assert {key[1:3] for key in end.outcomes} == {(0, 1), (1, 2)}
    assert all(o.verdict is Verdict.USED for o in end.outcomes.values())
    x, P = end.ledger.belief(2)
    assert np.sqrt(np.trace(P[:3, :3])) < 0.7 and np.linalg.norm(x[:3] - team.truth[2, 8, :3]) < 1.5


def test_distributed_falls_back_where_a_team_is_too_large(rng: np.random.Generator) -> None:
    team = points(rng, TEAM + 1, 6, 5)
    done, safe = (fuse_team(team[0], team[1], m, np.array([0.5]), start=0.0) for m in (Method.DISTRIBUTED, Method.CI))
    assert np.isfinite(done.x["r0"]).all() and done.counts().keys() == safe.counts().keys()
