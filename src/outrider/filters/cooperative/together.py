"""One filter for the whole team, with every cross-covariance: the reference, while the team is small."""

import numpy as np

from outrider._kernel import kernel
from outrider.core.linalg import mirror
from outrider.core.manifold import retract
from outrider.filters.cooperative.alone import LONGEST, measure
from outrider.filters.cooperative.meeting import relate
from outrider.filters.cooperative.tables import (
    DIVERGED,
    GATED,
    I_CODE,
    I_E,
    I_N,
    NOT_OBSERVING,
    USED,
    Beliefs,
    Scratch,
    Tables,
    blocks,
    errors,
    shaped,
    square,
    state,
)
from outrider.filters.ekf import innovate, transport
from outrider.filters.ekf import propagate as propagate_covariance
from outrider.models.motion import propagate
from outrider.typing import Floats


@kernel
def advance_all(t: Tables, b: Beliefs, ws: Scratch, now: float) -> None:
    """Predict everybody up to `now`."""
    while now > b.clock[0]:
        left = now - b.clock[0]
        dt = min(left, LONGEST)
        for i in range(t.index.shape[0]):
            F, Q, e = square(t, ws.F, i), square(t, ws.Q, i), t.index[i, I_E]
            propagate(t.index[i, I_CODE], state(t, b, i), dt, b.u[i], t.theta[i], F, Q)
            for r in range(t.index[i, I_N]):
                for c in range(t.index[i, I_N]):
                    ws.F_whole[e + r, e + c], ws.Q_whole[e + r, e + c] = F[r, c], Q[r, c]
            b.clock[i] = b.clock[i] + dt if left > LONGEST else now
        propagate_covariance(b.whole, ws.F_whole, ws.Q_whole, ws.w_whole)


@kernel
def absorb_all(t: Tables, b: Beliefs, ws: Scratch, src: int, z: Floats, r: Floats, out: Floats) -> None:
    """Fuse any record with the joint covariance.  out <- verdict, NIS, degrees of freedom."""
    i, j = t.member[src], t.partner[src]
    if j >= 0:
        n = t.index[i, I_N] + t.index[j, I_N]
        m, H = relate(t, b, ws, src, z, r), shaped(ws.H, ws.y.size, n)
    else:
        n = t.index[i, I_N]
        H = shaped(ws.H, ws.y.size, n)
        m = measure(t, b, ws, src, z, r, H)
    out[0], out[2] = NOT_OBSERVING, m
    if m == 0:
        return
    one, two = (i, -1) if j < 0 else (min(i, j), max(i, j))
    for k in range(m):
        for c in range(ws.H_whole.shape[1]):
            ws.H_whole[k, c] = 0.0
        for c in range(t.index[one, I_N]):
            ws.H_whole[k, t.index[one, I_E] + c] = H[k, c]
        if two >= 0:
            for c in range(t.index[two, I_N]):
                ws.H_whole[k, t.index[two, I_E] + c] = H[k, t.index[one, I_N] + c]
    nis = innovate(b.whole, ws.H_whole, ws.r, ws.y, m, ws.w_whole)
    out[1] = nis
    if not nis <= t.gate[src, m]:
        out[0] = GATED if np.isfinite(nis) else DIVERGED
        return
    out[0] = USED
    correct_all(t, b, ws)


@kernel
def correct_all(t: Tables, b: Beliefs, ws: Scratch) -> None:
    """The second half of an update, as `ekf.correct`: considered states keep value and variance."""
    M, dx = ws.w_whole.M, ws.w_whole.dx
    for r in range(t.keep.size):
        if t.keep[r] == 0.0:
            dx[r] = 0.0
            for c in range(t.keep.size):
                if t.keep[c] == 0.0:
                    M[r, c] = b.whole[r, c]
    mirror(M, b.whole)
    transport(b.whole, dx, t.rotations, False, ws.w_whole.J)
    for i in range(t.index.shape[0]):
        retract(state(t, b, i), errors(t, dx, i), blocks(t, i))
