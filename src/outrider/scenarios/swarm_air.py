"""What reaches whom of many drones, and how near they came in truth."""

from math import floor, hypot, inf, sqrt

from outrider._kernel import inlined, kernel
from outrider.models.vehicles.airborne import X_P, X_V
from outrider.scenarios.swarm_state import (
    H_DT,
    H_FORGET,
    H_JUDGED,
    H_LATE,
    H_LOSS,
    M_KNOWN,
    M_STAMP,
    Room,
    Swarm,
    World,
    to_wall,
)
from outrider.typing import Floats


@inlined
def dead(w: World, i: int, t: float) -> bool:
    """Whether the radio of a drone is."""
    out = False
    for k in range(w.silent.shape[1]):
        out = out or w.silent[i, k, 0] <= t < w.silent[i, k, 1]
    return out


@kernel
def hear(w: World, s: Swarm, r: Room, i: int, found: int, k: int, t: float, chance: Floats) -> None:
    """What reaches a drone now: of everybody in range one message, some steps old, unless it is lost."""
    slots = s.who.shape[1]
    for q in range(slots):
        if s.who[i, q] >= 0 and t - s.inbox[i, q, M_STAMP] > w.how[H_FORGET]:
            s.who[i, q] = -1
    if dead(w, i, t):
        return
    for m in range(found):
        late = 1 + floor(chance[m, 1] * w.how[H_LATE])
        if chance[m, 0] < w.how[H_LOSS] or late > k:
            continue
        j = r.ids[m]
        message = s.sent[(k - late) % s.sent.shape[0], j]
        if message[M_STAMP] == -inf:
            continue
        at, oldest = -1, inf
        for q in range(slots):
            if s.who[i, q] == j:
                at = q
                break
            stamp = s.inbox[i, q, M_STAMP] if s.who[i, q] >= 0 else -inf
            if stamp < oldest:
                at, oldest = q, stamp
        if s.who[i, at] == j and s.inbox[i, at, M_STAMP] >= message[M_STAMP]:
            continue
        s.who[i, at] = j
        for a in range(message.size):
            s.inbox[i, at, a] = message[a]
        for line in range(2):
            s.known[i, line] = max(s.known[i, line], int(message[M_KNOWN + line]))
        s.broken[2] += 1


@kernel
def judge(w: World, s: Swarm, r: Room, i: int, found: int, t: float) -> None:
    """How near a drone came in truth, between this step and the next if nobody changes its velocity."""
    nearest_now, dt = inf, w.how[H_DT]
    for m in range(found):
        j = r.ids[m]
        pp, pv, vv = 0.0, 0.0, 0.0
        for a in range(3):
            p, v = s.body[j, X_P + a] - s.body[i, X_P + a], s.body[j, X_V + a] - s.body[i, X_V + a]
            pp, pv, vv = pp + p * p, pv + p * v, vv + v * v
        tau = min(max(-pv / vv, 0.0), dt) if vv > 0.0 else 0.0
        nearest_now = min(nearest_now, pp + 2.0 * tau * pv + tau * tau * vv)
    d = sqrt(max(nearest_now, 0.0))
    if d < s.least[i]:
        s.least[i], s.when[i] = d, t
    if d < w.how[H_JUDGED]:
        s.broken[0] += 1
    for k in range(w.walls.shape[0]):
        x, y = to_wall(w.walls[k], s.body[i, X_P], s.body[i, X_P + 1])
        if hypot(x, y) < 0.5 * w.how[H_JUDGED]:
            s.broken[1] += 1
