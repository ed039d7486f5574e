"""Poses: of this robot against a map, of another robot as seen from this one."""

from dataclasses import dataclass
from typing import ClassVar, final

from outrider._kernel import kernel
from outrider.core.rotations import quat_from_matrix
from outrider.models.kinematics import T_TH, T_W
from outrider.models.sensors.attitude import attitude_rows, error_rows, sensor_attitude
from outrider.models.sensors.geometry import (
    Vector,
    clear,
    dot,
    in_body,
    in_mount,
    is_rotation,
    mix,
    point,
    point_row,
    sensor_axis,
    target_from_origin,
    target_row,
    triple,
    turned,
)
from outrider.models.sensors.layout import LEVER, OWN, STRAIGHT, Mount, Sensor, deviations
from outrider.typing import Floats

_AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@kernel
def pose(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """z[0:3] = p + R l, z[3:7] = quaternion of R R_bs;  y = [metres in the world, Log(R' R_z R_bs') in the body]."""
    clear(D, 6)
    if not is_rotation(z[3:7]):
        return 0
    for i in range(3):
        y[i] = z[i] - point(k, theta, i)
        point_row(k, theta, i, D, i)
    attitude_rows(k, z[3:7], theta, y, D, 3)
    return 6


@kernel
def simulate_pose(k: Floats, theta: Floats, D: Floats, z: Floats) -> None:
    """z[0:7]; D is scratch."""
    for i in range(3):
        z[i] = point(k, theta, i)
    sensor_attitude(k, theta, D, z[3:7])


@kernel
def other_axis(k: Floats, theta: Floats, j: int) -> Vector:
    """Axis j of the other robot in this body: column j of R' R_2."""
    return in_body(k, (theta[OWN + 3 + j], theta[OWN + 6 + j], theta[OWN + 9 + j]))


@kernel
def relative_pose(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """z[1:4] = R_bs' (R' (p_2 - p) - l), z[4:8] = quaternion of R_rel = R_bs' R' R_2, z[0] names the other robot.

    y = [metres along the sensor's axes, Log(R_rel' R_z) in the other's body];  theta[12:15] p_2, theta[15:24] R_2: the
    other's pose counts as known.
    """
    clear(D, 6)
    if not is_rotation(z[4:8]):
        return 0
    r = target_from_origin(k, triple(theta, OWN))
    for i in range(3):
        b = sensor_axis(theta, i)
        y[i] = z[1 + i] - dot(b, mix(1.0, r, -1.0, triple(theta, LEVER)))
        target_row(k, r, b, D, i)
    axes = (other_axis(k, theta, 0), other_axis(k, theta, 1), other_axis(k, theta, 2))
    for j in range(3):
        seen = in_mount(theta, turned(z[4:8], _AXES[j]))
        for i in range(3):
            D[3 + i, T_W + j] = dot(axes[i], seen)
    error_rows(y, D, 3)
    # R Exp(dth) turns the predicted R_rel by -R_2' R dth, seen from the other's body
    for i in range(3):
        J = triple(D[3 + i], T_TH)
        turn = mix(1.0, mix(J[0], axes[0], J[1], axes[1]), J[2], axes[2])
        D[3 + i, T_TH], D[3 + i, T_TH + 1], D[3 + i, T_TH + 2] = -turn[0], -turn[1], -turn[2]
    return 6


@kernel
def simulate_relative_pose(k: Floats, theta: Floats, D: Floats, z: Floats) -> None:
    """z[1:8]; D is scratch."""
    r = target_from_origin(k, triple(theta, OWN))
    R = D[0:3, T_W : T_W + 3]
    for i in range(3):
        b = sensor_axis(theta, i)
        z[1 + i] = dot(b, mix(1.0, r, -1.0, triple(theta, LEVER)))
        for j in range(3):
            R[i, j] = dot(b, other_axis(k, theta, j))
    quat_from_matrix(R, z[4:8])


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Pose:
    """Pose of the sensor in the site frame: lidar or camera against a map."""

    code: ClassVar[Sensor] = Sensor.POSE
    mount: Mount = STRAIGHT
    sigma_position: float = 0.1  # m
    sigma_attitude: float = 0.02  # rad

    def theta(self) -> Floats:
        return self.mount.theta()

    def sigmas(self) -> Floats:
        return deviations(self, *(self.sigma_position,) * 3, *(self.sigma_attitude,) * 3)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class RelativePose:
    """Pose of another robot in this sensor's axes, the other's own pose being known."""

    code: ClassVar[Sensor] = Sensor.RELATIVE_POSE
    mount: Mount = STRAIGHT
    other: Mount = STRAIGHT  # the other robot's position [m] and R_world_body
    sigma_position: float = 0.1  # m
    sigma_attitude: float = 0.05  # rad

    def theta(self) -> Floats:
        return self.mount.theta(*self.other.lever_arm, *self.other.rotation)

    def sigmas(self) -> Floats:
        return deviations(self, *(self.sigma_position,) * 3, *(self.sigma_attitude,) * 3)
