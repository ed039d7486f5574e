"""A few runs of the campaign of `test_people_evidence`, and somebody who walks into a robot that stands."""

import numpy as np
import pytest
from people import FREE_OF, STILL, drive, people

from outrider.sim.world import Mover

pytestmark = pytest.mark.compiled  # closed loops
FREE_S = 18.5  # without people


@pytest.mark.parametrize("seed", [1, 6])
def test_it_arrives_among_people_in_time_and_touches_nobody(seed: int) -> None:
    trial = drive(people(seed), seed)
    assert trial.arrived and not trial.contact
    assert trial.seconds < FREE_OF * FREE_S
    assert trial.room > 0.0


@pytest.mark.parametrize("seed", [32, 45])
def test_who_stands_beside_the_way_may_set_off_while_it_passes(seed: int) -> None:
    """In both runs somebody does, and is known to move 0.4 s later: at the gap that things are given he was hit."""
    trial = drive(people(seed), seed)
    assert trial.arrived and not trial.contact and trial.room > 0.2


def test_somebody_who_walks_up_to_it_head_on_is_let_past() -> None:
    """It moves aside, or stands when he touches it: never on into him."""
    man = Mover.along("man", [[0.1, 14.0], [0.1, -3.0]], 1.4, start_s=2.0)
    trial = drive((man,), 3)
    assert not trial.contact or trial.speed <= STILL
    assert trial.arrived and np.isfinite(trial.room)
