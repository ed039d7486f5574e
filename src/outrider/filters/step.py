"""One event: predict to its time, form the innovation, gate it, correct or say why not.

Both drivers call `step`: the online one with one event at a time, the batch one from a compiled loop. All that an
event can change is in `State`, so a copy of it is a snapshot.
"""

from typing import Final

import numpy as np

from outrider._kernel import kernel
from outrider.core.linalg import all_finite, chain, copy
from outrider.data import Verdict
from outrider.filters.ekf import correct, innovate
from outrider.filters.ekf import propagate as propagate_covariance
from outrider.filters.health import H_BAD, H_LAST, H_LAST_GOOD, H_SINCE, H_STATE, H_Y, forgive, judge
from outrider.filters.state import C_EVENTS, C_INPUT, C_NEXT, C_NOW, C_RESETS, ROWS, Model, Scratch, Sources, State
from outrider.filters.state import restore as restore
from outrider.filters.state import scratch as scratch
from outrider.filters.state import snapshot as snapshot
from outrider.filters.state import state as state
from outrider.models.kinematics import T_SIZE
from outrider.models.motion import kinematic_view, propagate
from outrider.models.sensors.dispatch import evaluate
from outrider.typing import Floats

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


@kernel
def predict(model: Model, s: State, t: float, ws: Scratch) -> None:
    """Carry x and P to time t in steps no longer than the model allows. Time never runs backwards here."""
    longest = max(model.limits[0], (t - s.clock[C_NOW]) / MOST_STEPS)
    while t > s.clock[C_NOW]:
        dt = t - s.clock[C_NOW]
        last = dt <= longest
        if not last:
            dt = longest
        if blind(model, s):
            coast(model, s, ws)
            propagate(model.code, s.x, dt, s.u, model.coasting, ws.F, ws.Q)
        else:
            tune(model, s, s.clock[C_NOW] + 0.5 * dt)  # the mean of a straight line is its middle
            propagate(model.code, s.x, dt, s.u, model.theta, ws.F, ws.Q)
        propagate_covariance(s.P, ws.F, ws.Q, ws.w)
        s.clock[C_NOW] = t if last else s.clock[C_NOW] + dt
    if not blind(model, s):
        tune(model, s, s.clock[C_NOW])


@kernel
def blind(model: Model, s: State) -> bool:
    """Whether a model that needs the input has none: the last record is too old, or the first too far ahead."""
    now, first = s.clock[C_NOW], s.clock[C_INPUT] == -np.inf
    near = 0.0 <= s.clock[C_NEXT] - now <= model.limits[1] if first else now - s.clock[C_INPUT] <= model.limits[1]
    return model.code == 1 and not near


@kernel
def tune(model: Model, s: State, t: float) -> None:
    """s.u <- the input at time t: on the straight line from the last record to the next, or as the only one known.

    A line has no jumps: where between two records an update falls, or on which side of one, makes no difference.
    """
    start, end = s.clock[C_INPUT], s.clock[C_NEXT]
    if start == -np.inf:
        if end == -np.inf:
            return
        part = 1.0
    else:
        part = min((t - start) / (end - start), 1.0) if 0.0 < end - start <= model.limits[1] else 0.0
    for i in range(6):
        s.u[i] = s.fed[0, i] + part * (s.fed[1, i] - s.fed[0, i])


@kernel
def announce(s: State, t: float, z: Floats) -> None:
    """Tell the next record of the input before its time; t = -inf: none is known."""
    s.clock[C_NEXT] = t
    for i in range(6):
        s.fed[1, i] = z[i] if t > -np.inf else 0.0


@kernel
def coast(model: Model, s: State, ws: Scratch) -> None:
    """The input is missing: go on without turning and without accelerating, whatever the last record said."""
    kinematic_view(model.code, s.x, s.u, model.theta, ws.k, ws.K)
    for i in range(3):
        s.u[i] = ws.k[21 + i]
        s.u[3 + i] = ws.k[24 + i] + ws.k[3 + 6 + i] * model.coasting[12]  # bias + R' g


@kernel
def feed(model: Model, s: State, t: float, z: Floats, ws: Scratch) -> None:
    """A record of the input: the interval since the last one is crossed on the line between the two."""
    announce(s, t, z)
    predict(model, s, t, ws)
    for i in range(6):
        s.u[i] = s.fed[0, i] = z[i]
    s.clock[C_INPUT] = t
    announce(s, -np.inf, z)


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
        out[OUT_Y + ws.row[i]], out[OUT_S + ws.row[i]] = ws.y[i], np.sqrt(ws.w.s[i])
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
        correct(s.x, s.P, model.keep, model.table, ws.w)
        if healthy(s):
            mark(s, t, m, ws)
        else:
            undo(s, ws)
            out[OUT_VERDICT] = _DIVERGED


@kernel
def drive(model: Model, s: State, src: int, t: float, z: Floats, ws: Scratch) -> int:
    """A record of the input through `feed`, unless it would spoil the estimate: then it is as if it had not come."""
    if not plausible(z):
        return _IMPLAUSIBLE
    now, last = s.clock[C_NOW], s.clock[C_INPUT]
    copy(s.fed[0], ws.u_last)
    feed(model, s, t, z, ws)
    if not healthy(s):
        undo(s, ws)
        copy(ws.u_last, s.fed[0])
        s.clock[C_NOW], s.clock[C_INPUT] = now, last
        return _DIVERGED
    s.health[src, H_LAST] = s.health[src, H_LAST_GOOD] = t
    s.health[src, H_STATE] = 1.0
    return _INPUT


@kernel
def plausible(z: Floats) -> bool:
    """Whether a record of the input is one that a vehicle can feel."""
    for i in range(6):  # noqa: SIM110 - kernels know no generators
        if not abs(z[i]) <= MOST_INPUT:
            return False
    return True


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
