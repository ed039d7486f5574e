"""What became of an inspection: errors and honesty of every robot, what was seen, landings, what sharing was worth."""

from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from outrider.core.angles import wrap_all
from outrider.core.rotations import quats_to_matrices
from outrider.eval import chi_square
from outrider.filters.cooperative import Method
from outrider.models.motion import Motion
from outrider.planning.inspection import InspectionPlan, seen
from outrider.scenarios.build import Cast
from outrider.sim.engine import Simulation
from outrider.sim.truth import EPOCH
from outrider.team.crew import Crew
from outrider.team.inspector import Drone, Rover
from outrider.typing import Floats

BAND: Final = 0.95
EVERY_S: Final = 1.0  # of estimates that are worked out again
AFTER_S: Final = 5.0  # s of the start that do not count: robots stand


def inspection(cast: Cast, run: Simulation) -> dict[str, Any] | None:
    """Of the robots that inspect; None without any. SI units."""
    robots = {r.name: r.agent for r in cast.team if isinstance(r.agent, Rover | Drone)}
    if not robots:
        return None
    crew = next(iter(robots.values())).crew
    other = {
        method.name.lower(): _again(crew, run, method)
        for method in (Method.LOCAL, Method.NONE)
        if method is not crew.method
    }
    return {
        "method": {"code": crew.method.name.lower(), "text": _told(crew)},
        "robots": {name: _robot(cast, run, name, agent) for name, agent in robots.items()},
        "sensors": crew.counts(),
        "without": {"exchange": other.get("local"), "exchange, lidar and stereo": other.get("none")},
    }


def _told(crew: Crew) -> str:
    """How it shares: step by step, teams of more than two that only talk when they meet are cautious."""
    exact = crew.method is not Method.DISTRIBUTED or len(crew.names) <= 2
    return crew.method.value if exact else f"among more than two: {Method.SPLIT_CI.value}"


def without(cast: Cast, run: Simulation) -> dict[str, dict[str, Any]]:
    """Errors with each sensor left out, estimated again from the same records: what it was worth."""
    crew = next(r.agent.crew for r in cast.team if isinstance(r.agent, Rover | Drone))
    names = sorted({(name, e.stream) for name, own in crew.ears.items() for e in own})
    return {f"{name}/{stream}": _again(crew, run, crew.method, (name, stream)) for name, stream in names}


def errors(crew: Crew, run: Simulation, name: str) -> dict[str, Any]:
    """How far a robot was from where it thought, and whether it knew. Position (2 or 3 axes) and heading."""
    kept = crew.kept[name]
    t = np.array(kept.t)
    rows = (t >= AFTER_S) & (t <= (run.ended - run.monitor.start) * 1e-9)
    t, pose, P = t[rows], np.array(kept.pose)[rows], np.array(kept.P)[rows]
    truth = run.truth[name].at(run.monitor.start + np.rint(t * 1e9).astype(np.int64))
    R = quats_to_matrices(truth.q)
    e = np.column_stack([pose[:, :3] - truth.p, wrap_all(pose[:, 3] - np.arctan2(R[:, 1, 0], R[:, 0, 0]))])
    flies = next(m for m in crew.members if m.name == name).motion is Motion.EULER
    axes = np.array([0, 1, 2, 3] if flies else [0, 1, 3])
    nees = chi_square(e[:, axes], P[:, axes[:, None], axes]) / axes.size
    off = np.linalg.norm(e[:, axes[:-1]], axis=1)
    return {
        "position_m": float(off.mean()), "position_largest_m": float(off.max()),
        "heading_deg": float(np.degrees(np.abs(e[:, 3])).mean()), "nees_per_dof": float(nees.mean()),
    }  # fmt: skip


def _again(crew: Crew, run: Simulation, method: Method, left_out: tuple[str, str] = ("", "")) -> dict[str, Any]:
    """Errors of the position of every robot [m], with another method or without a stream, from the same records."""
    ears = {n: tuple(e for e in own if (n, e.stream) != left_out) for n, own in crew.ears.items()}
    log = {n: [replace(s, name=s.name.removeprefix(f"{n}/")) for s in run.log if s.robot == n] for n in ears}
    done = Crew(crew.members, ears, method, EPOCH, next(iter(run.truth.values())).datum)
    done.hear_again(log, EVERY_S, (run.ended - run.monitor.start) * 1e-9)
    return {n: errors(done, run, n) for n in ears}


def _robot(cast: Cast, run: Simulation, name: str, agent: Rover | Drone) -> dict[str, Any]:
    plan = cast.plans[name]
    taken = np.array(agent.shots.taken, np.int64).reshape(-1, 2)
    out = {
        **errors(agent.crew, run, name),
        "path": {"length_m": plan.path.length, "planned_s": plan.path.duration, "done_s": agent.follower.s,
                 "clearance_m": plan.clearance},
        "coverage": {"reachable": float(plan.reachable.mean()), "planned": plan.coverage,
                     "achieved": float(_shown(cast, run, name, agent, plan).mean())},
        "pictures": len(taken),
    }  # fmt: skip
    if isinstance(agent, Drone):
        phase = {"code": agent.flight.phase.name.lower(), "text": agent.flight.phase.value}
        out |= {"phase": phase, "battery": agent.battery, "landings": _landings(run, agent)}
    return out


def _shown(cast: Cast, run: Simulation, name: str, agent: Rover | Drone, plan: InspectionPlan) -> Any:
    """(points,) what the pictures show from where the robot truly was, gazes turned by the error of its heading."""
    taken = np.array([x for x in agent.shots.taken if x[0] <= run.ended], np.int64).reshape(-1, 2)
    if not len(taken):
        return np.zeros(len(plan.on), np.bool_)
    truth, kept = run.truth[name].at(taken[:, 0]), agent.crew.kept[name]
    thought = np.interp((taken[:, 0] - EPOCH) * 1e-9, np.array(kept.t), np.unwrap(np.array(kept.pose)[:, 3]))
    R = quats_to_matrices(truth.q)
    off = wrap_all(np.arctan2(R[:, 1, 0], R[:, 0, 0]) - thought)
    gaze = _turned(plan.pictures.gaze[taken[:, 1]], off)
    table = np.ascontiguousarray(cast.world.solids.table)
    return seen(table, plan.task.camera, truth.p, gaze, plan.on).any(axis=0)


def write_picture(cast: Cast, run: Simulation, path: Path) -> None:
    """Draw what every robot has seen, and its way."""
    from outrider.plot.inspection import Inspected, inspection_figure  # imports matplotlib
    from outrider.plot.style import save_png

    drawn: dict[str, Inspected] = {}
    for r in cast.team:
        if isinstance(r.agent, Rover | Drone):
            plan, driven = cast.plans[r.name], run.truth[r.name].p[::20]
            shown = _shown(cast, run, r.name, r.agent, plan)
            drawn[r.name] = Inspected(surface=plan.on.p, seen=shown, planned=plan.path.p, driven=driven)
    save_png(inspection_figure(drawn), path)


def _turned(v: Floats, angle: Floats) -> Floats:
    """(n, 3) vectors turned about the vertical."""
    c, s = np.cos(angle), np.sin(angle)
    return np.column_stack([c * v[:, 0] - s * v[:, 1], s * v[:, 0] + c * v[:, 1], v[:, 2]])


def _landings(run: Simulation, agent: Drone) -> list[dict[str, float]]:
    """Where the drone touched the pad: t_s, m off its middle, and what its camera said then."""
    out: list[dict[str, float]] = []
    for t, said in agent.landings:
        at = np.array([min(t, run.ended)])
        own, under = run.truth[agent.name].at(at), run.truth[agent.carrier].at(at)
        R = quats_to_matrices(under.q)[0]
        off = R.T @ (own.p[0] - under.p[0]) - agent.pad
        seconds = (t - run.monitor.start) * 1e-9
        out.append({"t_s": seconds, "off_m": float(np.hypot(*off[:2])), "by_camera_m": float(np.hypot(*said[:2]))})
    return out
