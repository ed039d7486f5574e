"""A drone on the pad of a carrier that drives: carried, flying, landed, carried again."""

from collections.abc import Sequence

import numpy as np
import pytest
from rovers import rover

from outrider.data import Stream
from outrider.data.agents import Action, Message
from outrider.errors import ConfigError
from outrider.models.vehicles import Differential, Multirotor, Pad
from outrider.sim import Imu
from outrider.sim.engine import Ending, Simulation, simulate
from outrider.sim.monitor import Hull
from outrider.sim.team import Robot
from outrider.sim.world import World
from outrider.team import Schedule
from outrider.typing import Floats

STEP = 0.02
FIELD = World(name="field")
CART = Robot(
    name="cart",
    vehicle=Differential(step_s=STEP),
    agent=Schedule(t_s=np.array([0.0]), u=np.array([[0.4, 0.0, 0.0]])),
    pad=Pad(),
    size=Hull(radius=0.5, height=0.5),
)


def flown(
    rows: list[tuple[float, tuple[float, float, float, float]]], cart: Robot = CART, *others: Robot
) -> Simulation:
    t, u = zip(*rows, strict=True)
    agent = Schedule(t_s=np.array(t), u=np.array(u))
    drone = Robot(name="drone", vehicle=Multirotor(step_s=STEP), agent=agent, on="cart", sensors=(Imu(rate_hz=50),))
    return simulate(FIELD, [drone, cart, *others], 16.0, 1)  # the order of names does not matter


HOP = [(2.0, (0.4, 0.0, 0.8, 0.0)), (5.0, (0.4, 0.0, -0.4, 0.0)), (13.0, (0.4, 0.0, 0.5, 0.0))]


def height_over_deck(run: Simulation) -> Floats:
    return run.truth["drone"].p[:, 2] - run.truth["cart"].p[:, 2] - Pad().place[2]


def test_it_rides_takes_off_lands_and_takes_off_again() -> None:
    run = flown(HOP)
    drone, cart, up = run.truth["drone"], run.truth["cart"], height_over_deck(run)
    assert run.ending is Ending.TIME
    assert [n.text for n in run.notes] == ["it is in the air", "it stands on the pad", "it is in the air"]
    left, landed, again = (int(np.searchsorted(drone.t, n.t)) for n in run.notes)
    assert (left, again) == (round(2.0 / STEP), round(13.0 / STEP))
    assert np.abs(up[: left + 1]).max() < 1e-12 and np.abs(up[landed : again + 1]).max() < 1e-12
    np.testing.assert_allclose(drone.v[:left], cart.v[:left], atol=1e-12)
    assert up[left:landed].max() > 1.0 and up[-1] > 0.5
    assert np.abs(np.diff(drone.v[left - 2 : left + 5], axis=0)).max() < 0.2  # no jump as it leaves a moving deck
    assert run.log.streams["drone/imu"].z[:, 5].min() > 4.0  # and feels its weight all the way


class Ticker:
    """Wants to be asked often, and so cuts the run into pieces."""

    period_s = 0.06

    def act(self, t: int, records: Sequence[Stream], inbox: Sequence[Message]) -> Action:
        return Action(command=np.zeros(3))


def test_how_the_run_is_cut_changes_nothing() -> None:
    watcher = rover(name="watcher", vehicle=Differential(step_s=STEP), agent=Ticker(), start=(0.0, 20.0, 0.0, 0.0))
    whole, pieces = flown(HOP).truth["drone"], flown(HOP, CART, watcher).truth["drone"]
    for one, other in ((whole.p, pieces.p), (whole.q, pieces.q), (whole.f, pieces.f)):
        assert one.tobytes() == other.tobytes()


@pytest.mark.parametrize(
    ("down", "says"),
    [((0.4, 0.0, -1.5, 0.0), "struck the pad"), ((0.455, 0.0, -0.4, 0.0), "beside the pad")],
)
def test_a_bad_landing_ends_the_run_with_its_reason(down: tuple[float, float, float, float], says: str) -> None:
    run = flown([HOP[0], (5.0, down)])
    assert run.ending is Ending.COLLISION and says in run.sentence
    assert height_over_deck(run)[-1] > -0.1


def test_what_cannot_carry() -> None:
    for cart, says in (
        (Robot(name="cart", vehicle=Differential(step_s=STEP), agent=CART.agent), "cannot start on cart"),
        (Robot(name="cart", vehicle=Differential(step_s=0.01), agent=CART.agent, pad=Pad()), "steps of 0.02 s"),
        (Robot(name="cart", vehicle=Differential(step_s=STEP), agent=CART.agent, pad=Pad(place=(0, 0, 0.1))), "inside"),
        (Robot(name="wagon", vehicle=Differential(step_s=STEP), agent=CART.agent, pad=Pad()), "carries nobody"),
    ):
        with pytest.raises(ConfigError, match=f"drone.*{says}"):
            flown(HOP, cart)
