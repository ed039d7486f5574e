"""The folder of a run: what `outrider fuse` leaves behind, and what can be read back.

report.html          the report                          summary.json   `outrider.run/1`, what scripts read
fused.tum            map -> base_link, for evo           config.yaml    the resolved configuration, to be used again
local.tum            odom -> base_link                   track.geojson  the path on a map, if the site has a datum
estimates.parquet    every state with its deviation      run.mcap       ROS 2 messages for Foxglove and the like
innovations.parquet  every record against the estimate
"""

from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from typing import Any

from outrider.data import Run, Trajectory
from outrider.io import folders
from outrider.io.config import yaml_text
from outrider.io.innovations import write_innovations
from outrider.io.mcap import write_mcap
from outrider.io.trajectories import read_table, write_geojson, write_table
from outrider.io.tum import write_tum

SCHEMA = "outrider.run/1"
SUMMARY, CONFIG, REPORT, ESTIMATES = "summary.json", "config.yaml", "report.html", "estimates.parquet"
INNOVATIONS = "innovations.parquet"
FUSED, LOCAL, TRACK, MCAP = "fused.tum", "local.tum", "track.geojson", "run.mcap"


def run_folder(folder: Path, *, force: bool = False) -> AbstractContextManager[Path]:
    """A hidden directory to `write_run` into, which takes the place of `folder` when the block succeeds."""
    return folders.result_folder(folder, SUMMARY, SCHEMA, force=force)


def ensure_free(folder: Path, *, force: bool = False) -> None:
    """Refuse, before the work is done, a place that `run_folder` would refuse."""
    folders.ensure_free(folder, SUMMARY, SCHEMA, force=force)


def write_run(run: Run, folder: Path, summary: Mapping[str, object]) -> None:
    """Every file of a run but the report. Comes last: `summary` is stored with the list of the files that are there."""
    pose = replace(run.fused.pose, datum=run.datum, name=run.robot)
    write_tum(pose, folder / FUSED)
    if run.local is not None:
        write_tum(run.local.pose, folder / LOCAL)
    write_table(replace(run, fused=replace(run.fused, pose=pose)), folder / ESTIMATES)
    write_innovations(run, folder / INNOVATIONS)
    if run.datum is not None:
        write_geojson(pose, folder / TRACK)
    write_mcap(run, folder / MCAP)
    _write_config(run.config, folder / CONFIG)
    folders.write_marker(folder, SUMMARY, summary)


def read_summary(folder: Path) -> dict[str, Any]:
    """The summary of a run's folder; `DataError` if there is none that this version understands."""
    return folders.read_marker(folder, SUMMARY, SCHEMA)


def read_fused(folder: Path) -> Trajectory:
    """The fused trajectory of a run's folder with velocity, covariance and datum."""
    read_summary(folder)
    return replace(read_table(folder / ESTIMATES), name=folder.name)


def is_run_folder(path: Path) -> bool:
    """Whether a directory holds a run."""
    return folders.is_result(path, SUMMARY, SCHEMA)


def _write_config(config: Mapping[str, object], path: Path) -> None:
    text = yaml_text(folders.plain(config))
    path.write_text(
        f"# What this run was made with. To use it again: outrider fuse LOG -c {path.name}\n{text}", "utf-8"
    )
