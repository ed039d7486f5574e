"""What a scenario file may name: places, vehicles, sensors, missions, faults; each by its `type`."""

from collections.abc import Callable, Mapping
from inspect import Parameter, signature
from typing import Annotated, Any, Final, Literal, TypeAlias

from pydantic import Field, create_model

from outrider.io.checked import Flag, Whole
from outrider.models.vehicles import Differential, Mecanum, Multirotor, Pad, Rotorcraft, Steered, Vehicle
from outrider.scenarios.crews import MethodName
from outrider.scenarios.driving import GotoMission
from outrider.scenarios.following import FollowMission, LeadMission
from outrider.scenarios.inspecting import InspectMission
from outrider.scenarios.patrolling import PatrolMission, StationMission, site
from outrider.scenarios.sections import (
    STRICT,
    Endless,
    MadePart,
    Number,
    Part,
    Table,
    bounded,
    inner_section,
    section_of,
    tagged,
)
from outrider.sim import places, sensors
from outrider.sim.monitor import Hull
from outrider.sim.radio import Radio
from outrider.sim.truth import Drift
from outrider.sim.world import Fence, Ground, Wall, Wind, World
from outrider.team import Schedule

PLACES: Final[Mapping[str, Callable[..., World]]] = {
    f.__name__: f
    for f in (
        places.open_field,
        places.parked_airliner,
        places.amr_passage,
        places.amr_bend,
        places.amr_loop,
        places.city_block,
        site,
    )
}
VEHICLES: Final[Mapping[str, type[Vehicle]]] = {
    "mecanum": Mecanum,
    "differential": Differential,
    "steered": Steered,
    "multirotor": Multirotor,
    "rotorcraft": Rotorcraft,
}
SENSORS: Final[Mapping[str, type[Any]]] = {
    "imu": sensors.Imu,
    "attitude": sensors.Attitude,
    "gnss": sensors.Gnss,
    "gnss_receiver": sensors.GnssReceiver,
    "gnss_velocity": sensors.GnssVelocity,
    "heading": sensors.Heading,
    "baro": sensors.Baro,
    "magnetometer": sensors.Magnetometer,
    "body_twist": sensors.BodyTwist,
    "wheel_encoders": sensors.WheelEncoders,
    "steering_encoder": sensors.SteeringEncoder,
    "lidar": sensors.Lidar,
    "object_pose": sensors.ObjectPose,
    "robot_camera": sensors.RobotCamera,
    "stereo_velocity": sensors.StereoVelocity,
    "uwb": sensors.Uwb,
}
FAULTS: Final[Mapping[str, type[Any]]] = {
    "faulty": sensors.Faulty,
    "clocked": sensors.Clocked,
    "spell": sensors.Spell,
}
SET_BY_THE_FILE = ("wind", "ground")  # of a place: they have sections of their own
GRAVITY = ("gravity",)  # of a vehicle: the world's

Point: TypeAlias = tuple[Number, Number, Number]


def place_section(name: str, place: Callable[..., World]) -> Any:
    """The section of a function that makes a world: its arguments."""
    given: dict[str, Any] = {
        p.name: (
            bounded(STRICT.get(p.annotation, p.annotation), p.name),
            p.default if p.default is not Parameter.empty else ...,
        )
        for p in signature(place, eval_str=True).parameters.values()
        if p.name not in SET_BY_THE_FILE
    }
    about = " ".join((place.__doc__ or "").split("\n\n")[0].split())
    return create_model(name, __base__=MadePart, __doc__=about, type=(Literal[name], ...), **given)  # type: ignore[valid-type]


def _one_of(sections: list[Any]) -> Any:
    made = sections[0]
    for section in sections[1:]:
        made = made | section
    return Annotated[made, Field(discriminator="type")]


class MoverSection(Part):
    """Someone or something that walks through points at a constant speed."""

    name: str
    points: Annotated[list[list[Number]], Field(min_length=1)]
    """East, north (and up) [m]."""
    speed: Annotated[Number, Field(gt=0)] = 1.3
    start_s: Number = 0.0
    radius: Annotated[Number, Field(gt=0)] = 0.3
    height: Annotated[Number, Field(gt=0)] = 1.75


class WorldSection(Part):
    """Where it happens."""

    place: _one_of([place_section(n, f) for n, f in PLACES.items()])  # type: ignore[valid-type]
    wind: inner_section(Wind) = Field(default={}, validate_default=True)  # type: ignore[valid-type]
    ground: inner_section(Ground) = Field(default={}, validate_default=True)  # type: ignore[valid-type]
    walls: tuple[inner_section(Wall), ...] = ()  # type: ignore[valid-type]
    """Beside those of the place."""
    movers: tuple[MoverSection, ...] = ()
    """Beside those of the place."""
    fence: inner_section(Fence) | None = None  # type: ignore[valid-type]
    """Instead of the place's."""


class StartSection(Part):
    """Where a robot starts: east, north, up [m] and heading [rad], counter-clockwise from east."""

    x: Number = 0.0
    y: Number = 0.0
    z: Number = 0.0
    yaw: Number = 0.0
    yaw_deg: Number | None = None


class StillMission(Part):
    """Stands where it starts."""

    type: Literal["still"]


class TourMission(Part):
    """Visits waypoints on its own estimate, made of its own sensors."""

    type: Literal["tour"]
    waypoints: Annotated[list[list[Number]], Field(min_length=1)]
    """East, north (and up) [m]; the last one is the goal."""
    speed: Annotated[Number, Field(gt=0)] = 1.0
    reach: Annotated[Number, Field(gt=0)] = 0.5
    """How near counts as there [m]."""
    turn: Annotated[Number, Field(gt=0)] = 0.8
    """rad/s at most."""
    turn_deg: Number | None = None
    period_s: Annotated[Number, Field(gt=0)] = 0.1


class ScoutMission(TourMission):
    """Flies a tour, and tells the others what its lidar sees that is not on the map."""

    type: Literal["scout"]  # type: ignore[assignment]
    sees: Annotated[Number, Field(gt=0)] = 15.0
    """m, up to which its lidar is trusted."""


class TrackMission(Part):
    """Carried smoothly along points, whatever a vehicle could do; heading along the way."""

    type: Literal["track"]
    points: Annotated[list[Point], Field(min_length=2)]
    speed: Annotated[Number, Field(gt=0)] = 1.0
    wait_s: Annotated[Number, Field(ge=0, le=100_000)] = 5.0
    """Stands so long before it moves."""
    flies: Flag = False
    """Whether it leans into its accelerations, as a multirotor does."""
    rate_hz: Annotated[Number, Field(gt=0, le=2000)] = 100.0
    spacing_s: Annotated[Number, Field(gt=0)] = 1.0
    """Corners are rounded over a few times this."""


Mission: TypeAlias = _one_of(  # type: ignore[valid-type]
    [
        StillMission,
        TourMission,
        ScoutMission,
        TrackMission,
        GotoMission,
        PatrolMission,
        StationMission,
        InspectMission,
        LeadMission,
        FollowMission,
        section_of(Schedule, tag="schedule"),
    ]
)


def _fault(name: str, cls: type[Any]) -> Any:
    base = section_of(cls, tag=name, skip=("sensor",))
    return create_model(base.__name__, __base__=base, __doc__=base.__doc__, sensor=(str, ...))


class RobotSection(Part):
    """One member of the team."""

    vehicle: tagged(VEHICLES, skip=GRAVITY) | None = None  # type: ignore[valid-type]
    """None for a robot that is carried along a track."""
    physics: Literal["own", "mujoco"] = "own"
    """Which one moves the vehicle: `mujoco` has wheels on contacts; it takes the extra `physics`, and patience."""
    pad: inner_section(Pad) | None = None  # type: ignore[valid-type]
    """A deck on which a drone may stand, land, and take off."""
    on: str | None = None
    """The robot on whose pad this one starts, instead of `start`; it takes off with the first command to climb."""
    start: StartSection = StartSection()
    sensors: tuple[tagged(SENSORS), ...] = ()  # type: ignore[valid-type]
    mission: Mission = Field(default={"type": "still"}, validate_default=True)  # type: ignore[valid-type]
    faults: tuple[_one_of([_fault(n, c) for n, c in FAULTS.items()]), ...] = ()  # type: ignore[valid-type]
    """What goes wrong with a sensor, by its name."""
    drift: inner_section(Drift) = Field(default={}, validate_default=True)  # type: ignore[valid-type]
    """How slow sensor errors walk."""
    size: inner_section(Hull) | None = None  # type: ignore[valid-type]
    """Bounding cylinder, instead of the vehicle's."""


RobotName: TypeAlias = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$", max_length=40)]


class CooperationSection(Part):
    """What robots that share their estimates are told about it. Those that inspect name the method in their missions;
    a team that is carried along tracks is estimated from its records."""

    method: MethodName = "joint"
    ablate: Flag = False
    """Whether to estimate again without each of the sensors, to tell what it was worth."""


class Scenario(Part):
    """A scenario: who moves where, feeling what, and what goes wrong."""

    name: str = "scenario"
    about: str = ""
    seed: Annotated[Whole, Field(ge=0)] = 1
    duration_s: Annotated[Endless, Field(gt=0, le=100_000)]
    """At most; it ends earlier with the last mission, or with a collision."""
    world: WorldSection
    radio: inner_section(Radio) = Field(default={}, validate_default=True)  # type: ignore[valid-type]
    team: Annotated[dict[RobotName, RobotSection], Field(min_length=1)]
    cooperation: CooperationSection | None = None


__all__ = ["FAULTS", "PLACES", "SENSORS", "VEHICLES", "Scenario", "Table"]
