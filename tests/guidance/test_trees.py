"""A mission in a behaviour tree is the same mission; guards of one's own stand around it."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Selector, Sequence

from outrider.guidance.patrol import Duty, Ended, Inputs, Mission, Order, Rules, advance
from outrider.guidance.trees import Advance, During, Slate, transition_of


def order(number: int) -> Order:
    return Order(number=number, alert=7, view=np.zeros(3), hold_s=2.0, until_s=50.0)


situations = st.builds(
    Inputs,
    t_s=st.floats(0, 100),
    arrived=st.booleans(),
    unreachable=st.booleans(),
    blind=st.booleans(),
    battery=st.sampled_from([0.0, 0.1, 0.5, 1.0]),
    order=st.none() | st.builds(order, st.integers(0, 5)),
    cancelled=st.lists(st.integers(0, 5), max_size=2).map(tuple),
    stops=st.just(3),
)


@given(st.lists(situations, max_size=20))
def test_a_tree_of_one_behaviour_is_the_transition_itself(run: list[Inputs]) -> None:
    slate = Slate()
    step = Advance("mission", slate)
    transition, m = transition_of(step, slate), Mission()
    for s in run:
        before, (m, ended) = m, advance(m, s, Rules(low=0.3))
        assert transition(before, s, Rules(low=0.3)) == (m, ended)
        failed = any(how is not Ended.OBSERVED for _, how in ended)
        assert step.status is (Status.FAILURE if failed else Status.RUNNING if m.order else Status.SUCCESS)


class Raining(Behaviour):
    wet = False

    def update(self) -> Status:
        return Status.SUCCESS if self.wet else Status.FAILURE


def test_a_guard_of_ones_own_changes_the_rules_and_a_condition_sees_the_duty() -> None:
    slate = Slate()
    wet, home, dry = Raining("raining"), Advance("careful", slate, Rules(low=0.6)), Advance("mission", slate)
    charging = During("charging", slate, Duty.CHARGE, Duty.EMPTY)
    tree = Selector("robot", memory=False, children=[Sequence("rain", memory=False, children=[wet, home]), dry])
    transition = transition_of(Sequence("root", memory=False, children=[tree, charging]), slate)
    half = Inputs(t_s=1.0, battery=0.5)
    m, _ = transition(Mission(), half, Rules())
    assert m.duty is Duty.PATROL and charging.status is Status.FAILURE
    wet.wet = True
    m, _ = transition(m, half, Rules())
    assert m.duty is Duty.CHARGE and charging.status is Status.SUCCESS
    assert home.feedback_message == Duty.CHARGE.value
