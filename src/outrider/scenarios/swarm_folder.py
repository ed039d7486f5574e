"""The folder of a swarm: what everybody estimated as a recording, the truth as a table, numbers, page and picture."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from outrider.data import EventLog
from outrider.data.events import Kind, Stream, stream
from outrider.io import folders
from outrider.io.columns import write_columns
from outrider.io.record import write_recording
from outrider.scenarios.swarm import RANKS, Flown, Task, spacing_errors
from outrider.scenarios.swarm_runs import COLUMNS, MARKER, SCHEMA, nearest_each
from outrider.scenarios.swarm_state import T_AHEAD, T_ARC, T_OWN, T_RANK, T_SPEED
from outrider.sim.truth import EPOCH
from outrider.typing import Floats, Ints

RECORDING, TRUTH, REPORT, PICTURE = "run.mcap", "truth.parquet", "report.html", "swarm.png"
MOST_MESSAGES: Final = 200_000  # of the recording; beyond it every so many rows are left out
DRAWN: Final = 1500  # moments of a picture


def write_swarm(
    summary: Mapping[str, Any], flown: Flown, task: Task, folder: Path, *, force: bool = False, report: bool = True,
    command: str = "",
) -> None:  # fmt: skip
    """run.mcap, truth.parquet, report.html, swarm.png, summary.json; the folder is there whole or not at all."""
    with folders.result_folder(folder, MARKER, SCHEMA, force=force) as part:
        write_recording(recording(flown), part / RECORDING)
        write_columns(truth(flown), part / TRUTH)
        _draw(summary, flown, task, part, report=report, command=command)
        folders.write_marker(part, MARKER, summary)


def recording(flown: Flown) -> EventLog:
    """Everybody's own estimate, at most `MOST_MESSAGES` in all. Noses are not simulated: they point east."""
    rows, n = flown.track.shape[:2]
    keep = slice(None, None, -(-rows * n // MOST_MESSAGES))
    t = _stamps(flown)[keep]
    streams = dict[str, Stream]()
    for i, name in enumerate(names(n)):
        own = flown.track[keep, i, T_OWN : T_OWN + 6]
        z = np.hstack([own[:, :3], np.tile([0.0, 0.0, 0.0, 1.0], (len(own), 1)), own[:, 3:]])
        made = stream(f"{name}/estimate", Kind.ESTIMATE, t, z, robot=name, frame="base_link")
        streams[made.name] = made
    return EventLog(streams=streams)


def names(n: int) -> list[str]:
    """drone_00 to drone_(n - 1)."""
    return [f"drone_{i:0{len(str(n - 1))}d}" for i in range(n)]


def truth(flown: Flown) -> dict[str, Any]:
    """Columns of a table with a row per moment and drone; follows is -1 for who follows nobody."""
    rows, n = flown.track.shape[:2]
    x = flown.track.reshape(rows * n, -1)
    return {
        "t_ns": np.repeat(_stamps(flown), n), "drone": np.tile(np.arange(n), rows), "east_m": x[:, 0],
        "north_m": x[:, 1], "up_m": x[:, 2], "speed_m_s": x[:, T_SPEED], "along_m": x[:, T_ARC],
        "follows": x[:, T_AHEAD].astype(np.int64), "decided_by": np.array(RANKS)[x[:, T_RANK].astype(np.int64)],
    }  # fmt: skip


def _stamps(flown: Flown) -> Ints:
    return EPOCH + np.round(1e9 * flown.every_s * np.arange(len(flown.track))).astype(np.int64)


def _draw(
    summary: Mapping[str, Any], flown: Flown, task: Task, part: Path, *, report: bool, command: str
) -> None:  # fmt: skip
    from outrider.plot.style import save_png
    from outrider.plot.swarm import decided_figure, distances_figure, gaps_figure, swarm_figure, swarm_page

    in_column = summary["task"] in COLUMNS
    every = -(-len(flown.track) // DRAWN)
    track, every_s = flown.track[::every], every * flown.every_s
    spans = [slice(k, k + every) for k in range(0, len(flown.track), every)]
    nearest = np.array([nearest_each(flown.track[span]).min(axis=0) for span in spans])
    above = swarm_figure(track[:, :, :2], every_s, nearest, summary["separation_m"], task.walls,
                         _arcs(track) if in_column else None)  # fmt: skip
    save_png(above, part / PICTURE)
    if not report:
        return
    figures = [("From above", "Rings: where they start; dots: where they end. East is right, north is up.", above)]
    if in_column:
        near = distances_figure(every_s, nearest, summary["separation_m"])
        figures.append(("How near", "Centre to centre, in space.", near))
        errors = gaps_figure(spacing_errors(flown)[::every, 1:], every_s)
        text = "True gap to the one ahead less the wanted one. White: as wanted, or not in the column."
        figures.append(("Gaps", text, errors))
    ranks = flown.track[:, :, T_RANK].astype(np.int64)
    highest = np.array([ranks[span].max(axis=0) for span in spans])
    figures.append(("What decided", "Of each drone the highest rank in that time.",
                    decided_figure(highest, every_s, RANKS)))  # fmt: skip
    (part / REPORT).write_text(swarm_page(dict(summary), figures, command=command), encoding="utf-8")


def _arcs(track: Floats) -> Floats:
    """(rows, N) m along the trail, NaN for who is not in a column; the leader is in it."""
    led = np.arange(track.shape[1]) == 0
    return np.where((track[:, :, T_AHEAD] >= 0) | led, track[:, :, T_ARC], np.nan)
