"""What a filter carries from event to event: its state, its model and sources as kernels see them, and scratch."""

from typing import Final, NamedTuple

import numpy as np

from outrider.filters.ekf import Work, workspace
from outrider.filters.health import H_LAST, H_LAST_GOOD, H_SIZE
from outrider.models.kinematics import K_SIZE, T_SIZE
from outrider.typing import Floats, Ints

ROWS: Final = 8  # most rows in one measurement

# clock columns of State
C_NOW, C_INPUT, C_EVENTS, C_RESETS, C_NEXT = 0, 1, 2, 3, 4
C_SIZE: Final = 8


class State(NamedTuple):
    """Everything that events change."""

    x: Floats  # (layout.size,)
    P: Floats  # (n, n)
    u: Floats  # (6,) the input at the time of the estimate
    fed: Floats  # (2, 6) the last record of the input and, where it is known, the next
    clock: Floats  # (C_SIZE,) time of the estimate [s], of these two records [s], counts
    health: Floats  # (sources, H_SIZE)
    age: Floats  # (n,) s: when a direct measurement last corrected each error row, for the validity flags


class Model(NamedTuple):
    """A process model, as the kernels see it."""

    code: int
    theta: Floats
    coasting: Floats  # theta while the input is missing
    table: Ints  # block table of the layout
    limits: Floats  # longest step [s], input hold [s], reset: time [s], records, speed bound [m/s], margin [m]
    keep: Floats  # (n,) 1 estimated, 0 considered


class Sources(NamedTuple):
    """What the kernels need to know of every source; row = source."""

    code: Ints  # Sensor, or INPUT_SENSOR
    theta: Floats  # (sources, THETA_SIZE)
    gate: Floats  # (sources, ROWS + 1) threshold by degrees of freedom
    reset: Ints  # (sources, 2) first error row a reset may move, and how many; 0 rows: never


class Scratch(NamedTuple):
    """Work arrays of one filter."""

    F: Floats
    Q: Floats
    k: Floats
    K: Floats
    y: Floats
    D: Floats
    H: Floats
    r: Floats
    row: Ints  # which of its sensor's rows each row in use is
    w: Work
    x_before: Floats
    P_before: Floats
    u_before: Floats
    u_last: Floats


def scratch(size: int, n: int) -> Scratch:
    """Work arrays for a state of `size` numbers and n error states."""
    return Scratch(
        F=np.eye(n),
        Q=np.zeros((n, n)),
        k=np.zeros(K_SIZE),
        K=np.zeros((T_SIZE, n)),
        y=np.zeros(ROWS + 1),
        D=np.zeros((ROWS + 1, T_SIZE)),
        H=np.zeros((ROWS + 1, n)),
        r=np.zeros(ROWS + 1),
        row=np.zeros(ROWS + 1, np.int64),
        w=workspace(n, ROWS + 1),
        x_before=np.zeros(size),
        P_before=np.zeros((n, n)),
        u_before=np.zeros(6),
        u_last=np.zeros(6),
    )


def state(x: Floats, P: Floats, t: float, sources: int) -> State:
    """A state at time t [s] with no history."""
    health = np.zeros((sources, H_SIZE))
    health[:, H_LAST_GOOD] = health[:, H_LAST] = t
    clock = np.zeros(C_SIZE)
    clock[C_NOW], clock[C_INPUT], clock[C_NEXT] = t, -np.inf, -np.inf
    return State(x.copy(), P.copy(), np.zeros(6), np.zeros((2, 6)), clock, health, np.full(P.shape[0], -np.inf))


def snapshot(s: State) -> State:
    """A copy that later events do not change."""
    return State(*(a.copy() for a in s))


def restore(s: State, saved: State) -> None:
    """Bring a state back to a snapshot, in place."""
    for a, b in zip(s, saved, strict=True):
        a[...] = b
