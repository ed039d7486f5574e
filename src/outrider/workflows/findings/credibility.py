"""Whether the run as a whole can be believed: how sure it is of itself, and how much of its time anything was heard."""

from typing import Final

import numpy as np

from outrider.data import Finding, Run
from outrider.data.trajectory import LOST
from outrider.filters.align import Alignment
from outrider.workflows.draft import Plan
from outrider.workflows.findings.say import any_absolute, error, warning

STRAYED: Final = 100.0  # m at the end where a source of position was at hand
TINY: Final = 0.05  # share of the time with a valid position below which the run has failed


def credible(run: Run, chosen: Plan, aligned: Alignment) -> list[Finding]:
    """A position that is lost by kilometres at the end or most of the time, or valid hardly ever."""
    P = run.fused.pose.P
    if not len(P):
        return []
    sd = np.sqrt(np.maximum(np.maximum(P[:, 0, 0], P[:, 1, 1]), 0.0))
    share = run.valid_shares[0]
    strayed = any_absolute(chosen) and not run.fused.valid[-1, 0] and sd[-1] > STRAYED
    if strayed or not sd[-1] <= LOST:
        text = f"the position is only known to {sd[-1]:.3g} m at the end"
    elif not np.median(sd) <= LOST:
        text = f"the position is only known to {np.median(sd):.3g} m most of the time"
    elif share < TINY:
        text = f"the position is valid for {share:.1%} of the time only"
    else:
        return []
    fix = "look for sources that fell silent or were refused; without a source of position it drifts"
    return [error("not-credible", text, fix=fix)]


def silences(run: Run, chosen: Plan, aligned: Alignment) -> list[Finding]:
    """Times in which nothing usable was recorded; after each the job starts anew from the first position told."""
    gaps = run.silences
    if not len(gaps):
        return []
    begin, longest = gaps[int(np.argmax(gaps[:, 1]))]
    times = "once" if len(gaps) == 1 else f"{len(gaps)} times, the longest"
    text = f"no source was heard {times} for {longest:.0f} s from t = {begin:.0f} s: that time is not counted, "
    text += (
        "the estimate begins anew after it" if any_absolute(chosen) else "the estimate goes on as if nothing happened"
    )
    return [
        warning("silence", text, fix="a robot switched off or a clock set anew: `--start` and `--end` take one part")
    ]
