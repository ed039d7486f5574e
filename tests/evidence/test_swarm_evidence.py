"""Swarms: fifty in column for an hour, swaps with 2 to 64 drones, disturbances down a column.

OUTRIDER_SEEDS is the number of seeds of the swaps (10); a third of them, at least one, of the hour.
"""

import os
from dataclasses import replace

import numpy as np
import pytest

from outrider.guidance.avoidance import Avoidance
from outrider.scenarios.swarm import RANKS, Flown, Sky, fly_swarm, spacing_errors
from outrider.scenarios.swarm_tasks import circle, column, crossed, crossing, doorway, head_on
from published import publish

pytestmark = pytest.mark.evidence

SEEDS = range(int(os.environ.get("OUTRIDER_SEEDS", "10")))
HOURS = SEEDS[: max(1, len(SEEDS) // 3)]
R_D = Avoidance().separation
TRAIL = Sky(radio=40.0)
OUT = ((17, 600.0, 640.0), (34, 1800.0, 1920.0))  # drone, without a radio from, to [s]


def shares(flown: list[Flown]) -> str:
    ranks = sum(f.ranks.sum(axis=0) for f in flown)
    return ", ".join(f"{name} {share:.2%}" for name, share in zip(RANKS[2:], (ranks / ranks.sum())[2:], strict=True))


def swap(name: str, task, n: int) -> tuple[tuple[str, ...], list[Flown]]:
    flown = [fly_swarm(task(n), seed) for seed in SEEDS]
    least, took = [float(f.least.min()) for f in flown], [f.seconds for f in flown]
    there = sum(bool(f.there.all()) for f in flown)
    row = (f"{name}, {n} drones", f"{len(flown)}", f"{there} of {len(flown)}", f"{min(least):.2f}",
           f"{np.mean(least):.2f}", f"{sum(f.violations + f.in_walls for f in flown)}",
           f"{np.mean(took):.0f} ({min(took):.0f} to {max(took):.0f})", shares(flown))  # fmt: skip
    return row, flown


def silenced(task):
    silent = np.full((32, 1, 2), np.inf)
    silent[3, 0] = 5.0, 25.0
    return lambda n: replace(task(n), silent=silent[:n])


def hour(seed: int) -> tuple[tuple[str, ...], Flown]:
    f = fly_swarm(column(51, 3600.0, seed, silent=OUT), seed, sky=TRAIL, until_there=False, room=32)
    e = spacing_errors(f)[round(120.0 / f.every_s) :]
    rms = np.sqrt(np.nanmean(e[:, 1:] ** 2, axis=0))
    said = f"RMS of spacing errors [m]: drone 1 {rms[0]:.2f}, 25 {rms[24]:.2f}, 50 {rms[49]:.2f}; " + shares([f])
    out = f"{51 - int(f.aside.sum())} of 51 in column"
    row = (f"column of 50 behind a leader, seed {seed}", "1", out, f"{f.least.min():.2f}", f"{f.least.min():.2f}",
           f"{f.violations}", f"{f.seconds:.0f}", said)  # fmt: skip
    return row, f


def stability() -> tuple[float, float, str]:
    """The largest gain of the spacing error from one follower to the next: of the peak, of the 2-norm."""
    task = column(31, 240.0, 0)
    pace = np.zeros(2400)
    pace[1200:1500], pace[1650:1850], pace[1850:] = 3.0, 3.0, 1.2
    f = fly_swarm(replace(task, pace=pace), 0, until_there=False, sky=Sky(noisy=False), every=1, room=32)
    e = spacing_errors(f)[1200:, 1:]
    peak, norm = np.abs(e).max(axis=0), np.linalg.norm(e, axis=0)
    said = f"peak {peak[0]:.2f} m at the first, {peak[9]:.2f} at the 10th, {peak[29]:.2f} at the 30th follower"
    return float((peak[1:] / peak[:-1]).max()), float((norm[1:] / norm[:-1]).max()), said


def test_swarms() -> None:
    rows: list[tuple[str, ...]] = []
    swaps: list[Flown] = []
    for name, task in {"circle": circle, "head-on": head_on, "crossing": crossing, "doorway": doorway}.items():
        for n in (2, 4, 8, 16, 32, 64):
            row, flown = swap(name, task, n)
            rows.append(row)
            swaps += flown
    for name, task in {"circle": circle, "crossing": crossing}.items():
        row, flown = swap(f"{name}, one without a radio from 5 to 25 s", silenced(task), 32)
        rows.append(row)
        swaps += flown
    columns = [fly_swarm(crossed(25, 150.0, seed), seed, sky=TRAIL, until_there=False, room=24) for seed in SEEDS]
    met, through = [float(f.least.min()) for f in columns], sum(bool(f.there[-5:].all()) for f in columns)
    rows.append(("5 strangers through a column of 20", f"{len(columns)}", f"{through} of {len(columns)}",
                 f"{min(met):.2f}", f"{np.mean(met):.2f}", f"{sum(f.violations for f in columns)}", "150",
                 shares(columns)))  # fmt: skip
    for seed in HOURS:
        row, f = hour(seed)
        rows.append(row)
        columns.append(f)
    peak, norm, said = stability()
    rows.append(("30 followers, exact sensors, still air, a leader that stops dead", "1", "", "", "", "", "240",
                 f"largest gain from one to the next: peak {peak:.3f}, 2-norm {norm:.3f}; {said}"))  # fmt: skip
    sky = Sky()
    publish(
        "swarm", "Many drones",
        f"Simulated by `outrider.scenarios.swarm`, swaps with seeds {SEEDS[0]} to {SEEDS[-1]}. Every drone: velocity "
        f"lag 0.5 s, 4 m/s^2, commands 0.1 s late, decisions and fixes at 10 Hz (white, {sky.fix_p:g} m and "
        f"{sky.fix_v:g} m/s an axis), a filter of its own, wind {sky.wind:g} m/s with gusts of {sky.gust:g} m/s; "
        f"neighbours known by radio only, {sky.loss:.0%} of messages lost, the others 0.1 to {sky.late_s:g} s late. A "
        f"violation is a decision of a drone with another truly nearer than {R_D:g} m, or a wall nearer than "
        f"{0.5 * R_D:g} m. The hour: a leader at up to 3 m/s round bends of 10 m, changing its speed and stopping "
        f"dead at random times, drone {OUT[0][0]} without a radio for 40 s and drone {OUT[1][0]} for 120 s. Shares are "
        f"of decisions, by the highest rank that changed them.",
        ("what", "runs", "all there", "least distance [m]", "mean of least [m]", "violations", "time [s]", "remarks"),
        rows,
    )  # fmt: skip
    assert all(f.there.all() for f in swaps)
    assert sum(f.violations + f.in_walls for f in (*swaps, *columns)) == 0
    assert min(float(f.least.min()) for f in (*swaps, *columns)) >= R_D
    assert through == len(SEEDS)
    assert peak <= 1.0 and norm <= 1.0
    assert not any(f.aside.any() for f in columns)
