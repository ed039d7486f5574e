"""A four-wheel robot in MuJoCo: two driven wheels between castors, or four mecanum wheels with all their rollers."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from math import cos, pi, sin
from typing import Final, final

import numpy as np

from outrider.core.rotations import rpy_to_quats
from outrider.models.vehicles import LEVEL, Differential, Mecanum
from outrider.models.vehicles.base import ROW_P, ROW_SIZE
from outrider.sim.physics.body import MujocoBody
from outrider.typing import Floats

ROLLERS: Final = 24  # of a wheel
ROLLER: Final = 0.2  # radius of a roller over that of its wheel
CASTOR: Final = 0.35  # m, of the two balls that slide, ahead of and behind the middle
ROTOR: Final = 0.2  # kg m^2 of a motor as felt at its wheel: its servo must not be stiffer than a step can follow
TOUCHES: Final = 'contype="2" conaffinity="1"'  # the ground, and no other wheel
SERVO: Final = 40.0  # N m per rad/s

_XML = """
<mujoco>
  <option timestep="{step}" gravity="0 0 -{gravity}" integrator="implicitfast" cone="elliptic" impratio="10"/>
  <worldbody>
    <geom type="plane" size="0 0 1" friction="1 0.005 0.0001" conaffinity="2"/>
    <body name="chassis">
      <freejoint/>
      <geom type="box" size="{half_length} {half_width} 0.08" mass="{mass}" contype="0" conaffinity="0"/>
      {wheels}
    </body>
  </worldbody>
  <actuator>{motors}</actuator>
</mujoco>
"""


@final
@dataclass(frozen=True, kw_only=True)
class MujocoRover:
    """The same design on contacts. Its motors answer as the design's do; what the wheels make of it is MuJoCo's."""

    design: Differential | Mecanum = field(default_factory=Differential)
    mass: float = 30.0  # kg
    step_s: float = 0.001

    @property
    def gravity(self) -> float:
        return self.design.gravity

    @property
    def radius(self) -> float:
        return self.design.radius

    @property
    def height(self) -> float:
        return self.design.height

    @property
    def inputs(self) -> tuple[str, ...]:
        return self.design.inputs

    @property
    def actuators(self) -> tuple[str, ...]:
        return self.design.actuators

    @property
    def width(self) -> int:
        return self._motors.width + self._body.width

    @property
    def _wheel_radius(self) -> float:
        return self.design.drive.wheel_radius

    @cached_property
    def _motors(self) -> Differential | Mecanum:
        """The design at this step: it says how fast its motors turn the wheels."""
        return replace(self.design, step_s=self.step_s)

    @cached_property
    def _body(self) -> MujocoBody:
        r, wheels = self._wheel_radius, ""
        for i, (x, y, angle) in enumerate(self._places()):
            parts = _tyre(r) if angle is None else _rollers(r, angle)
            joint = f'<joint name="w{i}" type="hinge" axis="0 1 0" armature="{ROTOR}"/>'
            wheels += f'<body pos="{x} {y} 0">{joint}{parts}</body>'
        if isinstance(self.design, Differential):
            ball = f'<geom type="sphere" size="{r}" mass="0.5" {TOUCHES} condim="1" priority="1"/>'
            wheels += "".join(f'<body pos="{x} 0 0">{ball}</body>' for x in (-CASTOR, CASTOR))
        motors = "".join(f'<velocity joint="w{i}" kv="{SERVO}"/>' for i in range(len(self.actuators)))
        return MujocoBody(
            _XML.format(
                step=self.step_s, gravity=self.gravity, half_length=0.4, half_width=0.2, mass=self.mass, wheels=wheels,
                motors=motors,
            )
        )  # fmt: skip

    def _places(self) -> tuple[tuple[float, float, float | None], ...]:
        """x, y and roller angle of every driven wheel."""
        if isinstance(self.design, Mecanum):
            return tuple((x, y, angle) for x, y, angle in self.design.wheels)
        half = self.design.track / 2
        return (self.design.axle, half, None), (self.design.axle, -half, None)

    def start(self, p: Floats, yaw: float) -> Floats:
        """At rest at p: its origin is on the ground below the wheels' axles."""
        place = np.array([p[0], p[1], self._wheel_radius])
        rest = self._body.rest(place, rpy_to_quats(np.array([[0.0, 0.0, yaw]]))[0])
        return np.concatenate([self._motors.start(place, yaw), rest])

    def run(self, x: Floats, u: Floats, air: Floats, ground: Floats, out: Floats) -> None:
        """See `Vehicle`; the ground is level here, and there is no wind on the ground."""
        body, split = self._body, self._motors.width
        told = np.empty((len(u), ROW_SIZE + len(self.actuators)))
        self._motors.run(x[:split], u, air, LEVEL, told)
        body.load(x[split:])
        for k in range(len(u)):
            body.data.ctrl[:] = told[k, ROW_SIZE:] / self._wheel_radius
            body.step(self.gravity, out[k, :ROW_SIZE])
        out[:, ROW_P + 2] -= self._wheel_radius
        out[:, ROW_SIZE:] = told[:, ROW_SIZE:]
        body.store(x[split:])


def _tyre(r: float) -> str:
    return f'<geom type="cylinder" size="{r} 0.01" euler="90 0 0" mass="1" {TOUCHES} condim="3" friction="1"/>'


def _rollers(r: float, angle: float) -> str:
    """Balls on the rim, each free about an axis that lies `angle` left of forward where it touches the ground."""
    ball, parts = ROLLER * r, '<geom type="sphere" size="0.02" mass="1" contype="0" conaffinity="0"/>'
    for i in range(ROLLERS):
        phi = 2 * pi * i / ROLLERS
        x, z = (r - ball) * sin(phi), -(r - ball) * cos(phi)
        axis = f"{cos(angle) * cos(phi)} {sin(angle)} {cos(angle) * sin(phi)}"
        geom = f'<geom type="sphere" size="{ball}" mass="0.02" {TOUCHES} condim="3" friction="1"/>'
        parts += f'<body pos="{x} 0 {z}"><joint type="hinge" axis="{axis}" armature="1e-5"/>{geom}</body>'
    return parts
