"""One event: predict to its time, form the innovation, gate it, correct or say why not.

Both drivers call `step`: the online one with one event at a time, the batch one from a compiled loop. All that an
event can change is in `State`, so a copy of it is a snapshot.
"""

from typing import Final, NamedTuple

import numpy as np

from outrider._kernel import kernel
from outrider.core.linalg import all_finite, chain, copy
from outrider.data import Verdict
from outrider.filters.ekf import Work, correct, innovate, workspace
from outrider.filters.ekf import propagate as propagate_covariance
from outrider.filters.health import H_BAD, H_LAST, H_LAST_GOOD, H_SINCE, H_SIZE, H_STATE, H_Y, forgive, judge
from outrider.models.kinematics import K_SIZE, T_SIZE
from outrider.models.motion import kinematic_view, propagate
from outrider.models.sensors.dispatch import evaluate
from outrider.typing import Floats, Ints

ROWS: Final = 8  # most rows in one measurement
OUT_VERDICT, OUT_NIS, OUT_DOF, OUT_Y, OUT_S = 0, 1, 2, 3, 3 + ROWS
OUT_STATE: Final = 3 + 2 * ROWS  # SensorState of the source after the event
OUT_SIZE: Final = OUT_STATE + 1
MOST_STEPS: Final = 2000  # prediction steps across one gap, however long
INPUT_SENSOR: Final = -1  # the code of a source that drives the prediction
MOST_INPUT: Final = 1e3  # rad/s, m/s^2: no vehicle feels more
MOST_VARIANCE: Final = 1e30  # an estimate with more has diverged

_USED, _WITHHELD, _GATED = int(Verdict.USED), int(Verdict.WITHHELD), int(Verdict.GATED)
_INPUT, _RESET, _NOT_OBSERVING, _NOT_ALIGNED, _IMPLAUSIBLE, _DIVERGED = (
    int(Verdict.INPUT),
    int(Verdict.RESET),
    int(Verdict.NOT_OBSERVING),
    int(Verdict.NOT_ALIGNED),
    int(Verdict.IMPLAUSIBLE),
    int(Verdict.DIVERGED),
)
_FAULTED = 3  # SensorState

# clock columns of State
C_NOW, C_INPUT, C_EVENTS, C_RESETS, C_MOVED = 0, 1, 2, 3, 4
C_SIZE: Final = 8


class State(NamedTuple):
    """Everything that events change."""

    x: Floats  # (layout.size,)
    P: Floats  # (n, n)
    u: Floats  # (6,) the last input
    clock: Floats  # (C_SIZE,) time of the estimate [s], of the last input [s], counts
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
    )


def state(x: Floats, P: Floats, t: float, sources: int) -> State:
    """A state at time t [s] with no history."""
    health = np.zeros((sources, H_SIZE))
    health[:, H_LAST_GOOD] = health[:, H_LAST] = t
    clock = np.zeros(C_SIZE)
    clock[C_NOW], clock[C_INPUT] = t, -np.inf
    return State(x.copy(), P.copy(), np.zeros(6), clock, health, np.full(P.shape[0], -np.inf))


def snapshot(s: State) -> State:
    """A copy that later events do not change."""
    return State(*(a.copy() for a in s))


def restore(s: State, saved: State) -> None:
    """Bring a state back to a snapshot, in place."""
    for a, b in zip(s, saved, strict=True):
        a[...] = b


@kernel
def predict(model: Model, s: State, t: float, ws: Scratch) -> None:
    """Carry x and P to time t in steps no longer than the model allows. Time never runs backwards here."""
    longest = max(model.limits[0], (t - s.clock[C_NOW]) / MOST_STEPS)
    while t > s.clock[C_NOW]:
        dt = t - s.clock[C_NOW]
        last = dt <= longest
        if not last:
            dt = longest
        if model.code == 1 and s.clock[C_NOW] - s.clock[C_INPUT] > model.limits[1]:
            coast(model, s, ws)
            propagate(model.code, s.x, dt, s.u, model.coasting, ws.F, ws.Q)
        else:
            propagate(model.code, s.x, dt, s.u, model.theta, ws.F, ws.Q)
        propagate_covariance(s.P, ws.F, ws.Q, ws.w)
        s.clock[C_NOW] = t if last else s.clock[C_NOW] + dt


@kernel
def coast(model: Model, s: State, ws: Scratch) -> None:
    """The input is missing: go on without turning and without accelerating, whatever the last record said."""
    kinematic_view(model.code, s.x, s.u, model.theta, ws.k, ws.K)
    for i in range(3):
        s.u[i] = ws.k[21 + i]
        s.u[3 + i] = ws.k[24 + i] + ws.k[3 + 6 + i] * model.coasting[12]  # bias + R' g


@kernel
def feed(model: Model, s: State, t: float, z: Floats, ws: Scratch) -> None:
    """A record of the input: the interval since the last one is crossed with the mean of the two."""
    fresh = s.clock[C_NOW] - s.clock[C_INPUT] <= model.limits[1]
    if fresh:
        for i in range(6):
            s.u[i] = 0.5 * (s.u[i] + z[i])
    predict(model, s, t, ws)
    for i in range(6):
        s.u[i] = z[i]
    s.clock[C_INPUT] = t


@kernel
def measure(model: Model, sources: Sources, s: State, src: int, z: Floats, r: Floats, ws: Scratch) -> int:
    """Innovation ws.y, Jacobian ws.H and variances ws.r of one record; rows without a finite variance are left out.

    Returns how many rows are in use; ws.row tells which of the sensor's they are.
    """
    kinematic_view(model.code, s.x, s.u, model.theta, ws.k, ws.K)
    rows = evaluate(sources.code[src], ws.k, z, sources.theta[src], ws.y, ws.D)
    m = 0
    for i in range(rows):
        if np.isfinite(r[i]) and r[i] >= 0.0 and np.isfinite(ws.y[i]):
            ws.y[m], ws.r[m], ws.row[m] = ws.y[i], r[i], i
            if m != i:
                for j in range(T_SIZE):
                    ws.D[m, j] = ws.D[i, j]
            m += 1
    chain(ws.D, ws.K, m, ws.H)
    return m


@kernel
def step(
    model: Model,
    sources: Sources,
    s: State,
    t: float,
    src: int,
    z: Floats,
    r: Floats,
    flag: int,
    ws: Scratch,
    out: Floats,
) -> None:
    """Process one event.

    t [s]; src row of `sources`; z (ROWS,) the record and r (ROWS,) its variances; flag: a `Verdict` the record already
    has (0 none, WITHHELD: score only, others: refused).  out (OUT_SIZE,): verdict, NIS, dof, y and its predicted std
    (both by the sensor's rows, NaN where one is not in use), SensorState.
    """
    for i in range(OUT_SIZE):
        out[i] = np.nan
    out[OUT_VERDICT], out[OUT_DOF], out[OUT_STATE] = flag, 0.0, s.health[src, H_STATE]
    if flag != _USED and flag != _WITHHELD:
        return
    s.clock[C_EVENTS] += 1.0
    keep(s, ws)
    if sources.code[src] == INPUT_SENSOR:
        out[OUT_VERDICT] = drive(model, s, src, t, z, ws)
        out[OUT_STATE] = s.health[src, H_STATE]
        return
    if t < s.clock[C_NOW]:  # only before the start: drivers keep time in order
        out[OUT_VERDICT] = _NOT_ALIGNED
        return
    predict(model, s, t, ws)
    if not healthy(s):
        undo(s, ws)
        out[OUT_VERDICT] = _DIVERGED
        return
    m = measure(model, sources, s, src, z, r, ws)
    if m == 0:
        out[OUT_VERDICT] = _NOT_OBSERVING
        return
    nis = innovate(s.P, ws.H, ws.r, ws.y, m, ws.w)
    out[OUT_NIS], out[OUT_DOF] = nis, m
    for i in range(m):
        out[OUT_Y + ws.row[i]], out[OUT_S + ws.row[i]] = ws.y[i], np.sqrt(ws.w.S[i, i])
    if flag == _WITHHELD:
        return
    if not np.isfinite(nis):
        out[OUT_VERDICT] = _DIVERGED
        return
    h = s.health[src]
    verdict = judge(h, t, nis <= sources.gate[src, m], out[OUT_Y:OUT_S])
    if verdict != _USED and reset_is_due(model, sources, s, src, t):
        widen(sources, s, src, m, ws)
        innovate(s.P, ws.H, ws.r, ws.y, m, ws.w)
        forgive(h, t)
        verdict = _RESET
    out[OUT_VERDICT], out[OUT_STATE] = verdict, h[H_STATE]
    if verdict in (_USED, _RESET):
        keep(s, ws)
        correct(s.x, s.P, ws.H, ws.r, m, model.keep, model.table, ws.w)
        if healthy(s):
            mark(s, t, m, ws)
        else:
            undo(s, ws)
            out[OUT_VERDICT] = _DIVERGED


@kernel
def drive(model: Model, s: State, src: int, t: float, z: Floats, ws: Scratch) -> int:
    """A record of the input through `feed`, unless it would spoil the estimate: then it is as if it had not come."""
    for i in range(6):
        if not abs(z[i]) <= MOST_INPUT:
            return _IMPLAUSIBLE
    now, last = s.clock[C_NOW], s.clock[C_INPUT]
    feed(model, s, t, z, ws)
    if not healthy(s):
        undo(s, ws)
        s.clock[C_NOW], s.clock[C_INPUT] = now, last
        return _DIVERGED
    s.health[src, H_LAST] = s.health[src, H_LAST_GOOD] = t
    s.health[src, H_STATE] = 1.0
    return _INPUT


@kernel
def keep(s: State, ws: Scratch) -> None:
    """Remember the estimate: nothing that is not a number ever leaves the filter."""
    copy(s.x, ws.x_before)
    copy(s.P, ws.P_before)
    copy(s.u, ws.u_before)


@kernel
def undo(s: State, ws: Scratch) -> None:
    """Back to what `keep` remembers. The time stays."""
    copy(ws.x_before, s.x)
    copy(ws.P_before, s.P)
    copy(ws.u_before, s.u)


@kernel
def mark(s: State, t: float, m: int, ws: Scratch) -> None:
    """Remember when each error row was last observed directly."""
    for i in range(m):
        for j in range(s.age.size):
            if ws.H[i, j] != 0.0:
                s.age[j] = t


@kernel
def reset_is_due(model: Model, sources: Sources, s: State, src: int, t: float) -> bool:
    """Whether a source that keeps disagreeing has earned the benefit of the doubt.

    It must be one that may reset, have disagreed for long enough and often enough with no record accepted from any
    other source that could reset the same rows, and lie no further away than the vehicle could have driven since.
    """
    count = sources.reset[src, 1]
    if count == 0 or s.health[src, H_BAD] < model.limits[3] or t - s.health[src, H_SINCE] < model.limits[2]:
        return False
    for other in range(sources.code.size):
        rival = other != src and sources.reset[other, 1] > 0 and sources.reset[other, 0] == sources.reset[src, 0]
        recent = t - s.health[other, H_LAST_GOOD] < model.limits[2] and s.health[other, H_STATE] != _FAULTED
        if rival and recent:
            return False
    distance2 = 0.0
    for i in range(count):
        distance2 += s.health[src, H_Y + i] ** 2
    reach = model.limits[5] + model.limits[4] * (t - s.health[src, H_LAST_GOOD])
    return distance2 <= reach * reach


@kernel
def widen(sources: Sources, s: State, src: int, m: int, ws: Scratch) -> None:
    """Open the covariance of the rows a reset may move by the innovation itself, and cut their correlations."""
    first, count = sources.reset[src, 0], sources.reset[src, 1]
    n = s.P.shape[0]
    for i in range(m):
        if ws.row[i] >= count:
            continue
        row = first + ws.row[i]
        for j in range(n):
            if j != row:
                s.P[row, j] = s.P[j, row] = 0.0
        s.P[row, row] += ws.y[i] * ws.y[i]
    s.clock[C_RESETS] += 1.0


@kernel
def healthy(s: State) -> bool:
    """Whether the estimate is finite and every variance is possible."""
    for i in range(s.P.shape[0]):
        if not 0.0 <= s.P[i, i] <= MOST_VARIANCE:  # nor is NaN
            return False
    return all_finite(s.x)
