"""How a robot on the ground drives by itself: the section of a scenario file, and what is made of it."""

from math import tan
from typing import Annotated, Any, Final, Literal, TypeAlias

import numpy as np
from pydantic import Field

from outrider.core.angles import wrap
from outrider.data.driving import DriveLimits, LocalPlanner, Steering
from outrider.data.footprint import Footprint
from outrider.data.grid import Grid
from outrider.data.routes import GlobalPlanner, RouteGraph
from outrider.errors import ConfigError
from outrider.mapping.inflation import Inflation
from outrider.mapping.zones import Zones
from outrider.models.vehicles import Differential, Mecanum, Steered, Vehicle
from outrider.planning.astar import AStar
from outrider.planning.local.pursuit import Pursuit, PursuitSettings
from outrider.planning.local.teb import Teb, TebSettings
from outrider.planning.refine import Refined
from outrider.planning.roads import RoadPlanner
from outrider.scenarios.navigation import Put, mount_matrix, navigator
from outrider.scenarios.sections import Number, Part, inner_section, made_of, tagged
from outrider.sim.monitor import Hull
from outrider.sim.sensors import Lidar
from outrider.sim.truth import EPOCH
from outrider.sim.world import World
from outrider.team.driver import Driver, DriverSettings
from outrider.team.ground import Ground
from outrider.team.reaction import Reaction
from outrider.typing import Floats

Positive: TypeAlias = Annotated[Number, Field(gt=0)]
LOCAL: Final = {"teb": TebSettings, "pursuit": PursuitSettings}
CELL: Final = 0.1  # m, of a map that nobody drew
AROUND: Final = 15.0  # m of such a map around everything that is to be visited
RIMS_SHARE: Final = 0.9  # of the wheels' top speed that is planned with


class DrivePart(Part):
    """How a robot drives from pose to pose, within what its vehicle can do."""

    forward: Positive = 1.0
    """m/s."""
    backward: Annotated[Number, Field(ge=0)] = 0.4
    """m/s."""
    sideways: Positive = 0.5
    """m/s, of a base that can."""
    turn: Positive = 1.0
    """rad/s."""
    turn_deg: Number | None = None
    acceleration: Positive = 0.6
    """m/s^2."""
    turn_acceleration: Positive = 1.2
    """rad/s^2."""
    turn_acceleration_deg: Number | None = None
    footprint: tuple[Positive, Positive] | None = None
    """Length and width [m] of a rectangle about the body's origin, instead of the disc that must not touch anything."""
    inflation: Positive = 1.2
    """m from obstacles within which the planner's ground costs more."""
    falling: Positive = 2.5
    """1/m: how fast that cost falls."""
    roads: Positive = 400.0
    """m as the crow flies, from where on a leg is planned over the routes of the site, if it has any."""
    without: tuple[str, ...] = ()
    """Sensors that its navigation leaves alone: references, spares."""
    local: tagged(LOCAL, skip=("period",)) = Field(  # type: ignore[valid-type]
        default={"type": "teb"}, validate_default=True
    )
    """Local planner: timed elastic band, or regulated pure pursuit."""
    driver: inner_section(DriverSettings) = Field(default={}, validate_default=True)  # type: ignore[valid-type]


class GoalPart(Part):
    """A place to go to: east, north [m] and, unless any will do, the heading there."""

    x: Number
    y: Number
    yaw: Number | None = None
    yaw_deg: Number | None = None


class GotoMission(Part):
    """Drives to goals in turn, around what is in the way, on its own estimate."""

    type: Literal["goto"]
    goals: Annotated[list[list[Number] | GoalPart], Field(min_length=1)]
    """East, north [m] and, where it matters, heading [rad]; or x, y and yaw_deg."""
    hold_s: Annotated[Number, Field(ge=0)] = 1.0
    """Stands so long at each goal."""
    drive: DrivePart = DrivePart()
    period_s: Annotated[Number, Field(gt=0)] = 0.1


def ground_robot(
    section: DrivePart,
    vehicle: Vehicle,
    carried: tuple[Any, ...],
    put: Put,
    world: World,
    *,
    robot: str,
    period_s: float,
    goals: Floats,
    hull: Hull | None = None,
    others: Footprint | None = None,
    zones: Zones | None = None,
    routes: RouteGraph | None = None,
) -> Ground:
    """A robot that drives on its estimate: navigator, driver and lidar, from what it is and what it carries.

    goals : (n, 2+) m, what it is to visit: a world without a map of its own is taken as free around them;
    hull : what must not touch anything, of the vehicle unless given;  others : the footprint that other robots have;
    zones : of the site: where it may not go, how fast, and which way;  routes : of the site, for long legs.
    Raises ConfigError for a vehicle that cannot drive on the ground, and for sensors that do not tell where it is.
    """
    base: Vehicle = getattr(vehicle, "design", vehicle)  # of the second physics
    body = _footprint(section, base if hull is None else hull)
    limits = drive_limits(section, base)
    lidar = _lidar(carried)
    driver = Driver(
        ground=drawn(world, np.vstack([np.array(put[:2]), goals[:, :2]])),
        footprint=body,
        planner=path_planner(section, routes, limits.forward, 2.0 * body.circumscribed),
        local=_local(section.local, limits, body, period_s),
        inflation=Inflation(
            inscribed=body.inscribed, radius=body.inscribed + section.inflation, factor=section.falling
        ),
        zones=zones,
        settings=made_of(DriverSettings, section.driver),
        sees=lidar is not None,
        period_s=period_s,
    )
    used = [s for s in carried if s.name not in section.without]
    own = navigator(used, put, EPOCH, world, flies=False, robot=robot, base=base)
    mount = np.zeros(3) if lidar is None else _mount(lidar)
    late = Reaction(seconds=drive_lag(base))
    every = 0.1 if lidar is None else 1.0 / lidar.rate_hz
    return Ground(
        navigator=own, driver=driver, lidar=mount, scan_s=every, others=others, reaction=late, period_s=period_s
    )


def path_planner(section: DrivePart, routes: RouteGraph | None, speed: float, width: float) -> GlobalPlanner:
    """Over open ground; long legs over the routes of the site, where it has any."""
    if routes is None:
        return Refined(planner=AStar())
    over = RoadPlanner(graph=routes, planner=AStar(), speed=speed, width=width, near=section.roads, far=section.roads)
    return Refined(planner=over)


def drive_lag(vehicle: Vehicle) -> float:
    """Delay and lag of a base on wheels [s]."""
    return vehicle.latency_s + vehicle.drive.lag_s if isinstance(vehicle, Mecanum | Differential | Steered) else 0.0


def drive_limits(section: DrivePart, vehicle: Vehicle) -> DriveLimits:
    """What the base may be asked for: the section's speeds, within its wheels' and its steering."""
    asked: Any = {k: getattr(section, k) for k in ("forward", "backward", "turn", "acceleration", "turn_acceleration")}
    if isinstance(vehicle, Mecanum):
        inverse, top = vehicle.kinematics.inverse, RIMS_SHARE * vehicle.drive.top_speed
        holonomic = Steering.HOLONOMIC
        return DriveLimits(steering=holonomic, sideways=section.sideways, rims=inverse, rim_speed=top, **asked)
    if isinstance(vehicle, Differential):
        if vehicle.axle != 0.0:
            fix = "put the origin of its body on the axle: axle 0"
            raise ConfigError(f"an axle {vehicle.axle:g} m ahead of the body's origin", where="goto", fix=fix)
        top = RIMS_SHARE * vehicle.drive.top_speed
        return DriveLimits(steering=Steering.DIFFERENTIAL, rims=vehicle.inverse, rim_speed=top, **asked)
    if isinstance(vehicle, Steered):
        share = 2.0 if vehicle.both_axles else 1.0
        middle = -0.5 * vehicle.wheel_base if vehicle.both_axles else 0.0
        if vehicle.rear != middle:
            fix = f"put the origin of its body where it turns about: rear {middle:g}"
            raise ConfigError(f"a rear axle {vehicle.rear:g} m ahead of the body's origin", where="goto", fix=fix)
        radius = vehicle.wheel_base / (share * tan(vehicle.steering.limit))
        asked["forward"] = min(section.forward, RIMS_SHARE * vehicle.drive.top_speed)
        return DriveLimits(steering=Steering.CAR, min_radius=radius, **asked)
    name = type(vehicle).__name__.lower()
    raise ConfigError(f"a {name} does not drive on the ground", where="goto", fix="mecanum, differential or steered")


def goal_poses(goals: list[Any]) -> Floats:
    """(n, 3) east, north [m], heading [rad], NaN where any will do."""
    out = np.full((len(goals), 3), np.nan)
    for row, goal in zip(out, goals, strict=True):
        given: list[Any] = [goal.x, goal.y, goal.yaw] if isinstance(goal, GoalPart) else list(goal)
        if len(given) not in (2, 3):
            raise ConfigError(f"a goal of {len(given)} numbers", fix="give east, north and, where it matters, heading")
        row[:2] = given[:2]
        if given[2:] not in ([], [None]):
            row[2] = wrap(given[2])
    if not np.isfinite(out[:, :2]).all():
        raise ConfigError("a goal that is not finite", fix="east, north [m]")
    return out


def drawn(world: World, visited: Floats) -> Grid:
    """The map that a robot is given: the world's own grid; else free ground around the points visited (n, 2)."""
    if world.grid is not None:
        return world.grid
    low, high = visited.min(axis=0) - AROUND, visited.max(axis=0) + AROUND
    columns, rows = np.ceil((high - low) / CELL).astype(int).tolist()
    return Grid(cells=np.zeros((rows, columns), np.uint8), resolution=CELL, origin=low)


def _local(section: Any, limits: DriveLimits, body: Footprint, period_s: float) -> LocalPlanner:
    if section.type == "teb":
        return Teb(limits=limits, footprint=body, settings=made_of(TebSettings, section, period=period_s))
    return Pursuit(limits=limits, footprint=body, settings=made_of(PursuitSettings, section, period=period_s))


def _footprint(section: DrivePart, hull: Vehicle | Hull) -> Footprint:
    if section.footprint is None:
        return Footprint.circle(hull.radius)
    return Footprint.rectangle(*section.footprint)


def _lidar(carried: tuple[Any, ...]) -> Lidar | None:
    found: list[Lidar] = []
    for sensor in carried:
        while hasattr(sensor, "sensor"):  # a fault around it
            sensor = sensor.sensor
        found += [sensor] if isinstance(sensor, Lidar) else []
    if len(found) > 1:
        raise ConfigError(f"{len(found)} lidars", where="goto", fix="a robot that drives by itself looks with one")
    return found[0] if found else None


def _mount(lidar: Lidar) -> Floats:
    """(3,) forward, left [m] and the angle by which it is turned to the left [rad]."""
    T = mount_matrix(lidar)
    if not T[2, 2] > 0.99:
        raise ConfigError("a lidar that is tilted or upside down", where="goto", fix="mount it level to drive by it")
    return np.array([T[0, 3], T[1, 3], np.arctan2(T[1, 0], T[0, 0])])
