"""Swarms: fifty in column for an hour, swaps with 2 to 64 drones, disturbances down a column.

OUTRIDER_SEEDS is the number of seeds (10), from FIRST on, since the first hundred were used in tuning; a third of them,
at least one, of the hour. With OUTRIDER_TRIALS rows are kept in that folder, and OUTRIDER_ROWS=circle computes only
those whose name begins so, to do it in parts.
"""

import json
import os
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from outrider.guidance.avoidance import Avoidance
from outrider.scenarios.swarm import RANKS, Flown, Sky, fly_swarm, spacing_errors
from outrider.scenarios.swarm_state import T_AHEAD
from outrider.scenarios.swarm_tasks import circle, column, convoy, crossed, crossing, doorway, head_on
from published import code, publish

pytestmark = pytest.mark.evidence

FIRST = 100
SEEDS = range(FIRST, FIRST + int(os.environ.get("OUTRIDER_SEEDS", "10")))
HOURS = SEEDS[: max(1, len(SEEDS) // 3)]
R_D = Avoidance().separation
TRAIL = Sky(radio=40.0)
OUT = ((17, 600.0, 640.0), (34, 1800.0, 1920.0))  # drone, without a radio from, to [s]


Row = dict[str, Any]


def shares(flown: list[Flown]) -> str:
    ranks = sum(f.ranks.sum(axis=0) for f in flown)
    return ", ".join(f"{name} {share:.2%}" for name, share in zip(RANKS[2:], (ranks / ranks.sum())[2:], strict=True))


def row(name: str, flown: list[Flown], good: list[bool], said: str = "") -> Row:
    """What is published of some flights, and what is asserted of them."""
    least, took = [float(f.least.min()) for f in flown], [f.seconds for f in flown]
    broken = sum(f.violations + f.in_walls for f in flown)
    cells = [name, len(flown), f"{sum(good)} of {len(good)}", f"{min(least):.2f}", f"{np.mean(least):.2f}", broken,
             f"{np.mean(took):.0f} ({min(took):.0f} to {max(took):.0f})", said + shares(flown)]  # fmt: skip
    return {"cells": cells, "least": min(least), "broken": broken, "good": all(good)}


def swap(name: str, task, n: int) -> Row:
    flown = [fly_swarm(task(n), seed) for seed in SEEDS]
    return row(name, flown, [bool(f.there.all()) for f in flown])


def silenced(task):
    silent = np.full((32, 1, 2), np.inf)
    silent[3, 0] = 5.0, 25.0
    return lambda n: replace(task(n), silent=silent[:n])


def strangers() -> Row:
    flown = [fly_swarm(crossed(25, 150.0, seed), seed, sky=TRAIL, until_there=False, room=24) for seed in SEEDS]
    good = [bool(f.there[-5:].all() and not f.aside.any()) for f in flown]
    return row("5 strangers through a column of 20", flown, good)


def convoys(n: int) -> Row:
    """All in one column again, in the order that follows from who joins, leaves, splits off and merges."""
    flown = [fly_swarm(convoy(n, 300.0, s), s, sky=TRAIL, until_there=False, room=32) for s in SEEDS]
    order = [i for i in range(1, n) if i not in (2, n // 2 + 2)]
    good = [f.track[-1, order, T_AHEAD].astype(int).tolist() == [0, *order[:-1]] for f in flown]
    return row(f"convoy of {n}: one joins, two leave, split and merge", flown, good, "in the right order at the end; ")


def hour(seed: int) -> Row:
    f = fly_swarm(column(51, 3600.0, seed, silent=OUT), seed, sky=TRAIL, until_there=False, room=32)
    e = spacing_errors(f)[round(120.0 / f.every_s) :]
    rms = np.sqrt(np.nanmean(e[:, 1:] ** 2, axis=0))
    said = f"RMS of spacing errors [m]: drone 1 {rms[0]:.2f}, 25 {rms[24]:.2f}, 50 {rms[49]:.2f}; "
    return row(f"column of 50 behind a leader for an hour, seed {seed}", [f], [not f.aside.any()], said)


def stability() -> Row:
    """The largest gain of the spacing error from one follower to the next: of the peak, of the 2-norm."""
    task = column(31, 240.0, 0)
    pace = np.zeros(2400)
    pace[1200:1500], pace[1650:1850], pace[1850:] = 3.0, 3.0, 1.2
    f = fly_swarm(replace(task, pace=pace), 0, until_there=False, sky=Sky(noisy=False), every=1, room=32)
    e = spacing_errors(f)[1200:, 1:]
    peak, norm = np.abs(e).max(axis=0), np.linalg.norm(e, axis=0)
    said = f"peak {peak[0]:.2f} m at the first, {peak[9]:.2f} at the 10th, {peak[29]:.2f} at the 30th follower"
    gains = float((peak[1:] / peak[:-1]).max()), float((norm[1:] / norm[:-1]).max())
    text = f"largest gain from one to the next: peak {gains[0]:.3f}, 2-norm {gains[1]:.3f}; {said}"
    made = row("30 followers, exact sensors, still air, a leader that stops dead", [f], [max(gains) <= 1.0])
    return {**made, "cells": [*made["cells"][:-1], text]}


def parts() -> dict[str, Callable[[], Row]]:
    """What makes each row, by its name."""
    made: dict[str, Callable[[], Row]] = {}
    for name, task in {"circle": circle, "head-on": head_on, "crossing": crossing, "doorway": doorway}.items():
        for n in (2, 4, 8, 16, 32, 64):
            made[f"{name} {n}"] = partial(swap, f"{name}, {n} drones", task, n)
    for name, task in {"circle": circle, "crossing": crossing}.items():
        what = f"{name}, one without a radio from 5 to 25 s, 32 drones"
        made[f"silent {name}"] = partial(swap, what, silenced(task), 32)
    made["strangers"] = strangers
    for n in (9, 21, 51):
        made[f"convoy {n}"] = partial(convoys, n)
    for seed in HOURS:
        made[f"hour {seed}"] = partial(hour, seed)
    made["stability"] = stability
    return made


def kept(name: str, make: Callable[[], Row]) -> Row | None:
    """The row from the folder of rows, or made; None if it is not asked for."""
    folder = os.environ.get("OUTRIDER_TRIALS")
    path = Path(folder or ".") / f"swarm-{name.replace(' ', '-')}-{code()}-{len(SEEDS)}.json"
    if folder and path.exists():
        return json.loads(path.read_text())
    if not name.startswith(os.environ.get("OUTRIDER_ROWS", "")):
        return None
    made = make()
    if folder:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(made))
    return made


def test_swarms() -> None:
    found = {name: kept(name, make) for name, make in parts().items()}
    rows = [r for r in found.values() if r is not None]
    if len(rows) < len(found):
        pytest.skip(f"{len(rows)} of {len(found)} rows are there")
    sky = Sky()
    publish(
        "swarm", "Many drones",
        f"Code {code()}; `pytest -m evidence tests/evidence/test_swarm_evidence.py`. Simulated by "
        f"`outrider.scenarios.swarm`, swaps with seeds {SEEDS[0]} to {SEEDS[-1]}, none used in tuning. Every drone: "
        f"velocity lag 0.5 s, 4 m/s^2, commands 0.1 s late, decisions and fixes at 10 Hz (white, {sky.fix_p:g} m and "
        f"{sky.fix_v:g} m/s an axis), a filter of its own, wind {sky.wind:g} m/s with gusts of {sky.gust:g} m/s; "
        f"neighbours known by radio only, {sky.loss:.0%} of messages lost, the others 0.1 to {sky.late_s:g} s late. A "
        f"violation is a decision of a drone with another truly nearer than {R_D:g} m, or a wall nearer than "
        f"{0.5 * R_D:g} m. The hour: a leader at up to 3 m/s round bends of 10 m, changing its speed and stopping "
        f"dead at random times, drone {OUT[0][0]} without a radio for 40 s and drone {OUT[1][0]} for 120 s. Shares are "
        f"of decisions, by the highest rank that changed them.",
        ("what", "runs", "all there, or in column", "least distance [m]", "mean of least [m]", "violations", "time [s]",
         "remarks"),
        [tuple(r["cells"]) for r in rows],
    )  # fmt: skip
    assert all(r["good"] for r in rows)
    assert sum(r["broken"] for r in rows) == 0
    assert min(r["least"] for r in rows) >= R_D
