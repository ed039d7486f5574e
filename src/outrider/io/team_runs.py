"""The folder of a team's run: what `outrider fuse` leaves behind for a recording of several robots.

summary.json      `outrider.team/1`, what scripts read      tracks.png    the way of everybody, and the landmarks
NAME.tum          map -> base_link of each robot            errors.png    errors in their bands, if there is truth
estimates.parquet all states of everybody                   config.yaml   the resolved configuration
sightings.parquet every sighting and what became of it
"""

from collections.abc import Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, Final

import numpy as np

from outrider.core.attitudes import rpy_to_quats
from outrider.data import Trajectory
from outrider.data.team_run import REASONS, RobotEstimate, TeamRun
from outrider.io import folders
from outrider.io.columns import write_columns
from outrider.io.config import yaml_text
from outrider.io.tum import write_tum

SCHEMA: Final = "outrider.team/1"
SUMMARY, CONFIG = "summary.json", "config.yaml"
ESTIMATES, SIGHTINGS = "estimates.parquet", "sightings.parquet"
TRACKS, ERRORS = "tracks.png", "errors.png"


def team_folder(folder: Path, *, force: bool = False) -> AbstractContextManager[Path]:
    """A hidden directory to `write_team` into, which takes the place of `folder` when the block succeeds."""
    return folders.result_folder(folder, SUMMARY, SCHEMA, force=force)


def ensure_free(folder: Path, *, force: bool = False) -> None:
    """Refuse, before the work is done, a place that `team_folder` would refuse."""
    folders.ensure_free(folder, SUMMARY, SCHEMA, force=force)


def write_team(run: TeamRun, folder: Path, summary: Mapping[str, object]) -> None:
    """Every file of a team's run but the pictures. Comes last: `summary` is stored with the list of files."""
    for r in run.robots:
        write_tum(pose_of(r), folder / f"{r.name.replace('/', '_')}.tum")
    write_columns(_estimates(run), folder / ESTIMATES)
    write_columns(_sightings(run), folder / SIGHTINGS)
    text = yaml_text(folders.plain(run.config))
    head = f"# What this run was made with. To use it again: outrider fuse LOG -c {CONFIG}\n"
    (folder / CONFIG).write_text(head + text, encoding="utf-8")
    folders.write_marker(folder, SUMMARY, summary)


def pose_of(r: RobotEstimate) -> Trajectory:
    """A robot's poses as a trajectory."""
    flat = np.zeros(r.t.size)
    q = rpy_to_quats(np.column_stack([flat, flat, r.x[:, 2]]))
    return Trajectory(t=r.t, p=np.column_stack([r.x[:, :2], flat]), q=q, name=r.name)


def _estimates(run: TeamRun) -> dict[str, Any]:
    """t_ns, robot, every state and its standard deviation `sigma_NAME`."""
    rs = run.robots
    names = list(rs[0].states)
    columns: dict[str, Any] = {
        "t_ns": np.concatenate([r.t for r in rs]), "robot": [r.name for r in rs for _ in range(r.t.size)],
    }  # fmt: skip
    columns |= {n: np.concatenate([r.states[n] for r in rs]) for n in names}
    return columns | {f"sigma_{n}": np.concatenate([r.sigmas[n] for r in rs]) for n in names}


def _sightings(run: TeamRun) -> dict[str, Any]:
    s = run.sightings
    return {
        "t_ns": s.t, "robot": [run.names[i] for i in s.robot.tolist()], "subject": s.subject, "range": s.z[:, 0],
        "bearing": s.z[:, 1], "what": [REASONS[k].name.lower() for k in s.what.tolist()], "nis": s.nis,
    }  # fmt: skip
