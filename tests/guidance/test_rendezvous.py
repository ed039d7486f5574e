"""The mission of a follower: any senses end in a named stage, no zone chatters, and each reason is said."""

from itertools import pairwise
from math import inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from outrider.errors import ConfigError
from outrider.guidance.rendezvous import Rendezvous, Senses, Signal, Stage, Why, Zones, advance

ZONES = Zones()
ANY = st.floats(allow_nan=True, allow_infinity=True)
SENSES = st.builds(
    Senses,
    t_s=st.floats(0, 1e6),
    distance=ANY,
    heard_s=ANY,
    jumps=st.integers(0, 9),
    fix_s=ANY,
    sigma=ANY,
    clocks_s=ANY,
    unfit=st.booleans(),
    home=ANY,
)


def walk(*senses: Senses, zones: Zones = ZONES) -> list[Rendezvous]:
    """The mission after each of them."""
    m, out = Rendezvous(), list[Rendezvous]()
    for s in senses:
        m = advance(m, s, zones)
        out.append(m)
    return out


def heard(distance: float, t_s: float = 0.0, **more: float) -> Senses:
    """A target that is heard."""
    return Senses(t_s=t_s, distance=distance, **{"heard_s": 0.3, **more})  # type: ignore[arg-type]


@given(st.lists(SENSES, max_size=30))
def test_any_senses_end_in_a_named_stage_with_a_reason(senses: list[Senses]) -> None:
    for m, s in zip(walk(*senses), senses, strict=True):
        assert isinstance(m.stage, Stage) and isinstance(m.why, Why) and isinstance(m.signal, Signal)
        if m.stage is Stage.HOME:
            continue
        # it never approaches on what is not a number, nor on clocks that are known to disagree
        approaches = m.stage in (Stage.LOCALISE, Stage.RENDEZVOUS, Stage.PREDICT, Stage.SEARCH)
        if s.distance != s.distance or s.sigma != s.sigma or s.unfit or inf > abs(s.clocks_s) > ZONES.clocks_s:
            assert not approaches
        if s.distance < ZONES.danger and s.heard_s < ZONES.lost_s:
            assert not approaches  # inside the danger zone it gives way, or hovers


@given(st.sampled_from([ZONES.danger, ZONES.zone]), st.lists(st.floats(-0.14, 0.14), min_size=2, max_size=60))
def test_noise_within_the_band_changes_the_zone_twice_at_most(border: float, noise: list[float]) -> None:
    stages = [m.stage for m in walk(*(heard(border + e, float(k)) for k, e in enumerate(noise)))]
    assert sum(a is not b for a, b in pairwise(stages)) <= 1


@given(st.lists(st.floats(0.0, 12.0), min_size=2, max_size=60))
def test_from_a_zone_and_back_takes_more_than_the_band(distances: list[float]) -> None:
    missions = walk(*(heard(d, float(k)) for k, d in enumerate(distances)))
    changed = [k for k in range(1, len(missions)) if missions[k].stage is not missions[k - 1].stage]
    for a, b in pairwise(changed):
        if missions[b].stage is missions[a - 1].stage:
            # the distances that caused the two changes are on both sides of one border, the band apart
            near, far = sorted((distances[a], distances[b]))
            borders = ((ZONES.danger, ZONES.band), (ZONES.zone, ZONES.outer))
            crossed = [x for x, band in borders if near <= x and far >= x + band]
            assert crossed


@given(st.floats(0.0, 50.0), st.floats(0.0, 50.0), SENSES)
def test_a_period_later_with_the_same_senses_nothing_changes(d: float, age: float, s: Senses) -> None:
    once = advance(Rendezvous(), s, ZONES)
    assert advance(once, s, ZONES) == once


def test_the_zones_of_the_paper() -> None:
    stages = [m.stage for m in walk(*(heard(d) for d in (20.0, 6.1, 6.0, 6.9, 7.1, 5.0, 2.9, 3.2, 3.31, 4.0)))]
    expected = "LOCALISE LOCALISE RENDEZVOUS RENDEZVOUS LOCALISE RENDEZVOUS DANGER DANGER RENDEZVOUS RENDEZVOUS"
    assert [s.name for s in stages] == expected.split()


def test_height_alone_makes_a_distance() -> None:
    """The distance is in space: nothing else of a height enters."""
    assert walk(heard(2.0))[-1].stage is Stage.DANGER


def test_a_target_that_falls_silent_is_predicted_searched_waited_for_and_left() -> None:
    told = [(0.5, "RENDEZVOUS"), (2.6, "PREDICT"), (6.1, "SEARCH"), (26.1, "HOLD"), (46.1, "RETURN"), (90.0, "RETURN")]
    missions = walk(*(Senses(t_s=a, distance=5.0, heard_s=a, home=9.0) for a, _ in told))
    assert [m.stage.name for m in missions] == [name for _, name in told]
    assert [m.why for m in missions[1:5]] == [Why.SILENT, Why.LOST, Why.GIVEN_UP, Why.UNSEEN]
    home = advance(missions[-1], Senses(t_s=99.0, distance=5.0, heard_s=99.0, home=0.5), ZONES)
    assert home.stage is Stage.HOME
    assert advance(home, heard(5.0), ZONES).stage is Stage.HOME  # the mission is over


@pytest.mark.parametrize("age", [2.6, 6.1, 26.1, 46.1])
def test_a_target_that_is_heard_again_is_found(age: float) -> None:
    m = walk(heard(5.0), Senses(t_s=age, distance=5.0, heard_s=age), heard(9.0, age + 1.0))[-1]
    assert (m.stage, m.why) == (Stage.LOCALISE, Why.FOUND)


def test_jumps_are_named_while_they_are_refused() -> None:
    m = walk(heard(5.0), Senses(t_s=3.0, distance=5.0, heard_s=3.0, jumps=3))[-1]
    assert (m.stage, m.why) == (Stage.PREDICT, Why.JUMPED)


def test_a_silent_target_nearby_is_given_way_to() -> None:
    m = walk(heard(5.0), Senses(t_s=3.0, distance=2.5, heard_s=3.0))[-1]
    assert m.stage is Stage.DANGER


def test_clocks_that_disagree_hold_it_until_they_agree_well() -> None:
    stages = [m.stage for m in walk(*(heard(5.0, clocks_s=c) for c in (nan, 0.2, -0.3, 0.2, 0.1)))]
    assert [s.name for s in stages] == ["RENDEZVOUS", "RENDEZVOUS", "HOLD", "HOLD", "RENDEZVOUS"]


def test_a_blocked_signal_is_named_and_holds_only_when_it_is_blind() -> None:
    senses = (heard(5.0, fix_s=f, sigma=x) for f, x in ((0.5, 0.1), (3.0, 0.5), (9.0, 1.6), (0.2, 0.3)))
    clear, blocked, blind, back = walk(*senses)
    assert [m.signal for m in (clear, blocked, blind, back)] == [
        Signal.FIXED, Signal.BLOCKED, Signal.BLOCKED, Signal.FIXED,
    ]  # fmt: skip
    assert blocked.stage is Stage.RENDEZVOUS
    assert (blind.stage, blind.why) == (Stage.HOLD, Why.BLIND)
    assert back.stage is Stage.RENDEZVOUS


def test_what_cannot_be_followed_is_not() -> None:
    m = advance(Rendezvous(), Senses(t_s=0.0, distance=9.0, heard_s=0.1, unfit=True), ZONES)
    assert (m.stage, m.why) == (Stage.HOLD, Why.UNFIT)


@pytest.mark.parametrize(
    "wrong",
    [
        {"danger": 6.0},
        {"danger": nan},
        {"band": 0.0},
        {"band": 4.0},
        {"outer": 0.0},
        {"silent_s": 7.0},
        {"blind": 0.0},
        {"clocks_s": -1.0},
    ],
)
def test_zones_that_cannot_be(wrong: dict[str, float]) -> None:
    with pytest.raises(ConfigError, match="zones"):
        Zones(**wrong)
