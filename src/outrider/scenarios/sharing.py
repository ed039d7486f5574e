"""What a shared estimate was worth: errors and honesty of every robot and pair, each sensor's part in it."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

import numpy as np

from outrider.core.angles import wrap_all
from outrider.core.rotations import quats_to_matrices
from outrider.eval import average_bounds, chi_square
from outrider.filters.cooperative import Method
from outrider.models.motion import Motion
from outrider.scenarios.build import Cast
from outrider.sim.engine import Simulation
from outrider.sim.radio import Air, Radio
from outrider.sim.truth import EPOCH
from outrider.team.crew import Crew
from outrider.typing import Bools, Floats, Ints

BAND: Final = 0.95
STEP_S: Final = 0.2  # of estimates from records
AFTER_S: Final = 5.0  # s of the start that do not count: robots stand
UNITS: Final = {
    "GnssPosition": "m", "GnssVelocity": "m/s", "BodyVelocity": "m/s", "Twist": "m/s", "Gyro": "rad/s",
    "SpecificForce": "m/s^2", "Baro": "m", "MapPose": "m", "RelativePose": "m",
}  # fmt: skip
"""Of the first row of each sensor."""


def sharing(cast: Cast, run: Simulation) -> dict[str, Any] | None:
    """Of robots that share their estimates; None if none do. SI units."""
    crew = cast.crew
    if crew is None:
        return None
    if not any(k.t for k in crew.kept.values()):  # they were carried
        _hear(crew, crew, run)
    without = {
        name: _again(cast, run, method)
        for name, method in (("exchange", Method.LOCAL), ("exchange, lidar and stereo", Method.NONE))
        if method is not crew.method
    }
    return {
        "method": {"code": crew.method.name.lower(), "text": _told(crew, cast.radio)},
        "robots": {name: errors(crew, run, name) for name in crew.names},
        "pairs": [{"robots": list(pair), **_pair(crew, run, pair)} for pair, P in crew.crossed.items() if P],
        "sensors": _sensors(crew, run),
        "without": without,
        "ablation": ablation(cast, run) if cast.ablates else None,
        "exchange": crew.exchange,
        "unobserved": crew.unobserved(),
    }


def _told(crew: Crew, radio: Radio) -> str:
    """How it shares."""
    lossy = radio.loss > 0.0 or np.isfinite(radio.range_m)
    return crew.method.value + ("; it knows nothing of the radio" if lossy and crew.method is Method.JOINT else "")


def ablation(cast: Cast, run: Simulation) -> list[dict[str, Any]]:
    """Errors with each sensor left out, estimated again from the same records: what it was worth."""
    crew = cast.crew
    if crew is None:
        return []
    names = sorted({(name, e.stream) for name, own in crew.ears.items() for e in own})
    return [{"robot": n, "sensor": s, "robots": _again(cast, run, crew.method, (n, s))} for n, s in names]


def errors(crew: Crew, run: Simulation, name: str) -> dict[str, Any]:
    """How far a robot was from where it thought, and whether it knew. Position (2 or 3 axes) and heading."""
    e, P, _ = _off(crew, run, name)
    axes = _axes(crew, name)
    e = e[:, axes]
    off = np.linalg.norm(e[:, :-1], axis=1)
    return {
        "position_m": float(off.mean()), "position_largest_m": float(off.max()),
        "heading_deg": float(np.degrees(np.abs(e[:, -1])).mean()), **_honesty(e, P[:, axes[:, None], axes]),
    }  # fmt: skip


def _honesty(e: Floats, P: Floats) -> dict[str, float]:
    nees = chi_square(e, P)
    low, high = average_bounds(e.shape[1], 1, probability=BAND)
    return {
        "nees_per_dof": float(nees.mean() / e.shape[1]), "in_band": float(np.mean((low <= nees) & (nees <= high))),
    }  # fmt: skip


def _axes(crew: Crew, name: str) -> Ints:
    flies = next(m for m in crew.members if m.name == name).motion is Motion.EULER
    return np.array([0, 1, 2, 3] if flies else [0, 1, 3])


def _off(crew: Crew, run: Simulation, name: str) -> tuple[Floats, Floats, Bools]:
    """Errors (n, 4) and covariances (n, 4, 4) of the times that count, and which steps these are."""
    kept = crew.kept[name]
    t = np.array(kept.t)
    rows = (t >= AFTER_S) & (t <= (run.ended - run.monitor.start) * 1e-9)
    if not rows.any():  # it ended before that
        rows = t <= (run.ended - run.monitor.start) * 1e-9
    pose = np.array(kept.pose)[rows]
    truth = run.truth[name].at(run.monitor.start + np.rint(t[rows] * 1e9).astype(np.int64))
    R = quats_to_matrices(truth.q)
    e = np.column_stack([pose[:, :3] - truth.p, wrap_all(pose[:, 3] - np.arctan2(R[:, 1, 0], R[:, 0, 0]))])
    return e, np.array(kept.P)[rows], rows


def _pair(crew: Crew, run: Simulation, pair: tuple[str, str]) -> dict[str, float]:
    """Whether both errors together are what the filter of both expects: tests what it holds between robots, too."""
    (one, P_1, rows), (two, P_2, _) = (_off(crew, run, name) for name in pair)
    C = np.array(crew.crossed[pair])[rows]
    a, b = (_axes(crew, name) for name in pair)
    P = np.block([
        [P_1[:, a[:, None], a], C[:, a[:, None], b]],
        [np.swapaxes(C, 1, 2)[:, b[:, None], a], P_2[:, b[:, None], b]],
    ])  # fmt: skip
    return _honesty(np.hstack([one[:, a], two[:, b]]), P)


def _sensors(crew: Crew, run: Simulation) -> list[dict[str, Any]]:
    """What each sensor, and each look at a partner, said, and how much of it: `worth` is its deviation over the root of
    its rate, to which one second of it averages."""
    seconds = max((run.ended - run.monitor.start) * 1e-9, 1e-9)
    out: list[dict[str, Any]] = []
    for a in crew.agreements():
        stream, _, kind = a.sensor.partition(" ")
        ear = next(e for e in crew.ears[a.robot] if (e.stream, e.partner) == (stream, a.partner)
                   and (not kind or type(e.sensor).__name__ == kind))  # fmt: skip
        sigma = next(x for x in ear.sigmas if np.isfinite(x))
        out.append({
            "robot": a.robot, "sensor": stream, "kind": type(ear.sensor).__name__, "partner": a.partner,
            "used": a.used, "refused": a.refused, "nis_per_dof": _number(a.nis), "in_bound": _number(a.inside),
            "worth_in_1_s": float(sigma / np.sqrt(a.used / seconds)) if a.used else None,
            "unit": UNITS.get(type(ear.sensor).__name__, ""),
        })  # fmt: skip
    return out


def _number(x: float) -> float | None:
    return float(x) if np.isfinite(x) else None


def _again(
    cast: Cast, run: Simulation, method: Method, left_out: tuple[str, str] = ("", "")
) -> dict[str, dict[str, Any]]:
    """Errors of every robot with another method or without a stream, from the same records."""
    crew = cast.crew
    assert crew is not None
    ears = {n: tuple(e for e in own if (n, e.stream) != left_out) for n, own in crew.ears.items()}
    air = Air(cast.radio, tuple(crew.names), cast.seed, 0)
    done = Crew(crew.members, ears, method, EPOCH, cast.world.datum, air)
    _hear(done, crew, run)
    return {n: errors(done, run, n) for n in ears}


def _hear(done: Crew, crew: Crew, run: Simulation) -> None:
    log: Mapping[str, Any] = {
        n: [replace(s, name=s.name.removeprefix(f"{n}/")) for s in run.log if s.robot == n] for n in crew.ears
    }
    done.hear_again(log, STEP_S, (run.ended - run.monitor.start) * 1e-9)
