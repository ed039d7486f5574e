"""The filters of robots that share their estimates, from what they carry: those of coop2024 for one that drives and one
that flies, and how each of their sensors is heard."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, Literal, TypeAlias, final

import numpy as np

from outrider.data import Gaussian
from outrider.errors import ConfigError
from outrider.filters.cooperative import Member, Method
from outrider.models import sensors as s
from outrider.models.motion import LAYOUTS, DriftingRover, EulerBody, Motion
from outrider.scenarios.navigation import Put, mount_matrix
from outrider.sim import sensors
from outrider.sim.radio import Air, Radio
from outrider.sim.sensors.sight import number_of
from outrider.sim.truth import EPOCH
from outrider.sim.world import World
from outrider.team.crew import Crew
from outrider.team.ears import Ear

MethodName: TypeAlias = Literal["none", "local", "naive", "ci", "split_ci", "distributed", "joint"]
START: Final = {
    "position": 0.3, "heading": 0.02, "yaw": 0.02, "pitch": 0.01, "roll": 0.01, "velocity": 0.1, "yaw_rate": 0.1,
}  # fmt: skip
INF: Final = float("inf")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Heard:
    """A robot whose sensors are heard.  put : where it is put down;  closed_loop : whether it follows its estimate, and
    so moves as its motors and winds have it; carried ones move smoothly."""

    put: Put
    flies: bool
    carried: tuple[Any, ...]
    closed_loop: bool


def crew_of(robots: Mapping[str, Heard], method: Method, world: World, radio: Radio, seed: int) -> Crew:
    """Estimates of these robots. ConfigError for one without a source of position."""
    members = [_member(name, r, world) for name, r in robots.items()]
    ears = {name: _ears(name, r, tuple(robots)) for name, r in robots.items()}
    return Crew(members, ears, method, EPOCH, world.datum, Air(radio, tuple(robots), seed, 0))


def _member(name: str, r: Heard, world: World) -> Member:
    """Its filter, of coop2024's models, with what it believes where it was put down."""
    motion = Motion.EULER if r.flies else Motion.DRIFTING
    model = DriftingRover() if r.closed_loop else DriftingRover(acceleration=0.1, yaw_acceleration=0.25)
    if r.flies:
        model = EulerBody(gravity=world.gravity)
        model = replace(model, acceleration=1.5, rate=0.6) if r.closed_loop else model
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


def _ears(name: str, r: Heard, team: tuple[str, ...]) -> tuple[Ear, ...]:
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
