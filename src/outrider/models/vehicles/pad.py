"""A landing pad on a moving carrier: when a drone is on it, and what it then feels.

The states and their transitions are pure functions. A docked drone is not integrated: it is where its berth on the
carrier is, and feels what the carrier feels there,  v + R (w x r),  f + w' x r + w x (w x r).
"""

from dataclasses import dataclass
from enum import Enum
from typing import final

import numpy as np

from outrider.core.rotations import quats_conjugate, quats_multiply, quats_to_matrices
from outrider.models.vehicles.base import ROW_F, ROW_P, ROW_Q, ROW_SIZE, ROW_V, ROW_W, require_positive
from outrider.typing import Floats

_P, _Q, _V = slice(ROW_P, ROW_P + 3), slice(ROW_Q, ROW_Q + 4), slice(ROW_V, ROW_V + 3)
_W, _F = slice(ROW_W, ROW_W + 3), slice(ROW_F, ROW_F + 3)


class Docking(Enum):
    """Where a drone stands with its pad."""

    DOCKED = "it stands on the pad"
    AIRBORNE = "it is in the air"
    TOO_HARD = "it struck the pad: descend more slowly relative to the carrier"
    TOO_TILTED = "it touched the pad at too steep an angle: come to rest above the pad first"
    OFF_CENTRE = "it touched the carrier beside the pad: hold the position over the pad before descending"

    @property
    def crashed(self) -> bool:
        """Whether the flight ended there."""
        return self not in (Docking.DOCKED, Docking.AIRBORNE)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Berth:
    """Pose of a docked drone on its carrier: p (3,) m and q (4,), both in the carrier's body frame."""

    p: Floats
    q: Floats


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Pad:
    """A flat round deck on a carrier and what a landing there may be like."""

    place: tuple[float, float, float] = (0.0, 0.0, 0.6)  # m, middle of the deck in the carrier's body frame
    radius: float = 0.4  # m, of the deck
    tolerance: float = 0.25  # m, from its middle, for a landing to hold
    speed: float = 0.8  # m/s, relative to the deck
    tilt: float = 0.3  # rad, relative to the deck

    def __post_init__(self) -> None:
        require_positive(self, radius=self.radius, tolerance=self.tolerance, speed=self.speed, tilt=self.tilt)

    def berth(self, carrier: Floats, drone: Floats) -> Berth:
        """Where the drone is, seen from the carrier; both as rows (16 or more) of one instant."""
        R = quats_to_matrices(carrier[_Q])
        return Berth(p=R.T @ (drone[_P] - carrier[_P]), q=quats_multiply(quats_conjugate(carrier[_Q]), drone[_Q]))

    def middle(self) -> Berth:
        """In the middle of the deck, nose ahead."""
        return Berth(p=np.array(self.place), q=np.array([0.0, 0.0, 0.0, 1.0]))

    def after_takeoff(self, status: Docking, climb: float) -> Docking:
        """A docked drone leaves once it is told to climb (commanded v_up > 0); anything else stays as it is."""
        return Docking.AIRBORNE if status is Docking.DOCKED and climb > 0.0 else status

    def after_flight(self, status: Docking, before: Floats, carrier: Floats, drone: Floats) -> Docking:
        """What has become of a drone in the air; it touches the deck where it comes down through it.

        before (3,): its place [m] in the carrier's body a moment ago;  carrier, drone: rows of the same instant now.
        """
        now = self.berth(carrier, drone)
        through = before[2] >= self.place[2] > now.p[2]
        off = float(np.hypot(now.p[0] - self.place[0], now.p[1] - self.place[1]))
        if status is not Docking.AIRBORNE or not through or off > self.radius:
            return status
        return self._landing(off, self._relative_speed(carrier, drone, now), now)

    def _landing(self, off: float, speed: float, now: Berth) -> Docking:
        if speed > self.speed:
            return Docking.TOO_HARD
        if float(np.arccos(np.clip(quats_to_matrices(now.q)[2, 2], -1.0, 1.0))) > self.tilt:
            return Docking.TOO_TILTED
        return Docking.DOCKED if off <= self.tolerance else Docking.OFF_CENTRE

    def _relative_speed(self, carrier: Floats, drone: Floats, now: Berth) -> float:
        deck = carrier[_V] + quats_to_matrices(carrier[_Q]) @ np.cross(carrier[_W], now.p)
        return float(np.linalg.norm(drone[_V] - deck))

    def settled(self, berth: Berth) -> Berth:
        """The berth of a drone that has landed: level on the deck, at its place and heading."""
        z, w = float(berth.q[2]), float(berth.q[3])
        norm = float(np.hypot(z, w))
        q = np.array([0.0, 0.0, z / norm, w / norm] if norm > 0.0 else [0.0, 0.0, 0.0, 1.0])
        return Berth(p=np.array([berth.p[0], berth.p[1], self.place[2]]), q=q)


def carried(carrier: Floats, berth: Berth, step_s: float, actuators: int = 0) -> Floats:
    """Rows (n, 16 + actuators) of a docked drone from those (n + 1, 16 or more) of its carrier, the first one old.

    The old row gives the angular acceleration, by a difference; rotors stand still.
    """
    rows, r = carrier[1:], berth.p
    out = np.zeros((len(rows), ROW_SIZE + actuators))
    R, w = quats_to_matrices(rows[:, _Q]), rows[:, _W]
    turning = np.cross(np.diff(carrier[:, _W], axis=0) / step_s, r) + np.cross(w, np.cross(w, r))
    B = quats_to_matrices(berth.q)
    out[:, _P], out[:, _Q] = rows[:, _P] + R @ r, quats_multiply(rows[:, _Q], berth.q)
    out[:, _V] = rows[:, _V] + np.einsum("nij,nj->ni", R, np.cross(w, r))
    out[:, _W], out[:, _F] = w @ B, (rows[:, _F] + turning) @ B  # B' of each row
    return out
