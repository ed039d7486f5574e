"""Trials of coop2024's two robots: how wrong each estimate is, and whether it knows."""

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any, Final

import numpy as np

from outrider.campaign.trials import Params
from outrider.core.angles import wrap_all
from outrider.core.rotations import quats_to_matrices, rpy_to_quats
from outrider.errors import ConfigError
from outrider.eval import chi_square
from outrider.filters.cooperative import FALSE_ALARM, Method, TeamEstimate, fuse_team
from outrider.models.motion import LAYOUTS, Motion
from outrider.scenarios.inspection import Faults, Tours, Tuning, common, crew, sense, tours
from outrider.scenarios.radio import Places, fuse_by_radio
from outrider.sim.radio import Radio
from outrider.typing import Floats

EVERY_S: Final = 0.1  # of the errors
NEES_EVERY: Final = 10  # of those, how many there are to one NEES
PAPER: Final = {
    "gnss_bias": 0.41, "aircraft": 0.2, "gravity": False, "gyro_bias": 2e-4,
    "tuned_gyro_bias": 2e-4, "printed": True,
}  # fmt: skip
"""The world in which coop2024's numbers come out: papers.md fitted the two biases, so a match explains, not proves."""


def cooperation(params: Params, seed: int) -> Mapping[str, Any]:
    """One run of 180 s. params : method, fields of `Faults`, and fields of `Tuning` with `tuned_` before their name
    (`printed`, `printed_odometry`, `consider` and `common_tuning` without); loss (share), delay_s, jitter_s of the
    radio that `distributed` then talks by; without any, telegrams are there at once.

    Returns means and spreads over time of errors: position [m], heading, yaw, tilt and attitude [deg], velocity [m/s],
    rate [deg/s]; NEES per degree of freedom of the pose, its mean and once a second.
    """
    done, told, times = _run(params, seed)
    means = {k: v for name, e in series(done, times).items() for k, v in _spread(name, e).items()}
    honest = {k: v for name in done.members for k, v in _honesty(name, *_pose(done, name, times)).items()}
    return {**means, **honest, **told}


def over_time(params: Params, seed: int) -> tuple[Floats, dict[str, Floats]]:
    """Times (n,) [s] and every error (n,) of one run; see `cooperation`."""
    done, _, times = _run(params, seed)
    return times, series(done, times)


def _run(params: Params, seed: int) -> tuple[TeamEstimate, dict[str, float], Floats]:
    given: dict[str, Any] = dict(params)
    on_air = {name: float(given.pop(name)) for name in ("loss", "delay_s", "jitter_s") if name in given}
    method, faults, tuning = _read(given)
    if on_air and method is not Method.DISTRIBUTED:
        raise ConfigError(f"{method.name.lower()} does not talk by radio", fix="set method to distributed")
    way = tours()
    times = np.arange(1, round(way.t[-1] / EVERY_S) + 1) * EVERY_S
    false_alarm = 0.0 if tuning.printed else FALSE_ALARM
    members, sources, shared = crew(seed, tuning), sense(seed, faults, tuning), common(tuning)
    told: dict[str, float] = {}
    if not on_air:
        done = fuse_team(members, sources, method, times, shared=shared, start=0.0, false_alarm=false_alarm)
    else:
        radio = Radio(
            loss=on_air.get("loss", 0.0), latency_s=on_air.get("delay_s", 0.02), jitter_s=on_air.get("jitter_s", 0.0)
        )
        heard = fuse_by_radio(
            members, sources, times, radio, seed, shared=shared, start=0.0, false_alarm=false_alarm, places=_places(way)
        )
        done = heard.estimate
        told = {
            "telegrams": heard.telegrams, "received": heard.received, "sent_mb": heard.sent_bytes * 1e-6,
            "refused": heard.refused.total(), "isolated": len(heard.isolated),
        }  # fmt: skip
    return done, told, times


def _places(way: Tours) -> Places:
    def here(t: float) -> Mapping[str, Floats]:
        row = min(round(t * 100.0), way.t.size - 1)
        return {name: way.of(name).p[row] for name in ("ugv", "uav")}

    return here


def _read(params: Params) -> tuple[Method, Faults, Tuning]:
    given: dict[str, Any] = dict(params)
    method = Method[str(given.pop("method")).upper()]
    faults, tuning = Faults(), Tuning()
    for name, value in given.items():
        own = {**{n: n for n in ("printed", "printed_odometry", "consider")}, "common_tuning": "common"}.get(name)
        own = own or name.removeprefix("tuned_")
        if name in {f.name for f in fields(Faults)}:
            faults = replace(faults, **{name: value})
        elif own in {f.name for f in fields(Tuning)}:
            tuning = replace(tuning, **{own: value})
        else:
            raise ConfigError(f"no parameter '{name}' of cooperation", fix="name a field of Faults or Tuning")
    return method, faults, tuning


def series(done: TeamEstimate, times: Floats) -> dict[str, Floats]:
    """Errors (n,) of both robots: position [m], heading, yaw, tilt and attitude [deg], velocity [m/s], rate [deg/s]."""
    return {**_ground(done, times), **_air(done, times)}


def _pose(done: TeamEstimate, name: str, times: Floats) -> tuple[Floats, Floats]:
    """Errors (n, p) of position and heading, and their covariances."""
    x, truth, flies = done.x[name], tours().of(name).select(_rows(times)), name == "uav"
    layout = LAYOUTS[Motion.EULER if flies else Motion.DRIFTING]
    R = quats_to_matrices(truth.q)
    turn = x[:, layout.state("yaw" if flies else "heading")][:, 0] - np.arctan2(R[:, 1, 0], R[:, 0, 0])
    e = np.column_stack([x[:, layout.state("position")] - truth.p[:, : 3 if flies else 2], wrap_all(turn)])
    return e, done.pose_covariance(name)


def _ground(done: TeamEstimate, times: Floats) -> dict[str, Floats]:
    layout, x, truth = LAYOUTS[Motion.DRIFTING], done.x["ugv"], tours().ugv.select(_rows(times))
    e = _pose(done, "ugv", times)[0]
    turned = x[:, layout.state("yaw_rate")][:, 0] - truth.w[:, 2]
    return {
        "ugv_position": np.hypot(e[:, 0], e[:, 1]),
        "ugv_heading": np.degrees(np.abs(e[:, 2])),
        "ugv_velocity": np.linalg.norm(x[:, layout.state("velocity")] - truth.v[:, :2], axis=1),
        "ugv_rate": np.degrees(np.abs(turned)),
    }


def _air(done: TeamEstimate, times: Floats) -> dict[str, Floats]:
    layout, x, truth = LAYOUTS[Motion.EULER], done.x["uav"], tours().uav.select(_rows(times))
    R = quats_to_matrices(truth.q)
    angles = np.column_stack([x[:, layout.state(name)][:, 0] for name in ("yaw", "pitch", "roll")])
    e = _pose(done, "uav", times)[0]
    estimated = quats_to_matrices(rpy_to_quats(np.ascontiguousarray(angles[:, ::-1])))
    trace = np.clip(0.5 * (np.einsum("nij,nij->n", R, estimated) - 1.0), -1.0, 1.0)
    tilt = np.arccos(np.clip(np.sum(R[:, 2] * estimated[:, 2], axis=1), -1.0, 1.0))
    rate = _body_rates(angles, x[:, layout.state("euler_rate")])
    return {
        "uav_position": np.linalg.norm(e[:, :3], axis=1),
        "uav_yaw": np.degrees(np.abs(e[:, 3])),
        "uav_tilt": np.degrees(tilt),
        "uav_attitude": np.degrees(np.arccos(trace)),
        "uav_velocity": np.linalg.norm(x[:, layout.state("velocity")] - truth.v, axis=1),
        "uav_rate": np.degrees(np.linalg.norm(rate - truth.w, axis=1)),
    }


def _rows(times: Floats) -> Any:
    return np.rint(times * 100.0).astype(np.int64)


def _spread(name: str, error: Floats) -> dict[str, float]:
    return {name: float(error.mean()), f"{name}_sd": float(error.std())}


def _honesty(name: str, e: Floats, P: Floats) -> dict[str, Any]:
    nees = chi_square(e, P) / e.shape[1]
    return {f"{name}_nees": float(nees.mean()), f"{name}_nees_by_time": nees[NEES_EVERY - 1 :: NEES_EVERY]}


def _body_rates(angles: Floats, rates: Floats) -> Floats:
    """(n, 3) body rate from rates of yaw, pitch, roll."""
    (_, cp, cr), (_, sp, sr) = np.cos(angles).T, np.sin(angles).T
    yaw, pitch, roll = rates.T
    return np.column_stack([roll - sp * yaw, cr * pitch + cp * sr * yaw, cp * cr * yaw - sr * pitch])
