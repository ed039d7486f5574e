"""Who flies and touches the ground has collided with it, unless it takes off, lands on purpose or stands on a pad."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest

from outrider.data import Stream
from outrider.data.agents import Action, Message
from outrider.models.vehicles import AIR_INPUTS, ROW_P, ROW_Q, Multirotor
from outrider.sim.engine import Ending, Simulation, simulate
from outrider.sim.monitor import GROUND
from outrider.sim.team import Robot
from outrider.sim.truth import EPOCH
from outrider.sim.world import Ground, World
from outrider.team import Schedule

STEP = 0.01


@dataclass
class Falls:
    """Sinks at 1 m/s all the time; climbs for the first seconds if it stood. landing : what it says of that."""

    climbs_s: float = 0.0
    landing: bool = False
    period_s: float = 0.1

    def act(self, t: int, records: Sequence[Stream], inbox: Sequence[Message]) -> Action:
        up = 1.0 if (t - EPOCH) * 1e-9 < self.climbs_s else -1.0
        return Action(command=np.array([0.5, 0.0, up, 0.0]))


def flown(agent: object, height: float, world: World | None = None, vehicle: object = None) -> Simulation:
    """Ten seconds from that height."""
    drone = Robot(name="d", vehicle=vehicle or Multirotor(step_s=STEP), agent=agent, start=(0.0, 0.0, height, 0.0))  # type: ignore[arg-type]
    return simulate(world or World(name="plain"), (drone,), 10.0, 1)


def test_sinking_into_the_ground_is_a_collision_with_a_name_and_a_time() -> None:
    """From 4 m at 1 m/s, after 0.5 s of lag: v = 1 - e^(-2 t), 4 m are sunk after 4.5 s."""
    run = flown(Falls(), 4.0)
    assert run.ending is Ending.COLLISION
    assert run.hit is not None and (run.hit.robot, run.hit.what) == ("d", GROUND)
    assert (run.hit.t - EPOCH) * 1e-9 == pytest.approx(4.5, abs=0.02)
    assert run.sentence == "d collides with the ground after 4.5 s"
    assert run.monitor.clearances["d"].what == GROUND


@pytest.mark.parametrize(
    "agent",
    [Falls(landing=True), Schedule(t_s=np.zeros(1), u=np.array([[0.0, 0.0, -1.0, 0.0]]))],
    ids=["it says so", "its schedule tells it to sink"],
)
def test_a_landing_is_none(agent: object) -> None:
    run = flown(agent, 4.0)
    assert run.ending is Ending.TIME
    assert run.truth["d"].p[-1, 2] == pytest.approx(0.0, abs=1e-6)


def test_taking_off_is_none_and_coming_down_again_is_one() -> None:
    assert flown(Falls(climbs_s=20.0), 0.0).ending is Ending.TIME
    assert flown(Falls(climbs_s=0.2), 0.0).ending is Ending.TIME  # never left the ground by more than a hand
    again = flown(Falls(climbs_s=3.0), 0.0)
    assert again.hit is not None and again.hit.what == GROUND and (again.hit.t - EPOCH) * 1e-9 > 4.0


def test_standing_before_taking_off_is_none_also_within_one_look() -> None:
    """From rest on the ground to 2 m and back, looked at in one piece: only the way back counts."""
    run = flown(Falls(climbs_s=3.0), 0.0)
    truth = run.truth["d"]
    top = int(truth.p[:, 2].argmax())
    watch = replace(run.monitor, clearances={}, separations={}, fences={}, _aloft=set())
    assert truth.p[0, 2] == 0.0 and truth.p[top, 2] > 1.0
    assert watch.look({"d": truth.select(slice(0, top))}) is None
    hit = watch.look({"d": truth.select(slice(top, None))})
    assert hit is not None and hit.what == GROUND


def test_the_ground_may_slope() -> None:
    """Up a slope of 1 in 2 it meets the ground where that is by then."""
    run = flown(Falls(), 4.0, World(name="hill", ground=Ground(slope=(0.5, 0.0))))
    assert run.hit is not None and run.hit.what == GROUND
    p = run.truth["d"].p[-1]
    assert p[2] == pytest.approx(0.5 * p[0], abs=0.03)


@dataclass(frozen=True)
class Bottomless:
    """A vehicle from elsewhere that knows no ground."""

    radius: float = 0.3
    height: float = 0.2
    step_s: float = STEP
    gravity: float = World(name="any").gravity
    inputs: tuple[str, ...] = AIR_INPUTS
    actuators: tuple[str, ...] = ()

    def start(self, p: np.ndarray, yaw: float) -> np.ndarray:
        return np.array(p, float)

    def run(self, x: np.ndarray, u: np.ndarray, air: np.ndarray, ground: np.ndarray, out: np.ndarray) -> None:
        for k in range(len(u)):
            x += u[k, :3] * STEP
            out[k] = 0.0
            out[k, ROW_P : ROW_P + 3], out[k, ROW_Q + 3] = x, 1.0


def test_a_vehicle_of_another_physics_does_not_fly_below_the_ground_unseen() -> None:
    run = flown(Falls(), 2.0, vehicle=Bottomless())
    assert run.hit is not None and run.hit.what == GROUND
    assert (run.hit.t - EPOCH) * 1e-9 == pytest.approx(2.0, abs=0.03)
