"""Who takes part in a simulation."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import final

from outrider.data.agents import Agent, Planned
from outrider.models.vehicles import AIR_INPUTS, Pad, Vehicle
from outrider.sim.monitor import Hull
from outrider.sim.sensors import Plain, Sensor
from outrider.sim.truth import Drift, Truth
from outrider.typing import Floats


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Robot:
    """One member of the team. It is driven by an agent through a vehicle, or carried along a `track`.

    start : east, north, up [m] and heading [rad];  drift : how slow its sensor errors are;  aloft : whether the track
    is one through the air.
    """

    name: str = "robot"
    vehicle: Vehicle | None = None
    agent: Agent | Planned | None = None
    track: Truth | None = None
    sensors: tuple[Sensor | Plain, ...] = ()
    mounts: Mapping[str, Floats] = field(default_factory=dict[str, Floats])
    start: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    drift: Drift = field(default_factory=Drift)
    size: Hull | None = None  # of its vehicle, unless given
    pad: Pad | None = None  # a deck for a drone
    on: str = ""  # the robot on whose pad it starts
    aloft: bool = False

    @property
    def flies(self) -> bool:
        """Whether the ground is something that it must not touch on its way."""
        return self.aloft if self.vehicle is None else self.vehicle.inputs == AIR_INPUTS

    @property
    def hull(self) -> Hull:
        """What collides."""
        if self.size is not None or self.vehicle is None:
            return self.size or Hull()
        return Hull(radius=self.vehicle.radius, height=self.vehicle.height)
