"""Health of every source, kept beside the state so that rewinding restores it: gates, streaks, sensor states, resets.

One row of `health` per source, columns `H_*`. All of it is plain numbers: a snapshot is a copy.
"""

from typing import Final

import numpy as np
from scipy.special import chdtri  # type: ignore[import-untyped]

from outrider._kernel import kernel
from outrider.data import SensorState, Verdict
from outrider.typing import Floats

H_STATE: Final = 0  # SensorState
H_GOOD: Final = 1  # records in a row that agreed
H_BAD: Final = 2  # records in a row that did not
H_SINCE: Final = 3  # s, when the row of disagreeing records began
H_LAST_GOOD: Final = 4  # s, last accepted record
H_LAST: Final = 5  # s, last record at all
H_RATE: Final = 6  # running share of disagreeing records
H_Y: Final = 7  # last rejected innovation, its first 3 rows
H_SIZE: Final = 10

WARMING, HEALTHY, SUSPECT, FAULTED, RECOVERING = (
    int(SensorState.WARMING),
    int(SensorState.HEALTHY),
    int(SensorState.SUSPECT),
    int(SensorState.FAULTED),
    int(SensorState.RECOVERING),
)
USED, GATED, FAULT, RESET = int(Verdict.USED), int(Verdict.GATED), int(Verdict.FAULTED), int(Verdict.RESET)

WARM_UP: Final = 3  # records that must agree before a source counts as healthy
PROBATION: Final = 5  # records that must agree before a faulted source is believed again
MEMORY: Final = 0.1  # weight of the newest record in the running share
SUSPICIOUS: Final = 0.3
FAULTY: Final = 0.8


def gates(probability: float = 0.999, rows: int = 9) -> Floats:
    """(rows + 1,) chi-square thresholds by degrees of freedom; entry 0 is not used."""
    return np.concatenate([[0.0], chdtri(np.arange(1, rows + 1), 1.0 - probability)])


@kernel
def judge(h: Floats, t: float, passes: bool, y: Floats) -> int:
    """Update one source's row for a record that passes its gate or not; returns USED, GATED or FAULTED.

    y : the innovation by rows, at least 3, NaN where there is none
    """
    h[H_RATE] += MEMORY * ((0.0 if passes else 1.0) - h[H_RATE])
    h[H_LAST] = t
    state = int(h[H_STATE])
    if not passes:
        if h[H_BAD] == 0.0:
            h[H_SINCE] = t
        h[H_BAD] += 1.0
        h[H_GOOD] = 0.0
        for i in range(3):
            h[H_Y + i] = y[i] if np.isfinite(y[i]) else 0.0
        if state == RECOVERING or h[H_RATE] > FAULTY:
            h[H_STATE] = FAULTED
        elif h[H_RATE] > SUSPICIOUS:
            h[H_STATE] = SUSPECT
        return GATED
    h[H_BAD] = 0.0
    h[H_GOOD] += 1.0
    if state == FAULTED:
        h[H_STATE] = RECOVERING
        return FAULT
    if state == RECOVERING and h[H_GOOD] < PROBATION:
        return FAULT
    if state == WARMING and h[H_GOOD] < WARM_UP:
        h[H_LAST_GOOD] = t
        return USED
    h[H_STATE] = SUSPECT if h[H_RATE] > SUSPICIOUS else HEALTHY
    h[H_LAST_GOOD] = t
    return USED


@kernel
def forgive(h: Floats, t: float) -> None:
    """After a reset towards this source it starts again as recovering, with a clean record."""
    h[H_STATE] = RECOVERING
    h[H_GOOD] = PROBATION
    h[H_BAD] = 0.0
    h[H_RATE] = 0.5
    h[H_LAST_GOOD] = t
