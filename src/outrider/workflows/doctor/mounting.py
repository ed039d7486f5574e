"""How an IMU is turned on the body, from gravity and from what the wheels do."""

from dataclasses import dataclass
from itertools import permutations, product
from typing import Final, final

import numpy as np

from outrider.typing import Floats
from outrider.workflows.doctor.signals import Signal, instants
from outrider.workflows.sandwich import sandwich

WINDOW: Final = 1.0  # s over which accelerations are compared
STEP: Final = 0.25  # s between comparisons
FEW: Final = 60  # comparisons
NEAR: Final = np.radians(12.0)  # so near to right angles a bracket is meant to be at right angles
LEAST_GAIN: Final = 1e-6
SURE: Final = np.radians(8.0)  # deviation of the direction of travel within which it counts as found


@final
@dataclass(frozen=True, slots=True)
class Turned:
    """R : (3, 3) body from sensor;  sd : of its yaw [rad], inf where only gravity tells;  off : from the nearest
    right-angled mount [rad]."""

    R: Floats
    sd: float
    off: float

    @property
    def whole(self) -> bool:
        """Whether its yaw is known too."""
        return self.sd < SURE


def right_angled() -> list[Floats]:
    """The 24 mounts at right angles."""
    out: list[Floats] = []
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            R = np.zeros((3, 3))
            R[np.arange(3), order] = signs
            if np.linalg.det(R) > 0.0:
                out.append(R)
    return out


def angle_between(A: Floats, B: Floats) -> float:
    """The angle of the rotation from one to the other [rad]."""
    return float(np.arccos(np.clip((np.trace(A.T @ B) - 1.0) / 2.0, -1.0, 1.0)))


def from_gravity(up: Floats) -> Floats:
    """(3, 3) the least rotation that puts `up` (sensor axes) up."""
    u = up / np.linalg.norm(up)
    v, c = np.array([u[1], -u[0], 0.0]), u[2]  # u x z
    if c < -0.999:
        return np.diag([1.0, -1.0, -1.0])
    K = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.eye(3) + K + K @ K / (1.0 + c)


def mount_of(f: tuple[Signal, Signal, Signal], up: Floats, speed: Signal | None, turn: Signal | None) -> Turned:
    """The mount of an IMU, right-angled where it is so nearly, see `turned`."""
    R, sd = turned(f, up, speed, turn)
    return snapped(R, sd)


def turned(
    f: tuple[Signal, Signal, Signal], up: Floats, speed: Signal | None, turn: Signal | None
) -> tuple[Floats, float]:
    """(3, 3) body from IMU and the deviation of its yaw [rad], inf where only gravity tells: up by gravity, forward by
    the accelerations that wheels and turns ask for.

    On level ground the horizontal specific force is (dv/dt, v w) forward and left. As complex numbers
    h = e^{i psi} (dv/dt + i v w) + noise, of which the least-squares psi is arg sum conj(expected) h.
    f : the three axes of the accelerometer;  up : (3,) mean specific force, sensor axes;  turn : yaw rate [rad/s]
    """
    level = from_gravity(up)
    if speed is None:
        return level, np.inf
    at = instants(speed, f[0], STEP)
    a = np.column_stack([axis.mean(at, WINDOW) for axis in f])
    w = turn.mean(at, WINDOW) if turn is not None else np.zeros(len(at))
    expected = speed.slope(at, WINDOW) + 1j * speed.mean(at, WINDOW) * w
    good = np.isfinite(expected) & np.isfinite(a).all(axis=1)
    if good.sum() < FEW:
        return level, np.inf
    a = a[good] @ level.T
    psi, sd = direction(expected[good], a[:, 0] + 1j * a[:, 1], at[good])
    if sd >= SURE:  # yaw is free: of the right-angled mounts that put the same axis up the one that turns least
        return level, np.inf
    c, s = np.cos(psi), np.sin(psi)
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ level, sd


def direction(expected: "np.ndarray", h: "np.ndarray", t: Floats) -> tuple[float, float]:
    """psi [rad] and its deviation: d psi = Im sum conj(g expected) left / (|g|^2 sum |expected|^2), g = e^{i psi} times
    what scales the accelerations. t : (n,) s; windows overlap, and slopes of noise cancel over time."""
    expected, h = expected - expected.mean(), h - h.mean()
    power = float(np.sum(np.abs(expected) ** 2))
    if power <= 0.0:
        return 0.0, np.inf
    gain = np.vdot(expected, h) / power
    if abs(gain) < LEAST_GAIN:
        return 0.0, np.inf
    turned = gain * expected
    left = h - turned
    scores, scatter = np.imag(np.conj(turned) * left)[:, None], float(np.mean(np.abs(left) ** 2)) / 2.0
    sd = np.sqrt(sandwich(np.array([[abs(gain) ** 2 * power]]), scores, t, scatter)[0, 0])
    return float(np.angle(gain)), float(sd)


def snapped(R: Floats, sd: float) -> Turned:
    """A mount, right-angled where it is so nearly."""
    best = min(right_angled(), key=lambda B: angle_between(R, B))
    off = angle_between(R, best)
    return Turned(best if off < max(NEAR, 2.0 * min(sd, SURE)) else R, sd, off)
