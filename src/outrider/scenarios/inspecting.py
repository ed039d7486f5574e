"""Inspections in scenario files: `mission: inspect`. Paths are planned from the solids of the place, and followed on
estimates that the robots share."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any, Final, Literal, final

import numpy as np
from pydantic import Field

from outrider.core.solids import extent
from outrider.errors import ConfigError
from outrider.filters.cooperative import Method
from outrider.guidance.flight import Flight, FlightRules
from outrider.models.vehicles import AIR_INPUTS, Pad, Vehicle
from outrider.planning.inspection import (
    Body,
    Camera,
    Half,
    InspectionPlan,
    Pace,
    Surface,
    Task,
    halves,
    inspect,
    open_above,
)
from outrider.scenarios.crews import Heard, MethodName, crew_of
from outrider.scenarios.navigation import Put, mount_matrix
from outrider.scenarios.sections import Number, Part, inner_section, made_of
from outrider.sim import sensors
from outrider.sim.radio import Radio
from outrider.sim.sensors.sight import number_of
from outrider.sim.truth import EPOCH
from outrider.sim.world import World
from outrider.team.crew import Crew
from outrider.team.follow import Follower
from outrider.team.inspector import Drone, Rover, Shots
from outrider.typing import Floats

Positive = Annotated[Number, Field(gt=0)]
ABOVE: Final = 2.0  # m between the top of everything and a drone that crosses it
LEAST_ABOVE: Final = 2.5  # m above its pad at which the path of a drone begins
STEP_S: Final = 0.5  # s of a path between looks at the sky


class InspectMission(Part):
    """Sees as much of the place's solids as it can, along a planned path, on an estimate that the team shares."""

    type: Literal["inspect"]
    half: Literal["lower", "upper"] = "lower"
    """What looks down, or what looks up."""
    method: MethodName = "joint"
    """How the team shares what its robots measure of one another; one for all."""
    camera: inner_section(Camera) = Field(default={}, validate_default=True)  # type: ignore[valid-type]
    pace: inner_section(Pace) = Field(default={}, validate_default=True)  # type: ignore[valid-type]
    path_s: Positive = 170.0
    """Time for the path."""
    margin: Annotated[Number, Field(ge=0)] = 0.3
    """m between the body and everything."""
    standoff: Positive = 2.5
    """m from the surface, of a drone."""
    density: Positive = 4.0
    """Points per m^2 of surface."""
    endurance_s: Positive = 1e9
    """A full battery of a drone lasts so long."""
    charge_s: Positive = 30.0
    """An empty one takes so long."""
    rules: inner_section(FlightRules) = Field(default={}, validate_default=True)  # type: ignore[valid-type]
    period_s: Positive = 0.2


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Inspector:
    """A robot of an inspection, as its section makes it."""

    section: InspectMission
    vehicle: Vehicle
    carried: tuple[Any, ...]
    put: Put
    pad: Pad | None
    on: str

    @property
    def flies(self) -> bool:
        """Whether it is a drone."""
        return self.vehicle.inputs == AIR_INPUTS


def agents(
    robots: Mapping[str, Inspector], world: World, radio: Radio, seed: int
) -> tuple[dict[str, Rover | Drone], dict[str, InspectionPlan]]:
    """The agents of all inspectors of a team, which share their estimates, and their plans.

    Raises ConfigError for a place without solids, a drone without a carrier, two methods, and where no path is found.
    """
    if not robots:
        return {}, {}
    table = np.ascontiguousarray(world.solids.table)
    if not table.size:
        raise ConfigError(f"{world.name} has nothing to inspect", where="inspect", fix="a place with solids")
    methods = {r.section.method for r in robots.values()}
    if len(methods) > 1:
        raise ConfigError(f"methods {', '.join(sorted(methods))}", where="inspect", fix="one for all of the team")
    method = Method[methods.pop().upper()]
    heard = {n: Heard(put=r.put, flies=r.flies, carried=r.carried, closed_loop=True) for n, r in robots.items()}
    crew = crew_of(heard, method, world, radio, seed)
    plans = plan(robots, table)
    made = {n: (_drone if r.flies else _rover)(n, r, robots, plans[n], crew, table) for n, r in robots.items()}
    return made, plans


def plan(robots: Mapping[str, Inspector], table: Floats) -> dict[str, InspectionPlan]:
    """Everybody's plan; robots of one half share it, from west to east by where they start."""
    out: dict[str, InspectionPlan] = {}
    for half in ("lower", "upper"):
        crowd = sorted((r.put[0], n) for n, r in robots.items() if r.section.half == half)
        for k, (_, name) in enumerate(crowd):
            r = robots[name]
            out[name] = _planned(table.tobytes(), half, k, len(crowd), r.section.density, _task(r, robots))
    return out


def _task(r: Inspector, robots: Mapping[str, Inspector]) -> Task:
    m, put = r.section, r.put
    up = put[2]
    if r.flies:
        up += LEAST_ABOVE
    body = Body(radius=r.vehicle.radius, height=r.vehicle.height, margin=m.margin)
    return Task(
        body=body, camera=made_of(Camera, m.camera), pace=made_of(Pace, m.pace), start=(put[0], put[1], up),
        flies=r.flies, duration_s=m.path_s, standoff=m.standoff,
    )  # fmt: skip


@lru_cache(maxsize=32)
def _planned(table: bytes, half: str, k: int, n: int, density: float, task: Task) -> InspectionPlan:
    """Plans depend on no seed: a campaign makes each once."""
    solids = np.frombuffer(table).reshape(-1, 24)
    return inspect(solids, _share(halves(solids, density)[Half[half.upper()]], k, n), task)


def _share(on: Surface, k: int, n: int) -> Surface:
    """One of n equal parts, from west to east."""
    order = np.argsort(on.p[:, 0], kind="stable")
    return on if n == 1 else on.select(np.sort(np.array_split(order, n)[k]))


def _rover(
    name: str, r: Inspector, robots: Mapping[str, Inspector], plan: InspectionPlan, crew: Crew, table: Floats
) -> Rover:
    drones = [n for n, other in robots.items() if other.on == name]
    pad = np.array((r.pad or Pad()).place)
    t = np.arange(0.0, plan.path.duration + STEP_S, STEP_S)
    free = np.ones(t.size, np.bool_)
    if drones:
        d = robots[drones[0]]
        body = Body(radius=d.vehicle.radius, height=d.vehicle.height, margin=2.0 * d.section.margin)
        free = open_above(table, body, plan.path.at(t)[0] + [0.0, 0.0, pad[2]], _high(table))
    return Rover(
        name=name, crew=crew, follower=Follower(path=plan.path), shots=Shots(due=plan.pictures.t),
        speed=1.3 * plan.task.pace.speed, pad=pad, open_s=t[free], drone=drones[0] if drones else "",
        radius=r.vehicle.radius, period_s=r.section.period_s,
    )  # fmt: skip


def _drone(
    name: str, r: Inspector, robots: Mapping[str, Inspector], plan: InspectionPlan, crew: Crew, table: Floats
) -> Drone:
    carrier = robots.get(r.on)
    cameras = [c for c in r.carried if isinstance(c, sensors.RobotCamera)]
    if carrier is None or carrier.pad is None:
        raise ConfigError("a drone without a pad", where=f"robot {name}", fix="`on`: a robot that inspects, with a pad")
    if not cameras:
        raise ConfigError("a drone that cannot see its pad", where=f"robot {name}", fix="a robot_camera turned down")
    t = np.arange(0.0, plan.path.duration + STEP_S, STEP_S)
    T = mount_matrix(cameras[0])
    return Drone(
        name=name, carrier=r.on, crew=crew, follower=Follower(path=plan.path), shots=Shots(due=plan.pictures.t),
        speed=plan.task.pace.speed, camera=cameras[0].name, number=number_of(r.on), mount=T[:3, :3], lever=T[:3, 3],
        pad=np.array(carrier.pad.place), high=_high(table), free_s=t,
        free=open_above(table, plan.task.body, plan.path.at(t)[0], _high(table)),
        endurance_s=r.section.endurance_s, charge_s=r.section.charge_s, rules=made_of(FlightRules, r.section.rules),
        period_s=r.section.period_s, flight=Flight(since_s=EPOCH * 1e-9),
    )  # fmt: skip


def _high(table: Floats) -> float:
    return float(extent(table)[1, 2]) + ABOVE
