"""A rotorcraft in MuJoCo."""

from dataclasses import dataclass, field
from functools import cached_property
from math import exp
from typing import final

import numpy as np

from outrider.core.rotations import quats_to_matrices, rpy_to_quats
from outrider.models.vehicles import Rotorcraft
from outrider.models.vehicles.airborne import X_Q, X_V
from outrider.models.vehicles.base import ROW_SIZE
from outrider.models.vehicles.rigid import X_P, X_ROTORS, X_W
from outrider.models.vehicles.rotorcraft import new_goals
from outrider.sim.physics.body import MujocoBody
from outrider.typing import Floats

_XML = """
<mujoco>
  <option timestep="{step}" gravity="0 0 -{gravity}" integrator="RK4"/>
  <worldbody>
    <geom type="plane" size="0 0 1" friction="1 0.005 0.0001"/>
    <body name="craft">
      <freejoint/>
      <inertial pos="0 0 0" mass="{mass}" diaginertia="{inertia}"/>
      <geom type="cylinder" size="{radius} {half}" mass="0"/>
      {sites}
    </body>
  </worldbody>
  <actuator>{motors}</actuator>
</mujoco>
"""


@final
@dataclass(frozen=True, kw_only=True)
class MujocoRotorcraft:
    """The same design under the same autopilot, its body and its contacts in MuJoCo (Runge-Kutta of fourth order)."""

    design: Rotorcraft = field(default_factory=Rotorcraft)

    @property
    def step_s(self) -> float:
        return self.design.step_s

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
        return self.design.width + self._body.width

    @cached_property
    def _body(self) -> MujocoBody:
        d, sites, motors = self.design, "", ""
        for i, r in enumerate(d.rotors):
            sites += f'<site name="r{i}" pos="{r.x} {r.y} 0"/>'
            gear = f"0 0 {r.thrust} 0 0 {-r.spin * r.torque}"
            motors += f'<general site="r{i}" gear="{gear}" ctrllimited="false"/>'
        return MujocoBody(
            _XML.format(
                step=d.step_s, gravity=d.gravity, mass=d.mass, inertia=" ".join(map(str, d.inertia)), radius=d.radius,
                half=d.height / 2, sites=sites, motors=motors,
            )
        )  # fmt: skip

    def start(self, p: Floats, yaw: float) -> Floats:
        """At rest at p, hovering rotors; on the ground, the hull stands on it."""
        place = np.array([p[0], p[1], max(float(p[2]), self.height / 2)])
        shadow = self.design.launch(place, rpy_to_quats(np.array([[0.0, 0.0, yaw]]))[0], np.zeros(3))
        return np.concatenate([shadow, self._body.rest(place, shadow[X_Q : X_Q + 4])])

    def run(self, x: Floats, u: Floats, air: Floats, ground: Floats, out: Floats) -> None:
        """See `Vehicle`; the ground is level here."""
        d, body, n = self.design, self._body, len(self.design.rotors)
        shadow, keep = x[: d.width], exp(-d.step_s / d.rotor_lag_s)
        body.load(x[d.width :])
        drag = np.diag(d.drag)
        for k in range(len(u)):
            shadow[X_P : X_P + 3], shadow[X_Q : X_Q + 4], shadow[X_V : X_V + 3] = body.p, body.q, body.v
            shadow[X_W : X_W + 3] = body.w
            new_goals(shadow, u, k, d._theta, d._rotors)
            speeds, goals = shadow[X_ROTORS : X_ROTORS + n], shadow[X_ROTORS + n : X_ROTORS + 2 * n]
            speeds[:] = goals + (speeds - goals) * keep
            R = quats_to_matrices(body.q[None])[0]
            body.data.xfrc_applied[1, :3] = -R @ drag @ R.T @ (body.v - air[k])
            body.data.ctrl[:] = speeds**2
            body.step(d.gravity, out[k, :ROW_SIZE])
            out[k, ROW_SIZE:] = speeds
        body.store(x[d.width :])
