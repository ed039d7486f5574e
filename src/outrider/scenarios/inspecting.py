"""Inspections in scenario files: `mission: inspect`. Paths are planned from the solids of the place, and followed on
estimates that the robots share."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any, Final, Literal, final

import numpy as np
from pydantic import Field

from outrider.core.solids import extent
from outrider.data import Gaussian
from outrider.errors import ConfigError
from outrider.filters.cooperative import Member, Method
from outrider.guidance.flight import Flight, FlightRules
from outrider.models import sensors as s
from outrider.models.motion import LAYOUTS, DriftingRover, EulerBody, Motion
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
from outrider.scenarios.navigation import Put, mount_matrix
from outrider.scenarios.sections import Number, Part, inner_section, made_of
from outrider.sim import sensors
from outrider.sim.sensors.sight import number_of
from outrider.sim.truth import EPOCH
from outrider.sim.world import World
from outrider.team.crew import Crew, Ear
from outrider.team.follow import Follower
from outrider.team.inspector import Drone, Rover, Shots
from outrider.typing import Floats

Positive = Annotated[Number, Field(gt=0)]
ABOVE: Final = 2.0  # m between the top of everything and a drone that crosses it
LEAST_ABOVE: Final = 2.5  # m above its pad at which the path of a drone begins
STEP_S: Final = 0.5  # s of a path between looks at the sky
START: Final = {
    "position": 0.3, "heading": 0.02, "yaw": 0.02, "pitch": 0.01, "roll": 0.01, "velocity": 0.1, "yaw_rate": 0.1,
}  # fmt: skip
INF: Final = float("inf")


class InspectMission(Part):
    """Sees as much of the place's solids as it can, along a planned path, on an estimate that the team shares."""

    type: Literal["inspect"]
    half: Literal["lower", "upper"] = "lower"
    """What looks down, or what looks up."""
    method: Literal["none", "local", "naive", "ci", "split_ci", "distributed", "joint"] = "joint"
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


def agents(robots: Mapping[str, Inspector], world: World) -> tuple[dict[str, Rover | Drone], dict[str, InspectionPlan]]:
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
    members = [_member(name, r, world) for name, r in robots.items()]
    ears = {name: _ears(name, r, tuple(robots)) for name, r in robots.items()}
    crew = Crew(members, ears, method, EPOCH, world.datum)
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


def _member(name: str, r: Inspector, world: World) -> Member:
    """Its filter, of coop2024's models, with what it believes where it was put down."""
    motion = Motion.EULER if r.flies else Motion.DRIFTING
    model = EulerBody(acceleration=1.5, rate=0.6, gravity=world.gravity) if r.flies else DriftingRover()
    layout = LAYOUTS[motion]
    x, sd = layout.zeros(), np.zeros(layout.error_size)
    x[layout.state("position")] = r.put[: 3 if r.flies else 2]
    x[layout.state("yaw" if r.flies else "heading")] = r.put[3]
    spread = {**START, "gyro_bias": 0.005, "accel_bias": 0.05}
    if isinstance(model, EulerBody):
        spread |= {"acceleration": model.acceleration, "euler_rate": model.rate}
    for block, value in spread.items():
        if block in layout:
            sd[layout.error(block)] = value
    return Member(name=name, motion=motion, model=model, belief=Gaussian(x, np.diag(sd**2), layout))


def _ears(name: str, r: Inspector, team: tuple[str, ...]) -> tuple[Ear, ...]:
    """How each sensor is heard; those of no use are not. ConfigError without a source of position."""
    out: list[Ear] = []
    for sensor in r.carried:
        out += _ear(sensor, r.flies, [other for other in team if other != name])
    if not any(isinstance(e.sensor, s.GnssPosition | s.MapPose) for e in out):
        raise ConfigError("cannot tell where it is", where=f"robot {name}", fix="give it a gnss or object_pose")
    return tuple(out)


def _ear(sensor: Any, flies: bool, others: list[str]) -> list[Ear]:
    mount = s.Mount.from_matrix(mount_matrix(sensor))
    up = sensor.sigma_up if flies and hasattr(sensor, "sigma_up") else INF
    if isinstance(sensor, sensors.Imu):
        root = sensor.rate_hz**0.5
        gyro, accel = sensor.gyro_density * root, sensor.accel_density * root
        if not flies:
            return [Ear(stream=sensor.name, sensor=s.Gyro(mount=mount), sigmas=(INF, INF, gyro), columns=(0, 3))]
        return [
            Ear(stream=sensor.name, sensor=s.Gyro(mount=mount), sigmas=(gyro,) * 3, columns=(0, 3)),
            Ear(stream=sensor.name, sensor=s.SpecificForce(mount=mount), sigmas=(accel,) * 3, columns=(3, 6)),
        ]
    if isinstance(sensor, sensors.Gnss):
        model = s.GnssPosition(mount=mount)
        return [Ear(stream=sensor.name, sensor=model, sigmas=(sensor.sigma, sensor.sigma, up))]
    if isinstance(sensor, sensors.GnssVelocity):
        return [Ear(stream=sensor.name, sensor=s.GnssVelocity(mount=mount), sigmas=(sensor.sigma, sensor.sigma, up))]
    if isinstance(sensor, sensors.Baro):
        return [Ear(stream=sensor.name, sensor=s.Baro(), sigmas=(sensor.sigma,))] if flies else []
    if isinstance(sensor, sensors.BodyTwist) and not flies:
        v, w = sensor.sigma_v, sensor.sigma_w
        return [Ear(stream=sensor.name, sensor=s.Twist(), sigmas=(v, v, INF, INF, INF, w))]
    if isinstance(sensor, sensors.StereoVelocity):
        sigmas = (sensor.sigma,) * 2 + (sensor.sigma if flies else INF,)
        return [Ear(stream=sensor.name, sensor=s.BodyVelocity(), sigmas=sigmas, navigation=False)]
    if isinstance(sensor, sensors.ObjectPose) and not flies:
        sigmas = (sensor.sigma, sensor.sigma, sensor.sigma_angle)
        return [Ear(stream=sensor.name, sensor=s.MapPose(), sigmas=sigmas, navigation=False)]
    if isinstance(sensor, sensors.RobotCamera):
        model, a = s.RelativePose(mount=mount), sensor.sigma_angle
        sigmas = (sensor.sigma,) * 3 + (INF, INF, a)
        return [
            Ear(stream=sensor.name, sensor=model, sigmas=sigmas, partner=n, number=number_of(n), navigation=False)
            for n in others
        ]
    return []
