"""One follower behind one target, closed loop, from a seed: what tells whether a distance holds."""

from dataclasses import dataclass, field
from enum import Enum
from math import cos, inf, pi, sin
from typing import final

import numpy as np

from outrider.errors import ConfigError
from outrider.guidance.pursuit import Pursuit
from outrider.models.motion.following import CONSTANT_VELOCITY, STEP, FollowerModel, lag_step
from outrider.models.vehicles.base import LEVEL, ROW_SIZE
from outrider.models.vehicles.multirotor import Multirotor
from outrider.safety.admissible import Admissible, Fixes, admissible
from outrider.safety.separation import Separation
from outrider.scenarios import chase_steps as steps
from outrider.scenarios.chase_steps import HASTE, PERIOD, SETTINGS, SUBSTEPS, TRACE, fly_chase
from outrider.sim.targets import Behaviour
from outrider.typing import Floats


class Law(Enum):
    """Who steers."""

    PURSUE = "velocity fed forward, distance held, and the filter that keeps the distance below it"
    UNGUARDED = "the same without the filter"
    ZONES = "swarm2023: line of sight between raw fixes, speed by eq. 38, the end of the curve outside the zone"


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Chase:
    """A follower behind a target.

    separation, fixes : see there;  target_speed : m/s;  law : who steers
    start_m : how far behind it starts, at rest;  wind : m/s, ENU;  seconds : of a run
    set_point : m, None : the admissible one;  adapt : m/s, how fast the set-point falls where less is enough; 0 : fixed
    hold_s : s, how long it goes on without a fix of the target;  reacquire_s : how long fixes elsewhere are refused
    far_speed, zone : m/s and m, of swarm2023 outside its rendezvous zone

    Raises ConfigError for what cannot hold its distance, see `outrider.safety.admissible`.
    """

    separation: Separation
    fixes: Fixes = field(default_factory=Fixes)
    target_speed: float = 2.0
    law: Law = Law.PURSUE
    start_m: float = 12.0
    wind: tuple[float, float, float] = (0.0, 0.0, 0.0)
    seconds: float = 60.0
    set_point: float | None = None
    most: float = inf
    adapt: float = 0.2
    hold_s: float = 4.0
    reacquire_s: float = 10.0
    far_speed: float = 3.0
    zone: float = 6.0
    answer: Admissible = field(init=False)

    def __post_init__(self) -> None:
        for name, value in (("1 / rate_hz", 1.0 / self.fixes.rate_hz), ("latency_s", self.fixes.latency_s)):
            if abs(value / PERIOD - round(value / PERIOD)) > 1e-6:
                raise ConfigError(f"{name} is {value:g} s", where="chase", fix=f"a multiple of {PERIOD:g} s")
        if self.law is Law.ZONES:  # promises nothing
            answer = Admissible(set_point=self.separation.distance, least=inf, sigma=inf)
        else:
            answer = admissible(
                self.separation, self.fixes, self.target_speed, set_point=self.set_point, most=self.most
            )
        object.__setattr__(self, "answer", answer)

    def vehicle(self, speed: float) -> Multirotor:
        """Both are alike but for their speed."""
        x = self.separation
        return Multirotor(
            tau_s=x.lag_s, acceleration=x.acceleration, vertical_acceleration=min(x.acceleration, 5.0), speed=speed,
            climb=speed, sink=speed, step_s=PERIOD / SUBSTEPS,
        )  # fmt: skip


@final
class Runs:
    """Runs of one chase; what they need is laid out once."""

    def __init__(self, chase: Chase) -> None:
        x, f = chase.separation, chase.fixes
        self.chase = chase
        self._n = round(chase.seconds / PERIOD)
        self._fixes = int(chase.seconds * f.rate_hz) + 2
        self._own = chase.vehicle(max(x.speed, chase.far_speed) if chase.law is Law.ZONES else x.speed)
        self._target = chase.vehicle(4.0 * max(chase.target_speed, 1.0))
        model = FollowerModel(
            lag=x.lag_s, lag_z=x.lag_s, acceleration=f.own_acceleration, acceleration_z=f.own_acceleration
        )
        self._step = np.zeros((3, STEP))
        lag_step(PERIOD, model.theta(), self._step)
        self._model = FollowerModel(
            lag=CONSTANT_VELOCITY, lag_z=CONSTANT_VELOCITY, acceleration=f.acceleration, acceleration_z=f.acceleration
        ).theta()
        gain = 0.5 / (HASTE * max(x.lag_s, PERIOD))
        self._law = Pursuit(
            speed=x.speed, gain=gain, brake=0.7 * min(x.acceleration, x.speed / max(x.lag_s, PERIOD))
        ).theta()
        self._guard = x.theta()
        self._air = np.tile(np.array(chase.wind, np.float64), (SUBSTEPS, 1))
        self._truth, self._told = np.zeros((self._n, 12)), np.zeros((self._n, 3))
        self._commands, self._rows = np.zeros((2, SUBSTEPS, 4)), np.zeros((2, SUBSTEPS, ROW_SIZE))

    def run(self, behaviour: Behaviour, seed: int) -> Floats:
        """(n, TRACE) one run: everything random comes from the seed."""
        c, rng = self.chase, np.random.default_rng(seed)
        f = c.fixes
        every = round(1.0 / (f.rate_hz * PERIOD))
        heading, behind = rng.uniform(-pi, pi), rng.normal(0.0, 0.3)
        event = rng.uniform(0.5, 0.6) * c.seconds
        sigmas = np.array([f.sigma] * 3 + [f.velocity_sigma if np.isfinite(f.velocity_sigma) else 0.0] * 3)
        noise = rng.normal(size=(2, self._fixes, 6)) * sigmas
        phases = rng.integers(0, every, 2)
        told = {
            steps.S_LAW: tuple(Law).index(c.law), steps.S_BEHAVIOUR: behaviour.code, steps.S_EVENT: event,
            steps.S_SPEED: c.target_speed, steps.S_HEADING: heading, steps.S_EVERY: every,
            steps.S_LATE: round(f.latency_s / PERIOD), steps.S_PHASE: phases[1],
            steps.S_OWN_PHASE: phases[int(c.law is Law.ZONES)],  # the paper reads both receivers at once
            steps.S_SET: c.answer.set_point, steps.S_ADAPT: c.adapt, steps.S_HOLD: c.hold_s,
            steps.S_REACQUIRE: c.reacquire_s, steps.S_SIGMA: f.sigma, steps.S_V_SIGMA: min(f.velocity_sigma, 1e9),
            steps.S_DANGER: c.separation.distance, steps.S_ZONE: c.zone, steps.S_ZONE_SPEED: c.separation.speed,
            steps.S_FAR_SPEED: c.far_speed,
        }  # fmt: skip
        s = np.array([told[i] for i in range(SETTINGS)], np.float64)
        angle = heading + behind
        start = np.array([-c.start_m * cos(angle), -c.start_m * sin(angle), 30.0])
        own = self._own.launch(start, np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(3))
        v = 0.0 if behaviour is Behaviour.HOVER else c.target_speed
        velocity = np.array([v * cos(heading), v * sin(heading), 0.0])
        target = self._target.launch(np.array([0.0, 0.0, 30.0]), np.array([0.0, 0.0, 0.0, 1.0]), velocity)
        trace, marks = np.zeros((self._n, TRACE)), np.full(4, -1, np.int64)
        fly_chase(
            s, own, target, self._own._theta, self._target._theta, self._air, LEVEL, noise, self._step, self._model,
            self._law, self._guard, self._truth, self._told, self._commands, self._rows, np.zeros((4, 6)),
            np.zeros((4, 6, 6)), marks, np.zeros((3, 6)), np.zeros((3, STEP)), trace,
        )  # fmt: skip
        return trace
