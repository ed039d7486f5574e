"""The experiments of amr2025: one drive, or one turn on the spot, measured against its truth.

A trial is `outrider.campaign.trials`'; its numbers are those of the paper's tables 2 to 5 and of its figures.
"""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from outrider.campaign.trials import Params
from outrider.core.angles import wrap_all
from outrider.data import EventLog
from outrider.data.agents import arrived
from outrider.errors import DataError
from outrider.eval.paths import length, smoothness
from outrider.filters.channels import site_position
from outrider.models.motion import Motion
from outrider.models.vehicles import Differential, Mecanum
from outrider.scenarios.amr2025 import DEGRADED_S, STOPS_DEG
from outrider.scenarios.build import Cast, build
from outrider.scenarios.files import load_scenario
from outrider.scenarios.navigation import channels_of, filter_of, odometry_of
from outrider.sim.engine import Simulation
from outrider.sim.truth import EPOCH, Truth
from outrider.team import Schedule
from outrider.team.errand import Errand, Visit
from outrider.team.navigator import Navigator
from outrider.typing import Floats, Ints

GRID: Final = 0.1  # m, spacing of the paper's maps, at which its raw coefficient is taken
SPACING: Final = 0.5  # m, at which ours is compared
SHOWN: Final = 300  # points of a curve that a page shows
PERIOD: Final = 100_000_000  # ns between two estimates


def drive(params: Params, seed: int) -> dict[str, Any]:
    """params : `scenario`, and `given`: what is said instead of its defaults. Raises DataError for a missed goal."""
    cast, run = _ran(params, seed)
    robot, truth = cast.team[0], run.truth["robot"]
    errand = robot.agent
    assert isinstance(errand, Errand)
    missed = [o for o in errand.outcomes if o.visit is not Visit.ARRIVED]
    if missed:
        raise DataError(f"goal {missed[0].goal[:2].tolist()}: {missed[0].reason or run.sentence}", where=cast.where)
    ends = truth.at(np.array([min(o.t, int(truth.t[-1])) for o in errand.outcomes])).p[:, :2]
    goals, thought = (np.array([getattr(o, k)[:2] for o in errand.outcomes]) for k in ("goal", "estimate"))
    planned = np.vstack([o.path for o in errand.outcomes])
    near = run.monitor.clearances.get("robot")
    return {
        "goal_error": np.hypot(*(ends - goals).T),
        "goal_estimate": np.hypot(*(ends - thought).T),
        "goal_control": np.hypot(*(thought - goals).T),
        "duration": (run.ended - EPOCH) * 1e-9,
        "clearance": np.inf if near is None else near.distance,
        **_path(planned, truth),
        **_speed(cast, run),
        **_estimate(run, truth),
        **_localised(cast, run),
        **_degraded(cast, run),
    }


def turn(params: Params, seed: int) -> dict[str, Any]:
    """Table 3: heading by wheels and IMU at every stop of a robot that turns on the spot, minus the true one [deg]."""
    cast, run = _ran(params, seed)
    truth, commands = run.truth["robot"], cast.team[0].agent
    assert isinstance(commands, Schedule)
    leaves = np.append(commands.t_s[3::2], (run.ended - EPOCH) * 1e-9)  # the end of every stop
    t = EPOCH + np.rint(leaves * 1e9).astype(np.int64)
    estimate = replayed(cast, run.log, t - PERIOD, ("imu", "encoders"))
    error = np.degrees(wrap_all(estimate[:, 2] - truth.at(t - PERIOD).trajectory().yaw))
    assert len(error) == len(STOPS_DEG)
    return {"heading_error": error}


def replayed(cast: Cast, log: EventLog, t: Ints, names: Sequence[str]) -> Floats:
    """(n, 3) east, north [m], heading [rad] at stamps t (n,), by the filter over the named sensors alone.

    It starts where the robot was put down, and hears of every record when that arrived.
    """
    robot = cast.team[0]
    used = [s for s in robot.sensors if s.name in names]
    base: Any = getattr(robot.vehicle, "design", robot.vehicle)
    channels = channels_of(used, Motion.PLANAR, base)
    f, prior = filter_of(channels, used, Motion.PLANAR, robot.start, cast.world, base)
    own = Navigator(f, prior, EPOCH, cast.world.datum, robot.name, odometry_of(used, base))
    streams = [log.streams[n] for n in names]
    out, told = np.empty((t.size, 3)), EPOCH - 1
    for row, until in enumerate(t.tolist()):
        for now in [*range(told + PERIOD, until, PERIOD), until]:
            own.take([new for s in streams if len(new := arrived(s, told, now))])
            told = now
        here = own.now(until)
        out[row] = here.p[0], here.p[1], here.heading
    return out


def _ran(params: Params, seed: int) -> tuple[Cast, Simulation]:
    given: Any = params.get("given") or {}
    scenario, _ = load_scenario(str(params["scenario"]), {**given, "seed": seed + 1})
    cast = build(scenario)
    return cast, cast.run()


def _path(planned: Floats, truth: Truth) -> dict[str, Any]:
    """Table 4: smoothness and length, planned at the start of each leg and driven."""
    driven = truth.p[:: max(1, round(0.02 / truth.dt)), :2]
    out: dict[str, Any] = {"length_planned": length(planned), "length_driven": length(driven)}
    for name, p in (("planned", planned), ("driven", driven)):
        out |= {f"smc_raw_{name}": smoothness(p, GRID), f"smc_{name}": smoothness(p, SPACING)}
        out |= {f"{name}_x": _shown(p[:, 0]), f"{name}_y": _shown(p[:, 1])}
    return out


def rolled(cast: Cast, log: EventLog) -> tuple[Ints, Floats]:
    """Stamps (n,) and twists (n, 3), body frame, by the encoders and the kinematics of the wheels."""
    s, base = log.streams["encoders"], getattr(cast.team[0].vehicle, "design", cast.team[0].vehicle)
    if isinstance(base, Mecanum):
        return s.t, base.kinematics.twist(s.z)
    assert isinstance(base, Differential)
    left, right = s.z.T
    return s.t, np.column_stack([0.5 * (left + right), 0.0 * left, (right - left) / base.track])


def _speed(cast: Cast, run: Simulation) -> dict[str, Any]:
    """Table 5: forward speed by the encoders against the command in force, at every record of the encoders."""
    command, estimate = run.log.streams["command"], run.log.streams["estimate"]
    heading = _yaw(estimate.z[:, 3:7])  # the command is logged in the site frame
    told = np.cos(heading) * command.z[:, 0] + np.sin(heading) * command.z[:, 1]
    t, twist = rolled(cast, run.log)
    row = np.maximum(np.searchsorted(command.t, t, side="right") - 1, 0)
    a, b = told[row], twist[:, 0]
    return {
        "speed_mae": np.abs(b - a).mean(),
        "speed_rmse": np.sqrt(np.mean((b - a) ** 2)),
        "speed_r": np.corrcoef(a, b)[0, 1],
        "speed_t": _shown(np.asarray(t - EPOCH, np.float64) * 1e-9),
        "speed_told": _shown(a),
        "speed_driven": _shown(b),
    }


def _estimate(run: Simulation, truth: Truth) -> dict[str, Any]:
    """The estimate the robot drives on, against truth; how often it comes, against RTK."""
    s, gnss = run.log.streams["estimate"], run.log.streams["gnss"]
    here = truth.at(s.t)
    off = np.hypot(*(s.z[:, :2] - here.p[:, :2]).T)
    turned = np.degrees(wrap_all(_yaw(s.z[:, 3:7]) - here.trajectory().yaw))
    return {
        "estimate_rmse": np.sqrt(np.mean(off**2)),
        "estimate_worst": off.max(),
        "heading_me": turned.mean(),
        "heading_mae": np.abs(turned).mean(),
        "heading_rmse": np.sqrt(np.mean(turned**2)),
        "rate_ratio": len(s) / len(gnss),
    }


def _localised(cast: Cast, run: Simulation) -> dict[str, Any]:
    """Figures 14 and 15: wheels alone, wheels and IMU, RTK alone, all together; errors at the end and at worst."""
    truth = run.truth["robot"]
    s = run.log.streams["estimate"]
    at = np.linspace(0, len(s) - 1, SHOWN).astype(int)
    t = s.t[at]
    here = truth.at(t).p[:, :2]
    local = replayed(cast, run.log, t, ("imu", "encoders"))[:, :2]
    odometry = _reckoned(cast, run.log, t)
    antenna = _antenna(cast, run, "gnss")
    out: dict[str, Any] = {"t": (t - EPOCH) * 1e-9, "true_x": here[:, 0], "true_y": here[:, 1]}
    for name, p in (("odometry", odometry), ("local", local), ("fused", s.z[at, :2])):
        out |= {f"{name}_x": p[:, 0], f"{name}_y": p[:, 1], f"{name}_end": np.hypot(*(p[-1] - here[-1]))}
        out[f"{name}_north"] = np.abs(p[:, 1] - here[:, 1]).max()
    return {**out, "gnss_x": _shown(antenna[:, 0]), "gnss_y": _shown(antenna[:, 1])}


def _reckoned(cast: Cast, log: EventLog, t: Ints) -> Floats:
    """(n, 2) where the wheels alone say the robot was."""
    stamps, twist = rolled(cast, log)
    dt = np.diff(stamps, prepend=EPOCH) * 1e-9
    turned = cast.team[0].start[3] + np.cumsum(twist[:, 2] * dt)
    middle = turned - 0.5 * twist[:, 2] * dt
    c, s = np.cos(middle), np.sin(middle)
    x = cast.team[0].start[0] + np.cumsum((c * twist[:, 0] - s * twist[:, 1]) * dt)
    y = cast.team[0].start[1] + np.cumsum((s * twist[:, 0] + c * twist[:, 1]) * dt)
    return np.column_stack([np.interp(t - EPOCH, stamps - EPOCH, p) for p in (x, y)])


def _degraded(cast: Cast, run: Simulation) -> dict[str, Any]:
    """Figure 16: from the loss of corrections on, the second receiver alone, and fused with wheels and IMU."""
    if "plain" not in run.log.streams:
        return {}
    truth, s = run.truth["robot"], run.log.streams["estimate"]
    late = s.t[s.t > EPOCH + round(DEGRADED_S * 1e9)]
    fused = replayed(cast, run.log, late, ("imu", "encoders", "plain"))[:, :2]
    receiver = run.log.streams["plain"]
    alone, t = _antenna(cast, run, "plain"), receiver.t
    bad = t > EPOCH + round(DEGRADED_S * 1e9)
    raw = np.hypot(*(alone[bad] - truth.at(t[bad]).p[:, :2]).T)
    off = np.hypot(*(fused - truth.at(late).p[:, :2]).T)
    rmse = np.sqrt(np.mean(raw**2)), np.sqrt(np.mean(off**2))
    return {
        "raw_rmse": rmse[0], "degraded_rmse": rmse[1], "degraded_ratio": rmse[1] / rmse[0],
        "raw_x": _shown(alone[bad, 0]), "raw_y": _shown(alone[bad, 1]),
        "degraded_x": _shown(fused[:, 0]), "degraded_y": _shown(fused[:, 1]),
    }  # fmt: skip


def _antenna(cast: Cast, run: Simulation, name: str) -> Floats:
    """(n, 2) where a receiver says the robot was, its lever arm taken off with the true heading."""
    s = run.log.streams[name]
    sensor: Any = next(x for x in cast.team[0].sensors if x.name == name)
    yaw = run.truth["robot"].at(s.t).trajectory().yaw
    c, k = np.cos(yaw), np.sin(yaw)
    x, y, _ = sensor.lever
    return site_position(s, cast.world.datum)[:, :2] - np.column_stack([c * x - k * y, k * x + c * y])


def _yaw(q: Floats) -> Floats:
    x, y, z, w = q.T
    return np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def _shown(column: Floats) -> Floats:
    """(SHOWN,) evenly picked rows."""
    return column[np.linspace(0, len(column) - 1, SHOWN).astype(int)]
