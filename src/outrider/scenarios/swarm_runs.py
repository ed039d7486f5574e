"""A swarm as a user runs it: by the name of its task, with a summary of what became of it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from importlib.metadata import version
from time import perf_counter
from typing import Any, Final, final

import numpy as np

from outrider import __version__
from outrider.errors import ConfigError, UsageError
from outrider.guidance.avoidance import Avoidance
from outrider.guidance.column import Spacing
from outrider.scenarios.swarm import DT, RANKS, VEHICLE, Flown, Sky, Task, fly_swarm, spacing_errors
from outrider.scenarios.swarm_state import ASIDE, GOALS, LEADER, MEMBER, T_AHEAD, T_KIND, T_LINE, T_OWN
from outrider.scenarios.swarm_tasks import circle, column, convoy, crossed, crossing, doorway, head_on
from outrider.typing import Floats

MARKER: Final = "summary.json"
SCHEMA: Final = "outrider.swarm/1"
SWAPS: Final[Mapping[str, Callable[[int], Task]]] = {
    "circle": circle, "head-on": head_on, "crossing": crossing, "doorway": doorway,
}  # fmt: skip
COLUMNS: Final = ("column", "crossed", "convoy")
NAMES: Final = (*SWAPS, *COLUMNS)
STRANGERS: Final = 5  # that cross a column
CONVOY, CONVOY_S = 9, 4.0  # drones of a convoy at least, and how long each of them takes to split off and merge
MOST: Final = 1000
COST_US: Final = 27.0  # processor time of a drone's decision in a dense crowd of 128 or more; 8 to 20 in others
PATIENCE_S: Final = 1800.0  # the most processor time that is begun
SETTLED_S: Final = 60.0  # of a column, after which its gaps count


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """What a user asks for. drones : with the leader of a column;  seconds : how
    long it flies, at most where all have goals, None for as long as the task takes;  silent : of a column, drone
    and from when to when its radio is dead [s]."""

    task: str = "circle"
    drones: int = 16
    seconds: float | None = None
    seed: int = 0
    loss: float = 0.2
    late_s: float = 0.2
    separation: float = 1.5
    silent: tuple[tuple[int, float, float], ...] = ()

    def __post_init__(self) -> None:
        if self.task not in NAMES:
            raise UsageError(f"no task '{self.task}'", fix=f"there are: {', '.join(NAMES)}")
        if not 2 <= self.drones <= MOST:
            raise UsageError(f"{self.drones} drones", where="--drones", fix=f"from 2 to {MOST}")
        if self.task in ("head-on", "crossing", "doorway") and self.drones % 2:
            raise UsageError(f"{self.drones} drones are not two sides", where="--drones", fix="an even number")
        if self.seconds is not None and not self.seconds >= DT:
            raise UsageError(f"{self.seconds:g} s", where="--duration", fix=f"one step of {DT:g} s or more")
        if self.task in COLUMNS and not self.lasts >= 2.0 * SETTLED_S:
            raise UsageError(f"{self.lasts:g} s", where="--duration", fix=f"{2.0 * SETTLED_S:g} s or more")
        if self.task == "convoy" and not (self.drones >= CONVOY and self.lasts >= self.drones * CONVOY_S + 150.0):
            raise UsageError(
                f"{self.drones} drones for {self.lasts:g} s", where="swarm convoy",
                fix=f"{CONVOY} drones or more, and {CONVOY_S:g} s for each and 150 s more",
            )  # fmt: skip
        if self.task == "crossed" and self.drones < STRANGERS + 2:
            raise UsageError(
                f"{self.drones} drones", where="--drones", fix=f"{STRANGERS} strangers, a leader, a follower"
            )
        if self.silent and self.task != "column":
            raise UsageError("is of a column", where="--silent", fix="leave it out")
        if any(not 0 < d < self.drones or not 0.0 <= a < b for d, a, b in self.silent):
            raise UsageError("names no follower, or no span", where="--silent", fix="DRONE,FROM,TO, e.g. 17,60,90")

    @property
    def lasts(self) -> float:
        """s, of a column."""
        return 600.0 if self.seconds is None else self.seconds


def expected_s(task: Task) -> float:
    """The most processor time that a task takes [s], less if all are there early or few are near one another."""
    return 1e-6 * COST_US * len(task.start) * task.seconds / DT


def planned(asked: Asked) -> Task:
    """What is to be flown. Raises `UsageError` for what would take longer than `PATIENCE_S`."""
    if asked.task == "column":
        task = column(asked.drones, asked.lasts, asked.seed, silent=asked.silent)
    elif asked.task == "crossed":
        task = crossed(asked.drones, asked.lasts, asked.seed, strangers=STRANGERS)
    elif asked.task == "convoy":
        task = convoy(asked.drones, asked.lasts, asked.seed)
    else:
        task = SWAPS[asked.task](asked.drones)
        task = task if asked.seconds is None else replace(task, seconds=asked.seconds)
    if (takes := expected_s(task)) > PATIENCE_S:
        said = f"{asked.drones} drones for {task.seconds:.0f} s may take {takes / 60.0:.0f} min to compute"
        fix = f"fewer --drones or a shorter --duration: {PATIENCE_S / 60.0:g} min at most"
        raise UsageError(said, where="swarm", fix=fix)
    return task


def fly_task(asked: Asked, task: Task, progress: Callable[[float], None] | None = None) -> tuple[dict[str, Any], Flown]:
    """Fly what is `planned`; the summary, SI units."""
    rules, spacing = _rules(asked), Spacing()
    sky = Sky(loss=asked.loss, late_s=asked.late_s, radio=40.0 if asked.task in COLUMNS else 60.0)
    begin = perf_counter()
    if asked.task in COLUMNS:
        spacing.check(VEHICLE.tau_s, DT, asked.late_s)
        done = fly_swarm(task, asked.seed, sky=sky, rules=rules, spacing=spacing, until_there=False, room=32,
                         progress=progress)  # fmt: skip
    else:
        done = fly_swarm(task, asked.seed, sky=sky, rules=rules, progress=progress)
    return _summary(asked, done, perf_counter() - begin), done


def _rules(asked: Asked) -> Avoidance:
    """A column at 8.5 m and places 5 m apart leave no room for more than so much."""
    if not 0.5 <= asked.separation <= 2.5:
        raise ConfigError(f"is {asked.separation:g} m", where="--separation", fix="from 0.5 to 2.5 m")
    return Avoidance(separation=asked.separation)


def _summary(asked: Asked, f: Flown, wall: float) -> dict[str, Any]:
    near = int(f.least.argmin())
    lost, stuck = int(f.aside.sum()), int(len(f.there) - f.there.sum()) if asked.task not in COLUMNS else 0
    apart = int((f.track[-1, :, T_LINE] > 0.0).sum())
    outcome = "violated" if f.violations or f.in_walls else "stuck" if stuck or apart else "done"
    text = {
        "violated": f"two drones came nearer than {asked.separation:g} m, or one a wall",
        "stuck": f"{apart} of {len(f.there)} drones are still on the branch" if apart
        else f"{stuck} of {len(f.there)} drones did not get to their goals in time",
        "done": f"nobody came too near, and all are where they should be{_absences(f)}" if not lost
        else f"nobody came too near; {lost} out of the column, without a radio or with nobody to join",
    }  # fmt: skip
    shares = f.ranks.sum(axis=0) / f.ranks.sum()
    return {
        "schema": SCHEMA, "task": asked.task, "drones": asked.drones, "seed": asked.seed, "loss": asked.loss,
        "late_s": asked.late_s, "outcome": {"code": outcome, "text": text[outcome]}, "duration_s": f.seconds,
        "wall_s": wall, "least_m": float(f.least[near]), "least_at_s": float(f.when[near]), "least_of": near,
        "separation_m": asked.separation, "violations": f.violations, "in_walls": f.in_walls,
        "there": int(f.there.sum()) if asked.task not in COLUMNS else None, "aside": lost, "messages": f.heard,
        "decided_by": dict(zip(RANKS, map(float, shares), strict=True)),
        "decisions": dict(zip(RANKS, map(int, f.ranks.sum(axis=0)), strict=True)), "each": _each(asked, f),
        "column": _column(f) if asked.task in COLUMNS else None, "changes": changes(f),
        "versions": {"outrider": __version__, "numpy": version("numpy"), "numba": version("numba")},
    }  # fmt: skip


def _absences(f: Flown) -> str:
    """Who is back at the end and was out of the column for a while: without a radio, or with nobody to join."""
    aside = (f.track[:, :, T_KIND] == ASIDE).sum(axis=0) * f.every_s
    away = aside[(aside > 0.0) & (f.aside == 0)]
    return f" at the end; {away.size} out of the column for up to {away.max():.0f} s before" if away.size else ""


def changes(f: Flown) -> list[dict[str, Any]]:
    """What became of the order of a column: who left, joined, split off, took another trail, merged, and when."""
    out: list[dict[str, Any]] = []
    state = f.track[:, :, [T_KIND, T_LINE, T_AHEAD]].astype(np.int64)
    for row, i in np.argwhere((np.diff(state[:, :, :2], axis=0) != 0).any(axis=2)).tolist():
        (was, line, _), (now, new, ahead) = state[row, i].tolist(), state[row + 1, i].tolist()
        text = _change(was, now, line, new, ahead)
        out += [{"t_s": (row + 1) * f.every_s, "drone": i, "text": text}] if text else []
    return out


def _change(was: int, now: int, line: int, new: int, ahead: int) -> str:
    behind = f"behind {ahead}" if ahead >= 0 else "with nobody ahead that it hears"
    if now == ASIDE:
        return "has no radio, and climbs out of the way"
    if was == ASIDE:
        return f"joins, {behind}" if now == MEMBER else "is back among the others"
    if was == MEMBER and now == GOALS:
        return "leaves the column"
    if was == MEMBER and now == LEADER:
        return "splits off, and leads who is behind it"
    if was == LEADER:
        return f"merges, {behind}"
    return f"takes the other trail, {behind}" if new > line else f"is on the first trail again, {behind}"


def _each(asked: Asked, f: Flown) -> list[dict[str, Any]]:
    """Of every drone: how near it came to another, its way, the error of its estimate and of its gap, its end."""
    way = np.linalg.norm(np.diff(f.track[:, :, :3], axis=0), axis=2).sum(axis=0)
    off = np.linalg.norm(f.track[:, :, T_OWN : T_OWN + 3] - f.track[:, :, :3], axis=2)
    gaps = [None, *_column(f)["rms_m"]] if asked.task in COLUMNS else [None] * len(way)
    out: list[dict[str, Any]] = []
    for i in range(len(way)):
        last = int(f.track[-1, i, T_AHEAD])
        end = f"follows {last}" if last >= 0 else "leads" if asked.task in COLUMNS and i == 0 else ""
        end = "out of the column" if f.aside[i] else end or ("at its goal" if f.there[i] else "not at its goal")
        out.append({
            "drone": i, "least_m": float(f.least[i]), "least_at_s": float(f.when[i]), "way_m": float(way[i]),
            "error_m": float(np.sqrt((off[:, i] ** 2).mean())), "gap_m": gaps[i], "end": end,
        })  # fmt: skip
    return out


def _column(f: Flown) -> dict[str, Any]:
    """Errors of the true gaps of every follower, once the column has settled; where it splits in the last minute."""
    settled = f.seconds - SETTLED_S if (f.track[:, :, T_LINE] > 0.0).any() else SETTLED_S
    e = spacing_errors(f)[round(settled / f.every_s) :, 1:]
    followed = np.isfinite(e)
    rms = np.sqrt(np.sum(np.where(followed, e, 0.0) ** 2, axis=0) / np.maximum(followed.sum(axis=0), 1))
    known = [float(r) if n else None for r, n in zip(rms, followed.sum(axis=0), strict=True)]
    return {"rms_m": known, "largest_m": np.abs(np.where(followed, e, 0.0)).max(axis=0).tolist()}


def nearest_each(track: Floats) -> Floats:
    """(rows, N) m, from each to the next one, in space."""
    from scipy.spatial import KDTree  # slow to import

    return np.array([KDTree(row[:, :3]).query(row[:, :3], k=2)[0][:, 1] for row in track])
