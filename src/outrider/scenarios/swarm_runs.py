"""A swarm as a user runs it: by the name of its task, into a folder with a summary and a picture."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any, Final, final

import numpy as np

from outrider.errors import ConfigError, UsageError
from outrider.guidance.avoidance import Avoidance
from outrider.guidance.column import Spacing
from outrider.io import folders
from outrider.scenarios.swarm import DT, RANKS, VEHICLE, Flown, Sky, Task, fly_swarm, spacing_errors
from outrider.scenarios.swarm_state import T_AHEAD, T_ARC
from outrider.scenarios.swarm_tasks import circle, column, crossed, crossing, doorway, head_on
from outrider.typing import Floats

MARKER: Final = "summary.json"
SCHEMA: Final = "outrider.swarm/1"
SWAPS: Final[Mapping[str, Callable[[int], Task]]] = {
    "circle": circle, "head-on": head_on, "crossing": crossing, "doorway": doorway,
}  # fmt: skip
COLUMNS: Final = ("column", "crossed")
NAMES: Final = (*SWAPS, *COLUMNS)
STRANGERS: Final = 5  # that cross a column
MOST: Final = 1000
SETTLED_S: Final = 60.0  # of a column, after which its gaps count


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """What a user asks for. drones : with the leader of a column;  seconds : of a column;  silent : of a column, drone
    and from when to when its radio is dead [s]."""

    task: str = "circle"
    drones: int = 16
    seconds: float = 600.0
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
        if self.task in COLUMNS and not self.seconds >= 2.0 * SETTLED_S:
            raise UsageError(f"{self.seconds:g} s", where="--duration", fix=f"{2.0 * SETTLED_S:g} s or more")
        if self.task == "crossed" and self.drones < STRANGERS + 2:
            raise UsageError(
                f"{self.drones} drones", where="--drones", fix=f"{STRANGERS} strangers, a leader, a follower"
            )
        if self.silent and self.task != "column":
            raise UsageError("is of a column", where="--silent", fix="leave it out")
        if any(not 0 < d < self.drones or not 0.0 <= a < b for d, a, b in self.silent):
            raise UsageError("names no follower, or no span", where="--silent", fix="DRONE,FROM,TO, e.g. 17,60,90")


def fly_task(asked: Asked) -> tuple[dict[str, Any], Flown, Task]:
    """Fly it; the summary, SI units."""
    rules, spacing = _rules(asked), Spacing()
    sky = Sky(loss=asked.loss, late_s=asked.late_s, radio=40.0 if asked.task in COLUMNS else 60.0)
    begin = perf_counter()
    if asked.task in COLUMNS:
        spacing.check(VEHICLE.tau_s, DT, asked.late_s)
        if asked.task == "column":
            task = column(asked.drones, asked.seconds, asked.seed, silent=asked.silent)
        else:
            task = crossed(asked.drones, asked.seconds, asked.seed, strangers=STRANGERS)
        done = fly_swarm(task, asked.seed, sky=sky, rules=rules, spacing=spacing, until_there=False, room=32)
    else:
        task = SWAPS[asked.task](asked.drones)
        done = fly_swarm(task, asked.seed, sky=sky, rules=rules)
    return _summary(asked, done, perf_counter() - begin), done, task


def _rules(asked: Asked) -> Avoidance:
    """A column at 8.5 m and places 5 m apart leave no room for more than so much."""
    if not 0.5 <= asked.separation <= 2.5:
        raise ConfigError(f"is {asked.separation:g} m", where="--separation", fix="from 0.5 to 2.5 m")
    return Avoidance(separation=asked.separation)


def _summary(asked: Asked, f: Flown, wall: float) -> dict[str, Any]:
    near = int(f.least.argmin())
    lost, stuck = int(f.aside.sum()), int(len(f.there) - f.there.sum()) if asked.task not in COLUMNS else 0
    outcome = "violated" if f.violations or f.in_walls else "stuck" if stuck else "done"
    text = {
        "violated": f"two drones came nearer than {asked.separation:g} m, or one a wall",
        "stuck": f"{stuck} of {len(f.there)} drones did not get to their goals in time",
        "done": "nobody came too near, and all are where they should be" if not lost
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
        "column": _column(f) if asked.task in COLUMNS else None,
    }  # fmt: skip


def _column(f: Flown) -> dict[str, Any]:
    """Errors of the true gaps of every follower, once the column has settled."""
    e = spacing_errors(f)[round(SETTLED_S / f.every_s) :, 1:]
    followed = np.isfinite(e)
    rms = np.sqrt(np.sum(np.where(followed, e, 0.0) ** 2, axis=0) / np.maximum(followed.sum(axis=0), 1))
    return {"rms_m": rms.tolist(), "largest_m": np.abs(np.where(followed, e, 0.0)).max(axis=0).tolist()}


def nearest_two(track: Floats) -> Floats:
    """(rows,) m, the least distance between any two."""
    from scipy.spatial import KDTree  # slow to import

    return np.array([KDTree(row[:, :3]).query(row[:, :3], k=2)[0][:, 1].min() for row in track])


def write_swarm(summary: Mapping[str, Any], flown: Flown, task: Task, folder: Path, *, force: bool = False) -> None:
    """summary.json and swarm.png; the folder is there whole or not at all."""
    from outrider.plot.style import save_png
    from outrider.plot.swarm import swarm_figure  # imports matplotlib

    track = flown.track
    arcs = None
    if summary["task"] in COLUMNS:
        arcs = np.where((track[:, :, T_AHEAD] >= 0) | (np.arange(track.shape[1]) == 0), track[:, :, T_ARC], np.nan)
    with folders.result_folder(folder, MARKER, SCHEMA, force=force) as part:
        figure = swarm_figure(
            track[:, :, :2], flown.every_s, nearest_two(track), summary["separation_m"], task.walls, arcs
        )
        save_png(figure, part / "swarm.png")
        folders.write_marker(part, MARKER, summary)
