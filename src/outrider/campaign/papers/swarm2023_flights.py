"""swarm2023's rendezvous and full mission, seed by seed: the paper's guidance on raw fixes, its filters offline.

The paper's frame: x north, y east. Both receivers are read at once, once a second, `latency` late, and nobody knows;
truth answers commands with a lag. Distances, fixes and filters see what the paper's did.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cache
from math import exp, inf, nan
from typing import Any, Final, Literal, final

import numpy as np

from outrider.campaign.following import Flown, Scene, Tuning, as_designed, as_printed
from outrider.campaign.following_tunings import FULL, VARIANTS, Printed, printed
from outrider.campaign.trials import Params
from outrider.errors import ConfigError
from outrider.eval import chi_square
from outrider.filters.following.runs import EKF, ENKF, UKF, run
from outrider.guidance.los import line_of_sight, zone_speed
from outrider.safety.separation import Separation
from outrider.scenarios.build import build
from outrider.scenarios.chase import Chase, Law, Runs
from outrider.scenarios.chase_steps import C_DISTANCE, C_LEAST
from outrider.scenarios.files import load_scenario
from outrider.scenarios.followed import follows, pursuers
from outrider.sim.targets import Behaviour
from outrider.team.leader import Legs
from outrider.team.trail import Aim, Trail
from outrider.typing import Floats

R_D: Final = 3.0  # m
ZONE: Final = 6.0  # m
V_T: Final = 2.0  # m/s
V_M: Final = 2.5  # m/s
V_FAR: Final = 3.0  # m/s
NOISE: Final = 0.15  # m
TENTHS: Final = 10  # steps of truth a second
SETTLED_S: Final = 3  # s of the start that do not count as an approach
LASTS: Final = {"rendezvous": 45, "mission": 118}
FLOOR: Final = 1.5  # m


def tunings(sign: int) -> dict[str, dict[str, Printed]]:
    """Q and R of sections 4.2 and 4.3 by phase and filter. Exponents of Q have the sign that is asked for, those of R
    are negative: the signs are lost in print."""

    def q(n: int) -> float:
        return 10.0 ** (sign * n)

    ekf = FULL["EKF"]
    return {
        "rendezvous": {
            "EKF": ekf,
            "UKF": printed(0.1, (0.01, 20.0, 1.0, 0.5, 0.5, 1.0, 10.0), q(5), (0.01, 1e-4, 1e-5, 1.0, 1e-5, 1e-5)),
            "EnKF": printed(1.0, (0.001, 100.0, 0.1, 10.0, 1.0, 0.1, 1.0), q(2), (10.0, 1.0, 0.2, 0.5, 0.2, 0.01)),
        },
        "outside": {
            "EKF": ekf,
            "UKF": printed(1.0, (0.001, 0.001, 0.1, 5.0, 5.0, 5.0, 1.0), q(2), (0.1, 0.1, 0.1, 1.0, 1.0, 0.01)),
            "EnKF": printed(1.0, (0.001, 5.0, 0.1, 5.0, 5.0, 0.1, 1.0), q(5), (1.0, 5e-5, 1e-5, 1.0, 1e-5, 1e-5)),
        },
        "inside": {
            "EKF": ekf,
            "UKF": printed(1e-2, (0.05, 0.05, 0.005, 0.05, 0.05, 5.0, 0.001), q(1), (1.0, 1.0, 1.0, 10.0, 10.0, 1.0)),
            "EnKF": printed(0.1, (1.0, 1.0, 1.0, 1.0, 1.0, 5.0, 10.0), q(2), (1.0, 1.0, 1.0, 10.0, 1.0, 0.05)),
        },
    }


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Approach:
    """What is flown. variant : how the paper's model is read;  sign : of the exponents of its Q;  aim : which point of
    the curve is flown at outside."""

    flight: Literal["rendezvous", "mission"] = "rendezvous"
    latency: float = 0.3  # s, fitted to table 2
    tau: float = 1.0  # s, likewise
    variant: str = "lag"
    sign: int = -1
    aim: Literal["points", "end"] = "end"


@final
@dataclass(frozen=True, slots=True)
class Course:
    """A flight by seconds, and the true distance every tenth of one."""

    flown: Flown
    target: Floats  # (K, 3) its fixes, as they came
    apart: Floats  # (10 K,) m, true
    v_target: Floats  # (K,) m/s, true


def approach(params: Params, seed: int) -> Mapping[str, Any]:
    """One flight by the paper's law. params : fields of `Approach`.

    Returns for GPS, EKF, UKF and EnKF (the paper's tunings) and `honest` (one lag model, the true noise, fixes where
    they were taken) the RMSE in space [m] `outside` and `inside` (until and after the danger zone is reached, of a
    mission the rendezvous zone) and `time` [s] to 3 m; the least true distance, the time inside R_d, times to 6 m.
    """
    unknown = sorted(set(params) - {f.name for f in fields(Approach)})
    if unknown:
        raise ConfigError(f"no parameter '{unknown[0]}' of approach", fix="name a field of Approach")
    a = Approach(**dict(params))  # type: ignore[arg-type]
    course = fly(a, seed)
    flown, x = course.flown, course.flown.x[:, :3]
    entered = _first(np.linalg.norm(course.target - flown.fix, axis=1), ZONE if a.flight == "mission" else R_D)
    out = {**_separation(course), **_scored("GPS", flown.fix, course, entered)}
    far = replace(flown, came=np.arange(len(x)) < (entered if a.flight == "mission" else inf))
    scene = Scene(seconds=len(x) - 1, latency=a.latency, lag=a.tau)
    tuned, phases = tunings(a.sign), ("outside", "inside") if a.flight == "mission" else ("rendezvous",) * 2
    for kind in (EKF, UKF, ENKF):
        log, start, spread, rows = as_printed(far, VARIANTS[a.variant], scene, *(tuned[p][kind.name] for p in phases))
        track = run(kind, log, start, spread, np.random.default_rng((seed, 1)))
        out |= _scored(kind.name, np.vstack([start[:3], track.x[rows, :3]]), course, entered)
    log, start, spread, rows = as_designed(flown, scene, Tuning(lag=a.tau, direction=False))
    track = run(EKF, log, start, spread)
    nees = chi_square(track.x[rows, :6] - flown.x[1:], track.P[rows][:, :6, :6]) / 6.0
    return {**out, **_scored("honest", np.vstack([start[:3], track.x[rows, :3]]), course, entered),
            "honest_nees": float(nees.mean())}  # fmt: skip


@cache
def target_way(flight: str) -> Floats:
    """(n, 3) m, x north, y east: where the target is every tenth of a second."""
    corners = [[0.0, 100.0, 7.0]] if flight == "rendezvous" else [[0.0, 150.0, 7.0], [-100.0, 150.0, 7.0]]
    way = np.array(corners)
    legs = Legs(waypoints=way, speeds=np.full(len(way), V_T), waits_s=np.zeros(len(way)), corner=0.3)
    return legs.path(np.array([0.0, 7.0, 7.0]), LASTS[flight] + 1.0, 1.0 / TENTHS, 0.5, 5.0)


def fly(a: Approach, seed: int) -> Course:
    """swarm2023, algorithms 2 and 3: outside the zone along the trail's curve, inside by eq. 38 (made continuous)."""
    rng, way, K, h = np.random.default_rng(seed), target_way(a.flight), LASTS[a.flight], 1.0 / TENTHS
    noise, nose_noise = NOISE * rng.normal(size=(2, K, 3)), 0.1 * rng.normal(size=K)
    p, v = np.array([-5.0 if a.flight == "rendezvous" else 20.0, 7.0, 7.0]), np.zeros(3)
    late, keep = round(a.latency * TENTHS), exp(-h / a.tau)
    reach = a.tau * (1.0 - keep)
    past, apart = [p.copy()] * (late + 1), np.zeros(K * TENTHS)
    x, fix, seen, u, nose = np.zeros((K, 6)), np.zeros((K, 3)), np.zeros((K, 3)), np.zeros((K, 3)), np.zeros(K)
    trail = Trail(degree=3, aim_at=Aim[a.aim.upper()])
    for k in range(K):
        x[k] = [*p, *v]
        fix[k] = past[-1 - late] + noise[0, k]
        seen[k] = way[max(k * TENTHS - late, 0)] + noise[1, k]
        nose[k] = np.arctan2(v[1], v[0]) + nose_noise[k]
        trail.see(float(k), seen[k])
        far = float(np.linalg.norm(seen[k] - fix[k]))
        outside = a.flight == "mission" and far > ZONE
        at = trail.aim(fix[k]) if outside else None
        speed = V_FAR if outside else float(zone_speed(far, R_D, V_T, V_M))
        line_of_sight(fix[k], seen[k] if at is None else np.ascontiguousarray(at), speed, u[k])
        for i in range(k * TENTHS, (k + 1) * TENTHS):
            apart[i] = np.linalg.norm(way[i] - p)
            p, v = p + u[k] * (h - reach) + v * reach, u[k] + (v - u[k]) * keep
            past.append(p)
    flown = Flown(x, fix, np.ones(K, np.bool_), u, nose, np.zeros(K))
    speed = np.linalg.norm(np.gradient(way, h, axis=0), axis=1)[: K * TENTHS : TENTHS]
    return Course(flown, seen, apart, speed)


def _first(distance: Floats, limit: float) -> float:
    """The first second from `SETTLED_S` on with a distance within a limit; infinite if there is none."""
    hits = np.flatnonzero(distance[SETTLED_S:] <= limit)
    return float(hits[0] + SETTLED_S) if hits.size else inf


def _scored(name: str, p: Floats, course: Course, entered: float) -> dict[str, float]:
    """RMSE in space before and after the zone was entered, and when the distance by that estimate was 3 m."""
    square = ((p - course.flown.x[:, :3]) ** 2).sum(axis=1)
    k = np.arange(len(p))
    before, after = square[(k < entered) & (k > 0)], square[k >= entered]
    time = _first(np.linalg.norm(course.target - p, axis=1), R_D)
    return {
        f"{name}_outside": float(np.sqrt(before.mean())) if before.size else nan,
        f"{name}_inside": float(np.sqrt(after.mean())) if after.size else nan,
        f"{name}_time": time if np.isfinite(time) else nan,
    }


def _separation(course: Course) -> dict[str, float]:
    """True distances: the least, the share of time inside R_d from the first 6 m on, times to 6 m and to 1.15 R_d."""
    d = course.apart
    near, close = (np.flatnonzero(d[SETTLED_S * TENTHS :] <= m) + SETTLED_S * TENTHS for m in (ZONE, 1.15 * R_D))
    later = d[near[0] :] if near.size else np.zeros(0)
    return {
        "least": float(d[SETTLED_S * TENTHS :].min()), "violated": float(d.min() < R_D),
        "inside_share": float((later < R_D).mean()) if later.size else nan,
        "to_zone": near[0] / TENTHS if near.size else nan, "to_near": close[0] / TENTHS if close.size else nan,
    }  # fmt: skip


def principled(params: Params, seed: int) -> Mapping[str, Any]:
    """One whole simulation of a scenario of swarm2023. params : `scenario`, and its settings by dotted key.

    Returns the least true distance and whether it was below R_d, the share of time inside, times to 6 m and to the
    set-point plus 1 m, mean and spread of the distance from then on while it follows (not while it searches), its share
    of the time, and the RMSE of the estimate [m].
    """
    given = dict(params)
    name = str(given.pop("scenario"))
    cast = build(*load_scenario(name, {**given, "seed": seed}))
    done = cast.run()
    agent = pursuers(cast)["follower"]
    own, target = done.truth["follower"], done.truth["target"]
    t = np.arange(done.monitor.start, done.ended + 1, 100_000_000)
    d = np.linalg.norm(own.at(t).p - target.at(t).p, axis=1)
    goal = agent.flown.set_point[-1]
    near, held = (np.flatnonzero(d[SETTLED_S * TENTHS :] <= m) + SETTLED_S * TENTHS for m in (ZONE, goal + 1.0))
    e = done.log.streams["follower/estimate"]
    off = np.linalg.norm(e.z[:, :3] - own.at(e.t).p, axis=1)
    following = follows(agent, t)
    later = d[held[0] :][following[held[0] :]] if held.size else np.zeros(0)
    return {
        "least": float(d[SETTLED_S * TENTHS :].min()), "violated": float(d.min() < R_D),
        "inside_share": float((d < R_D).mean()), "to_zone": near[0] / TENTHS if near.size else nan,
        "to_set_point": held[0] / TENTHS if held.size else nan, "set_point": goal,
        "mean": float(later.mean()) if later.size else nan, "sd": float(later.std()) if later.size else nan,
        "following": float(following[held[0] :].mean()) if held.size else nan,
        "rmse": float(np.sqrt((off**2).mean())), "collided": float(done.hit is not None),
    }  # fmt: skip


@cache
def _runs(law: str) -> Runs:
    separation = Separation(distance=R_D, lag_s=1.0, speed=V_M)
    return Runs(Chase(separation=separation, law=Law[law.upper()], start_m=20.0, seconds=90.0, far_speed=V_FAR))


def chased(params: Params, seed: int) -> Mapping[str, Any]:
    """One compiled chase from 20 m behind, fixes of 1 Hz that are 0.3 s late. params : `law` and the target's
    `behaviour`, by their names.

    Returns the least true distance after the start, whether it was below R_d, the share of time inside after the first
    6 m, the time to the set-point plus 1 m.
    """
    runs = _runs(str(params["law"]))
    trace = runs.run(Behaviour[str(params["behaviour"]).upper()], seed)
    least, d = trace[SETTLED_S * TENTHS :, C_LEAST], trace[:, C_DISTANCE]
    near, held = (
        np.flatnonzero(d[SETTLED_S * TENTHS :] <= m) + SETTLED_S * TENTHS
        for m in (ZONE + 1.0, runs.chase.answer.set_point + 1.0)
    )
    return {
        "least": float(least.min()), "violated": float(least.min() < R_D),
        "inside_share": float((d[near[0] :] < R_D).mean()) if near.size else nan,
        "to_set_point": held[0] / TENTHS if held.size else nan,
        "mean": float(d[held[0] :].mean()) if held.size else nan, "set_point": runs.chase.answer.set_point,
    }  # fmt: skip
