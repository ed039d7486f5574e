"""What became of an inspection: what was seen, along which way, and landings."""

from pathlib import Path
from typing import Any

import numpy as np

from outrider.core.angles import wrap_all
from outrider.core.rotations import quats_to_matrices
from outrider.planning.inspection import InspectionPlan, seen
from outrider.scenarios.build import Cast
from outrider.sim.engine import Simulation
from outrider.sim.truth import EPOCH
from outrider.team.inspector import Drone, Rover
from outrider.typing import Floats


def inspection(cast: Cast, run: Simulation) -> dict[str, Any] | None:
    """Of the robots that inspect; None without any. SI units."""
    robots = {r.name: r.agent for r in cast.team if isinstance(r.agent, Rover | Drone)}
    return {"robots": {name: _robot(cast, run, name, agent) for name, agent in robots.items()}} if robots else None


def _robot(cast: Cast, run: Simulation, name: str, agent: Rover | Drone) -> dict[str, Any]:
    plan = cast.plans[name]
    taken = np.array(agent.shots.taken, np.int64).reshape(-1, 2)
    out = {
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
