"""Patrols in scenario files: a drawn site as a place, robots on their rounds, the station that sends them to alerts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import isfinite
from pathlib import Path
from typing import Annotated, Any, Final, Literal, TypeAlias, final

import numpy as np
import shapely
from pydantic import Field

from outrider.data.footprint import Footprint
from outrider.data.grid import INSCRIBED, LETHAL, UNKNOWN, Costmap, Grid
from outrider.data.routes import RouteGraph
from outrider.data.site import Anchor, Site
from outrider.errors import ConfigError
from outrider.guidance.patrol import Rules
from outrider.io.alerts import AlertFile, AlertSection, agenda
from outrider.io.checked import remedy
from outrider.io.sites import parse_site, read_site
from outrider.mapping.inflation import Inflation
from outrider.mapping.sites import draw
from outrider.mapping.zones import Zones
from outrider.models.vehicles import Vehicle
from outrider.planning.astar import AStar
from outrider.planning.refine import Refined
from outrider.planning.traversal import Traversal
from outrider.scenarios.driving import DrivePart, drawn, ground_robot
from outrider.scenarios.navigation import Put
from outrider.scenarios.sections import Number, Part, inner_section, made_of
from outrider.sim.monitor import Hull
from outrider.sim.truth import EPOCH, SITE
from outrider.sim.world import World
from outrider.team.driver import zoned
from outrider.team.patrol import Battery, Patrol
from outrider.team.station import Feed, Station
from outrider.typing import Floats

Positive: TypeAlias = Annotated[Number, Field(gt=0)]
Share: TypeAlias = Annotated[Number, Field(ge=0, le=1)]
Stop: TypeAlias = str | list[Number]
ROOM: Final = 0.5  # m between two robots, and to either side, where they can pass each other


def site(file: str = "", drawing: dict[str, Any] | None = None, resolution: float = 0.1, height: float = 1.5) -> World:
    """A site that somebody drew: the `file` of a drawing (YAML in metres, GeoJSON), or the `drawing` itself.

    What is drawn as taken is `height` [m] high; where nothing is drawn a robot could go, but does not plan to.
    """
    there = read_drawing(file, drawing)
    made = draw(there, resolution)
    datum = there.anchor.datum if there.anchor is not None else SITE
    return World(name=there.name, datum=datum, grid=made.grid, grid_height=height)


def read_drawing(file: str, drawing: Mapping[str, Any] | None) -> Site:
    """The site of a place `site`."""
    if bool(file) == (drawing is not None):
        raise ConfigError("one of file and drawing", where="site", fix="file: site.yaml, of `outrider map`")
    return read_site(Path(file)) if drawing is None else parse_site(drawing)


class PatrolMission(Part):
    """Goes round its stops, and wherever the station sends it to look; charges at its dock."""

    type: Literal["patrol"]
    stops: tuple[Stop, ...] = ()
    """Names of nodes of the site's routes, or east, north [m] (and heading [rad]); none: all nodes, as drawn."""
    dock: Stop | None = None
    """A dock of the site by its name, or east, north [m], heading [rad]; none: where the robot starts."""
    drive: DrivePart = DrivePart()
    battery: inner_section(Battery) = Field(default={}, validate_default=True)  # type: ignore[valid-type]
    charge: Share = 1.0
    """Share of a full battery at the start."""
    rules: inner_section(Rules) = Field(default={}, validate_default=True)  # type: ignore[valid-type]
    period_s: Positive = 0.1


class StationMission(Part):
    """Takes alerts, sends the robots of the team that patrol, and keeps the book. It stands, and needs no vehicle."""

    type: Literal["station"]
    alerts: tuple[AlertSection, ...] = ()
    """Raised, or called off, at their `t_s`."""
    file: str | None = None
    """JSON lines instead: a file that may grow, or a FIFO."""
    near: Positive = 2.0
    """m to stand off from wherever the alert may be."""
    far: Positive = 6.0
    """m from which it can still be observed."""
    same: Annotated[Number, Field(ge=0)] = 0.5
    """m within which two alerts are one."""
    narrow: Annotated[Number, Field(ge=0)] | None = None
    """m: ways of the site's routes of a smaller width are for one robot at a time; none: where two cannot pass."""
    passages: tuple[Annotated[list[list[Number]], Field(min_length=3)], ...] = ()
    """More outlines (east, north) in which only one robot may be."""
    lease_s: Positive = 30.0
    """Silence of a robot after which its passage is free for others."""
    period_s: Positive = 0.5


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Member:
    """A robot of a patrol: its name, vehicle, sensors, start, and the hull that must not touch anything."""

    name: str
    vehicle: Vehicle
    carried: tuple[Any, ...]
    put: Put
    hull: Hull | None = None

    @property
    def radius(self) -> float:
        """m."""
        return self.vehicle.radius if self.hull is None else self.hull.radius


@final
@dataclass(frozen=True, kw_only=True)
class Setting:
    """What a station and its robots share. drawing : of the place, if it was drawn;  radius : m, of the largest robot;
    station, mission : its name, and what it is to do;  patrols : what the robots are to do."""

    world: World
    drawing: Site | None
    radius: float
    station: str = ""
    mission: StationMission | None = None
    patrols: tuple[PatrolMission, ...] = ()

    @cached_property
    def passages(self) -> tuple[Floats, ...]:
        """Outlines (k, 2) m."""
        if self.mission is None:
            return ()
        graph = self.routes
        narrow = self.mission.narrow
        least = 4.0 * self.radius + 3.0 * ROOM if narrow is None else narrow
        listed = [np.array(p, np.float64) for p in self.mission.passages]
        if any(p.ndim != 2 or p.shape[1] != 2 or not np.isfinite(p).all() for p in listed):
            raise ConfigError("a corner that is no place", where="passages", fix="rows of east, north [m]")
        return (*(narrow_ways(graph, least) if graph is not None else ()), *listed)

    @cached_property
    def zones(self) -> Zones | None:
        """Where nobody may go, how fast robots may go, and which way."""
        if self.drawing is None or self.world.grid is None:
            return None
        return draw(self.drawing, self.world.grid.resolution).zones

    @property
    def routes(self) -> RouteGraph | None:
        """Drawn ways from node to node."""
        return self.drawing.routes if self.drawing is not None else None

    @property
    def anchor(self) -> Anchor:
        """Where the site is on the Earth."""
        own = self.drawing.anchor if self.drawing is not None else None
        return own or Anchor(datum=self.world.datum)


def setting_of(world: World, place: Any, robots: Mapping[str, Any]) -> Setting:
    """place : the section of the world's;  robots : the sections of the team, by name."""
    drawing = read_drawing(place.file, place.drawing) if place.type == "site" else None
    patrols = [r for r in robots.values() if r.mission.type == "patrol"]
    radius = max((float((r.size or r.vehicle).radius) for r in patrols if r.size or r.vehicle), default=0.0)
    stations = [name for name, r in robots.items() if r.mission.type == "station"]
    if len(stations) > 1:
        raise ConfigError(f"{' and '.join(stations)} are stations", where="team", fix="a team has one")
    name = stations[0] if stations else ""
    return Setting(
        world=world, drawing=drawing, radius=radius, station=name, mission=robots[name].mission if name else None,
        patrols=tuple(r.mission for r in patrols),
    )  # fmt: skip


def patrol(section: PatrolMission, member: Member, setting: Setting) -> Patrol:
    """The agent of a robot. ConfigError: a stop or a dock that is not there, a robot that cannot drive by itself."""
    stops = _stops(section, setting.drawing)
    dock = _dock(section.dock, setting.drawing, member.put)
    _check_places(section, member, setting, stops, dock)
    body = ground_robot(
        section.drive, member.vehicle, member.carried, member.put, setting.world, robot=member.name,
        period_s=section.period_s, goals=np.vstack([stops, dock]), hull=member.hull,
        others=Footprint.circle(setting.radius), zones=setting.zones,
        routes=setting.routes,
    )  # fmt: skip
    return Patrol(
        name=member.name, body=body, stops=stops, dock=dock, station=setting.station, passages=setting.passages,
        battery=made_of(Battery, section.battery), rules=made_of(Rules, section.rules), share=section.charge,
        period_s=section.period_s,
    )  # fmt: skip


def station(name: str, section: StationMission, setting: Setting) -> Station:
    """The agent that sends the robots.

    ConfigError: nobody to send, alerts that make no sense, a file that cannot be read.
    """
    if not setting.patrols:
        raise ConfigError("no robot to send", where="station", fix="give one of the team a mission of type patrol")
    drive = setting.patrols[0].drive
    ground = setting.world.grid
    if ground is None:
        ground = drawn(setting.world, np.vstack([_stops(p, setting.drawing)[:, :2] for p in setting.patrols]))
    if section.near >= section.far:
        what = f"near {section.near:g} m, far {section.far:g} m"
        raise ConfigError(what, where="station", fix="far is what a camera can see, more than near")
    if section.file is not None and section.alerts:
        raise ConfigError("alerts and file", where="station", fix="one of them; a line of a file may have t_s as well")
    feed: Feed = (
        agenda(section.alerts, start=EPOCH, anchor=setting.anchor)
        if section.file is None
        else AlertFile(Path(section.file), start=EPOCH, anchor=setting.anchor)
    )
    return Station(
        name=name, feed=feed, costmap=_costmap(setting, drive, ground),
        planner=Refined(planner=AStar()), near=section.near, far=section.far, same=section.same,
        lease_s=section.lease_s, period_s=section.period_s,
    )  # fmt: skip


def _costmap(setting: Setting, drive: DrivePart, ground: Grid) -> Costmap:
    """The map as the robots have it before they have seen anything."""
    body = Footprint.circle(setting.radius) if drive.footprint is None else Footprint.rectangle(*drive.footprint)
    costs = Inflation(inscribed=body.inscribed, radius=body.inscribed + drive.inflation, factor=drive.falling)
    rules = Traversal()
    return zoned(ground, setting.zones, costs, body, speed=drive.forward, weight=rules.weight).costmap


def narrow_ways(graph: RouteGraph, width: float) -> tuple[Floats, ...]:
    """Outlines (k, 2) m of the ways that are narrower than `width` [m]; those that meet are one.

    Where a narrow way comes out on a wider one, it ends at the edge of that.
    """
    narrow = np.isfinite(graph.width) & (graph.width < width)
    open_width, joins = np.zeros(len(graph.names)), np.zeros(len(graph.names), np.int64)
    for (a, b), wide in zip(graph.edges[~narrow].tolist(), graph.width[~narrow].tolist(), strict=True):
        for n in (a, b):
            open_width[n] = max(open_width[n], wide if isfinite(wide) else 0.0)
    for a, b in {(min(e), max(e)) for e in graph.edges[narrow].tolist()}:
        joins[[a, b]] += 1
    made: list[Any] = []
    for (a, b), wide in zip(graph.edges[narrow].tolist(), graph.width[narrow].tolist(), strict=True):
        ends = graph.nodes[[a, b]]
        length = float(np.hypot(*(ends[1] - ends[0])))
        # at a corner two narrow ways overlap
        less = [0.5 * open_width[n] if open_width[n] > 0.0 else -0.5 * wide * (joins[n] > 1) for n in (a, b)]
        if sum(less) < length:
            along = (ends[1] - ends[0]) / length
            line = shapely.LineString([ends[0] + less[0] * along, ends[1] - less[1] * along])
            made.append(line.buffer(0.5 * wide, cap_style="flat"))
    parts = shapely.get_parts(shapely.union_all(made)).tolist() if made else []
    return tuple(np.asarray(p.exterior.coords)[:-1, :2].copy() for p in parts)


def _check_places(section: PatrolMission, member: Member, setting: Setting, stops: Floats, dock: Floats) -> None:
    """Refuse what the map alone rules out: a stop, a dock or a start where a robot cannot stand."""
    if setting.world.grid is None:
        return
    costmap = _costmap(setting, section.drive, setting.world.grid)
    places = [(f"stop {k + 1}", p) for k, p in enumerate(stops)] + [("dock", dock), ("start", np.array(member.put))]
    for what, p in places:
        row, col = costmap.cell_of(p[:2]).tolist()
        inside = 0 <= row < costmap.cells.shape[0] and 0 <= col < costmap.cells.shape[1]
        cost = int(costmap.cells[row, col]) if inside else UNKNOWN
        if cost >= INSCRIBED:
            why = {UNKNOWN: "nothing is drawn", LETHAL: "the ground is taken"}.get(cost, "there is no room for it")
            raise ConfigError(f"at ({p[0]:g}, {p[1]:g}) {why}", where=what, fix="a place where it can stand")


def _stops(section: PatrolMission, drawing: Site | None) -> Floats:
    """(n, 3) east, north [m], heading [rad], NaN where any will do."""
    graph = drawing.routes if drawing is not None else None
    listed: Sequence[Stop] = section.stops or (graph.names if graph is not None else ())
    if not listed:
        raise ConfigError("a patrol without stops", where="stops", fix="east, north [m]; or draw routes")
    return np.array([_stop(s, graph) for s in listed])


def _stop(said: Stop, graph: RouteGraph | None) -> Floats:
    if isinstance(said, str):
        names = graph.names if graph is not None else ()
        if graph is None or said not in names:
            fix = remedy(said, names) if names else "the place has no routes: give east, north [m]"
            raise ConfigError(f"there is no node '{said}'", where="stops", fix=fix)
        return np.array([*graph.nodes[names.index(said)], np.nan])
    if len(said) not in (2, 3) or not np.isfinite(said).all():
        raise ConfigError(f"{said} is no place", where="stops", fix="east, north [m] and, if it matters, heading")
    return np.array([*said, np.nan][:3])


def _dock(said: Stop | None, drawing: Site | None, put: Put) -> Floats:
    """(3,) east, north [m], heading [rad]."""
    if said is None:
        return np.array([put[0], put[1], put[3]])
    if not isinstance(said, str):
        return _stop(said, None)
    docks = {d.name: d.pose for d in drawing.docks} if drawing is not None else {}
    if said not in docks:
        fix = remedy(said, list(docks)) if docks else "the place has no docks: give east, north [m], heading [rad]"
        raise ConfigError(f"there is no dock '{said}'", where="dock", fix=fix)
    return docks[said].copy()
