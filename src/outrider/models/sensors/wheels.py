"""Wheel odometry. The wheel axes are those of the mount; their origin, the lever arm, is where the base reckons.

u = R_bs' (R' v + w x l) and w = R_bs' w_body below; s is the scale error: true speed = (1 + s) measured speed.
"""

from dataclasses import dataclass
from math import atan, tan
from typing import ClassVar, Self, final

from outrider._kernel import kernel
from outrider.errors import ConfigError
from outrider.models.kinematics import K_S, K_W, T_S, T_W
from outrider.models.sensors.geometry import clear, dot, in_mount, put, sensor_axis, triple, velocity_row
from outrider.models.sensors.layout import MAX_ROWS, OWN, STRAIGHT, Mount, Sensor, deviations, require_positive
from outrider.models.wheels import mecanum_rectangle, require_mecanum
from outrider.typing import Floats


@kernel
def rolling_row(k: Floats, theta: Floats, forward: float, left: float, turn: float, D: Floats, row: int) -> float:
    """(forward u_x + left u_y + turn w_z) / (1 + s): what any wheel, or pair of wheels, says of the motion."""
    inverse = 1.0 / (1.0 + k[K_S])
    up = sensor_axis(theta, 2)
    h = velocity_row(k, theta, in_mount(theta, (forward, left, 0.0)), inverse, D, row)
    h += turn * inverse * dot(up, triple(k, K_W))
    put(D, row, T_W, turn * inverse, up)
    D[row, T_S] = -h * inverse
    return h


@kernel
def rate_row(k: Floats, theta: Floats, i: int, D: Floats, row: int) -> float:
    """Component i of w."""
    b = sensor_axis(theta, i)
    put(D, row, T_W, 1.0, b)
    return dot(b, triple(k, K_W))


@kernel
def twist(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """z[0:6] = [u_x/(1+s), u_y/(1+s), u_z, w] [m/s, rad/s]."""
    clear(D, 6)
    y[0] = z[0] - rolling_row(k, theta, 1.0, 0.0, 0.0, D, 0)
    y[1] = z[1] - rolling_row(k, theta, 0.0, 1.0, 0.0, D, 1)
    y[2] = z[2] - velocity_row(k, theta, sensor_axis(theta, 2), 1.0, D, 2)
    for i in range(3):
        y[3 + i] = z[3 + i] - rate_row(k, theta, i, D, 3 + i)
    return 6


@kernel
def wheels_differential(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """z[0:2] = [u_x - w_z B/2, u_x + w_z B/2] / (1+s): left and right rim speed [m/s];  theta[12] track B [m]."""
    clear(D, 2)
    half = 0.5 * theta[OWN]
    y[0] = z[0] - rolling_row(k, theta, 1.0, 0.0, -half, D, 0)
    y[1] = z[1] - rolling_row(k, theta, 1.0, 0.0, half, D, 1)
    return 2


@kernel
def wheels_mecanum(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """z[i] = (u_x - w_z y_i + tan g_i (u_y + w_z x_i)) / (1+s): rim speed [m/s] of the wheel at (x_i, y_i).

    g is the angle, left of forward, of the axis of the roller that touches the ground: along it the ground cannot slip.
    theta[12] number of wheels, then x, y, tan g of each.
    """
    n = int(theta[OWN])
    clear(D, n)
    for i in range(n):
        wheel_x, wheel_y, slant = triple(theta, OWN + 1 + 3 * i)
        y[i] = z[i] - rolling_row(k, theta, 1.0, slant, wheel_x * slant - wheel_y, D, i)
    return n


@kernel
def ackermann(k: Floats, z: Floats, theta: Floats, y: Floats, D: Floats) -> int:
    """z[0] = u_x/(1+s) rear-axle speed [m/s];  0 = (1+s) z[0] tan(z[1])/L - w_z [rad/s];  theta[12] wheel base L [m].

    The steering angle enters as a yaw rate: atan(L w/u) has no value at rest, where this row says w = 0. Its sigma is
    a yaw rate, too.
    """
    clear(D, 2)
    y[0] = z[0] - rolling_row(k, theta, 1.0, 0.0, 0.0, D, 0)
    rate = z[0] * tan(z[1]) / theta[OWN]
    y[1] = (1.0 + k[K_S]) * rate - rate_row(k, theta, 2, D, 1)
    D[1, T_S] = -rate
    return 2


@kernel
def simulate_ackermann(k: Floats, theta: Floats, y: Floats, D: Floats, z: Floats) -> None:
    """z = speed, steering angle; a car at rest steers straight ahead. y and D are scratch."""
    clear(D, 2)
    z[0] = rolling_row(k, theta, 1.0, 0.0, 0.0, D, 0)
    true_speed = (1.0 + k[K_S]) * z[0]
    curvature = rate_row(k, theta, 2, D, 1) / true_speed if abs(true_speed) > 1e-9 else 0.0
    z[1] = atan(theta[OWN] * curvature)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Twist:
    """Velocity and rates as the base reckons them."""

    code: ClassVar[Sensor] = Sensor.TWIST
    mount: Mount = STRAIGHT
    sigma_forward: float = 0.05  # m/s
    sigma_lateral: float = 0.1  # m/s
    sigma_vertical: float = 0.1  # m/s
    sigma_tilt: float = 0.1  # rad/s, rolling and pitching
    sigma_yaw: float = 0.05  # rad/s

    def theta(self) -> Floats:
        return self.mount.theta()

    def sigmas(self) -> Floats:
        linear = (self.sigma_forward, self.sigma_lateral, self.sigma_vertical)
        return deviations(self, *linear, self.sigma_tilt, self.sigma_tilt, self.sigma_yaw)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class WheelsDifferential:
    """Left and right wheel of a differential or skid-steered base (there the track is the effective one)."""

    code: ClassVar[Sensor] = Sensor.WHEELS_DIFFERENTIAL
    mount: Mount = STRAIGHT
    track: float  # m
    sigma: float = 0.05  # m/s

    def __post_init__(self) -> None:
        require_positive(self, track=self.track)

    def theta(self) -> Floats:
        return self.mount.theta(self.track)

    def sigmas(self) -> Floats:
        return deviations(self, self.sigma, self.sigma)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class WheelsMecanum:
    """Up to eight mecanum (or, with roller angle 0, omni) wheels that all roll forward; any layout of full rank."""

    code: ClassVar[Sensor] = Sensor.WHEELS_MECANUM
    mount: Mount = STRAIGHT
    wheels: tuple[tuple[float, float, float], ...]  # x m, y m, angle rad of the touching roller's axis left of forward
    sigma: float = 0.05  # m/s

    def __post_init__(self) -> None:
        where = self.code.name.lower()
        if len(self.wheels) > MAX_ROWS:
            raise ConfigError(f"{len(self.wheels)} wheels; at most {MAX_ROWS} can be used", where=where)
        require_mecanum(self.wheels, where)

    @classmethod
    def rectangle(cls, half_length: float, half_width: float, *, mount: Mount = STRAIGHT, sigma: float = 0.05) -> Self:
        """Front left, front right, rear left, rear right at 45 degrees; an X when seen from above."""
        return cls(mount=mount, wheels=mecanum_rectangle(half_length, half_width), sigma=sigma)

    def theta(self) -> Floats:
        return self.mount.theta(len(self.wheels), *(a for x, y, g in self.wheels for a in (x, y, tan(g))))

    def sigmas(self) -> Floats:
        return deviations(self, *(self.sigma for _ in self.wheels))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Ackermann:
    """Speed of the rear axle (at the lever arm) and steering angle of a car-like base."""

    code: ClassVar[Sensor] = Sensor.ACKERMANN
    mount: Mount = STRAIGHT
    wheel_base: float  # m
    sigma_speed: float = 0.05  # m/s
    sigma_yaw_rate: float = 0.05  # rad/s, of the yaw rate that speed and steering stand for

    def __post_init__(self) -> None:
        require_positive(self, wheel_base=self.wheel_base)

    def theta(self) -> Floats:
        return self.mount.theta(self.wheel_base)

    def sigmas(self) -> Floats:
        return deviations(self, self.sigma_speed, self.sigma_yaw_rate)
