"""A scenario run and kept: a folder with the recording, the truth, the numbers, the report and the scenario itself."""

import platform
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final, final

import numpy as np

from outrider import __version__
from outrider._kernel import compiling
from outrider.data.agents import Planned
from outrider.errors import ExitCode
from outrider.io import folders
from outrider.io.record import write_recording
from outrider.io.tum import write_tum
from outrider.models.vehicles import Vehicle
from outrider.scenarios.booked import mission, unserved
from outrider.scenarios.build import Cast, build
from outrider.scenarios.files import scenario_text
from outrider.scenarios.followed import Breach, breaches, promises, pursuit, pursuit_figures, strayed, write_pictures
from outrider.scenarios.inspected import inspection, write_picture
from outrider.scenarios.parts import Scenario
from outrider.scenarios.sharing import sharing
from outrider.sim.engine import Ending, Simulation
from outrider.sim.monitor import Closest
from outrider.sim.radio import Lost
from outrider.sim.truth import Truth
from outrider.team.errand import Errand, Outcome, Visit
from outrider.team.patrol import Patrol

SCHEMA: Final = "outrider.simulation/1"
SUMMARY, RECORDING, SCENARIO, REPORT = "summary.json", "run.mcap", "scenario.yaml", "report.html"
FILM: Final = "film.gif"
PICTURE: Final = "inspection.png"
FILM_HZ: Final = 10.0
TOO_NEAR: Final = "too_near"
GOOD: Final = (Ending.GOAL, Ending.TIME)

Progress = Callable[[str, float], None]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Done:
    """A scenario that was run."""

    scenario: Scenario
    cast: Cast
    run: Simulation
    wall_s: float  # of simulating, without what compiling took
    compile_s: float

    @property
    def exit_code(self) -> ExitCode:
        """Whether it ended as planned, every goal reached, no alert in vain, every follower at its distance."""
        good = self.run.ending in GOOD and all(o.visit is Visit.ARRIVED for _, e in self.errands for o in e.outcomes)
        good &= not unserved(self.cast) and not self.breaches
        return ExitCode.OK if good else ExitCode.FAILED_CHECK

    @property
    def code(self) -> str:
        """How it ended, in a word: an `Ending`, or that a follower came too near to its target."""
        return TOO_NEAR if self.breaches and self.run.ending in GOOD else self.run.ending.name.lower()

    @property
    def breaches(self) -> list[Breach]:
        """Followers that broke their protective distance."""
        return breaches(self.cast, self.run)

    @property
    def sentence(self) -> str:
        """How it ended, and what was in vain."""
        missed = [o for _, e in self.errands for o in e.outcomes if o.visit is not Visit.ARRIVED]
        vain = unserved(self.cast)
        told = [self.run.sentence]
        told += [f"{len(missed)} goal{'s' * (len(missed) > 1)} not reached"] if missed else []
        told += [f"{vain} alert{'s' * (vain > 1)} in vain"] if vain else []
        told += [b.sentence for b in self.breaches] + strayed(self.cast)
        return "; ".join(told)

    @property
    def errands(self) -> list[tuple[str, Errand]]:
        """The robots that were sent to goals."""
        return [(r.name, r.agent) for r in self.cast.team if isinstance(r.agent, Errand)]


def ensure_free(folder: Path, *, force: bool = False) -> None:
    """Refuse a folder that holds anything but an earlier simulation, and that only without `force`."""
    folders.ensure_free(folder, SUMMARY, SCHEMA, force=force)


def run_scenario(
    scenario: Scenario,
    output: Path,
    *,
    where: str = "",
    force: bool = False,
    report: bool = True,
    film: float = 0.0,
    command: str = "",
    progress: Progress | None = None,
    say: Callable[[str], None] | None = None,
) -> tuple[Done, dict[str, Any]]:
    """Run a scenario and write its folder, complete or not at all; what was done, and its summary.

    film : pictures per simulated second, 0 for none;  say : hears what is to be known before it begins.

    Raises ConfigError for what cannot be, OutputExistsError if there is something at `output`.
    """
    ensure_free(output, force=force)
    cast = build(scenario, where)
    if say is not None:
        for line in promises(cast):
            say(line)
    tell = progress or _silent
    tell("simulating", 0.0)
    with compiling() as compiled:
        began = time.perf_counter()
        run = cast.run()
        wall = time.perf_counter() - began
    done = Done(scenario=scenario, cast=cast, run=run, wall_s=wall - compiled(), compile_s=compiled())
    document = summarise(done)
    with folders.result_folder(output, SUMMARY, SCHEMA, force=force) as part:
        tell("writing", 0.0)
        write_recording(done.run.log, part / RECORDING)
        for name, truth in done.run.truth.items():
            write_tum(truth.trajectory(), part / f"truth_{name}.tum")
        if film > 0.0:
            tell("film", 0.0)
            _film(done.run, part / FILM, film)
        (part / SCENARIO).write_text(scenario_text(scenario), encoding="utf-8")
        if report:
            from outrider.plot.simulation import write_simulation_report  # imports matplotlib

            tell("report", 0.0)
            text = scenario_text(scenario)
            figures = pursuit_figures(cast, done.run)
            write_simulation_report(done.run, document, part / REPORT, scenario=text, command=command, figures=figures)
            write_pictures(figures, part)
            if document["inspection"]:
                write_picture(cast, done.run, part / PICTURE)
        folders.write_marker(part, SUMMARY, document)
    return done, document


def _film(run: Simulation, path: Path, rate_hz: float) -> None:
    """Rendered by the second physics, whichever moved the vehicles; played ten times a second."""
    from outrider.io.film import write_film
    from outrider.sim.physics.pictures import pictures

    seconds = np.arange(0.0, (run.ended - run.monitor.start) * 1e-9, 1.0 / rate_hz)
    write_film(pictures(run, seconds), path, FILM_HZ)


def rehearse(scenario: Scenario, where: str = "") -> Cast:
    """Everything but the run: one step of it finds robots that start in a wall and sensors that lack their object."""
    cast = build(scenario, where)
    step = max((r.vehicle.step_s for r in cast.team if r.vehicle is not None), default=0.01)
    replace(cast, duration_s=step).run()
    return cast


def summarise(done: Done) -> dict[str, Any]:
    """Everything about a simulation but its time series. SI units."""
    run, scenario, site = done.run, done.scenario, done.cast.world.datum
    lasted = (run.ended - run.monitor.start) * 1e-9
    return {
        "schema": SCHEMA,
        "scenario": scenario.name,
        "about": scenario.about,
        "outcome": {"code": done.code, "text": done.sentence},
        "seed": scenario.seed,
        "start_ns": run.monitor.start,
        "duration_s": lasted,
        "world": done.cast.world.name,
        "datum": {"lat_deg": float(np.degrees(site.lat)), "lon_deg": float(np.degrees(site.lon)), "alt_m": site.alt},
        "robots": {name: _robot(done, name) for name in run.truth},
        "separations": [
            {"robots": list(pair), **(_closest(run, c) or {})} for pair, c in sorted(run.monitor.separations.items())
        ],
        "mission": mission(done.cast, run),
        "inspection": inspection(done.cast, run),
        "pursuit": pursuit(done.cast, run),
        "cooperation": sharing(done.cast, run),
        "messages": {
            "sent": run.air.sent,
            "lost": {reason.name.lower(): run.air.lost[reason] for reason in Lost if run.air.lost[reason]},
        },
        "notes": [
            {"t_s": (n.t - run.monitor.start) * 1e-9, "robot": n.robot, "text": n.text} for n in run.notes
        ],
        "log": {"records": len(run.log), "sha256": run.log.sha256},
        "wall_s": done.wall_s,
        "compile_s": done.compile_s,
        "times_real_time": lasted / done.wall_s,
        "versions": {
            "outrider": __version__, "python": platform.python_version(), "machine": platform.machine(),
            "numpy": version("numpy"), "numba": version("numba"),
        },
    }  # fmt: skip


def _robot(done: Done, name: str) -> dict[str, Any]:
    run, truth = done.run, done.run.truth[name]
    member = next(r for r in done.cast.team if r.name == name)
    several = len(run.truth) > 1
    steps = np.linalg.norm(np.diff(truth.p, axis=0), axis=1)
    by_agent = member.agent is not None and not isinstance(member.agent, Planned)
    return {
        "vehicle": _kind(member.vehicle),
        "driven_by": type(member.agent).__name__.lower() if member.agent else "track",
        "closed_loop": by_agent,
        "distance_m": float(steps.sum()),
        "top_speed_m_s": float(np.linalg.norm(truth.v, axis=1).max()),
        "end": dict(zip(("east_m", "north_m", "up_m"), truth.p[-1].tolist(), strict=True)),
        "clearance": _closest(run, run.monitor.clearances.get(name)),
        "fence": _closest(run, run.monitor.fences.get(name)),
        "goals": [_goal(run, truth, o) for n, errand in done.errands if n == name for o in errand.outcomes],
        "safety": _safety(member.agent),
        "estimate": _estimate(done, f"{name}/estimate" if several else "estimate", name),
        "sensors": {
            s.name.removeprefix(f"{name}/"): {"kind": s.kind.value, "records": len(s), "rate_hz": s.rate}
            for s in run.log
            if s.robot == name
        },
    }


def _goal(run: Simulation, truth: Truth, o: Outcome) -> dict[str, Any]:
    """What became of a goal: `error_m` is how far off the robot was; it is made of what its estimate was off the truth
    and what its control left between estimate and goal."""
    east, north, heading = o.goal.tolist()
    told = {"east_m": east, "north_m": north, "heading_deg": None if np.isnan(heading) else float(np.degrees(heading))}
    told |= {"outcome": o.visit.name.lower(), "reason": o.reason or ("" if o.visit is Visit.ARRIVED else o.visit.value)}
    if o.visit is Visit.OPEN:
        return told
    here = truth.at(np.array([min(o.t, int(truth.t[-1]))])).p[0, :2]
    return {
        **told,
        "t_s": (o.t - run.monitor.start) * 1e-9,
        "error_m": float(np.hypot(*(here - o.goal[:2]))),
        "of_estimate_m": float(np.hypot(*(here - o.estimate[:2]))),
        "of_control_m": o.error,
    }


def _safety(agent: object) -> list[dict[str, Any]]:
    """Why commands were changed on their way to the motors: how many times, and for how long altogether."""
    if not isinstance(agent, Errand | Patrol):
        return []
    told = agent.body.interventions.items()
    return [
        {"reason": r.name.lower(), "text": r.value, "times": times, "total_s": cycles * agent.period_s}
        for r, (times, cycles) in told
    ]


def _kind(vehicle: Vehicle | None) -> str:
    if vehicle is None:
        return "carried"
    design = getattr(vehicle, "design", None)  # of the second physics
    name = type(vehicle if design is None else design).__name__.lower()
    return name if design is None else f"{name} in MuJoCo"


def _closest(run: Simulation, c: Closest | None) -> dict[str, Any] | None:
    if c is None:
        return None
    return {"distance_m": float(c.distance), "to": c.what, "t_s": (c.t - run.monitor.start) * 1e-9}


def _estimate(done: Done, stream: str, name: str) -> dict[str, Any] | None:
    """How far the robot's own estimate was from the truth, horizontally."""
    s = done.run.log.streams.get(stream)
    if s is None or not len(s):
        return None
    error = np.linalg.norm((s.z[:, :3] - done.run.truth[name].at(s.t).p)[:, :2], axis=1)
    return {"records": len(s), "rmse_m": float(np.sqrt(np.mean(error**2))), "largest_m": float(error.max())}


def _silent(what: str, share: float) -> None:
    pass
