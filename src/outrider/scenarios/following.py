"""One aircraft that follows another in scenario files: `mission: lead` and `mission: follow`."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import pi
from typing import Annotated, Any, Final, Literal, cast

import numpy as np
from pydantic import Field

from outrider.core.angles import wrap
from outrider.errors import ConfigError
from outrider.filters.following import FollowerFilter, Following
from outrider.guidance.rendezvous import Zones
from outrider.io.checked import Flag, Whole, remedy
from outrider.models.motion.following import FollowerModel
from outrider.models.vehicles import AIR_INPUTS, Multirotor, Rotorcraft, Vehicle
from outrider.safety.admissible import Fixes, admissible, promise
from outrider.safety.separation import Separation
from outrider.scenarios.navigation import Put, navigator
from outrider.scenarios.sections import Number, Part, inner_section, made_of, plain_value
from outrider.sim.motion import glide
from outrider.sim.truth import EPOCH, Place, Truth
from outrider.sim.world import World
from outrider.team.bearings import Bearings
from outrider.team.leader import Leader, Legs, Spoof
from outrider.team.pursuer import Adaptive, Fixed, Law, Pursuer, SetPoint, Style
from outrider.team.trail import Aim, Trail
from outrider.typing import Floats

Positive = Annotated[Number, Field(gt=0)]
NotNegative = Annotated[Number, Field(ge=0)]
Spell = tuple[NotNegative, Positive]
SQUARE: Final = 0.5 * pi + 1e-6  # rad
TARGET: Final = cast("dict[str, Any]", plain_value(FollowerModel.target()))
WIND_WALK: Final = 0.1  # m/s per sqrt(s)
UNGUARDED: Final = "nothing keeps R_d: it flies without a safety filter"
BEGINS_S: Final = 0.02  # s that a vehicle takes to begin with a command
FALL: Final = 0.2  # m/s by which the set-point comes nearer
KNOTS_S: Final = 0.2  # s between the knots of the spline that carries a leader
CARRIED_HZ: Final = 100.0
MOST_HZ: Final = 50.0  # of fixes that are told or followed by


class LeadMission(Part):
    """Flies through waypoints and tells everybody its fixes; exactly so if nothing is its vehicle, else on its own
    estimate."""

    type: Literal["lead"]
    waypoints: Annotated[list[list[Number]], Field(min_length=1)]
    """East, north (and up) [m]; the last one is the end."""
    speed: Positive = 2.0
    speeds: tuple[Positive, ...] | None = None
    """m/s to each waypoint, instead of one for all."""
    waits_s: tuple[NotNegative, ...] = ()
    """Hovers so long at each waypoint."""
    stops_s: tuple[Spell, ...] = ()
    """Spells in which it stops dead."""
    corner: Positive = 0.5
    """Share of its speed with which it passes a waypoint."""
    tells: str = "gnss"
    """The receiver of which it tells every fix."""
    tells_velocity: str = "gnss_velocity"
    """The stream of the velocity that it tells besides, if it has one of that name."""
    silent_s: tuple[Spell, ...] = ()
    """Spells in which it tells nothing."""
    spoofs: tuple[inner_section(Spoof), ...] = ()  # type: ignore[valid-type]
    """Spells in which what it tells is somewhere else."""
    clock_s: Number = 0.0
    """By which its clock is ahead."""
    lag_s: Positive = 0.5
    """Of its velocity, if it is carried."""
    acceleration: Positive = 5.0
    """m/s^2 at most, if it is carried."""
    period_s: Positive = 0.1

    @property
    def fastest(self) -> float:
        """m/s."""
        return max([self.speed] if self.speeds is None else self.speeds)


class FollowMission(Part):
    """Follows one that leads, through localisation and rendezvous zone, and stays out of its danger zone."""

    type: Literal["follow"]
    leader: str
    zones: inner_section(Zones) = Field(default={}, validate_default=True)  # type: ignore[valid-type]
    far: Literal["los", "bezier", "vector"] = "vector"
    """How it approaches outside the rendezvous zone."""
    near: Literal["los", "zone", "vector"] = "vector"
    """How it flies inside."""
    speed: Positive = 2.5
    """m/s at most, inside the rendezvous zone."""
    far_speed: Positive = 3.0
    """m/s at most, outside."""
    guides_on: Literal["estimate", "gps"] = "estimate"
    """What guidance sees: the filters, or the newest fixes alone."""
    safety: Flag = True
    """Whether a filter below every law keeps the distance."""
    distance: Positive | None = None
    """m to stay away, at least; by default what the target's speed and the link's delay ask for."""
    target_speed: Positive | None = None
    """m/s, where it is told instead of estimated."""
    approach: NotNegative = 0.0
    """m/s by which the target may come towards it of its own will; above 0 it is also taken to brake and speed up as
    hard as it turns."""
    target_lag_s: NotNegative = 0.5
    """How quickly the target changes its velocity."""
    target_turn: NotNegative = 0.5 * pi
    """By how much the target may change its course at once [rad]; pi: it may come back the way it went."""
    target_turn_deg: Number | None = None
    degree: Annotated[Whole, Field(ge=1, le=8)] = 3
    """Of the Bezier curve: so many points of the trail, one a second."""
    aim: Literal["points", "end"] = "end"
    """Which point of the curve is flown at."""
    model: inner_section(FollowerModel) | None = None  # type: ignore[valid-type]
    """How it answers commands; by default as its vehicle is built."""
    target: inner_section(FollowerModel) = Field(default=TARGET, validate_default=True)  # type: ignore[valid-type]
    """How the target moves."""
    wind: NotNegative = 0.0
    """m/s, of the wind that its filter estimates; 0: it knows of none."""
    gnss: str = "gnss"
    velocity: str = "gnss_velocity"
    heading: str = ""
    """Streams that its filter hears. A heading is one only of a craft whose nose points where it flies."""
    command_s: Positive = 0.1
    """s between two commands."""
    period_s: Positive = 0.1


def legs(mission: LeadMission, height: float) -> Legs:
    """What it flies; of a waypoint without a height the start's is taken."""
    if any(len(p) not in (2, 3) for p in mission.waypoints):
        raise ConfigError("a waypoint of other than 2 or 3 numbers", where="waypoints", fix="east, north (and up) [m]")
    n = len(mission.waypoints)
    return Legs(
        waypoints=np.array([[*p, height][:3] for p in mission.waypoints], np.float64),
        speeds=np.array([mission.speed] * n if mission.speeds is None else mission.speeds, np.float64),
        waits_s=np.array(mission.waits_s or [0.0] * n, np.float64), stops_s=mission.stops_s, corner=mission.corner,
    )  # fmt: skip


def leader(
    name: str, mission: LeadMission, vehicle: Vehicle | None, carried: tuple[Any, ...], put: Put, world: World
) -> Leader:
    """The agent. ConfigError: no receiver to tell of, a vehicle on the ground."""
    names = [s.name for s in carried]
    if mission.tells not in names:
        raise ConfigError(f"no sensor '{mission.tells}'", where="tells", fix=remedy(mission.tells, names))
    if vehicle is not None and vehicle.inputs != AIR_INPUTS:
        raise ConfigError("only who flies leads", where="vehicle", fix="a multirotor, or none: it is carried then")
    for sensor in carried:
        if sensor.name in (mission.tells, mission.tells_velocity):
            _sane(sensor)
    own = None if vehicle is None else navigator(carried, put, EPOCH, world, flies=True, robot=name)
    return Leader(
        name=name, legs=legs(mission, put[2]), datum=world.datum, start=EPOCH, tells=mission.tells, navigator=own,
        tells_velocity=mission.tells_velocity, silent_s=mission.silent_s,
        spoofs=tuple(made_of(Spoof, s) for s in mission.spoofs), clock_s=mission.clock_s,
        period_s=mission.period_s,
    )  # fmt: skip


def told_of(mission: LeadMission, sensors: Sequence[str]) -> LeadMission:
    """What others may expect to hear of one that carries these sensors: no velocity of a stream that it has not."""
    return mission if mission.tells_velocity in sensors else mission.model_copy(update={"tells_velocity": ""})


def carried_leader(mission: LeadMission, put: Put, duration_s: float, world: World, robot: str) -> Truth:
    """The motion of one that is carried: its nose along its course, its body leaning as a multirotor's."""
    p = legs(mission, put[2]).path(np.array(put[:3]), duration_s, KNOTS_S, mission.lag_s, mission.acceleration)
    heading = _course(p, put[3])
    control = np.vstack([np.tile([*p[0], put[3]], (2, 1)), np.column_stack([p, heading])])  # a knot acts 2 knots early
    place = Place(gravity=world.gravity, datum=world.datum, t0=EPOCH, robot=robot)
    return glide(control, KNOTS_S, duration_s, CARRIED_HZ, leans=True, place=place)


def _course(p: Floats, yaw: float) -> Floats:
    """(n,) rad, along the way; the last one while it hardly moves. It turns by less than half a turn a step."""
    step = np.diff(p[:, :2], axis=0, append=p[-1:, :2])
    moves = np.hypot(step[:, 0], step[:, 1]) > 0.1 * KNOTS_S
    course = np.where(moves, np.arctan2(step[:, 1], step[:, 0]), np.nan)
    out = np.empty(len(p))
    now = yaw
    for k, c in enumerate(course.tolist()):
        if np.isfinite(c):
            now += float(np.clip(wrap(c - now), -1.5 * KNOTS_S, 1.5 * KNOTS_S))
        out[k] = now
    return out


def pursuer(
    name: str, mission: FollowMission, vehicle: Vehicle, carried: tuple[Any, ...], put: Put, world: World,
    leads: Mapping[str, LeadMission | None],
) -> Pursuer:  # fmt: skip
    """The agent. leads : everybody else, and how those lead who do.

    ConfigError: nobody of that name, no receiver, a target that is faster, a distance that cannot be held.
    """
    if mission.leader not in leads or mission.leader == name:
        others = [n for n in leads if n != name]
        raise ConfigError(f"no robot '{mission.leader}' to follow", where="leader", fix=remedy(mission.leader, others))
    if vehicle.inputs != AIR_INPUTS:
        raise ConfigError("only who flies follows", where="vehicle", fix="a multirotor or a rotorcraft")
    names = [s.name for s in carried]
    if mission.gnss not in names:
        raise ConfigError(f"no sensor '{mission.gnss}'", where="gnss", fix=remedy(mission.gnss, names))
    for sensor in carried:
        if sensor.name in (mission.gnss, mission.velocity, mission.heading):
            _sane(sensor)
    lead = leads[mission.leader]
    if lead is not None and lead.fastest >= mission.speed:
        what = f"{mission.speed:g} m/s to follow {mission.leader}, which flies {lead.fastest:g} m/s"
        raise ConfigError(what, where="speed", fix="more than the target's: what is over closes the distance")
    zones = made_of(Zones, mission.zones)
    design = cast("Multirotor | Rotorcraft", getattr(vehicle, "design", vehicle))
    walk = WIND_WALK if mission.wind > 0.0 else 0.0
    model = (
        FollowerModel(lag=design.tau_s, wind=walk, wind_z=walk)
        if mission.model is None
        else made_of(FollowerModel, mission.model)
    )
    bearings = _bearings(mission, design, model, carried, world)
    style = Style(
        far=Law[mission.far.upper()], near=Law[mission.near.upper()], speed=mission.speed, far_speed=mission.far_speed,
        target_speed=mission.target_speed or float("nan"), command_s=mission.command_s, latency_s=design.latency_s,
        climb=design.climb, sink=design.sink,
    )  # fmt: skip
    separation = Separation(
        distance=zones.danger, period_s=mission.command_s + BEGINS_S, lag_s=design.tau_s,
        acceleration=design.acceleration, speed=max(mission.speed, mission.far_speed),
        other_lag_s=mission.target_lag_s, turn=mission.target_turn, approach=mission.approach,
    )  # fmt: skip
    fixes = _fixes(mission, carried, model, lead)
    speed = 0.8 * mission.speed if lead is None else lead.fastest
    set_point = _set_point(mission, separation, zones, fixes, speed)
    if fixes.oldest_s >= zones.silent_s:
        what = f"who is not heard for {zones.silent_s:g} s is silent, but fixes get {fixes.oldest_s:.3g} s old"
        fix = f"silent_s above {fixes.oldest_s:.3g}, lost_s above that, or less delay"
        raise ConfigError(what, where="zones", fix=fix)
    return Pursuer(
        name=name, bearings=bearings, zones=zones, style=style, separation=separation if mission.safety else None,
        set_point=set_point,
        trail=Trail(degree=mission.degree, aim_at=Aim[mission.aim.upper()]), home=np.array(put[:3]),
        period_s=mission.period_s,
        promise=promise(separation, fixes, speed, set_point.now) if isinstance(set_point, Adaptive) else UNGUARDED,
    )  # fmt: skip


def _bearings(
    mission: FollowMission,
    design: Multirotor | Rotorcraft,
    model: FollowerModel,
    carried: tuple[Any, ...],
    world: World,
) -> Bearings:
    """Its filter, which knows what its vehicle can, and the one of the target, which is no faster than the follower."""
    names = [s.name for s in carried]
    late = getattr(_bare(carried[names.index(mission.gnss)]), "latency_s", 0.0)
    history_s = max(Following().history_s, late + 2.0)
    own = Following(
        history_s=history_s, fastest=2.0 * design.speed, wind=mission.wind, command_delay_s=design.latency_s,
        hardest=design.acceleration, hardest_up=design.vertical_acceleration,
    )  # fmt: skip
    target = Following(history_s=history_s, fastest=max(mission.speed, mission.far_speed))
    return Bearings(
        leader=mission.leader, own=FollowerFilter(model, own), target=FollowerFilter(_target_model(mission), target),
        datum=world.datum, start=EPOCH, gnss=mission.gnss, velocity=mission.velocity,
        heading=mission.heading if mission.heading in names else "", raw=mission.guides_on == "gps",
    )  # fmt: skip


def _set_point(mission: FollowMission, separation: Separation, zones: Zones, fixes: Fixes, speed: float) -> SetPoint:
    """How far away it stays; ConfigError where that cannot hold R_d, or lies outside the rendezvous zone."""
    if not mission.safety:
        return Fixed(m=mission.distance or zones.danger)
    answer = admissible(separation, fixes, speed, set_point=mission.distance)
    if answer.set_point + zones.band > zones.zone:
        what = f"it must stay {answer.set_point:.2f} m away, outside of a rendezvous zone of {zones.zone:g} m"
        raise ConfigError(what, where="zones", fix=f"a zone of {answer.set_point + zones.outer:.1f} m or more")
    return Adaptive(
        separation=separation, fixes=fixes, wanted=mission.distance or 0.0, fall=FALL * mission.period_s,
        now=answer.set_point,
    )  # fmt: skip


def _fixes(mission: FollowMission, carried: tuple[Any, ...], model: FollowerModel, lead: LeadMission | None) -> Fixes:
    """What it may expect of both receivers, from its own; no velocity, if either tells none."""
    by_name = {s.name: _bare(s) for s in carried}
    own, velocity = by_name[mission.gnss], by_name.get(mission.velocity)
    target, mute = _target_model(mission), lead is not None and not lead.tells_velocity
    return Fixes(
        rate_hz=own.rate_hz, latency_s=getattr(own, "latency_s", 0.0) + mission.period_s,
        sigma=max(getattr(own, "sigma", 1.0), getattr(own, "sigma_up", 0.0)),
        velocity_sigma=float("inf") if velocity is None or mute else velocity.sigma,
        acceleration=max(target.acceleration, target.turn or 0.0), own_acceleration=model.acceleration,
    )  # fmt: skip


def _target_model(mission: FollowMission) -> FollowerModel:
    """How the target moves. One that may come back is believed when it does, of its own will (`approach`) or in a turn
    by more than a right angle, which changes its speed along its course as hard as across: no fix of it is an outlier.
    """
    model = made_of(FollowerModel, mission.target)
    hard = model.acceleration if model.turn is None else model.turn
    back = mission.approach > 0.0 or mission.target_turn > SQUARE
    return replace(model, acceleration=max(model.acceleration, hard)) if back else model


def _sane(sensor: Any) -> None:
    """Refuse fixes that come so often that nobody has such a receiver, and that every filter would take an age over."""
    rate = getattr(_bare(sensor), "rate_hz", 0.0)
    if rate > MOST_HZ:
        fix = f"{MOST_HZ:g} Hz or fewer; a follower decides ten times a second"
        raise ConfigError(f"{sensor.name} tells {rate:g} times a second", where="sensors", fix=fix)


def _bare(sensor: Any) -> Any:
    """A sensor without what is wrong with it."""
    while hasattr(sensor, "sensor"):
        sensor = sensor.sensor
    return sensor
