"""Three Kalman filters on the same flights of a following drone: same model, same Q and R, same records.

Every filter gets the commands, the fixes and the direction of the nose, and nothing else.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Final, final

import numpy as np

from outrider.campaign.following_flights import Flown, Scene, fly
from outrider.campaign.following_tunings import BLOCKED, FULL, VARIANTS
from outrider.campaign.trials import Params
from outrider.errors import ConfigError
from outrider.eval import chi_square
from outrider.filters.following.records import Log, Seen, Track
from outrider.filters.following.runs import EKF, ENKF, UKF, Kind, run, smoothed
from outrider.models.motion.following import STEP, FollowerModel, Variant, lag_step, literal_step
from outrider.typing import Floats

ROOT: Final = Kind("EnKF root", members=900, square_root=True)
SMALL: Final = Kind("EnKF 50", members=50)
SMALL_ROOT: Final = Kind("EnKF root 20", members=20, square_root=True)
KINDS: Final = {k.name: k for k in (EKF, UKF, ENKF, ROOT, SMALL, SMALL_ROOT)}


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


def records(flown: Flown, scene: Scene, tuning: Tuning, name: str) -> tuple[Log, Floats, Floats, Any]:
    """What a filter gets, (log, x0, P0), and which events are the seconds 1, 2, ..."""
    if tuning.by == "honest":
        return as_designed(flown, scene, tuning)
    full, blocked = (FULL[name], BLOCKED[name]) if tuning.by == "printed" else (FULL[tuning.by], BLOCKED[tuning.by])
    return as_printed(flown, VARIANTS[tuning.variant], scene, full, blocked)


def as_designed(flown: Flown, scene: Scene, tuning: Tuning) -> tuple[Log, Floats, Floats, Any]:
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


def as_printed(
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
