"""The cascaded velocity controller of a rotorcraft: velocity, thrust direction, body rate, torque, rotor speeds."""

from math import hypot, sqrt
from typing import Final

from outrider._kernel import kernel
from outrider.models.vehicles.airborne import X_OWN, X_V, X_W, in_body, lean_towards
from outrider.models.vehicles.base import limited
from outrider.models.vehicles.rigid import X_ROTORS, Quadruple
from outrider.typing import Floats

X_INTEGRAL: Final = X_OWN

# theta after that of `rigid`
T_MIN: Final = 10  # rotor speeds [rad/s]
T_MAX: Final = 11
T_TAU: Final = 12  # s
T_TRIM: Final = 13  # 1/s^2
T_LEVEL: Final = 14  # m/s^2
T_UPRIGHT: Final = 15
T_TILT_LAG: Final = 16
T_TILT_RATE: Final = 17
T_RATE_LAG: Final = 18
T_SPEED: Final = 19  # speed, climb, sink, yaw rate
T_DELAY: Final = 23
T_DIRECT: Final = 24


@kernel
def desired_thrust(x: Floats, u: Quadruple, theta: Floats) -> tuple[float, float, float]:
    """Thrust per mass [m/s^2], site frame: (u - v) / tau within limits, plus an integral that learns wind and drag."""
    h, tau = theta[0], theta[T_TAU]
    e, n, z = u[0] - x[X_V], u[1] - x[X_V + 1], u[2] - x[X_V + 2]
    hard = hypot(e, n) / tau
    level = theta[T_LEVEL] / hard if hard > theta[T_LEVEL] else 1.0
    up = limited(z / tau, theta[T_UPRIGHT])
    if level == 1.0:  # an integral that grows while a limit holds would overshoot
        x[X_INTEGRAL] = limited(x[X_INTEGRAL] + h * theta[T_TRIM] * e, theta[T_LEVEL])
        x[X_INTEGRAL + 1] = limited(x[X_INTEGRAL + 1] + h * theta[T_TRIM] * n, theta[T_LEVEL])
    if up == z / tau:
        x[X_INTEGRAL + 2] = limited(x[X_INTEGRAL + 2] + h * theta[T_TRIM] * z, theta[T_UPRIGHT])
    return (
        e / tau * level + x[X_INTEGRAL],
        n / tau * level + x[X_INTEGRAL + 1],
        up + x[X_INTEGRAL + 2] + theta[1],
    )


@kernel
def desired_torque(x: Floats, t: tuple[float, float, float], yaw_rate: float, theta: Floats) -> tuple[float, ...]:
    """Torque [N m] that turns body z into the thrust t:  w* = lean / lag + yaw,  J (w* - w) / lag + w x J w."""
    phi_x, phi_y = lean_towards(x, t[0], t[1], t[2])
    quick = hypot(phi_x, phi_y) / theta[T_TILT_LAG]
    pace = (theta[T_TILT_RATE] / quick if quick > theta[T_TILT_RATE] else 1.0) / theta[T_TILT_LAG]
    wx, wy, wz = in_body(x, 0.0, 0.0, yaw_rate)
    a, b, c = x[X_W], x[X_W + 1], x[X_W + 2]
    per = 1.0 / theta[T_RATE_LAG]
    j0, j1, j2 = theta[3], theta[4], theta[5]
    return (
        j0 * (wx + phi_x * pace - a) * per + (j2 - j1) * b * c,
        j1 * (wy + phi_y * pace - b) * per + (j0 - j2) * c * a,
        j2 * (wz - c) * per + (j1 - j0) * a * b,
    )


@kernel
def allocate(x: Floats, force: float, torque: tuple[float, ...], theta: Floats, rotors: Floats) -> None:
    """Goals of the rotors: Omega^2 = M+ (T, torque) within their limits; turning in yaw gives way first."""
    n, low, high = rotors.shape[0], theta[T_MIN] * theta[T_MIN], theta[T_MAX] * theta[T_MAX]
    share = 1.0
    for i in range(n):
        base = rotors[i, 5] * force + rotors[i, 6] * torque[0] + rotors[i, 7] * torque[1]
        yaw = rotors[i, 8] * torque[2]
        room = high - base if yaw > 0.0 else base - low
        if abs(yaw) > room:
            share = min(share, max(room, 0.0) / abs(yaw))
    for i in range(n):
        square = rotors[i, 5] * force + rotors[i, 6] * torque[0] + rotors[i, 7] * torque[1]
        square += rotors[i, 8] * torque[2] * share
        x[X_ROTORS + n + i] = sqrt(min(max(square, low), high))


@kernel
def fly_velocity(x: Floats, u: Quadruple, theta: Floats, rotors: Floats) -> None:
    """Goals of the rotors for the command (v_east, v_north, v_up, yaw rate)."""
    t = desired_thrust(x, u, theta)
    along = in_body(x, t[0], t[1], t[2])[2]
    force = theta[2] * max(along, 0.1 * theta[1])  # upside down there is no going up
    allocate(x, force, desired_torque(x, t, u[3], theta), theta, rotors)
