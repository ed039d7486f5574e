"""Flights of a follower for the comparison of filters: truth, records and commands.

swarm2023's localisation: the target goes along four waypoints at 2 m/s, the follower flies towards it at 1 m/s on raw
fixes of 1 Hz, or on estimates; truth answers its commands with a lag, gusts and a wind.
"""

from dataclasses import dataclass
from typing import Final, final

import numpy as np

from outrider._kernel import kernel
from outrider.filters.following import Following, RelativeFilter
from outrider.models.motion.following import STEP, FollowerModel, lag_step
from outrider.typing import Bools, Floats

STEPS: Final = 10  # of truth, a second
SLOWEST: Final = 0.4  # m/s, below which nobody takes the nose for a direction of flight
WAYPOINTS: Final = np.array([[0.0, 7.0, 7.0], [10.0, 9.0, 7.0], [13.0, 25.0, 7.0], [15.0, 1.0, 7.0]])
START: Final = np.array([-3.0608, 7.173, 7.0])


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """What happens. latency [s] of fixes, a multiple of 0.1;  outage : fixes lost from `outage_from` for so long [s];
    guided : by raw fixes, as swarm2023's drone, or by what `FollowerFilter` makes of ours and the target's."""

    seconds: int = 30
    latency: float = 0.0
    outage: int = 0
    outage_from: int = 9
    wind: float = 0.0  # m/s, from the start, from a side drawn by lot
    gust: float = 0.1  # m/s^2 per sqrt(Hz), horizontal; half of it vertically
    lag: float = 0.5  # s
    sigma: float = 0.15  # m, fixes, each axis
    heading: float = 0.1  # rad
    guided: str = "fixes"  # or "estimate"


@final
@dataclass(frozen=True, slots=True)
class Flown:
    """At every second k: truth (K, 6), fixes as they came (K, 3), whether one came (K,), commands from then on (K, 3),
    direction of the nose (K,) [rad], and how far the command was off the true line to the target (K,) [rad]."""

    x: Floats
    fix: Floats
    came: Bools
    u: Floats
    nose: Floats
    aim: Floats


def fly(scene: Scene, seed: int) -> Flown:
    """Truth, records and commands of a flight; raw fixes are held while there are none."""
    rng, h, K = np.random.default_rng(seed), 1.0 / STEPS, scene.seconds + 1
    c = np.zeros((3, STEP))
    truth = FollowerModel(
        lag=scene.lag, lag_z=scene.lag, acceleration=max(scene.gust, 1e-9), acceleration_z=0.5 * scene.gust
    )
    lag_step(h, truth.theta(), c)
    roots = np.zeros((3, 3))
    roots[0] = np.sqrt(c[:, 4])
    roots[1] = c[:, 5] / np.maximum(roots[0], 1e-300)
    roots[2] = np.sqrt(np.maximum(c[:, 6] - roots[1] ** 2, 0.0))
    shocks = rng.normal(size=(K * STEPS, 2, 3))
    noise, nose_noise = scene.sigma * rng.normal(size=(K, 3)), scene.heading * rng.normal(size=K)
    seen = target(np.arange(0.0, K) - scene.latency) + scene.sigma * rng.normal(size=(K, 3))
    side = rng.uniform(-np.pi, np.pi)
    wind = scene.wind * np.array([np.cos(side), np.sin(side), 0.0])
    late = round(scene.latency * STEPS)
    p, v, path = START.copy(), np.zeros(3), np.zeros((K * STEPS, 3))
    x, fix, u, nose, aim = np.zeros((K, 6)), np.zeros((K, 3)), np.zeros((K, 3)), np.zeros(K), np.zeros(K)
    own, goals = (_Onboard(scene) if scene.guided == "estimate" else None), target(np.arange(0.0, K))
    came = np.ones(K, np.bool_)
    came[scene.outage_from : scene.outage_from + scene.outage] = False
    for k in range(K):
        x[k] = [*p, *v]
        taken = path[k * STEPS - late - 1] if k else p
        fix[k] = taken + noise[k] if came[k] else fix[k - 1]
        air = v - wind
        nose[k] = np.arctan2(air[1], air[0]) + nose_noise[k]
        here, there = fix[k], seen[k]
        if own is not None:
            here, there = own.see(k, fix[k] if came[k] else None, seen[k], nose[k])
        line = there[:2] - here[:2]
        u[k, :2] = line / max(float(np.hypot(*line)), 1e-9)
        if own is not None:
            own.pair.own.add_command(float(k), u[k])
        true = goals[k, :2] - p[:2]
        aim[k] = np.arctan2(u[k, 0] * true[1] - u[k, 1] * true[0], u[k, :2] @ true)
        rows = slice(k * STEPS, (k + 1) * STEPS)
        answer(p, v, u[k] + wind, c, roots, shocks[rows], path[rows])
    return Flown(x, fix, came, u, nose, aim)


@final
class _Onboard:
    """What guides on estimates: ours, and the target's brought up to now."""

    def __init__(self, scene: Scene) -> None:
        gust = max(scene.gust, 0.05)
        model = FollowerModel(lag=scene.lag, lag_z=scene.lag, acceleration=gust, acceleration_z=0.5 * gust, wind=0.005)
        target = FollowerModel.target(acceleration=0.5, turn=1.0, acceleration_z=0.1)
        self.pair = RelativeFilter(model, target, Following(velocity=0.05, wind=0.2, slowest=SLOWEST))
        self.scene = scene

    def see(self, k: int, fix: Floats | None, seen: Floats, nose: float) -> tuple[Floats, Floats]:
        """(p, p of the target) at second k, from what has come."""
        taken, s = max(k - self.scene.latency, 0.0), self.scene
        r = np.full(3, s.sigma**2)
        if fix is not None:
            self.pair.own.add_fix(taken, fix, r)
        self.pair.own.add_course(float(k), nose, s.heading**2, heading=True)
        self.pair.target.add_fix(taken, seen, r)
        return self.pair.own.belief(float(k)).p, self.pair.target.belief(float(k)).p


@kernel
def answer(p: Floats, v: Floats, pull: Floats, c: Floats, roots: Floats, shocks: Floats, path: Floats) -> None:
    """p, v (3,) <- after as many steps c (3, STEP) as shocks (steps, 2, 3) has; path (steps, 3) <- where it has been.

    roots (3, 3): Cholesky factor (p p, v p, v v) of a step's noise, axes in columns.
    """
    for k in range(shocks.shape[0]):
        for i in range(3):
            e, f = shocks[k, 0, i], shocks[k, 1, i]
            p[i] += c[i, 0] * v[i] + c[i, 2] * pull[i] + roots[0, i] * e
            v[i] = c[i, 1] * v[i] + c[i, 3] * pull[i] + roots[1, i] * e + roots[2, i] * f
            path[k, i] = p[i]


def target(t: Floats) -> Floats:
    """(n, 3) where the target is at t [s]: along the waypoints at 2 m/s, from and to a stop."""
    legs = np.linalg.norm(np.diff(WAYPOINTS, axis=0), axis=1)
    s = np.concatenate([[0.0], np.cumsum(legs)])
    return np.column_stack([np.interp(2.0 * t, s, WAYPOINTS[:, i]) for i in range(3)])
