"""The mission's transitions: no order is lost, and each ends once with its reason."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from outrider.data.alerts import Alert, AlertState
from outrider.errors import ConfigError, DataError
from outrider.guidance.dispatch import Passages, assign
from outrider.guidance.patrol import Duty, Ended, Inputs, Mission, Order, Rules, advance


def order(alert: int, hold_s: float = 10.0, until_s: float = 100.0) -> Order:
    return Order(number=alert, alert=alert, view=np.zeros(3), hold_s=hold_s, until_s=until_s)


RESPONDING = Mission(duty=Duty.RESPOND, order=order(7), stop=2)


def test_an_alert_interrupts_the_round_and_the_round_goes_on_where_it_was() -> None:
    m, ended = advance(Mission(stop=2), Inputs(t_s=5.0, order=order(7), stops=4))
    assert (m.duty, m.stop, ended) == (Duty.RESPOND, 2, ())
    m, ended = advance(m, Inputs(t_s=20.0, arrived=True, stops=4))
    assert (m.duty, m.since_s, ended) == (Duty.OBSERVE, 20.0, ())
    m, ended = advance(m, Inputs(t_s=29.9, stops=4))
    assert (m.duty, ended) == (Duty.OBSERVE, ())
    m, ended = advance(m, Inputs(t_s=30.0, stops=4))
    assert (m.duty, m.stop, m.order, ended) == (Duty.PATROL, 2, None, ((7, Ended.OBSERVED),))


@pytest.mark.parametrize(
    ("situation", "how", "duty"),
    [
        (Inputs(t_s=5.0, cancelled=(3, 7)), Ended.CANCELLED, Duty.PATROL),
        (Inputs(t_s=100.1, arrived=True), Ended.TIMED_OUT, Duty.PATROL),
        (Inputs(t_s=5.0, unreachable=True), Ended.UNREACHABLE, Duty.PATROL),
        (Inputs(t_s=5.0, order=order(8)), Ended.REPLACED, Duty.RESPOND),
        (Inputs(t_s=5.0, battery=0.19), Ended.BATTERY, Duty.CHARGE),
        (Inputs(t_s=5.0, battery=0.0), Ended.BATTERY, Duty.EMPTY),
        (Inputs(t_s=5.0, blind=True), Ended.BLIND, Duty.BLIND),
    ],
)
def test_what_ends_a_response(situation: Inputs, how: Ended, duty: Duty) -> None:
    m, ended = advance(RESPONDING, situation, Rules(blind_s=0.0))
    assert ended == ((7, how),) and m.duty is duty and (m.order is None) == (duty is not Duty.RESPOND)
    assert m.stop == 2  # the stop it was on its way to is the next still


def test_a_blink_is_no_blindness_and_a_blind_robot_takes_no_orders_until_it_sees() -> None:
    m, ended = RESPONDING, ()
    for t, blind in ((0.0, True), (4.9, True), (5.0, False), (5.1, True), (10.0, True)):
        m, ended = advance(m, Inputs(t_s=t, blind=blind, stops=4))
        assert (m.duty, ended) == (Duty.RESPOND, ())
    m, ended = advance(m, Inputs(t_s=10.2, blind=True, stops=4))
    assert (m.duty, ended) == (Duty.BLIND, ((7, Ended.BLIND),))
    assert advance(m, Inputs(t_s=11.0, blind=True, order=order(8)))[1] == ((8, Ended.BLIND),)
    m, ended = advance(m, Inputs(t_s=12.0, stops=4, arrived=True))
    assert (m.duty, m.stop, ended) == (Duty.PATROL, 2, ())


def test_a_dock_that_was_reached_is_no_stop_of_the_round() -> None:
    m, _ = advance(Mission(duty=Duty.CHARGE, stop=2), Inputs(t_s=0.0, battery=1.0, arrived=True, stops=4))
    assert (m.duty, m.stop) == (Duty.PATROL, 2)
    m, _ = advance(Mission(duty=Duty.EMPTY, stop=2), Inputs(t_s=0.0, battery=0.5, stops=4))
    assert m.duty is Duty.CHARGE  # somebody has brought it power


def test_a_round_skips_what_it_cannot_reach_and_stands_when_that_is_all() -> None:
    m = Mission()
    for stop, duty in ((1, Duty.PATROL), (2, Duty.PATROL), (0, Duty.STAND)):
        m, _ = advance(m, Inputs(t_s=0.0, unreachable=True, stops=3))
        assert (m.stop, m.duty) == (stop, duty)
    for stop in (1, 2, 0, 1):  # it tries them in turn, and says so once
        m, _ = advance(m, Inputs(t_s=0.5, unreachable=True, stops=3))
        assert (m.stop, m.duty) == (stop, Duty.STAND)
    m, _ = advance(m, Inputs(t_s=1.0, arrived=True, stops=3))
    assert m.duty is Duty.PATROL


def test_an_order_while_charging_comes_back_at_once() -> None:
    m, ended = advance(Mission(duty=Duty.CHARGE), Inputs(t_s=0.0, battery=0.5, order=order(9)))
    assert m.duty is Duty.CHARGE and ended == ((9, Ended.BATTERY),)
    assert advance(m, Inputs(t_s=1.0, battery=0.95))[0].duty is Duty.PATROL


situations = st.builds(
    Inputs,
    t_s=st.floats(0, 200),
    arrived=st.booleans(),
    unreachable=st.booleans(),
    blind=st.booleans(),
    battery=st.sampled_from([0.0, 0.1, 0.5, 1.0]),
    order=st.none() | st.builds(order, st.integers(0, 5), st.floats(0, 20), st.floats(0, 200)),
    cancelled=st.lists(st.integers(0, 5), max_size=2).map(tuple),
    stops=st.just(3),
)


@given(st.lists(situations, max_size=30))
def test_every_order_taken_ends_exactly_once(run: list[Inputs]) -> None:
    m, open_orders = Mission(), []
    for k, s in enumerate(run):
        given_order = (
            s.order
            if s.order is None
            else Order(number=100 * k + s.order.number, alert=1, view=np.zeros(3), hold_s=1, until_s=50)
        )
        s = replace(s, order=given_order, cancelled=())
        m, ended = advance(m, s)
        open_orders += [given_order.number] if given_order else []
        for alert, _ in ended:
            open_orders.remove(alert)
        assert open_orders == ([m.order.number] if m.order else [])
        assert (m.order is not None) == (m.duty in (Duty.RESPOND, Duty.OBSERVE)) and 0 <= m.stop < 3


@given(st.integers(1, 4), st.integers(1, 4), st.integers(0, 10_000))
def test_assignments_are_the_best_of_all(robots: int, alerts: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    costs = np.where(rng.random((robots, alerts)) < 0.3, np.inf, rng.uniform(0, 50, (robots, alerts)))
    pairs = assign(costs)
    assert len({r for r, _ in pairs}) == len({a for _, a in pairs}) == len(pairs)
    most, least = 0, 0.0
    for chosen in permutations(range(max(robots, alerts)), robots):
        real = [(r, c) for r, c in enumerate(chosen) if c < alerts and np.isfinite(costs[r, c])]
        total = sum(costs[p] for p in real)
        if len(real) > most or (len(real) == most and total < least):
            most, least = len(real), total
    assert len(pairs) == most and sum(costs[p] for p in pairs) == pytest.approx(least)


@given(
    st.lists(
        st.tuples(st.sampled_from(["ask", "leave", "lost"]), st.sampled_from("ABC"), st.sampled_from("xy")), max_size=40
    )
)
def test_one_robot_in_a_passage_and_nobody_forgotten(run: list[tuple[str, str, str]]) -> None:
    p = Passages()
    for what, robot, passage in run:
        before = p
        p = {"ask": p.asked, "leave": p.left}.get(what, lambda _, r: p.lost(r))(passage, robot)  # noqa: B023
        for name, waiting in p.queue.items():
            assert len(set(waiting)) == len(waiting) and p.holder.get(name) not in waiting
            assert not waiting or name in p.holder  # whoever waits, waits for somebody
        if what == "ask":
            busy = any(who == robot and name != passage for name, who in before.holder.items())
            assert busy or p.holder[passage] == robot or robot in p.queue[passage]
            assert before.holder.get(passage) in (None, p.holder.get(passage))
        if what == "leave" and before.holder.get(passage) == robot:
            assert p.holder.get(passage) == next(iter(before.queue.get(passage, ())), None)


def test_what_is_no_alert_and_what_are_no_rules() -> None:
    assert AlertState.OBSERVED.ended and not AlertState.ON_SCENE.ended
    for wrong in ({"p": np.array([np.nan, 0.0])}, {"p": np.zeros(3)}, {"sigma": -1.0}, {"patience_s": 0.0}):
        with pytest.raises(DataError, match="alert 4"):
            Alert(**({"number": 4, "t": 0, "p": np.zeros(2)} | wrong))
    with pytest.raises(ConfigError, match="battery"):
        Rules(low=0.9, full=0.5)
