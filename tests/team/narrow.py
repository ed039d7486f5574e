"""Two yards joined by a passage 2 m wide, as wide as the aisles of amr2025's bicycle parking, and robots that swap."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from outrider.data import Stream
from outrider.data.agents import Action, Agent, Message
from outrider.scenarios.build import Cast, build
from outrider.scenarios.files import parse_scenario
from outrider.scenarios.ground import WHEELS
from outrider.sim.engine import Simulation
from outrider.typing import Bools

LONG = 8.0  # m
DRAWING: dict[str, Any] = {
    "name": "narrow",
    "roads": [
        {"name": "west yard", "area": [[-10, -5], [0, -5], [0, 5], [-10, 5]]},
        {"name": "passage", "line": [[-0.5, 0], [LONG + 0.5, 0]], "width": 2.0},
        {"name": "east yard", "area": [[LONG, -5], [LONG + 10, -5], [LONG + 10, 5], [LONG, 5]]},
    ],
    "buildings": [
        {"name": "north rack", "area": [[0, 1], [LONG, 1], [LONG, 5], [0, 5]]},
        {"name": "south rack", "area": [[0, -5], [LONG, -5], [LONG, -1], [0, -1]]},
    ],
    "routes": {"nodes": {"in": [0, 0], "out": [LONG, 0]}, "ways": [{"way": ["in", "out"], "width": 2.0}]},
}
DRIVE = {"forward": 1.0, "sideways": 0.4, "acceleration": 0.8, "driver": {"patience_s": 90.0}}
WEST, EAST = ([-8.0, 0.5], [-8.0, -3.0], [-8.0, 3.0]), ([LONG + 8.0, -1.5], [LONG + 8.0, 3.0], [LONG + 8.0, -3.0])


def robot(start: tuple[float, float, float], stops: Sequence[Sequence[float]]) -> dict[str, Any]:
    return {
        "vehicle": {"type": "mecanum", "wheels": WHEELS, "radius": 0.45, "height": 0.6, "latency_s": 0.05},
        "start": {"x": start[0], "y": start[1], "yaw_deg": start[2]},
        "sensors": [
            {"type": "imu", "rate_hz": 20.0},
            {"type": "body_twist", "name": "wheels", "rate_hz": 10.0, "rolling": False},
            {"type": "gnss_receiver", "lever": [0.1, 0.0, 0.7], "latency_s": 0.1},
            {"type": "lidar", "rate_hz": 5.0, "beams": 180, "max_range": 12.0},
        ],
        "mission": {"type": "patrol", "stops": stops, "period_s": 0.2, "drive": DRIVE},
    }


def cast(robots: dict[str, Any], seconds: float, seed: int = 1, alerts: Sequence[Any] = (), **more: Any) -> Cast:
    mast = {"start": {"x": 4.0, "y": 8.0, "z": 6.0}, "size": {"radius": 0.1, "height": 0.3}}
    station = {**mast, "mission": {"type": "station", "alerts": list(alerts), **more}}
    place = {"type": "site", "drawing": DRAWING}
    data = {"duration_s": seconds, "seed": seed, "world": {"place": place}, "team": {"station": station, **robots}}
    return build(parse_scenario(data))


def inside(run: Simulation, name: str) -> Bools:
    """Whether a robot's middle is in the passage, at every stamp."""
    p = run.truth[name].p
    return (p[:, 0] > 0.0) & (p[:, 0] < LONG) & (np.abs(p[:, 1]) < 1.0)


def crossings(run: Simulation, name: str) -> int:
    """How often a robot came from one yard into the other."""
    x = run.truth[name].p[:, 0]
    side = np.sign(np.where((x > 0.0) & (x < LONG), 0.0, x - LONG / 2))
    side = side[side != 0.0]
    return int((np.diff(side) != 0.0).sum())


@dataclass
class Dies:
    """Goes silent and stops for good, at the moment it is told to or once `when` says so."""

    agent: Any
    when: Any
    dead: bool = False

    @property
    def period_s(self) -> float:
        return self.agent.period_s

    def act(self, t: int, records: Sequence[Stream], inbox: Sequence[Message]) -> Action:
        self.dead = self.dead or bool(self.when(t, self.agent))
        return Action(command=np.zeros(3)) if self.dead else self.agent.act(t, records, inbox)


def with_agent(one: Cast, name: str, make: Any) -> Cast:
    """The cast with an agent wrapped."""

    def changed(agent: Agent) -> Agent:
        return make(agent)

    return replace(one, team=tuple(replace(r, agent=changed(r.agent)) if r.name == name else r for r in one.team))
