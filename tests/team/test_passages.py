"""Robots that meet in a passage 2 m wide, driven in the simulator: one at a time, nobody waits for ever."""

from itertools import combinations
from typing import Any

import numpy as np
import pytest
from narrow import EAST, LONG, WEST, Dies, cast, crossings, inside, robot, with_agent

from outrider.io.sites import parse_site
from outrider.scenarios.patrolling import narrow_ways
from outrider.sim.engine import Ending, Simulation

S = 1_000_000_000


def swapping(offset: float = 8.0, third: bool = False, turned: int = 0) -> dict[str, Any]:
    """offset : m, of the second robot from the passage;  turned : by how many names are handed on: who gives way."""
    robots = {
        "r1": robot((-8.0, 0.5, 0.0), (EAST[0], WEST[0])),
        "r2": robot((LONG + offset, 0.5, 180.0), (WEST[1], EAST[1])),
    }
    robots |= {"r3": robot((LONG + 8.0, 3.0, 180.0), (WEST[2], EAST[2]))} if third else {}
    names = list(robots)
    return {name: robots[names[(k + turned) % len(names)]] for k, name in enumerate(names)}


def together(run: Simulation) -> int:
    """Stamps at which two robots are in the passage."""
    there = {name: inside(run, name) for name in run.truth if name != "station"}
    return sum(int((there[a] & there[b]).sum()) for a, b in combinations(there, 2))


def test_narrow_ways_are_passages_up_to_the_edge_of_the_wide_ones() -> None:
    nodes = {"a": [0, 0], "b": [20, 0], "c": [20, 10], "d": [-5, 0], "e": [20, 20], "f": [30, 20]}
    ways = [
        {"way": ["a", "b", "c"], "width": 2.0}, {"way": ["d", "a"], "width": 6.0}, {"way": ["c", "e"]},
        {"way": ["e", "f"], "width": 1.0},
    ]  # fmt: skip
    graph = parse_site({"routes": {"nodes": nodes, "ways": ways}}).routes
    assert graph is not None
    bent, dead_end = sorted(narrow_ways(graph, 3.0), key=len, reverse=True)
    assert (bent.min(axis=0).tolist(), bent.max(axis=0).tolist()) == ([3.0, -1.0], [21.0, 10.0])
    assert (dead_end.min(axis=0).tolist(), dead_end.max(axis=0).tolist()) == ([20.0, 19.5], [30.0, 20.5])
    assert narrow_ways(graph, 0.5) == ()


@pytest.mark.compiled
@pytest.mark.parametrize(("third", "seconds"), [(False, 36.0), (True, 54.0)])
def test_robots_that_meet_at_1_mps_go_one_after_the_other(third: bool, seconds: float) -> None:
    run = cast(swapping(7.0, third, turned=int(third)), seconds, seed=5).run()
    names = [name for name in run.truth if name != "station"]
    assert run.ending is Ending.TIME and together(run) == 0
    assert min(crossings(run, name) for name in names) >= 1
    assert all(run.monitor.separations[pair].distance > 0.1 for pair in combinations(names, 2))
    order = [n.text.split("; ")[-1].split("'")[0][-2:] for n in run.notes if "passage 0 is" in n.text]
    assert all(set(order[k : k + len(names)]) == set(names) for k in range(len(order) - len(names) + 1))  # in turn
    assert max(float(np.hypot(*run.truth[name].v[:, :2].T).max()) for name in names) > 0.95


@pytest.mark.compiled
def test_a_robot_that_dies_before_a_passage_that_is_its_own_keeps_it_for_no_longer_than_its_lease() -> None:
    def granted(t: int, agent: Any) -> bool:
        return agent._granted[0] == 0

    robots = swapping()
    robots["r1"]["start"]["x"] = -6.0  # it is the first
    one = with_agent(cast(robots, 40.0, lease_s=8.0), "r1", lambda a: Dies(a, granted))
    run = one.run()
    notes = [(n.t - run.monitor.start, n.text) for n in run.notes if n.robot == "station"]
    (first, whose), (then, other), *_ = notes
    assert "passage 0 is r1's" in whose and "passage 0 is r2's" in other and then - first > 8 * S
    assert run.ending is Ending.TIME and crossings(run, "r1") == 0 and crossings(run, "r2") >= 1


@pytest.mark.evidence
@pytest.mark.parametrize("third", [False, True])
@pytest.mark.parametrize(
    ("offset", "turned", "seed"), [(5.0, 0, 1), (6.0, 1, 2), (7.0, 2, 3), (8.0, 0, 4), (5.0, 1, 5)]
)
def test_whoever_comes_when_all_get_through(offset: float, turned: int, seed: int, third: bool) -> None:
    run = cast(swapping(offset, third, turned), 90.0, seed).run()
    assert run.ending is Ending.TIME and together(run) == 0
    assert min(crossings(run, name) for name in run.truth if name != "station") >= 1
