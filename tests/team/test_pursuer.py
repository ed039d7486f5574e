"""A follower and whom it follows, as agents: legs, clocks, the trail, set-points, a period of each."""

from math import isnan, nan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from outrider.core.bezier import bezier
from outrider.core.geodesy import enu_to_geodetic
from outrider.data import Datum, Kind, Stream, stream
from outrider.data.agents import Message
from outrider.errors import ConfigError
from outrider.filters.following import FollowerFilter, Following, Outcome
from outrider.guidance.rendezvous import Stage, Why, Zones
from outrider.models.motion.following import FollowerModel
from outrider.safety.admissible import Fixes, admissible
from outrider.safety.separation import Hold, Separation
from outrider.team.bearings import Bearings, Clocks
from outrider.team.leader import ASK_TIME, TELL_TIME, Leader, Legs, Spoof, TargetFix, Way, stamp, stamped
from outrider.team.pursuer import WARY, Adaptive, Fixed, Law, Pursuer, Style
from outrider.team.trail import Aim, Trail

DATUM = Datum(lat=0.8, lon=0.1, alt=200.0)
T0 = 1_750_000_000_000_000_000


def legs(**changes: object) -> Legs:
    """East, then north."""
    way = np.array([[10.0, 0.0, 5.0], [10.0, 10.0, 5.0]])
    given = {"waypoints": way, "speeds": np.full(2, 2.0), "waits_s": np.zeros(2), **changes}
    return Legs(**given)  # type: ignore[arg-type]


def test_legs_lead_through_every_waypoint_and_stop_at_the_last() -> None:
    p = legs().path(np.array([0.0, 0.0, 5.0]), 20.0, 0.1, 0.5, 5.0)
    for point in ([10.0, 0.0, 5.0], [10.0, 10.0, 5.0]):
        assert np.linalg.norm(p - point, axis=1).min() < 0.5
    assert np.linalg.norm(p[-1] - p[-11]) < 0.01
    assert np.linalg.norm(np.diff(p, axis=0), axis=1).max() <= 0.2 + 1e-9


def test_it_stops_dead_in_its_spells() -> None:
    assert np.array_equal(legs(stops_s=((3.0, 4.0),)).go(Way(), np.zeros(3), 3.5)[1], np.zeros(3))


@pytest.mark.parametrize("wrong", [{"speeds": np.ones(3)}, {"speeds": np.zeros(2)}, {"waits_s": np.full(2, -1.0)}])
def test_legs_that_cannot_be(wrong: dict[str, object]) -> None:
    with pytest.raises(ConfigError, match="legs"):
        legs(**wrong)


@given(st.integers(0, 2**62))
def test_a_stamp_survives_floats(t: int) -> None:
    assert stamped(stamp(t)) == t


@given(st.floats(-5.0, 5.0), st.floats(0.0, 0.4), st.floats(0.0, 0.4))
def test_a_clock_is_never_said_to_be_off_by_more_than_it_is(off: float, there: float, back: float) -> None:
    """Question and answer may take different times: half of the exchange is what cannot be told."""
    clocks = Clocks()
    asked = T0 + round(there * 1e9)
    told = Message(sender="a", topic=TELL_TIME, data={"asked": stamp(T0), "clock": stamp(asked + round(off * 1e9))})
    clocks.hear(told, asked + round(back * 1e9))
    assert abs(clocks.ahead_s) <= abs(off) + 1e-6
    assert abs(off) <= abs(clocks.ahead_s) + there + back + 1e-6


def fix(t: int, p: list[float], name: str = "gnss") -> Stream:
    """A record of a receiver at p (3,) m in the site."""
    z = np.column_stack(enu_to_geodetic(np.array([p]), DATUM.lat, DATUM.lon, DATUM.alt))
    return stream(name, Kind.GNSS, np.array([t]), z, var=np.full((1, 3), 0.15**2))


def leader(**changes: object) -> Leader:
    """One that is carried."""
    return Leader(name="a", legs=legs(), datum=DATUM, start=T0, **changes)  # type: ignore[arg-type]


def test_a_leader_tells_its_fixes_answers_and_falls_silent() -> None:
    ask = Message(sender="b", receiver="a", topic=ASK_TIME, data={"asked": stamp(T0)})
    told = leader(clock_s=1.0).act(T0 + 10**9, [fix(T0, [1.0, 2.0, 3.0])], [ask]).messages
    assert [m.topic for m in told] == ["fix", TELL_TIME]
    said = TargetFix.of(told[0])
    assert np.allclose(said.p, [1.0, 2.0, 3.0], atol=1e-6)
    assert said.t == T0 + 10**9
    assert isnan(said.v[0])
    assert stamped(told[1].data["clock"]) == T0 + 2 * 10**9
    assert not leader(silent_s=((0.5, 2.0),)).act(T0 + 10**9, [fix(T0, [1.0, 2.0, 3.0])], [ask]).messages


def test_a_spoofed_fix_is_somewhere_else() -> None:
    spoofs = (Spoof(spell_s=(0.0, 1.0), by=(0.0, 50.0, 0.0)),)
    told = leader(spoofs=spoofs).act(T0, [fix(T0, [1.0, 2.0, 3.0])], []).messages
    assert np.allclose(TargetFix.of(told[0]).p, [1.0, 52.0, 3.0], atol=1e-6)


def test_a_curve_ends_where_the_target_was_seen_last() -> None:
    trail = Trail(degree=2, aim_at=Aim.END)
    assert trail.aim(np.zeros(3)) is None
    for k in range(4):
        trail.see(float(k), np.array([k, k * k, 0.0]))
    aim = trail.aim(np.zeros(3))
    assert aim is not None and np.array_equal(aim, [3.0, 9.0, 0.0])


@given(st.floats(0.0, 1.0))
def test_a_curve_of_points_on_a_line_is_the_line(s: float) -> None:
    points = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 0.0], [2.0, 4.0, 0.0], [3.0, 6.0, 0.0]])
    assert np.allclose(bezier(points, s), [3.0 * s, 6.0 * s, 0.0], atol=1e-12)


def test_the_set_point_grows_with_speed_and_delay_at_once_and_shrinks_slowly() -> None:
    separation, fixes = Separation(distance=3.0, speed=4.0), Fixes(rate_hz=5.0, latency_s=0.1)
    adaptive = Adaptive(separation=separation, fixes=fixes)
    slow, fast = adaptive.distance(0.5, 0.1), adaptive.distance(2.0, 0.1)
    assert fast > slow > 3.0
    assert abs(fast - admissible(separation, fixes, 2.0).set_point) < 0.02
    assert adaptive.distance(2.0, 0.5) > fast
    late = adaptive.now
    assert adaptive.distance(0.0, 0.1) == pytest.approx(late - adaptive.fall)


def pursuer(law: Law = Law.VECTOR, separation: Separation | None = None) -> Pursuer:
    """One at the origin, whose target is heard as "a"."""
    own = FollowerFilter(FollowerModel(), Following())
    target = FollowerFilter(FollowerModel.target(), Following())
    return Pursuer(
        name="b", bearings=Bearings(leader="a", own=own, target=target, datum=DATUM, start=T0), zones=Zones(),
        style=Style(near=law, far=law), set_point=Fixed(m=4.0), separation=separation, trail=Trail(), home=np.zeros(3),
    )  # fmt: skip


def heard(p: list[float], t: int) -> Message:
    """A fix of the target."""
    return TargetFix(t=t, p=np.array(p), sigma=np.full(3, 0.1)).message("a", t)


def passing(*last: TargetFix) -> Bearings:
    """Who hovers at the origin, 10 m up, and has heard three seconds of a target that flies east at 2 m/s, at 5 Hz, and
    then `last`."""
    own, target = FollowerFilter(FollowerModel()), FollowerFilter(FollowerModel.target(), Following(fastest=4.0))
    b = Bearings(leader="a", own=own, target=target, datum=DATUM, start=T0)
    for k in range(16):
        own.add_fix(0.2 * k, np.array([0.0, 0.0, 10.0]), np.full(3, 0.1**2))
        own.add_velocity(0.2 * k, np.zeros(3), np.full(3, 0.05**2))
        b.hear(T0 + k * STEP, [told(k, 0.4 * k, 2.0).message("a", T0 + k * STEP)])
    for said in last:
        b.hear(said.t, [said.message("a", said.t)])
    return b


STEP = 200_000_000


def told(k: int, east: float, v: float) -> TargetFix:
    """The fix at step k, `east` m out; without a velocity where that is not a number."""
    return TargetFix(
        t=T0 + k * STEP, p=np.array([east, 0.0, 10.0]), sigma=np.full(3, 0.1), v=np.array([v, 0.0, 0.0]) if v == v
        else np.full(3, nan), v_sigma=np.full(3, 0.05 if v == v else np.inf),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("last", "v"), [(told(16, 6.2, -2.0), -2.0), (told(16, 4.8, -2.0), -2.0), (told(16, 4.8, nan), -6.0)]
)
def test_what_does_not_fit_is_doubted_as_it_was_told(last: TargetFix, v: float) -> None:
    """A velocity, a position with it, and a position alone, whose velocity is the mean one since the fix before."""
    doubt = passing(last).doubt(T0 + 17 * STEP)
    assert doubt is not None and doubt.p[0] == last.p[0]
    assert doubt.v[0] == pytest.approx(v, abs=0.3) and doubt.age == pytest.approx(0.2)


def test_nothing_is_doubted_that_fits_or_that_nobody_can_have_flown_or_that_is_old() -> None:
    assert passing().doubt(T0 + 16 * STEP) is None
    assert passing(told(16, 6.4, 2.0)).doubt(T0 + 17 * STEP) is None
    assert passing(told(16, 60.0, 2.0)).doubt(T0 + 17 * STEP) is None
    assert passing(told(16, 4.8, -2.0), told(17, 6.8, 2.0)).doubt(T0 + 17 * STEP) is None
    assert passing(told(16, 4.8, -2.0)).doubt(T0 + 40 * STEP) is None


def test_a_doubted_target_is_kept_clear_of_and_not_followed() -> None:
    """From 5 m behind it goes on, but not if the target has turned round by what did not fit."""

    def after(b: Bearings) -> tuple[float, str, Hold]:
        agent = pursuer(Law.VECTOR, Separation(distance=3.0, speed=4.0))
        agent.bearings = b
        action = agent.act(T0 + 18 * STEP, [], [])
        assert action.command is not None
        return float(action.command[0]), action.note, agent.flown.hold[-1]

    freely, note, hold = after(passing(told(16, 6.4, 2.0)))
    assert freely > 0.0 and WARY not in note and hold in (Hold.FREE, Hold.LIMITED)
    warily, note, hold = after(passing(told(16, 4.8, -2.0)))
    assert warily < 0.0 and WARY in note and hold is Hold.RETREATING


def test_before_anything_is_known_it_hovers() -> None:
    agent = pursuer()
    action = agent.act(T0, [], [])
    assert action.command is not None and np.array_equal(action.command, np.zeros(4))
    assert agent.mission.stage is Stage.WAIT
    assert [m.topic for m in action.messages] == [ASK_TIME]


@pytest.mark.parametrize("law", [Law.LOS, Law.ZONE, Law.VECTOR])
def test_every_law_flies_at_a_target_that_is_far(law: Law) -> None:
    agent = pursuer(law)
    action = agent.act(T0, [fix(T0, [0.0, 0.0, 5.0])], [heard([30.0, 40.0, 8.0], T0)])
    assert action.command is not None
    v = action.command[:3]
    assert v[1] / v[0] == pytest.approx(40.0 / 30.0, rel=1e-3)
    assert v[2] > 0.0  # and climbs to it
    assert agent.mission.why is Why.FIRST


def test_another_robots_fixes_are_not_the_targets() -> None:
    agent = pursuer()
    stranger = TargetFix(t=T0, p=np.zeros(3), sigma=np.ones(3)).message("c", T0)
    agent.act(T0, [fix(T0, [0.0, 0.0, 5.0])], [stranger])
    assert agent.mission.stage is Stage.WAIT


def test_a_fix_from_the_future_is_named() -> None:
    agent = pursuer()
    agent.act(T0, [fix(T0, [0.0, 0.0, 5.0])], [heard([30.0, 0.0, 5.0], T0)])
    action = agent.act(T0 + 10**8, [], [heard([30.0, 0.0, 5.0], T0 + 10**9)])
    assert Outcome.FUTURE.value in action.note


def test_inside_the_danger_zone_the_safety_filter_sends_it_away() -> None:
    agent = pursuer(Law.LOS, Separation(distance=3.0, speed=4.0))
    action = agent.act(T0, [fix(T0, [0.0, 0.0, 5.0])], [heard([2.0, 0.0, 5.0], T0)])
    assert action.command is not None and action.command[0] < 0.0
    assert agent.mission.stage is Stage.DANGER


def test_nothing_that_is_not_a_number_is_ever_commanded() -> None:
    agent = pursuer(Law.VECTOR, Separation(distance=3.0, speed=4.0))
    bad = TargetFix(t=T0, p=np.full(3, nan), sigma=np.ones(3)).message("a", T0)
    for k in range(5):
        action = agent.act(T0 + k * 10**8, [fix(T0 + k * 10**8, [nan, 0.0, 5.0])], [bad])
        assert action.command is not None and np.isfinite(action.command).all()
