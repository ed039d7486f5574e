"""Poses: of this robot against a map, of another robot as seen from this one."""

from dataclasses import dataclass
from math import atan2, cos, sin
from typing import ClassVar, final

from outrider._kernel import kernel
from outrider.core.angles import wrap
from outrider.core.rotations import quat_from_matrix
from outrider.models.kinematics import K_M, K_R, T_M, T_P, T_TH, T_W
from outrider.models.sensors.attitude import attitude_rows, azimuth_row, error_rows, sensor_attitude
from outrider.models.sensors.geometry import (
    Vector,
    clear,
    cross,
    dot,
    in_body,
    in_mount,
    is_rotation,
    mix,
    point,
    point_row,
    put,
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
def map_pose(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """z[0:2], yaw of z[3:7]: the robot's pose as read off a map that itself lies wrong by d, delta.  coop2024 (10)

    h = [c + Rz(delta)' (p + R l - c - d), yaw(R) - delta], of which the first two metres count;  theta[12:14] c, the
    place that the map turns about.
    """
    clear(D, 3)
    azimuth = azimuth_row(k, (1.0, 0.0, 0.0), D, 2)
    if azimuth != azimuth or not is_rotation(z[3:7]):
        return 0
    c, s = cos(k[K_M + 2]), sin(k[K_M + 2])
    east, north = point(k, theta, 0) - theta[OWN] - k[K_M], point(k, theta, 1) - theta[OWN + 1] - k[K_M + 1]
    h_x, h_y = c * east + s * north, c * north - s * east
    y[0], y[1] = z[0] - theta[OWN] - h_x, z[1] - theta[OWN + 1] - h_y
    for i in range(2):
        a = (c, s, 0.0) if i == 0 else (-s, c, 0.0)
        put(D, i, T_P, 1.0, a)
        put(D, i, T_TH, 1.0, cross(triple(theta, LEVER), in_body(k, a)))
        D[i, T_M], D[i, T_M + 1] = -a[0], -a[1]
    D[0, T_M + 2], D[1, T_M + 2], D[2, T_M + 2] = h_y, -h_x, -1.0
    forward = turned(z[3:7], _AXES[0])
    y[2] = wrap(atan2(forward[1], forward[0]) - azimuth + k[K_M + 2])
    return 3


@kernel
def simulate_map_pose(k: Floats, theta: Floats, D: Floats, z: Floats) -> None:
    """z[0:7], level; D is scratch."""
    c, s = cos(k[K_M + 2]), sin(k[K_M + 2])
    east, north = point(k, theta, 0) - theta[OWN] - k[K_M], point(k, theta, 1) - theta[OWN + 1] - k[K_M + 1]
    half = 0.5 * (atan2(k[K_R + 3], k[K_R]) - k[K_M + 2])
    z[0], z[1], z[2] = theta[OWN] + c * east + s * north, theta[OWN + 1] + c * north - s * east, point(k, theta, 2)
    z[3], z[4], z[5], z[6] = 0.0, 0.0, sin(half), cos(half)


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


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class MapPose:
    """Place and heading against a map (or an object, as a parked aircraft) that may itself lie elsewhere."""

    code: ClassVar[Sensor] = Sensor.MAP_POSE
    mount: Mount = STRAIGHT
    centre: tuple[float, float] = (0.0, 0.0)  # m, the place that an error of the map's yaw turns it about
    sigma_position: float = 0.05  # m
    sigma_heading: float = 0.04  # rad

    def theta(self) -> Floats:
        return self.mount.theta(*self.centre)

    def sigmas(self) -> Floats:
        return deviations(self, self.sigma_position, self.sigma_position, self.sigma_heading)
