"""Fifty rovers and fifty drones of which nothing was written down: how often the truth lies in the interval."""

import platform
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from evidence_table import commit, cpu

from calibration_logs import True_, flown, steered, tracked, tumbled, wandering, wheeled
from outrider.data import EventLog
from outrider.workflows.calibration import calibrate
from outrider.workflows.calibration.calibrate import by_whole_path, patient
from outrider.workflows.calibration.row import VAGUE, Row
from outrider.workflows.config import FuseConfig

pytestmark = pytest.mark.evidence
PAGE = Path(__file__).resolve().parents[2] / "docs" / "evidence" / "calibration.md"
SEEDS = range(1, 51)
HEAD = """# Calibration

Written by `pytest -m evidence tests/evidence/test_calibration_evidence.py`: generated logs, seeds 1 to 50, with lever
arms, delays, scales and mounts drawn anew (tests/calibration_logs.py), calibrated with nothing given. *Inside*: how
often the truth lay in the 95 % interval, of the seeds in which the parameter was found; 90 to 99 % is asked for.
"""


def whole(log: EventLog) -> Sequence[Row]:
    """All rows."""
    return calibrate(log, FuseConfig()).rows


def scales(log: EventLog) -> Sequence[Row]:
    """The speed scale by the whole path, which comes without a filter."""
    row = Row(source="wheels", what="speed scale", unit="", told=1.0, verdict=VAGUE)
    return by_whole_path([row], patient(log, FuseConfig()))


def strolling(seed: int) -> tuple[EventLog, True_]:
    """As long as the Husky's recording."""
    return wandering(seed, 400.0)


def table(
    make: Callable[[int], tuple[EventLog, True_]], find: Callable[[EventLog], Sequence[Row]]
) -> list[tuple[str, str, int, float, float, float]]:
    """Per parameter: found in so many seeds, inside, RMS error, median half width."""
    seen: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for seed in SEEDS:
        log, true = make(seed)
        rows = {(r.source, r.what): r for r in find(log)}
        for key, x in true.items():
            of = seen.setdefault(key, [])
            row = rows.get(key)  # none in a log that hardly moves
            if row is not None and row.found:
                of.append((row.value - x, row.half))
    out = []
    for (source, what), pairs in seen.items():
        e, half = np.array(pairs).reshape(-1, 2).T
        inside = float(np.mean(np.abs(e) <= half)) if e.size else float("nan")
        rms = float(np.sqrt(np.mean(e**2))) if e.size else float("nan")
        out.append((source, what, e.size, inside, rms, float(np.median(half)) if e.size else float("nan")))
        print(*out[-1])  # noqa: T201
    return out


def test_intervals_hold_what_they_promise() -> None:
    lines = [HEAD]
    misses: list[str] = []
    for name, make, find in (
        ("Rover, 80 s, RTK, wheels, IMU", wheeled, whole),
        ("Drone, 50 s, RTK, IMU", flown, whole),
        ("Car, 60 s, RTK, steering angles, IMU, magnetometer", steered, whole),
        ("Left and right wheels, 60 s, RTK, IMU", tracked, whole),
        ("Magnetometer and IMU, 60 s, turned by hand", tumbled, whole),
        ("Rover, 400 s, wheels, IMU, a receiver that wanders by 1.8 m", strolling, scales),
    ):
        lines += [f"## {name}", "", "| source | parameter | found | inside | RMS error | median half width |",
                  "|---|---|---|---|---|---|"]  # fmt: skip
        for source, what, found, inside, rms, half in table(make, find):
            lines.append(f"| {source} | {what} | {found} | {100 * inside:.0f} % | {rms:.2g} | {half:.2g} |")
            if found < 0.5 * len(SEEDS) or inside < 0.9:
                misses.append(lines[-1])
        lines.append("")
    lines += [f"Machine: {cpu()}, Python {platform.python_version()}. Code of commit {commit()}.", ""]
    PAGE.write_text("\n".join(lines), encoding="utf-8")
    assert not misses, misses
