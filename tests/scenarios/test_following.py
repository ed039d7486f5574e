"""One drone follows another through scenario files: refusals, what the target may do, and that they never meet."""

from copy import deepcopy
from functools import cache
from typing import Any

import numpy as np
import pytest

from outrider.errors import ConfigError
from outrider.filters.following import Outcome
from outrider.guidance.rendezvous import Signal, Stage, Why
from outrider.safety.admissible import nearest_coming_back
from outrider.scenarios.build import Cast, build
from outrider.scenarios.files import load_scenario, parse_scenario
from outrider.scenarios.followed import promises, pursuers, pursuit, strayed
from outrider.scenarios.leading import BEHAVIOURS
from outrider.scenarios.registry import find_scenario
from outrider.sim.engine import Ending, Simulation
from outrider.sim.truth import EPOCH
from outrider.team.pursuer import WARY, Adaptive, Pursuer

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
    data = {"duration_s": 1.0, **deepcopy(found.describe(found.config()))}
    for key, value in changes.items():
        *way, last = key.split("__")
        node = data
        for word in way:
            node = node[int(word)] if isinstance(node, list) else node[word]
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
        ({"team__follower__sensors__0__rate_hz": 1000.0}, r"gnss tells 1000 times a second \(50 Hz or fewer"),
        ({"team__target__sensors__1__rate_hz": 100.0}, "gnss_velocity tells 100 times a second"),
        ({"team__follower__sensors__0__latency_s": 100.0}, r"no distance holds .* delay \(at most 5 s of delay\)"),
        (
            {"team__follower__sensors__0__latency_s": 3.0, "team__follower__mission__zones__zone": 20.0},
            r"silent, but fixes get 3.3 s old \(silent_s above 3.3",
        ),
    ],
)
def test_what_cannot_be_is_refused_with_a_remedy(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        build(parse_scenario(described(**changes)))


@pytest.mark.parametrize("changes", [
    {"team__target__mission__tells_velocity": ""},
    {"team__target__sensors__1__name": "another"},
])  # fmt: skip
def test_a_target_that_tells_no_velocity_is_followed_from_farther_away(changes: dict[str, Any]) -> None:
    def stays(**given: Any) -> float:
        agent = pursuers(build(parse_scenario(described(team__follower__mission__zones__zone=12.0, **given))))
        assert isinstance(agent["follower"].set_point, Adaptive)
        return agent["follower"].set_point.now

    assert stays(**changes) > stays() + 1.0


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
    """That the target of `reverse` comes back is declared."""
    _, done, agent, distance = run("follow-leader", target=target, seed=3)
    assert done.ending in (Ending.TIME, Ending.GOAL)
    assert distance.min() > R_D
    assert agent.counts[Stage.LOCALISE, Why.FIRST] == (target != "clock")


@pytest.mark.compiled
def test_a_target_that_falls_silent_is_searched_and_found() -> None:
    cast, done, agent, distance = run("follow-leader", target="silent", seed=3, duration_s=55.0)
    assert agent.counts[Stage.PREDICT, Why.SILENT] == 1
    assert agent.counts[Stage.SEARCH, Why.LOST] == 1
    assert sum(n for (_, why), n in agent.counts.items() if why is Why.FOUND) == 1
    assert distance.min() > R_D
    assert distance[-1] < 5.0
    told = (pursuit(cast, done) or {})["follower"]
    lost = {x["stage"]: x for x in told["lost"]}
    assert set(lost) == {"predict", "search"} and lost["search"]["seconds"] > 3.0
    assert told["followed_s"] + sum(x["seconds"] for x in lost.values()) <= 55.0 - told["held_after_s"] + 0.2
    assert lost["search"]["mean_m"] > told["mean_m"] + told["sd_m"]  # it does not count as following


@pytest.mark.compiled
def test_a_jump_of_50_m_is_refused_as_long_as_nobody_flies_that_far() -> None:
    """Two seconds of fixes that are somewhere else agree with one another; the truth is believed at once after them."""
    _, done, agent, distance = run("follow-leader", target="spoofed", seed=3)
    o = agent.bearings.outcomes
    assert o["target", Outcome.GATED] + o["target", Outcome.TOO_FAR] == 10
    assert o["target", Outcome.REACQUIRED] == 0
    (said,) = [n for n in done.notes if Outcome.TOO_FAR.value in n.text]
    assert 15.0 < (said.t - EPOCH) * 1e-9 < 16.0
    assert "(8 times within" in said.text
    assert R_D < distance[-100:].min() < distance[-100:].max() < 6.0


@pytest.mark.compiled
def test_a_jump_that_stays_is_believed_once_it_can_have_been_flown() -> None:
    """50 m to the side at 4 m/s at most, while it flies on at 2 m/s ahead: after 12 to 15 s."""
    spoof = {"team.target.mission.spoofs.0.spell_s": (15.0, 100.0)}
    _, done, agent, _ = run("follow-leader", target="spoofed", seed=3, **spoof)
    p, when = done.truth["follower"].p, (done.truth["follower"].t - EPOCH) * 1e-9
    assert np.abs(p[when < 26.0, 1]).max() < 10.0  # it looks along the credible track
    assert agent.counts[Stage.PREDICT, Why.JUMPED] == agent.counts[Stage.SEARCH, Why.JUMPED] == 1
    (found,) = [n for n in done.notes if Why.FOUND.value in n.text]
    assert 27.0 < (found.t - EPOCH) * 1e-9 < 31.0


@pytest.mark.compiled
def test_clocks_that_disagree_are_named_and_it_hovers() -> None:
    cast, done, agent, _ = run("follow-leader", target="clock", seed=3)
    assert strayed(cast) == ["follower at the end: it hovers (the clocks of the two aircraft disagree)"]
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
def test_a_target_that_may_turn_back_is_believed_when_it_does() -> None:
    """At the hairpin, whose 180 degrees are declared, no fix of it is an outlier and nobody is lost."""
    cast, done, agent, distance = run("swarm2023-blocked")
    assert agent.bearings.outcomes["target", Outcome.GATED] == 0
    told = (pursuit(cast, done) or {})["follower"]  # which begins 3 m behind, nearer than its set-point
    assert distance[0] < 4.0 and told["held_after_s"] > 2.0
    assert {stage for stage, _ in agent.counts} == {Stage.RENDEZVOUS}


@pytest.mark.compiled
def test_what_is_told_beforehand_of_a_reversal_that_nobody_declared_is_so() -> None:
    undeclared = {"team.follower.mission.approach": 0.0, "team.follower.mission.target_turn_deg": 90.0}
    cast, done, agent, distance = run("follow-leader", target="reverse", duration_s=20.0, **undeclared)
    (said,) = promises(cast)
    assert done.notes[0].text == agent.promise and said == f"follower: {agent.promise}"
    assert isinstance(agent.set_point, Adaptive) and agent.separation is not None
    chosen = float(said.split("at ")[1].split(" m,")[0])
    worst = nearest_coming_back(agent.separation, agent.set_point.fixes, 2.0, chosen)
    assert f"may get within {worst:.2g} m at worst" in said
    assert 1.0 < worst < distance.min() < R_D


@pytest.mark.compiled
def test_a_reversal_that_nobody_declared_is_noticed_before_it_is_believed() -> None:
    """1 Hz and 0.4 s late, so that three fixes that agree would take three seconds: 1.5 m is never undercut."""
    given = {"target": "reverse", "gnss_hz": 1.0, "latency_s": 0.3, "zone": 10.0, "duration_s": 25.0}
    undeclared = {"team.follower.mission.approach": 0.0, "team.follower.mission.target_turn_deg": 90.0}
    _, done, agent, distance = run("follow-leader", seed=0, **given, **undeclared)
    assert agent.bearings.outcomes["target", Outcome.GATED] > 0
    assert any(WARY in n.text for n in done.notes)
    assert distance.min() > 1.5


@pytest.mark.compiled
def test_the_paper_enters_its_danger_zone_and_the_principled_one_does_not() -> None:
    assert run("swarm2023-rendezvous", preset="paper")[3].min() < R_D
    assert run("swarm2023-rendezvous")[3].min() > R_D


@pytest.mark.compiled
def test_a_follower_that_has_lost_its_target_sinks_to_no_ground() -> None:
    """Five metres up, and the target silent for half a minute on its way: it is looked for over its credible track, and
    when the search ends, twelve seconds' flight closer than hovering would leave it."""
    given = {"target": "silent", "team.target.start.z": 5.0, "team.follower.start.z": 5.0, "duration_s": 50.0,
             "team.target.mission.silent_s": [[15.0, 45.0]]}  # fmt: skip
    cast = build(*load_scenario("follow-leader", given))
    run = cast.run()
    assert pursuers(cast)["follower"].counts[Stage.SEARCH, Why.LOST] == 1
    own, target = run.truth["follower"], run.truth["target"]
    assert float(own.p[:, 2].min()) > 1.5
    apart = np.linalg.norm(own.p - target.at(own.t).p, axis=1)
    assert apart.min() > R_D
    assert apart[int(40.0 / own.dt)] < 12.0 < apart.max() < 30.0  # of 25 s of silence at 2 m/s
