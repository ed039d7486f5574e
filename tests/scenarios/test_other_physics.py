"""The same follower in vehicles that are not its own: rigid bodies of MuJoCo, and a quadrotor of RotorPy."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest

from outrider.core.rotations import quats_to_matrices, rpy_to_quats
from outrider.models.vehicles import AIR_INPUTS, Multirotor
from outrider.models.vehicles.base import STANDARD_GRAVITY
from outrider.scenarios.build import Cast, build
from outrider.scenarios.files import load_scenario
from outrider.scenarios.followed import pursuers
from outrider.sim.engine import Ending
from outrider.typing import Floats

R_D = 3.0
GIVEN = {"target": "turn", "duration_s": 40.0}


def apart(cast: Cast) -> tuple[Ending, Floats, float]:
    """How it ended, the true distance every tenth of a second, and where it should stay at the end."""
    done = cast.run()
    t = np.arange(done.monitor.start, done.ended + 1, 100_000_000)
    d = np.linalg.norm(done.truth["follower"].at(t).p - done.truth["target"].at(t).p, axis=1)
    return done.ending, d, pursuers(cast)["follower"].flown.set_point[-1]


@pytest.mark.compiled
def test_mujoco() -> None:
    pytest.importorskip("mujoco")
    ending, d, goal = apart(build(*load_scenario("follow-leader", {**GIVEN, "physics": "mujoco"})))
    assert ending is Ending.TIME
    assert d.min() > R_D
    assert np.abs(d[-50:] - goal).max() < 1.0


@dataclass(frozen=True, kw_only=True)
class RotorPy:
    """A Hummingbird of RotorPy under its own velocity controller; `design` says how quickly it answers."""

    design: Multirotor = field(default_factory=lambda: Multirotor(tau_s=0.5, speed=4.0))
    step_s: float = 0.02
    gravity: float = STANDARD_GRAVITY
    radius: float = 0.3
    height: float = 0.2
    inputs: tuple[str, ...] = AIR_INPUTS
    actuators: tuple[str, ...] = ()
    width: int = 20  # x, v, q, w, wind, rotor speeds

    def _body(self) -> Any:
        from rotorpy.vehicles.hummingbird_params import quad_params
        from rotorpy.vehicles.multirotor import Multirotor as Body

        body = Body({**quad_params, "k_v": 1.0 / self.design.tau_s}, control_abstraction="cmd_vel")
        body.g, body.weight = self.gravity, np.array([0.0, 0.0, -body.mass * self.gravity])
        return body

    def start(self, p: Floats, yaw: float) -> Floats:
        """Hovering at p; its velocity controller keeps the nose to the east."""
        body = self._body()
        q = rpy_to_quats(np.zeros((1, 3)))[0]
        hover = np.full(4, np.sqrt(body.mass * body.g / (4.0 * body.k_eta)))
        return np.concatenate([p, np.zeros(3), q, np.zeros(3), np.zeros(3), hover])

    def run(self, x: Floats, u: Floats, air: Floats, ground: Floats, out: Floats) -> None:
        """See `Vehicle`."""
        body, cuts = self._body(), {"x": (0, 3), "v": (3, 6), "q": (6, 10), "w": (10, 13), "wind": (13, 16)}
        state = {name: x[a:b].copy() for name, (a, b) in {**cuts, "rotor_speeds": (16, 20)}.items()}
        for k in range(len(u)):
            state["wind"] = air[k].copy()
            before = state["v"].copy()
            state = body.step(state, {"cmd_v": u[k, :3]}, self.step_s)
            R = quats_to_matrices(state["q"][None])[0]
            felt = R.T @ ((state["v"] - before) / self.step_s + [0.0, 0.0, self.gravity])
            out[k] = np.concatenate([state["x"], state["q"], state["v"], state["w"], felt])
        x[:] = np.concatenate([state[n] for n in ("x", "v", "q", "w", "wind", "rotor_speeds")])


@pytest.mark.compiled
def test_rotorpy() -> None:
    pytest.importorskip("rotorpy")
    # drag holds back a controller without integral: to its filter that is a wind, which it flies against
    cast = build(*load_scenario("follow-leader", {**GIVEN, "team.follower.mission.wind": 1.0}))
    outside = RotorPy()
    team = tuple(replace(r, vehicle=outside) if r.name == "follower" else r for r in cast.team)
    ending, d, goal = apart(replace(cast, team=team))
    assert ending is Ending.TIME
    assert d.min() > R_D
    assert np.abs(d[-50:] - goal).max() < 1.0
