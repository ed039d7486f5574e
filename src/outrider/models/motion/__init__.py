"""Process models: how a vehicle may move. Each is a layout, a dataclass of parameters and two kernels.

`propagate(x, dt, u, theta, F, Q)` moves the state in place and writes Jacobian and noise;
`kinematic_view(x, u, theta, k, K)` writes the kinematic view that sensors are written against. Both write only entries
that their model uses: F arrives as the identity, Q, k and K as zeros, and the caller keeps them for the same model.
"""

from collections.abc import Mapping
from enum import IntEnum
from typing import Final

from outrider._kernel import kernel
from outrider.data import StateLayout
from outrider.models.motion import drifting, euler, follower, odometric, omnidirectional, planar, strapdown
from outrider.models.motion.drifting import DriftingRover
from outrider.models.motion.euler import EulerBody
from outrider.models.motion.follower import LaggedFollower
from outrider.models.motion.odometric import OdometricRobot
from outrider.models.motion.omnidirectional import OmnidirectionalBody
from outrider.models.motion.planar import PlanarRobot
from outrider.models.motion.strapdown import StrapdownIns
from outrider.typing import Floats


class Motion(IntEnum):
    """Process models by code, for kernels."""

    PLANAR = 0
    STRAPDOWN = 1
    OMNIDIRECTIONAL = 2
    FOLLOWER = 3
    DRIFTING = 4
    EULER = 5
    ODOMETRIC = 6


LAYOUTS: Final[Mapping[Motion, StateLayout]] = {
    Motion.PLANAR: planar.LAYOUT,
    Motion.STRAPDOWN: strapdown.LAYOUT,
    Motion.OMNIDIRECTIONAL: omnidirectional.LAYOUT,
    Motion.FOLLOWER: follower.LAYOUT,
    Motion.DRIFTING: drifting.LAYOUT,
    Motion.EULER: euler.LAYOUT,
    Motion.ODOMETRIC: odometric.LAYOUT,
}


@kernel
def propagate(code: int, x: Floats, dt: float, u: Floats, theta: Floats, F: Floats, Q: Floats) -> None:
    """x <- f(x, u, dt) with F and Q, for the process model of the given code."""
    if code == 0:
        planar.propagate(x, dt, u, theta, F, Q)
    elif code == 1:
        strapdown.propagate(x, dt, u, theta, F, Q)
    elif code == 2:
        omnidirectional.propagate(x, dt, u, theta, F, Q)
    elif code == 3:
        follower.propagate(x, dt, u, theta, F, Q)
    elif code == 4:
        drifting.propagate(x, dt, u, theta, F, Q)
    elif code == 5:
        euler.propagate(x, dt, u, theta, F, Q)
    else:
        odometric.propagate(x, dt, u, theta, F, Q)


@kernel
def kinematic_view(code: int, x: Floats, u: Floats, theta: Floats, k: Floats, K: Floats) -> None:
    """Kinematic view k and Jacobian K, for the process model of the given code."""
    if code == 0:
        planar.kinematic_view(x, u, theta, k, K)
    elif code == 1:
        strapdown.kinematic_view(x, u, theta, k, K)
    elif code == 2:
        omnidirectional.kinematic_view(x, u, theta, k, K)
    elif code == 3:
        follower.kinematic_view(x, u, theta, k, K)
    elif code == 4:
        drifting.kinematic_view(x, u, theta, k, K)
    elif code == 5:
        euler.kinematic_view(x, u, theta, k, K)
    else:
        odometric.kinematic_view(x, u, theta, k, K)


__all__ = [
    "LAYOUTS", "DriftingRover", "EulerBody", "LaggedFollower", "Motion", "OdometricRobot", "OmnidirectionalBody",
    "PlanarRobot", "StrapdownIns", "kinematic_view", "propagate",
]  # fmt: skip
