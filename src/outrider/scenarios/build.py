"""From a checked scenario to a world, a team and a radio."""

from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from math import cos, sin
from typing import Any, final

import numpy as np

from outrider.core.rotations import quats_to_matrices
from outrider.data.agents import Agent, Planned
from outrider.errors import ConfigError
from outrider.filters.cooperative import Method
from outrider.io.checked import fault_at, remedy
from outrider.models.vehicles import AIR_INPUTS, Differential, Mecanum, Pad, Rotorcraft, Vehicle
from outrider.planning.inspection import InspectionPlan
from outrider.scenarios.crews import Heard, crew_of
from outrider.scenarios.driving import GotoMission, goal_poses, ground_robot
from outrider.scenarios.following import LeadMission, carried_leader, leader, pursuer, told_of
from outrider.scenarios.inspecting import Inspector, agents
from outrider.scenarios.navigation import Put, mount_matrix, navigator
from outrider.scenarios.parts import (
    FAULTS,
    PLACES,
    SENSORS,
    VEHICLES,
    RobotSection,
    Scenario,
    ScoutMission,
    TourMission,
    WorldSection,
)
from outrider.scenarios.patrolling import Member, Setting, patrol, setting_of, station
from outrider.scenarios.sections import made_of
from outrider.scenarios.tracks import standing, track
from outrider.sim.engine import Simulation, simulate
from outrider.sim.monitor import Hull
from outrider.sim.radio import Radio
from outrider.sim.sensors import GnssReceiver, Lidar, Spell
from outrider.sim.team import Robot
from outrider.sim.truth import EPOCH, Drift, Truth
from outrider.sim.world import Fence, Ground, Mover, Wall, Wind, World
from outrider.team import Schedule, Tour
from outrider.team.crew import Crew
from outrider.team.errand import Errand
from outrider.team.scout import Scout
from outrider.team.tour import GROUNDED
from outrider.typing import Floats


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Cast:
    """What a scenario describes, ready to run once: agents keep what they have learnt."""

    world: World
    team: tuple[Robot, ...]
    radio: Radio
    duration_s: float
    seed: int

    where: str = ""
    plans: Mapping[str, InspectionPlan] = field(default_factory=dict[str, InspectionPlan])
    crew: Crew | None = None
    """Of robots that share their estimates."""
    ablates: bool = False
    """Whether what each sensor was worth is to be found."""

    def run(self) -> Simulation:
        """Simulate it. Raises ConfigError for what only shows on the spot: a robot that starts inside a wall."""
        try:
            return simulate(self.world, self.team, self.duration_s, self.seed, radio=self.radio)
        except ConfigError as e:
            own = [r.name for r in self.team if e.where == f"robot {r.name}"]
            what = e.what if own or not e.where else f"{e.where}: {e.what}"
            raise fault_at(("team", *own), what, self.where, e.fix) from None


def build(scenario: Scenario, where: str = "") -> Cast:
    """The objects of a scenario. What cannot be is a ConfigError with its place in the file `where`."""
    with at(where, "world"):
        world = _world(scenario.world)
        world.validate()
    with at(where, "radio"):
        radio = made_of(Radio, scenario.radio)
    put = {name: _put(name, scenario, where) for name in scenario.team}
    with at(where, "team"):
        shared = setting_of(world, scenario.world.place, scenario.team)
        inspectors, plans = agents(_inspectors(scenario, world, put), world, radio, scenario.seed)
    leads = {
        n: told_of(s.mission, [x.name for x in s.sensors]) if isinstance(s.mission, LeadMission) else None
        for n, s in scenario.team.items()
    }
    team = tuple(
        _robot(n, s, shared, put[n], scenario.duration_s, where, inspectors.get(n), leads)
        for n, s in scenario.team.items()
    )
    with at(where, "cooperation"):
        crew = next((a.crew for a in inspectors.values()), None) or _listeners(scenario, team, world, radio)
    return Cast(
        world=world,
        team=team,
        radio=radio,
        duration_s=scenario.duration_s,
        seed=scenario.seed,
        where=where,
        plans=plans,
        crew=crew,
        ablates=scenario.cooperation is not None and scenario.cooperation.ablate,
    )


def _listeners(scenario: Scenario, team: Sequence[Robot], world: World, radio: Radio) -> Crew | None:
    """Estimates of a team that is carried, from its records; None unless the scenario asks for them."""
    if scenario.cooperation is None:
        return None
    tracks = {r.name: r.track for r in team if r.track is not None and scenario.team[r.name].mission.type == "track"}
    missing = [r.name for r in team if r.name not in tracks]
    if missing:
        what = f"{', '.join(missing)} estimate by themselves"
        raise ConfigError(what, fix="a team of which everybody is carried along a track, or inspects")
    heard: dict[str, Heard] = {}
    for r in team:
        truth, mission = tracks[r.name], scenario.team[r.name].mission
        R = quats_to_matrices(truth.q[:1])[0]
        put = (*truth.p[0].tolist(), float(np.arctan2(R[1, 0], R[0, 0])))
        heard[r.name] = Heard(put=put, flies=mission.flies, carried=tuple(_bare(r.sensors)), closed_loop=False)
    return crew_of(heard, Method[scenario.cooperation.method.upper()], world, radio, scenario.seed)


@contextmanager
def at(where: str, *keys: str | int) -> Generator[None, None, None]:
    """Give the place in the file to a ConfigError that knows only its class."""
    try:
        yield
    except ConfigError as e:
        raise fault_at(keys, f"{e.where}: {e.what}" if e.where else e.what, where, e.fix) from None


def _world(section: WorldSection) -> World:
    given = section.place.model_dump(exclude={"type"})
    world = PLACES[section.place.type](**given)
    movers = [Mover.along(**m.model_dump()) for m in section.movers]
    return replace(
        world,
        wind=made_of(Wind, section.wind),
        ground=made_of(Ground, section.ground),
        walls=(*world.walls, *(made_of(Wall, w) for w in section.walls)),
        movers=(*world.movers, *movers),
        fence=world.fence if section.fence is None else made_of(Fence, section.fence),
    )


def _put(name: str, scenario: Scenario, where: str) -> Put:
    """Where a robot starts; on a pad, that is up to the carrier."""
    section = scenario.team[name]
    if section.on is None:
        start = section.start
        return start.x, start.y, start.z, start.yaw
    carrier = scenario.team.get(section.on)
    with at(where, "team", name, "on"):
        if carrier is None or carrier.pad is None:
            with_pads = [n for n, s in scenario.team.items() if s.pad is not None]
            raise ConfigError(f"no robot '{section.on}' with a pad", fix=remedy(section.on, with_pads))
    east, north, up, yaw = _put(section.on, scenario, where) if carrier.on is None else (0.0, 0.0, 0.0, 0.0)
    x, y, z = made_of(Pad, carrier.pad).place
    return east + x * cos(yaw) - y * sin(yaw), north + x * sin(yaw) + y * cos(yaw), up + z, yaw


def _inspectors(scenario: Scenario, world: World, put: Mapping[str, Put]) -> dict[str, Inspector]:
    """Who inspects, with what it is and carries."""
    out: dict[str, Inspector] = {}
    for name, section in scenario.team.items():
        mission: Any = section.mission
        vehicle = _vehicle(section, world) if mission.type == "inspect" else None
        if vehicle is None:
            continue
        pad = None if section.pad is None else made_of(Pad, section.pad)
        carried = tuple(_bare(_sensors(section, "", ("team", name))))
        out[name] = Inspector(
            section=mission, vehicle=vehicle, carried=carried, put=put[name], pad=pad, on=section.on or "",
        )  # fmt: skip
    return out


def _vehicle(section: RobotSection, world: World) -> Vehicle | None:
    if section.vehicle is None:
        return None
    vehicle = made_of(VEHICLES[section.vehicle.type], section.vehicle, gravity=world.gravity)
    if section.physics == "own":
        return vehicle
    from outrider.sim.physics import MujocoRotorcraft, MujocoRover, library

    library()
    if isinstance(vehicle, Mecanum | Differential):
        return MujocoRover(design=vehicle)
    if isinstance(vehicle, Rotorcraft):
        return MujocoRotorcraft(design=vehicle)
    raise ConfigError(
        f"physics 'mujoco' knows no {section.vehicle.type}", fix="it has mecanum, differential, rotorcraft"
    )


def _robot(
    name: str, section: RobotSection, shared: Setting, put: Put, duration_s: float, where: str,
    inspector: Agent | None, leads: Mapping[str, LeadMission | None],
) -> Robot:  # fmt: skip
    key, world = ("team", name), shared.world
    with at(where, *key, "vehicle"):
        vehicle = _vehicle(section, world)
    carried = _sensors(section, where, key)
    hull = None if section.size is None else made_of(Hull, section.size)
    agent: Agent | Planned | None = None
    path: Truth | None = None
    with at(where, *key, "mission"):
        mission: Any = section.mission
        if mission.type == "track":
            path = track(mission, put, duration_s, world, name)
            if vehicle is not None:
                raise ConfigError("a track carries its robot", fix="leave out the vehicle, or give it a tour")
        elif mission.type == "station":
            path, agent = standing(put, duration_s, world, name), station(name, mission, shared)
            if vehicle is not None:
                raise ConfigError("a station stands", fix="leave out the vehicle")
        elif mission.type == "lead":
            agent = leader(name, mission, vehicle, carried, put, world)
            path = carried_leader(mission, put, duration_s, world, name) if vehicle is None else None
        elif mission.type == "follow" and vehicle is not None:
            agent = pursuer(name, mission, vehicle, carried, put, world, leads)
        elif vehicle is None:
            raise ConfigError(f"a mission '{mission.type}' needs a vehicle", fix=f"there are: {', '.join(VEHICLES)}")
        elif inspector is not None:
            agent = inspector
        else:
            member = Member(name=name, vehicle=vehicle, carried=carried, put=put, hull=hull)
            agent = _agent(member, mission, shared)
    return Robot(
        name=name, vehicle=vehicle, agent=agent, track=path, sensors=carried, start=put,
        mounts={getattr(s, "frame", s.name): mount_matrix(s) for s in _bare(carried) if hasattr(s, "lever")},
        drift=made_of(Drift, section.drift), size=hull,
        pad=None if section.pad is None else made_of(Pad, section.pad), on=section.on or "",
        aloft=mission.type == "lead" or (mission.type == "track" and mission.flies and _high(mission.points)),
    )  # fmt: skip


def _high(points: list[list[float]]) -> bool:
    """Whether no point of a track lies on the ground: one that does is a landing."""
    return all(len(p) == 3 and p[2] > GROUNDED for p in points)


def _agent(member: Member, mission: Any, shared: Setting) -> Agent | Planned:
    if mission.type == "patrol":
        return patrol(mission, member, shared)
    if mission.type == "goto":
        return _errand(member, mission, shared)
    if mission.type == "scout":
        return _scout(member, mission, shared.world)
    if mission.type == "tour":
        return _tour(member.name, mission, member.vehicle, member.carried, member.put, shared.world)
    inputs = member.vehicle.inputs
    if mission.type == "still":
        return Schedule(t_s=np.zeros(1), u=np.zeros((1, len(inputs))))
    plan = made_of(Schedule, mission)
    if plan.u.shape[1] != len(inputs):
        raise ConfigError(f"{plan.u.shape[1]} numbers in a row of u", fix=f"give {', '.join(inputs)}")
    return plan


def _errand(member: Member, mission: GotoMission, shared: Setting) -> Errand:
    goals, period = goal_poses(mission.goals), mission.period_s
    body = ground_robot(
        mission.drive, member.vehicle, member.carried, member.put, shared.world, robot=member.name, period_s=period,
        goals=goals, hull=member.hull, zones=shared.zones, routes=shared.routes,
    )  # fmt: skip
    return Errand(body=body, goals=goals, hold_s=mission.hold_s, period_s=period)


def _scout(member: Member, mission: ScoutMission, world: World) -> Scout:
    lidars = [s for s in _bare(member.carried) if isinstance(s, Lidar)]
    if len(lidars) != 1:
        raise ConfigError(f"a scout with {len(lidars)} lidars", fix="give it one")
    tour = _tour(member.name, mission, member.vehicle, member.carried, member.put, world)
    return Scout(tour=tour, drawn=world.grid, mount=mount_matrix(lidars[0]), reach=mission.sees)


def _tour(name: str, mission: TourMission, vehicle: Vehicle, carried: tuple[Any, ...], put: Put, world: World) -> Tour:
    flies = vehicle.inputs == AIR_INPUTS
    own = navigator(carried, put, EPOCH, world, flies=flies, robot=name)
    waypoints = np.array([_place(p, put[2]) for p in mission.waypoints])
    options = {k: getattr(mission, k) for k in ("speed", "reach", "turn", "period_s")}
    return Tour(own, waypoints, flies=flies, **options)


def _place(point: list[float], height: float) -> Floats:
    """(3,) a waypoint; of one without a height the start's is taken."""
    if len(point) not in (2, 3):
        raise ConfigError(f"a waypoint of {len(point)} numbers", fix="give east, north and, in the air, up")
    return np.array([*point, height][:3])


def _sensors(section: RobotSection, where: str, key: tuple[str, ...]) -> tuple[Any, ...]:
    """Every sensor with its faults around it."""
    made: dict[str, Any] = {}
    for k, one in enumerate(section.sensors):
        with at(where, *key, "sensors", k):
            sensor: Any = made_of(SENSORS[one.type], one)
            if sensor.name in made:
                raise ConfigError(f"a second sensor of the name '{sensor.name}'", fix="give it a `name` of its own")
            made[sensor.name] = sensor
    for k, fault in enumerate(section.faults):
        with at(where, *key, "faults", k):
            if fault.sensor not in made:
                raise ConfigError(f"no sensor '{fault.sensor}'", fix=remedy(fault.sensor, list(made)))
            made[fault.sensor] = _spoilt(made[fault.sensor], fault)
    return tuple(made.values())


def _spoilt(sensor: Any, fault: Any) -> Any:
    if fault.type != "spell":
        return made_of(FAULTS[fault.type], fault, sensor=sensor)
    if not isinstance(sensor, GnssReceiver):
        fix = "use `faulty`, or name it before other faults of its sensor"
        raise ConfigError("a spell is something of a gnss_receiver", fix=fix)
    return replace(sensor, spells=(*sensor.spells, made_of(Spell, fault)))


def _bare(carried: tuple[Any, ...]) -> list[Any]:
    """The sensors without what is wrong with them."""
    out = list(carried)
    for k, sensor in enumerate(out):
        while hasattr(sensor, "sensor"):
            sensor = sensor.sensor
        out[k] = sensor
    return out
