"""A drone and the pad of its carrier during a run: it stands there, takes off, lands, and takes off again."""

from typing import Final, Protocol, final, runtime_checkable

import numpy as np

from outrider.core.rotations import quats_to_matrices
from outrider.errors import ConfigError
from outrider.models.vehicles import AIR_INPUTS, CLIMB, ROW_P, ROW_Q, ROW_V, Vehicle
from outrider.models.vehicles.pad import Docking, Pad, carried
from outrider.typing import Floats

LEAP: Final = 5.0  # m: no step is as long, so who is farther from the deck does not come down on it
_P, _Q, _V = slice(ROW_P, ROW_P + 3), slice(ROW_Q, ROW_Q + 4), slice(ROW_V, ROW_V + 3)


@runtime_checkable
class Flying(Protocol):
    """A vehicle that can be set into the air as it moves."""

    def launch(self, p: Floats, q: Floats, v: Floats) -> Floats:
        """Its state at p [m], q, v [m/s]."""
        ...


@final
class Deck:
    """What the pad of a carrier is to one drone.

    carrier, own : rows of both from the start of the run, of which those of the carrier are ahead;  status : as of the
    newest row;  events : (row, what it became).  Raises ConfigError for a pair that cannot be.
    """

    def __init__(
        self, pad: Pad, carrier: Vehicle, drone: Vehicle, carrier_rows: Floats, own: Floats, name: str
    ) -> None:
        self.pad, self._drone, self._carrier, self._own = pad, drone, carrier_rows, own
        where = f"robot {name}"
        if not isinstance(drone, Flying) or drone.inputs != AIR_INPUTS:
            raise ConfigError("stands on a pad and cannot take off", where=where, fix="give it a drone as vehicle")
        if drone.step_s != carrier.step_s:
            fix = "one step_s for both"
            raise ConfigError(f"steps of {drone.step_s:g} s, its carrier {carrier.step_s:g} s", where=where, fix=fix)
        if pad.place[2] < carrier.height:
            fix = f"raise its place to {carrier.height:g} m or more"
            raise ConfigError(f"its pad lies {carrier.height - pad.place[2]:g} m inside", where=where, fix=fix)
        self._launch = drone.launch
        self._far = float(np.linalg.norm(pad.place)) + pad.radius + LEAP
        self.status, self._berth = Docking.DOCKED, pad.middle()
        self.events: list[tuple[int, Docking]] = []
        own[0] = carried(carrier_rows[[0, 0]], self._berth, drone.step_s, len(drone.actuators))[0]

    def move(self, first: int, last: int, u: Floats, x: Floats, wind: Floats, ground: Floats) -> None:
        """Fill the rows after `first` up to `last` under commands u (last - first, 4); x : state of the drone in the
        air, wind (n, 3) by row. A drone that crashed stays where it touched."""
        k = first
        while k < last:
            ahead = u[k - first :]
            if self.status is Docking.DOCKED:
                k = self._ride(k, last, ahead, x)
            elif self.status is Docking.AIRBORNE:
                self._drone.run(x, ahead, wind[k + 1 : last + 1], ground, self._own[k + 1 : last + 1])
                k = self._touch(k, last)
            else:
                self._own[k + 1 : last + 1] = self._own[k]
                return

    def _ride(self, k: int, last: int, u: Floats, x: Floats) -> int:
        """Carried until a command says climb; the row until which it is."""
        climbing = np.flatnonzero(u[:, CLIMB] > 0.0)
        until = k + int(climbing[0]) if climbing.size else last
        if until > k:
            self._carry(k, until)
        if climbing.size:
            row = self._own[until]
            x[:] = self._launch(row[_P], row[_Q], row[_V])  # as fast as the carrier
            self._become(until, self.pad.after_takeoff(self.status, float(u[until - k, CLIMB])))
        return until

    def _carry(self, k: int, until: int) -> None:
        step, width = self._drone.step_s, len(self._drone.actuators)
        self._own[k + 1 : until + 1] = carried(self._carrier[k : until + 1], self._berth, step, width)

    def _touch(self, k: int, last: int) -> int:
        """The row in which it comes down on the deck, else the last one."""
        carrier, own = self._carrier[k : last + 1], self._own[k : last + 1]
        apart = own[:, _P] - carrier[:, _P]
        if float(np.add.reduce(apart * apart, axis=1).min()) > self._far**2:
            return last
        seen = np.einsum("nji,nj->ni", quats_to_matrices(carrier[:, _Q]), apart)
        z, deck = seen[:, 2], self.pad.place[2]
        for i in (np.flatnonzero((z[:-1] >= deck) & (z[1:] < deck)) + 1).tolist():
            status = self.pad.after_flight(self.status, seen[i - 1], carrier[i], own[i])
            if status is not self.status:
                self._berth = self.pad.settled(self.pad.berth(carrier[i], own[i]))
                self._become(k + i, status)
                self._carry(k + i - 1, k + i)
                return k + i
        return last

    def _become(self, k: int, status: Docking) -> None:
        self.status = status
        self.events.append((k, status))
