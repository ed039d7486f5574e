"""Runs of a team: what agents are told, how runs end, and that nothing depends on what it should not depend on."""

import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import pytest
from rovers import GNSS, navigator, rover

from outrider.data import Stream
from outrider.data.agents import Action, Message
from outrider.errors import ConfigError
from outrider.models.vehicles import Mecanum
from outrider.sim.engine import Ending, simulate
from outrider.sim.radio import Radio
from outrider.sim.truth import EPOCH
from outrider.sim.world import Mover, Wall, World
from outrider.team import Schedule, Tour
from outrider.typing import Floats

FIELD = World(name="field")
STRAIGHT = Schedule(t_s=np.array([0.0]), u=np.array([[1.0, 0.0, 0.0]]))


@dataclass
class Puppet:
    """Commands what a function of seconds says, and keeps what it is told."""

    u: Floats
    period_s: float = 0.1
    talks: bool = False
    told: list[tuple[int, Stream]] = field(default_factory=list)
    heard: list[tuple[int, Message]] = field(default_factory=list)
    name: str = ""

    def act(self, t: int, records: Sequence[Stream], inbox: Sequence[Message]) -> Action:
        self.told += [(t, s) for s in records]
        self.heard += [(t, m) for m in inbox]
        messages = (Message(sender=self.name, topic="here", t=t),) if self.talks else ()
        return Action(command=self.u, messages=messages)


def box(east: float, size: float = 2.0) -> Wall:
    corners = np.array([[east, -size], [east + size, -size], [east + size, size], [east, size]])
    return Wall(name="shed", outline=corners, low=0.0, high=3.0)


def test_a_robot_hits_what_stands_in_its_way() -> None:
    done = simulate(World(name="yard", walls=(box(5.0),)), [rover(agent=STRAIGHT)], 30.0, 1)
    p = done.truth["robot"].p
    assert done.ending is Ending.COLLISION and done.hit is not None and done.hit.what == "shed"
    assert abs(5.0 - p[-1, 0] - rover().hull.radius) < 0.1 and "collides with shed after" in done.sentence
    assert max(int(s.t.max()) for s in done.log) <= done.ended


def test_a_mover_is_met_when_it_is_there() -> None:
    crossing = Mover(name="pedestrian", t_s=np.array([0.0, 10.0]), p=np.array([[4.0, -5.0, 0.0], [4.0, 5.0, 0.0]]))
    assert simulate(World(name="street", movers=(crossing,)), [rover(agent=STRAIGHT)], 20.0, 1).hit is not None
    late = Mover(name="pedestrian", t_s=np.array([12.0, 22.0]), p=crossing.p)
    assert simulate(World(name="street", movers=(late,)), [rover(agent=STRAIGHT)], 20.0, 1).hit is None


def test_robots_collide_with_each_other() -> None:
    east, west = rover("a", agent=STRAIGHT), rover("b", agent=STRAIGHT, start=(8.0, 0.0, 0.0, np.pi))
    done = simulate(FIELD, [east, west], 30.0, 1)
    assert done.hit is not None and {done.hit.robot, done.hit.what} == {"a", "b"}
    gap = np.linalg.norm(done.truth["a"].p[-1] - done.truth["b"].p[-1]) - 2 * east.hull.radius
    assert -0.2 < gap < 0.0


def test_a_tour_is_driven_on_the_estimate() -> None:
    goal = np.array([[12.0, 0.0, 0.0], [12.0, 8.0, 0.0]])
    robot = rover(agent=Tour(navigator(), goal, speed=1.5, reach=0.4))
    done = simulate(FIELD, [robot], 60.0, 3)
    truth, estimate = done.truth["robot"], done.log.streams["estimate"]
    assert done.ending is Ending.GOAL and [n.text for n in done.notes][-1] == "waypoint 2 of 2 reached"
    assert np.linalg.norm(truth.p[-1, :2] - goal[-1, :2]) < 0.6
    error = estimate.z[:, :2] - truth.at(estimate.t).p[:, :2]
    assert np.sqrt(np.mean(np.sum(error[20:] ** 2, axis=1))) < 0.1


def test_an_agent_is_told_every_record_once_and_none_before_it_arrived() -> None:
    puppet = Puppet(np.array([1.0, 0.0, 0.2]))
    done = simulate(FIELD, [rover(agent=puppet)], 10.0, 1)
    for name, whole in done.log.streams.items():
        told = [(t, s) for t, s in puppet.told if s.name == name]
        assert all((s.t_arrival <= t).all() and (s.t_arrival > t - 100_000_000 - 1).all() for t, s in told)
        stamps = np.concatenate([s.t for _, s in told])
        due = whole.t[whole.t_arrival <= puppet.told[-1][0]]
        np.testing.assert_array_equal(np.sort(stamps), np.sort(due))


def test_an_agent_that_commands_a_plan_makes_the_same_motion() -> None:
    u = np.array([0.8, 0.0, 0.3])
    planned = simulate(FIELD, [rover(agent=Schedule(t_s=np.zeros(1), u=u[None]))], 5.0, 1)
    decided = simulate(FIELD, [rover(agent=Puppet(u))], 5.0, 1)
    np.testing.assert_array_equal(planned.truth["robot"].p, decided.truth["robot"].p)
    for name, s in planned.log.streams.items():
        np.testing.assert_allclose(decided.log.streams[name].z, s.z, rtol=1e-13, atol=1e-13)


def test_messages_arrive_when_the_radio_says() -> None:
    a, b = (Puppet(np.zeros(3), name=n, talks=True, period_s=0.05) for n in "ab")
    team = [rover("a", agent=a), rover("b", agent=b, start=(5.0, 5.0, 0.0, 0.0))]
    done = simulate(FIELD, team, 2.0, 1, radio=Radio(latency_s=0.12))
    assert done.air.sent == 2 * 40 and len(a.heard) == len(b.heard) == 37
    assert {t - m.t for t, m in a.heard} == {150_000_000}  # the next look of the agent


def test_another_robot_changes_nothing_of_the_first() -> None:
    alone = simulate(FIELD, [rover("a", agent=STRAIGHT)], 8.0, 5)
    other = rover("b", agent=STRAIGHT, start=(0.0, 9.0, 0.0, 0.0))
    for team in ([rover("a", agent=STRAIGHT), other], [other, rover("a", agent=STRAIGHT)]):
        both = simulate(FIELD, team, 8.0, 5)
        np.testing.assert_array_equal(both.truth["a"].p, alone.truth["a"].p)
        for name, s in alone.log.streams.items():
            np.testing.assert_array_equal(both.log.streams[f"a/{name}"].z, s.z)
            assert not np.array_equal(both.log.streams[f"b/{name}"].z, s.z)


@pytest.mark.compiled
def test_two_processes_give_the_same_bytes() -> None:
    script = (
        "import sys; sys.path.insert(0, sys.argv[1]); from rovers import rover, navigator; import numpy as np;"
        "from outrider.sim.engine import simulate; from outrider.sim.world import World;"
        "from outrider.team import Tour;"
        "r = rover(agent=Tour(navigator(), np.array([[6.0, 2.0, 0.0]])));"
        "print(simulate(World(name='f'), [r], 10.0, 4).log.sha256)"
    )
    here = str(__import__("pathlib").Path(__file__).parent)
    runs = [subprocess.run([sys.executable, "-c", script, here], capture_output=True, text=True) for _ in range(2)]
    assert runs[0].stdout == runs[1].stdout and len(runs[0].stdout.strip()) == 64, runs[0].stderr


@pytest.mark.parametrize(
    ("words", "team"),
    [
        ("name of its own", lambda: [rover("a", agent=STRAIGHT), rover("a", agent=STRAIGHT)]),
        ("no agent", lambda: [rover()]),
        ("multiple of", lambda: [rover(agent=Puppet(np.zeros(3), period_s=0.0123))]),
        ("commands", lambda: [rover(agent=Puppet(np.array([np.nan, 0.0, 0.0])))]),
        ("commands", lambda: [rover(agent=Puppet(np.zeros(2)))]),
        ("one gravity", lambda: [rover(agent=STRAIGHT, vehicle=Mecanum(gravity=1.62))]),
        ("two sensors", lambda: [rover(agent=STRAIGHT, sensors=(GNSS, GNSS))]),
    ],
)
def test_impossible_teams_are_refused(words: str, team) -> None:
    with pytest.raises(ConfigError, match=words):
        simulate(FIELD, team(), 5.0, 1)


def test_a_robot_that_starts_inside_a_wall_is_refused() -> None:
    with pytest.raises(ConfigError, match="shed"):
        simulate(World(name="yard", walls=(box(-1.0),)), [rover(agent=STRAIGHT)], 5.0, 1)


def test_time_starts_where_it_should() -> None:
    done = simulate(FIELD, [rover(agent=STRAIGHT)], 3.0, 1)
    assert done.ending is Ending.TIME and done.log.span[0] == EPOCH and done.ended == EPOCH + 3_000_000_000
