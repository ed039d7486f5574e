"""What an agent says again and again is one note, with how often and for how long."""

from collections.abc import Sequence

import numpy as np

from outrider.data import Stream
from outrider.data.agents import Action, Message
from outrider.models.vehicles import Differential
from outrider.sim.engine import simulate
from outrider.sim.team import Robot
from outrider.sim.truth import EPOCH
from outrider.sim.world import World


class Talks:
    """Says what its script has for each tenth of a second."""

    period_s = 0.1

    def __init__(self, script: Sequence[str]) -> None:
        self.script = script

    def act(self, t: int, records: Sequence[Stream], inbox: Sequence[Message]) -> Action:
        return Action(command=np.zeros(3), note=self.script[round((t - EPOCH) * 1e-8)])


def said(*scripts: Sequence[str]) -> list[tuple[float, str, str]]:
    """The notes of robots that stand beside one another."""
    team = tuple(
        Robot(name=f"r{k}", vehicle=Differential(), agent=Talks(s), start=(0.0, 5.0 * k, 0.0, 0.0))
        for k, s in enumerate(scripts)
    )
    run = simulate(World(name="plain"), team, (len(scripts[0]) - 1) * 0.1, 1)
    return [(round((n.t - EPOCH) * 1e-9, 1), n.robot, n.text) for n in run.notes]


def test_the_same_words_are_said_once_with_a_count() -> None:
    assert said(["late", *["late"] * 20, "ok", "", "ok", "late", ""]) == [
        (0.0, "r0", "late (21 times within 2.0 s)"),
        (2.1, "r0", "ok (2 times within 0.2 s)"),
        (2.4, "r0", "late"),
    ]


def test_what_happens_again_later_is_another_note() -> None:
    assert said(["lost", *[""] * 19, "lost", ""]) == [(0.0, "r0", "lost"), (2.0, "r0", "lost")]


def test_another_robot_does_not_interrupt() -> None:
    notes = said(["a", "a", "a", "", ""], ["", "b", "a", "", ""])
    assert notes == [(0.0, "r0", "a (3 times within 0.2 s)"), (0.1, "r1", "b"), (0.2, "r1", "a")]
