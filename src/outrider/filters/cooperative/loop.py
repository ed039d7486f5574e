"""The compiled loop over a team's records in time order."""

from typing import NamedTuple

from outrider._kernel import kernel
from outrider.filters.cooperative.alone import absorb, advance
from outrider.filters.cooperative.intersection import intersect
from outrider.filters.cooperative.meeting import distributed, naive
from outrider.filters.cooperative.tables import (
    I_E,
    I_N,
    I_POSE,
    I_POSES,
    INPUT,
    NOT_ALIGNED,
    Beliefs,
    Scratch,
    Tables,
    square,
)
from outrider.filters.cooperative.together import absorb_all, advance_all
from outrider.typing import Floats, Ints

NAIVE, CI, JOINT, SPLIT_CI, DISTRIBUTED = range(5)  # the last two carry Psi from meeting to meeting


class Records(NamedTuple):
    """Everybody's records in time order."""

    t: Floats  # (n,) s
    source: Ints  # (n,)
    z: Floats  # (n, 8)
    r: Floats  # (n, 8) variances of the rows; infinite: not in use


class Estimates(NamedTuple):
    """What is kept of the estimates at the times t, each after the records of that time."""

    t: Floats  # (k,) s
    x: Floats  # (k, all states)
    variance: Floats  # (k, all errors)
    pose: Floats  # (k, members, POSES, POSES)


@kernel
def run(method: int, t: Tables, b: Beliefs, ws: Scratch, records: Records, estimates: Estimates, out: Floats) -> None:
    """Take all records.  out (n, 3): verdict, NIS, degrees of freedom."""
    k = 0
    for e in range(records.t.size):
        now, src = records.t[e], records.source[e]
        while k < estimates.t.size and estimates.t[k] < now:
            write(method, t, b, ws, estimates, k)
            k += 1
        if now < b.clock[t.member[src]]:
            out[e, 0] = NOT_ALIGNED
        elif t.code[src] < 0:
            drive(method, t, b, ws, src, now, records.z[e])
            out[e, 0] = INPUT
        elif method == JOINT:
            advance_all(t, b, ws, now)
            absorb_all(t, b, ws, src, records.z[e], records.r[e], out[e])
        else:
            carries = method >= SPLIT_CI
            advance(t, b, ws, t.member[src], now, carries)
            if t.partner[src] < 0:
                absorb(t, b, ws, src, records.z[e], records.r[e], carries, out[e])
            else:
                advance(t, b, ws, t.partner[src], now, carries)
                meet(method, t, b, ws, src, records.z[e], records.r[e], out[e])
    while k < estimates.t.size:
        write(method, t, b, ws, estimates, k)
        k += 1


@kernel
def meet(method: int, t: Tables, b: Beliefs, ws: Scratch, src: int, z: Floats, r: Floats, out: Floats) -> None:
    """A record of one robot about another."""
    if method == DISTRIBUTED:
        distributed(t, b, ws, src, z, r, out)
    elif method == NAIVE:
        naive(t, b, ws, src, z, r, out)
    else:
        intersect(t, b, ws, src, z, r, method == SPLIT_CI, out)


@kernel
def drive(method: int, t: Tables, b: Beliefs, ws: Scratch, src: int, now: float, z: Floats) -> None:
    """A record of what drives a prediction, an IMU: the mean of it and the last one holds in between."""
    i = t.member[src]
    for c in range(6):
        b.u[i, c] = 0.5 * (b.fed[i, c] + z[c])
    if method == JOINT:
        advance_all(t, b, ws, now)
    else:
        advance(t, b, ws, i, now, method >= SPLIT_CI)
    for c in range(6):
        b.fed[i, c] = b.u[i, c] = z[c]


@kernel
def write(method: int, t: Tables, b: Beliefs, ws: Scratch, estimates: Estimates, k: int) -> None:
    """Keep everybody's estimate at the time k."""
    if method == JOINT:
        advance_all(t, b, ws, estimates.t[k])
    for i in range(t.index.shape[0]):
        if method != JOINT:
            advance(t, b, ws, i, estimates.t[k], method >= SPLIT_CI)
        e, P = t.index[i, I_E], square(t, b.P, i)
        first = 0
        if method == JOINT:
            P, first = b.whole, e
        for c in range(t.index[i, I_N]):
            estimates.variance[k, e + c] = P[first + c, first + c]
        p = t.index[i, I_POSE]
        for c in range(t.index[i, I_POSES]):
            for d in range(t.index[i, I_POSES]):
                estimates.pose[k, i, c, d] = P[first + t.pose[p + c], first + t.pose[p + d]]
    for c in range(b.x.size):
        estimates.x[k, c] = b.x[c]
