"""A drone on a pad: its flight as a pure transition."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from outrider.guidance.flight import Flight, FlightRules, Phase, Senses, advance

RULES = FlightRules()
GOOD = Senses(
    t_s=10.0, battery=1.0, left=True, ready=True, near=0.0, up=0.0, free=True, unseen_s=0.0, aside=0.0, slow=0.0,
    landed=False,
)  # fmt: skip


def fly(phase, **senses):
    start = Flight(phase=phase, since_s=0.0, tries=senses.pop("tries", 0))
    return advance(start, replace(GOOD, **senses), RULES)


@pytest.mark.parametrize(
    ("phase", "senses", "then"),
    [
        (Phase.DOCKED, {}, Phase.CLIMB),
        (Phase.DOCKED, {"ready": False}, Phase.DOCKED),
        (Phase.DOCKED, {"battery": 0.5}, Phase.DOCKED),
        (Phase.DOCKED, {"left": False}, Phase.DOCKED),
        (Phase.CLIMB, {"up": 3.0}, Phase.CLIMB),
        (Phase.CLIMB, {"near": 5.0}, Phase.GO),
        (Phase.CLIMB, {}, Phase.SINK),
        (Phase.GO, {"near": 5.0}, Phase.GO),
        (Phase.GO, {}, Phase.SINK),
        (Phase.SINK, {"up": -3.0}, Phase.SINK),
        (Phase.SINK, {}, Phase.INSPECT),
        (Phase.INSPECT, {}, Phase.INSPECT),
        (Phase.INSPECT, {"battery": 0.1}, Phase.LEAVE),
        (Phase.INSPECT, {"left": False}, Phase.LEAVE),
        (Phase.LEAVE, {"free": False}, Phase.LEAVE),
        (Phase.LEAVE, {}, Phase.RISE),
        (Phase.RISE, {"up": 4.0}, Phase.RISE),
        (Phase.RISE, {}, Phase.RETURN),
        (Phase.RETURN, {"ready": False}, Phase.RETURN),
        (Phase.RETURN, {}, Phase.LOWER),
        (Phase.LOWER, {"up": -5.0}, Phase.LOWER),
        (Phase.LOWER, {}, Phase.ALIGN),
        (Phase.ALIGN, {}, Phase.DESCEND),
        (Phase.ALIGN, {"aside": 0.4}, Phase.ALIGN),
        (Phase.ALIGN, {"slow": 0.4}, Phase.ALIGN),
        (Phase.ALIGN, {"unseen_s": 5.0}, Phase.ABORT),
        (Phase.DESCEND, {}, Phase.DESCEND),
        (Phase.DESCEND, {"landed": True}, Phase.DOCKED),
        (Phase.DESCEND, {"unseen_s": 1.5}, Phase.ABORT),
        (Phase.DESCEND, {"aside": 0.5}, Phase.ABORT),
        (Phase.DESCEND, {"ready": False}, Phase.ABORT),
        (Phase.ABORT, {"up": 2.0}, Phase.ABORT),
        (Phase.ABORT, {"tries": 1}, Phase.ALIGN),
        (Phase.ABORT, {"tries": 3}, Phase.LOST),
        (Phase.LOST, {}, Phase.LOST),
    ],
)
def test_every_transition(phase, senses, then):
    assert fly(phase, **senses).phase is then


def test_a_broken_off_landing_counts_and_says_why():
    f = fly(Phase.DESCEND, unseen_s=1.5)
    assert (f.tries, f.reason) == (1, "the pad is out of sight for 1.5 s")
    f = advance(f, GOOD, RULES)
    assert (f.phase, f.tries) == (Phase.ALIGN, 1)
    f = replace(f, phase=Phase.DESCEND)
    f = advance(f, replace(GOOD, landed=True), RULES)
    assert (f.phase, f.tries, f.charges) == (Phase.DOCKED, 0, 1)


@given(
    st.sampled_from(list(Phase)), st.floats(0, 20), st.floats(0, 5), st.floats(-10, 10), st.floats(0, 10),
    st.booleans(), st.floats(0, 1),
)  # fmt: skip
def test_it_never_begins_to_descend_on_a_pad_that_it_does_not_see(phase, unseen, aside, up, near, ready, battery):
    f = fly(phase, unseen_s=unseen, aside=aside, up=up, near=near, ready=ready, battery=battery)
    if f.phase is Phase.DESCEND:
        assert ready and unseen < RULES.unseen_s
        assert aside < RULES.aside or phase is Phase.DESCEND
