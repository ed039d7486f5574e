"""Three Kalman filters on the same flights of a following drone: same model, same Q and R, same records.

The flight is swarm2023's localisation: the target goes along four waypoints at 2 m/s, the follower flies towards the
target's last fix at 1 m/s on raw fixes of 1 Hz, or on estimates; truth answers its commands with a lag, gusts and a
wind. Every filter gets the commands, the fixes and the direction of the nose, and nothing else.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Final, final

import numpy as np

from outrider._kernel import kernel
from outrider.campaign.following_tunings import BLOCKED, FULL, VARIANTS
from outrider.campaign.trials import Params
from outrider.errors import ConfigError
from outrider.eval import chi_square
from outrider.filters.following import Following, RelativeFilter
from outrider.filters.following.records import Log, Seen, Track
from outrider.filters.following.runs import EKF, ENKF, UKF, Kind, run, smoothed
from outrider.models.motion.following import STEP, FollowerModel, Variant, lag_step, literal_step
from outrider.typing import Bools, Floats

STEPS: Final = 10  # of truth, a second
SLOWEST: Final = 0.4  # m/s, below which nobody takes the nose for a direction of flight
WAYPOINTS: Final = np.array([[0.0, 7.0, 7.0], [10.0, 9.0, 7.0], [13.0, 25.0, 7.0], [15.0, 1.0, 7.0]])
START: Final = np.array([-3.0608, 7.173, 7.0])
ROOT: Final = Kind("EnKF root", members=900, square_root=True)
SMALL: Final = Kind("EnKF 50", members=50)
SMALL_ROOT: Final = Kind("EnKF root 20", members=20, square_root=True)
KINDS: Final = {k.name: k for k in (EKF, UKF, ENKF, ROOT, SMALL, SMALL_ROOT)}


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
@dataclass(frozen=True, slots=True, kw_only=True)
class Tuning:
    """What filters are told. by : "honest" (what is true of fixes, `acceleration` for gusts and all that is not), or
    "printed" (the paper's own for each), or one filter's printed one for all ("EKF", "UKF")."""

    by: str = "honest"
    variant: str = "lag"
    lag: float = 0.5
    acceleration: float = 0.1
    sigma: float = 0.15
    wind: float = 0.0  # m/s at the start, each horizontal axis; above zero it is a state
    wind_walk: float = 0.005  # m/s per sqrt(s)
    compensated: bool = True  # fixes are placed where they were taken
    direction: bool = True  # the nose tells the direction of flight
    blind: bool = False  # but not while there are no fixes


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


def following(params: Params, seed: int) -> Mapping[str, Any]:
    """One flight. params : fields of `Scene`, those of `Tuning` with `tuned_` before their name, and `kinds`, a list of
    names in `KINDS` (EKF, UKF, EnKF).

    Returns for "GPS", each filter and "RTS" (with EKF): RMSE x, y, xy, xyz [m] over the seconds, the error `end` [m]
    when the last lost fix is due; for filters `nees` per degree of freedom of position and velocity, and `likelihood`
    of a second. Also `aim` [deg], RMS of the command's direction off the true line to the target.
    """
    scene, tuning, kinds = _read(params)
    flown = fly(scene, seed)
    out = _scores("GPS", flown.fix - flown.x[:, :3], scene)
    out["aim"] = float(np.degrees(np.sqrt(np.mean(flown.aim[1:] ** 2))))
    for kind in kinds:
        log, x0, P0, rows = records(flown, scene, tuning, kind.name)
        track = run(kind, log, x0, P0, np.random.default_rng((seed, kind.members, 1)))
        out |= _measured(kind.name, track, flown, scene, rows)
        if kind is EKF and tuning.by == "honest":
            back = smoothed(log, track)
            e = np.zeros((flown.x.shape[0], 3))
            e[1:] = back.x[rows, :3] - flown.x[1:, :3]
            out |= _scores("RTS", e, scene)
    return out


def _read(params: Params) -> tuple[Scene, Tuning, list[Kind]]:
    given: dict[str, Any] = dict(params)
    names = given.pop("kinds", ["EKF", "UKF", "EnKF"])
    tuned = {k.removeprefix("tuned_"): given.pop(k) for k in list(given) if k.startswith("tuned_")}
    for have, allowed in ((given, Scene), (tuned, Tuning)):
        strange = sorted(set(have) - {f.name for f in fields(allowed)})
        if strange:
            raise ConfigError(f"no parameter '{strange[0]}' of following", fix="name a field of Scene or Tuning")
    if given.get("guided", "fixes") not in ("fixes", "estimate"):
        raise ConfigError(f"guided by '{given['guided']}'", fix="fixes or estimate")
    unknown = [n for n in names if n not in KINDS]
    if unknown:
        raise ConfigError(f"no filter '{unknown[0]}'", fix=f"there are: {', '.join(KINDS)}")
    return Scene(**given), Tuning(**tuned), [KINDS[n] for n in names]


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


def records(flown: Flown, scene: Scene, tuning: Tuning, name: str) -> tuple[Log, Floats, Floats, Any]:
    """What a filter gets, (log, x0, P0), and which events are the seconds 1, 2, ..."""
    if tuning.by == "honest":
        return _honest(flown, scene, tuning)
    full, blocked = (FULL[name], BLOCKED[name]) if tuning.by == "printed" else (FULL[tuning.by], BLOCKED[tuning.by])
    return _as_printed(flown, VARIANTS[tuning.variant], scene, full, blocked)


def _honest(flown: Flown, scene: Scene, tuning: Tuning) -> tuple[Log, Floats, Floats, Any]:
    """Two events a second: the fix where it was taken, and the end of the second with the nose."""
    K, age = flown.x.shape[0] - 1, scene.latency if tuning.compensated else 0.0
    model = FollowerModel(
        lag=tuning.lag, lag_z=tuning.lag, acceleration=tuning.acceleration, acceleration_z=0.5 * tuning.acceleration,
        wind=tuning.wind_walk if tuning.wind > 0.0 else 0.0,
    )  # fmt: skip
    lengths = np.array([1.0 - age, age])
    C = np.zeros((2, 3, STEP))
    for c, dt in zip(C, lengths, strict=True):
        lag_step(float(dt), model.theta(), c)
    z, r, kind = np.zeros((2 * K, 6)), np.full((2 * K, 6), np.inf), np.zeros(2 * K, np.int64)
    came = flown.came[1:]
    z[0::2, :3], z[1::2, 3] = flown.fix[1:], flown.nose[1:]
    r[0::2, :3] = np.where(came[:, None], tuning.sigma**2, np.inf)
    r[1::2, 3] = scene.heading**2
    kind[1::2] = np.where(tuning.direction & (came | (not tuning.blind)), int(Seen.ANGLE), int(Seen.NOTHING))
    log = Log(np.tile(np.array([0, 1], np.int64), K), np.repeat(flown.u[:-1], 2, axis=0), kind, z, r, C, lengths, 0.4)
    n = 9 if tuning.wind > 0.0 else 6
    x0, P0 = np.zeros(n), np.zeros((n, n))
    x0[:3] = flown.fix[0]
    P0[np.diag_indices(n)] = np.array([tuning.sigma**2] * 3 + [0.05**2] * 3 + [tuning.wind**2] * 2 + [1e-6])[:n]
    return log, x0, P0, slice(1, None, 2)


def _as_printed(
    flown: Flown, variant: Variant, scene: Scene, full: Any, blocked: Any
) -> tuple[Log, Floats, Floats, Any]:
    """One event a second, latency ignored, the last fix held and its distance zero while none comes: swarm2023 4.1."""
    K = flown.x.shape[0] - 1
    C = np.zeros((2, 3, STEP))
    for c, q in zip(C, (full.q, blocked.q), strict=True):
        if variant is Variant.LAG:
            lag_step(1.0, FollowerModel(lag=scene.lag, lag_z=scene.lag).theta(), c)
            c[:, 4:] = 0.0
            c[:, 4], c[:, 6] = q[:3], q[3:]
        else:
            c[...] = literal_step(1.0, q)
    came = flown.came[1:]
    z = np.zeros((K, 6))
    z[:, :3], z[:, 3], z[:, 4] = flown.fix[1:], np.cos(flown.nose[1:]), np.sin(flown.nose[1:])
    z[:, 5] = np.hypot(*np.diff(flown.fix[:, :2], axis=0).T)
    r = np.where(came[:, None], full.r, blocked.r)
    step = np.where(came, 0, 1).astype(np.int64)
    kind = np.full(K, int(Seen.PRINTED), np.int64)
    log = Log(step, np.ascontiguousarray(variant.inputs(flown.u[:-1])), kind, z, r, C, np.ones(2), 0.1)
    return log, np.concatenate([flown.fix[0], np.zeros(3)]), np.diag(full.r[[0, 1, 2, 3, 4, 4]]), slice(None)


def _measured(name: str, track: Track, flown: Flown, scene: Scene, rows: Any) -> dict[str, float]:
    x, P = track.x[rows], track.P[rows]
    e = np.zeros((flown.x.shape[0], 3))
    e[1:] = x[:, :3] - flown.x[1:, :3]
    nees = chi_square(x[:, :6] - flown.x[1:], P[:, :6, :6]) / 6.0
    return {
        **_scores(name, e, scene), f"{name}_nees": float(nees.mean()),
        f"{name}_likelihood": float(track.likelihood.sum() / (flown.x.shape[0] - 1)),
    }  # fmt: skip


def _scores(name: str, e: Floats, scene: Scene) -> dict[str, float]:
    """RMSE from the first second on, and the error when the last lost fix is due (NaN without an outage)."""
    x, y, z = (e[1:] ** 2).mean(axis=0)
    end = float(np.linalg.norm(e[scene.outage_from + scene.outage - 1])) if scene.outage else np.nan
    return {
        f"{name}_x": float(np.sqrt(x)), f"{name}_y": float(np.sqrt(y)), f"{name}_xy": float(np.sqrt(x + y)),
        f"{name}_xyz": float(np.sqrt(x + y + z)), f"{name}_end": end,
    }  # fmt: skip
