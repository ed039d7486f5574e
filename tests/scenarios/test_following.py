"""One drone follows another through scenario files: refusals, what the target may do, and that they never meet."""

from functools import cache
from typing import Any

import numpy as np
import pytest

from outrider.errors import ConfigError
from outrider.filters.following import Outcome
from outrider.guidance.rendezvous import Signal, Stage, Why
from outrider.scenarios.build import Cast, build
from outrider.scenarios.files import load_scenario, parse_scenario
from outrider.scenarios.followed import pursuers
from outrider.scenarios.leading import BEHAVIOURS
from outrider.scenarios.registry import find_scenario
from outrider.sim.engine import Ending, Simulation
from outrider.sim.truth import EPOCH
from outrider.team.pursuer import Pursuer

R_D = 3.0


@cache
def run(name: str, **given: object) -> tuple[Cast, Simulation, Pursuer, np.ndarray]:
    """A built-in scenario, its follower, and the true distance at every step of the follower."""
    cast = build(*load_scenario(name, {"duration_s": 45.0, **given} if name == "follow-leader" else given))
    done = cast.run()
    agent = next(r.agent for r in cast.team if r.name == "follower")
    assert isinstance(agent, Pursuer)
    own = done.truth["follower"]
    return cast, done, agent, np.linalg.norm(own.p - done.truth["target"].at(own.t).p, axis=1)


def described(**changes: Any) -> dict[str, Any]:
    """A short scenario of a leader and a follower; changes by dotted key."""
    found = find_scenario("follow-leader")
    data = {"duration_s": 1.0, **found.describe(found.config())}
    for key, value in changes.items():
        *way, last = key.split("__")
        node = data
        for word in way:
            node = node[word]
        node[last] = value
    return data


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"team__follower__mission__leader": "nobody"}, "no robot 'nobody' to follow"),
        ({"team__follower__mission__leader": "follower"}, "no robot 'follower' to follow"),
        ({"team__follower__mission__speed": 1.5}, "1.5 m/s to follow target, which flies 2 m/s"),
        ({"team__follower__mission__gnss": "gps"}, "no sensor 'gps'"),
        ({"team__follower__mission__zones": {"danger": 9.0, "zone": 8.0}}, "0 < danger < zone"),
        ({"team__follower__mission__law": "los"}, "law"),
        ({"team__target__mission__tells": "gps"}, "no sensor 'gps'"),
        ({"team__target__mission__speeds": [1.0, 2.0, 3.0]}, "3 speeds for 2 waypoints"),
        ({"team__target__mission__waypoints": [[1.0]]}, "waypoint"),
        ({"team__follower__vehicle": {"type": "differential"}}, "only who flies follows"),
    ],
)
def test_what_cannot_be_is_refused_with_a_remedy(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        build(parse_scenario(described(**changes)))


def test_a_carried_leader_flies_through_its_waypoints_at_its_speed() -> None:
    data = described(duration_s=40.0, team__target__mission={
        "type": "lead", "waypoints": [[20.0, 0.0, 10.0], [20.0, 20.0, 16.0]], "speed": 2.0, "waits_s": [3.0, 0.0],
    })  # fmt: skip
    truth = build(parse_scenario(data)).team[0].track
    assert truth is not None
    assert np.linalg.norm(truth.v, axis=1).max() < 2.05
    for point in ([20.0, 0.0, 10.0], [20.0, 20.0, 16.0]):
        assert np.linalg.norm(truth.p - point, axis=1).min() < 0.1
    at_rest = np.linalg.norm(truth.v, axis=1) < 0.06
    waited = at_rest & (np.linalg.norm(truth.p - [20.0, 0.0, 10.0], axis=1) < 0.2)
    assert 2.0 < waited.sum() * truth.dt < 5.0


@pytest.mark.compiled
@pytest.mark.parametrize("target", sorted(BEHAVIOURS))
def test_whatever_the_target_does_the_distance_is_kept(target: str) -> None:
    """Of the behaviours the reverse one alone may come nearer than R_d: the hard floor is 1.5 m."""
    _, done, agent, distance = run("follow-leader", target=target, seed=3)
    assert done.ending in (Ending.TIME, Ending.GOAL)
    assert distance.min() > (1.5 if target == "reverse" else R_D)
    assert agent.counts[Stage.LOCALISE, Why.FIRST] == (target != "clock")


@pytest.mark.compiled
def test_a_target_that_falls_silent_is_searched_and_found() -> None:
    _, _, agent, distance = run("follow-leader", target="silent", seed=3, duration_s=55.0)
    assert agent.counts[Stage.PREDICT, Why.SILENT] == 1
    assert agent.counts[Stage.SEARCH, Why.LOST] == 1
    assert sum(n for (_, why), n in agent.counts.items() if why is Why.FOUND) == 1
    assert distance.min() > R_D
    assert distance[-1] < 8.0  # the longer it was silent, the farther the safety filter had held it back


@pytest.mark.compiled
def test_a_jump_of_50_m_is_refused_and_then_believed_with_a_reason() -> None:
    """Two seconds of fixes that are somewhere else: the first are refused, those that agree are another place."""
    _, done, agent, _ = run("follow-leader", target="spoofed", seed=3)
    assert agent.bearings.outcomes["target", Outcome.GATED] >= 4  # two on the way there, two on the way back
    assert agent.bearings.outcomes["target", Outcome.REACQUIRED] == 2
    said = [n for n in done.notes if Outcome.REACQUIRED.value in n.text]
    assert [15.0 < (n.t - EPOCH) * 1e-9 < 18.5 for n in said] == [True, True]
    assert np.abs(done.truth["follower"].p[:, 1]).max() < 12.0


@pytest.mark.compiled
def test_clocks_that_disagree_are_named_and_it_hovers() -> None:
    _, done, agent, _ = run("follow-leader", target="clock", seed=3)
    assert agent.mission.stage is Stage.HOLD
    assert agent.mission.why is Why.CLOCKS
    assert any("clocks of the two aircraft disagree" in n.text for n in done.notes)
    assert np.linalg.norm(done.truth["follower"].v[-1]) < 0.05


@pytest.mark.compiled
def test_blocked_fixes_are_named_and_survived() -> None:
    _, done, agent, distance = run("swarm2023-blocked")
    assert agent.blocked == 1
    assert agent.mission.signal is Signal.FIXED
    told = [(n.t - EPOCH) * 1e-9 for n in done.notes if Signal.BLOCKED.value in n.text]
    assert len(told) == 1 and 9.0 < told[0] < 11.0
    assert distance.min() > R_D


@pytest.mark.compiled
def test_the_paper_enters_its_danger_zone_and_the_principled_one_does_not() -> None:
    assert run("swarm2023-rendezvous", preset="paper")[3].min() < R_D
    assert run("swarm2023-rendezvous")[3].min() > R_D


@pytest.mark.compiled
def test_a_follower_that_has_lost_its_target_sinks_to_no_ground() -> None:
    """Five metres up, and the target silent for half a minute: backing off from what is hardly known goes nowhere
    below."""
    given = {"target": "silent", "team.target.start.z": 5.0, "team.follower.start.z": 5.0, "duration_s": 50.0,
             "team.target.mission.silent_s": [[15.0, 45.0]]}  # fmt: skip
    cast = build(*load_scenario("follow-leader", given))
    run = cast.run()
    assert pursuers(cast)["follower"].counts[Stage.SEARCH, Why.LOST] == 1
    assert float(run.truth["follower"].p[:, 2].min()) > 1.5
