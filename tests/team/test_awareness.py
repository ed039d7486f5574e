"""What one robot sees and another believes: refusals, shapes, and a robot that goes round what it was told of."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from outrider.scenarios.build import build
from outrider.scenarios.files import load_scenario
from outrider.team.awareness import SURE, Awareness, Refusal, shape
from outrider.team.scout import lines
from outrider.team.words import Sighting

NOW = 1_700_000_000 * 10**9
WALL = Sighting(
    source="scout", number=3, t=NOW - 10**9, ends=np.array([[10.0, -2.0], [10.0, 2.0]]), radius=0.2,
    P=np.diag([0.01, 0.04]),
)  # fmt: skip
HERE = np.zeros(2)


def test_a_sighting_survives_its_message():
    s = Sighting.of(WALL.message(NOW))
    assert (s.source, s.number, s.t, s.radius) == ("scout", 3, NOW - 10**9, 0.2)
    assert np.array_equal(s.ends, WALL.ends) and np.array_equal(s.P, WALL.P)


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"t": NOW + 10**9}, Refusal.FUTURE),
        ({"t": NOW - 31 * 10**9}, Refusal.STALE),
        ({"P": np.diag([9.0, 0.1])}, Refusal.VAGUE),
        ({"P": np.array([[1.0, 2.0], [2.0, 1.0]])}, Refusal.BROKEN),
        ({"P": np.full((2, 2), np.nan)}, Refusal.BROKEN),
        ({"radius": -1.0}, Refusal.BROKEN),
        ({"ends": np.array([[10.0, np.inf], [10.0, 2.0]])}, Refusal.BROKEN),
        ({"ends": np.array([[0.0, 0.0], [90.0, 2.0]])}, Refusal.HUGE),
        ({"ends": np.array([[0.5, -2.0], [0.5, 2.0]])}, Refusal.HERE),
    ],
)
def test_what_is_not_believed_is_named_and_counted_and_changes_nothing(changes, why):
    a = Awareness()
    note = a.hear(NOW, HERE, [replace(WALL, **changes).message(NOW)])
    assert why.value in note and a.refused == {("scout", why): 1}
    assert a.standing(NOW) == []
    assert a.hear(NOW, HERE, [replace(WALL, **changes).message(NOW)]) == ""  # told once, counted each time
    assert a.refused["scout", why] == 2


def test_a_message_without_its_parts_is_refused():
    m = WALL.message(NOW)
    a = Awareness()
    a.hear(NOW, HERE, [replace(m, data={k: v for k, v in m.data.items() if k != "ends"})])
    assert a.refused == {("scout", Refusal.BROKEN): 1}


def test_what_is_believed_stands_until_it_is_too_old():
    a = Awareness(last_s=30.0)
    assert "has seen something in the way at (10.0, 0.0)" in a.hear(NOW, HERE, [WALL.message(NOW)])
    assert len(a.standing(NOW)) == 1
    assert a.hear(NOW, HERE, [WALL.message(NOW)]) == ""  # doubled messages change nothing
    assert len(a.standing(NOW)) == 1 and not a.refused
    assert len(a.standing(NOW + 28 * 10**9)) == 1
    assert a.standing(NOW + 29 * 10**9) == []


def test_an_older_message_on_a_detour_does_not_replace_a_newer_one():
    a = Awareness()
    moved = replace(WALL, ends=WALL.ends + 1.0, t=NOW)
    a.hear(NOW, HERE, [moved.message(NOW), WALL.message(NOW)])
    assert np.allclose(a.standing(NOW)[0][1][:2], [11.0, 1.0])


def test_what_was_the_robot_itself_is_not_believed_when_it_has_gone_on():
    a, itself = Awareness(), replace(WALL, ends=np.zeros((2, 2)), radius=0.4)
    a.hear(NOW, HERE, [itself.message(NOW)])
    a.hear(NOW, np.array([8.0, 0.0]), [itself.message(NOW)])
    assert a.standing(NOW) == []


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.floats(-3.0, 3.0))
def test_a_shape_is_larger_by_two_deviations_the_worst_way(a, b, turn):
    c, s = np.cos(turn), np.sin(turn)
    R = np.array([[c, -s], [s, c]])
    body, pose = shape(replace(WALL, P=R @ np.diag([a, b]) @ R.T))
    assert body.radius == pytest.approx(0.2 + SURE * np.sqrt(max(a, b)), abs=1e-6)
    assert np.allclose(np.sort(body.at(pose)[:, 1]), [-2.0, 2.0])


def test_beams_on_a_corner_are_two_lines_and_few_are_nothing():
    x = np.linspace(0.0, 2.0, 15)
    corner = np.vstack([np.column_stack([x, np.zeros(15)]), np.column_stack([np.full(15, 2.0), x])[1:]])
    found = lines(corner)
    assert len(found) == 2 and all(radius < 0.1 for _, radius in found)
    assert np.allclose(found[0][0], [[0, 0], [2, 0]]) and np.allclose(found[1][0], [[2, 0], [2, 2]])
    assert lines(corner[:4]) == [] and lines(np.zeros((0, 2))) == []
    assert len(lines(np.vstack([corner, corner + 9.0]))) == 4


@pytest.mark.compiled
@pytest.mark.parametrize("tells", [True, False])
def test_the_robot_that_is_told_goes_round_before_it_could_have_seen(tells):
    given = {"tells": tells, "duration_s": 24.0}
    run = build(load_scenario("scout-ahead", given)[0]).run()
    p = run.truth["rover"].p
    wall, lidar = 28.0, 6.0
    blind = p[:, 0] < wall - lidar - 0.5  # the wall is out of reach of its own lidar
    aside = np.abs(p[blind, 1]).max()
    assert p[-1, 0] > 15.0
    assert aside > 2.0 if tells else aside < 0.5
    told = any("scout has seen something" in n.text for n in run.notes if n.robot == "rover")
    assert told is tells
    assert run.hit is None
