"""The motion of one robot during a run: driven through its vehicle, or carried along a track."""

from dataclasses import replace
from itertools import pairwise
from math import isfinite
from typing import final

import numpy as np

from outrider.data.agents import Planned
from outrider.errors import ConfigError
from outrider.models.vehicles import ROW_F, ROW_P, ROW_Q, ROW_SIZE, ROW_V, ROW_W, Vehicle, first_row
from outrider.sim.deck import Deck
from outrider.sim.noise import generator
from outrider.sim.team import Robot
from outrider.sim.truth import Biases, Truth, drift
from outrider.sim.world import World
from outrider.typing import Floats


@final
class Course:
    """The motion of one robot: rows of truth, filled as far as it has come. k : the last row that holds."""

    def __init__(self, world: World, robot: Robot, start: int, end: int, seed: int) -> None:
        self._vehicle, self._start, self.k = robot.vehicle, start, 0
        if robot.track is not None:
            shifted = robot.track.t - robot.track.t[0] + start
            truth = replace(robot.track, t=shifted, start=start, robot=robot.name)
        elif robot.vehicle is not None:
            truth = self._laid_out(world, robot, robot.vehicle, end, seed)
        else:
            raise ConfigError("neither has a vehicle nor follows a track", where=f"robot {robot.name}")
        self.truth = drift(truth, generator(seed, robot.name, "drift"), robot.drift)
        self.deck: Deck | None = None

    def board(self, robot: Robot, carrier: Robot, under: "Course") -> None:
        """Start on the pad of a carrier. Raises ConfigError for a pair that cannot be."""
        if carrier.pad is None or carrier.vehicle is None or robot.vehicle is None:
            fix = "give the carrier a vehicle and a pad, and the drone a vehicle"
            raise ConfigError(f"cannot start on {carrier.name}", where=f"robot {robot.name}", fix=fix)
        self.deck = Deck(carrier.pad, carrier.vehicle, robot.vehicle, under._rows, self._rows, robot.name)

    def _laid_out(self, world: World, robot: Robot, vehicle: Vehicle, end: int, seed: int) -> Truth:
        if abs(vehicle.gravity - world.gravity) > 1e-9:
            fix = f"give both one gravity: {world.gravity} m/s^2 in {world.name}"
            raise ConfigError(f"a vehicle for {vehicle.gravity} m/s^2", where=f"robot {robot.name}", fix=fix)
        step = round(vehicle.step_s * 1e9)
        n = (end - self._start) // step
        self._ground = world.ground.table()
        self._wind = world.wind.sample(generator(seed, robot.name, "gusts"), n + 1, vehicle.step_s)
        self._rows = np.full((n + 1, ROW_SIZE + len(vehicle.actuators)), np.nan)
        self._x = vehicle.start(np.array(robot.start[:3]), robot.start[3])
        self._rows[0] = first_row(vehicle, self._x, self._ground)
        edges = (ROW_P, ROW_Q, ROW_V, ROW_W, ROW_F, ROW_SIZE, None)
        p, q, v, w, f, actuators = (self._rows[:, a:b] for a, b in pairwise(edges))
        t = self._start + np.arange(n + 1) * step
        return Truth(
            t=t, p=p, q=q, v=v, w=w, f=f, bias=Biases.none(n + 1), actuators=actuators, gravity=world.gravity,
            datum=world.datum, robot=robot.name, start=self._start,
        )  # fmt: skip

    def move(self, until: int, command: Floats | Planned) -> None:
        """Take every step up to `until` [ns] under one command, or as planned."""
        last = int(np.searchsorted(self.truth.t, until, side="right")) - 1
        if self._vehicle is not None and last > self.k:
            if isinstance(command, np.ndarray):
                u = np.empty((last - self.k, command.size))
                u[:] = command
            else:
                u = command.plan(np.asarray((self.truth.t[self.k : last] - self._start) * 1e-9, np.float64))
            u, rows = np.ascontiguousarray(u), slice(self.k + 1, last + 1)
            if self.deck is not None:
                self.deck.move(self.k, last, u, self._x, self._wind, self._ground)
            else:
                self._vehicle.run(self._x, u, self._wind[rows], self._ground, self._rows[rows])
        self.k = last

    @property
    def finite(self) -> bool:
        """Whether the newest row is made of numbers."""
        return all(map(isfinite, (*self.truth.p[self.k].tolist(), *self.truth.v[self.k].tolist())))

    def piece(self, after: int, until: int) -> Truth:
        """The truth from the last row not later than `after` [ns] to the last one not later than `until`."""
        first = max(int(np.searchsorted(self.truth.t, after, side="right")) - 1, 0)
        last = min(int(np.searchsorted(self.truth.t, until, side="right")), self.k + 1)
        return self.truth.select(slice(first, last))
